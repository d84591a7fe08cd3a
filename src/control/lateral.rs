//! Lateral MPC: from errors to the path and the road ahead to a steering command.
//!
//! One step: look at the road ahead, predict with the variant's model, condense, solve the QP, apply the first input.
//! The cost is
//!
//! ```text
//! sum_j q_e1 e1_j^2 + q_e2 (e2_j - e2_steady,j)^2 + ... + r ((u_j - u_{j-1}) / Ts)^2
//! ```
//!
//! where `e2_steady` is the yaw error of steady cornering (its sideslip): a reference of zero would pull the car
//! off the path in every bend.

use super::bank::slowest;
use super::clarabel_solver::BuildError;
use super::condense::{Affine, HorizonModel, Propagation, condense};
use super::cost_term::{CostTerm, CostTerms};
use super::fast_solver::build_solver;
use super::history::History;
use super::parameters::MpcParameters;
use super::preview::{Preview, SpeedAhead};
use super::reference::{RoadReference, Steady};
use super::tracking_qp::{QpError, QpReport, QpShape, SoftBound, TrackingQp};
use super::variant::{
    Actuated, BicycleRollOut, ExpectedState, NominalWithResidual, PredictionModelFor, Qp, Timing, Variant,
};
use super::vehicle::{Bound, ControlledVehicle, FurtherState, Nonlinear};
use crate::nominal::{Actuator, ERRORS, SingleTrackError};
use crate::path::Path;
use crate::residual::ModelMismatch;
use nalgebra::SVector;

