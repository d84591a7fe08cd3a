//! A linear vehicle model behind its steering actuator: the dynamics between command and road wheels.
//!
//! Every actuator here has one form,
//!
//! ```text
//! delta = c' z + d u(t - T),    z' = A_z z + b u(t - T)
//! ```
//!
//! with a dead time `T` and states `z` from at most a Pade approximant and a lag behind it:
//!
//! ```text
//! lag            tau delta' = w - delta                                          delta = w if tau = 0
//! Pade(1,1)      z' = -2/T z + 4/T u,                                  w = z - u
//! Pade(2,2)      p1' = p2/T,  p2' = 12/T (u - p1 - p2/2),              w = u - p2
//! exact          w = u(t - T)
//! ```
//!
//! (Pade(2,2) is `z1' = z2, z2' = -12/T^2 z1 - 6/T z2 + u, w = u - 12/T z2` with states of the command's size.) A Pade
//! approximant passes part of the command on at once, the wrong way for an odd order. A lag behind it makes it strictly
//! proper. Before the vehicle `x' = A x + B delta + ..` the state is `X = [x; z]`, sampled exactly. Within a step the
//! delayed command changes once, as `T` is not a whole number of steps:
//!
//! ```text
//! X_{k+1} = A X_k + G_1 u_{k-m} + G_2 u_{k-m-1} + D psi_des' + E psi_des'',     m = floor(T / Ts)
//! ```
//!
//! `z` is not measured: it follows from the issued commands. With the vehicle's true constants the exact actuator is
//! the oracle that a learned residual is measured against. With identified ones it is an engineer's remedy for a known
//! delay.
//!
//! Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, ch. 4.3.4 (dead time that is no whole
//! number of samples); Golub and Van Loan, Matrix Computations, ch. 9.3.1 (Pade approximants).

use super::{Chain, ContinuousErrorModel, ERRORS, zero_order_hold};
use crate::enumeration;
use nalgebra::{Matrix3, RowVector3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};
use std::ops::{Add, AddAssign, Mul, Sub};

enumeration! {
    /// Representation of a dead time by a model.
    pub enum DeadTimeModel {
        Exact = 0 "exact", "As it is: whole steps and a fraction of one";
        Pade11 = 1 "pade_1_1", "Pade approximant of order (1, 1)";
        Pade22 = 2 "pade_2_2", "Pade approximant of order (2, 2)";
        FirstOrder = 3 "first_order", "Not at all: a first-order inertia, whose time constant makes up for it";
    }
}

/// A steering actuator as a model has it: dead time, then a first-order lag. With its dead time left out it is the
/// first-order inertia; without either it is none.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Actuator {
    /// Dead time, s.
    pub dead_time: f64,
    /// Time constant of the first-order lag, s; 0 for none.
    pub time_constant: f64,
    /// Representation of the dead time.
    pub dead_time_model: DeadTimeModel,
}

/// States of an actuator: two of a Pade approximant, one of the lag. Those that an actuator does not have stay 0.
pub const ACTUATOR_STATES: usize = 3;

/// Lag or approximated dead time below which there is none, s: its pole would only make the model stiff.
const NO_LAG: f64 = 1e-4;
/// Number of time constants after which a command counts as settled: e^-10 of it is left.
const SETTLED: f64 = 10.0;

/// The linear part of an actuator: everything but an exact dead time.
#[derive(Debug, Clone, Copy)]
struct LinearPart {
    a: Matrix3<f64>,
    b: Vector3<f64>,
    c: RowVector3<f64>,
    d: f64,
    /// State under a constant command of 1.
    steady: Vector3<f64>,
}

/// An actuator sampled.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledActuator {
    a: Matrix3<f64>,
    newer: Vector3<f64>,
    older: Vector3<f64>,
    c: RowVector3<f64>,
    d: f64,
    steady: Vector3<f64>,
    delay: usize,
}

