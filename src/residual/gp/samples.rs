//! From drives to what a Gaussian process learns: states of a bicycle model and what that model missed.
//!
//! The drives' errors and rates give the vehicle's lateral velocity and yaw rate (method of measurement as in
//! [`super`]): with `e1' = vx sin e2 + vy cos e2` and `e2' = r - kappa s'`,
//!
//! ```text
//! vy = (e1' - vx sin e2) / cos e2,   s' = (vx cos e2 - vy sin e2) / (1 - kappa e1),   r = e2' + kappa s'
//! label_k = [vy, r]_{k+1} - bicycle([vy, r]_k, vx_k, steer_k, Ts)
//! ```

use crate::nominal::Bicycle;
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
    /// Steps left out because the vehicle stood across the path or at its centre of curvature.
    pub left_out: usize,
}

/// Below this cosine of the yaw error, or share of the path's radius, the vehicle's motion cannot be told from the
/// errors.
const LEAST: f64 = 0.2;

/// Lateral velocity, m/s, and yaw rate, rad/s, of a row.
fn motion(row: &Row) -> Option<[f64; GP_OUTPUTS]> {
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
    /// The samples of all drives, for a nominal model on the data's vehicle.
    #[must_use]
    pub fn new(data: &DataSet, nominal: &Bicycle) -> Self {
        let mut samples = Self::default();
        let sample_time = data.config.sample_time;
        for stretch in data.stretches() {
            for i in 0..stretch.len().saturating_sub(1) {
                let (Some([vy, yaw_rate]), Some(next)) = (motion(&stretch[i]), motion(&stretch[i + 1]))
                else {
                    samples.left_out += 1;
                    continue;
                };
                let (vx, steer) = (stretch[i].road[0], stretch[i].command);
                let held = vx.max(data.config.min_model_speed);
                let predicted = nominal.step(vy, yaw_rate, held, steer, sample_time).value;
                let accel = dataset::acceleration(&stretch, i, sample_time);
                samples.inputs.push([vx, vy, yaw_rate, steer, accel]);
                samples.labels.push(std::array::from_fn(|o| next[o] - predicted[o]));
            }
        }
        samples
    }
}

/// Names of the inputs.
pub(super) fn input_names() -> impl Iterator<Item = &'static str> {
    ["vx", "vy", "yaw_rate", "steer_cmd", "accel"].into_iter()
}

/// Names of the outputs.
pub(super) const OUTPUT_NAMES: [&str; GP_OUTPUTS] = ["vy", "yaw_rate"];
