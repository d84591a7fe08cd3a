//! Lateral MPC: from errors to the path and the road ahead to a steering command.
//!
//! One step: linearise the nominal model at the current speed, roll it out with the curvature ahead, ask the learned
//! residual (if there is one) at each step of the roll-out, condense, solve the QP, apply the first input. The cost is
//!
//! ```text
//! sum_j q_e1 e1_j^2 + q_e2 (e2_j - e2_steady,j)^2 + ... + r ((u_j - u_{j-1}) / Ts)^2
//! ```
//!
//! where `e2_steady` is the yaw error of steady cornering (its sideslip): a reference of zero would pull the car
//! off the path in every bend.
//!
//! Source of the residual's part: Zhao et al., ITSC 2024, Algorithm 1.

use super::clarabel_solver::BuildError;
use super::condense::{Affine, Linear, Propagation, condense};
use super::fast_solver::build_solver;
use super::history::History;
use super::parameters::MpcParameters;
use super::tracking_qp::{QpError, QpReport, QpShape, QpSolver, SoftBound, TrackingQp};
use crate::enumeration;
use crate::nominal::{
    ContinuousErrorModel, DiscreteErrorModel, ErrorState, SingleTrackError, steady_yaw_error,
};
use crate::path::Path;
use crate::residual::{Coefficients, Expected, Misfit, ROAD, ResidualModel};
use crate::vehicle::SingleTrack;
use nalgebra::{Matrix4, Vector4};
use std::sync::Arc;

