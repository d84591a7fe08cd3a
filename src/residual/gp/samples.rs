//! From drives to the samples of a Gaussian process: states of a nonlinear model and that model's errors.
//!
//! The drives' errors and rates give the vehicle's lateral velocity and yaw rate : with `e1' = vx sin e2 + vy cos e2` and `e2' = r - kappa s'`,
//!
//! ```text
//! vy = (e1' - vx sin e2) / cos e2,   s' = (vx cos e2 - vy sin e2) / (1 - kappa e1),   r = e2' + kappa s'
//! label_k = [vy, r, ..]_{k+1} - model([vy, r, ..]_k, vx_k, steer_k, Ts)
//! ```
//!
//! States behind the errors to the path are taken as recorded.

use super::vehicle::GpVehicle;
use crate::nominal::ERRORS;
use crate::residual::dataset::{self, DataSet};
use crate::residual::recorded::DriveRow;

/// Inputs and labels, and the number of steps without any.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples<const D: usize, const O: usize> {
    /// Inputs: m/s, m/s, rad/s, then the vehicle's own, then rad, m/s2.
    pub inputs: Vec<[f64; D]>,
    /// Labels, in the units of the outputs.
    pub labels: Vec<[f64; O]>,
    /// Outputs as recorded at the beginning of the step.
    recorded: Vec<[f64; O]>,
    /// Samples before this one in its uninterrupted run.
    before: Vec<usize>,
    /// Steps left out because the vehicle stood across the path or at its centre of curvature.
    pub left_out: usize,
}

/// Least cosine of the yaw error, or share of the path's radius, at which the errors determine the vehicle's motion.
const LEAST: f64 = 0.2;

/// The body's states of a row, in their places among the inputs; the others are 0.
fn motion<const S: usize, const D: usize>(row: &DriveRow<S>) -> Option<[f64; D]> {
    let (state, [vx, curvature, _]) = (&row.state, row.road);
    let (e1, e1_rate, e2, e2_rate) = (state[0], state[1], state[2], state[3]);
    let (sin, cos) = e2.sin_cos();
    let radius = 1.0 - curvature * e1;
    if cos < LEAST || radius < LEAST {
        return None;
    }
    let vy = (e1_rate - vx * sin) / cos;
    let speed = (vx * cos - vy * sin) / radius;
    let mut at = [0.0; D];
    (at[1], at[2]) = (vy, e2_rate + curvature * speed);
    at[3..S - 1].copy_from_slice(&state[ERRORS..]);
    Some(at)
}

impl<const D: usize, const O: usize> Samples<D, O> {
    /// The samples of all drives, for a nominal model of the data's vehicle, with the body's states smoothed over
    /// `smoothing` rows on each side.
    #[must_use]
    pub fn new<V: GpVehicle<S, D, O>, const S: usize>(
        data: &DataSet<V, S>,
        nominal: &V::Model,
        smoothing: usize,
    ) -> Self {
        const { assert!(D == S + 1, "speed, body, command, acceleration") };
        let mut samples =
            Self { inputs: vec![], labels: vec![], recorded: vec![], before: vec![], left_out: 0 };
        let sample_time = data.config.sample_time;
        for stretch in data.stretches() {
            let raw: Vec<Option<[f64; D]>> = stretch.iter().map(motion).collect();
            let mut run = 0;
            for i in 0..stretch.len().saturating_sub(1) {
                let (Some(mut at), Some(next)) = (smooth(&raw, i, smoothing), smooth(&raw, i + 1, smoothing))
                else {
                    samples.left_out += 1;
                    run = 0;
                    continue;
                };
                let (vx, steer) = (stretch[i].road[0], stretch[i].command);
                let held = vx.max(data.config.min_model_speed);
                let accel = dataset::acceleration(&stretch, i, sample_time);
                (at[0], at[D - 2], at[D - 1]) = (vx, steer, accel);
                let predicted = V::step(nominal, &at, held, sample_time);
                samples.inputs.push(at);
                samples.labels.push(V::OUTPUTS.map(|place| next[place] - predicted[place]));
                samples.recorded.push(V::OUTPUTS.map(|place| raw[i].unwrap_or(at)[place]));
                samples.before.push(run);
                run += 1;
            }
        }
        samples
    }

    /// Root mean square error of the outputs predicted freely over `steps` steps, against the record. Speeds and
    /// commands are those recorded; each `steps / 2`-th sample starts a run. Not a number if no run is that long.
    #[cfg(feature = "cli")]
    pub(super) fn rollout<V: GpVehicle<S, D, O>, const S: usize>(
        &self,
        data: &DataSet<V, S>,
        nominal: &V::Model,
        steps: usize,
        residual: impl Fn(&[f64; D]) -> [f64; O],
    ) -> [f64; O] {
        let (mut squares, mut count) = ([0.0; O], 0.0);
        for end in (steps..self.inputs.len()).step_by((steps / 2).max(1)) {
            if self.before[end] < steps {
                continue;
            }
            let mut at = self.inputs[end - steps];
            for driven in &self.inputs[end - steps..end] {
                (at[0], at[D - 2], at[D - 1]) = (driven[0], driven[D - 2], driven[D - 1]);
                let held = at[0].max(data.config.min_model_speed);
                let missed = residual(&at);
                at = V::step(nominal, &at, held, data.config.sample_time);
                V::OUTPUTS.into_iter().zip(missed).for_each(|(place, missed)| at[place] += missed);
            }
            for (o, place) in V::OUTPUTS.into_iter().enumerate() {
                squares[o] += (at[place] - self.recorded[end][o]).powi(2);
            }
            count += 1.0;
        }
        squares.map(|square| (square / count).sqrt())
    }
}

/// The value at row `i` of the best cubic through `reach` rows on each side (Savitzky and Golay 1964). Fewer rows, if
/// one is missing.
fn smooth<const D: usize>(raw: &[Option<[f64; D]>], i: usize, reach: usize) -> Option<[f64; D]> {
    let here = raw[i]?;
    let known = |m: &usize| *m <= i && i + m < raw.len() && raw[i - m].is_some() && raw[i + m].is_some();
    let m = (1..=reach).take_while(known).last().unwrap_or(0);
    if m < 2 {
        return Some(here);
    }
    let f = m as f64;
    let norm = (2.0 * f - 1.0) * (2.0 * f + 1.0) * (2.0 * f + 3.0);
    let mut sum = [0.0; D];
    for (j, value) in (-(m as isize)..).zip(&raw[i - m..=i + m]) {
        let weight = 3.0 * (3.0 * f * f + 3.0 * f - 1.0 - 5.0 * (j * j) as f64) / norm;
        sum.iter_mut().zip((*value)?).for_each(|(sum, value)| *sum += weight * value);
    }
    Some(sum)
}
