//! The nonlinear prediction over a horizon, with derivatives: from a plan of the steering to the errors ahead.

use crate::control::truck::TRUCK_STATES;
use crate::control::variant::ExpectedState;
use crate::nominal::{
    ARTICULATED_PATH_STATES, BICYCLE_STATES, Curvature, ERRORS, HeldSpeed, PathErrors, PathModel, PathStep,
    SingleTrackError,
};
use crate::path::Path;
use crate::residual::gp::{GP_OUTPUTS, GpModelFor, GpResidual, GpVehicle, TRUCK_GP_OUTPUTS};
use crate::vehicle::{Articulated, SingleTrack};
use nalgebra::{SMatrix, SVector};
use std::sync::Arc;

/// Planned motion in one step of the horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSpeed {
    /// At the beginning, in the middle and at the end, m/s: the model's, positive.
    pub speed: [f64; 3],
    /// At the beginning as planned, m/s, maybe 0: the speed of the Gaussian process's input.
    pub planned: f64,
    /// Acceleration, m/s2.
    pub accel: f64,
}

impl StepSpeed {
    /// A held speed.
    #[must_use]
    pub fn held(speed: f64) -> Self {
        Self { speed: [speed; 3], planned: speed, accel: 0.0 }
    }

    /// Speed held by the model within the step: the mean. A Gaussian process has learned the errors of a body that
    /// holds the speed of the step's beginning.
    fn held_within(&self, corrected: bool) -> HeldSpeed {
        let [begin, mean, _] = self.speed;
        HeldSpeed { path: mean, body: if corrected { begin } else { mean } }
    }
}

/// The prediction of a car.
pub type BicycleRollOut = NonlinearRollOut<SingleTrack, ERRORS, BICYCLE_STATES, GP_OUTPUTS>;

/// The prediction of a truck.
pub type ArticulatedRollOut =
    NonlinearRollOut<Articulated, TRUCK_STATES, ARTICULATED_PATH_STATES, TRUCK_GP_OUTPUTS>;

/// The prediction with all its inputs but the road and the plan. The vehicle's model has `N` states and `S` errors to
/// the path; a Gaussian process corrects `O` of the states.
#[derive(Debug, Clone)]
pub struct NonlinearRollOut<V: GpVehicle<S, N, O>, const S: usize, const N: usize, const O: usize> {
    model: V::Model,
    sample_time: f64,
    /// State at the beginning.
    pub start: SVector<f64, N>,
    /// Speeds of each step.
    pub speed: Vec<StepSpeed>,
    /// Added to the state after each step.
    pub disturbance: SVector<f64, N>,
    gp: Option<Arc<GpModelFor<V, N, O>>>,
    /// Trust in the process at each step, 0 to 1.
    trust: Vec<f64>,
    /// Share of it in use, and true if it is asked within its training: nearer to it than half a range's width.
    share: f64,
    inside: Vec<bool>,
    /// Errors after the first step that was predicted, without the process.
    without: SVector<f64, S>,
    steps: Vec<Predicted<S, N>>,
    start_errors: PathErrors<S, N>,
    /// Command of the first step that was predicted.
    first_command: f64,
    /// Effects of the plan's commands on the newest state, for `gain`.
    effects: Vec<SVector<f64, N>>,
}

/// One step of the prediction.
#[derive(Debug, Clone, Copy)]
struct Predicted<const S: usize, const N: usize> {
    step: PathStep<N>,
    end: PathErrors<S, N>,
}

fn road(path: &Path) -> impl Fn(f64) -> Curvature {
    |station| [path.curvature(station), path.curvature_rate(station)]
}

/// Start of the body's states: behind station and errors.
const BODY: usize = 3;

impl BicycleRollOut {
    /// Yaw error at which the vehicle stays on a path of this curvature: see [`steady`](Self::steady).
    #[must_use]
    pub fn steady_yaw_error(&self, j: usize, curvature: f64) -> f64 {
        self.steady(j, curvature)[2]
    }
}

