//! Longitudinal MPC: from lag error and speed to an acceleration command.
//!
//! A reference point moves along the path in time, at the planned speed. With the lag error `e_l`, how far the vehicle is
//! behind it along the path,
//!
//! ```text
//! min  sum_j  q_lag e_l,j^2 + q_speed (v_j - v_ref,j)^2 + r ((a_j - a_{j-1}) / Ts)^2
//! s.t. e_l' = v_ref - v,   v' = a_d + d,   tau a_d' = a - a_d       (tau = 0: a_d = a)
//!      -decel_max <= a <= accel_max,  |a_j - a_{j-1}| <= Ts * rate_max,   v <= v_ref + overspeed_max softly
//! ```
//!
//! `a` is the command beyond what holds the vehicle on a slope that the path tells of, `g sin grade`: the bounds are of
//! the vehicle's acceleration, or no truck would climb. `d` is the acceleration of the drive beyond its command (drag,
//! slopes untold, payload), observed from the speed. Without it a slope would cause a standing lag error. The speeds of the reference are known, so that this is a QP with known
//! inputs.
//!
//! **Two QPs instead of one with the steering.** Contouring and lag error are the two components of one position error.
//! Take their joint cost (Zhao et al., Acta Automatica Sinica 2025, Table 6) to first order about driving on the
//! reference. There the steering moves only the first and the acceleration only the second, so that the Hessian is
//! block diagonal and one QP is two. This leaves out products with the curvature. A deviation of the speed turns the
//! path faster (`psi_des' = v kappa`):
//! the steering takes it into account if it predicts with [`LongitudinalMpc::predicted_speed`]. A lateral error changes
//! the way (`e_l' = .. - v kappa e1`): the joint QP would cut a bend to make up for being late, which is unwanted.
//! `tests/control_longitudinal.rs` holds both to the joint QP.
//!
//! **No divergence.** The reference point is a vehicle itself: it starts at the vehicle's place and speed and gains
//! speed no faster than the plan's acceleration. It is never further from the vehicle than `lag_max`. A vehicle that is
//! held, off the path or too weak for a slope cannot follow. The point then waits at that distance, and its speed falls
//! to the vehicle's. A jump of the station moves the point along. At the end of an open path the plan's speed is zero,
//! and the point stands there.
//!
//! Sources: contouring and lag error: Lam, Manzie and Good, Model predictive contouring control, CDC 2010. Disturbance:
//! Maeder, Borrelli and Morari, Linear offset-free model predictive control, Automatica 2009.

use super::clarabel_solver::BuildError;
use super::condense::{Affine, HorizonModel, Propagation, condense};
use super::fast_solver::build_solver;
use super::grip::holding;
use super::parameters::{MpcParameters, SpeedParameters};
use super::tracking_qp::{QpError, QpReport, QpShape, QpSolver, SoftBound, TrackingQp};
use crate::nominal::zero_order_hold;
use crate::parameters;
use crate::path::{Path, SpeedPlan};
use crate::vehicle::{CarParameters, range_of};
use nalgebra::{Matrix3, Matrix3x2, Vector3};
use serde::{Deserialize, Serialize};

/// Range of the lag of a vehicle's file.
const DRIVE_LAG: (f64, f64) = range_of(CarParameters::TABLE, "drive.lag");

parameters! {
    /// The longitudinal MPC.
    pub struct LongitudinalParameters {
        horizon: usize = 60, ONE in 2.0, 120.0; "longitudinal.horizon", "Steps of the horizon of speed and lag error: a second, or the lag error swings"
        q_lag: f64 = 10.0, ONE in 0.0, 1e6; "longitudinal.q_lag", "Weight of the squared lag error, per m2"
        q_speed: f64 = 4.0, ONE in 1e-6, 1e6; "longitudinal.q_speed", "Weight of the squared deviation from the reference speed, per (m/s)2"
        r_rate: f64 = 0.03, ONE in 1e-9, 1e6; "longitudinal.r_rate", "Weight of the squared rate of the acceleration command, per (m/s3)2"
        accel_rate_max: f64 = 10.0, ONE in 0.1, 1e3; "longitudinal.accel_rate_max", "Largest rate of the commanded acceleration, m/s3"
        lag_max: f64 = 2.0, METRE in 0.01, 100.0; "longitudinal.lag_max", "Largest distance along the path between vehicle and reference point: further away the point waits"
        overspeed_max: f64 = 0.5, METRE_PER_SECOND in 0.01, 10.0; "longitudinal.overspeed_max", "Soft bound of the speed beyond the reference speed, for catching up"
        drive_lag: f64 = 0.0, SECOND in DRIVE_LAG.0, DRIVE_LAG.1; "longitudinal.drive_lag", "Time constant of drive and brakes that speed control knows; 0 for none"
        observer_gain: f64 = 0.02, ONE in 0.0, 1.0; "longitudinal.observer_gain", "Gain for one step of the observer of drag and grade; 0 switches it off"
    }
}