/// The vehicle's state and the actuator's.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct ActuatedState<const S: usize = ERRORS> {
    pub vehicle: SVector<f64, S>,
    pub actuator: Vector3<f64>,
}

/// Action of a state with its actuator on the next one: `A` in blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatedTransition<const S: usize = ERRORS> {
    /// Of the vehicle's state on itself.
    pub vehicle: SMatrix<f64, S, S>,
    /// Of the actuator's state on the vehicle's.
    pub by_actuator: SMatrix<f64, S, ACTUATOR_STATES>,
    /// Of the actuator's state on itself.
    pub actuator: Matrix3<f64>,
}

/// A vehicle model behind an actuator, sampled.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct ActuatedModel<const S: usize = ERRORS> {
    pub a: ActuatedTransition<S>,
    /// Effect of the command `delay` steps ago.
    pub newer: ActuatedState<S>,
    /// Effect of the command a step earlier.
    pub older: ActuatedState<S>,
    pub d: ActuatedState<S>,
    pub e: ActuatedState<S>,
    /// Whole steps of dead time.
    pub delay: usize,
    /// The actuator alone.
    pub actuator: SampledActuator,
}

impl<const S: usize> ActuatedState<S> {
    /// All zero.
    #[must_use]
    pub fn zeros() -> Self {
        Self { vehicle: SVector::zeros(), actuator: Vector3::zeros() }
    }
}

impl<const S: usize> From<SVector<f64, S>> for ActuatedState<S> {
    /// A state of the vehicle with none of the actuator.
    fn from(vehicle: SVector<f64, S>) -> Self {
        Self { vehicle, actuator: Vector3::zeros() }
    }
}

impl<const S: usize> Mul<&ActuatedState<S>> for &ActuatedTransition<S> {
    type Output = ActuatedState<S>;

    fn mul(self, x: &ActuatedState<S>) -> ActuatedState<S> {
        ActuatedState {
            vehicle: self.vehicle * x.vehicle + self.by_actuator * x.actuator,
            actuator: self.actuator * x.actuator,
        }
    }
}

impl<const S: usize> Add for ActuatedState<S> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { vehicle: self.vehicle + other.vehicle, actuator: self.actuator + other.actuator }
    }
}

impl<const S: usize> AddAssign for ActuatedState<S> {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const S: usize> Sub for ActuatedState<S> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { vehicle: self.vehicle - other.vehicle, actuator: self.actuator - other.actuator }
    }
}

impl<const S: usize> Mul<f64> for ActuatedState<S> {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { vehicle: self.vehicle * factor, actuator: self.actuator * factor }
    }
}

impl Actuator {
    /// Whole steps of an exact dead time, and the fraction of a step beyond them; none for an approximated one.
    #[must_use]
    pub fn delay(&self, sample_time: f64) -> (usize, f64) {
        if self.dead_time_model != DeadTimeModel::Exact {
            return (0, 0.0);
        }
        let steps = self.dead_time / sample_time;
        // 0.06 s are 3 steps of 0.02 s, whatever binary fractions say.
        let whole = (steps + 1e-9).floor();
        let fraction = steps - whole;
        (whole as usize, if fraction > 1e-9 { fraction } else { 0.0 })
    }

    /// Time for which a command acts on the actuator's states, beyond an exact dead time, s: after that e^-10 of it is
    /// left.
    #[must_use]
    pub fn memory(&self) -> f64 {
        let slowest = match self.dead_time_model {
            DeadTimeModel::Exact | DeadTimeModel::FirstOrder => 0.0,
            // Real parts of the poles: -2/T and -3/T.
            DeadTimeModel::Pade11 => self.dead_time / 2.0,
            DeadTimeModel::Pade22 => self.dead_time / 3.0,
        };
        SETTLED * (slowest + self.time_constant)
    }

