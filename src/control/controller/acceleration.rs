//! The acceleration command of a step: the speed plan's, within what the road's grip leaves, and the stops.
//!
//! Speed is given up first (see [`super`]). Bounds are of the vehicle's acceleration; what holds it on a slope that the path
//! tells of comes on top.

use super::{ControllerFor, FAR_E1, FAR_E2, StepReport};
use crate::control::grip::{LEAST_SHARE, RoadAhead, beside};
use crate::control::longitudinal::LongitudinalInput;
use crate::control::parameters::SpeedParameters;
use crate::control::speed::track_speed;
use crate::control::step::Measurement;
use crate::control::vehicle::ControlledParameters;
use std::time::Instant;

/// Speed at which a far vehicle comes back, m/s.
const APPROACH_SPEED: f64 = 3.0;
/// Look-ahead of the trend of the lateral error, s.
const TREND_TIME: f64 = 1.0;
/// Time in which the speed comes back after the lateral error has taken it, s.
const RECOVERY_TIME: f64 = 2.0;
/// Speed backwards, m/s, and time of it, s, after which a vehicle that is to drive has rolled back on a slope.
const ROLLS_BACK: f64 = 0.1;
const ROLL_BACK_TIME: f64 = 2.0;

impl<G: ControlledParameters<S>, const S: usize> ControllerFor<G, S> {
    /// True if the vehicle has rolled back for a while: its drive does not hold it on its slope. It is true until the host
    /// moves the vehicle.
    pub(super) fn rolls_back(&mut self, speed: f64, elapsed: f64) -> bool {
        let state = &mut self.state;
        if state.rolled_back < ROLL_BACK_TIME {
            state.rolled_back = if speed < -ROLLS_BACK { state.rolled_back + elapsed } else { 0.0 };
        }
        self.parameters.guard.active != 0 && state.rolled_back >= ROLL_BACK_TIME
    }

    /// Tracks the speed plan. The speed falls if the vehicle is far from the path or leaves it. It falls to zero once
    /// the vehicle has left it or is to stop.
    pub(super) fn command_speed(
        &mut self,
        seen: &Measurement,
        far: bool,
        stops: bool,
        elapsed: f64,
        report: &mut StepReport,
        begin: Instant,
    ) {
        let speed = seen.vx;
        let time_limit = self.time_left(begin);
        let planned = self.plan.speed(report.station);
        let limit = self.speed_limit(far, planned, elapsed, report);
        let brakes = stops || self.state.speed_share < 1.0;
        let p = &self.parameters;
        let road = RoadAhead::look(&self.path, report.station, speed, p.speed.grip, &p.axles);
        let RoadAhead { lateral, brakes: stops_by, drives, holding } = road;
        // Brakes act against the motion, and hold a standing vehicle against either slope.
        let pull = if speed > ROLLS_BACK { -holding } else { holding.abs() };
        // Off its path a vehicle may turn faster than its road: brakes would take the grip that brings it back. A safe stop cannot
        // count on the measured rate.
        let turning = if stops { 0.0 } else { (speed * seen.yaw_rate).abs() };
        let braking = (self.braking(lateral.max(turning)) + pull.max(0.0)).min(stops_by);
        let integral = self.state.speed_integral;
        let drives = drives.min(self.catching_up(lateral) + integral.max(0.0) + holding.max(0.0));
        if let Some(longitudinal) = &mut self.longitudinal {
            let step = longitudinal.step(&LongitudinalInput {
                station: report.station,
                speed,
                elapsed,
                plan: &self.plan,
                path: &self.path,
                speed_limit: limit,
                time_limit,
            });
            (report.speed_ref, report.lag_error) = (step.speed_ref, step.lag_error);
            report.accel_cmd = step.accel_cmd;
        } else {
            let p = &self.parameters;
            let lag = p.longitudinal.drive_lag;
            let (accel, ahead) = (self.plan.accel(report.station), report.station + lag * speed.max(0.0));
            let mut target = (planned + lag * accel, self.plan.accel(ahead));
            if planned > limit {
                target = (limit, 0.0);
            }
            // The bounds are of the vehicle's acceleration, what holds it on its slope comes on top.
            let bounded = SpeedParameters {
                accel_cmd_max: p.speed.accel_cmd_max.min(drives - holding),
                decel_cmd_max: p.speed.decel_cmd_max.min(stops_by + holding),
                ..p.speed
            };
            let output = speed + lag * (self.state.drive - holding);
            let command = track_speed(&bounded, target, output, self.state.speed_integral, p.mpc.sample_time);
            self.state.speed_integral = command.integral;
            (report.speed_ref, report.accel_cmd) = (planned.min(limit), command.accel_cmd + holding);
        }
        report.accel_cmd = report.accel_cmd.clamp(-stops_by, drives);
        if stops {
            (report.speed_ref, report.accel_cmd) = (0.0, -braking);
            self.state.speed_integral = integral;
        } else if brakes {
            report.accel_cmd = report.accel_cmd.max(-braking);
        }
    }

    /// Speed that the lateral error allows, m/s; infinite for any.
    fn speed_limit(&mut self, far: bool, planned: f64, elapsed: f64, report: &StepReport) -> f64 {
        let guard = &self.parameters.guard;
        let state = &mut self.state;
        state.on_path |= !far && report.e1.abs() < guard.slow_e1;
        let guarded = guard.active != 0 && state.on_path;
        if far {
            let turned = || self.path.least_turn(report.station, report.e2).abs() > FAR_E2;
            let stops = guarded && (report.e1.abs() > FAR_E1 || turned());
            return if stops { 0.0 } else { APPROACH_SPEED };
        }
        let growth = report.e1.signum() * report.e1_rate;
        let mut share = 1.0;
        if guarded && report.e1.abs() > guard.slow_e1 && growth > 0.0 {
            let ahead = report.e1.abs() + growth * TREND_TIME;
            share = ((FAR_E1 - ahead) / (FAR_E1 - guard.slow_e1)).clamp(0.0, 1.0);
        }
        state.speed_share = share.min(state.speed_share + elapsed / RECOVERY_TIME);
        if state.speed_share < 1.0 { planned * state.speed_share } else { f64::INFINITY }
    }

    /// Acceleration of a vehicle that is slower than its plan, m/s2: by the plan's friction ellipse, because a road that is more
    /// slippery than it is told has no grip for both. Holding the speed against drag and slope comes on top.
    fn catching_up(&self, lateral: f64) -> f64 {
        let p = &self.parameters;
        if p.guard.active == 0 {
            return p.speed.accel_cmd_max;
        }
        let share = beside(lateral, p.speed.lateral_accel) / p.speed.lateral_accel;
        p.speed.accel_cmd_max * share.max(LEAST_SHARE)
    }

    /// Deceleration of a stop, m/s2: the safe one, or the rest of the grip after steering along the road. Speed plan
    /// and safe stop count on the same grip.
    fn braking(&self, lateral: f64) -> f64 {
        let p = &self.parameters.speed;
        let grip = p.safe_decel.max(p.lateral_accel);
        beside(lateral, grip).clamp(LEAST_SHARE * p.safe_decel, p.safe_decel)
    }
}