/// Largest plausible acceleration beyond the command, m/s2: more is no drag and no grade.
const LARGEST_DISTURBANCE: f64 = 2.0;
/// Weights of the excess over the overspeed, per (m/s)2 and per m/s.
const OVERSPEED_PENALTY: [f64; 2] = [1000.0, 10.0];
/// The speed's lower bound, which no vehicle reaches: soft bounds have two sides, m/s.
const UNDERSPEED: f64 = -100.0;
/// Speed below which the brakes may hold a vehicle: nothing is observed then, m/s.
const STANDSTILL: f64 = 0.1;
/// Gain from the speed error to the acceleration when the solver has no answer, 1/s.
const FALLBACK_GAIN: f64 = 1.0;

/// States of the prediction: lag error, speed, acceleration of the drive.
const TRACKED: [usize; 2] = [0, 1];

/// Input of a step.
#[derive(Debug, Clone, Copy)]
pub struct LongitudinalInput<'a> {
    /// Station of the vehicle, m.
    pub station: f64,
    /// Its speed along the path, m/s.
    pub speed: f64,
    /// Time since the last step, s: the reference point has moved for as long.
    pub elapsed: f64,
    /// The plan of the speed.
    pub plan: &'a SpeedPlan,
    /// The path that it is for.
    pub path: &'a Path,
    /// A speed that is not to be exceeded now, m/s; infinite for none.
    pub speed_limit: f64,
    /// Seconds for the solver; infinite for no limit.
    pub time_limit: f64,
}

/// Decision of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LongitudinalStep {
    /// Acceleration command, m/s2; within its bounds in any case, which move with the slope.
    pub accel_cmd: f64,
    /// Distance along the path from the vehicle to the reference point, positive if the vehicle is behind, m.
    pub lag_error: f64,
    /// Speed of the reference point, m/s.
    pub speed_ref: f64,
    /// Report of the solver. Without a solution the command is a proportional speed controller's.
    pub solved: Result<QpReport, QpError>,
}

/// The reference point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct ReferencePoint {
    station: f64,
    speed: f64,
}

/// State of the MPC between steps: the contents of a saved state.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LongitudinalState {
    /// The reference point where it is to be a sample time later; none before the first step.
    reference: Option<ReferencePoint>,
    /// Command in force.
    accel_cmd: f64,
    /// Acceleration of the drive, from the commands.
    drive: f64,
    disturbance: f64,
    /// Speed that is expected a sample time later; none before the first step.
    expected_speed: Option<f64>,
}

/// The MPC with its preallocated problem.
pub struct LongitudinalMpc {
    parameters: LongitudinalParameters,
    /// The reference point's own limits: gaining and losing speed, m/s2.
    reference_accel: [f64; 2],
    sample_time: f64,
    transition: Matrix3<f64>,
    command: Vector3<f64>,
    disturbed: Vector3<f64>,
    affine: Affine<Vector3<f64>>,
    problem: TrackingQp,
    solver: Box<dyn QpSolver>,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    /// Speed of the reference at the end of each step.
    reference_speed: Vec<f64>,
    /// Speed at the end of each step of the newest prediction; empty if there is none.
    predicted: Vec<f64>,
    state: LongitudinalState,
}

impl ReferencePoint {
    /// The point a step later.
    fn next(self, input: &LongitudinalInput<'_>, [gain, loss]: [f64; 2], sample_time: f64) -> Self {
        // A little ahead even at standstill: a plan that starts from it says zero at its start.
        let ahead = self.station + (self.speed + 0.5 * gain * sample_time) * sample_time;
        let planned = input.plan.speed(ahead).min(input.speed_limit).max(0.0);
        let speed =
            planned.clamp((self.speed - loss * sample_time).max(0.0), self.speed + gain * sample_time);
        Self { station: self.station + 0.5 * (self.speed + speed) * sample_time, speed }
    }
}

