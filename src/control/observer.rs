//! The observer: state of the vehicle behind the noise, and mean error of the prediction (offset-free MPC).
//!
//! A Kalman filter of the state and of disturbing accelerations `d` (lateral, yaw) that wander:
//!
//! ```text
//! x_{k+1} = prediction of x_k with the command that was issued + G d_k + w_x,     d_{k+1} = d_k + w_d
//! measured = x + v,      cov(v) from the sensors: e1' is seen through position, velocity and, v sin e2, yaw
//! ```
//!
//! The horizon starts at the estimate of `x` and is predicted with `d` held. A steady gap (bank, wind, a steering offset,
//! a wrong stiffness in a long bend) then leaves no steady error. On a vehicle with an uncorrected actuator delay a
//! fast observer feeds the delay's error back and destabilises the loop. Let `d` wander slowly there, or add a learned
//! residual first. The filter, too, needs a good prediction.
//!
//! Source: Maeder, Borrelli and Morari, Linear offset-free model predictive control, Automatica 2009; Kalman 1960.

use super::variant::ExpectedState;
use super::vehicle::FurtherState;
use crate::nominal::ERRORS;
use crate::parameters;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

parameters! {
    /// The observer.
    pub struct ObserverParameters {
        disturbance_noise: f64 = 0.025, METRE_PER_SECOND2 in 0.0, 100.0; "observer.disturbance_noise", "How far the disturbing lateral acceleration wanders in one step (standard deviation); 0 switches the observer off"
        prediction_noise: f64 = 0.03, METRE_PER_SECOND in 0.0, 10.0; "observer.prediction_noise", "What else the prediction of one step misses in the rate of the lateral error (standard deviation)"
        noise_position: f64 = 0.005, METRE in 1e-9, 10.0; "observer.noise_position", "Noise of the measured position (standard deviation)"
        noise_velocity: f64 = 0.01, METRE_PER_SECOND in 1e-9, 10.0; "observer.noise_velocity", "Noise of the measured velocity (standard deviation)"
        noise_yaw: f64 = 0.0015, RADIAN in 1e-9, 1.0; "observer.noise_yaw", "Noise of the measured yaw angle (standard deviation)"
        noise_yaw_rate: f64 = 0.004, RADIAN_PER_SECOND in 1e-9, 10.0; "observer.noise_yaw_rate", "Noise of the measured yaw rate (standard deviation)"
        yaw_offset: f64 = 0.02, RADIAN in 0.0, 0.1; "observer.yaw_offset", "Ordinary offset of a yaw angle from the way that the vehicle moves, with that of vy (standard deviation): it is learned against the place while driving, with the place's lateness; 0 takes the angle as it is"
        yaw_rate_bias: f64 = 0.01, RADIAN_PER_SECOND in 0.0, 0.1; "observer.yaw_rate_bias", "Ordinary bias of a yaw-rate sensor (standard deviation): it is learned against the yaw angle while driving, with scale and lateness; 0 takes the rate as it is"
    }
}

/// The observer's state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Observer<const S: usize = ERRORS> {
    /// Disturbing accelerations, at the places of the rates that they change.
    disturbance: SVector<f64, S>,
    expected: Option<ExpectedState<S>>,
    /// Covariance of the estimated state.
    of_state: SMatrix<f64, S, S>,
    /// Covariance of the disturbance.
    of_disturbance: SMatrix<f64, S, S>,
    /// Covariance of the two.
    of_both: SMatrix<f64, S, S>,
}

/// Largest plausible disturbing accelerations, lateral m/s2 and yaw rad/s2. More is a jump in a measurement, not a gap.
const LARGEST: [f64; ERRORS] = [0.0, 5.0, 0.0, 3.0];
/// Unmodelled yaw rate for each m/s of unmodelled lateral velocity, rad/m: both come from the axles' forces.
const YAW_SHARE: f64 = 0.5;

impl<const S: usize> Default for Observer<S> {
    fn default() -> Self {
        Self {
            disturbance: SVector::zeros(),
            expected: None,
            of_state: SMatrix::zeros(),
            of_disturbance: SMatrix::zeros(),
            of_both: SMatrix::zeros(),
        }
    }
}

