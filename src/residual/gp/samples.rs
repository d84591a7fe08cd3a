//! From drives to what a Gaussian process learns: states of a bicycle model and what that model missed.
//!
//! The drives' errors and rates give the vehicle's lateral velocity and yaw rate : with `e1' = vx sin e2 + vy cos e2` and `e2' = r - kappa s'`,
//!
//! ```text
//! vy = (e1' - vx sin e2) / cos e2,   s' = (vx cos e2 - vy sin e2) / (1 - kappa e1),   r = e2' + kappa s'
//! label_k = [vy, r]_{k+1} - bicycle([vy, r]_k, vx_k, steer_k, Ts)
//! ```

use crate::nominal::{Bicycle, ERRORS};
use crate::residual::dataset::{self, DataSet, Row};

/// Inputs of the process: vx, vy, yaw rate, steering command, longitudinal acceleration.
pub const INPUTS: usize = 5;
/// Its outputs: what the bicycle model misses of vy and of the yaw rate over one control step.
pub const GP_OUTPUTS: usize = 2;

/// Inputs and labels, and how many steps gave none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// Inputs: m/s, m/s, rad/s, rad, m/s2.
    pub inputs: Vec<[f64; INPUTS]>,
    /// Labels: m/s, rad/s.
    pub labels: Vec<[f64; GP_OUTPUTS]>,
    /// States as recorded: m/s, rad/s.
    recorded: Vec<[f64; GP_OUTPUTS]>,
    /// Samples before this one in its uninterrupted run.
    before: Vec<usize>,
    /// Steps left out because the vehicle stood across the path or at its centre of curvature.
    pub left_out: usize,
}

/// Below this cosine of the yaw error, or share of the path's radius, the vehicle's motion cannot be told from the
/// errors.
const LEAST: f64 = 0.2;

/// Lateral velocity, m/s, and yaw rate, rad/s, of a row.
fn motion(row: &Row<ERRORS>) -> Option<[f64; GP_OUTPUTS]> {
    let ([e1, e1_rate, e2, e2_rate], [vx, curvature, _]) = (row.state, row.road);
    let (sin, cos) = e2.sin_cos();
    let radius = 1.0 - curvature * e1;
    if cos < LEAST || radius < LEAST {
        return None;
    }
    let vy = (e1_rate - vx * sin) / cos;
    let speed = (vx * cos - vy * sin) / radius;
    Some([vy, e2_rate + curvature * speed])
}

impl Samples {
    /// The samples of all drives, for a nominal model on the data's vehicle, with velocity and yaw rate smoothed over
    /// `smoothing` rows on each side.
    #[must_use]
    pub fn new(data: &DataSet, nominal: &Bicycle, smoothing: usize) -> Self {
        let mut samples = Self::default();
        let sample_time = data.config.sample_time;
        for stretch in data.stretches() {
            let raw: Vec<Option<[f64; GP_OUTPUTS]>> = stretch.iter().map(motion).collect();
            let mut run = 0;
            for i in 0..stretch.len().saturating_sub(1) {
                let (Some([vy, yaw_rate]), Some(next)) =
                    (smooth(&raw, i, smoothing), smooth(&raw, i + 1, smoothing))
                else {
                    samples.left_out += 1;
                    run = 0;
                    continue;
                };
                let (vx, steer) = (stretch[i].road[0], stretch[i].command);
                let held = vx.max(data.config.min_model_speed);
                let predicted = nominal.step(vy, yaw_rate, held, steer, sample_time).value;
                let accel = dataset::acceleration(&stretch, i, sample_time);
                samples.inputs.push([vx, vy, yaw_rate, steer, accel]);
                samples.labels.push(std::array::from_fn(|o| next[o] - predicted[o]));
                samples.recorded.push(raw[i].unwrap_or([vy, yaw_rate]));
                samples.before.push(run);
                run += 1;
            }
        }
        samples
    }

    /// Root mean square error of the states predicted freely over `steps` steps, with recorded speeds and commands, from
    /// each `steps / 2`-th sample on, against what was recorded. Not a number if no run is that long.
    #[cfg(feature = "cli")]
    pub(super) fn rollout(
        &self,
        data: &DataSet,
        nominal: &Bicycle,
        steps: usize,
        residual: impl Fn(&[f64; INPUTS]) -> [f64; GP_OUTPUTS],
    ) -> [f64; GP_OUTPUTS] {
        let (mut squares, mut count) = ([0.0; GP_OUTPUTS], 0.0);
        for end in (steps..self.inputs.len()).step_by((steps / 2).max(1)) {
            if self.before[end] < steps {
                continue;
            }
            let mut state = [self.inputs[end - steps][1], self.inputs[end - steps][2]];
            for &[vx, _, _, steer, accel] in &self.inputs[end - steps..end] {
                let [vy, yaw_rate] = state;
                let held = vx.max(data.config.min_model_speed);
                let believed = nominal.step(vy, yaw_rate, held, steer, data.config.sample_time).value;
                let missed = residual(&[vx, vy, yaw_rate, steer, accel]);
                state = std::array::from_fn(|o| believed[o] + missed[o]);
            }
            (0..GP_OUTPUTS).for_each(|o| squares[o] += (state[o] - self.recorded[end][o]).powi(2));
            count += 1.0;
        }
        squares.map(|square| (square / count).sqrt())
    }
}

/// The value at row `i` of the cubic that fits `reach` rows on each side best (Savitzky and Golay 1964), of fewer where a
/// row is missing.
fn smooth(raw: &[Option<[f64; GP_OUTPUTS]>], i: usize, reach: usize) -> Option<[f64; GP_OUTPUTS]> {
    let here = raw[i]?;
    let known = |m: &usize| *m <= i && i + m < raw.len() && raw[i - m].is_some() && raw[i + m].is_some();
    let m = (1..=reach).take_while(known).last().unwrap_or(0);
    if m < 2 {
        return Some(here);
    }
    let f = m as f64;
    let norm = (2.0 * f - 1.0) * (2.0 * f + 1.0) * (2.0 * f + 3.0);
    let mut sum = [0.0; GP_OUTPUTS];
    for (j, value) in (-(m as isize)..).zip(&raw[i - m..=i + m]) {
        let weight = 3.0 * (3.0 * f * f + 3.0 * f - 1.0 - 5.0 * (j * j) as f64) / norm;
        sum.iter_mut().zip((*value)?).for_each(|(sum, value)| *sum += weight * value);
    }
    Some(sum)
}

/// Names of the inputs.
pub(super) fn input_names() -> impl Iterator<Item = &'static str> {
    ["vx", "vy", "yaw_rate", "steer_cmd", "accel"].into_iter()
}

/// Names of the outputs.
pub(super) const OUTPUT_NAMES: [&str; GP_OUTPUTS] = ["vy", "yaw_rate"];
