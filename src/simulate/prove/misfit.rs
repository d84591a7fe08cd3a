//! Misfit of a plant to the logs: the simulator of the proof, driven by the logs' commands at their speeds and on their road, in
//! windows. Each starts from the measured motion a second before, which then fades.
//!
//! ```text
//! J_window = sum_k |(vy, r)_k - (vy, r)(u_k, u_{k-1}, ..)|^2         sideways velocity and yaw rate, in open loop
//! ```
//!
//! It is the vehicle without its fast motions (`vehicle/reduced/`), with tyres, compliance and steering of the plant that the proof
//! drives. In open loop an error counts by its duration, and noise does not bias the plant: no measured motion enters the prediction.

use crate::nominal::LateralVehicle;
use crate::residual::{DataSet, DriveRow, acceleration};
use crate::vehicle::{ReducedInput, ReducedStart, ReducedSteer, ReducedVehicle, Surface};

/// Length of a window, s, and of the lead-in before it, in which steering, tyres and roll come to the log's.
const WINDOW: f64 = 2.0;
const LEAD_IN: f64 = 1.0;
/// Most windows of the logs, spread evenly.
const MOST_WINDOWS: usize = 64;
/// Least cosine of a yaw error.
const LEAST_COSINE: f64 = 0.1;

/// Sideways velocity, m/s, and yaw rate, rad/s, of a plant that spins: as which it counts for the rest of a window.
const LOST: [f64; OUTPUTS] = [20.0, 5.0];

/// Outputs of a misfit: sideways velocity and yaw rate.
pub(super) const OUTPUTS: usize = 2;

/// Errors of a plant in one window: of the sideways velocity, m/s, and of the yaw rate, rad/s, step by step.
pub(super) type WindowErrors = [Vec<f64>; OUTPUTS];

/// One row of a log, as a plant meets it.
#[derive(Debug, Clone, Copy)]
struct LoggedRow {
    steer_cmd: f64,
    motion: [f64; OUTPUTS],
    vx: f64,
    accel: f64,
    articulation: [f64; 2],
    surface: Surface,
}

impl LoggedRow {
    fn new<const S: usize>(row: &DriveRow<S>, steer_cmd: f64, accel: f64) -> Self {
        let [e1, e1_rate, e2, e2_rate] = [0, 1, 2, 3].map(|i| row.state[i]);
        let [vx, curvature, _] = row.road;
        let (sin, cos) = e2.sin_cos();
        let cos = cos.max(LEAST_COSINE);
        let vy = (e1_rate - vx * sin) / cos;
        let yaw_rate = e2_rate + curvature * (vx * cos - vy * sin) / (1.0 - curvature * e1).max(LEAST_COSINE);
        let articulation = [4, 5].map(|i| row.state.get(i).copied().unwrap_or(0.0));
        Self { steer_cmd, motion: [vy, yaw_rate], vx, accel, articulation, surface: row.surface }
    }
}

/// Windows of the logs, with their lead-in.
pub(super) struct LogWindows {
    /// Rows, and the number of those of the lead-in.
    windows: Vec<(Vec<LoggedRow>, usize)>,
    step: f64,
}

impl LogWindows {
    /// Of the samples.
    pub fn of<V: LateralVehicle<S>, const S: usize>(data: &DataSet<V, S>) -> Self {
        let told = data.config();
        let step = told.sample_time;
        let [length, lead_in] = [WINDOW, LEAD_IN].map(|time| (time / step).ceil() as usize);
        let mut all = vec![];
        for stretch in data.stretches() {
            let row = |(k, row): (usize, &DriveRow<S>)| {
                // The samples have the angle at the wheels that was planned.
                let steer_cmd = (row.command - told.steer_offset) / told.steer_gain;
                LoggedRow::new(row, steer_cmd, acceleration(&stretch, k, step))
            };
            let rows: Vec<_> = stretch.iter().enumerate().map(row).collect();
            for run in rows.chunk_by(|a, b| a.vx.min(b.vx) >= told.min_model_speed) {
                for begin in (lead_in..run.len()).step_by(length) {
                    let end = (begin + length).min(run.len());
                    all.push((run[begin - lead_in..end].to_vec(), lead_in));
                }
            }
        }
        let kept = all.len().min(MOST_WINDOWS);
        let windows = (0..kept).map(|i| all[i * all.len() / kept].clone()).collect();
        Self { windows, step }
    }

    /// Number of windows.
    pub fn count(&self) -> usize {
        self.windows.len()
    }

    /// Errors of a plant in each window.
    pub fn errors(&self, plant: &mut dyn ReducedVehicle) -> Vec<WindowErrors> {
        self.windows.iter().map(|(rows, lead_in)| self.of_window(plant, rows, *lead_in)).collect()
    }

    fn of_window(&self, plant: &mut dyn ReducedVehicle, rows: &[LoggedRow], lead_in: usize) -> WindowErrors {
        let mut errors: WindowErrors = [const { Vec::new() }; OUTPUTS];
        let first = &rows[0];
        let mut lost = false;
        plant.start(&ReducedStart {
            vx: first.vx,
            vy: first.motion[0],
            yaw_rate: first.motion[1],
            yaw: 0.0,
            steer: first.steer_cmd,
            accel: first.accel,
            articulation: first.articulation[0],
            articulation_rate: first.articulation[1],
        });
        for (k, row) in rows.iter().enumerate() {
            let input = ReducedInput {
                steer: ReducedSteer::Commanded(row.steer_cmd),
                accel: row.accel,
                accel_is_given: true,
                vx: row.vx,
                yaw: None,
                surface: row.surface,
            };
            let now = plant.step(&input, self.step);
            let driven = [now.true_vy, now.true_yaw_rate];
            let is_within = driven.iter().zip(LOST).all(|(driven, limit)| driven.abs() < limit);
            lost |= !is_within;
            if k >= lead_in {
                let driven = if lost { LOST } else { driven };
                let each = errors.iter_mut().zip(driven.iter().zip(row.motion));
                each.for_each(|(errors, (driven, logged))| errors.push(driven - logged));
            }
        }
        errors
    }
}
