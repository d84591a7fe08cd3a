//! Stability margins of the steering loop, from the linear loop: tolerable additional gain, phase lag and dead time.
//!
//! On a straight road, with no bound active, the MPC is a linear feedback with a memory of its own commands,
//!
//! ```text
//! u_k = sum_i K_i x_{k-i} + sum_{i>=1} h_i u_{k-i}
//! ```
//!
//! because the rate of the command has a cost, and because a known actuator is run over the issued commands. `K` and
//! `h` are identified from the MPC itself, by unit states and unit commands. Behind it the vehicle and its actuator are
//! sampled exactly, `X_{k+1} = A X_k + G_1 u_{k-m} + G_2 u_{k-m-1}`. Broken at the command, the loop is
//!
//! ```text
//! L(z) = - K(z) P(z) / (1 - h(z)),      1 + L = 0 where a pole is,      z = e^{j w Ts},  w up to Nyquist's
//! ```
//!
//! and the margins of a stable loop lie where `L` passes -1. The gain margin is the factor `1/|L|` at a real, negative
//! `L`. The phase margin is the angle `arg L + pi` at `|L| = 1`, and the delay margin is that angle over `w`. The poles
//! decide on stability: the spectral radius of the closed loop, by Gelfand's formula `|A^n|^(1/n)`.
//!
//! An observer stands before the gains, with the steady gains `M` of its filter. It predicts with the MPC's own model and takes
//! part in the memory, `p` being the predicted state and `d` the disturbance:
//!
//! ```text
//! xhat_k = p_k + M_x (x_k - p_k),    d_k = d_{k-1} + M_d (x_k - p_k),    p_{k+1} = N xhat_k + G d_k + sum_{i>=0} n_i u_{k-i}
//! u_k = K_0 xhat_k + K_d d_k + ..
//! ```
//!
//! A learned forest is taken as its leaves at straight driving.
//!
//! Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, ch. 7 (sampled loops); Skogestad and
//! Postlethwaite, Multivariable Feedback Control, ch. 2.4 (margins).

use super::history::History;
use super::lateral::{LateralError, LateralInput, LateralMpc};
use super::observer::{Observer, ObserverNoise};
use super::parameters::{ControllerParametersFor, MpcParameters};
use super::preview::SpeedAhead;
use super::tracking_qp::QpError;
use super::variant::{ExpectedState, PredictionModelFor};
use super::vehicle::{Bound, ControlledParameters, FurtherState};
use crate::nominal::{ACTUATOR_STATES, ActuatedModel, Actuator, LateralVehicle, SingleTrackError};
use crate::path::{Closure, Path, PathError, Sample};
use nalgebra::{Complex, DMatrix, SMatrix, SVector};
use std::f64::consts::{PI, TAU};

/// Reasons for which there are no margins.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum MarginError {
    #[error(transparent)]
    Lateral(#[from] LateralError),
    #[error(transparent)]
    Vehicle(#[from] SingleTrackError),
    #[error("the MPC at {speed} m/s on a straight road: {error}")]
    NoPlan { speed: f64, error: QpError },
    #[error("a straight road: {0}")]
    Road(#[from] PathError),
}

/// The MPC at one speed as a linear feedback.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearController<const S: usize> {
    /// Speed, m/s.
    pub speed: f64,
    /// Time between steps, s.
    pub sample_time: f64,
    /// Gains on the states of this step, the one before, ..; only a learned residual has more than one.
    pub state: Vec<SVector<f64, S>>,
    /// Gains on the command before this step, the one before that, ..
    pub command: Vec<f64>,
    /// Constant continuation behind these.
    pub tail: Option<Tail>,
    /// The observer before these gains, if it is on.
    pub observer: Option<LinearObserver<S>>,
}

/// A steady observer, and the prediction that it compares with.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearObserver<const S: usize> {
    /// Gain of the estimated state on a deviation from the prediction.
    pub of_state: SMatrix<f64, S, S>,
    /// Gain of the disturbance on it.
    pub of_disturbance: SMatrix<f64, S, S>,
    /// Effect `G` of the disturbance in a step.
    pub effect: SMatrix<f64, S, S>,
    /// Gain of the command on the disturbance.
    pub by_disturbance: SVector<f64, S>,
    /// The next state by the state of this step, the one before, ..
    pub next_by_state: Vec<SMatrix<f64, S, S>>,
    /// The next state by the command of this step, the one before, ..
    pub next_by_command: Vec<SVector<f64, S>>,
}

