//! Errors of the model's form: deviations of a vehicle of another formulation though all its numbers are right.
//!
//! They are no white noise; they follow the motion. A signal `s` comes out a little too large or too early. Or it does
//! so with speed, with lateral acceleration `a`, or with driving (`a_x > 0`) against braking. Shares of brakes and of
//! load differ between formulations:
//!
//! ```text
//!     d(t) = x_1 s + x_2 (-ds/dt) + x_3 s (v - 15 m/s) / 10 m/s + x_4 s |a| / 3 m/s2 + x_5 s a_x / 2 m/s2
//! ```
//!
//! with `x` of the order of a hundredth (`form` in `calibration.toml`). Each `x` is a tolerance like all others and is
//! marginalised in every fit; a gap that these errors can mimic is no evidence. Errors of yaw rate and lateral velocity
//! propagate to heading and place, that of the acceleration to the speed. Lateral velocity is a difference of two large
//! parts; its uncertain part is the tyres' slip, about `v a / 120 m/s2`.
//!
//! Source: model discrepancy as a random function with a prior of its own, Kennedy and O'Hagan, Bayesian calibration
//! of computer models, J. R. Stat. Soc. B 63 (2001); here with few functions in place of a Gaussian process.

use super::replay::{Channel, ReplayDrive, Trace};

/// Kind of deviation of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviationKind {
    /// Larger throughout.
    Size,
    /// Later, by seconds.
    Late,
    /// Larger with speed.
    Speed,
    /// Larger with lateral acceleration.
    Grip,
    /// Larger when driven, smaller when braked.
    Drive,
}

/// Error of the model's form: id, channel, kind.
pub type FormError = (&'static str, Channel, DeviationKind);

/// All errors of the form that are known.
pub const FORMS: &[FormError] = &[
    ("form.yaw_rate.size", Channel::YawRate, DeviationKind::Size),
    ("form.yaw_rate.late", Channel::YawRate, DeviationKind::Late),
    ("form.yaw_rate.speed", Channel::YawRate, DeviationKind::Speed),
    ("form.yaw_rate.grip", Channel::YawRate, DeviationKind::Grip),
    ("form.yaw_rate.drive", Channel::YawRate, DeviationKind::Drive),
    ("form.ay.size", Channel::Ay, DeviationKind::Size),
    ("form.ay.late", Channel::Ay, DeviationKind::Late),
    ("form.ay.speed", Channel::Ay, DeviationKind::Speed),
    ("form.ay.grip", Channel::Ay, DeviationKind::Grip),
    ("form.ay.drive", Channel::Ay, DeviationKind::Drive),
    ("form.vy.size", Channel::Vy, DeviationKind::Size),
    ("form.vy.late", Channel::Vy, DeviationKind::Late),
    ("form.vy.speed", Channel::Vy, DeviationKind::Speed),
    ("form.vy.grip", Channel::Vy, DeviationKind::Grip),
    ("form.vy.drive", Channel::Vy, DeviationKind::Drive),
    ("form.roll.size", Channel::Roll, DeviationKind::Size),
    ("form.roll.late", Channel::Roll, DeviationKind::Late),
    ("form.roll.speed", Channel::Roll, DeviationKind::Speed),
    ("form.roll.grip", Channel::Roll, DeviationKind::Grip),
    ("form.roll.drive", Channel::Roll, DeviationKind::Drive),
    ("form.articulation.size", Channel::Articulation, DeviationKind::Size),
    ("form.articulation.late", Channel::Articulation, DeviationKind::Late),
    ("form.articulation.speed", Channel::Articulation, DeviationKind::Speed),
    ("form.articulation.grip", Channel::Articulation, DeviationKind::Grip),
    ("form.articulation.drive", Channel::Articulation, DeviationKind::Drive),
    ("form.ax.size", Channel::Ax, DeviationKind::Size),
    ("form.ax.late", Channel::Ax, DeviationKind::Late),
    ("form.ax.grip", Channel::Ax, DeviationKind::Grip),
];

/// Contributions of an error to the channels of a drive, from the neutral replay; rows outside stretches are 0.
#[must_use]
pub fn shapes(drive: &ReplayDrive, neutral: &Trace, row: &FormError) -> Vec<(Channel, Vec<f64>)> {
    let (_, channel, kind) = *row;
    let vx = drive.column("vx");
    let rate = neutral.column(Channel::YawRate);
    let lateral = |i: usize| vx[i] * rate[i];
    let signal: Vec<f64> = match channel {
        Channel::Vy => (0..vx.len()).map(|i| vx[i] * lateral(i) / 120.0).collect(),
        Channel::Ax if neutral.column(channel).is_empty() => drive.accel.clone(),
        _ => neutral.column(channel).to_vec(),
    };
    if signal.len() != vx.len() || rate.len() != vx.len() {
        return Vec::new();
    }
    let slope = |of: &[f64]| {
        let mut slope = vec![0.0; of.len()];
        for &(from, to) in &drive.stretches {
            for (i, slope) in slope.iter_mut().enumerate().take(to).skip(from) {
                let (a, b) = (i.max(from + 1) - 1, (i + 1).min(to - 1));
                *slope = (of[b] - of[a]) / ((b - a).max(1) as f64 * drive.step);
            }
        }
        slope
    };
    let shape: Vec<f64> = match kind {
        DeviationKind::Size => signal,
        DeviationKind::Late => slope(&signal).iter().map(|slope| -slope).collect(),
        DeviationKind::Speed => signal.iter().zip(vx).map(|(s, vx)| s * (vx - 15.0) / 10.0).collect(),
        DeviationKind::Grip => signal.iter().enumerate().map(|(i, s)| s * lateral(i).abs() / 3.0).collect(),
        DeviationKind::Drive => signal.iter().zip(&drive.accel).map(|(s, accel)| s * accel / 2.0).collect(),
    };
    if channel == Channel::Articulation {
        let rate = slope(&shape);
        return vec![(channel, shape), (Channel::ArticulationRate, rate)];
    }
    vec![(channel, shape)]
}
