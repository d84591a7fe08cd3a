//! The nonlinear tractor with semi-trailer along a path, with derivatives: the body of `articulated_single_track.rs` behind
//! the motion of `path_model.rs`.

use super::path_model::{Sensed, integrate, motion, newton};
use super::{
    ArticulatedSingleTrack, ArticulatedState, Curvature, ErrorState, HeldSpeed, PathErrors, PathModel,
    PathStep, SteadyTurn, body_change,
};
use nalgebra::{SMatrix, SVector};

/// `[station m, e1 m, e2 rad, vy m/s, yaw_rate rad/s, articulation rad, articulation_rate rad/s]`; the first five of the tractor.
pub type ArticulatedPathState = SVector<f64, ARTICULATED_PATH_STATES>;

/// Number of those states.
pub const ARTICULATED_PATH_STATES: usize = 7;

type SensedSlope = Sensed<7, 8>;

impl PathModel<6, ARTICULATED_PATH_STATES> for ArticulatedSingleTrack {
    fn step_along(
        &self,
        road: impl Fn(f64) -> Curvature,
        state: &ArticulatedPathState,
        vx: HeldSpeed,
        steer: f64,
        sample_time: f64,
    ) -> PathStep<ARTICULATED_PATH_STATES> {
        let count = self.substeps(vx.body, sample_time);
        integrate(|at| self.slope(&road, at, vx, steer), state, count, sample_time)
    }

    fn errors_of(
        state: &ArticulatedPathState,
        vx: f64,
        curvature: Curvature,
    ) -> PathErrors<6, ARTICULATED_PATH_STATES> {
        let ([e1, e1_rate, e2, e2_rate], of_tractor) = motion(state, vx, curvature).errors(state, curvature);
        let mut by_state = SMatrix::<f64, 6, ARTICULATED_PATH_STATES>::zeros();
        by_state.fixed_rows_mut::<4>(0).copy_from(&of_tractor);
        by_state[(4, 5)] = 1.0;
        by_state[(5, 6)] = 1.0;
        let errors = ArticulatedState::from([e1, e1_rate, e2, e2_rate, state[5], state[6]]);
        PathErrors { errors, by_state }
    }

    fn state_of(station: f64, errors: &ArticulatedState, vy: f64, yaw_rate: f64) -> ArticulatedPathState {
        [station, errors[0], errors[2], vy, yaw_rate, errors[4], errors[5]].into()
    }

    fn change_of(errors: &ArticulatedState, vx: f64) -> ArticulatedPathState {
        let of_tractor = ErrorState::new(errors[0], errors[1], errors[2], errors[3]);
        let [vy, yaw_rate] = body_change(&of_tractor, vx);
        [0.0, errors[0], errors[2], vy, yaw_rate, errors[4], errors[5]].into()
    }

    fn steady_errors(&self, vx: f64, curvature: f64) -> ArticulatedState {
        let SteadyTurn { vy, articulation, .. } = self.steady_turn(vx, curvature);
        [0.0, 0.0, -(vy / vx).atan(), 0.0, articulation, 0.0].into()
    }

    fn steady_state(
        &self,
        vx: f64,
        curvature: f64,
        errors: &ArticulatedState,
    ) -> (ArticulatedPathState, f64) {
        let (yaw_error, articulation) = (errors[2], errors[4]);
        let (vy, yaw_rate) = (-vx * yaw_error.tan(), curvature * vx / yaw_error.cos());
        let state = [0.0, 0.0, yaw_error, vy, yaw_rate, articulation, 0.0].into();
        (state, self.steady_turn(vx, curvature).steer)
    }

    fn steadier(
        errors: &ArticulatedState,
        state: &ArticulatedPathState,
        step: &PathStep<ARTICULATED_PATH_STATES>,
    ) -> Option<ArticulatedState> {
        let (by, gap) = newton::<ARTICULATED_PATH_STATES, { ARTICULATED_PATH_STATES - 1 }>(state, step);
        let change = by.lu().solve(&gap)?;
        let mut errors = *errors;
        errors[2] -= change[0];
        errors[4] -= change[3];
        Some(errors)
    }
}

impl ArticulatedSingleTrack {
    fn slope(
        &self,
        road: &impl Fn(f64) -> Curvature,
        at: &SensedSlope,
        vx: HeldSpeed,
        steer: f64,
    ) -> SensedSlope {
        let x = &at.value;
        let curvature = road(x[0]);
        let on_path = motion(x, vx.path, curvature);
        let body = self.rates([x[3], x[4], x[5], x[6]], vx.body, steer);
        let [station_rate, lateral_rate, yaw_rate] = on_path.rates(x[4], curvature);
        let [vy, r, articulation] = body.value;
        let value = [station_rate, lateral_rate, yaw_rate, vy, r, x[6], articulation];
        let mut by = SMatrix::<f64, 7, 8>::zeros();
        for column in 0..8 {
            let d = at.by.column(column).into_owned();
            for (row, change) in on_path.changes(&d, curvature).into_iter().enumerate() {
                by[(row, column)] = change;
            }
            // Where the vehicle is on the path does not move its body: three columns stay zero.
            if column >= 3 {
                let steered = if column == 7 { 1.0 } else { 0.0 };
                for (row, jacobian) in [3, 4, 6].into_iter().zip(&body.jacobian) {
                    by[(row, column)] = jacobian[0] * d[3]
                        + jacobian[1] * d[4]
                        + jacobian[2] * d[5]
                        + jacobian[3] * d[6]
                        + jacobian[4] * steered;
                }
                by[(5, column)] = d[6];
            }
        }
        Sensed { value: value.into(), by }
    }
}
