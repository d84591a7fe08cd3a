//! Errors of the yaw-rate sensor, learned while driving: bias, scale and the yaw angle's lateness.
//!
//! The path errors come of two sensors. A receiver's yaw angle tells `e2`, a gyroscope's rate its change. If the rate has a
//! bias of half a degree a second, the prediction turns off a straight road, and the loop steers against a turn that is
//! none: metres beside the road at 30 m/s, for a calm controller weighs `e1` little. The angle knows better in the long run:
//!
//! ```text
//! z = [psi, b, s, T],    psi' = (1 - s) w - b,    measured yaw = psi - T w + v
//! ```
//!
//! with the measured rate `w`. A Kalman filter takes each new yaw angle; steps without one only predict. Bias and scale
//! are told apart by straights and bends, lateness by the beginnings of bends. The controller is given `(1 - s) w - b`. A rate that
//! rests to the bit for longer than a slow sensor's sample may be dead, and teaches nothing.
//!
//! Source: the filter of attitude and gyroscope bias, Lefferts, Markley and Shuster, Journal of Guidance 1982, for one axis.

use super::observer::ObserverParameters;
use super::sensor_filter::SensorFilter;
use crate::path::wrap_angle;
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// States: angle, bias, scale, lateness.
const STATES: usize = 4;
const ANGLE: usize = 0;
/// Standard deviation of the scale, and of the angle's lateness, s, before any is seen.
const SCALE: f64 = 0.03;
const LATENESS: f64 = 0.03;
/// Wandering in a second: of the bias, rad/s (ten degrees an hour over 100 s), and of the others, which nearly rest.
const BIAS_WANDERS: f64 = 1e-5;
const REST_WANDERS: f64 = 1e-4;
/// Longest time for which a living sensor's rate rests to the bit, s.
const LONGEST_REST: f64 = 0.2;
/// Largest bias, rad/s, and scale that are believed.
pub(super) const LARGEST_BIAS: f64 = 0.1;
const LARGEST_SCALE: f64 = 0.2;

/// The yaw-rate sensor, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct RateSensor {
    filter: SensorFilter<STATES>,
    /// The rate of the step before, rad/s; none before the first step.
    before: Option<f64>,
    /// Time for which it has rested, s.
    rested: f64,
}

impl RateSensor {
    /// Nothing is known yet.
    pub fn new(parameters: &ObserverParameters) -> Self {
        let square = |deviation: f64| deviation * deviation;
        let variances = [0.0, square(parameters.yaw_rate_bias), square(SCALE), square(LATENESS)];
        Self { filter: SensorFilter::new(variances), before: None, rested: 0.0 }
    }

    /// Takes the measured yaw, rad, if it is new, and rate, rad/s, so many seconds after the last; gives the corrected rate.
    pub fn correct(&mut self, yaw: Option<f64>, rate: f64, elapsed: f64, noise: &ObserverParameters) -> f64 {
        if !rate.is_finite() {
            return rate;
        }
        let rests = self.before == Some(rate);
        let rested = if rests { self.rested + elapsed } else { std::mem::take(&mut self.rested) };
        // What a rate says at its next change is known then: a dead one never does.
        let yaw = yaw.filter(|_| !rests);
        match (self.before.replace(rate), yaw) {
            (Some(_), Some(yaw)) if rested > LONGEST_REST => self.begin(yaw, noise),
            (Some(before), _) => {
                self.predict(0.5 * (before + rate), elapsed, noise);
                if let Some(yaw) = yaw {
                    self.observe(yaw, rate, noise);
                }
            }
            (None, Some(yaw)) => self.begin(yaw, noise),
            (None, None) => self.before = None,
        }
        if rests {
            self.rested = rested;
        }
        if !self.filter.is_sound() {
            *self = Self::new(noise);
        }
        let bias = self.filter.mean[1].clamp(-LARGEST_BIAS, LARGEST_BIAS);
        let scale = self.filter.mean[2].clamp(-LARGEST_SCALE, LARGEST_SCALE);
        (1.0 - scale) * rate - bias
    }

    /// Goes on from another angle: the vehicle was moved. What is known of the sensor stays.
    pub fn move_to(&mut self, yaw: f64, noise: &ObserverParameters) {
        if self.before.is_some() {
            self.begin(yaw, noise);
        }
    }

    fn begin(&mut self, yaw: f64, noise: &ObserverParameters) {
        self.filter.begin(yaw, noise.noise_yaw * noise.noise_yaw);
    }

    fn predict(&mut self, rate: f64, elapsed: f64, noise: &ObserverParameters) {
        let mean = &self.filter.mean;
        let turned = ((1.0 - mean[2]) * rate - mean[1]) * elapsed;
        let by = SVector::<f64, STATES>::from([0.0, -elapsed, -rate * elapsed, 0.0]);
        let missed = noise.noise_yaw_rate * elapsed;
        let [bias, rest] = [BIAS_WANDERS, REST_WANDERS].map(|wanders| wanders * wanders * elapsed);
        self.filter.predict(turned, by, [missed * missed, bias, rest, rest]);
    }

