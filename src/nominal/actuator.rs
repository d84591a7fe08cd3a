//! The single track with its steering actuator: dead time and first-order lag between command and road wheels.
//!
//! ```text
//! x' = A x + B delta + ..,    tau delta' = u(t - T) - delta        state [x; delta]
//! ```
//!
//! sampled exactly: within a step the delayed command changes once, `T` being no whole number of steps, so that
//!
//! ```text
//! z_{k+1} = A_z z_k + G_1 u_{k-d} + G_2 u_{k-d-1} + D psi_des' + E psi_des'',     d = floor(T / Ts)
//! ```
//!
//! With the vehicle's true `T` and `tau` this is the oracle that a learned residual is measured against; with
//! identified ones it is what an engineer does who knows that there is a delay.
//!
//! Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, ch. 4.3.4 (dead time that is no whole
//! number of samples).

use super::{Chain, ContinuousErrorModel, ERRORS};
use nalgebra::{Matrix1, SMatrix, SVector};
use serde::{Deserialize, Serialize};
use std::ops::{Add, AddAssign, Mul, Sub};

/// The vehicle's state and the angle at the road wheels, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct ActuatedState<const S: usize = ERRORS> {
    pub vehicle: SVector<f64, S>,
    pub angle: f64,
}

/// How a state with its actuator acts on the next one: `A` in blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatedTransition<const S: usize = ERRORS> {
    /// Of the vehicle's state on itself.
    pub vehicle: SMatrix<f64, S, S>,
    /// Of the angle on the vehicle's state.
    pub by_angle: SVector<f64, S>,
    /// Of the angle on itself.
    pub angle: f64,
}

impl<const S: usize> Mul<&ActuatedState<S>> for &ActuatedTransition<S> {
    type Output = ActuatedState<S>;

    fn mul(self, x: &ActuatedState<S>) -> ActuatedState<S> {
        ActuatedState {
            vehicle: self.vehicle * x.vehicle + self.by_angle * x.angle,
            angle: self.angle * x.angle,
        }
    }
}

impl<const S: usize> Add for ActuatedState<S> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { vehicle: self.vehicle + other.vehicle, angle: self.angle + other.angle }
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
        Self { vehicle: self.vehicle - other.vehicle, angle: self.angle - other.angle }
    }
}

impl<const S: usize> Mul<f64> for ActuatedState<S> {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { vehicle: self.vehicle * factor, angle: self.angle * factor }
    }
}

impl<const S: usize> ActuatedState<S> {
    /// All zero.
    #[must_use]
    pub fn zeros() -> Self {
        Self { vehicle: SVector::zeros(), angle: 0.0 }
    }
}

/// A steering actuator.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Actuator {
    /// Dead time, s.
    pub dead_time: f64,
    /// Time constant of the first-order lag, s; 0 for none.
    pub time_constant: f64,
}

/// A lag shorter than this is none, s: its pole would only make the model stiff.
const NO_LAG: f64 = 1e-4;

/// The sampled model.
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
}

impl Actuator {
    /// Whole steps of the dead time, and the fraction of a step beyond them.
    #[must_use]
    pub fn delay(&self, sample_time: f64) -> (usize, f64) {
        let steps = self.dead_time / sample_time;
        // 0.06 s are 3 steps of 0.02 s, whatever binary fractions say.
        let whole = (steps + 1e-9).floor();
        (whole as usize, (steps - whole).max(0.0))
    }

