//! The observer: where the vehicle is, seen through noise, and what the prediction misses on average (offset-free MPC).
//!
//! ```text
//! x^-_k = prediction of x_k with d_{k-1} and the command that was issued,     innovation i_k = x_k - x^-_k
//! x^_k  = x^-_k + K_k i_k           K: Kalman gain, from the noise of sensors and of prediction
//! d_k   = d_{k-1} + L i_k
//! ```
//!
//! The horizon starts at `x^_k` and is predicted with `d_k` held. A steady gap (bank, wind, a steering offset, a wrong
//! stiffness in a long bend) is then no steady error any more. On a vehicle with an uncorrected actuator delay a fast
//! observer feeds the delay's error back and destabilises the loop: choose a small `L`, or add a learned residual
//! first. The same holds of the filter: it trusts a prediction, which has to deserve it.
//!
//! Source: Maeder, Borrelli and Morari, Linear offset-free model predictive control, Automatica 2009; Kalman 1960.

use super::variant::Expected;
use crate::nominal::ErrorState;
use crate::parameters;
use nalgebra::{Matrix4, Vector4};
use serde::{Deserialize, Serialize};

parameters! {
    /// The observer.
    pub struct ObserverParameters {
        gain: f64 = 0.0, ONE in 0.0, 1.0; "observer.gain", "Gain L of the disturbance observer for one step; 0 switches it off"
        prediction_noise: f64 = 0.0, METRE_PER_SECOND in 0.0, 10.0; "observer.prediction_noise", "What the prediction of one step misses in the rate of the lateral error (standard deviation); 0: measured states are taken as they are"
        noise_e1: f64 = 0.005, METRE in 1e-9, 10.0; "observer.noise_e1", "Noise of the measured lateral error (standard deviation)"
        noise_e1_rate: f64 = 0.015, METRE_PER_SECOND in 1e-9, 10.0; "observer.noise_e1_rate", "Noise of the measured rate of the lateral error (standard deviation)"
        noise_e2: f64 = 0.0015, RADIAN in 1e-9, 1.0; "observer.noise_e2", "Noise of the measured yaw error (standard deviation)"
        noise_e2_rate: f64 = 0.004, RADIAN_PER_SECOND in 1e-9, 10.0; "observer.noise_e2_rate", "Noise of the measured rate of the yaw error (standard deviation)"
    }
}

/// The observer's state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Observer {
    disturbance: ErrorState,
    expected: Option<Expected>,
    /// Covariance of the estimate.
    covariance: Matrix4<f64>,
}

/// Largest disturbance for one step that is believed: [m, m/s, rad, rad/s]. More is a jump in a measurement, not a gap.
const LARGEST: [f64; 4] = [0.05, 0.2, 0.02, 0.1];
/// What a prediction misses in the yaw rate for each m/s that it misses in the lateral velocity, rad/m: both come from
/// the axles' forces.
const YAW_SHARE: f64 = 0.5;

impl Default for Observer {
    fn default() -> Self {
        Self { disturbance: ErrorState::zeros(), expected: None, covariance: Matrix4::zeros() }
    }
}

impl Observer {
    /// Takes a measured state; gives the estimated one.
    pub fn observe(&mut self, measured: &ErrorState, p: &ObserverParameters, sample_time: f64) -> ErrorState {
        let noise = Vector4::new(p.noise_e1, p.noise_e1_rate, p.noise_e2, p.noise_e2_rate);
        let noise = Matrix4::from_diagonal(&noise.component_mul(&noise));
        let Some(Expected { state, transition }) = self.expected.take() else {
            self.covariance = noise;
            return *measured;
        };
        let innovation = measured - state;
        self.disturbance += innovation * p.gain;
        for (value, largest) in self.disturbance.iter_mut().zip(LARGEST) {
            *value = value.clamp(-largest, largest);
        }
        if p.prediction_noise == 0.0 {
            return *measured;
        }
        let missed = p.prediction_noise
            * Vector4::new(0.5 * sample_time, 1.0, 0.5 * sample_time * YAW_SHARE, YAW_SHARE);
        let predicted = transition * self.covariance * transition.transpose()
            + Matrix4::from_diagonal(&missed.component_mul(&missed));
        let Some(inverse) = (predicted + noise).try_inverse() else { return *measured };
        let gain = predicted * inverse;
        let covariance = predicted - gain * predicted;
        self.covariance = 0.5 * (covariance + covariance.transpose());
        state + gain * innovation
    }

    /// Keeps what is expected of the next state, with the disturbance in it.
    pub fn expect(&mut self, expected: Expected) {
        self.expected = Some(expected);
    }

    /// Forgets everything: the vehicle was moved, or is where the model says nothing.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// Disturbance of a step.
    #[must_use]
    pub fn disturbance(&self) -> &ErrorState {
        &self.disturbance
    }
}

impl ObserverParameters {
    /// Whether the observer changes anything.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.gain > 0.0 || self.prediction_noise > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::Random;

    fn drift() -> Matrix4<f64> {
        // Constant velocities, 0.02 s.
        Matrix4::new(1.0, 0.02, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.02, 0.0, 0.0, 0.0, 1.0)
    }

    #[test]
    fn it_finds_a_steady_gap() {
        let mut observer = Observer::default();
        let parameters = ObserverParameters { gain: 0.05, ..Default::default() };
        let gap = ErrorState::new(0.0, 0.01, 0.0, -0.002);
        for _ in 0..400 {
            observer.observe(&gap, &parameters, 0.02);
            observer.expect(Expected { state: *observer.disturbance(), transition: Matrix4::zeros() });
        }
        assert!((observer.disturbance() - gap).norm() < 1e-8);
    }

    #[test]
    fn it_sees_through_noise() {
        let parameters = ObserverParameters { prediction_noise: 1e-3, ..Default::default() };
        let mut observer = Observer::default();
        let mut random = Random::new(3);
        let mut draw = |deviation: f64| deviation * 12.0_f64.sqrt() * (random.uniform() - 0.5);
        let mut truth = ErrorState::new(0.1, 0.05, 0.0, 0.0);
        let (mut raw, mut filtered) = (0.0, 0.0);
        for k in 0..2000 {
            let noise = ErrorState::new(draw(0.005), draw(0.015), draw(0.0015), draw(0.004));
            let measured = truth + noise;
            let estimate = observer.observe(&measured, &parameters, 0.02);
            if k > 100 {
                raw += (measured - truth)[0].powi(2);
                filtered += (estimate - truth)[0].powi(2);
            }
            observer.expect(Expected { state: drift() * estimate, transition: drift() });
            truth = drift() * truth;
        }
        assert!(filtered < 0.1 * raw, "{filtered} {raw}");
    }
}