/// Noise of each state, as the observer assumes it.
#[derive(Debug, Clone, PartialEq)]
pub struct ObserverNoise<const S: usize = ERRORS> {
    parameters: ObserverParameters,
    /// Of the measured states behind the errors to the path (standard deviation); zero for the errors.
    further: SVector<f64, S>,
    /// Effect on the state of accelerations held over a step.
    effect: SMatrix<f64, S, S>,
    /// Covariance of the prediction error of a step.
    missed: SMatrix<f64, S, S>,
    /// Covariance of the disturbance's change in a step.
    wandered: SMatrix<f64, S, S>,
    /// Largest disturbance that is believed.
    largest: SVector<f64, S>,
}

impl<const S: usize> ObserverNoise<S> {
    /// Noise of the errors to the path, by the parameters, and of the states behind them. Each is a value and then its
    /// rate, as the errors.
    #[must_use]
    pub fn new(p: &ObserverParameters, further: &[FurtherState], sample_time: f64) -> Self {
        let of = |errors: [f64; ERRORS], of_further: fn(&FurtherState) -> f64| {
            let mut all = errors.into_iter().chain(further.iter().map(of_further));
            SVector::from_fn(|_, _| all.next().unwrap_or(0.0))
        };
        let mut effect = SMatrix::zeros();
        for rate in (1..S).step_by(2) {
            effect[(rate - 1, rate)] = 0.5 * sample_time * sample_time;
            effect[(rate, rate)] = sample_time;
        }
        // What a prediction misses of each rate, for each m/s that it misses of the lateral velocity.
        let shares = of([0.0, 1.0, 0.0, YAW_SHARE], |state| state.process_noise_gain);
        let missed = effect * shares * (p.prediction_noise / sample_time);
        let wandered = shares * p.disturbance_noise;
        Self {
            parameters: *p,
            further: of([0.0; ERRORS], |state| state.noise),
            effect,
            missed: SMatrix::from_diagonal(&missed.component_mul(&missed)),
            wandered: SMatrix::from_diagonal(&wandered.component_mul(&wandered)),
            largest: of(LARGEST, |state| state.largest_disturbance),
        }
    }

    /// Effect on the state of accelerations held over a step.
    pub(super) fn effect(&self) -> &SMatrix<f64, S, S> {
        &self.effect
    }

    /// Variance of each measured state at a speed, m/s.
    #[must_use]
    pub fn variance(&self, speed: f64) -> SVector<f64, S> {
        self.measured(speed).diagonal()
    }

    /// Covariance of a measured state at a speed, m/s: noise of the yaw angle turns the velocity too.
    fn measured(&self, speed: f64) -> SMatrix<f64, S, S> {
        let p = &self.parameters;
        let square = |deviation: f64| deviation * deviation;
        let yaw = square(p.noise_yaw);
        let mut noise = SMatrix::from_diagonal(&self.further.component_mul(&self.further));
        noise[(0, 0)] = square(p.noise_position);
        noise[(1, 1)] = square(p.noise_velocity) + square(speed) * yaw;
        noise[(2, 2)] = yaw;
        noise[(3, 3)] = square(p.noise_yaw_rate);
        noise[(1, 2)] = speed * yaw;
        noise[(2, 1)] = speed * yaw;
        noise
    }
}

