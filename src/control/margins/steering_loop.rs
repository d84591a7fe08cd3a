//! The steering loop at one speed: response, poles and margins.

use super::MarginError;
use super::complex::{resolve, spectral_radius};
use super::linear_controller::LinearController;
use crate::nominal::{ACTUATOR_STATES, ActuatedModel, Actuator, LateralVehicle};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::{PI, TAU};

/// Frequencies of the grid.
const FREQUENCIES: usize = 1200;
/// The lowest of them, rad/s: a drive's slowest swing takes ten minutes.
const LOWEST: f64 = 1e-2;
/// Bisections of a crossing: to a double's accuracy of the step of the grid.
const BISECTIONS: usize = 44;
/// Bisections of a dead time by poles: to 10 ns.
const DEAD_TIME_BISECTIONS: usize = 20;

/// The steering loop at one speed: the controller with a vehicle and its actuator.
#[derive(Debug, Clone)]
pub struct SteeringLoop<V, const S: usize> {
    controller: LinearController<S>,
    vehicle: V,
    actuator: Actuator,
    /// Speed of the vehicle's model, m/s.
    model_speed: f64,
    plant: ActuatedModel<S>,
}

/// Margins of a stable loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margins {
    /// Factor on the loop's gain that destabilises it, above 1; infinite if none does.
    pub gain: f64,
    /// Factor on the loop's gain that destabilises it, below 1; 0 if none does.
    pub gain_down: f64,
    /// Least phase lag that destabilises it, rad; infinite if the gain never is 1.
    pub phase: f64,
    /// Least additional dead time that destabilises it, s; infinite if the gain never is 1. Exact for whole steps.
    /// Between them accurate to a fraction of one, for a command that changes within a step is no pure lag of the
    /// phase.
    pub delay: f64,
    /// Frequency of that crossover, rad/s.
    pub crossover: f64,
    /// Largest `|1/(1 + L)|`: the inverse of the distance from -1.
    pub sensitivity: f64,
}

impl<V: LateralVehicle<S>, const S: usize> SteeringLoop<V, S> {
    /// The loop of a controller with a vehicle behind an actuator; below `min_model_speed` in m/s the vehicle's model is
    /// held, as the controller's is.
    ///
    /// # Errors
    /// A vehicle with a parameter that is not positive.
    pub fn new(
        controller: LinearController<S>,
        vehicle: V,
        actuator: Actuator,
        min_model_speed: f64,
    ) -> Result<Self, MarginError> {
        let model_speed = controller.speed.max(min_model_speed);
        let model = vehicle.model_at(model_speed)?;
        let plant = actuator.discretise(&model, controller.sample_time);
        Ok(Self { controller, vehicle, actuator, model_speed, plant })
    }

    /// The same loop with so much more dead time, s.
    ///
    /// # Errors
    /// A vehicle with a parameter that is not positive.
    pub fn delayed(&self, dead_time: f64) -> Result<Self, MarginError> {
        let actuator = Actuator { dead_time: self.actuator.dead_time + dead_time, ..self.actuator };
        Self::new(self.controller.clone(), self.vehicle, actuator, self.model_speed)
    }

    /// The same loop with the vehicle's response to steering multiplied by a factor.
    #[must_use]
    pub fn amplified(&self, factor: f64) -> Self {
        let mut amplified = self.clone();
        amplified.plant.newer = self.plant.newer * factor;
        amplified.plant.older = self.plant.older * factor;
        amplified
    }

    /// The controller.
    #[must_use]
    pub fn controller(&self) -> &LinearController<S> {
        &self.controller
    }

    /// `L` at a frequency in rad/s.
    #[must_use]
    pub fn response(&self, frequency: f64) -> Complex<f64> {
        let z = Complex::from_polar(1.0, frequency * self.controller.sample_time);
        let z_inverse = z.conj();
        let plant = &self.plant;
        let [newer, older] = [z_inverse.powi(plant.delay as i32), z_inverse.powi(plant.delay as i32 + 1)];
        let input = |newer_effect: f64, older_effect: f64| newer * newer_effect + older * older_effect;
        let actuator = resolve::<ACTUATOR_STATES>(
            z,
            |i, j| plant.a.actuator[(i, j)],
            std::array::from_fn(|i| input(plant.newer.actuator[i], plant.older.actuator[i])),
        );
        let drive = std::array::from_fn(|i| {
            let mut sum = input(plant.newer.vehicle[i], plant.older.vehicle[i]);
            for (j, state) in actuator.iter().enumerate() {
                sum += state * plant.a.by_actuator[(i, j)];
            }
            sum
        });
        let state = resolve::<S>(z, |i, j| plant.a.vehicle[(i, j)], drive);
        let [by_state, by_command] = self.controller.response(z_inverse, &state);
        -by_state / (1.0 - by_command)
    }