/// Reasons for which the MPC cannot be set up.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LateralError {
    #[error(transparent)]
    Model(#[from] SingleTrackError),
    #[error(transparent)]
    Solver(#[from] BuildError),
    #[error(transparent)]
    Residual(#[from] ModelMismatch),
}

/// Input of one step of the lateral MPC.
#[derive(Debug, Clone, Copy)]
pub struct LateralInput<'a, const S: usize = ERRORS> {
    /// The state, first the errors to the path that the MPC is to bring to zero.
    pub state: &'a SVector<f64, S>,
    /// Lateral velocity of the vehicle, m/s.
    pub vy: f64,
    /// Yaw rate of the vehicle, rad/s.
    pub yaw_rate: f64,
    /// The window of measured states and issued commands.
    pub history: &'a History<S>,
    /// Last plan of the steering, beginning with this step; may be shorter than the horizon.
    pub last_plan: &'a [f64],
    /// Station of the vehicle, m.
    pub station: f64,
    /// Speed, and how it will change.
    pub ahead: SpeedAhead<'a>,
    /// Steering command in force, rad.
    pub previous: f64,
    /// Largest rate of that command, rad/s.
    pub rate_max: f64,
    /// The road.
    pub path: &'a Path,
    /// Disturbance of each step.
    pub disturbance: &'a SVector<f64, S>,
    /// Share of the learned model in use, 0 to 1.
    pub residual_share: f64,
    /// Seconds for the solver; infinite for no limit.
    pub time_limit: f64,
    /// The steering actuator to predict with, if the drive has shown it.
    pub actuator: Option<Actuator>,
    /// Certainty of the prediction, 0 to 1: the loop becomes faster with it, `mpc.tightening`.
    pub tightness: f64,
    /// Largest lateral acceleration that the steering may ask for beyond that of the road, m/s2.
    pub lateral_accel: f64,
}

/// Steering that following the road asks for, and what a deviation from it does to the vehicle.
#[derive(Debug, Clone, Copy)]
struct RoadSteer {
    /// Least and largest angle over the horizon, with what the disturbances ask for, rad.
    range: [f64; 2],
    /// Angle of a steady turn for each m/s2 of lateral acceleration, rad s2/m.
    per_accel: f64,
}

/// Writes the reference of following the road into a problem, for a kind of vehicle.
trait FollowRoad<const S: usize>: Send {
    fn write(
        &mut self,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        actuator: Option<&Actuator>,
        qp: &mut Qp,
    ) -> Result<RoadSteer, QpError>;
}

/// A vehicle on its road.
struct Following<V, const S: usize> {
    vehicle: V,
    min_model_speed: f64,
    sample_time: f64,
    reference: RoadReference<S>,
}

impl<V: ControlledVehicle<S>, const S: usize> Following<V, S> {
    fn new(vehicle: V, p: &MpcParameters) -> Self {
        let reference = RoadReference::new(p.horizon, p.sample_time);
        Self { vehicle, min_model_speed: p.min_model_speed, sample_time: p.sample_time, reference }
    }
}

impl<V: ControlledVehicle<S>, const S: usize> FollowRoad<S> for Following<V, S> {
    fn write(
        &mut self,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        actuator: Option<&Actuator>,
        qp: &mut Qp,
    ) -> Result<RoadSteer, QpError> {
        let speed = input.ahead.speed;
        let model = self
            .vehicle
            .model_at(speed.max(self.min_model_speed))
            .map_err(|_| QpError::Numerical { iterations: 0 })?;
        let steady = Steady::new(&self.vehicle, speed);
        self.reference.follow(&model, &steady, input.path, input.station, speed, preview);
        self.reference.write_increments(actuator, &mut qp.problem.free_increments);
        for (j, of_step) in qp.transient.chunks_exact_mut(qp.tracked.len()).enumerate() {
            let transient = self.reference.transient(j);
            for (value, &state) in of_step.iter_mut().zip(&qp.tracked) {
                *value = transient[state];
            }
        }
        let disturbed = model.steady_steer_against(&(input.disturbance / self.sample_time));
        let [least, largest] = self.reference.steer_range();
        // A vehicle that oversteers needs less than its wheelbase asks for, and none at its critical speed.
        let steady = self.vehicle.steady_steer(speed).max(self.vehicle.wheelbase());
        Ok(RoadSteer {
            range: [least + disturbed, largest + disturbed],
            per_accel: steady / (speed * speed).max(LEAST_SPEED_SQUARED),
        })
    }
}

/// The MPC with its preallocated problem.
pub struct LateralMpc<const S: usize = ERRORS> {
    parameters: MpcParameters,
    /// The actuator of the prediction, if it is given.
    actuator: Option<Actuator>,
    /// Weights of the outputs without tightening.
    weights: Vec<f64>,
    wheelbase: f64,
    road: Option<Box<dyn FollowRoad<S>>>,
    variant: Box<dyn Variant<S>>,
    /// Substitute for a learned residual out of its range: the nominal model behind the actuator that the drive shows.
    beside: Option<Box<dyn Variant<S>>>,
    learned_is_used: bool,
    preview: Preview,
    qp: Qp,
}

/// Speed at which the QP that scales the solver is linearised, m/s.
const TYPICAL_SPEED: f64 = 10.0;
/// Below this squared speed no steering rolls a vehicle over, m2/s2.
const LEAST_SPEED_SQUARED: f64 = 1.0;
/// Share of a learned residual from which on it is used.
const HALF: f64 = 0.5;
/// Largest reference of the yaw error, rad. Far from straight driving the linear steady state means nothing.
const LARGEST_YAW_REFERENCE: f64 = 0.3;

impl<const S: usize> LateralMpc<S> {
    /// Sets the problem up; `further` are the states behind the errors to the path.
    ///
    /// # Errors
    /// Vehicle parameters that are not positive; weights that the solver refuses; a residual that was learned for
    /// another controller.
    pub fn new<V: ControlledVehicle<S>>(
        vehicle: V,
        parameters: MpcParameters,
        further: &[FurtherState],
        model: PredictionModelFor<V, S>,
    ) -> Result<Self, LateralError> {
        let p = &parameters;
        let errors = [p.q_e1, p.q_e1_rate, p.q_e2, p.q_e2_rate];
        let mut weights = errors.into_iter().chain(further.iter().map(|state| state.weight));
        let weights: [f64; S] = std::array::from_fn(|_| weights.next().unwrap_or(0.0));
        let of_e1 = Bound { max: p.e1_max, quadratic: p.slack_quadratic, linear: p.slack_linear };
        let bounds = further.iter().enumerate().map(|(i, state)| (ERRORS + i, state.bound));
        let bounds: Vec<(usize, Bound)> = bounds.filter_map(|(i, bound)| Some((i, bound?))).collect();
        // e1 is always an output, because of its bound; the others only where they cost something or have a bound.
        let bounded = |i: usize| i == 0 || bounds.iter().any(|&(state, _)| state == i);
        let tracked: Vec<usize> = (0..S).filter(|&i| bounded(i) || weights[i] > 0.0).collect();
        let soft = |(state, bound): (usize, Bound)| SoftBound {
            output: tracked.iter().position(|&i| i == state).unwrap_or(0),
            min: -bound.max,
            max: bound.max,
            quadratic: bound.quadratic,
            linear: bound.linear,
        };
        let largest_reference = |&i: &usize| match i {
            // What costs nothing needs no reference.
            _ if weights[i] == 0.0 => 0.0,
            2 => LARGEST_YAW_REFERENCE,
            _ => i.checked_sub(ERRORS).map_or(0.0, |i| further[i].largest_reference),
        };
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
            soft: [(0, of_e1)].into_iter().chain(bounds.iter().copied()).map(soft).collect(),
        };
        let rows = shape.horizon * shape.outputs;
        let mut problem = TrackingQp::new(shape);
        let typical = vehicle.model_at(TYPICAL_SPEED)?.discretise(p.sample_time);
        let start = SVector::from_fn(|i, _| [0.1, 0.0, 0.05].get(i).copied().unwrap_or(0.0));
        // The typical problem that scales the solver is the nominal one.
        let mut affine = Affine::new(p.horizon, 0);
        let linear = HorizonModel { a: &typical.a, b: &typical.b };
        condense(linear, &start, &mut affine, &[], Propagation::default(), &tracked, &mut problem);
        let solver = build_solver(p.solver, &problem, p.max_iterations as u32)?;
        let beside: Option<Box<dyn Variant<S>>> = match &model {
            PredictionModelFor::Residual(_) if p.follow_road == 1 => {
                Some(Box::new(Actuated::new(vehicle, p, Actuator::default(), slowest())))
            }
            _ => None,
        };
        let model_is_linear = !matches!(model, PredictionModelFor::Nonlinear(_));
        let actuator = match &model {
            PredictionModelFor::Actuator(actuator) | PredictionModelFor::Adaptive(actuator) => {
                Some(*actuator)
            }
            _ => None,
        };
        let variant: Box<dyn Variant<S>> = match model {
            PredictionModelFor::Nominal => Box::new(NominalWithResidual::new(vehicle, p, None)?),
            PredictionModelFor::Residual(residual) => {
                Box::new(NominalWithResidual::new(vehicle, p, Some(residual))?)
            }
            PredictionModelFor::Actuator(actuator) => Box::new(Actuated::new(vehicle, p, actuator, actuator)),
            PredictionModelFor::Adaptive(actuator) => {
                Box::new(Actuated::new(vehicle, p, actuator, slowest()))
            }
            PredictionModelFor::Nonlinear(nonlinear) => nonlinear.variant(vehicle, p)?,
        };
        let weights: Vec<f64> = tracked.iter().map(|&i| weights[i]).collect();
        let wheelbase = vehicle.wheelbase();
        let follows = p.follow_road == 1 && model_is_linear;
        let road: Option<Box<dyn FollowRoad<S>>> =
            if follows { Some(Box::new(Following::new(vehicle, p))) } else { None };
        let qp = Qp {
            largest_reference: tracked.iter().map(largest_reference).collect(),
            inputs: vec![0.0; p.horizon],
            outputs: vec![0.0; rows],
            tracked,
            problem,
            solver,
            timing: Timing::default(),
            transient: if follows { vec![0.0; rows] } else { Vec::new() },
            solved: 0,
            terms: None,
        };
        Ok(Self {
            actuator,
            beside,
            learned_is_used: false,
            variant,
            preview: Preview::new(p.horizon),
            qp,
            parameters,
            weights,
            wheelbase,
            road,
        })
    }

    /// Adds a term to the cost.
    ///
    /// # Errors
    /// A problem that the solver refuses.
    pub fn add_cost(&mut self, term: Box<dyn CostTerm>) -> Result<(), BuildError> {
        let Qp { problem, tracked, terms, .. } = &mut self.qp;
        *terms = Some(CostTerms::with(term, terms.take(), (problem, tracked), &self.parameters)?);
        Ok(())
    }

    /// One control step.
    ///
    /// # Errors
    /// The solver found no plan.
    pub fn step(&mut self, input: &LateralInput<'_, S>) -> Result<QpReport, QpError> {
        let p = &self.parameters;
        // Between the limits the steering can come back; a command outside them would make the QP infeasible.
        let previous = input.previous.clamp(-p.steer_max, p.steer_max);
        self.preview.look(input.path, input.station, input.ahead, p.sample_time);
        self.qp.problem.previous[0] = previous;
        self.qp.timing = Timing::default();
        self.qp.solved = 0;
        self.weigh(input);
        if let Some(terms) = &mut self.qp.terms {
            terms.look(input.ahead.speed, &self.preview.curvature);
        }
        if let Some(road) = &mut self.road {
            let actuator = input.actuator.or(self.actuator);
            let asked = road.write(input, &self.preview, actuator.as_ref(), &mut self.qp)?;
            // A learned model asks for steering that nothing here knows of.
            let is_learned = self.variant.is_learned() && input.residual_share > 0.0;
            let most = if is_learned { f64::INFINITY } else { input.lateral_accel };
            self.bound(asked, most);
        } else {
            let speed = input.ahead.speed;
            let per_accel = self.wheelbase / (speed * speed).max(LEAST_SPEED_SQUARED);
            self.bound(RoadSteer { range: [0.0; 2], per_accel }, input.lateral_accel);
        }
        let Some(beside) = &mut self.beside else {
            return self.variant.plan(input, &self.preview, previous, &mut self.qp);
        };
        // One of the two as a whole: a model of half a dead time is neither. The other one is asked, to be judged.
        let whole = LateralInput { residual_share: 1.0, ..*input };
        self.learned_is_used = input.residual_share >= HALF;
        if self.learned_is_used {
            beside.look(&whole, &self.preview, previous)?;
            let planned = self.variant.plan(&whole, &self.preview, previous, &mut self.qp);
            if self.variant.is_within_training() {
                return planned;
            }
            // Mostly faded out: neither of the two as a whole.
            self.learned_is_used = false;
        } else {
            self.variant.look(&whole, &self.preview, previous)?;
        }
        beside.plan(&whole, &self.preview, previous, &mut self.qp)
    }

    /// Writes the bounds of the steering: its limit, and the lateral acceleration that it may ask for beyond that of the
    /// road. The steering in force may be beyond, and comes back.
    ///
    /// ```text
    /// u_road,min - l a <= u_j <= u_road,max + l a        l = (L + K v^2) / v^2, K of understeer
    /// ```
    fn bound(&mut self, road: RoadSteer, lateral_accel: f64) {
        let problem = &mut self.qp.problem;
        let (previous, back) = (problem.previous[0], 0.5 * problem.shape.rate_max[0]);
        let (most, beyond) = (self.parameters.steer_max, road.per_accel * lateral_accel);
        let [least, largest] = road.range.map(|steer| steer.clamp(-most, most));
        problem.shape.input_min[0] = (least - beyond).min(previous + back).max(-most);
        problem.shape.input_max[0] = (largest + beyond).max(previous - back).min(most);
    }

    /// Writes the weights at a speed, [tightened](MpcParameters::tightened), and the bound of the rate.
    fn weigh(&mut self, input: &LateralInput<'_, S>) {
        let (speed, tightness) = (input.ahead.speed, input.tightness);
        let p = self.parameters.tightened(tightness);
        let errors = [p.q_e1, p.q_e1_rate, p.q_e2, p.q_e2_rate];
        // States behind the errors fall as an angle does.
        let faster = self.parameters.tightening.powf(tightness);
        let Qp { problem, tracked, .. } = &mut self.qp;
        let shape = &mut problem.shape;
        for ((weight, &state), &calm) in shape.output_weight.iter_mut().zip(&*tracked).zip(&self.weights) {
            *weight = errors.get(state).copied().unwrap_or(calm * faster.powi(-2));
        }
        let jerk = speed * speed / self.wheelbase;
        let rate_weight = p.r_rate + p.r_lateral_jerk * jerk * jerk;
        shape.rate_weight[0] = rate_weight / (p.sample_time * p.sample_time);
        shape.rate_max[0] = input.rate_max * p.sample_time;
    }

    /// The state after this step if `steer` is issued, with all knowledge of the newest prediction; `past` are the
    /// commands before it.
    #[must_use]
    pub fn next_state(&self, state: &SVector<f64, S>, past: &[f64], steer: f64) -> Option<ExpectedState<S>> {
        match &self.beside {
            Some(beside) if !self.learned_is_used => beside.next_state(state, past, steer),
            _ => self.variant.next_state(state, past, steer),
        }
    }

    /// The state after this step if `steer` is issued: by the nominal model, and with the full learned model regardless
    /// of the share in use. None without a learned model.
    #[must_use]
    pub fn without_and_with_learned(
        &self,
        state: &SVector<f64, S>,
        past: &[f64],
        steer: f64,
    ) -> Option<[SVector<f64, S>; 2]> {
        let both = self.variant.without_and_with_learned(state, past, steer)?;
        match &self.beside {
            Some(beside) => Some([beside.next_state(state, past, steer)?.state, both[1]]),
            None => Some(both),
        }
    }

    /// True if it predicts with a learned model.
    #[must_use]
    pub fn is_learned(&self) -> bool {
        self.variant.is_learned()
    }

    /// Steps of states and commands that the prediction looks back at; 0 for none.
    #[must_use]
    pub fn window(&self) -> usize {
        self.variant.window().max(self.beside.as_ref().map_or(0, |beside| beside.window()))
    }

    /// Share of the newest horizon where the residual was asked outside its training and reduced, 0 to 1.
    #[must_use]
    pub fn outside_training(&self) -> f64 {
        self.variant.outside_training()
    }

    /// The newest plan: steering command of each step of the horizon, rad.
    #[must_use]
    pub fn plan(&self) -> &[f64] {
        &self.qp.inputs
    }

    /// The newest predicted lateral error at the end of step `j`, m.
    #[must_use]
    pub fn predicted_e1(&self, j: usize) -> f64 {
        self.qp.outputs[j * self.qp.tracked.len()]
    }

    /// Station of the path at the end of step `j` of the newest prediction, m.
    #[must_use]
    pub fn predicted_station(&self, j: usize) -> f64 {
        self.preview.station[j]
    }

    /// The newest problem, for recording and for comparison with other solvers.
    #[must_use]
    pub fn problem(&self) -> &TrackingQp {
        &self.qp.problem
    }

    /// The newest nonlinear prediction of a car; none for a linear model or another vehicle.
    #[must_use]
    pub fn roll_out(&self) -> Option<&BicycleRollOut> {
        self.variant.roll_out()?.downcast_ref()
    }

    /// QPs that the newest step solved: more than 1 only for a nonlinear model.
    #[must_use]
    pub fn qps(&self) -> u32 {
        self.qp.solved
    }

    /// Times of the parts of the newest step.
    #[must_use]
    pub fn timing(&self) -> Timing {
        self.qp.timing
    }
}