/// Gains that fall by a ratio from command to command: the memory of a lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tail {
    /// Gain on the first command behind those that stand singly.
    pub first: f64,
    /// Ratio of a gain to the one before.
    pub ratio: f64,
}

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

/// Size of the states and commands that identify the MPC; it is linear, so the size does not matter.
const UNIT: f64 = 1e-2;
/// A bound that is never active.
const NEVER: f64 = 1e6;
/// Gains below this share of the largest are negligible.
const NEGLIGIBLE: f64 = 1e-8;
/// Steps after which an observer's covariances stand still.
const SETTLED: usize = 3000;
/// The plan with which a learned residual is asked is the plan itself after so many steps.
const PLAN_STEPS: usize = 4;
/// Frequencies of the grid.
const FREQUENCIES: usize = 1200;
/// The lowest of them, rad/s: a drive's slowest swing takes ten minutes.
const LOWEST: f64 = 1e-2;
/// Bisections of a crossing: to a double's accuracy of the step of the grid.
const BISECTIONS: usize = 44;
/// Bisections of a dead time by poles: to 10 ns.
const DEAD_TIME_BISECTIONS: usize = 20;

impl<const S: usize> LinearController<S> {
    /// The controller of these parameters that predicts with this model, at each of these speeds in m/s.
    ///
    /// # Errors
    /// Parameters that no MPC can be made of, or a model that does not fit.
    pub fn at_speeds<G: ControlledParameters<S>>(
        parameters: &ControllerParametersFor<G>,
        model: PredictionModelFor<G::Vehicle, S>,
        speeds: &[f64],
    ) -> Result<Vec<Self>, MarginError> {
        let looks_back = matches!(model, PredictionModelFor::Residual(_));
        let mpc = MpcParameters {
            steer_max: NEVER,
            steer_rate_max: NEVER,
            lateral_jerk_max: NEVER * NEVER,
            e1_max: NEVER,
            dither: 0.0,
            // On a straight road there is nothing to follow, and a residual is looked at alone.
            follow_road: if looks_back { 0 } else { parameters.mpc.follow_road },
            ..parameters.mpc
        };
        let unbounded = |state: FurtherState| FurtherState {
            bound: state.bound.map(|bound| Bound { max: NEVER, ..bound }),
            ..state
        };
        let further: Vec<_> = parameters.vehicle.further_states().into_iter().map(unbounded).collect();
        let lateral = LateralMpc::new(parameters.vehicle.nominal(), mpc, &further, model)?;
        let road = [0.0, 25.0, 50.0, 75.0, 100.0].map(|x| Sample::at(x, 0.0));
        let road = Path::from_samples(road.to_vec(), Closure::Open)?;
        let observer = parameters.observer.is_on().then(|| {
            let further = parameters.vehicle.further_states();
            ObserverNoise::new(&parameters.observer, &further, mpc.sample_time)
        });
        let mut asked = Asked { lateral, road, sample_time: mpc.sample_time, observer };
        speeds.iter().map(|&speed| asked.at(speed, looks_back)).collect()
    }

    /// `K(z)` applied to a state, and `h(z)`.
    fn response(&self, z_inverse: Complex<f64>, state: &[Complex<f64>; S]) -> [Complex<f64>; 2] {
        let zero = Complex::new(0.0, 0.0);
        // What is behind a gain of this step: Horner, from the oldest.
        let mut by_state = zero;
        for gain in self.state.iter().skip(1).rev() {
            by_state = (by_state + applied(gain, state)) * z_inverse;
        }
        let mut by_command = self.tail.map_or(zero, |tail| (1.0 - z_inverse * tail.ratio).inv() * tail.first);
        for gain in self.command.iter().rev() {
            by_command = by_command * z_inverse + gain;
        }
        by_command *= z_inverse;
        let Some(observer) = &self.observer else {
            return [by_state + applied(&self.state[0], state), by_command];
        };
        let [by_seen, by_issued] = observer.response(z_inverse, state, &self.state[0]);
        [by_state + by_seen, by_command + by_issued]
    }
}

/// A gain applied to a state.
fn applied<const S: usize>(gain: &SVector<f64, S>, state: &[Complex<f64>; S]) -> Complex<f64> {
    gain.iter().zip(state).map(|(gain, state)| state * *gain).sum()
}