    fn linear_part(&self) -> LinearPart {
        let (mut a, mut b, mut c, mut d) = (Matrix3::zeros(), Vector3::zeros(), RowVector3::zeros(), 1.0);
        let mut steady = Vector3::zeros();
        let t = self.dead_time;
        match self.dead_time_model {
            DeadTimeModel::Pade11 if t > NO_LAG => {
                (a[(0, 0)], b[0], c[0], d) = (-2.0 / t, 4.0 / t, 1.0, -1.0);
                steady[0] = 2.0;
            }
            DeadTimeModel::Pade22 if t > NO_LAG => {
                a[(0, 1)] = 1.0 / t;
                (a[(1, 0)], a[(1, 1)], b[1]) = (-12.0 / t, -6.0 / t, 12.0 / t);
                c[1] = -1.0;
                steady[0] = 1.0;
            }
            _ => {}
        }
        if self.time_constant > NO_LAG {
            a.set_row(2, &(c / self.time_constant));
            a[(2, 2)] = -1.0 / self.time_constant;
            b[2] = d / self.time_constant;
            (c, d) = (RowVector3::new(0.0, 0.0, 1.0), 0.0);
            steady[2] = 1.0;
        }
        LinearPart { a, b, c, d, steady }
    }

    /// The actuator alone, sampled.
    #[must_use]
    pub fn sample(&self, sample_time: f64) -> SampledActuator {
        let LinearPart { a, b, c, d, steady } = self.linear_part();
        let (delay, fraction) = self.delay(sample_time);
        let (a_step, whole) = zero_order_hold(&a, &b, sample_time);
        let newer = match fraction {
            0.0 => whole,
            _ => zero_order_hold(&a, &b, (1.0 - fraction) * sample_time).1,
        };
        SampledActuator { a: a_step, newer, older: whole - newer, c, d, steady, delay }
    }

    /// Samples a vehicle model with this actuator before it.
    #[must_use]
    pub fn discretise<const S: usize>(
        &self,
        model: &ContinuousErrorModel<S>,
        sample_time: f64,
    ) -> ActuatedModel<S> {
        let part = self.linear_part();
        let (delay, fraction) = self.delay(sample_time);
        let chain = Chain {
            x_by_x: model.a,
            x_by_z: model.b * part.c,
            z_by_z: part.a,
            x_by_input: SMatrix::<f64, S, 3>::from_columns(&[model.b * part.d, model.d, model.e]),
            z_by_input: Matrix3::from_columns(&[part.b, Vector3::zeros(), Vector3::zeros()]),
        };
        let step = chain.zero_order_hold(sample_time);
        let effect = |input: usize| ActuatedState {
            vehicle: step.x_by_input.column(input).into_owned(),
            actuator: step.z_by_input.column(input).into_owned(),
        };
        let whole = effect(0);
        let newer = if fraction > 0.0 {
            let command = Chain {
                x_by_x: chain.x_by_x,
                x_by_z: chain.x_by_z,
                z_by_z: chain.z_by_z,
                x_by_input: model.b * part.d,
                z_by_input: part.b,
            };
            let rest = command.zero_order_hold((1.0 - fraction) * sample_time);
            ActuatedState { vehicle: rest.x_by_input, actuator: rest.z_by_input }
        } else {
            whole
        };
        ActuatedModel {
            a: ActuatedTransition { vehicle: step.x_by_x, by_actuator: step.x_by_z, actuator: step.z_by_z },
            newer,
            older: whole - newer,
            d: effect(1),
            e: effect(2),
            delay,
            actuator: self.sample(sample_time),
        }
    }
}

impl SampledActuator {
    /// The state under a constant command.
    #[must_use]
    pub fn steady(&self, command: f64) -> Vector3<f64> {
        self.steady * command
    }

    /// The state a step later, from the commands `delay` and `delay + 1` steps before the step's begin.
    #[must_use]
    pub fn next(&self, state: &Vector3<f64>, newer: f64, older: f64) -> Vector3<f64> {
        self.a * state + self.newer * newer + self.older * older
    }