impl<const S: usize> Observer<S> {
    /// Takes a state measured at a speed, m/s; gives the estimated one.
    pub fn observe(
        &mut self,
        measured: &SVector<f64, S>,
        speed: f64,
        noise: &ObserverNoise<S>,
    ) -> SVector<f64, S> {
        let of_measured = noise.measured(speed);
        let Some(ExpectedState { state, transition: a }) = self.expected.take() else {
            self.of_state = of_measured;
            return *measured;
        };
        let innovation = measured - state;
        let g = &noise.effect;
        let across = a * self.of_both * g.transpose();
        let of_state = a * self.of_state * a.transpose()
            + across
            + across.transpose()
            + g * self.of_disturbance * g.transpose()
            + noise.missed;
        let of_both = a * self.of_both + g * self.of_disturbance;
        let of_disturbance = self.of_disturbance + noise.wandered;
        let Some(inverse) = (of_state + of_measured).try_inverse() else { return *measured };
        let (gain, gain_of_disturbance) = (of_state * inverse, of_both.transpose() * inverse);
        self.disturbance += gain_of_disturbance * innovation;
        for (value, largest) in self.disturbance.iter_mut().zip(&noise.largest) {
            *value = value.clamp(-largest, *largest);
        }
        let updated = of_state - gain * of_state;
        self.of_state = (updated + updated.transpose()) * 0.5;
        let updated = of_disturbance - gain_of_disturbance * of_both;
        self.of_disturbance = (updated + updated.transpose()) * 0.5;
        self.of_both = of_both - gain * of_both;
        state + gain * innovation
    }

    /// Keeps the expected next state, with the disturbance in it.
    pub fn expect(&mut self, expected: ExpectedState<S>) {
        self.expected = Some(expected);
    }

    /// Forgets everything: the vehicle was moved, or is out of the model's range.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// The disturbing accelerations.
    pub(super) fn accelerations(&self) -> SVector<f64, S> {
        self.disturbance
    }

    /// Effect of the disturbance on the state in a step.
    #[must_use]
    pub fn disturbance(&self, noise: &ObserverNoise<S>) -> SVector<f64, S> {
        noise.effect * self.disturbance
    }
}

impl ObserverParameters {
    /// True if the observer changes anything.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.disturbance_noise > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal::ErrorState;
    use crate::numerics::Random;
    use nalgebra::Matrix4;

    fn drift() -> Matrix4<f64> {
        // Constant velocities, 0.02 s.
        Matrix4::new(1.0, 0.02, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.02, 0.0, 0.0, 0.0, 1.0)
    }

    #[test]
    fn it_finds_a_steady_gap() {
        let mut observer = Observer::default();
        let parameters = ObserverParameters { disturbance_noise: 0.1, ..Default::default() };
        let noise = ObserverNoise::new(&parameters, &[], 0.02);
        let gap = ErrorState::new(0.0, 0.5, 0.0, -0.1);
        let mut truth = ErrorState::zeros();
        let mut estimate = truth;
        for _ in 0..400 {
            estimate = observer.observe(&truth, 10.0, &noise);
            let state = drift() * estimate + observer.disturbance(&noise);
            observer.expect(ExpectedState { state, transition: drift() });
            truth = drift() * truth + noise.effect * gap;
        }
        assert!((observer.disturbance - gap).norm() < 1e-6, "{}", observer.disturbance);
        assert!((estimate[1] / truth[1] - 1.0).abs() < 0.01);
    }

    #[test]
    fn it_sees_through_noise() {
        let parameters =
            ObserverParameters { prediction_noise: 1e-3, disturbance_noise: 1e-6, ..Default::default() };
        let of = ObserverNoise::new(&parameters, &[], 0.02);
        let mut observer = Observer::default();
        let mut random = Random::new(3);
        let mut draw = |deviation: f64| deviation * 12.0_f64.sqrt() * (random.uniform() - 0.5);
        let mut truth = ErrorState::new(0.1, 0.05, 0.0, 0.0);
        let (mut raw, mut filtered) = (0.0, 0.0);
        for k in 0..2000 {
            let yaw = draw(0.0015);
            let noise = ErrorState::new(draw(0.005), draw(0.01) + 10.0 * yaw, yaw, draw(0.004));
            let measured = truth + noise;
            let estimate = observer.observe(&measured, 10.0, &of);
            if k > 100 {
                raw += (measured - truth)[0].powi(2);
                filtered += (estimate - truth)[0].powi(2);
            }
            observer.expect(ExpectedState { state: drift() * estimate, transition: drift() });
            truth = drift() * truth;
        }
        assert!(filtered < 0.1 * raw, "{filtered} {raw}");
    }
}
