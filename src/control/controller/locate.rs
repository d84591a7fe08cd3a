//! Where the vehicle is on its path, and what the step's report says before the command is known.

use super::{ControllerFor, END_DISTANCE, FAR_E1};
use crate::control::step::{Measurement, StepReport};
use crate::control::vehicle::ControlledParameters;

impl<G: ControlledParameters<S>, const S: usize> ControllerFor<G, S> {
    /// Projects the vehicle onto the path and keeps count of the way.
    pub(super) fn locate(&mut self, measurement: &Measurement) -> StepReport {
        let Measurement { x, y, yaw, vx, vy, yaw_rate, .. } = *measurement;
        let mut at = self.path.project(x, y, yaw, self.state.station);
        if self.state.station.is_some() && at.e1.abs() > 4.0 * FAR_E1 {
            // Lost: another part of the path may be the right one.
            at = self.path.project(x, y, yaw, None);
        }
        let length = self.path.length();
        if let Some(before) = self.state.station {
            let mut advance = at.station - before;
            if self.path.is_periodic() {
                advance -= length * (advance / length).round();
            }
            self.state.travelled += advance;
        }
        self.state.station = Some(at.station);
        self.state.finished = if self.path.is_periodic() {
            self.state.travelled >= length
        } else {
            let near = if self.state.finished { 2.0 * END_DISTANCE } else { END_DISTANCE };
            // Far beside the end nothing has been driven to it.
            at.station >= length - near && at.e1.abs() <= FAR_E1
        };
        let (e1_rate, e2_rate) = at.error_rates(vx, vy, yaw_rate);
        StepReport {
            e1: at.e1,
            e1_rate,
            e2: at.e2,
            e2_rate,
            station: at.station,
            curvature: at.curvature,
            curvature_rate: self.path.curvature_rate(at.station),
            ..StepReport::default()
        }
    }
}