    /// The state now, from the commands issued before now, oldest first: the actuator run over them. Exact except for
    /// the effect of commands before the oldest.
    #[must_use]
    pub fn state(&self, commands: &[f64]) -> Vector3<f64> {
        let Some(&oldest) = commands.first() else { return Vector3::zeros() };
        let at = |k: usize, back: usize| k.checked_sub(back).map_or(oldest, |i| commands[i]);
        (0..commands.len())
            .fold(self.steady(oldest), |state, k| self.next(&state, at(k, self.delay), at(k, self.delay + 1)))
    }

    /// The angle at the road wheels now, just before a new command, from the commands issued before now, oldest first.
    #[must_use]
    pub fn angle(&self, commands: &[f64]) -> f64 {
        let passed = commands.len().checked_sub(self.delay + 1).map(|i| commands[i]);
        self.output(&self.state(commands), passed.or(commands.first().copied()).unwrap_or(0.0))
    }

    /// The angle at the road wheels from the state and the command that then arrives.
    #[must_use]
    pub fn output(&self, state: &Vector3<f64>, arriving: f64) -> f64 {
        (self.c * state)[0] + self.d * arriving
    }

    /// Whole steps of dead time.
    #[must_use]
    pub fn delay(&self) -> usize {
        self.delay
    }
}

