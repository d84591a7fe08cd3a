//! The steering command of a step: of the new plan or the last one, within its bounds, with dither and for backlash.

use super::{ControllerFor, StepReport};
use crate::control::status::ControlStatus;
use crate::control::tracking_qp::{QpEnd, QpError, QpReport};
use crate::control::vehicle::ControlledParameters;
use crate::nominal::LateralVehicle as _;
use crate::numerics::Random;
use nalgebra::SVector;

/// Steps for which a value of the dither is held: 40 ms at Ts = 0.02 s. Held for 0.1 s it does not excite the vehicle
/// above 5 Hz. A model learned from it is wrong at the frequencies of a tight controller.
const DITHER_HOLD: u64 = 2;
/// Least time to take up the steering's backlash, s, and share of the gap that is left of it: the plan moves by as much.
const TAKE_UP_TIME: f64 = 0.1;
const BACKLASH_SHARE: f64 = 0.25;

impl<G: ControlledParameters<S>, const S: usize> ControllerFor<G, S> {
    /// The steering command: of the new plan, or else of the last one, or else held.
    pub(super) fn command_steering(
        &mut self,
        solved: Result<QpReport, QpError>,
        previous: f64,
        far: bool,
        report: &mut StepReport,
    ) {
        match solved {
            Ok(qp) => {
                self.state.plan.copy_from_slice(self.lateral.plan());
                self.state.plan_age = 0;
                report.iterations = qp.iterations;
                report.status = match qp.end {
                    _ if far => ControlStatus::FarFromPath,
                    QpEnd::Solved => ControlStatus::Optimal,
                    QpEnd::ReducedAccuracy => ControlStatus::ReducedAccuracy,
                };
            }
            Err(error) => {
                self.state.plan_age += 1;
                report.status = match error {
                    QpError::TimeLimit { .. } => ControlStatus::DeadlineMissed,
                    _ => ControlStatus::SolverFailed,
                };
            }
        }
        let planned = self.state.plan.get(self.state.plan_age).copied();
        if planned.is_none() {
            report.status = ControlStatus::SafeHold;
            report.accel_cmd = -self.parameters.speed.safe_decel;
        }
        report.steer_cmd = planned.unwrap_or(previous);
    }

    /// A steering command within its bounds. The plan respects them to the solver's tolerance, the command does exactly; and
    /// no measurement moves it faster than the lateral acceleration may change.
    pub(super) fn within_bounds(&self, steer: f64, previous: f64, rate: f64) -> f64 {
        let p = &self.parameters.mpc;
        let most = rate * p.sample_time;
        steer.clamp(previous - most, previous + most).clamp(-p.steer_max, p.steer_max)
    }

    /// Largest rate of the steering with errors to the path, rad/s. Far from its path a vehicle has time.
    pub(super) fn largest_rate(&self, errors: &SVector<f64, S>, speed: f64, far: bool) -> f64 {
        let wheelbase = self.parameters.vehicle.nominal().wheelbase();
        let errors = if far { [0.0; 2] } else { [errors[0], errors[1]] };
        self.parameters.mpc.steer_rate_at(speed, wheelbase, errors)
    }

    /// The command for an angle at the wheels, before the linkage's known gain and offset, within its bounds.
    pub(super) fn before_linkage(&self, angle: f64) -> f64 {
        let p = &self.parameters;
        p.actuator.before_linkage(angle).clamp(-p.mpc.steer_max, p.mpc.steer_max)
    }

    /// The command beyond the steering's known gap. The wheels follow on the side that the plan moves to: the command goes
    /// over to it while the plan goes back by a share of the gap, so that noise does not chatter.
    pub(super) fn take_up_backlash(&mut self, steer: f64, previous: f64) -> f64 {
        let p = &self.parameters;
        let half = 0.5 * self.state.bank.as_ref().map_or(p.actuator.backlash, |bank| bank.known().backlash);
        let before = self.state.taken_up;
        if half == 0.0 && before == 0.0 {
            return steer;
        }
        let most = 2.0 * half.max(before.abs()) * (p.mpc.sample_time / TAKE_UP_TIME).min(1.0);
        let towards = ((steer - previous) / BACKLASH_SHARE).clamp(-most, most);
        // A width that the drive shows may become another one: the command does not jump by it.
        self.state.taken_up = (before + towards).clamp(-half, half).clamp(before - most, before + most);
        (steer + self.state.taken_up).clamp(-p.mpc.steer_max, p.mpc.steer_max)
    }

    /// Random steering for collecting drives to learn from, rad; 0 unless asked for.
    pub(super) fn dither(&self) -> f64 {
        let p = &self.parameters.mpc;
        if p.dither == 0.0 {
            return 0.0;
        }
        let draw = self.state.steps / DITHER_HOLD;
        let mut random = Random::new(draw.wrapping_mul(1 << 20).wrapping_add(p.dither_seed as u64));
        p.dither * (2.0 * random.uniform() - 1.0)
    }
}