    /// The closed loop from step to step: `[X, commands before, tail, states before, p, d]`.
    #[must_use]
    pub fn closed(&self) -> DMatrix<f64> {
        let (plant, controller) = (&self.plant, &self.controller);
        let singly = controller.command.len();
        let commands = singly.max(plant.delay + 1);
        // The tail's filter holds what the commands behind the single ones weigh: its input is the last of them.
        let begin = S + ACTUATOR_STATES;
        let tail = begin + commands;
        let states = tail + 1;
        let predicted = states + S * (controller.state.len() - 1);
        let disturbance = predicted + S;
        let size = predicted + if controller.observer.is_some() { 2 * S } else { 0 };
        let mut closed = DMatrix::zeros(size, size);
        // The command as a row.
        let mut command = vec![0.0; size];
        for (back, gain) in controller.state.iter().enumerate() {
            let place = if back == 0 { 0 } else { states + S * (back - 1) };
            command[place..place + S].copy_from_slice(gain.as_slice());
        }
        if let Some(observer) = &controller.observer {
            // K_0 xhat + K_d d
            let gain = controller.state[0].transpose();
            let by_deviation =
                gain * observer.of_state + observer.by_disturbance.transpose() * observer.of_disturbance;
            command[..S].copy_from_slice(by_deviation.as_slice());
            command[predicted..disturbance].copy_from_slice((gain - by_deviation).as_slice());
            command[disturbance..].copy_from_slice(observer.by_disturbance.as_slice());
        }
        command[begin..begin + singly].copy_from_slice(&controller.command);
        command[tail] = controller.tail.map_or(0.0, |tail| tail.first);
        // u_{k-i} as a row: i = 0 the command itself.
        let back = |i: usize| -> Vec<f64> {
            if i == 0 {
                return command.clone();
            }
            let mut row = vec![0.0; size];
            row[begin + i - 1] = 1.0;
            row
        };
        let [newer, older] = [back(plant.delay), back(plant.delay + 1)];
        for column in 0..size {
            for i in 0..S {
                closed[(i, column)] =
                    plant.newer.vehicle[i] * newer[column] + plant.older.vehicle[i] * older[column];
            }
            for i in 0..ACTUATOR_STATES {
                closed[(S + i, column)] =
                    plant.newer.actuator[i] * newer[column] + plant.older.actuator[i] * older[column];
            }
            closed[(begin, column)] = command[column];
            closed[(tail, column)] = back(singly)[column];
        }
        for i in 0..S {
            for j in 0..S {
                closed[(i, j)] += plant.a.vehicle[(i, j)];
            }
            for j in 0..ACTUATOR_STATES {
                closed[(i, S + j)] += plant.a.by_actuator[(i, j)];
            }
        }
        for i in 0..ACTUATOR_STATES {
            // A state that the actuator does not have stays as it is, which is no pole of the loop.
            let has = (0..size).any(|column| closed[(S + i, column)] != 0.0)
                || (0..ACTUATOR_STATES).any(|j| j != i && plant.a.actuator[(i, j)] != 0.0);
            for j in (0..ACTUATOR_STATES).filter(|_| has) {
                closed[(S + i, S + j)] += plant.a.actuator[(i, j)];
            }
        }
        for i in 1..commands {
            closed[(begin + i, begin + i - 1)] = 1.0;
        }
        closed[(tail, tail)] += controller.tail.map_or(0.0, |tail| tail.ratio);
        for back in 1..controller.state.len() {
            for i in 0..S {
                let from = if back == 1 { 0 } else { states + S * (back - 2) };
                closed[(states + S * (back - 1) + i, from + i)] = 1.0;
            }
        }
        if let Some(observer) = &controller.observer {
            observer.close(&mut closed, &command, begin, states, [predicted, disturbance]);
        }
        closed
    }

    /// Magnitude of the closed loop's largest pole: stable below 1.
    #[must_use]
    pub fn spectral_radius(&self) -> f64 {
        spectral_radius(self.closed())
    }

