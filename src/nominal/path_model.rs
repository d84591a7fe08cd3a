//! A nonlinear vehicle along a path, whatever the vehicle: what nonlinear MPC predicts with.
//!
//! ```text
//! s'  = (vx cos e2 - vy sin e2) / (1 - kappa(s) e1)        state [s, e1, e2, vy, r, ..], input steer
//! e1' =  vx sin e2 + vy cos e2                              vx held within a step
//! e2' =  r - kappa(s) s'                                    what follows is the body's own
//! ```
//!
//! The curvature is that at the predicted station, so a vehicle that cuts a bend meets the next one earlier. A model has
//! `N` states, and its errors to the path are the `S` states of the linear model of the same vehicle.

use nalgebra::{SMatrix, SVector};

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
pub struct PathStep<const N: usize> {
    pub state: SVector<f64, N>,
    pub by_state: SMatrix<f64, N, N>,
    pub by_steer: SVector<f64, N>,
}

/// Errors to the path with their derivatives by the state.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct PathErrors<const S: usize, const N: usize> {
    pub errors: SVector<f64, S>,
    pub by_state: SMatrix<f64, S, N>,
}

/// A nonlinear model with `N` states `[station m, e1 m, e2 rad, vy m/s, yaw_rate rad/s, ..]` whose errors to the path are `S`.
pub trait PathModel<const S: usize, const N: usize>: std::fmt::Debug + Clone + Send + Sync + 'static {
    /// One control step along a path with speed and steering held, in s. `road` gives the curvature at a station.
    fn step_along(
        &self,
        road: impl Fn(f64) -> Curvature,
        state: &SVector<f64, N>,
        vx: HeldSpeed,
        steer: f64,
        sample_time: f64,
    ) -> PathStep<N>;

    /// Errors to the path of a state, where the path has this curvature.
    fn errors_of(state: &SVector<f64, N>, vx: f64, curvature: Curvature) -> PathErrors<S, N>;

    /// The state at a station with these errors, lateral velocity and yaw rate.
    fn state_of(station: f64, errors: &SVector<f64, S>, vy: f64, yaw_rate: f64) -> SVector<f64, N>;

    /// Change of the state that belongs to a small change of the errors, at a small yaw error.
    fn change_of(errors: &SVector<f64, S>, vx: f64) -> SVector<f64, N>;

    /// The errors of steady cornering with no lateral error.
    fn steady_errors(&self, vx: f64, curvature: f64) -> SVector<f64, S>;

    /// The state of steady cornering with these errors, at station 0, and a good first guess of its steering angle.
    fn steady_state(&self, vx: f64, curvature: f64, errors: &SVector<f64, S>) -> (SVector<f64, N>, f64);

    /// Errors nearer to the steady state with the inputs of this step, from `state`. One step of Newton on
    /// `step(x) = x` for all states but the station and `e1 = 0`, and for the steering.
    fn steadier(
        errors: &SVector<f64, S>,
        state: &SVector<f64, N>,
        step: &PathStep<N>,
    ) -> Option<SVector<f64, S>>;
}

/// Values with derivatives by the `N` states and the steering at the step's beginning: `M` is `N + 1`.
#[derive(Clone, Copy)]
pub(super) struct Sensed<const N: usize, const M: usize> {
    pub value: SVector<f64, N>,
    pub by: SMatrix<f64, N, M>,
}

impl<const N: usize, const M: usize> Sensed<N, M> {
    fn plus(&self, factor: f64, slope: &Self) -> Self {
        Self { value: self.value + slope.value * factor, by: self.by + slope.by * factor }
    }
}

/// Runge-Kutta of 4th order on the state and on its derivatives, in `count` parts of a step.
pub(super) fn integrate<const N: usize, const M: usize>(
    slope: impl Fn(&Sensed<N, M>) -> Sensed<N, M>,
    state: &SVector<f64, N>,
    count: usize,
    sample_time: f64,
) -> PathStep<N> {
    const { assert!(M == N + 1, "derivatives by the states and the steering") };
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
    PathStep {
        state: at.value,
        by_state: at.by.fixed_columns::<N>(0).into_owned(),
        by_steer: at.by.column(N).into_owned(),
    }
}