impl<const S: usize> LinearObserver<S> {
    /// `u` by way of the estimate: of a measured state, and of a command of 1.
    fn response(
        &self,
        z_inverse: Complex<f64>,
        measured: &[Complex<f64>; S],
        gain: &SVector<f64, S>,
    ) -> [Complex<f64>; 2] {
        let complex = |value: f64| Complex::new(value, 0.0);
        let z = z_inverse.inv();
        // The disturbance sums the deviations x - p: d = M_d (x - p) z / (z - 1).
        let disturbance = self.of_disturbance.map(complex) * (1.0 - z_inverse).inv();
        let next = self.next_by_state[0].map(complex);
        let estimate = self.of_state.map(complex);
        let measured = SVector::from(*measured);
        // (z - N (I - M_x) + G M_d z / (z - 1)) p = (N M_x + G M_d z / (z - 1)) x + older states, or commands
        let by_deviation = next * estimate + self.effect.map(complex) * disturbance;
        let mut drive = by_deviation * measured;
        let mut delay = complex(1.0);
        for older in self.next_by_state.iter().skip(1) {
            delay *= z_inverse;
            drive += older.map(complex) * measured * delay;
        }
        let mut issued = SVector::zeros();
        let mut delay = complex(1.0);
        for gain in &self.next_by_command {
            issued += gain.map(complex) * delay;
            delay *= z_inverse;
        }
        let a = next - by_deviation;
        let predicted = |drive: SVector<Complex<f64>, S>| {
            SVector::from(solve_shifted::<S>(z, |i, j| a[(i, j)], drive.into()))
        };
        let command = |predicted: SVector<Complex<f64>, S>, measured: SVector<Complex<f64>, S>| {
            let deviation = measured - predicted;
            let state = predicted + estimate * deviation;
            (gain.map(complex).transpose() * state)[0]
                + (self.by_disturbance.map(complex).transpose() * disturbance * deviation)[0]
        };
        [command(predicted(drive), measured), command(predicted(issued), SVector::zeros())]
    }

    /// Writes the rows of `p` and `d` into the closed loop; `command` is the command as a row, and the places are those of the
    /// commands before, of the states before, and of `p` and `d`.
    fn close(
        &self,
        closed: &mut DMatrix<f64>,
        command: &[f64],
        commands: usize,
        states: usize,
        [predicted, disturbance]: [usize; 2],
    ) {
        let by_deviation = self.next_by_state[0] * self.of_state + self.effect * self.of_disturbance;
        // A disturbance that nothing moves is no pole of the loop.
        let moved =
            SMatrix::from_fn(|i, j| f64::from(u8::from(i == j && self.of_disturbance.row(i).amax() > 0.0)));
        let mut write = |row: usize, column: usize, block: &SMatrix<f64, S, S>| {
            closed.view_mut((row, column), (S, S)).copy_from(block);
        };
        write(predicted, 0, &by_deviation);
        write(predicted, predicted, &(self.next_by_state[0] - by_deviation));
        write(predicted, disturbance, &self.effect);
        for (back, block) in self.next_by_state.iter().enumerate().skip(1) {
            write(predicted, states + S * (back - 1), block);
        }
        write(disturbance, 0, &self.of_disturbance);
        write(disturbance, predicted, &-self.of_disturbance);
        write(disturbance, disturbance, &moved);
        for i in 0..S {
            for (back, gain) in self.next_by_command.iter().enumerate().skip(1) {
                closed[(predicted + i, commands + back - 1)] += gain[i];
            }
            for (column, value) in command.iter().enumerate() {
                closed[(predicted + i, column)] += self.next_by_command[0][i] * value;
            }
        }
    }
}

/// An MPC without active bounds on a straight road.
struct Asked<const S: usize> {
    lateral: LateralMpc<S>,
    road: Path,
    sample_time: f64,
    observer: Option<ObserverNoise<S>>,
}

/// Answer of the MPC in a situation: its command, and the state that it expects after a given one.
type LinearAnswer<const S: usize> = (f64, Option<ExpectedState<S>>);

