//! Errors of the yaw angle, learned while driving: how far it points beside the way that the vehicle moves.
//!
//! A receiver that is mounted a degree askew, or a `vy` of another origin, turns the velocity that the path errors are made of. On a
//! straight road the prediction then leaves the road, the place does not, and the observer takes the difference for a side force: a
//! truck at 30 m/s was metres beside a straight road. The place knows better:
//!
//! ```text
//! z = [s, b, T],    s' = vx (b + T r),    n . d(p) = n . int R(yaw) [vx, vy] dt + d(s)
//! ```
//!
//! with `s` the way across the heading (normal `n`) beyond that by speed and yaw, the offset `b` of the yaw angle, and the lateness
//! `T` of the place behind it, which another reference point or a missing `vy` has as well. The controller is given `yaw + b`: what goes
//! with the turns is not the angle's.
//!
//! A receiver whose noise is larger than told counts as little as its innovations say.

use super::observer::ObserverParameters;
use super::sensor_filter::SensorFilter;
use super::step::Measurement;
use nalgebra::{SVector, Vector2};
use serde::{Deserialize, Serialize};

/// States: way across, offset, lateness.
const STATES: usize = 3;
/// Standard deviation of the lateness, s, before any is seen.
const LATENESS: f64 = 0.05;
/// Wandering in a second: of the offset, rad, and of the lateness, s.
const OFFSET_WANDERS: f64 = 5e-5;
const LATENESS_WANDERS: f64 = 1e-4;
/// Largest offset that is believed, rad: a compass' or another frame's is no offset.
const LARGEST: f64 = 0.1;
/// Time over which the noise of the place is judged, s, and its largest variance beside the told one.
const JUDGED: f64 = 1.0;
const NOISIEST: f64 = 1000.0;

/// The yaw angle, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct YawSensor {
    filter: SensorFilter<STATES>,
    /// Motion of the step before: velocity over the ground, place.
    before: Option<[Vector2<f64>; 2]>,
    /// Way across the heading so far, by the place beyond that by speed and yaw, m.
    across: f64,
    /// Variance of the place's noise over the told one.
    noisy: f64,
}

impl YawSensor {
    /// A sensor of which nothing is known yet.
    pub fn new(parameters: &ObserverParameters) -> Self {
        let square = |deviation: f64| deviation * deviation;
        Self {
            filter: SensorFilter::new([0.0, square(parameters.yaw_offset), square(LATENESS)]),
            before: None,
            across: 0.0,
            noisy: 1.0,
        }
    }

    /// Takes a motion so many seconds after the last; gives the offset of its yaw angle, rad. One that is not to be trusted
    /// teaches nothing.
    pub fn offset(
        &mut self,
        seen: &Measurement,
        trusted: bool,
        elapsed: f64,
        noise: &ObserverParameters,
    ) -> f64 {
        let (sin, cos) = seen.yaw.sin_cos();
        let velocity = Vector2::new(seen.vx * cos - seen.vy * sin, seen.vx * sin + seen.vy * cos);
        let place = Vector2::new(seen.x, seen.y);
        match self.before.filter(|_| trusted) {
            None => self.filter.begin(self.across, noise.noise_position.powi(2)),
            Some([velocity_before, place_before]) => {
                let way = 0.5 * elapsed * (velocity_before + velocity);
                let beyond = place - place_before - way;
                self.across += cos * beyond.y - sin * beyond.x;
                self.learn(seen, place != place_before, elapsed, noise);
            }
        }
        self.before = trusted.then_some([velocity, place]);
        if !self.filter.is_sound() || !self.across.is_finite() {
            *self = Self::new(noise);
        }
        self.filter.mean[1].clamp(-LARGEST, LARGEST)
    }