impl<const S: usize> ActuatedModel<S> {
    /// The state of vehicle and actuator, from the vehicle's and the commands issued before now.
    #[must_use]
    pub fn state(&self, vehicle: &SVector<f64, S>, commands: &[f64]) -> ActuatedState<S> {
        ActuatedState { vehicle: *vehicle, actuator: self.actuator.state(commands) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::SingleTrack;
    use nalgebra::Complex;

    fn continuous() -> ContinuousErrorModel {
        let car = SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };
        ContinuousErrorModel::new(&car, 12.0).unwrap()
    }

    fn exact(dead_time: f64, time_constant: f64) -> Actuator {
        Actuator { dead_time, time_constant, ..Actuator::default() }
    }

    /// All kinds, with and without a lag behind them.
    fn all() -> Vec<Actuator> {
        let lags = [0.0, 0.08];
        DeadTimeModel::ALL
            .iter()
            .flat_map(|&dead_time_model| {
                lags.map(|time_constant| Actuator { dead_time: 0.05, time_constant, dead_time_model })
            })
            .chain([exact(0.0, 0.0), exact(0.0, 0.08)])
            .collect()
    }

    #[test]
    fn without_an_actuator_it_is_the_plain_model() {
        let plain = continuous().discretise(0.02);
        let none =
            DeadTimeModel::ALL.iter().map(|&form| Actuator { dead_time_model: form, ..exact(0.0, 0.0) });
        for actuator in none {
            let model = actuator.discretise(&continuous(), 0.02);
            assert_eq!(model.delay, 0);
            assert!((model.newer.vehicle - plain.b).norm() < 1e-14);
            assert!((model.a.vehicle - plain.a).norm() < 1e-14);
            assert_eq!(model.older, ActuatedState::zeros());
            assert_eq!(model.actuator.angle(&[0.1, 0.2]), 0.2);
        }
    }

    #[test]
    fn a_fractional_dead_time_and_a_lag_are_sampled_exactly() {
        // 50 ms at Ts = 20 ms: two and a half steps. Reference: ten times finer steps, where it is whole.
        for actuator in all() {
            let coarse = actuator.discretise(&continuous(), 0.02);
            let fine = actuator.discretise(&continuous(), 0.002);
            let command = |k: i64| if k < 0 { 0.0 } else { (0.3 * k as f64).sin() };
            let (mut x, mut y) = (ActuatedState::zeros(), ActuatedState::zeros());
            for k in 0..40 {
                let delay = coarse.delay as i64;
                x = &coarse.a * &x
                    + coarse.newer * command(k - delay)
                    + coarse.older * command(k - delay - 1);
                for i in 0..10 {
                    y = &fine.a * &y + fine.newer * command((10 * k + i - fine.delay as i64).div_euclid(10));
                }
            }
            let off = x - y;
            assert!(off.vehicle.norm() < 1e-9 * y.vehicle.norm(), "{actuator:?}: {x:?} {y:?}");
            assert!(off.actuator.norm() <= 1e-9 * y.actuator.norm(), "{actuator:?}: {x:?} {y:?}");
        }
    }

    #[test]
    fn the_state_follows_from_the_commands() {
        for actuator in all() {
            let model = actuator.discretise(&continuous(), 0.02);
            let commands: Vec<f64> = (0..60).map(|k| (0.2 * f64::from(k)).cos()).collect();
            let at = |i: i64| commands[i.max(0) as usize];
            let mut state = ActuatedState::from(SVector::zeros());
            state.actuator = model.actuator.steady(commands[0]);
            let delay = model.delay as i64;
            for k in 0..60_i64 {
                state = &model.a * &state + model.newer * at(k - delay) + model.older * at(k - delay - 1);
            }
            let found = model.state(&SVector::zeros(), &commands);
            assert!((found - state).actuator.norm() < 1e-12, "{actuator:?}: {found:?} {state:?}");
        }
    }

    #[test]
    fn approximants_have_their_transfer_functions() {
        let t = 0.3;
        for (dead_time_model, time_constant) in [
            (DeadTimeModel::Pade11, 0.0),
            (DeadTimeModel::Pade22, 0.0),
            (DeadTimeModel::Pade11, 0.2),
            (DeadTimeModel::Pade22, 0.2),
        ] {
            let part = Actuator { dead_time: t, time_constant, dead_time_model }.linear_part();
            for frequency in [0.1, 1.0, 5.0, 20.0, 100.0] {
                let s = Complex::new(0.0, frequency);
                let resolvent = Matrix3::identity() * s - part.a.map(|x| Complex::new(x, 0.0));
                let state = resolvent.lu().solve(&part.b.map(|x| Complex::new(x, 0.0))).unwrap();
                let found = (part.c.map(|x| Complex::new(x, 0.0)) * state)[0] + part.d;
                let (half, square) = (s * t / 2.0, s * s * t * t / 12.0);
                let pade = match dead_time_model {
                    DeadTimeModel::Pade22 => (square - half + 1.0) / (square + half + 1.0),
                    _ => (-half + 1.0) / (half + 1.0),
                };
                let expected = pade / (s * time_constant + 1.0);
                assert!(
                    (found - expected).norm() < 1e-12,
                    "{dead_time_model:?} at {frequency}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_constant_command_is_an_equilibrium() {
        for actuator in all() {
            let sampled = actuator.sample(0.02);
            let steady = sampled.steady(0.1);
            assert!((sampled.next(&steady, 0.1, 0.1) - steady).norm() < 1e-14, "{actuator:?}");
            assert!((sampled.angle(&[0.1; 30]) - 0.1).abs() < 1e-14, "{actuator:?}");
        }
    }

    #[test]
    fn an_approximant_answers_a_step_at_once() {
        // Of order (1, 1) the wrong way, of order (2, 2) first the right way: neither is strictly proper.
        let commands = [0.0, 0.0, 1.0];
        let angle = |dead_time_model| {
            Actuator { dead_time: 0.3, time_constant: 0.0, dead_time_model }.sample(1e-6).angle(&commands)
        };
        assert!((angle(DeadTimeModel::Pade11) + 1.0).abs() < 1e-4);
        assert!((angle(DeadTimeModel::Pade22) - 1.0).abs() < 1e-4);
        assert_eq!(angle(DeadTimeModel::Exact), 0.0);
    }
}
