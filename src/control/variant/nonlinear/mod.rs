//! Nonlinear MPC: a nonlinear model along the path, by Gauss-Newton sequential quadratic programming.
//!
//! With the plan `U` and the predicted errors `y(U)`, the problem is the tracking problem of all variants with
//! `y = y(U)` in place of `free + G U`. Each iteration linearises,
//!
//! ```text
//! G = dy/dU,   free = y(U) - G U,   solve the QP: U*,   U <- U + alpha (U* - U)
//! ```
//!
//! with `alpha` found by halving until the true objective, soft bounds included, falls by a share of the QP's promise
//! (Armijo). The bounds of the commands are linear and the first plan, the last one shifted, is cut to them: every
//! iterate can be driven. The errors are small beside the curvature of `y`, so Gauss-Newton converges within a few
//! iterations.
//!
//! It is written for any [`PathModel`]: the bicycle of a car, the tractor with semi-trailer of a truck. With a Gaussian
//! process (GP-NMPC) its mean and gradient correct `vy`, the yaw rate and that of the articulation after each step.
//!
//! The information is that of the linear MPC: measured state, path, planned speeds, command in force, disturbance.
//!
//! Sources: Kabzan et al., Learning-Based MPC for Autonomous Racing, RA-L 2019; Bock and Plitt 1984. Diehl et al.,
//! Real-time optimization and nonlinear model predictive control, J. Process Control 2002. Line search on a convex
//! composite: Burke 1985.

mod roll_out;

pub use roll_out::{ArticulatedRollOut, BicycleRollOut, NonlinearRollOut, StepSpeed};

use super::{ExpectedState, Qp, Variant};
use crate::control::NmpcParameters;
use crate::control::lateral::{LateralError, LateralInput};
use crate::control::parameters::MpcParameters;
use crate::control::preview::Preview;
use crate::control::tracking_qp::{QpEnd, QpError, QpReport};
use crate::control::vehicle::Nonlinear;
use crate::nominal::PathModel;
use crate::path::Path;
use crate::residual::gp::{GpModel, GpModelFor, GpVehicle, TruckGpModel};
use crate::residual::{self, FileError};
use nalgebra::SVector;
use std::any::Any;
use std::sync::Arc;
use std::time::Instant;

/// Prediction and iteration of a nonlinear MPC; `G` is the learned model of its errors.
#[derive(Debug, Clone)]
pub struct NonlinearModel<G> {
    /// Friction coefficient of the tyres. Given, not learned: in ordinary driving the peak cannot be observed.
    pub friction: f64,
    /// Most QPs of a step.
    pub max_iterations: usize,
    /// Learned error of the model in a step: GP-NMPC.
    pub gp: Option<Arc<G>>,
}

/// Nonlinear model of a car: the bicycle.
pub type BicycleModel = NonlinearModel<GpModel>;

/// Nonlinear model of a truck: tractor and semi-trailer.
pub type ArticulatedModel = NonlinearModel<TruckGpModel>;

impl<G> Default for NonlinearModel<G> {
    fn default() -> Self {
        Self { friction: 1.0, max_iterations: 30, gp: None }
    }
}

impl<V: GpVehicle<S, N, O>, const S: usize, const N: usize, const O: usize> Nonlinear<V, S>
    for NonlinearModel<GpModelFor<V, N, O>>
{
    type Gp = GpModelFor<V, N, O>;

    fn of(parameters: &NmpcParameters, gp: Option<Arc<Self::Gp>>) -> Option<Self> {
        let NmpcParameters { friction, max_iterations } = *parameters;
        Some(Self { friction, max_iterations, gp })
    }

    fn gp_from_bytes(bytes: &[u8]) -> Result<Self::Gp, FileError> {
        GpModelFor::from_bytes(bytes)
    }

    fn variant(self, vehicle: V, parameters: &MpcParameters) -> Result<Box<dyn Variant<S>>, LateralError> {
        let Self { friction, max_iterations, gp } = self;
        if let Some(gp) = &gp {
            let expected = residual::Expected {
                vehicle,
                sample_time: parameters.sample_time,
                min_model_speed: parameters.min_model_speed,
                window: None,
            };
            gp.check_fits(&expected, friction)?;
        }
        let MpcParameters { sample_time, horizon, .. } = *parameters;
        let roll_out = NonlinearRollOut::new(&vehicle, friction, gp, sample_time, horizon)?;
        Ok(Box::new(NonlinearMpc::new(roll_out, parameters, max_iterations)))
    }
}