/// Why the MPC cannot be set up.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LateralError {
    #[error(transparent)]
    Model(#[from] SingleTrackError),
    #[error(transparent)]
    Solver(#[from] BuildError),
    #[error(transparent)]
    Residual(#[from] Misfit),
}

enumeration! {
    /// With which model the states are predicted at which the residual is asked.
    pub enum RollOut {
        Nominal = 0 "nominal", "The nominal model, as in Zhao et al.";
        Corrected = 1 "corrected", "The nominal model with the residual";
    }
}

/// A learned residual and how it is used.
#[derive(Debug, Clone)]
#[allow(missing_docs)]
pub struct Residual {
    pub model: Arc<ResidualModel>,
    pub propagation: Propagation,
    pub roll_out: RollOut,
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
    /// Speed, curvature and curvature rate at the beginning of each step.
    road: Vec<[f64; ROAD]>,
}

impl Preview {
    fn new(horizon: usize) -> Self {
        Self {
            station: vec![0.0; horizon],
            heading_rate: vec![0.0; horizon],
            heading_accel: vec![0.0; horizon],
            curvature: vec![0.0; horizon],
            road: vec![[0.0; ROAD]; horizon],
        }
    }
}

/// Speed over the horizon, as the speed plan has it.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)]
pub struct SpeedAhead {
    pub speed: f64,
    pub accel: f64,
}

/// What one step of the lateral MPC is told.
#[derive(Debug, Clone, Copy)]
pub struct LateralInput<'a> {
    /// Errors to the path that the MPC is to bring to zero.
    pub state: &'a ErrorState,
    /// The window of measured states and issued commands.
    pub history: &'a History,
    /// Last plan of the steering, beginning with this step; may be shorter than the horizon.
    pub last_plan: &'a [f64],
    /// Station of the vehicle, m.
    pub station: f64,
    /// Speed, and how it will change.
    pub ahead: SpeedAhead,
    /// Steering command in force, rad.
    pub previous: f64,
    /// The road.
    pub path: &'a Path,
    /// Disturbance of each step.
    pub disturbance: &'a ErrorState,
    /// Whether the learned residual is to be used.
    pub use_residual: bool,
    /// Seconds for the solver; infinite for no limit.
    pub time_limit: f64,
}

/// The learned residual with room for its use.
struct Learned {
    residual: Residual,
    room: Coefficients,
    features: Vec<f64>,
    /// Measured states and then predicted ones, oldest first.
    states: Vec<ErrorState>,
    /// Issued commands and then planned ones, oldest first.
    commands: Vec<f64>,
}

/// The MPC with its preallocated problem.
pub struct LateralMpc {
    vehicle: SingleTrack,
    parameters: MpcParameters,
    /// States of the model that are outputs of the QP; the first is e1.
    tracked: Vec<usize>,
    learned: Option<Learned>,
    affine: Affine<4>,
    problem: TrackingQp,
    solver: Box<dyn QpSolver>,
    preview: Preview,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    /// What the newest prediction was made with.
    model: Option<DiscreteErrorModel>,
    outside: f64,
}

/// Speed at which the QP that scales the solver is linearised, m/s.
const TYPICAL_SPEED: f64 = 10.0;

impl LateralMpc {
    /// Sets the problem up.
    ///
    /// # Errors
    /// Vehicle parameters that are not positive; weights that the solver refuses; a residual that was learned for
    /// another controller.
    pub fn new(
        vehicle: SingleTrack,
        parameters: MpcParameters,
        residual: Option<Residual>,
    ) -> Result<Self, LateralError> {
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
        // The typical problem that scales the solver is the nominal one.
        let mut affine = Affine::new(p.horizon, 0);
        let linear = Linear { a: &model.a, b: &model.b };
        condense(linear, &start, &mut affine, &[], Propagation::default(), &tracked, &mut problem);
        let learned = residual.map(|residual| Learned::new(residual, &vehicle, p)).transpose()?;
        if let Some(learned) = &learned {
            affine = Affine::new(p.horizon, learned.window());
        }
        let solver = build_solver(p.solver, &problem, p.max_iterations as u32)?;
        Ok(Self {
            vehicle,
            tracked,
            problem,
            solver,
            preview: Preview::new(p.horizon),
            learned,
            affine,
            model: None,
            outside: 0.0,
            inputs: vec![0.0; p.horizon],
            outputs: vec![0.0; rows],
            parameters,
        })
    }

    /// One control step.
    ///
    /// # Errors
    /// The solver found no plan.
    pub fn step(&mut self, input: &LateralInput<'_>) -> Result<QpReport, QpError> {
        let p = &self.parameters;
        // Between the limits the steering can come back; a command outside them would make the QP infeasible.
        let previous = input.previous.clamp(-p.steer_max, p.steer_max);
        let speed = input.ahead.speed.max(p.min_model_speed);
        look_ahead(&mut self.preview, input.path, input.station, input.ahead, p.sample_time);
        let Ok(model) = ContinuousErrorModel::new(&self.vehicle, speed) else {
            return Err(QpError::Numerical { iterations: 0 });
        };
        let model = model.discretise(p.sample_time);
        self.predict(&model, input, previous);
        let past = self.past(input);
        let propagation =
            self.learned.as_ref().map_or(Propagation::default(), |learned| learned.residual.propagation);
        let linear = Linear { a: &model.a, b: &model.b };
        condense(linear, input.state, &mut self.affine, past, propagation, &self.tracked, &mut self.problem);
        self.write_references(&model, input);
        self.model = Some(model);
        self.problem.previous[0] = previous;
        self.solver.solve(&self.problem, input.time_limit, &mut self.inputs, &mut self.outputs)
    }

    /// The commands before the first decision that the residual looks at.
    fn past<'a>(&self, input: &LateralInput<'a>) -> &'a [f64] {
        if self.affine.window == 0 { &[] } else { input.history.commands() }
    }

    /// Fills the affine part of the prediction: the road, the disturbance, the residual at each step of a roll-out.
    fn predict(&mut self, model: &DiscreteErrorModel, input: &LateralInput<'_>, previous: f64) {
        let preview = &self.preview;
        for (j, known) in self.affine.known.iter_mut().enumerate() {
            *known =
                model.d * preview.heading_rate[j] + model.e * preview.heading_accel[j] + input.disturbance;
        }
        self.outside = 0.0;
        let Some(learned) = &mut self.learned else { return };
        if !input.use_residual {
            self.affine.constant.fill(Vector4::zeros());
            self.affine.command.fill(Vector4::zeros());
            return;
        }
        self.outside = learned.roll_out(model, input, previous, preview, &mut self.affine);
    }

    /// The references of the outputs: zero, but for the yaw error, which is that of steady cornering.
    fn write_references(&mut self, model: &DiscreteErrorModel, input: &LateralInput<'_>) {
        let yaw_error = steady_yaw_error(&self.vehicle, input.ahead.speed);
        let corrected = self.affine.window > 0 || *input.disturbance != Vector4::zeros();
        let outputs = self.tracked.len();
        let Some(yaw) = self.tracked.iter().position(|&state| state == 2) else { return };
        for j in 0..self.parameters.horizon {
            let nominal = yaw_error * self.preview.curvature[j];
            let target = if corrected { self.steady_target(model, j) } else { None };
            // Far from straight driving the linear steady state means nothing.
            self.problem.reference[j * outputs + yaw] = target.unwrap_or(nominal).clamp(-0.3, 0.3);
        }
    }

    /// Yaw error at which the corrected model of step `j` stays on the path with a constant command:
    /// `x = A x + B u + w + c + sum beta u` with `e1 = 0`, four equations for `e1'`, `e2`, `e2'` and `u`.
    fn steady_target(&self, model: &DiscreteErrorModel, j: usize) -> Option<f64> {
        let input: Vector4<f64> = model.b + self.affine.commands_of(j).iter().sum::<Vector4<f64>>();
        let mut matrix = Matrix4::identity() - model.a;
        matrix.set_column(0, &-input);
        let known = self.affine.known[j] + self.affine.constant[j];
        matrix.lu().solve(&known).map(|solution| solution[2])
    }

    /// The state after this step if `steer` is issued, with everything that the newest prediction knew.
    #[must_use]
    pub fn next_state(&self, state: &ErrorState, past: &[f64], steer: f64) -> Option<ErrorState> {
        let model = self.model.as_ref()?;
        let mut next = model.a * state + model.b * steer + self.affine.known[0];
        if self.affine.window > 0 {
            next += self.affine.constant[0];
            for (effect, command) in self.affine.commands_of(0).iter().zip(past.iter().chain([&steer])) {
                next += effect * *command;
            }
        }
        Some(next)
    }

    /// Steps of the window that the learned residual looks at; 0 without one.
    #[must_use]
    pub fn window(&self) -> usize {
        self.affine.window
    }

    /// Share of the newest horizon where the residual was asked outside its training and reduced, 0 to 1.
    #[must_use]
    pub fn outside_training(&self) -> f64 {
        self.outside
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

impl Learned {
    fn new(residual: Residual, vehicle: &SingleTrack, p: &MpcParameters) -> Result<Self, Misfit> {
        let model = &residual.model;
        model.check_fits(&Expected {
            vehicle: *vehicle,
            sample_time: p.sample_time,
            min_model_speed: p.min_model_speed,
            window: None,
        })?;
        let window = model.schema().window;
        Ok(Self {
            room: model.room(),
            features: vec![0.0; model.features()],
            states: vec![ErrorState::zeros(); window + p.horizon],
            commands: vec![0.0; window - 1 + p.horizon],
            residual,
        })
    }

    fn window(&self) -> usize {
        self.residual.model.schema().window
    }

    /// Predicts the states of the horizon under the last plan and asks the residual at each of them. Gives the share
    /// of steps at which it was asked outside its training.
    fn roll_out(
        &mut self,
        model: &DiscreteErrorModel,
        input: &LateralInput<'_>,
        previous: f64,
        preview: &Preview,
        affine: &mut Affine<4>,
    ) -> f64 {
        let window = self.window();
        let horizon = affine.known.len();
        self.states[..window].copy_from_slice(input.history.states());
        self.commands[..window - 1].copy_from_slice(input.history.commands());
        // The last plan, its end held.
        let end = input.last_plan.last().copied().unwrap_or(previous);
        let planned = input.last_plan.iter().copied().chain(std::iter::repeat(end));
        for (command, planned) in self.commands[window - 1..].iter_mut().zip(planned) {
            *command = planned;
        }
        let mut outside = 0.0;
        for j in 0..horizon {
            let states = &self.states[j..j + window];
            let commands = &self.commands[j..j + window];
            let (errors, road) = self.features.split_at_mut(4 * window);
            for (feature, state) in errors.chunks_exact_mut(4).zip(states) {
                feature.copy_from_slice(state.as_slice());
            }
            road.copy_from_slice(&preview.road[j]);
            self.residual.model.coefficients(&self.features, commands, &mut self.room);
            // Outside its training the residual fades: half a range's width further there is the nominal model.
            let trust = (1.0 - 2.0 * self.room.excess).clamp(0.0, 1.0);
            if trust < 1.0 {
                self.room.scale(trust);
                outside += 1.0;
            }
            let newest = &states[window - self.room.state().len() / 4..];
            let known = newest.iter().flat_map(|state| state.iter()).zip(self.room.state());
            let mut constant = Vector4::from(self.room.constant());
            for (value, effect) in known {
                constant += Vector4::from(*effect) * *value;
            }
            affine.constant[j] = constant;
            let effects = &mut affine.command[j * window..(j + 1) * window];
            for (effect, command) in effects.iter_mut().zip(self.room.command()) {
                *effect = Vector4::from(*command);
            }
            let mut next = model.a * states[window - 1] + model.b * commands[window - 1] + affine.known[j];
            if self.residual.roll_out == RollOut::Corrected {
                next += constant;
                for (effect, command) in effects.iter().zip(commands) {
                    next += *effect * *command;
                }
            }
            self.states[j + window] = next;
        }
        outside / horizon as f64
    }
}

/// Reads the road over the horizon: at the middle of each step for what drives the model, at its end for what is
/// compared with the state there.
fn look_ahead(preview: &mut Preview, path: &Path, station: f64, ahead: SpeedAhead, sample_time: f64) {
    let (mut s, mut v) = (station, ahead.speed);
    for j in 0..preview.station.len() {
        let next = (v + ahead.accel * sample_time).max(0.0);
        let mean = 0.5 * (v + next);
        preview.road[j] = [v, path.curvature(s), path.curvature_rate(s)];
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
