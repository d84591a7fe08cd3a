//! The nonlinear prediction over a horizon, with derivatives: from a plan of the steering to the errors ahead.

use crate::control::variant::Expected;
use crate::nominal::{
    Bicycle, BicycleErrors, BicycleState, BicycleStep, Curvature, ErrorState, SingleTrackError, errors_of,
};
use crate::path::Path;
use crate::vehicle::SingleTrack;
use nalgebra::{Matrix4, SMatrix, Vector4};

/// The prediction with everything it depends on but the road and the plan.
#[derive(Debug, Clone)]
pub struct BicycleRollOut {
    bicycle: Bicycle,
    sample_time: f64,
    /// State at the beginning.
    pub start: BicycleState,
    /// Mean speed of each step and speed at its end, m/s; positive.
    pub speed: Vec<[f64; 2]>,
    /// Added to the state after each step.
    pub disturbance: BicycleState,
    steps: Vec<Predicted>,
    start_errors: BicycleErrors,
    /// Command of the first step that was predicted.
    first_command: f64,
    /// Effects of the plan's commands on the newest state, for `gain`.
    effects: Vec<BicycleState>,
}

/// One step of the prediction.
#[derive(Debug, Clone, Copy)]
struct Predicted {
    step: BicycleStep,
    end: BicycleErrors,
}

fn road(path: &Path) -> impl Fn(f64) -> Curvature {
    |station| [path.curvature(station), path.curvature_rate(station)]
}

impl BicycleRollOut {
    /// Room for a horizon.
    ///
    /// # Errors
    /// A parameter of the vehicle or a friction that is not positive.
    pub fn new(
        vehicle: &SingleTrack,
        friction: f64,
        sample_time: f64,
        horizon: usize,
    ) -> Result<Self, SingleTrackError> {
        let bicycle = Bicycle::new(vehicle, friction)?;
        let step = BicycleStep {
            state: BicycleState::zeros(),
            by_state: SMatrix::zeros(),
            by_steer: BicycleState::zeros(),
        };
        let end = BicycleErrors { errors: ErrorState::zeros(), by_state: SMatrix::zeros() };
        Ok(Self {
            bicycle,
            sample_time,
            start: BicycleState::zeros(),
            speed: vec![[1.0; 2]; horizon],
            disturbance: BicycleState::zeros(),
            steps: vec![Predicted { step, end }; horizon],
            start_errors: end,
            first_command: 0.0,
            effects: vec![BicycleState::zeros(); horizon],
        })
    }

    /// The vehicle model.
    #[must_use]
    pub fn bicycle(&self) -> &Bicycle {
        &self.bicycle
    }

    /// Predicts under a plan, one steering command for each step.
    pub fn follow(&mut self, path: &Path, plan: &[f64]) {
        let mut state = self.start;
        // The speed at the beginning is nearly the mean one: the errors' dependence on it is not asked for here.
        let [mean_speed, _] = self.speed[0];
        self.start_errors = errors_of(&state, mean_speed, road(path)(state[0]));
        self.first_command = plan[0];
        for (j, steer) in plan.iter().enumerate() {
            let [_, end_speed] = self.speed[j];
            let step = self.step(road(path), &state, j, *steer);
            state = step.state;
            let end = errors_of(&state, end_speed, road(path)(state[0]));
            self.steps[j] = Predicted { step, end };
        }
    }

    /// Step `j` of the horizon from a state.
    fn step(
        &self,
        road: impl Fn(f64) -> Curvature,
        state: &BicycleState,
        j: usize,
        steer: f64,
    ) -> BicycleStep {
        let [mean_speed, _] = self.speed[j];
        let mut step = self.bicycle.step_along(road, state, mean_speed, steer, self.sample_time);
        step.state += self.disturbance;
        step
    }

    /// What is expected after the first step from errors that differ by `moved` and with another command, to first order:
    /// exact for those that were predicted with.
    #[must_use]
    pub fn first_step(&self, moved: &ErrorState, steer: f64) -> Expected {
        let Predicted { step, end } = &self.steps[0];
        // How the state depends on the errors, at the same station.
        let of_errors = self.start_errors.by_state.fixed_columns::<4>(1).try_inverse().unwrap_or_default();
        let by_state = end.by_state * step.by_state;
        let transition = by_state.fixed_columns::<4>(1) * of_errors;
        let command = steer - self.first_command;
        let state = end.errors + transition * moved + end.by_state * step.by_steer * command;
        Expected { state, transition }
    }

    /// Predicted errors at the end of step `j`.
    #[must_use]
    pub fn errors(&self, j: usize) -> &ErrorState {
        &self.steps[j].end.errors
    }

    /// Predicted state at the end of step `j`.
    #[must_use]
    pub fn state(&self, j: usize) -> &BicycleState {
        &self.steps[j].step.state
    }

    /// Writes the derivatives of the tracked errors by the plan, row-major; the upper triangle is left as it is.
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

    /// Yaw error at which the vehicle stays on a path of this curvature with a constant command and the speed at the
    /// end of step `j`: that of steady cornering, and where something acts beside the bicycle, with that.
    #[must_use]
    pub fn steady_yaw_error(&self, j: usize, curvature: f64) -> f64 {
        let [_, speed] = self.speed[j];
        let yaw_error = self.bicycle.steady_yaw_error(speed, curvature);
        if self.disturbance == BicycleState::zeros() {
            return yaw_error;
        }
        self.steady_with_disturbance(j, curvature, yaw_error).unwrap_or(yaw_error)
    }

    /// Newton on `step(x) = x` for `e2`, `vy`, `yaw_rate` and the command, with `e1 = 0`.
    fn steady_with_disturbance(&self, j: usize, curvature: f64, yaw_error: f64) -> Option<f64> {
        let [speed, _] = self.speed[j];
        let yaw_rate = curvature * speed;
        let wheelbase = self.bicycle.vehicle().lf + self.bicycle.vehicle().lr;
        let mut x = Vector4::new(yaw_error, -speed * yaw_error.tan(), yaw_rate, wheelbase * curvature);
        for _ in 0..2 {
            let state = BicycleState::new(0.0, 0.0, x[0], x[1], x[2]);
            let step = self.step(|_| [curvature, 0.0], &state, j, x[3]);
            let gap = (step.state - state).fixed_rows::<4>(1).into_owned();
            let mut by = Matrix4::zeros();
            by.fixed_view_mut::<4, 3>(0, 0).copy_from(&step.by_state.fixed_view::<4, 3>(1, 2));
            by.fixed_view_mut::<4, 1>(0, 3).copy_from(&step.by_steer.fixed_rows::<4>(1));
            for i in 0..3 {
                by[(i + 1, i)] -= 1.0;
            }
            x -= by.lu().solve(&gap)?;
        }
        Some(x[0])
    }
}
