//! The nonlinear bicycle along a path, with derivatives: `vy'` and `r'` of `bicycle.rs` behind the motion of
//! `path_model.rs`.

use super::path_model::{PathMotion, Sensed, integrate, motion, newton};
use super::{Bicycle, Curvature, ERRORS, ErrorState, HeldSpeed, PathErrors, PathModel, PathStep};
use nalgebra::{SMatrix, SVector};

/// `[station m, e1 m, e2 rad, vy m/s, yaw_rate rad/s]`.
pub type BicycleState = SVector<f64, BICYCLE_STATES>;

/// Number of the bicycle's states on a path.
pub const BICYCLE_STATES: usize = 5;

/// Errors to the path of a bicycle's state, where the path has this curvature.
#[must_use]
pub fn errors_of(state: &BicycleState, vx: f64, curvature: Curvature) -> PathErrors<ERRORS, BICYCLE_STATES> {
    let (errors, by_state) = motion(state, vx, curvature).errors(state, curvature);
    PathErrors { errors: ErrorState::from(errors), by_state }
}

/// Change of `[vy, yaw_rate]` that belongs to a small change of the errors, at a small yaw error.
#[must_use]
pub fn body_change(errors: &ErrorState, vx: f64) -> [f64; 2] {
    [errors[1] - vx * errors[2], errors[3]]
}

impl PathModel<ERRORS, BICYCLE_STATES> for Bicycle {
    fn step_along(
        &self,
        road: impl Fn(f64) -> Curvature,
        state: &BicycleState,
        vx: HeldSpeed,
        steer: f64,
        sample_time: f64,
    ) -> PathStep<BICYCLE_STATES> {
        let count = self.substeps(vx.body, sample_time);
        integrate(|at| self.slope(&road, at, vx, steer), state, count, sample_time)
    }

    fn errors_of(state: &BicycleState, vx: f64, curvature: Curvature) -> PathErrors<ERRORS, BICYCLE_STATES> {
        errors_of(state, vx, curvature)
    }

    fn state_of(station: f64, errors: &ErrorState, vy: f64, yaw_rate: f64) -> BicycleState {
        BicycleState::new(station, errors[0], errors[2], vy, yaw_rate)
    }

    fn change_of(errors: &ErrorState, vx: f64) -> BicycleState {
        let [vy, yaw_rate] = body_change(errors, vx);
        BicycleState::new(0.0, errors[0], errors[2], vy, yaw_rate)
    }

    fn steady_errors(&self, vx: f64, curvature: f64) -> ErrorState {
        ErrorState::new(0.0, 0.0, self.steady_yaw_error(vx, curvature), 0.0)
    }

    fn steady_state(&self, vx: f64, curvature: f64, errors: &ErrorState) -> (BicycleState, f64) {
        let yaw_error = errors[2];
        let (vy, yaw_rate) = (-vx * yaw_error.tan(), curvature * vx / yaw_error.cos());
        (BicycleState::new(0.0, 0.0, yaw_error, vy, yaw_rate), self.steady_steer(vx, curvature))
    }

    fn steadier(
        errors: &ErrorState,
        state: &BicycleState,
        step: &PathStep<BICYCLE_STATES>,
    ) -> Option<ErrorState> {
        let (by, gap) = newton::<BICYCLE_STATES, { BICYCLE_STATES - 1 }>(state, step);
        let change = by.lu().solve(&gap)?;
        Some(ErrorState::new(0.0, 0.0, errors[2] - change[0], 0.0))
    }
}

impl Bicycle {
    fn slope(
        &self,
        road: &impl Fn(f64) -> Curvature,
        at: &Sensed<5, 6>,
        vx: HeldSpeed,
        steer: f64,
    ) -> Sensed<5, 6> {
        let x = &at.value;
        let curvature = road(x[0]);
        let on_path: PathMotion = motion(x, vx.path, curvature);
        let body = self.rates(x[3], x[4], vx.body, steer);
        let [station_rate, lateral_rate, yaw_rate] = on_path.rates(x[4], curvature);
        let value = [station_rate, lateral_rate, yaw_rate, body.value[0], body.value[1]];
        let mut by = SMatrix::<f64, 5, 6>::zeros();
        for column in 0..6 {
            let d = at.by.column(column).into_owned();
            for (row, change) in on_path.changes(&d, curvature).into_iter().enumerate() {
                by[(row, column)] = change;
            }
            // Where the vehicle is on the path does not move its body: three columns stay zero.
            if column >= 3 {
                let steered = if column == 5 { 1.0 } else { 0.0 };
                for (row, jacobian) in body.jacobian.iter().enumerate() {
                    by[(3 + row, column)] = jacobian[0] * d[3] + jacobian[1] * d[4] + jacobian[2] * steered;
                }
            }
        }
        Sensed { value: value.into(), by }
    }
}
