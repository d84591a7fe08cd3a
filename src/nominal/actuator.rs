//! A linear vehicle model behind its steering actuator: what lies between command and road wheels.
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
//! approximant passes part of the command on at once, the wrong way for an odd order; a lag behind it makes it strictly
//! proper. Before the vehicle `x' = A x + B delta + ..` the state is `[x; z]`, sampled exactly: within a step the delayed
//! command changes once, `T` being no whole number of steps, so that
//!
//! ```text
//! X_{k+1} = A_X X_k + G_1 u_{k-m} + G_2 u_{k-m-1} + D psi_des' + E psi_des'',     m = floor(T / Ts)
//! ```
//!
//! `z` is not measured: it is what the issued commands have made of it. With the vehicle's true constants the exact
//! actuator is the oracle that a learned residual is measured against; with identified ones it is what an engineer does
//! who knows that there is a delay.
//!
//! Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, ch. 4.3.4 (dead time that is no whole
//! number of samples); Golub and Van Loan, Matrix Computations, ch. 9.3.1 (Pade approximants).

use super::{ContinuousErrorModel, zero_order_hold};
use crate::enumeration;
use nalgebra::{Matrix3, RowVector3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

enumeration! {
    /// How a model represents a dead time.
    pub enum DeadTimeModel {
        Exact = 0 "exact", "As it is: whole steps and a fraction of one";
        Pade11 = 1 "pade_1_1", "Pade approximant of order (1, 1)";
        Pade22 = 2 "pade_2_2", "Pade approximant of order (2, 2)";
    }
}

/// A steering actuator as a model has it: dead time, then a first-order lag. Without a dead time it is the first-order
/// inertia; without either it is none.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Actuator {
    /// Dead time, s.
    pub dead_time: f64,
    /// Time constant of the first-order lag, s; 0 for none.
    pub time_constant: f64,
    /// How the dead time is represented.
    pub dead_time_model: DeadTimeModel,
}

/// States of an actuator: two of a Pade approximant, one of the lag. Those that an actuator does not have stay 0.
pub const ACTUATOR_STATES: usize = 3;

/// A lag or an approximated dead time shorter than this is none, s: its pole would only make the model stiff.
const NO_LAG: f64 = 1e-4;
/// A command counts as settled after so many time constants: e^-10 of it is left.
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

/// A vehicle model of `S` states behind an actuator, sampled; `P = S + ACTUATOR_STATES`. The vehicle's states stand first.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct ActuatedModel<const S: usize, const P: usize> {
    pub a: SMatrix<f64, P, P>,
    /// Effect of the command `delay` steps ago.
    pub newer: SVector<f64, P>,
    /// Effect of the command a step earlier.
    pub older: SVector<f64, P>,
    pub d: SVector<f64, P>,
    pub e: SVector<f64, P>,
    /// Whole steps of dead time.
    pub delay: usize,
    /// The actuator alone.
    pub actuator: SampledActuator,
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

    /// How long a command acts on the actuator's states, beyond an exact dead time, s: after that e^-10 of it is left.
    #[must_use]
    pub fn memory(&self) -> f64 {
        let slowest = match self.dead_time_model {
            DeadTimeModel::Exact => 0.0,
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
        let delay = self.delay(sample_time);
        let (a, newer, older) = hold_delayed(&a, &b, sample_time, delay.1);
        SampledActuator { a, newer, older, c, d, steady, delay: delay.0 }
    }

    /// Samples a vehicle model with this actuator before it.
    #[must_use]
    pub fn discretise<const S: usize, const P: usize>(
        &self,
        model: &ContinuousErrorModel<S>,
        sample_time: f64,
    ) -> ActuatedModel<S, P> {
        const { assert!(P == S + ACTUATOR_STATES, "the state is the vehicle's and the actuator's") };
        let part = self.linear_part();
        let mut a = SMatrix::<f64, P, P>::zeros();
        a.fixed_view_mut::<S, S>(0, 0).copy_from(&model.a);
        a.fixed_view_mut::<S, ACTUATOR_STATES>(0, S).copy_from(&(model.b * part.c));
        a.fixed_view_mut::<ACTUATOR_STATES, ACTUATOR_STATES>(S, S).copy_from(&part.a);
        let stacked = |x: &SVector<f64, S>| SVector::<f64, P>::from_fn(|i, _| if i < S { x[i] } else { 0.0 });
        let mut command = stacked(&(model.b * part.d));
        command.fixed_rows_mut::<ACTUATOR_STATES>(S).copy_from(&part.b);
        let road = SMatrix::<f64, P, 2>::from_columns(&[stacked(&model.d), stacked(&model.e)]);
        let road = zero_order_hold(&a, &road, sample_time).1;
        let (delay, fraction) = self.delay(sample_time);
        let (a, newer, older) = hold_delayed(&a, &command, sample_time, fraction);
        ActuatedModel {
            a,
            newer,
            older,
            d: road.column(0).into_owned(),
            e: road.column(1).into_owned(),
            delay,
            actuator: self.sample(sample_time),
        }
    }
}

