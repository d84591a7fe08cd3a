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

use super::{ContinuousErrorModel, zero_order_hold};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// `[e1, e1', e2, e2', delta]`.
pub type ActuatedState = SVector<f64, 5>;

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
pub struct ActuatedModel {
    pub a: SMatrix<f64, 5, 5>,
    /// Effect of the command `delay` steps ago.
    pub newer: ActuatedState,
    /// Effect of the command a step earlier.
    pub older: ActuatedState,
    pub d: ActuatedState,
    pub e: ActuatedState,
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
    pub fn discretise(&self, model: &ContinuousErrorModel, sample_time: f64) -> ActuatedModel {
        let mut a = SMatrix::<f64, 5, 5>::zeros();
        a.fixed_view_mut::<4, 4>(0, 0).copy_from(&model.a);
        let mut command = ActuatedState::zeros();
        if self.time_constant > NO_LAG {
            a.fixed_view_mut::<4, 1>(0, 4).copy_from(&model.b);
            a[(4, 4)] = -1.0 / self.time_constant;
            command[4] = 1.0 / self.time_constant;
        } else {
            command.fixed_rows_mut::<4>(0).copy_from(&model.b);
        }
        let padded = |x: &SVector<f64, 4>| ActuatedState::from_fn(|i, _| if i < 4 { x[i] } else { 0.0 });
        let inputs = SMatrix::<f64, 5, 3>::from_columns(&[command, padded(&model.d), padded(&model.e)]);
        let (a_step, inputs) = zero_order_hold::<5, 3, 8>(&a, &inputs, sample_time);
        let whole: ActuatedState = inputs.column(0).into_owned();
        let (delay, fraction) = self.delay(sample_time);
        let newer = if fraction > 1e-9 {
            let rest = (1.0 - fraction) * sample_time;
            zero_order_hold::<5, 1, 6>(&a, &SMatrix::from_columns(&[command]), rest).1.column(0).into_owned()
        } else {
            whole
        };
        ActuatedModel {
            a: a_step,
            newer,
            older: whole - newer,
            d: inputs.column(1).into_owned(),
            e: inputs.column(2).into_owned(),
            delay,
        }
    }
}

impl ActuatedModel {
    /// The angle at the road wheels now, from the commands issued before now, oldest first: the actuator run over
    /// them. Exact but for what was before the oldest.
    #[must_use]
    pub fn angle(&self, commands: &[f64]) -> f64 {
        let Some(&oldest) = commands.first() else { return 0.0 };
        // Input of a step that ends at a command's instant: the command `delay` and `delay + 1` before it.
        let at = |k: usize, back: usize| k.checked_sub(back).map_or(oldest, |i| commands[i]);
        (0..commands.len()).fold(oldest, |angle, k| {
            self.a[(4, 4)] * angle + self.newer[4] * at(k, self.delay) + self.older[4] * at(k, self.delay + 1)
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
        assert!((model.newer.fixed_rows::<4>(0) - plain.b).norm() < 1e-14);
        assert!((model.a.fixed_view::<4, 4>(0, 0) - plain.a).norm() < 1e-14);
        assert_eq!(model.older.norm(), 0.0);
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
            x = coarse.a * x + coarse.newer * command(k - 2) + coarse.older * command(k - 3);
            for i in 0..10 {
                y = fine.a * y + fine.newer * command((10 * k + i - 25).div_euclid(10));
            }
        }
        assert!((x - y).norm() < 1e-9 * y.norm(), "{x} {y}");
    }

    #[test]
    fn the_angle_follows_from_the_commands() {
        let actuator = Actuator { dead_time: 0.03, time_constant: 0.05 };
        let model = actuator.discretise(&continuous(), 0.02);
        let commands: Vec<f64> = (0..60).map(|k| (0.2 * f64::from(k)).cos()).collect();
        let mut angle = commands[0];
        let at = |i: i64| commands[i.max(0) as usize];
        for k in 0..60_i64 {
            angle = model.a[(4, 4)] * angle + model.newer[4] * at(k - 1) + model.older[4] * at(k - 2);
        }
        assert!((model.angle(&commands) - angle).abs() < 1e-12);
    }
}