/// Step of the plan below which the iterations end, rad: Gauss-Newton contracts, the remaining error is smaller.
const STEP_TOLERANCE: f64 = 1e-5;
/// Share of the promised decrease that a step must bring.
const ARMIJO: f64 = 1e-4;
/// Shortest step is `2^-HALVINGS`.
const HALVINGS: u32 = 12;

/// The variant.
pub struct NonlinearMpc<V: GpVehicle<S, N, O>, const S: usize, const N: usize, const O: usize> {
    roll_out: NonlinearRollOut<V, S, N, O>,
    max_iterations: usize,
    min_model_speed: f64,
    steer_max: f64,
    /// Largest change of the command in a step, rad.
    steer_change: f64,
    plan: Vec<f64>,
    trial: Vec<f64>,
    outputs: Vec<f64>,
    /// Errors that the newest prediction started from.
    start: SVector<f64, S>,
    planned: bool,
}

/// End of a line search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Search {
    /// The plan has moved to a better one.
    Better,
    /// No step of the direction is better.
    Stuck,
}

impl<V: GpVehicle<S, N, O>, const S: usize, const N: usize, const O: usize> NonlinearMpc<V, S, N, O> {
    fn new(roll_out: NonlinearRollOut<V, S, N, O>, p: &MpcParameters, max_iterations: usize) -> Self {
        Self {
            roll_out,
            max_iterations: max_iterations.max(1),
            min_model_speed: p.min_model_speed,
            steer_max: p.steer_max,
            steer_change: p.steer_rate_max * p.sample_time,
            plan: vec![0.0; p.horizon],
            trial: vec![0.0; p.horizon],
            outputs: Vec::new(),
            start: SVector::zeros(),
            planned: false,
        }
    }

    /// Start of the prediction, and its inputs.
    fn set_up(&mut self, input: &LateralInput<'_, S>, preview: &Preview) {
        let (errors, disturbance) = (input.state, input.disturbance);
        let roll_out = &mut self.roll_out;
        roll_out.start = V::Model::state_of(input.station, errors, input.vy, input.yaw_rate);
        // The model is stiff at standstill: it never drives slower than this, neither its tyres nor along the path.
        for (j, speed) in roll_out.speed.iter_mut().enumerate() {
            let ([begin, ..], [mean, end]) = (preview.road[j], preview.speed[j]);
            *speed = StepSpeed {
                speed: [begin, mean, end].map(|speed| speed.max(self.min_model_speed)),
                planned: begin,
                accel: input.ahead.accel,
            };
        }
        roll_out.disturbance = V::Model::change_of(disturbance, input.ahead.speed.max(self.min_model_speed));
        self.start = *errors;
        self.planned = true;
    }

    /// The first plan: the last one, its end held, cut to the bounds.
    fn warm_start(&mut self, last_plan: &[f64], previous: f64) {
        let end = last_plan.last().copied().unwrap_or(previous);
        let planned = last_plan.iter().copied().chain(std::iter::repeat(end));
        let mut before = previous;
        for (command, planned) in self.plan.iter_mut().zip(planned) {
            *command = planned
                .clamp(before - self.steer_change, before + self.steer_change)
                .clamp(-self.steer_max, self.steer_max);
            before = *command;
        }
    }

    /// Linearises the outputs around the plan that was predicted last.
    fn linearise(&mut self, qp: &mut Qp) {
        let problem = &mut qp.problem;
        self.roll_out.write_gain(&qp.tracked, &mut problem.gain);
        problem.shift_invariant = false;
        let (horizon, outputs) = (problem.shape.horizon, problem.shape.outputs);
        for (row, (free, output)) in problem.free.iter_mut().zip(&self.outputs).enumerate() {
            let gain = &problem.gain[row * horizon..][..=row / outputs];
            let forced: f64 = gain.iter().zip(&self.plan).map(|(gain, command)| gain * command).sum();
            *free = output - forced;
        }
    }

