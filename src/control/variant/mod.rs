//! The variants of the lateral MPC: prediction models of the states ahead.
//!
//! All share cost, bounds, road ahead and solver (`lateral.rs`); each fills in how the outputs depend on the commands.
//!
//! | file | prediction model |
//! |---|---|
//! | `linear.rs` | the nominal linear model, with or without a learned residual |
//! | `actuator.rs` | the nominal linear model behind a steering actuator, known or found while driving |
//! | `nonlinear/` | a nonlinear model, with or without a Gaussian process, by sequential quadratic programming |

mod actuator;
mod linear;
mod nonlinear;

pub(super) use actuator::Actuated;
pub(super) use linear::NominalWithResidual;
pub use linear::{Residual, RollOut};
pub use nonlinear::{
    ArticulatedModel, ArticulatedRollOut, BicycleModel, BicycleRollOut, NonlinearModel, NonlinearRollOut,
    StepSpeed,
};

use super::cost_term::CostTerms;
use super::lateral::LateralInput;
use super::parameters::MpcParameters;
use super::preview::Preview;
use super::tracking_qp::{QpError, QpReport, QpSolver, TrackingQp};
use super::vehicle::ControlledVehicle;
use crate::nominal::{Actuator, ContinuousErrorModel, ERRORS, LateralVehicle};
use crate::vehicle::SingleTrack;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::time::Instant;

/// Effect on the state of a lateral acceleration held over a step, of all masses alike as gravity along the road's bank:
/// the integral of the transition's second column, by the trapezoidal rule with its correction at the ends (Euler and Maclaurin).
pub(super) fn effect_of_bank<const S: usize>(
    continuous: &SMatrix<f64, S, S>,
    transition: &SMatrix<f64, S, S>,
    sample_time: f64,
) -> SVector<f64, S> {
    let end = transition.column(1).into_owned();
    let mut start = SVector::<f64, S>::zeros();
    start[1] = 1.0;
    (end + start) * (0.5 * sample_time) + continuous * (start - end) * (sample_time * sample_time / 12.0)
}

/// Prediction model of a car's controller.
pub type PredictionModel = PredictionModelFor<SingleTrack, ERRORS>;

/// Prediction model of the controller of a kind of vehicle with `S` states.
#[derive(Debug, Clone, Default)]
pub enum PredictionModelFor<V: ControlledVehicle<S>, const S: usize> {
    /// The linear single track.
    #[default]
    Nominal,
    /// The linear single track with a learned residual.
    Residual(Residual<V, S>),
    /// The linear single track behind a steering actuator with known dead time and lag.
    Actuator(Actuator),
    /// The same with an actuator that a bank of hypotheses finds while driving; the given one is the prior knowledge.
    Adaptive(Actuator),
    /// The nonlinear model, with or without a learned Gaussian process: nonlinear MPC. Of a car the bicycle, of a truck the
    /// single track of tractor and semi-trailer.
    Nonlinear(V::Nonlinear),
}