impl<V: GpVehicle<S, N, O>, const S: usize, const N: usize, const O: usize> NonlinearRollOut<V, S, N, O> {
    /// Room for a horizon.
    ///
    /// # Errors
    /// A parameter of the vehicle or a friction that is not positive.
    pub fn new(
        vehicle: &V,
        friction: f64,
        gp: Option<Arc<GpModelFor<V, N, O>>>,
        sample_time: f64,
        horizon: usize,
    ) -> Result<Self, SingleTrackError> {
        let model = vehicle.nonlinear_model(friction)?;
        let zero = SVector::zeros();
        let step = PathStep { state: zero, by_state: SMatrix::zeros(), by_steer: zero };
        let end = PathErrors { errors: SVector::zeros(), by_state: SMatrix::zeros() };
        Ok(Self {
            model,
            sample_time,
            start: zero,
            speed: vec![StepSpeed::held(1.0); horizon],
            disturbance: zero,
            gp,
            trust: vec![0.0; horizon],
            share: 0.0,
            inside: vec![true; horizon],
            without: SVector::zeros(),
            steps: vec![Predicted { step, end }; horizon],
            start_errors: end,
            first_command: 0.0,
            effects: vec![zero; horizon],
        })
    }

    /// The vehicle model.
    #[must_use]
    pub fn model(&self) -> &V::Model {
        &self.model
    }

    /// Predicts under a plan, one steering command for each step.
    pub fn follow(&mut self, path: &Path, plan: &[f64]) {
        self.predict(path, plan, None);
    }

    /// Predicts under a plan, and sets the trust in the Gaussian process along it. Outside its training the process
    /// fades; half a range's width further there is the model alone. A share scales the rest. Later plans keep this
    /// trust, so that they are compared by one smooth problem.
    pub fn follow_anew(&mut self, path: &Path, plan: &[f64], share: f64) {
        self.predict(path, plan, Some(share));
    }

    fn predict(&mut self, path: &Path, plan: &[f64], share: Option<f64>) {
        let mut state = self.start;
        // The speed at the beginning is nearly the mean one: the errors' dependence on it is not asked for here.
        let [_, mean_speed, _] = self.speed[0].speed;
        self.start_errors = V::Model::errors_of(&state, mean_speed, road(path)(state[0]));
        self.first_command = plan[0];
        for (j, steer) in plan.iter().enumerate() {
            if let (Some(share), Some(gp)) = (share, &self.gp) {
                let excess = gp.excess(&self.input(&state, j, *steer));
                let trust = (1.0 - 2.0 * excess).clamp(0.0, 1.0);
                (self.share, self.inside[j], self.trust[j]) = (share, trust >= 1.0, trust * share);
            }
            let step = self.step(road(path), &state, j, *steer);
            let [_, _, end_speed] = self.speed[j].speed;
            if j == 0 && self.gp.is_some() {
                let speed = self.speed[j].held_within(self.trust[j] > 0.0);
                let without = self.model.step_along(road(path), &state, speed, *steer, self.sample_time);
                let without = without.state + self.disturbance;
                self.without = V::Model::errors_of(&without, end_speed, road(path)(without[0])).errors;
            }
            state = step.state;
            let end = V::Model::errors_of(&state, end_speed, road(path)(state[0]));
            self.steps[j] = Predicted { step, end };
        }
    }

    /// Step `j` of the horizon from a state.
    fn step(
        &self,
        road: impl Fn(f64) -> Curvature,
        state: &SVector<f64, N>,
        j: usize,
        steer: f64,
    ) -> PathStep<N> {
        let speed = self.speed[j].held_within(self.trust[j] > 0.0);
        let mut step = self.model.step_along(road, state, speed, steer, self.sample_time);
        step.state += self.disturbance;
        if let Some(gp) = self.gp.as_ref().filter(|_| self.trust[j] > 0.0) {
            let GpResidual { mean, gradient } = gp.residual(&self.input(state, j, steer));
            for ((place, mean), by) in V::OUTPUTS.into_iter().zip(mean).zip(gradient) {
                // The inputs are the speed, the body's states, command and acceleration.
                let row = place - 1 + BODY;
                step.state[row] += self.trust[j] * mean;
                for column in BODY..N {
                    step.by_state[(row, column)] += self.trust[j] * by[column - BODY + 1];
                }
                step.by_steer[row] += self.trust[j] * by[N - 2];
            }
        }
        step
    }