    /// Samples a vehicle model with this actuator before it.
    #[must_use]
    pub fn discretise<const S: usize>(
        &self,
        model: &ContinuousErrorModel<S>,
        sample_time: f64,
    ) -> ActuatedModel<S> {
        let lags = self.time_constant > NO_LAG;
        let rate = if lags { 1.0 / self.time_constant } else { 0.0 };
        // Without a lag the command acts on the vehicle itself, and the angle on nothing.
        let (by_angle, by_command) =
            if lags { (model.b, SVector::zeros()) } else { (SVector::zeros(), model.b) };
        let chain = Chain {
            x_by_x: model.a,
            x_by_z: by_angle,
            z_by_z: Matrix1::new(-rate),
            x_by_input: SMatrix::<f64, S, 3>::from_columns(&[by_command, model.d, model.e]),
            z_by_input: SMatrix::<f64, 1, 3>::new(rate, 0.0, 0.0),
        };
        let step = chain.zero_order_hold(sample_time);
        let effect = |input: usize| ActuatedState {
            vehicle: step.x_by_input.column(input).into_owned(),
            angle: step.z_by_input[input],
        };
        let whole = effect(0);
        let (delay, fraction) = self.delay(sample_time);
        let newer = if fraction > 1e-9 {
            let rest = (1.0 - fraction) * sample_time;
            let command = Chain {
                x_by_x: chain.x_by_x,
                x_by_z: chain.x_by_z,
                z_by_z: chain.z_by_z,
                x_by_input: by_command,
                z_by_input: Matrix1::new(rate),
            };
            let part = command.zero_order_hold(rest);
            ActuatedState { vehicle: part.x_by_input, angle: part.z_by_input[0] }
        } else {
            whole
        };
        ActuatedModel {
            a: ActuatedTransition { vehicle: step.x_by_x, by_angle: step.x_by_z, angle: step.z_by_z[0] },
            newer,
            older: whole - newer,
            d: effect(1),
            e: effect(2),
            delay,
        }
    }
}

impl<const S: usize> ActuatedModel<S> {
    /// The angle at the road wheels now, from the commands issued before now, oldest first: the actuator run over
    /// them. Exact but for what was before the oldest.
    #[must_use]
    pub fn angle(&self, commands: &[f64]) -> f64 {
        let Some(&oldest) = commands.first() else { return 0.0 };
        // Input of a step that ends at a command's instant: the command `delay` and `delay + 1` before it.
        let at = |k: usize, back: usize| k.checked_sub(back).map_or(oldest, |i| commands[i]);
        (0..commands.len()).fold(oldest, |angle, k| {
            self.a.angle * angle
                + self.newer.angle * at(k, self.delay)
                + self.older.angle * at(k, self.delay + 1)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::SingleTrack;

    fn continuous() -> ContinuousErrorModel {
        let car = SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };
        ContinuousErrorModel::new(&car, 12.0).unwrap()
    }

    #[test]
    fn without_an_actuator_it_is_the_plain_model() {
        let plain = continuous().discretise(0.02);
        let model = Actuator::default().discretise(&continuous(), 0.02);
        assert_eq!(model.delay, 0);
        assert!((model.newer.vehicle - plain.b).norm() < 1e-14);
        assert!((model.a.vehicle - plain.a).norm() < 1e-14);
        assert_eq!(model.older, ActuatedState::zeros());
    }

    #[test]
    fn a_fractional_dead_time_and_a_lag_are_sampled_exactly() {
        // 50 ms at Ts = 20 ms: two and a half steps. Reference: ten times finer steps, where it is whole.
        let actuator = Actuator { dead_time: 0.05, time_constant: 0.08 };
        let coarse = actuator.discretise(&continuous(), 0.02);
        let fine = actuator.discretise(&continuous(), 0.002);
        assert_eq!((coarse.delay, fine.delay), (2, 25));
        let command = |k: i64| if k < 0 { 0.0 } else { (0.3 * k as f64).sin() };
        let (mut x, mut y) = (ActuatedState::zeros(), ActuatedState::zeros());
        for k in 0..40 {
            x = &coarse.a * &x + coarse.newer * command(k - 2) + coarse.older * command(k - 3);
            for i in 0..10 {
                y = &fine.a * &y + fine.newer * command((10 * k + i - 25).div_euclid(10));
            }
        }
        assert!((x.vehicle - y.vehicle).norm() < 1e-9 * y.vehicle.norm(), "{x:?} {y:?}");
        assert!((x.angle - y.angle).abs() < 1e-9 * y.angle.abs(), "{x:?} {y:?}");
    }

    #[test]
    fn the_angle_follows_from_the_commands() {
        let actuator = Actuator { dead_time: 0.03, time_constant: 0.05 };
        let model = actuator.discretise(&continuous(), 0.02);
        let commands: Vec<f64> = (0..60).map(|k| (0.2 * f64::from(k)).cos()).collect();
        let mut angle = commands[0];
        let at = |i: i64| commands[i.max(0) as usize];
        for k in 0..60_i64 {
            angle = model.a.angle * angle + model.newer.angle * at(k - 1) + model.older.angle * at(k - 2);
        }
        assert!((model.angle(&commands) - angle).abs() < 1e-12);
    }
}