    fn learn(&mut self, seen: &Measurement, is_new: bool, elapsed: f64, noise: &ObserverParameters) {
        let way = seen.vx * elapsed;
        let by = SVector::<f64, STATES>::from([0.0, way, way * seen.yaw_rate]);
        let missed = (way * noise.noise_yaw).powi(2) + (elapsed * noise.noise_velocity).powi(2);
        let wanders = [missed, OFFSET_WANDERS.powi(2) * elapsed, LATENESS_WANDERS.powi(2) * elapsed];
        let added = by.dot(&self.filter.mean);
        self.filter.predict(added, by, wanders);
        // A place that rests while the vehicle moves is an old one.
        if !is_new {
            return;
        }
        let saw = SVector::<f64, STATES>::from([1.0, 0.0, 0.0]);
        let off = self.across - self.filter.mean[0];
        let told = noise.noise_position.powi(2);
        let ratio = (off * off - self.filter.variance(&saw)).max(0.0) / told;
        self.noisy += (ratio.min(NOISIEST) - self.noisy) * (elapsed / JUDGED).min(1.0);
        let noise = told * self.noisy.max(1.0);
        if !self.filter.update(&saw, off, noise) {
            self.filter.begin(self.across, noise);
        }
    }

    /// The vehicle was moved. What is known of the sensor stays.
    pub fn forget_place(&mut self) {
        self.before = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;

    const STEP: f64 = 0.02;

    /// Drives at 20 m/s on straights and bends; gives the largest error of the corrected yaw angle in the second half.
    fn drive(offset: f64, late: f64, noise: f64, every: u32) -> f64 {
        let parameters = ObserverParameters::default();
        let mut sensor = YawSensor::new(&parameters);
        let mut random = Random::new(5);
        let mut draw = |deviation: f64| noise * deviation * 12.0_f64.sqrt() * (random.uniform() - 0.5);
        let (mut yaw, mut x, mut y, mut largest) = (0.3, 0.0, 0.0, 0.0_f64);
        let mut seen = Measurement::default();
        for k in 0..2000 {
            let time = STEP * f64::from(k);
            let rate = if (time / 8.0) as usize % 2 == 1 { 0.15 * (0.4 * time).sin() } else { 0.0 };
            let before: f64 = yaw;
            yaw += rate * STEP;
            let middle = 0.5 * (before + yaw);
            (x, y) = (x + 20.0 * STEP * middle.cos(), y + 20.0 * STEP * middle.sin());
            if k % every == 0 {
                // A late place, as of a receiver.
                seen.x = x - 20.0 * late * yaw.cos() + draw(parameters.noise_position);
                seen.y = y - 20.0 * late * yaw.sin() + draw(parameters.noise_position);
            }
            (seen.yaw, seen.yaw_rate) = (yaw + offset + draw(parameters.noise_yaw), rate);
            (seen.vx, seen.vy) = (20.0, draw(parameters.noise_velocity));
            let found = sensor.offset(&seen, true, STEP, &parameters);
            // Of the turns the lateness is seen, too: the way driven is that of a late place.
            if k >= 1000 && rate == 0.0 {
                largest = largest.max((offset + found).abs());
            }
        }
        largest
    }

    #[test]
    fn a_sound_sensor_is_left_alone() {
        assert!(drive(0.0, 0.0, 0.0, 1) < 1e-4, "{}", drive(0.0, 0.0, 0.0, 1));
        assert!(drive(0.0, 0.0, 1.0, 1) < 3e-3, "{}", drive(0.0, 0.0, 1.0, 1));
    }

    #[test]
    fn an_offset_is_found_also_with_noise_and_a_late_or_slow_receiver() {
        for offset in [0.01, -0.03, 0.05] {
            for (late, noise, every) in
                [(0.0, 0.0, 1), (0.0, 1.0, 1), (0.1, 1.0, 1), (0.0, 1.0, 5), (0.0, 10.0, 1)]
            {
                let off = drive(offset, late, noise, every);
                let most = if noise > 1.0 { 0.02 } else { 4e-3 };
                assert!(off < most, "{offset} {late} {noise} {every}: {off}");
            }
        }
    }
}