    /// Input of the Gaussian process.
    fn input(&self, state: &SVector<f64, N>, j: usize, steer: f64) -> [f64; N] {
        let StepSpeed { planned, accel, .. } = self.speed[j];
        let mut input = [0.0; N];
        (input[0], input[N - 2], input[N - 1]) = (planned, steer, accel);
        input[1..N - 2].copy_from_slice(&state.as_slice()[BODY..]);
        input
    }

    /// True if it has a Gaussian process.
    #[must_use]
    pub fn is_learned(&self) -> bool {
        self.gp.is_some()
    }

    /// Share of the horizon where the Gaussian process was asked outside its training, 0 to 1.
    #[must_use]
    pub fn outside_training(&self) -> f64 {
        let outside = self.inside.iter().filter(|inside| !**inside).count();
        if self.gp.is_some() { outside as f64 / self.trust.len() as f64 } else { 0.0 }
    }

    /// Expected state after the first step from errors that differ by `moved` and with another command, to first order.
    /// Exact for the errors of the prediction.
    #[must_use]
    pub fn first_step(&self, moved: &SVector<f64, S>, steer: f64) -> ExpectedState<S> {
        let Predicted { step, end } = &self.steps[0];
        // How the state depends on the errors, at the same station.
        let of_errors =
            self.start_errors.by_state.fixed_columns::<S>(1).try_inverse().unwrap_or_else(SMatrix::zeros);
        let by_state = end.by_state * step.by_state;
        let transition = by_state.fixed_columns::<S>(1) * of_errors;
        let command = steer - self.first_command;
        let state = end.errors + transition * moved + end.by_state * step.by_steer * command;
        ExpectedState { state, transition }
    }

    /// The same without the process and with all of it, regardless of the share in use; none without a learned process
    /// in use.
    #[must_use]
    pub fn first_step_without_and_with(
        &self,
        moved: &SVector<f64, S>,
        steer: f64,
    ) -> Option<[SVector<f64, S>; 2]> {
        self.gp.as_ref().filter(|_| self.share > 0.0)?;
        let used = self.first_step(moved, steer).state;
        let by_process = self.steps[0].end.errors - self.without;
        let without = used - by_process;
        Some([without, without + by_process / self.share])
    }

    /// Predicted errors at the end of step `j`.
    #[must_use]
    pub fn errors(&self, j: usize) -> &SVector<f64, S> {
        &self.steps[j].end.errors
    }

    /// Predicted state at the end of step `j`.
    #[must_use]
    pub fn state(&self, j: usize) -> &SVector<f64, N> {
        &self.steps[j].step.state
    }

    /// Writes the derivatives of the tracked errors by the plan, row-major; the upper triangle is left unchanged.
    pub fn write_gain(&mut self, tracked: &[usize], gain: &mut [f64]) {
        let horizon = self.steps.len();
        for (j, Predicted { step, end }) in self.steps.iter().enumerate() {
            for effect in &mut self.effects[..j] {
                *effect = step.by_state * *effect;
            }
            self.effects[j] = step.by_steer;
            for (i, &output) in tracked.iter().enumerate() {
                let by = end.by_state.row(output);
                let row = &mut gain[(j * tracked.len() + i) * horizon..][..=j];
                for (entry, effect) in row.iter_mut().zip(&self.effects) {
                    *entry = (by * effect)[0];
                }
            }
        }
    }

    /// Errors at which the vehicle stays on a path of this curvature with a constant command and the speed of step `j`.
    /// They are those of steady cornering, with any disturbance beside the model.
    #[must_use]
    pub fn steady(&self, j: usize, curvature: f64) -> SVector<f64, S> {
        let [_, _, speed] = self.speed[j].speed;
        let errors = self.model.steady_errors(speed, curvature);
        if self.disturbance == SVector::<f64, N>::zeros() && self.trust[j] == 0.0 {
            return errors;
        }
        let [speed, ..] = self.speed[j].speed;
        let (state, steer) = self.model.steady_state(speed, curvature, &errors);
        let step = self.step(|_| [curvature, 0.0], &state, j, steer);
        V::Model::steadier(&errors, &state, &step).unwrap_or(errors)
    }
}
