//! The nonlinear bicycle along a path, with derivatives.
//!
//! ```text
//! s'  = (vx cos e2 - vy sin e2) / (1 - kappa(s) e1)        state [s, e1, e2, vy, r], input steer
//! e1' =  vx sin e2 + vy cos e2                              vx held within a step
//! e2' =  r - kappa(s) s'                                    vy', r' of `bicycle.rs`
//! ```
//!
//! The curvature is that at the predicted station, so a vehicle that cuts a bend meets the next one earlier.

use super::{Bicycle, ErrorState};
use nalgebra::{SMatrix, SVector};

/// `[station m, e1 m, e2 rad, vy m/s, yaw_rate rad/s]`.
pub type BicycleState = SVector<f64, 5>;

/// Curvature, 1/m, and its rate along the path, 1/m2.
pub type Curvature = [f64; 2];

/// Speed held within a step, m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldSpeed {
    /// For the motion along and across the path: the mean is best.
    pub path: f64,
    /// For the tyres and the turning body; positive.
    pub body: f64,
}

/// A state after a step, with its derivatives by the state and the steering before it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct BicycleStep {
    pub state: BicycleState,
    pub by_state: SMatrix<f64, 5, 5>,
    pub by_steer: BicycleState,
}

/// Errors to the path with their derivatives by the state.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct BicycleErrors {
    pub errors: ErrorState,
    pub by_state: SMatrix<f64, 4, 5>,
}

/// Values with derivatives by the five states and the steering at the step's beginning.
#[derive(Clone, Copy)]
struct Sensed {
    value: BicycleState,
    by: SMatrix<f64, 5, 6>,
}

/// A point beyond the centre of curvature has no foot on the path: `1 - kappa e1` is bounded, not inverted.
const LEAST_STRETCH: f64 = 0.1;

/// How the vehicle moves along and across the path: `s'` with derivatives by s, e1, e2, vy; `e1'` by e2, vy.
struct Motion {
    station_rate: f64,
    station_by: [f64; 4],
    lateral_rate: f64,
    lateral_by: [f64; 2],
}

fn motion(state: &BicycleState, vx: f64, [curvature, curvature_rate]: Curvature) -> Motion {
    let (e1, e2, vy) = (state[1], state[2], state[3]);
    let (sin, cos) = e2.sin_cos();
    let (along, across) = (vx * cos - vy * sin, vx * sin + vy * cos);
    let stretch = 1.0 - curvature * e1;
    let bounded = stretch < LEAST_STRETCH;
    let stretch = stretch.max(LEAST_STRETCH);
    let by_stretch = if bounded { 0.0 } else { along / (stretch * stretch) };
    Motion {
        station_rate: along / stretch,
        station_by: [
            by_stretch * curvature_rate * e1,
            by_stretch * curvature,
            -across / stretch,
            -sin / stretch,
        ],
        lateral_rate: across,
        lateral_by: [along, cos],
    }
}

/// Errors to the path of a state, where the path has this curvature.
#[must_use]
pub fn errors_of(state: &BicycleState, vx: f64, curvature: Curvature) -> BicycleErrors {
    let Motion { station_rate, station_by, lateral_rate, lateral_by } = motion(state, vx, curvature);
    let mut by_state = SMatrix::zeros();
    by_state[(0, 1)] = 1.0;
    by_state[(1, 2)] = lateral_by[0];
    by_state[(1, 3)] = lateral_by[1];
    by_state[(2, 2)] = 1.0;
    for (i, by) in station_by.iter().enumerate() {
        by_state[(3, i)] = -curvature[0] * by;
    }
    by_state[(3, 0)] -= curvature[1] * station_rate;
    by_state[(3, 4)] = 1.0;
    let errors = ErrorState::new(state[1], lateral_rate, state[2], state[4] - curvature[0] * station_rate);
    BicycleErrors { errors, by_state }
}

/// Change of `[vy, yaw_rate]` that belongs to a small change of the errors, at a small yaw error.
#[must_use]
pub fn body_change(errors: &ErrorState, vx: f64) -> [f64; 2] {
    [errors[1] - vx * errors[2], errors[3]]
}

impl Bicycle {
    /// One control step along a path with speed and steering held: Runge-Kutta of 4th order on the state and on its
    /// derivatives, in as many parts as the speed needs. `road` gives the curvature at a station. Of the two speeds one
    /// moves the vehicle along the path, one its body.
    pub fn step_along(
        &self,
        road: impl Fn(f64) -> Curvature,
        state: &BicycleState,
        vx: HeldSpeed,
        steer: f64,
        sample_time: f64,
    ) -> BicycleStep {
        let slope = |at: &Sensed| self.slope(&road, at, vx, steer);
        let count = self.substeps(vx.body, sample_time);
        let h = sample_time / count as f64;
        let mut at = Sensed { value: *state, by: SMatrix::identity() };
        for _ in 0..count {
            let k1 = slope(&at);
            let k2 = slope(&at.plus(0.5 * h, &k1));
            let k3 = slope(&at.plus(0.5 * h, &k2));
            let k4 = slope(&at.plus(h, &k3));
            let sum = Sensed {
                value: k1.value + 2.0 * (k2.value + k3.value) + k4.value,
                by: k1.by + 2.0 * (k2.by + k3.by) + k4.by,
            };
            at = at.plus(h / 6.0, &sum);
        }
        BicycleStep {
            state: at.value,
            by_state: at.by.fixed_columns::<5>(0).into_owned(),
            by_steer: at.by.column(5).into_owned(),
        }
    }

    fn slope(&self, road: &impl Fn(f64) -> Curvature, at: &Sensed, vx: HeldSpeed, steer: f64) -> Sensed {
        let x = &at.value;
        let curvature = road(x[0]);
        let on_path = motion(x, vx.path, curvature);
        let body = self.rates(x[3], x[4], vx.body, steer);
        let yaw_rate = x[4] - curvature[0] * on_path.station_rate;
        let value = [on_path.station_rate, on_path.lateral_rate, yaw_rate, body.value[0], body.value[1]];
        let mut by = SMatrix::<f64, 5, 6>::zeros();
        for column in 0..6 {
            let d = at.by.column(column);
            let station: f64 = on_path.station_by.iter().zip(d.iter()).map(|(by, d)| by * d).sum();
            by[(0, column)] = station;
            by[(1, column)] = on_path.lateral_by[0] * d[2] + on_path.lateral_by[1] * d[3];
            by[(2, column)] = d[4] - curvature[0] * station - curvature[1] * on_path.station_rate * d[0];
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

impl Sensed {
    fn plus(&self, factor: f64, slope: &Self) -> Self {
        Self { value: self.value + slope.value * factor, by: self.by + slope.by * factor }
    }
}
