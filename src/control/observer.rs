//! The observer: where the vehicle is, seen through noise, and what the prediction misses on average (offset-free MPC).
//!
//! A Kalman filter of the state and of disturbing accelerations `d` (lateral, yaw) that wander:
//!
//! ```text
//! x_{k+1} = prediction of x_k with the command that was issued + G d_k + w_x,     d_{k+1} = d_k + w_d
//! measured = x + v,      cov(v) from the sensors: e1' is seen through position, velocity and, v sin e2, yaw
//! ```
//!
//! The horizon starts at the estimate of `x` and is predicted with `d` held. A steady gap (bank, wind, a steering offset,
//! a wrong stiffness in a long bend) is then no steady error any more. On a vehicle with an uncorrected actuator delay a
//! fast observer feeds the delay's error back and destabilises the loop: let `d` wander slowly, or add a learned
//! residual first. The same holds of the filter: it trusts a prediction, which has to deserve it.
//!
//! Source: Maeder, Borrelli and Morari, Linear offset-free model predictive control, Automatica 2009; Kalman 1960.

use super::variant::Expected;
use crate::nominal::ErrorState;
use crate::parameters;
use nalgebra::{Matrix2, Matrix4, Matrix4x2, Vector2, Vector4};
use serde::{Deserialize, Serialize};

parameters! {
    /// The observer.
    pub struct ObserverParameters {
        disturbance_noise: f64 = 0.0, METRE_PER_SECOND2 in 0.0, 100.0; "observer.disturbance_noise", "How far the disturbing lateral acceleration wanders in one step (standard deviation); 0 switches the observer off"
        prediction_noise: f64 = 0.05, METRE_PER_SECOND in 0.0, 10.0; "observer.prediction_noise", "What else the prediction of one step misses in the rate of the lateral error (standard deviation)"
        noise_position: f64 = 0.005, METRE in 1e-9, 10.0; "observer.noise_position", "Noise of the measured position (standard deviation)"
        noise_velocity: f64 = 0.01, METRE_PER_SECOND in 1e-9, 10.0; "observer.noise_velocity", "Noise of the measured velocity (standard deviation)"
        noise_yaw: f64 = 0.0015, RADIAN in 1e-9, 1.0; "observer.noise_yaw", "Noise of the measured yaw angle (standard deviation)"
        noise_yaw_rate: f64 = 0.004, RADIAN_PER_SECOND in 1e-9, 10.0; "observer.noise_yaw_rate", "Noise of the measured yaw rate (standard deviation)"
    }
}

/// Disturbing accelerations, lateral m/s2 and yaw rad/s2.
type Disturbance = Vector2<f64>;

/// The observer's state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Observer {
    disturbance: Disturbance,
    expected: Option<Expected>,
    /// Covariance of the estimated state.
    of_state: Matrix4<f64>,
    /// Covariance of the disturbance.
    of_disturbance: Matrix2<f64>,
    /// Covariance of the two.
    of_both: Matrix4x2<f64>,
}

/// Largest disturbance that is believed, m/s2 and rad/s2. More is a jump in a measurement, not a gap.
const LARGEST: [f64; 2] = [5.0, 3.0];
/// What a prediction misses in the yaw rate for each m/s that it misses in the lateral velocity, rad/m: both come from
/// the axles' forces.
const YAW_SHARE: f64 = 0.5;

impl Default for Observer {
    fn default() -> Self {
        Self {
            disturbance: Disturbance::zeros(),
            expected: None,
            of_state: Matrix4::zeros(),
            of_disturbance: Matrix2::zeros(),
            of_both: Matrix4x2::zeros(),
        }
    }
}