/// A point beyond the centre of curvature has no foot on the path: `1 - kappa e1` is bounded, not inverted.
const LEAST_STRETCH: f64 = 0.1;

/// Motion of the vehicle along and across the path: `s'` with derivatives by s, e1, e2, vy; `e1'` by e2, vy.
pub(super) struct PathMotion {
    pub station_rate: f64,
    pub station_by: [f64; 4],
    pub lateral_rate: f64,
    pub lateral_by: [f64; 2],
}

pub(super) fn motion<const N: usize>(
    state: &SVector<f64, N>,
    vx: f64,
    [curvature, curvature_rate]: Curvature,
) -> PathMotion {
    let (e1, e2, vy) = (state[1], state[2], state[3]);
    let (sin, cos) = e2.sin_cos();
    let (along, across) = (vx * cos - vy * sin, vx * sin + vy * cos);
    let stretch = 1.0 - curvature * e1;
    let bounded = stretch < LEAST_STRETCH;
    let stretch = stretch.max(LEAST_STRETCH);
    let by_stretch = if bounded { 0.0 } else { along / (stretch * stretch) };
    PathMotion {
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

impl PathMotion {
    /// Rates of station, `e1` and `e2` at a yaw rate.
    pub fn rates(&self, yaw_rate: f64, curvature: Curvature) -> [f64; 3] {
        [self.station_rate, self.lateral_rate, yaw_rate - curvature[0] * self.station_rate]
    }

    /// Their changes with a change `d` of the state.
    pub fn changes<const N: usize>(&self, d: &SVector<f64, N>, curvature: Curvature) -> [f64; 3] {
        let station: f64 = self.station_by.iter().zip(d.iter()).map(|(by, d)| by * d).sum();
        [
            station,
            self.lateral_by[0] * d[2] + self.lateral_by[1] * d[3],
            d[4] - curvature[0] * station - curvature[1] * self.station_rate * d[0],
        ]
    }

    /// The errors `[e1, e1', e2, e2']` of a state with their derivatives.
    pub fn errors<const N: usize>(
        &self,
        state: &SVector<f64, N>,
        curvature: Curvature,
    ) -> ([f64; 4], SMatrix<f64, 4, N>) {
        let mut by_state = SMatrix::zeros();
        by_state[(0, 1)] = 1.0;
        by_state[(1, 2)] = self.lateral_by[0];
        by_state[(1, 3)] = self.lateral_by[1];
        by_state[(2, 2)] = 1.0;
        for (i, by) in self.station_by.iter().enumerate() {
            by_state[(3, i)] = -curvature[0] * by;
        }
        by_state[(3, 0)] -= curvature[1] * self.station_rate;
        by_state[(3, 4)] = 1.0;
        let errors = [state[1], self.lateral_rate, state[2], state[4] - curvature[0] * self.station_rate];
        (errors, by_state)
    }
}

/// The linear system of [`PathModel::steadier`], matrix and right side: its solution is to be taken from the states behind
/// `e1`, and last from the steering. `K` is `N - 1`.
pub(super) fn newton<const N: usize, const K: usize>(
    state: &SVector<f64, N>,
    step: &PathStep<N>,
) -> (SMatrix<f64, K, K>, SVector<f64, K>) {
    const { assert!(N == K + 1, "all states but the station") };
    let gap = (step.state - state).fixed_rows::<K>(1).into_owned();
    let mut by = SMatrix::<f64, K, K>::zeros();
    for row in 0..K {
        for column in 0..K - 1 {
            by[(row, column)] = step.by_state[(row + 1, column + 2)];
        }
        by[(row, K - 1)] = step.by_steer[row + 1];
    }
    for i in 0..K - 1 {
        by[(i + 1, i)] -= 1.0;
    }
    (by, gap)
}