    /// Line search from the plan towards the QP's, as far as the true objective follows the QP's promise.
    fn search(&mut self, path: &Path, qp: &Qp, objective: &mut f64, promised: f64) -> Search {
        let mut alpha = 1.0;
        for _ in 0..=HALVINGS {
            for ((trial, from), to) in self.trial.iter_mut().zip(&self.plan).zip(&qp.inputs) {
                *trial = from + alpha * (to - from);
            }
            self.roll_out.follow(path, &self.trial);
            let reached = assess(&self.roll_out, &self.trial, qp, &mut self.outputs);
            if reached <= *objective - ARMIJO * alpha * promised {
                std::mem::swap(&mut self.plan, &mut self.trial);
                *objective = reached;
                return Search::Better;
            }
            alpha *= 0.5;
        }
        self.roll_out.follow(path, &self.plan);
        assess(&self.roll_out, &self.plan, qp, &mut self.outputs);
        Search::Stuck
    }
}

/// Writes the outputs predicted under a plan and gives the true objective.
fn assess<V: GpVehicle<S, N, O>, const S: usize, const N: usize, const O: usize>(
    roll_out: &NonlinearRollOut<V, S, N, O>,
    plan: &[f64],
    qp: &Qp,
    outputs: &mut [f64],
) -> f64 {
    for (j, of_step) in outputs.chunks_exact_mut(qp.tracked.len()).enumerate() {
        for (output, &state) in of_step.iter_mut().zip(&qp.tracked) {
            *output = roll_out.errors(j)[state];
        }
    }
    qp.problem.objective(plan, outputs)
}

