//! The path-tracking controller: projection, speed tracking, lateral MPC, and its fallback without an answer.
//!
//! A step never leaves the vehicle without a command. If the solver misses its deadline or fails, the last plan
//! goes on; when that is used up, steering is held and the vehicle brakes. Measurements are judged first. The
//! prediction replaces an implausible one for a while, and then the vehicle stops along the road (`guard.rs`).
//!
//! Speed is given up first: it falls with a lateral error that is large and grows,
//!
//! ```text
//! v <= v_plan (FAR_E1 - ahead) / (FAR_E1 - slow_e1),     ahead = |e1| + e1' * 1 s  in the direction of e1
//! ```
//!
//! and to zero once a vehicle has left the path by a lane's width, or is turned far from it.

mod acceleration;
mod host_order;
mod locate;
mod naming;
mod resample;
mod steering;
mod stored;

use self::host_order::HostOrder;
use super::bank::{Bank, BankState, KnownActuator};
use super::clarabel_solver::BuildError;
use super::cost_term::CostTerm;
use super::fading::Fading;
use super::guard::{Guard, GuardState, Judgement};
use super::history::History;
use super::lateral::{LateralError, LateralInput, LateralMpc};
use super::longitudinal::{LongitudinalMpc, LongitudinalState};
use super::observer::{Observer, ObserverNoise};
use super::parameters::{ControllerParametersFor, NominalVehicle, SpeedController};
use super::preview::SpeedAhead;
use super::rate_sensor::RateSensor;
use super::status::ControlStatus;
use super::step::{Measurement, StepError, StepReport};
use super::tracking_qp::{QpError, QpReport, TrackingQp};
use super::variant::PredictionModelFor;
use super::vehicle::{ControlledParameters, ControlledVehicle};
use super::yaw_sensor::YawSensor;
use crate::nominal::{ERRORS, ErrorState, LateralVehicle as _, body_change};
use crate::parameter::OutOfRange;
use crate::path::{Path, SpeedLimits, SpeedPlan};
use crate::signal::Signal;
use nalgebra::SVector;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// Reasons for which a controller cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ControllerError {
    #[error(transparent)]
    Parameter(#[from] OutOfRange),
    #[error(transparent)]
    Lateral(#[from] LateralError),
    #[error("the longitudinal MPC: {0}")]
    Longitudinal(#[from] BuildError),
}

/// State of the controller between steps: the contents of a saved state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ControllerState<const S: usize = ERRORS> {
    /// Steering command in force without the part that takes up backlash; none before the first step.
    steer_cmd: Option<f64>,
    /// That part, rad.
    taken_up: f64,
    /// Dither in that command, rad.
    dither: f64,
    /// Newest plan of the steering.
    plan: Vec<f64>,
    /// Steps since the plan was made.
    plan_age: usize,
    history: History<S>,
    observer: Observer<S>,
    /// None where the prediction has no actuator to find.
    bank: Option<BankState>,
    guard: GuardState,
    rate_sensor: RateSensor,
    yaw_sensor: YawSensor,
    /// Trust in the learned model.
    fading: Fading<S>,
    /// Time of the last step, s, where it was given.
    time: Option<f64>,
    host_order: HostOrder,
    /// True once the vehicle has been near the path.
    on_path: bool,
    /// Share of the planned speed that the lateral error leaves.
    speed_share: f64,
    /// Station of the last step.
    station: Option<f64>,
    /// Distance driven along the path.
    travelled: f64,
    speed_integral: f64,
    /// Acceleration of drive and brakes by their lag, m/s2.
    drive: f64,
    /// Time for which the vehicle has rolled back, s.
    rolled_back: f64,
    /// None where the speed is not tracked by MPC.
    longitudinal: Option<LongitudinalState>,
    finished: bool,
    /// Steps made.
    steps: u64,
    last: StepReport,
}

/// Uncertainty of the actuator's delay at which the loop is half way from calm to tight, s: a tight loop stands it
/// three times over.
const SURE: f64 = 0.015;

/// Lateral acceleration that a road may ask for at once, m/s2. A vehicle that does not turn yet is a hand's breadth off
/// the path by the time it turns.
const START_LATERAL_ACCEL: f64 = 0.3;
/// Share of the steering's rate and of the lateral jerk that the speed plan uses: the rest is for errors.
const PLANNED_SHARE: f64 = 0.5;

/// Share of a sample time that the rounding of a clock may make.
const ROUNDING: f64 = 1e-6;
/// Yaw angle from which on a number holds no direction to a part in a million, rad.
const LARGEST_YAW: f64 = 1e9;
/// Lateral error beyond which there is a fault and speed is given up first: a lane's width, m.
const FAR_E1: f64 = 3.5;
/// Yaw error beyond which there is a fault, too, rad, unless the road turns by as much within the vehicle's length.
const FAR_E2: f64 = 1.0;
/// A vehicle beside the path aims at a parallel path this many seconds of travel away: it bounds the approach angle.
const APPROACH_TIME: f64 = 0.2;
/// ... and at least this far away, m.
const APPROACH_E1: f64 = 0.2;
/// Share of the grip that turns a vehicle back to a path far away.
const FAR_GRIP_SHARE: f64 = 0.4;
/// The path's end counts as reached this far before it, m; twice as far before it no longer.
const END_DISTANCE: f64 = 0.5;

/// The controller of a car.
pub type Controller = ControllerFor<NominalVehicle, ERRORS>;

/// The controller of a kind of vehicle with parameters `G` of its own and `S` states.
pub struct ControllerFor<G: ControlledParameters<S>, const S: usize> {
    parameters: ControllerParametersFor<G>,
    path: Arc<Path>,
    plan: Arc<SpeedPlan>,
    lateral: LateralMpc<S>,
    longitudinal: Option<LongitudinalMpc>,
    noise: ObserverNoise<S>,
    bank: Option<Bank>,
    /// Certainty of the actuator without a bank: 1 where it is given, else 0.
    told: f64,
    guard: Guard<G::Vehicle, S>,
    state: ControllerState<S>,
}

impl<G: ControlledParameters<S>, const S: usize> ControllerFor<G, S> {
    /// Sets the controller up for a path. It first predicts with the linear model behind the steering actuator of the
    /// parameters, and then with the one that the drive shows.
    ///
    /// # Errors
    /// A parameter out of range.
    pub fn new(parameters: ControllerParametersFor<G>, path: Arc<Path>) -> Result<Self, ControllerError> {
        let known = parameters.actuator.actuator();
        Self::predicting_with(parameters, path, PredictionModelFor::Adaptive(known))
    }

    /// Sets a controller up that predicts with a model of choice.
    ///
    /// # Errors
    /// A parameter out of range; a residual that was learned for another vehicle or sample time.
    pub fn predicting_with(
        parameters: ControllerParametersFor<G>,
        path: Arc<Path>,
        model: PredictionModelFor<G::Vehicle, S>,
    ) -> Result<Self, ControllerError> {
        const { assert!(S >= ERRORS, "a state begins with the errors to the path") };
        parameters.check()?;
        let (speed, mpc, vehicle) = (&parameters.speed, &parameters.mpc, parameters.vehicle.nominal());
        let steered = |bound: f64| if mpc.follow_road == 1 { PLANNED_SHARE * bound } else { f64::INFINITY };
        let limits = SpeedLimits {
            lateral_accel: speed.lateral_accel,
            accel: speed.accel,
            decel: speed.decel,
            brake_decel: speed.brake_decel,
            speed: speed.limit,
            curvature_rate: steered(mpc.steer_rate_max / vehicle.wheelbase()),
            turn: Some(parameters.tightest_turn()),
            lateral_jerk: steered(mpc.lateral_jerk_max),
            grip: speed.grip,
            axles: parameters.axles,
        };
        let plan = path.plan_to_the_end(&limits);
        let further = parameters.vehicle.further_states();
        let noise = ObserverNoise::new(&parameters.observer, &further, parameters.mpc.sample_time);
        let bank = match &model {
            PredictionModelFor::Adaptive(known) => {
                Some(Bank::new(*known, parameters.actuator.backlash, parameters.mpc.sample_time))
            }
            // A residual holds the actuator; the road is followed ahead of it.
            PredictionModelFor::Residual(_) if parameters.mpc.follow_road == 1 => {
                let actuator = parameters.actuator;
                Some(Bank::new(actuator.actuator(), actuator.backlash, parameters.mpc.sample_time))
            }
            _ => None,
        };
        let told = if matches!(model, PredictionModelFor::Actuator(_)) { 1.0 } else { 0.0 };
        let guard = Guard::new(
            parameters.guard,
            &parameters.observer,
            &further,
            parameters.vehicle.nominal(),
            parameters.mpc.min_model_speed,
        );
        let lateral = LateralMpc::new(parameters.vehicle.nominal(), parameters.mpc, &further, model)?;
        let longitudinal = match speed.tracked_by() {
            SpeedController::Pi => None,
            SpeedController::Mpc => {
                Some(LongitudinalMpc::new(parameters.longitudinal, speed, &parameters.mpc)?)
            }
        };
        let state = ControllerState {
            steer_cmd: None,
            taken_up: 0.0,
            dither: 0.0,
            plan: vec![0.0; parameters.mpc.horizon],
            plan_age: parameters.mpc.horizon,
            history: History::new(lateral.window()),
            observer: Observer::default(),
            bank: bank.as_ref().map(Bank::state),
            guard: GuardState::default(),
            rate_sensor: RateSensor::new(&parameters.observer),
            yaw_sensor: YawSensor::new(&parameters.observer),
            fading: Fading::default(),
            time: None,
            host_order: HostOrder::default(),
            on_path: false,
            speed_share: 1.0,
            station: None,
            travelled: 0.0,
            speed_integral: 0.0,
            drive: 0.0,
            rolled_back: 0.0,
            longitudinal: longitudinal.as_ref().map(LongitudinalMpc::state),
            finished: false,
            steps: 0,
            last: StepReport::default(),
        };
        Ok(Self { parameters, path, plan, lateral, longitudinal, noise, bank, told, guard, state })
    }

    /// Adds a term to the cost of the steering.
    ///
    /// # Errors
    /// A problem that the solver refuses.
    pub fn add_cost(&mut self, term: Box<dyn CostTerm>) -> Result<(), ControllerError> {
        Ok(self.lateral.add_cost(term).map_err(LateralError::from)?)
    }

    /// One control step. The commands hold until the next one, `mpc.sample_time` later.
    ///
    /// # Errors
    /// A first measurement that is not finite; nothing has changed then.
    pub fn step(&mut self, measurement: &Measurement) -> Result<&StepReport, StepError> {
        self.state.time = None;
        self.state.host_order = HostOrder::default();
        self.step_after(measurement, self.parameters.mpc.sample_time)
    }

    /// One control step at a time, s, in a host whose steps are not those of the controller. The commands of the step
    /// before were in force until now.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_at(&mut self, time: f64, measurement: &Measurement) -> Result<&StepReport, StepError> {
        self.step_within(time, 0.0, measurement)
    }

    /// The same in a host's step of `step` s from that time on: the measurement is of its beginning, or of its end where the host
    /// has stepped the vehicle first, which the drive shows.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_within(
        &mut self,
        time: f64,
        step: f64,
        measurement: &Measurement,
    ) -> Result<&StepReport, StepError> {
        let sample_time = self.parameters.mpc.sample_time;
        let elapsed = self.state.time.map_or(sample_time, |before| time - before);
        // A clock that stands still or runs back says nothing.
        let elapsed = if elapsed > 0.0 && elapsed.is_finite() { elapsed } else { sample_time };
        let (order, way) = (self.state.host_order, self.state.guard.way_to(measurement));
        let elapsed = self.state.host_order.elapsed(elapsed, time + step, way, &self.parameters.observer);
        // Of a host's clock the last digits are rounding: in every host a sample time is the same.
        let elapsed = if (elapsed / sample_time - 1.0).abs() < ROUNDING { sample_time } else { elapsed };
        let before = self.state.time.replace(time);
        if let Err(error) = self.step_after(measurement, elapsed) {
            (self.state.time, self.state.host_order) = (before, order);
            return Err(error);
        }
        Ok(&self.state.last)
    }

    /// The signals for which the prediction stands in.
    pub fn bridged_signals(&self) -> impl Iterator<Item = &'static Signal> {
        self.state.guard.bridged()
    }

    /// One control step, so many seconds after the one before.
    fn step_after(&mut self, measurement: &Measurement, elapsed: f64) -> Result<&StepReport, StepError> {
        let begin = Instant::now();
        let mut seen = *measurement;
        if seen.yaw.abs() > LARGEST_YAW {
            seen.yaw = f64::NAN;
        }
        // Plans, predictions and commands kept are of the angle at the wheels.
        seen.steer = self.parameters.actuator.at_wheels(seen.steer);
        // The angle at the wheels is what the body answers to.
        let angle = match (&self.bank, &self.state.bank) {
            (Some(bank), Some(state)) => bank.angle_now(state),
            _ => self.state.steer_cmd,
        };
        let commands = [angle.unwrap_or(seen.steer), self.state.last.accel_cmd];
        let on_road = |pose: &Measurement| {
            let at = self.path.project(pose.x, pose.y, pose.yaw, None);
            at.e1.abs() <= FAR_E1 && at.e2.abs() <= FAR_E2
        };
        let had_lost_rate = self.state.guard.has_lost_rate();
        let verdict = self.guard.judge(&mut self.state.guard, &mut seen, elapsed, commands, on_road)?;
        if verdict == Judgement::Moved {
            self.forget();
            self.state.rate_sensor.move_to(seen.yaw, &self.parameters.observer);
            self.state.yaw_sensor.forget_place();
        }
        if !had_lost_rate && self.state.guard.has_lost_rate() {
            // What it was taught is of a sensor that was wrong.
            self.state.observer.reset();
        }
        let bridged = verdict == Judgement::Bridged;
        let stops = self.guard.stops(&self.state.guard);
        // The report has the errors as measured; what is known of the sensor's is for the control.
        let mut report = self.locate(&seen);
        let measured = seen.yaw_rate;
        let offset = self.yaw_offset(&seen, bridged, elapsed);
        seen.yaw_rate = self.corrected_rate(&seen, bridged, elapsed);
        let measurement = &seen;
        let far = report.e1.abs() > FAR_E1 || report.e2.abs() > FAR_E2;
        let previous = self.state.steer_cmd.unwrap_or(measurement.steer);
        let rolled_back = self.rolls_back(measurement.vx, elapsed);
        self.command_speed(measurement, far, stops || rolled_back, elapsed, &mut report, begin);

        let e2_rate = report.e2_rate + (measurement.yaw_rate - measured);
        let e2 = report.e2 + offset;
        let (sin, cos) = e2.sin_cos();
        let e1_rate =
            if offset == 0.0 { report.e1_rate } else { measurement.vx * sin + measurement.vy * cos };
        let errors = ErrorState::new(report.e1, e1_rate, e2, e2_rate);
        let state = G::Vehicle::state(&errors, measurement);
        self.state.history.observe(&state, previous);
        if let (Some(bank), Some(state)) = (&self.bank, &mut self.state.bank) {
            let issued = previous + self.parameters.actuator.gain * self.state.taken_up;
            bank.observe(state, measurement, issued, !bridged);
        }
        if bridged || far {
            self.state.fading.expect(None);
        }
        let variance = self.noise.variance(measurement.vx);
        self.state.fading.observe(&state, &variance, elapsed);
        let observer = self.parameters.observer;
        let mut estimate = state;
        if far {
            self.state.observer.reset();
        } else if observer.is_on() {
            estimate = self.state.observer.observe(&state, measurement.vx, &self.noise);
        }
        // What the filter moves of the errors, it moves of the body's own velocities.
        let moved = body_change(&(estimate - state).fixed_rows::<ERRORS>(0).into_owned(), measurement.vx);
        let motion = [measurement.vx, measurement.vy + moved[0], measurement.yaw_rate + moved[1]];
        // The plan goes on from its own command: dither that it went on from would add up.
        let own = previous - self.state.dither;
        let solved = self.solve(&estimate, motion, own, far, &report, begin);
        self.command_steering(solved, own, far, &mut report);
        self.name_status(bridged, stops, rolled_back, &mut report);
        let planned = report.steer_cmd;
        if report.status == ControlStatus::Optimal {
            report.steer_cmd += self.dither();
        }
        let rate = self.largest_rate(&estimate, measurement.vx, far);
        report.steer_cmd = self.within_bounds(report.steer_cmd, previous, rate);
        if self.parameters.mpc.dither > 0.0 && self.parameters.mpc.follow_road == 1 {
            self.state.dither = report.steer_cmd - planned;
        }
        let past = self.state.history.commands();
        if observer.is_on()
            && !far
            && let Some(next) = self.lateral.next_state(&estimate, past, report.steer_cmd)
        {
            self.state.observer.expect(next);
        }
        if !bridged && !far && self.parameters.guard.active != 0 {
            let expected = self.lateral.without_and_with_learned(&state, past, report.steer_cmd);
            self.state.fading.expect(expected);
        }

        if let Some(longitudinal) = &mut self.longitudinal {
            // A safe hold has brought a command of its own.
            longitudinal.override_command(report.accel_cmd);
            self.state.longitudinal = Some(longitudinal.state());
        }
        let lag = self.parameters.longitudinal.drive_lag;
        let kept = if lag > 0.0 { (-self.parameters.mpc.sample_time / lag).exp() } else { 0.0 };
        self.state.drive = report.accel_cmd + (self.state.drive - report.accel_cmd) * kept;
        self.state.steer_cmd = Some(report.steer_cmd);
        let [steer, previous] = [report.steer_cmd, previous].map(|angle| self.before_linkage(angle));
        report.steer_cmd = self.take_up_backlash(steer, previous);
        self.state.steps += 1;
        report.residual_outside = self.lateral.outside_training();
        report.finished = self.state.finished;
        report.compute_time = begin.elapsed().as_secs_f64();
        self.state.last = report;
        Ok(&self.state.last)
    }

    /// The yaw rate without the errors of its sensor that the drive has shown.
    fn corrected_rate(&mut self, seen: &Measurement, bridged: bool, elapsed: f64) -> f64 {
        let (sensor, noise) = (&mut self.state.rate_sensor, &self.parameters.observer);
        if noise.yaw_rate_bias == 0.0 {
            return seen.yaw_rate;
        }
        if self.state.guard.has_lost_rate() {
            // What it seemed to show was of a sensor that says nothing; its estimate comes of the model.
            *sensor = RateSensor::new(noise);
            return seen.yaw_rate;
        }
        sensor.correct((!bridged).then_some(seen.yaw), seen.yaw_rate, elapsed, noise)
    }

    /// Offset of the yaw angle that the drive has shown, rad.
    fn yaw_offset(&mut self, seen: &Measurement, bridged: bool, elapsed: f64) -> f64 {
        let noise = &self.parameters.observer;
        if noise.yaw_offset == 0.0 {
            return 0.0;
        }
        self.state.yaw_sensor.offset(seen, !bridged, elapsed, noise)
    }

    /// Forgets the vehicle's place: the host has moved it. The commands in force stay.
    fn forget(&mut self) {
        let state = &mut self.state;
        state.plan_age = state.plan.len();
        state.history.forget_states();
        state.observer.reset();
        state.fading.expect(None);
        (state.on_path, state.speed_share) = (false, 1.0);
        (state.station, state.travelled, state.finished) = (None, 0.0, false);
        (state.speed_integral, state.rolled_back) = (0.0, 0.0);
        if let Some(longitudinal) = &mut self.longitudinal {
            longitudinal.reset();
        }
    }

    /// Seconds that are left to a solver in a step that began then.
    fn time_left(&self, begin: Instant) -> f64 {
        match self.parameters.mpc.deadline {
            deadline if deadline > 0.0 => (deadline - begin.elapsed().as_secs_f64()).max(0.0),
            _ => f64::INFINITY,
        }
    }

    /// Solves the lateral MPC for a measured or estimated state.
    fn solve(
        &mut self,
        state: &SVector<f64, S>,
        [speed, vy, yaw_rate]: [f64; 3],
        previous: f64,
        far: bool,
        report: &StepReport,
        begin: Instant,
    ) -> Result<QpReport, QpError> {
        let p = &self.parameters.mpc;
        // The model does not depend on e1: to bound it is to follow a parallel path that comes closer with the
        // vehicle. Without that, a large error is answered by a turn across the path that the horizon, 0.3 s, is too
        // short to see the end of.
        let bound = (APPROACH_TIME * speed.abs()).max(APPROACH_E1).min(p.e1_max);
        let mut aim = *state;
        aim[0] = state[0].clamp(-bound, bound);
        aim[2] = state[2].clamp(-FAR_E2, FAR_E2);
        let time_limit = self.time_left(begin);
        let predicted = self.longitudinal.as_ref().map_or(&[][..], LongitudinalMpc::predicted_speeds);
        let memory = &self.state;
        let disturbance = memory.observer.disturbance(&self.noise);
        let known = memory.bank.as_ref().map(BankState::known);
        // Far from its path a vehicle has time.
        let back = if far { FAR_GRIP_SHARE * self.parameters.speed.grip } else { f64::INFINITY };
        self.lateral.step(&LateralInput {
            state: &aim,
            vy,
            yaw_rate,
            history: &memory.history,
            last_plan: memory.plan.get(memory.plan_age + 1..).unwrap_or_default(),
            station: report.station,
            ahead: SpeedAhead { speed, accel: report.accel_cmd, predicted },
            previous,
            rate_max: self.largest_rate(state, speed, far),
            path: &self.path,
            disturbance: &disturbance,
            residual_share: if far { 0.0 } else { self.residual_share() },
            time_limit,
            actuator: known.map(|known| known.actuator),
            tightness: known.map_or(self.told, |known| tightness(&known)),
            lateral_accel: p.lateral_accel_max.min(back),
        })
    }

    /// Share of the learned model that is used.
    fn residual_share(&self) -> f64 {
        if self.parameters.guard.active == 0 { 1.0 } else { self.state.fading.share() }
    }

    /// The newest step's report.
    #[must_use]
    pub fn report(&self) -> &StepReport {
        &self.state.last
    }

    /// The lateral MPC with its newest problem and prediction.
    #[must_use]
    pub fn lateral(&self) -> &LateralMpc<S> {
        &self.lateral
    }

    /// The steering actuator as the drive has shown it; none where the prediction has none to find.
    #[must_use]
    pub fn known_actuator(&self) -> Option<KnownActuator> {
        self.state.bank.as_ref().map(BankState::known)
    }

    /// The longitudinal MPC, where the speed is tracked by one.
    #[must_use]
    pub fn longitudinal(&self) -> Option<&LongitudinalMpc> {
        self.longitudinal.as_ref()
    }

    /// The newest QP.
    #[must_use]
    pub fn problem(&self) -> &TrackingQp {
        self.lateral.problem()
    }

    /// Initial speed of a vehicle that is put on the path without turning, m/s. It is that of the plan, but lower where
    /// the road bends: the vehicle must stay on the path until it has begun to turn.
    #[must_use]
    pub fn start_speed(&self) -> f64 {
        let planned = self.plan.speed(0.0);
        if self.parameters.mpc.follow_road == 0 {
            return planned;
        }
        planned.min((START_LATERAL_ACCEL / self.path.curvature(0.0).abs().max(1e-9)).sqrt())
    }

    /// The speed plan on the path.
    #[must_use]
    pub fn speed_plan(&self) -> &SpeedPlan {
        &self.plan
    }

    /// The path that is followed.
    #[must_use]
    pub fn path(&self) -> &Arc<Path> {
        &self.path
    }

    /// The parameters in force.
    #[must_use]
    pub fn parameters(&self) -> &ControllerParametersFor<G> {
        &self.parameters
    }
}

/// Certainty of the actuator in the prediction, 0 to 1.
fn tightness(known: &KnownActuator) -> f64 {
    let (sure, spread) = (SURE * SURE, known.spread * known.spread);
    sure / (sure + spread)
}
