//! Lateral MPC: from errors to the path and the road ahead to a steering command.
//!
//! One step: linearise the nominal model at the current speed, roll it out with the curvature ahead, condense,
//! solve the QP, apply the first input. The cost is
//!
//! ```text
//! sum_j q_e1 e1_j^2 + q_e2 (e2_j - e2_steady(kappa_j))^2 + ... + r ((u_j - u_{j-1}) / Ts)^2
//! ```
//!
//! where `e2_steady` is the yaw error of steady cornering (its sideslip): a reference of zero would pull the car
//! off the path in every bend.

use super::clarabel_solver::{BuildError, ClarabelSolver};
use super::condense::condense;
use super::parameters::MpcParameters;
use super::tracking_qp::{QpError, QpReport, QpShape, QpSolver, SoftBound, TrackingQp};
use crate::nominal::{
    ContinuousErrorModel, DiscreteErrorModel, ErrorState, SingleTrackError, steady_yaw_error,
};
use crate::path::Path;
use crate::vehicle::SingleTrack;
use nalgebra::Vector4;

/// Why the MPC cannot be set up.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LateralError {
    #[error(transparent)]
    Model(#[from] SingleTrackError),
    #[error(transparent)]
    Solver(#[from] BuildError),
}

/// The road ahead at each step of the horizon.
#[derive(Debug, Clone, Default)]
struct Preview {
    /// Station at the end of each step.
    station: Vec<f64>,
    /// Heading rate of the path, `v kappa`, at the middle of each step.
    heading_rate: Vec<f64>,
    /// Heading acceleration of the path, `v^2 kappa' + a kappa`, there.
    heading_accel: Vec<f64>,
    /// Curvature at the end of each step.
    curvature: Vec<f64>,
}

/// Speed over the horizon, as the speed plan has it.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)]
pub struct SpeedAhead {
    pub speed: f64,
    pub accel: f64,
}

/// The MPC with its preallocated problem.
pub struct LateralMpc {
    vehicle: SingleTrack,
    parameters: MpcParameters,
    /// States of the model that are outputs of the QP; the first is e1.
    tracked: Vec<usize>,
    problem: TrackingQp,
    solver: Box<dyn QpSolver>,
    preview: Preview,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

/// Speed at which the QP that scales the solver is linearised, m/s.
const TYPICAL_SPEED: f64 = 10.0;

impl LateralMpc {
    /// Sets the problem up.
    ///
    /// # Errors
    /// Vehicle parameters that are not positive; weights that the solver refuses.
    pub fn new(vehicle: SingleTrack, parameters: MpcParameters) -> Result<Self, LateralError> {
        let p = &parameters;
        let weights = [p.q_e1, p.q_e1_rate, p.q_e2, p.q_e2_rate];
        // e1 is always an output, because of its bound; the others only where they cost something.
        let tracked: Vec<usize> = (0..4).filter(|&i| i == 0 || weights[i] > 0.0).collect();
        let shape = QpShape {
            horizon: p.horizon,
            outputs: tracked.len(),
            inputs: 1,
            output_weight: tracked.iter().map(|&i| weights[i]).collect(),
            terminal_factor: p.terminal_factor,
            rate_weight: vec![p.r_rate / (p.sample_time * p.sample_time)],
            input_min: vec![-p.steer_max],
            input_max: vec![p.steer_max],
            rate_max: vec![p.steer_rate_max * p.sample_time],
            soft: vec![SoftBound {
                output: 0,
                min: -p.e1_max,
                max: p.e1_max,
                quadratic: p.slack_quadratic,
                linear: p.slack_linear,
            }],
        };
        let rows = shape.horizon * shape.outputs;
        let mut problem = TrackingQp::new(shape);
        let model = ContinuousErrorModel::new(&vehicle, TYPICAL_SPEED)?.discretise(p.sample_time);
        let start = Vector4::new(0.1, 0.0, 0.05, 0.0);
        condense(&model.a, &model.b, &start, |_| Vector4::zeros(), &tracked, &mut problem);
        let solver = ClarabelSolver::new(&problem, p.max_iterations as u32)?;
        Ok(Self {
            vehicle,
            tracked,
            problem,
            solver: Box::new(solver),
            preview: Preview {
                station: vec![0.0; p.horizon],
                heading_rate: vec![0.0; p.horizon],
                heading_accel: vec![0.0; p.horizon],
                curvature: vec![0.0; p.horizon],
            },
            inputs: vec![0.0; p.horizon],
            outputs: vec![0.0; rows],
            parameters,
        })
    }

    /// One control step from the state at `station`, with the steering command `previous` in force.
    ///
    /// # Errors
    /// The solver found no plan.
    pub fn step(
        &mut self,
        state: &ErrorState,
        station: f64,
        ahead: SpeedAhead,
        previous: f64,
        path: &Path,
        time_limit: f64,
    ) -> Result<QpReport, QpError> {
        let p = &self.parameters;
        // Between the limits the steering can come back; a command outside them would make the QP infeasible.
        let previous = previous.clamp(-p.steer_max, p.steer_max);
        let speed = ahead.speed.max(p.min_model_speed);
        look_ahead(&mut self.preview, path, station, ahead, p.sample_time);
        let Ok(model) = ContinuousErrorModel::new(&self.vehicle, speed) else {
            return Err(QpError::Numerical { iterations: 0 });
        };
        let model: DiscreteErrorModel = model.discretise(p.sample_time);
        let preview = &self.preview;
        let disturbance = |j: usize| model.d * preview.heading_rate[j] + model.e * preview.heading_accel[j];
        condense(&model.a, &model.b, state, disturbance, &self.tracked, &mut self.problem);
        let yaw_error = steady_yaw_error(&self.vehicle, ahead.speed);
        for (row, reference) in self.problem.reference.iter_mut().enumerate() {
            let (j, i) = (row / self.tracked.len(), row % self.tracked.len());
            *reference = if self.tracked[i] == 2 { yaw_error * preview.curvature[j] } else { 0.0 };
        }
        self.problem.previous[0] = previous;
        self.solver.solve(&self.problem, time_limit, &mut self.inputs, &mut self.outputs)
    }

    /// The newest plan: steering command of each step of the horizon, rad.
    #[must_use]
    pub fn plan(&self) -> &[f64] {
        &self.inputs
    }

    /// The newest predicted lateral error at the end of step `j`, m.
    #[must_use]
    pub fn predicted_e1(&self, j: usize) -> f64 {
        self.outputs[j * self.tracked.len()]
    }

    /// Station of the path at the end of step `j` of the newest prediction, m.
    #[must_use]
    pub fn predicted_station(&self, j: usize) -> f64 {
        self.preview.station[j]
    }

    /// The newest problem, for recording and for comparison with other solvers.
    #[must_use]
    pub fn problem(&self) -> &TrackingQp {
        &self.problem
    }
}

/// Reads the road over the horizon: at the middle of each step for what drives the model, at its end for what is
/// compared with the state there.
fn look_ahead(preview: &mut Preview, path: &Path, station: f64, ahead: SpeedAhead, sample_time: f64) {
    let (mut s, mut v) = (station, ahead.speed);
    for j in 0..preview.station.len() {
        let next = (v + ahead.accel * sample_time).max(0.0);
        let mean = 0.5 * (v + next);
        let middle = s + 0.5 * mean * sample_time;
        let curvature = path.curvature(middle);
        preview.heading_rate[j] = mean * curvature;
        preview.heading_accel[j] = mean * mean * path.curvature_rate(middle) + ahead.accel * curvature;
        s += mean * sample_time;
        preview.station[j] = s;
        preview.curvature[j] = path.curvature(s);
        v = next;
    }
}