impl<V: GpVehicle<S, N, O>, const S: usize, const N: usize, const O: usize> Variant<S>
    for NonlinearMpc<V, S, N, O>
{
    fn plan(
        &mut self,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        previous: f64,
        qp: &mut Qp,
    ) -> Result<QpReport, QpError> {
        let begin = Instant::now();
        self.set_up(input, preview);
        self.warm_start(input.last_plan, previous);
        self.roll_out.follow_anew(input.path, &self.plan, input.residual_share);
        qp.refer(|j| self.roll_out.steady(j, preview.curvature[j]));
        self.outputs.resize(qp.outputs.len(), 0.0);
        let mut objective = assess(&self.roll_out, &self.plan, qp, &mut self.outputs);
        if !objective.is_finite() {
            return Err(QpError::Numerical { iterations: 0 });
        }
        let (mut end, mut iterations) = (QpEnd::ReducedAccuracy, 0);
        for iteration in 0..self.max_iterations {
            self.linearise(qp);
            let left = (input.time_limit - begin.elapsed().as_secs_f64()).max(0.0);
            let report = match qp.solve(left) {
                Ok(report) => report,
                Err(error) if iteration == 0 => return Err(error),
                // What the iterations before have reached can be driven and is better than the last plan.
                Err(_) => break,
            };
            iterations += report.iterations;
            let size =
                qp.inputs.iter().zip(&self.plan).map(|(to, from)| (to - from).abs()).fold(0.0, f64::max);
            let promised = objective - qp.problem.objective(&qp.inputs, &qp.outputs);
            let search = self.search(input.path, qp, &mut objective, promised.max(0.0));
            if size <= STEP_TOLERANCE {
                end = report.end;
                break;
            }
            if search == Search::Stuck {
                break;
            }
        }
        qp.inputs.copy_from_slice(&self.plan);
        qp.outputs.copy_from_slice(&self.outputs);
        qp.timing.condense = begin.elapsed().as_secs_f64() - qp.timing.solve;
        Ok(QpReport { end, iterations, objective })
    }

    fn next_state(&self, state: &SVector<f64, S>, _past: &[f64], steer: f64) -> Option<ExpectedState<S>> {
        self.planned.then(|| self.roll_out.first_step(&(state - self.start), steer))
    }

    fn without_and_with_learned(
        &self,
        state: &SVector<f64, S>,
        _past: &[f64],
        steer: f64,
    ) -> Option<[SVector<f64, S>; 2]> {
        let moved = state - self.start;
        self.planned.then(|| self.roll_out.first_step_without_and_with(&moved, steer))?
    }

    fn is_learned(&self) -> bool {
        self.roll_out.is_learned()
    }

    fn outside_training(&self) -> f64 {
        self.roll_out.outside_training()
    }

    fn roll_out(&self) -> Option<&dyn Any> {
        Some(&self.roll_out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::history::History;
    use crate::control::preview::SpeedAhead;
    use crate::control::tracking_qp::{QpShape, QpSolver, SoftBound, TrackingQp};
    use crate::control::variant::Timing;
    use crate::control::{ActiveSetSolver, ControllerParameters};
    use crate::nominal::ErrorState;
    use crate::path::{Closure, Sample};
    use nalgebra::Vector4;

    /// A solver that is out of time after some QPs.
    struct OutOfTime {
        solver: ActiveSetSolver,
        left: u32,
    }

    impl QpSolver for OutOfTime {
        fn solve(
            &mut self,
            problem: &TrackingQp,
            time_limit: f64,
            inputs: &mut [f64],
            outputs: &mut [f64],
        ) -> Result<QpReport, QpError> {
            if self.left == 0 {
                inputs.fill(f64::NAN);
                return Err(QpError::TimeLimit { iterations: 3 });
            }
            self.left -= 1;
            self.solver.solve(problem, time_limit, inputs, outputs)
        }
    }

    fn plan(qps: u32) -> (Result<QpReport, QpError>, Vec<f64>) {
        let p = ControllerParameters::default();
        let horizon = p.mpc.horizon;
        let shape = QpShape {
            horizon,
            outputs: 3,
            inputs: 1,
            output_weight: vec![1.0, 0.4, 1.0],
            terminal_factor: 1.0,
            rate_weight: vec![75.0],
            input_min: vec![-0.6],
            input_max: vec![0.6],
            rate_max: vec![0.016],
            soft: vec![SoftBound { output: 0, min: -0.5, max: 0.5, quadratic: 100.0, linear: 1.0 }],
        };
        let mut qp = Qp {
            tracked: vec![0, 1, 2],
            largest_reference: vec![0.0, 0.0, 0.3],
            solver: Box::new(OutOfTime { solver: ActiveSetSolver::new(&shape), left: qps }),
            problem: TrackingQp::new(shape),
            inputs: vec![0.0; horizon],
            outputs: vec![0.0; 3 * horizon],
            timing: Timing::default(),
            transient: Vec::new(),
            solved: 0,
            terms: None,
        };
        qp.problem.previous[0] = 0.2;
        let circle = (0..100).map(|k| {
            let angle = f64::from(k) * std::f64::consts::TAU / 100.0;
            Sample::at(12.0 * angle.cos(), 12.0 * angle.sin())
        });
        let path = Path::from_samples(circle.collect(), Closure::Closed).unwrap();
        let ahead = SpeedAhead { speed: 5.0, accel: 0.0, predicted: &[] };
        let mut preview = Preview::new(horizon);
        preview.look(&path, 10.0, ahead, 0.02);
        let input = LateralInput {
            state: &Vector4::new(0.4, 0.5, 0.1, 0.0),
            vy: 0.0,
            yaw_rate: 5.0 * path.curvature(10.0),
            history: &History::new(0),
            last_plan: &[],
            station: 10.0,
            ahead,
            previous: 0.2,
            rate_max: 1.0,
            path: &path,
            disturbance: &ErrorState::zeros(),
            residual_share: 1.0,
            time_limit: f64::INFINITY,
            actuator: None,
            tightness: 0.0,
            lateral_accel: f64::INFINITY,
        };
        let mut mpc = BicycleModel::default().variant(p.vehicle.single_track(), &p.mpc).unwrap();
        let report = mpc.plan(&input, &preview, 0.2, &mut qp);
        (report, qp.inputs)
    }

    #[test]
    fn what_a_stopped_iteration_has_reached_is_a_plan() {
        assert_eq!(plan(0).0, Err(QpError::TimeLimit { iterations: 3 }));
        let ((full, converged), (stopped, reached)) = (plan(30), plan(1));
        let (full, stopped) = (full.unwrap(), stopped.unwrap());
        assert_eq!((full.end, stopped.end), (QpEnd::Solved, QpEnd::ReducedAccuracy));
        assert!(full.objective <= stopped.objective && stopped.objective < 1.01 * full.objective);
        let mut before = 0.2;
        for command in &reached {
            assert!((command - before).abs() < 0.016 + 1e-9 && command.abs() < 0.6 + 1e-9);
            before = *command;
        }
        assert_ne!(reached, converged, "one QP is not all");
    }
}