impl LongitudinalMpc {
    /// Sets the problem up. Bounds of the command and the reference's acceleration are those of speed control; sample time
    /// and solver those of the lateral MPC.
    ///
    /// # Errors
    /// Weights that the solver refuses.
    pub fn new(
        parameters: LongitudinalParameters,
        speed: &SpeedParameters,
        mpc: &MpcParameters,
    ) -> Result<Self, BuildError> {
        let p = &parameters;
        let (horizon, sample_time) = (p.horizon, mpc.sample_time);
        let shape = QpShape {
            horizon,
            outputs: TRACKED.len(),
            inputs: 1,
            output_weight: vec![p.q_lag, p.q_speed],
            terminal_factor: 1.0,
            rate_weight: vec![p.r_rate / (sample_time * sample_time)],
            input_min: vec![-speed.decel_cmd_max],
            input_max: vec![speed.accel_cmd_max],
            rate_max: vec![p.accel_rate_max * sample_time],
            soft: vec![SoftBound {
                output: 1,
                min: UNDERSPEED,
                max: p.overspeed_max,
                quadratic: OVERSPEED_PENALTY[0],
                linear: OVERSPEED_PENALTY[1],
            }],
        };
        // [e_l, v, a_d] by the command and by the disturbance.
        let (mut a, mut inputs) = (Matrix3::zeros(), Matrix3x2::zeros());
        a[(0, 1)] = -1.0;
        inputs[(1, 1)] = 1.0;
        if p.drive_lag > 0.0 {
            a[(1, 2)] = 1.0;
            (a[(2, 2)], inputs[(2, 0)]) = (-1.0 / p.drive_lag, 1.0 / p.drive_lag);
        } else {
            inputs[(1, 0)] = 1.0;
        }
        let (transition, inputs) = zero_order_hold(&a, &inputs, sample_time);
        let command = inputs.column(0).into_owned();
        let mut problem = TrackingQp::new(shape);
        let mut affine = Affine::new(horizon, 0);
        let linear = HorizonModel { a: &transition, b: &command };
        let start = Vector3::new(0.2, 0.5, 0.0);
        condense(linear, &start, &mut affine, &[], Propagation::default(), &TRACKED, &mut problem);
        let solver = build_solver(mpc.solver, &problem, mpc.max_iterations as u32)?;
        Ok(Self {
            parameters,
            reference_accel: [speed.accel, speed.decel_cmd_max],
            sample_time,
            transition,
            command,
            disturbed: inputs.column(1).into_owned(),
            affine,
            solver,
            inputs: vec![0.0; horizon],
            outputs: vec![0.0; problem.free.len()],
            reference_speed: vec![0.0; horizon],
            predicted: Vec::with_capacity(horizon),
            problem,
            state: LongitudinalState::default(),
        })
    }

    /// One control step; allocates nothing with the active-set solver. Station and speed that are no finite numbers hold
    /// the command in force and change nothing.
    pub fn step(&mut self, input: &LongitudinalInput<'_>) -> LongitudinalStep {
        if !(input.station.is_finite() && input.speed.is_finite()) {
            return LongitudinalStep {
                accel_cmd: self.state.accel_cmd,
                lag_error: 0.0,
                speed_ref: input.speed,
                solved: Err(QpError::Numerical { iterations: 0 }),
            };
        }
        let (reference, lag_error) = self.place_reference(input);
        let slope = holding(input.path, input.station);
        // A vehicle that is held is no slope: while the point waits nothing is learned, or it would be unlearned later.
        if lag_error.abs() < self.parameters.lag_max && input.speed > STANDSTILL {
            self.observe(input, slope);
        }
        let start = Vector3::new(lag_error, input.speed, self.state.drive - slope);
        let next = self.predict(input, reference, &start, slope);
        let shape = &self.problem.shape;
        let (low, high, rate) = (shape.input_min[0], shape.input_max[0], shape.rate_max[0]);
        let previous = (self.state.accel_cmd - slope).clamp(low, high);
        self.problem.previous[0] = previous;
        let solved = self.solver.solve(&self.problem, input.time_limit, &mut self.inputs, &mut self.outputs);
        self.predicted.clear();
        if solved.is_ok() {
            let deviations = self.outputs.chunks_exact(TRACKED.len()).map(|of_step| of_step[1]);
            self.predicted
                .extend(deviations.zip(&self.reference_speed).map(|(deviation, speed)| deviation + speed));
        }
        let wanted = if solved.is_ok() {
            self.inputs[0]
        } else {
            (next.speed - reference.speed) / self.sample_time
                + FALLBACK_GAIN * (reference.speed - input.speed)
                - self.state.disturbance
        };
        // The plan respects the bounds to the solver's tolerance; the command does exactly.
        let beyond = wanted.clamp(previous - rate, previous + rate).clamp(low, high);
        let expected =
            self.transition * start + self.command * beyond + self.disturbed * self.state.disturbance;
        let accel_cmd = beyond + slope;
        self.state.reference = Some(next);
        self.state.accel_cmd = accel_cmd;
        self.state.drive = expected[2] + slope;
        self.state.expected_speed = Some(expected[1]);
        LongitudinalStep { accel_cmd, lag_error, speed_ref: reference.speed, solved }
    }

