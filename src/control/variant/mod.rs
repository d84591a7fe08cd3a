//! The variants of the lateral MPC: what the states ahead are predicted with.
//!
//! All share cost, bounds, road ahead and solver (`lateral.rs`); each fills in how the outputs depend on the commands.
//!
//! | file | predicts with |
//! |---|---|
//! | `linear.rs` | the nominal linear model, with or without a learned residual |
//! | `actuator.rs` | the nominal linear model behind a known steering actuator |
//! | `bicycle/` | the nonlinear bicycle, with or without a Gaussian process, by sequential quadratic programming |

mod actuator;
mod bicycle;
mod linear;

pub(super) use actuator::Actuated;
pub(super) use bicycle::BicycleMpc;
pub use bicycle::{BicycleModel, BicycleRollOut, StepSpeed};
pub(super) use linear::NominalWithResidual;
pub use linear::{Residual, RollOut};

use super::lateral::LateralInput;
use super::parameters::MpcParameters;
use super::preview::Preview;
use super::tracking_qp::{QpError, QpReport, QpSolver, TrackingQp};
use crate::nominal::{Actuator, ContinuousErrorModel, ErrorState};
use crate::vehicle::SingleTrack;
use nalgebra::Matrix4;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// What the controller predicts with.
#[derive(Debug, Clone, Default)]
pub enum PredictionModel {
    /// The linear single track.
    #[default]
    Nominal,
    /// The linear single track with a learned residual.
    Residual(Residual),
    /// The linear single track behind a steering actuator with known dead time and lag.
    Actuator(Actuator),
    /// The nonlinear bicycle, with or without a learned Gaussian process: nonlinear MPC.
    Bicycle(BicycleModel),
}

impl From<Option<Residual>> for PredictionModel {
    fn from(residual: Option<Residual>) -> Self {
        residual.map_or(Self::Nominal, Self::Residual)
    }
}

/// Wall-clock time that the parts of a step took, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Timing {
    /// Roll-out with look-ups of the residual.
    pub look_up: f64,
    /// From the model to the QP's matrices.
    pub condense: f64,
    /// Solving the QP.
    pub solve: f64,
}

/// The QP of a step with its solver and solution.
pub(super) struct Qp {
    /// States of the model that are outputs of the QP; the first is e1.
    pub tracked: Vec<usize>,
    pub problem: TrackingQp,
    pub solver: Box<dyn QpSolver>,
    pub inputs: Vec<f64>,
    pub outputs: Vec<f64>,
    pub timing: Timing,
    /// QPs solved in this step.
    pub solved: u32,
}

impl Qp {
    /// Solves the problem as it stands.
    pub fn solve(&mut self, time_limit: f64) -> Result<QpReport, QpError> {
        let begin = Instant::now();
        let solved = self.solver.solve(&self.problem, time_limit, &mut self.inputs, &mut self.outputs);
        self.timing.solve += begin.elapsed().as_secs_f64();
        self.solved += 1;
        solved
    }

    /// Writes the references of the outputs: zero, but for the yaw error, whose reference `yaw` gives for each step.
    /// Far from straight driving the linear steady state means nothing: it is bounded.
    pub fn refer(&mut self, mut yaw: impl FnMut(usize) -> f64) {
        let outputs = self.tracked.len();
        let Some(place) = self.tracked.iter().position(|&state| state == 2) else { return };
        for (j, references) in self.problem.reference.chunks_exact_mut(outputs).enumerate() {
            references[place] = yaw(j).clamp(-0.3, 0.3);
        }
    }
}

/// The state one step ahead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// The state.
    pub state: ErrorState,
    /// How it depends on the state before: `A` of the model.
    pub transition: Matrix4<f64>,
}

/// The nominal linear model that the linear variants build on.
#[derive(Debug, Clone, Copy)]
struct Nominal {
    vehicle: SingleTrack,
    sample_time: f64,
    min_model_speed: f64,
}

impl Nominal {
    fn new(vehicle: SingleTrack, p: &MpcParameters) -> Self {
        Self { vehicle, sample_time: p.sample_time, min_model_speed: p.min_model_speed }
    }

    /// The model at a speed, held where it would be stiff.
    fn at(&self, speed: f64) -> Result<ContinuousErrorModel, QpError> {
        ContinuousErrorModel::new(&self.vehicle, speed.max(self.min_model_speed))
            .map_err(|_| QpError::Numerical { iterations: 0 })
    }
}

/// A variant of the lateral MPC.
pub(super) trait Variant: Send {
    /// Predicts, sets the QP up and solves it; `previous` is the command in force, within its limits.
    fn plan(
        &mut self,
        input: &LateralInput<'_>,
        preview: &Preview,
        previous: f64,
        qp: &mut Qp,
    ) -> Result<QpReport, QpError>;

    /// The state after this step if `steer` is issued, with everything that the newest prediction knew; `past` are the
    /// commands before it. None before the first prediction.
    fn next_state(&self, state: &ErrorState, past: &[f64], steer: f64) -> Option<Expected>;

    /// The newest nonlinear prediction, if it makes one.
    fn roll_out(&self) -> Option<&BicycleRollOut> {
        None
    }

    /// Steps of states and commands that it looks back at; 0 for none.
    fn window(&self) -> usize {
        0
    }

    /// Share of the newest horizon where something learned was asked outside its training, 0 to 1.
    fn outside_training(&self) -> f64 {
        0.0
    }
}