impl<const S: usize> Asked<S> {
    fn at(&mut self, speed: f64, looks_back: bool) -> Result<LinearController<S>, MarginError> {
        let window = self.lateral.window();
        let states = if looks_back { window.max(1) } else { 1 };
        let commands = window.saturating_sub(1).max(1);
        let zero = vec![SVector::zeros(); states];
        let still = vec![0.0; commands];
        let nothing = SVector::zeros();
        let rest = self.answer(speed, &zero, &still, &nothing, 0.0)?;
        let next_from_rest = |next: &LinearAnswer<S>| match (next.1, rest.1) {
            (Some(next), Some(rest)) => (next.state - rest.state) / UNIT,
            _ => SVector::zeros(),
        };
        let mut state = Vec::with_capacity(states);
        let mut next_by_state = Vec::with_capacity(states);
        for back in 0..states {
            let mut gain = SVector::zeros();
            let mut next = SMatrix::<f64, S, S>::zeros();
            for i in 0..S {
                let mut asked = zero.clone();
                asked[back][i] = UNIT;
                let answer = self.answer(speed, &asked, &still, &nothing, 0.0)?;
                gain[i] = (answer.0 - rest.0) / UNIT;
                next.set_column(i, &next_from_rest(&answer));
            }
            state.push(gain);
            next_by_state.push(next);
        }
        let mut next_by_command = vec![next_from_rest(&self.answer(speed, &zero, &still, &nothing, UNIT)?)];
        let mut command = Vec::with_capacity(commands);
        for back in 0..commands {
            let mut asked = still.clone();
            asked[back] = UNIT;
            let answer = self.answer(speed, &zero, &asked, &nothing, 0.0)?;
            command.push((answer.0 - rest.0) / UNIT);
            next_by_command.push(next_from_rest(&answer));
        }
        if let (Some(noise), Some(expected)) = (self.observer.clone(), rest.1) {
            let [of_state, of_disturbance] = steady_gains(&noise, speed, &expected.transition);
            let effect = *noise.effect();
            let mut by_disturbance = SVector::zeros();
            for i in 0..S {
                let unit = effect.column(i) * UNIT;
                by_disturbance[i] = (self.answer(speed, &zero, &still, &unit, 0.0)?.0 - rest.0) / UNIT;
            }
            let observer = Some(LinearObserver {
                of_state,
                of_disturbance,
                effect,
                by_disturbance,
                next_by_state,
                next_by_command,
            });
            let sample_time = self.sample_time;
            return Ok(LinearController { speed, sample_time, state, command, tail: None, observer });
        }
        let size = state.iter().map(SVector::amax).fold(0.0, f64::max);
        while state.len() > 1
            && state.last().is_some_and(|gain: &SVector<f64, S>| gain.amax() <= NEGLIGIBLE * size)
        {
            state.pop();
        }
        let tail = cut_tail(&mut command);
        Ok(LinearController { speed, sample_time: self.sample_time, state, command, tail, observer: None })
    }

    /// The answer to a situation, states and commands newest first, and to the disturbance's effect in a step; `steer` is
    /// the command that the next state is expected with.
    fn answer(
        &mut self,
        speed: f64,
        states: &[SVector<f64, S>],
        commands: &[f64],
        disturbance: &SVector<f64, S>,
        steer: f64,
    ) -> Result<LinearAnswer<S>, MarginError> {
        let window = self.lateral.window();
        let mut history = History::new(window);
        for back in (0..window).rev() {
            let state = states.get(back).copied().unwrap_or_else(SVector::zeros);
            history.observe(&state, commands.get(back).copied().unwrap_or(0.0));
        }
        let mut plan = Vec::new();
        for _ in 0..if states.len() > 1 { PLAN_STEPS } else { 1 } {
            let input = LateralInput {
                state: &states[0],
                vy: states[0][1] - speed * states[0][2],
                yaw_rate: states[0][3],
                history: &history,
                last_plan: &plan,
                station: 0.0,
                ahead: SpeedAhead { speed, accel: 0.0, predicted: &[] },
                previous: commands[0],
                path: &self.road,
                disturbance,
                residual_share: 1.0,
                time_limit: f64::INFINITY,
                actuator: None,
                tightness: 0.0,
            };
            self.lateral.step(&input).map_err(|error| MarginError::NoPlan { speed, error })?;
            plan.clear();
            plan.extend_from_slice(self.lateral.plan());
        }
        Ok((plan[0], self.lateral.next_state(&states[0], history.commands(), steer)))
    }
}

/// Gains of the observer's state and of its disturbance on a deviation, once its covariances stand still.
fn steady_gains<const S: usize>(
    noise: &ObserverNoise<S>,
    speed: f64,
    transition: &SMatrix<f64, S, S>,
) -> [SMatrix<f64, S, S>; 2] {
    let mut observer = Observer::default();
    let expected = ExpectedState { state: SVector::zeros(), transition: *transition };
    for _ in 0..SETTLED {
        observer.observe(&SVector::zeros(), speed, noise);
        observer.expect(expected);
    }
    let mut gains = [SMatrix::<f64, S, S>::zeros(); 2];
    for i in 0..S {
        let mut asked = observer.clone();
        let unit = SVector::from_fn(|j, _| if i == j { UNIT } else { 0.0 });
        gains[0].set_column(i, &(asked.observe(&unit, speed, noise) / UNIT));
        gains[1].set_column(i, &(asked.accelerations() / UNIT));
    }
    gains
}

