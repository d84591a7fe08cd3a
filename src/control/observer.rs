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
use super::vehicle::FurtherState;
use crate::nominal::ERRORS;
use crate::parameters;
use nalgebra::{SMatrix, SVector};
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
pub struct Observer<const S: usize = ERRORS> {
    disturbance: SVector<f64, S>,
    expected: Option<Expected<S>>,
    /// Covariance of the estimate.
    covariance: SMatrix<f64, S, S>,
}

/// Largest disturbance for one step that is believed: [m, m/s, rad, rad/s]. More is a jump in a measurement, not a gap.
const LARGEST: [f64; ERRORS] = [0.05, 0.2, 0.02, 0.1];
/// What a prediction misses in the yaw rate for each m/s that it misses in the lateral velocity, rad/m: both come from
/// the axles' forces.
const YAW_SHARE: f64 = 0.5;

impl<const S: usize> Default for Observer<S> {
    fn default() -> Self {
        Self { disturbance: SVector::zeros(), expected: None, covariance: SMatrix::zeros() }
    }
}

/// What is noise to the observer, state by state.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise<const S: usize = ERRORS> {
    /// Of the measurement (standard deviation).
    measured: SVector<f64, S>,
    /// What a prediction misses in a step for each m/s that it misses of the lateral velocity.
    missed: SVector<f64, S>,
    /// Largest disturbance for one step that is believed.
    largest: SVector<f64, S>,
}

impl<const S: usize> Noise<S> {
    /// The noise of the errors to the path by the parameters, and that of the states behind them.
    #[must_use]
    pub fn new(p: &ObserverParameters, further: &[FurtherState], sample_time: f64) -> Self {
        let errors = [p.noise_e1, p.noise_e1_rate, p.noise_e2, p.noise_e2_rate];
        let missed = [0.5 * sample_time, 1.0, 0.5 * sample_time * YAW_SHARE, YAW_SHARE];
        let of = |errors: [f64; ERRORS], further: Vec<f64>| {
            let mut all = errors.into_iter().chain(further);
            SVector::from_fn(|_, _| all.next().unwrap_or(0.0))
        };
        Self {
            measured: of(errors, further.iter().map(|state| state.noise).collect()),
            missed: of(missed, further.iter().map(|state| state.missed).collect()),
            largest: of(LARGEST, further.iter().map(|state| state.largest_disturbance).collect()),
        }
    }
}

impl<const S: usize> Observer<S> {
    /// Takes a measured state; gives the estimated one.
    pub fn observe(
        &mut self,
        measured: &SVector<f64, S>,
        p: &ObserverParameters,
        noise: &Noise<S>,
    ) -> SVector<f64, S> {
        let Noise { measured: deviation, missed, largest } = noise;
        let noise = SMatrix::from_diagonal(&deviation.component_mul(deviation));
        let Some(Expected { state, transition }) = self.expected.take() else {
            self.covariance = noise;
            return *measured;
        };
        let innovation = measured - state;
        self.disturbance += innovation * p.gain;
        for (value, largest) in self.disturbance.iter_mut().zip(largest) {
            *value = value.clamp(-largest, *largest);
        }
        if p.prediction_noise == 0.0 {
            return *measured;
        }
        let missed = missed * p.prediction_noise;
        let predicted = transition * self.covariance * transition.transpose()
            + SMatrix::from_diagonal(&missed.component_mul(&missed));
        let Some(inverse) = (predicted + noise).try_inverse() else { return *measured };
        let gain = predicted * inverse;
        let covariance = predicted - gain * predicted;
        self.covariance = (covariance + covariance.transpose()) * 0.5;
        state + gain * innovation
    }

    /// Keeps what is expected of the next state, with the disturbance in it.
    pub fn expect(&mut self, expected: Expected<S>) {
        self.expected = Some(expected);
    }

    /// Forgets everything: the vehicle was moved, or is where the model says nothing.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// Disturbance of a step.
    #[must_use]
    pub fn disturbance(&self) -> &SVector<f64, S> {
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
    use crate::nominal::ErrorState;
    use crate::residual::Random;
    use nalgebra::Matrix4;

    fn drift() -> Matrix4<f64> {
        // Constant velocities, 0.02 s.
        Matrix4::new(1.0, 0.02, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.02, 0.0, 0.0, 0.0, 1.0)
    }

    #[test]
    fn it_finds_a_steady_gap() {
        let mut observer = Observer::default();
        let parameters = ObserverParameters { gain: 0.05, ..Default::default() };
        let noise = Noise::new(&parameters, &[], 0.02);
        let gap = ErrorState::new(0.0, 0.01, 0.0, -0.002);
        for _ in 0..400 {
            observer.observe(&gap, &parameters, &noise);
            observer.expect(Expected { state: *observer.disturbance(), transition: Matrix4::zeros() });
        }
        assert!((observer.disturbance() - gap).norm() < 1e-8);
    }

    #[test]
    fn it_sees_through_noise() {
        let parameters = ObserverParameters { prediction_noise: 1e-3, ..Default::default() };
        let model = Noise::new(&parameters, &[], 0.02);
        let mut observer = Observer::default();
        let mut random = Random::new(3);
        let mut draw = |deviation: f64| deviation * 12.0_f64.sqrt() * (random.uniform() - 0.5);
        let mut truth = ErrorState::new(0.1, 0.05, 0.0, 0.0);
        let (mut raw, mut filtered) = (0.0, 0.0);
        for k in 0..2000 {
            let noise = ErrorState::new(draw(0.005), draw(0.015), draw(0.0015), draw(0.004));
            let measured = truth + noise;
            let estimate = observer.observe(&measured, &parameters, &model);
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
