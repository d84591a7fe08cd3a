//! The status of a step: the most important of what happened in it.

use super::ControllerFor;
use crate::control::status::ControlStatus;
use crate::control::step::StepReport;
use crate::control::vehicle::ControlledParameters;

impl<G: ControlledParameters<S>, const S: usize> ControllerFor<G, S> {
    /// Status of the step, and the brakes at the road's end.
    pub(super) fn name_status(&self, bridged: bool, stops: bool, rolled_back: bool, report: &mut StepReport) {
        use ControlStatus::{Bridged, FarFromPath, Finished, Optimal, ReducedAccuracy};
        use ControlStatus::{ResidualFaded, RolledBack, SafeHold, SafeStop, Slowed};
        let planned = matches!(report.status, Optimal | ReducedAccuracy);
        let of_residual = self.state.fading.faded() && self.lateral.is_learned();
        if stops && report.status != SafeHold {
            report.status = SafeStop;
        } else if bridged && (planned || report.status == FarFromPath) {
            report.status = Bridged;
        } else if planned && rolled_back {
            report.status = RolledBack;
        } else if planned && self.state.speed_share < 1.0 {
            report.status = Slowed;
        } else if planned && of_residual {
            report.status = ResidualFaded;
        }
        if self.state.finished && !self.path.is_periodic() {
            report.status = Finished;
            report.accel_cmd = -self.parameters.speed.safe_decel;
        }
    }
}