impl<V: ControlledVehicle<S>, const S: usize> From<Option<Residual<V, S>>> for PredictionModelFor<V, S> {
    fn from(residual: Option<Residual<V, S>>) -> Self {
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
pub struct Qp {
    /// States of the model that are outputs of the QP; the first is e1.
    pub tracked: Vec<usize>,
    /// Largest magnitude of each output's reference; 0 where it is always zero.
    pub largest_reference: Vec<f64>,
    pub problem: TrackingQp,
    pub solver: Box<dyn QpSolver>,
    pub inputs: Vec<f64>,
    pub outputs: Vec<f64>,
    pub timing: Timing,
    /// Addition to the references, `N outputs`: the transient motion on a road that changes. Empty for none.
    pub transient: Vec<f64>,
    /// QPs solved in this step.
    pub solved: u32,
    /// Further terms of the cost, if there are any.
    pub terms: Option<CostTerms>,
}

impl Qp {
    /// Solves the problem as it stands.
    pub fn solve(&mut self, time_limit: f64) -> Result<QpReport, QpError> {
        let begin = Instant::now();
        let Self { problem, inputs, outputs, .. } = self;
        let solved = match &mut self.terms {
            Some(terms) => terms.solve((problem, &self.tracked), time_limit, inputs, outputs),
            None => self.solver.solve(problem, time_limit, inputs, outputs),
        };
        self.timing.solve += begin.elapsed().as_secs_f64();
        self.solved += 1;
        solved
    }

    /// Writes the references of the outputs: of those that have one the state that `target` gives for each step, cut
    /// to the largest.
    pub fn refer<const S: usize>(&mut self, mut target: impl FnMut(usize) -> SVector<f64, S>) {
        let outputs = self.tracked.len();
        if self.transient.is_empty() {
            self.problem.reference.fill(0.0);
        } else {
            self.problem.reference.copy_from_slice(&self.transient);
        }
        if self.largest_reference.iter().all(|&largest| largest == 0.0) {
            return;
        }
        for (j, references) in self.problem.reference.chunks_exact_mut(outputs).enumerate() {
            let target = target(j);
            let places = self.tracked.iter().zip(&self.largest_reference).zip(references);
            for ((&state, &largest), reference) in places.filter(|((_, largest), _)| **largest > 0.0) {
                *reference += target[state].clamp(-largest, largest);
            }
        }
    }
}

/// The state one step ahead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ExpectedState<const S: usize = ERRORS> {
    /// The state.
    pub state: SVector<f64, S>,
    /// Derivative by the state before: `A` of the model.
    pub transition: SMatrix<f64, S, S>,
}

/// The nominal linear model that the linear variants build on.
#[derive(Debug, Clone, Copy)]
struct Nominal<V> {
    vehicle: V,
    sample_time: f64,
    min_model_speed: f64,
}

impl<V> Nominal<V> {
    fn new(vehicle: V, p: &MpcParameters) -> Self {
        Self { vehicle, sample_time: p.sample_time, min_model_speed: p.min_model_speed }
    }

    /// The model at a speed, held where it would be stiff.
    fn at<const S: usize>(&self, speed: f64) -> Result<ContinuousErrorModel<S>, QpError>
    where
        V: LateralVehicle<S>,
    {
        self.vehicle
            .model_at(speed.max(self.min_model_speed))
            .map_err(|_| QpError::Numerical { iterations: 0 })
    }
}

/// A variant of the lateral MPC.
pub trait Variant<const S: usize>: Send {
    /// Predicts, sets the QP up and solves it; `previous` is the command in force, within its limits.
    fn plan(
        &mut self,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        previous: f64,
        qp: &mut Qp,
    ) -> Result<QpReport, QpError>;

    /// Predicts without a plan, so that the next state is known.
    ///
    /// # Errors
    /// A model that cannot be made.
    fn look(
        &mut self,
        _input: &LateralInput<'_, S>,
        _preview: &Preview,
        _previous: f64,
    ) -> Result<(), QpError> {
        Ok(())
    }

    /// The state after this step if `steer` is issued, with all knowledge of the newest prediction; `past` are the
    /// commands before it. None before the first prediction.
    fn next_state(&self, state: &SVector<f64, S>, past: &[f64], steer: f64) -> Option<ExpectedState<S>>;

    /// The same by the nominal model and with the full learned model, regardless of the share in use. None without a
    /// learned model, or if it was not asked.
    fn without_and_with_learned(
        &self,
        _state: &SVector<f64, S>,
        _past: &[f64],
        _steer: f64,
    ) -> Option<[SVector<f64, S>; 2]> {
        None
    }

    /// True if it predicts with a learned model.
    fn is_learned(&self) -> bool {
        false
    }

    /// The newest nonlinear prediction, if it makes one: a [`NonlinearRollOut`].
    fn roll_out(&self) -> Option<&dyn Any> {
        None
    }

    /// Steps of states and commands that it looks back at; 0 for none.
    fn window(&self) -> usize {
        0
    }

    /// False if the newest prediction began outside the training of a learned model.
    fn is_within_training(&self) -> bool {
        true
    }

    /// Share of the newest horizon for which a learned model was asked outside its training, 0 to 1.
    fn outside_training(&self) -> f64 {
        0.0
    }
}