/// Zero-order hold with an input that changes the given fraction of a step after its begin: the transition, and the
/// effects of the input after and before that.
fn hold_delayed<const N: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SVector<f64, N>,
    sample_time: f64,
    fraction: f64,
) -> (SMatrix<f64, N, N>, SVector<f64, N>, SVector<f64, N>) {
    let (transition, whole) = zero_order_hold(a, b, sample_time);
    let newer = if fraction > 0.0 { zero_order_hold(a, b, (1.0 - fraction) * sample_time).1 } else { whole };
    (transition, newer, whole - newer)
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

    /// The state now, from the commands issued before now, oldest first: the actuator run over them. Exact but for what
    /// was before the oldest.
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

impl<const S: usize, const P: usize> ActuatedModel<S, P> {
    /// The state of vehicle and actuator, from the vehicle's and the commands issued before now.
    #[must_use]
    pub fn state(&self, vehicle: &SVector<f64, S>, commands: &[f64]) -> SVector<f64, P> {
        let mut state = Self::extend(vehicle);
        state.fixed_rows_mut::<ACTUATOR_STATES>(S).copy_from(&self.actuator.state(commands));
        state
    }

    /// A vector of the vehicle's states with none of the actuator's.
    #[must_use]
    pub fn extend(vehicle: &SVector<f64, S>) -> SVector<f64, P> {
        SVector::from_fn(|i, _| if i < S { vehicle[i] } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::SingleTrack;
    use nalgebra::Complex;

    type Model = ActuatedModel<4, 7>;

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
            let model: Model = actuator.discretise(&continuous(), 0.02);
            assert_eq!(model.delay, 0);
            assert!((model.newer.fixed_rows::<4>(0) - plain.b).norm() < 1e-14);
            assert!((model.a.fixed_view::<4, 4>(0, 0) - plain.a).norm() < 1e-14);
            assert_eq!(model.older.norm(), 0.0);
            assert_eq!(model.actuator.angle(&[0.1, 0.2]), 0.2);
        }
    }

    #[test]
    fn a_fractional_dead_time_and_a_lag_are_sampled_exactly() {
        // 50 ms at Ts = 20 ms: two and a half steps. Reference: ten times finer steps, where it is whole.
        for actuator in all() {
            let coarse: Model = actuator.discretise(&continuous(), 0.02);
            let fine: Model = actuator.discretise(&continuous(), 0.002);
            let command = |k: i64| if k < 0 { 0.0 } else { (0.3 * k as f64).sin() };
            let (mut x, mut y) = (SVector::<f64, 7>::zeros(), SVector::<f64, 7>::zeros());
            for k in 0..40 {
                let delay = coarse.delay as i64;
                x = coarse.a * x + coarse.newer * command(k - delay) + coarse.older * command(k - delay - 1);
                for i in 0..10 {
                    y = fine.a * y + fine.newer * command((10 * k + i - fine.delay as i64).div_euclid(10));
                }
            }
            assert!((x - y).norm() < 1e-9 * y.norm(), "{actuator:?}: {x} {y}");
        }
    }

    #[test]
    fn the_state_follows_from_the_commands() {
        for actuator in all() {
            let model: Model = actuator.discretise(&continuous(), 0.02);
            let commands: Vec<f64> = (0..60).map(|k| (0.2 * f64::from(k)).cos()).collect();
            let at = |i: i64| commands[i.max(0) as usize];
            let mut state = Model::extend(&SVector::zeros());
            state.fixed_rows_mut::<3>(4).copy_from(&model.actuator.steady(commands[0]));
            let delay = model.delay as i64;
            for k in 0..60_i64 {
                state = model.a * state + model.newer * at(k - delay) + model.older * at(k - delay - 1);
            }
            let found = model.state(&SVector::zeros(), &commands);
            assert!((found - state).fixed_rows::<3>(4).norm() < 1e-12, "{actuator:?}: {found} {state}");
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