/// Cuts gains that fall by one ratio to the end off the end. The last of them stands for all before it, so it is not
/// compared.
fn cut_tail(gains: &mut Vec<f64>) -> Option<Tail> {
    let size = gains.iter().fold(0.0, |size: f64, gain| size.max(gain.abs()));
    let same = |i: usize, ratio: f64| (gains[i + 1] - ratio * gains[i]).abs() <= NEGLIGIBLE * size;
    let last = gains.len().checked_sub(2)?;
    let begins = (0..last).find(|&begin| {
        let ratio = gains[begin + 1] / gains[begin];
        last - begin >= 8 && ratio.abs() < 1.0 && (begin..last).all(|i| same(i, ratio))
    })?;
    let tail = Tail { first: gains[begins], ratio: gains[begins + 1] / gains[begins] };
    gains.truncate(begins);
    Some(tail)
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

/// `(z - A)^-1 b` by elimination with pivoting.
fn resolve<const N: usize>(
    z: Complex<f64>,
    a: impl Fn(usize, usize) -> f64,
    b: [Complex<f64>; N],
) -> [Complex<f64>; N] {
    solve_shifted(z, |i, j| a(i, j).into(), b)
}

/// The same with a complex `A`.
fn solve_shifted<const N: usize>(
    z: Complex<f64>,
    a: impl Fn(usize, usize) -> Complex<f64>,
    mut b: [Complex<f64>; N],
) -> [Complex<f64>; N] {
    let mut m: [[Complex<f64>; N]; N] =
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { z - a(i, j) } else { -a(i, j) }));
    for k in 0..N {
        let pivot =
            (k..N).fold(k, |best, i| if m[i][k].norm_sqr() > m[best][k].norm_sqr() { i } else { best });
        m.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..N {
            let factor = m[i][k] / m[k][k];
            let above = m[k];
            for (entry, above) in m[i].iter_mut().zip(above).skip(k) {
                *entry -= factor * above;
            }
            let above = b[k];
            b[i] -= factor * above;
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            let behind = b[j];
            b[k] -= m[k][j] * behind;
        }
        b[k] /= m[k][k];
    }
    b
}

/// Magnitude of a matrix's largest eigenvalue: `|A^n|^(1/n)` for `n = 2^48`, the powers by squaring. Unlike iterations
/// for eigenvalues it always comes to an end, also for the shifts of a memory, which are far from normal.
#[must_use]
fn spectral_radius(mut power: DMatrix<f64>) -> f64 {
    let mut logarithm = 0.0;
    let mut share = 1.0;
    for _ in 0..48 {
        let size = power.norm();
        if size == 0.0 {
            return 0.0;
        }
        logarithm += share * size.ln();
        share *= 0.5;
        power /= size;
        power = &power * &power;
    }
    logarithm.exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn the_spectral_radius_of_known_matrices() {
        let rotation = dmatrix![0.6, -0.7; 0.7, 0.6];
        assert!((spectral_radius(rotation) - 0.85_f64.sqrt()).abs() < 1e-12);
        // A Jordan block, and a memory alone.
        assert!((spectral_radius(dmatrix![0.9, 1.0; 0.0, 0.9]) - 0.9).abs() < 1e-12);
        assert_eq!(spectral_radius(dmatrix![0.0, 0.0; 1.0, 0.0]), 0.0);
        assert!((spectral_radius(dmatrix![1.2, 5.0; 0.0, 0.3]) - 1.2).abs() < 1e-12);
    }

    #[test]
    fn a_tail_is_cut_where_it_begins() {
        let mut gains: Vec<f64> =
            [0.7, -0.2].into_iter().chain((0..30).map(|i| 0.5 * 0.8_f64.powi(i))).collect();
        // What was before the oldest.
        gains.push(1e-3);
        let tail = cut_tail(&mut gains).unwrap();
        assert_eq!(gains, [0.7, -0.2]);
        assert!((tail.first - 0.5).abs() < 1e-15 && (tail.ratio - 0.8).abs() < 1e-12);
        assert_eq!(cut_tail(&mut vec![0.4]), None);
        assert_eq!(cut_tail(&mut vec![0.4, 0.1, 0.3, 0.7, -0.2, 0.0, 0.1, 0.2, 0.3, 0.5, 0.2]), None);
    }
}