    fn observe(&mut self, yaw: f64, rate: f64, noise: &ObserverParameters) {
        let seen = SVector::<f64, STATES>::from([1.0, 0.0, 0.0, -rate]);
        let off = wrap_angle(yaw - seen.dot(&self.filter.mean));
        if self.filter.update(&seen, off, noise.noise_yaw * noise.noise_yaw) {
            self.filter.mean[ANGLE] = wrap_angle(self.filter.mean[ANGLE]);
        } else {
            self.begin(yaw, noise);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;

    const STEP: f64 = 0.02;

    /// A minute on a road with bends; the error of the corrected rate in the second half, root of the mean square.
    fn drive(bias: f64, scale: f64, late: usize, noise: f64, every: usize) -> (f64, RateSensor) {
        let parameters = ObserverParameters::default();
        let mut sensor = RateSensor::new(&parameters);
        let mut random = Random::new(5);
        let mut draw = |deviation: f64| noise * deviation * 12.0_f64.sqrt() * (random.uniform() - 0.5);
        let (mut yaw, mut square, mut count) = (3.0, 0.0, 0.0);
        let mut past = vec![yaw];
        for k in 0..3000 {
            let time = STEP * f64::from(k);
            let rate = if (time / 8.0) as usize % 2 == 1 { 0.15 * (0.4 * time).sin() } else { 0.0 };
            yaw += rate * STEP;
            past.push(yaw);
            let seen = past[(past.len() - 1).saturating_sub(late)];
            let angle =
                (k as usize).is_multiple_of(every).then(|| wrap_angle(seen + draw(parameters.noise_yaw)));
            let measured = (1.0 + scale) * rate + bias + draw(parameters.noise_yaw_rate);
            let truth = measured - (scale * rate + bias);
            let corrected = sensor.correct(angle, measured, STEP, &parameters);
            if k >= 1500 {
                (square, count) = (square + (corrected - truth).powi(2), count + 1.0);
            }
        }
        ((square / count).sqrt(), sensor)
    }

    #[test]
    fn a_sound_sensor_is_left_alone() {
        let (off, sensor) = drive(0.0, 0.0, 0, 0.0, 1);
        assert!(off < 2e-4, "{off} {}", sensor.filter.mean);
        assert!(drive(0.0, 0.0, 0, 1.0, 1).0 < 4e-4);
    }

    #[test]
    fn bias_and_scale_are_found_also_with_noise_a_late_angle_and_a_slow_receiver() {
        for (bias, scale) in [(0.01, 0.0), (-0.02, 0.0), (0.0, 0.05), (0.005, -0.04)] {
            for (late, noise, every) in [(0, 0.0, 1), (0, 1.0, 1), (5, 1.0, 1), (0, 1.0, 5)] {
                let (off, sensor) = drive(bias, scale, late, noise, every);
                assert!(off < 1e-3, "{bias} {scale} {late} {noise} {every}: {off} {}", sensor.filter.mean);
            }
        }
    }

    #[test]
    fn a_bias_is_found_within_two_seconds() {
        let parameters = ObserverParameters::default();
        let mut sensor = RateSensor::new(&parameters);
        let mut corrected = 0.0;
        for k in 0..100 {
            let noise = if k % 2 == 0 { 1e-6 } else { -1e-6 };
            corrected = sensor.correct(Some(1.0), 0.01 + noise, STEP, &parameters);
        }
        assert!(corrected.abs() < 1e-3, "{corrected}");
    }

    #[test]
    fn a_rate_that_rests_while_the_angle_turns_teaches_nothing() {
        let parameters = ObserverParameters::default();
        let mut sensor = RateSensor::new(&parameters);
        for k in 0..500 {
            let corrected =
                sensor.correct(Some(wrap_angle(0.1 * STEP * f64::from(k))), 0.0, STEP, &parameters);
            assert!(corrected.abs() < 5e-3, "{k}: {corrected}");
        }
        assert!(sensor.filter.mean[1].abs() < 5e-3, "{}", sensor.filter.mean);
    }

    #[test]
    fn a_jump_of_the_angle_is_none_of_the_rate() {
        let parameters = ObserverParameters::default();
        let (_, mut sensor) = drive(0.0, 0.0, 0, 0.0, 1);
        let before = sensor.correct(Some(sensor.filter.mean[0]), 0.0, STEP, &parameters);
        for _ in 0..50 {
            let after = sensor.correct(Some(1.0), 0.0, STEP, &parameters);
            assert!((after - before).abs() < 1e-4, "{before} {after}");
        }
    }
}