impl Observer {
    /// Takes a state measured at a speed, m/s; gives the estimated one.
    pub fn observe(
        &mut self,
        measured: &ErrorState,
        speed: f64,
        p: &ObserverParameters,
        sample_time: f64,
    ) -> ErrorState {
        let noise = p.noise(speed);
        let Some(Expected { state, transition: a }) = self.expected.take() else {
            self.of_state = noise;
            return *measured;
        };
        let innovation = measured - state;
        let g = effect(sample_time);
        let shares = Vector2::new(1.0, YAW_SHARE);
        let (missed, wandered) =
            (g * shares * (p.prediction_noise / sample_time), shares * p.disturbance_noise);
        let across = a * self.of_both * g.transpose();
        let of_state = a * self.of_state * a.transpose()
            + across
            + across.transpose()
            + g * self.of_disturbance * g.transpose()
            + Matrix4::from_diagonal(&missed.component_mul(&missed));
        let of_both = a * self.of_both + g * self.of_disturbance;
        let of_disturbance = self.of_disturbance + Matrix2::from_diagonal(&wandered.component_mul(&wandered));
        let Some(inverse) = (of_state + noise).try_inverse() else { return *measured };
        let (gain, gain_of_disturbance) = (of_state * inverse, of_both.transpose() * inverse);
        self.disturbance += gain_of_disturbance * innovation;
        for (value, largest) in self.disturbance.iter_mut().zip(LARGEST) {
            *value = value.clamp(-largest, largest);
        }
        let updated = of_state - gain * of_state;
        self.of_state = 0.5 * (updated + updated.transpose());
        let updated = of_disturbance - gain_of_disturbance * of_both;
        self.of_disturbance = 0.5 * (updated + updated.transpose());
        self.of_both = of_both - gain * of_both;
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

    /// What the disturbance adds to the state in a step.
    #[must_use]
    pub fn disturbance(&self, sample_time: f64) -> ErrorState {
        effect(sample_time) * self.disturbance
    }
}

/// What accelerations, held over a step, add to the state.
fn effect(sample_time: f64) -> Matrix4x2<f64> {
    let (rate, angle) = (sample_time, 0.5 * sample_time * sample_time);
    Matrix4x2::new(angle, 0.0, rate, 0.0, 0.0, angle, 0.0, rate)
}

impl ObserverParameters {
    /// Whether the observer changes anything.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.disturbance_noise > 0.0
    }

    /// Covariance of the measured errors at a speed, m/s: noise of the yaw angle turns the velocity too.
    fn noise(&self, speed: f64) -> Matrix4<f64> {
        let square = |deviation: f64| deviation * deviation;
        let yaw = square(self.noise_yaw);
        let mut noise = Matrix4::from_diagonal(&Vector4::new(
            square(self.noise_position),
            square(self.noise_velocity) + square(speed) * yaw,
            yaw,
            square(self.noise_yaw_rate),
        ));
        noise[(1, 2)] = speed * yaw;
        noise[(2, 1)] = speed * yaw;
        noise
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
        let parameters = ObserverParameters { disturbance_noise: 0.1, ..Default::default() };
        let gap = Disturbance::new(0.5, -0.1);
        let mut truth = ErrorState::zeros();
        let mut estimate = truth;
        for _ in 0..400 {
            estimate = observer.observe(&truth, 10.0, &parameters, 0.02);
            let state = drift() * estimate + observer.disturbance(0.02);
            observer.expect(Expected { state, transition: drift() });
            truth = drift() * truth + effect(0.02) * gap;
        }
        assert!((observer.disturbance - gap).norm() < 1e-6, "{}", observer.disturbance);
        assert!((estimate[1] / truth[1] - 1.0).abs() < 0.01);
    }

    #[test]
    fn it_sees_through_noise() {
        let parameters =
            ObserverParameters { prediction_noise: 1e-3, disturbance_noise: 1e-6, ..Default::default() };
        let mut observer = Observer::default();
        let mut random = Random::new(3);
        let mut draw = |deviation: f64| deviation * 12.0_f64.sqrt() * (random.uniform() - 0.5);
        let mut truth = ErrorState::new(0.1, 0.05, 0.0, 0.0);
        let (mut raw, mut filtered) = (0.0, 0.0);
        for k in 0..2000 {
            let yaw = draw(0.0015);
            let noise = ErrorState::new(draw(0.005), draw(0.01) + 10.0 * yaw, yaw, draw(0.004));
            let measured = truth + noise;
            let estimate = observer.observe(&measured, 10.0, &parameters, 0.02);
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
