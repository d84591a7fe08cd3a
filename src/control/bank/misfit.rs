//! Misfit of the best hypothesis: the measured angle that no hypothesis explains, as a time.
//!
//! The posterior's spread holds if the actuator is among the hypotheses. A resonance, a rate limit or a gap of another width is
//! not, and leaves a residual `e` that lasts, while a sensor's noise does not. Both behind a high pass at the loop's bandwidth `w`,
//!
//! ```text
//! misfit^2 = sum (e_k e_{k-1} - (g s)^2) / (w^2 sum (g delta_k)^2),      e = steer - g delta
//! ```
//!
//! with the play `s` of an ordinary linkage, is the residual's share of the angle, which is an error of phase there, over the
//! bandwidth: a dead time that would err as much. An error of the gain in slow bends passes as little as they do.

use super::regression::TINY;
use serde::{Deserialize, Serialize};

/// Bandwidth of the steering loop, rad/s.
const BANDWIDTH: f64 = 3.0;

/// High pass of the measured angle and of each hypothesis' angle, and their sums.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct ActuatorMisfit {
    /// True once the high passes have a value to go on from.
    runs: bool,
    steer: Passed,
    /// Sum of the measured angle's products with the one before.
    own: f64,
    each: Vec<MisfitSums>,
}

/// Slow part of a signal, and its fast part one step ago.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Passed {
    slow: f64,
    before: f64,
}

/// A hypothesis' high pass and sums.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct MisfitSums {
    angle: Passed,
    /// Products of the angle with the one before.
    own: f64,
    /// Products with the measured angle, each with the other one before.
    both: f64,
    /// Squares of the angle.
    square: f64,
}

impl Passed {
    /// The fast part, now and one step ago.
    fn pass(&mut self, value: f64, runs: bool, newer: f64) -> [f64; 2] {
        if !runs {
            *self = Self { slow: value, before: 0.0 };
        }
        let (fast, before) = (value - self.slow, self.before);
        *self = Self { slow: self.slow + newer * fast, before: fast };
        [fast, before]
    }
}

impl ActuatorMisfit {
    /// Sums of so many hypotheses, before the first step.
    pub fn new(count: usize) -> Self {
        Self { each: vec![MisfitSums::default(); count], ..Self::default() }
    }

    /// Number of hypotheses.
    pub fn len(&self) -> usize {
        self.each.len()
    }

    /// Takes the measured angle and those of the hypotheses, with their share, and keeps as much of the sums.
    pub fn observe(
        &mut self,
        steer: f64,
        angles: impl Iterator<Item = f64>,
        [keep, share]: [f64; 2],
        sample_time: f64,
    ) {
        let newer = (BANDWIDTH * sample_time).min(1.0);
        let [steer, steer_before] = self.steer.pass(steer, self.runs, newer);
        self.own = self.own * keep + share * steer * steer_before;
        for (sums, angle) in self.each.iter_mut().zip(angles) {
            let [angle, before] = sums.angle.pass(angle, self.runs, newer);
            sums.own = sums.own * keep + share * angle * before;
            sums.both = sums.both * keep + share * (angle * steer_before + steer * before);
            sums.square = sums.square * keep + share * angle * angle;
        }
        self.runs = true;
    }

    /// The next sample does not follow the last.
    pub fn interrupt(&mut self) {
        self.runs = false;
    }

    /// The misfit of a hypothesis with the sensor's gain as a variance of the dead time, s2. `play` is the sum of the ordinary
    /// play's squares.
    pub fn variance(&self, k: usize, gain: f64, play: f64) -> f64 {
        let MisfitSums { own, both, square, .. } = self.each[k];
        let products = self.own - gain * both + gain * gain * (own - play);
        let squares = BANDWIDTH * BANDWIDTH * gain * gain * square;
        if squares > TINY { products.max(0.0) / squares } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;

    fn misfit(measured: impl Fn(f64, f64) -> f64) -> f64 {
        let mut misfit = ActuatorMisfit::new(1);
        let mut random = Random::new(1);
        let angle = |time: f64| 0.02 * (BANDWIDTH * time).sin();
        for k in 0..20_000 {
            let time = 0.02 * f64::from(k);
            let steer = measured(time, 2.0 * random.uniform() - 1.0);
            misfit.observe(steer, [angle(time)].into_iter(), [1.0, 1.0], 0.02);
        }
        misfit.variance(0, 1.0, 0.0).sqrt()
    }

    #[test]
    fn is_the_time_by_which_an_angle_is_late_at_the_bandwidth() {
        let late = misfit(|time, _| 0.02 * (BANDWIDTH * (time - 0.05)).sin());
        assert!((late - 0.05).abs() < 0.002, "{late}");
    }

    #[test]
    fn noise_of_a_sensor_is_none() {
        let angle = |time: f64| 0.02 * (BANDWIDTH * time).sin();
        let noisy = misfit(|time, random| angle(time) + 2e-3 * random);
        assert!(noisy < 0.005, "{noisy}");
        assert!(misfit(|time, _| angle(time)) < 1e-6);
    }
}