    /// The margins; none of a loop that is not stable.
    #[must_use]
    pub fn margins(&self) -> Option<Margins> {
        if self.spectral_radius() >= 1.0 {
            return None;
        }
        let nyquist = PI / self.controller.sample_time;
        let ratio = (nyquist / LOWEST).powf(1.0 / (FREQUENCIES - 1) as f64);
        let mut margins = Margins {
            gain: f64::INFINITY,
            gain_down: 0.0,
            phase: f64::INFINITY,
            delay: f64::INFINITY,
            crossover: f64::INFINITY,
            sensitivity: 0.0,
        };
        let mut before = (LOWEST, self.response(LOWEST));
        margins.meet_sensitivity(before.1);
        for k in 1..FREQUENCIES {
            let last = k == FREQUENCIES - 1;
            let frequency = if last { nyquist } else { LOWEST * ratio.powi(k as i32) };
            let here = (frequency, self.response(frequency));
            margins.meet_sensitivity(here.1);
            let crossing = |value: fn(Complex<f64>) -> f64| self.crossing(before, here, value);
            if let Some((frequency, response)) = crossing(|l| l.norm() - 1.0) {
                margins.meet_unit_gain(frequency, response);
            }
            // At Nyquist's frequency L is real.
            match crossing(|l| l.im) {
                Some((_, response)) => margins.meet_real(response),
                None if last => margins.meet_real(here.1),
                None => (),
            }
            before = here;
        }
        Some(margins)
    }

    /// Sign change of a value between two frequencies.
    fn crossing(
        &self,
        mut low: (f64, Complex<f64>),
        mut high: (f64, Complex<f64>),
        value: fn(Complex<f64>) -> f64,
    ) -> Option<(f64, Complex<f64>)> {
        let sign = value(low.1) > 0.0;
        if (value(high.1) > 0.0) == sign {
            return None;
        }
        for _ in 0..BISECTIONS {
            let frequency = 0.5 * (low.0 + high.0);
            let middle = (frequency, self.response(frequency));
            if (value(middle.1) > 0.0) == sign { low = middle } else { high = middle }
        }
        Some(low)
    }

    /// Least additional dead time up to `limit` at which the closed loop's poles are unstable, s; none if all are
    /// stable. Slower than [`Self::margins`], and exact for a dead time that is no whole number of steps.
    ///
    /// # Errors
    /// A vehicle with a parameter that is not positive.
    pub fn dead_time_to_instability(&self, limit: f64) -> Result<Option<f64>, MarginError> {
        let unstable = |dead_time: f64| Ok(self.delayed(dead_time)?.spectral_radius() >= 1.0);
        first_failure(limit, self.controller.sample_time / 2.0, unstable)
    }
}

/// The first value up to a limit at which something fails, found in steps and then by bisection.
fn first_failure(
    limit: f64,
    step: f64,
    fails: impl Fn(f64) -> Result<bool, MarginError>,
) -> Result<Option<f64>, MarginError> {
    let mut low = 0.0;
    let mut high = 0.0;
    while !fails(high)? {
        if high >= limit {
            return Ok(None);
        }
        low = high;
        high = (high + step).min(limit);
    }
    for _ in 0..DEAD_TIME_BISECTIONS {
        let middle = 0.5 * (low + high);
        if fails(middle)? { high = middle } else { low = middle }
    }
    Ok(Some(high))
}

impl Margins {
    fn meet_sensitivity(&mut self, response: Complex<f64>) {
        self.sensitivity = self.sensitivity.max((response + 1.0).norm().recip());
    }

    fn meet_unit_gain(&mut self, frequency: f64, response: Complex<f64>) {
        let lag = (-response).arg().rem_euclid(TAU);
        self.phase = self.phase.min(lag.min(TAU - lag));
        if lag / frequency < self.delay {
            (self.delay, self.crossover) = (lag / frequency, frequency);
        }
    }

    fn meet_real(&mut self, response: Complex<f64>) {
        let factor = -response.re.recip();
        if factor > 1.0 {
            self.gain = self.gain.min(factor);
        } else if factor > 0.0 {
            self.gain_down = self.gain_down.max(factor);
        }
    }

    /// Each margin of the worse of two loops.
    #[must_use]
    pub fn worse(self, other: Self) -> Self {
        let later = self.delay <= other.delay;
        Self {
            gain: self.gain.min(other.gain),
            gain_down: self.gain_down.max(other.gain_down),
            phase: self.phase.min(other.phase),
            delay: self.delay.min(other.delay),
            crossover: if later { self.crossover } else { other.crossover },
            sensitivity: self.sensitivity.max(other.sensitivity),
        }
    }
}