    /// Learns the drive's acceleration beyond its command from the speed.
    fn observe(&mut self, input: &LongitudinalInput<'_>, slope: f64) {
        let Some(expected) = self.state.expected_speed else { return };
        let gained = self.state.drive - slope + self.state.disturbance;
        let expected = expected + gained * (input.elapsed - self.sample_time);
        let missed = (input.speed - expected) / input.elapsed.max(self.sample_time);
        let disturbance = self.state.disturbance + self.parameters.observer_gain * missed;
        self.state.disturbance = disturbance.clamp(-LARGEST_DISTURBANCE, LARGEST_DISTURBANCE);
    }

    /// The reference point now, never far from the vehicle, and the lag error.
    fn place_reference(&self, input: &LongitudinalInput<'_>) -> (ReferencePoint, f64) {
        let here = ReferencePoint { station: input.station, speed: input.speed.max(0.0) };
        let Some(mut reference) = self.state.reference else { return (here, 0.0) };
        reference.station += reference.speed * (input.elapsed - self.sample_time);
        let mut lag = reference.station - input.station;
        if input.path.is_periodic() {
            let length = input.path.length();
            lag -= length * (lag / length).round();
        }
        let limit = self.parameters.lag_max;
        if lag > limit {
            // The vehicle does not follow: the point waits for it.
            reference.speed = reference.speed.min(here.speed);
        }
        let lag = lag.clamp(-limit, limit);
        (ReferencePoint { station: input.station + lag, ..reference }, lag)
    }

    /// Condenses the problem from a state and a reference point. Gives the point a step later.
    fn predict(
        &mut self,
        input: &LongitudinalInput<'_>,
        reference: ReferencePoint,
        start: &Vector3<f64>,
        slope: f64,
    ) -> ReferencePoint {
        let observed = self.state.disturbance;
        let lag_error = start[0];
        let first = reference.next(input, self.reference_accel, self.sample_time);
        let (mut now, mut next) = (reference, first);
        for (known, speed) in self.affine.known.iter_mut().zip(&mut self.reference_speed) {
            let steeper = holding(input.path, now.station - lag_error) - slope;
            *known = self.disturbed * (observed - steeper);
            known[0] += next.station - now.station;
            *speed = next.speed;
            now = next;
            next = now.next(input, self.reference_accel, self.sample_time);
        }
        let linear = HorizonModel { a: &self.transition, b: &self.command };
        condense(linear, start, &mut self.affine, &[], Propagation::default(), &TRACKED, &mut self.problem);
        // The second output is the deviation from the reference speed, which the soft bound is of.
        for (of_step, speed) in self.problem.free.chunks_exact_mut(TRACKED.len()).zip(&self.reference_speed) {
            of_step[1] -= speed;
        }
        first
    }

    /// Forgets the reference point and the observed disturbance: the vehicle was moved. The command in force stays.
    pub fn reset(&mut self) {
        self.state = LongitudinalState { accel_cmd: self.state.accel_cmd, ..LongitudinalState::default() };
    }

    /// Replaces the last step's decision by the issued command, m/s2: the next step starts from it.
    pub fn override_command(&mut self, accel_cmd: f64) {
        let more = accel_cmd - self.state.accel_cmd;
        self.state.accel_cmd = accel_cmd;
        self.state.drive += self.command[2] * more;
        if let Some(expected) = &mut self.state.expected_speed {
            *expected += self.command[1] * more;
        }
    }

    /// Speed at the end of each step of the newest prediction, m/s; empty if the newest step found no plan.
    #[must_use]
    pub fn predicted_speeds(&self) -> &[f64] {
        &self.predicted
    }

    /// Speed at the end of step `j` of the newest prediction, m/s.
    #[must_use]
    pub fn predicted_speed(&self, j: usize) -> f64 {
        self.outputs[j * TRACKED.len() + 1] + self.reference_speed[j]
    }

    /// The newest plan: acceleration command of each step of the horizon beyond what holds the vehicle on its slope, m/s2.
    #[must_use]
    pub fn plan(&self) -> &[f64] {
        &self.inputs
    }

    /// Acceleration beyond command and slope that is observed, m/s2.
    #[must_use]
    pub fn disturbance(&self) -> f64 {
        self.state.disturbance
    }

    /// The newest problem, for recording and for comparison with other solvers.
    #[must_use]
    pub fn problem(&self) -> &TrackingQp {
        &self.problem
    }

    /// Everything that steps have changed.
    #[must_use]
    pub fn state(&self) -> LongitudinalState {
        self.state
    }

    /// Continues from a state.
    pub fn restore(&mut self, mut state: LongitudinalState) {
        // The point never moves back, whatever a file says: the bounds of its next speed would cross.
        if let Some(reference) = &mut state.reference {
            reference.speed = reference.speed.max(0.0);
        }
        self.state = state;
    }
}
