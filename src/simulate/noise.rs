//! Measurement noise between the vehicle and its controller.

use crate::control::Measurement;
use crate::numerics::Random;

/// Standard deviations of white noise on the measurements of one control step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SensorNoise {
    /// Of `x` and `y`, m.
    pub position: f64,
    /// Of `vx` and `vy`, m/s.
    pub velocity: f64,
    /// Of `yaw`, rad.
    pub yaw: f64,
    /// Of `yaw_rate`, rad/s.
    pub yaw_rate: f64,
    /// Of `articulation`, rad.
    pub articulation: f64,
    /// Of `articulation_rate`, rad/s.
    pub articulation_rate: f64,
}

impl SensorNoise {
    /// A good inertial navigation system with differential satellite positioning.
    pub const TYPICAL: Self = Self {
        position: 0.005,
        velocity: 0.010,
        yaw: 0.0015,
        yaw_rate: 0.004,
        articulation: 0.0,
        articulation_rate: 0.0,
    };

    /// The same in a truck, with an angle sensor at the fifth wheel.
    pub const TYPICAL_TRUCK: Self = Self { articulation: 0.002, articulation_rate: 0.005, ..Self::TYPICAL };

    /// So many times as much.
    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        let Self { position, velocity, yaw, yaw_rate, articulation, articulation_rate } = *self;
        Self {
            position: by * position,
            velocity: by * velocity,
            yaw: by * yaw,
            yaw_rate: by * yaw_rate,
            articulation: by * articulation,
            articulation_rate: by * articulation_rate,
        }
    }

    /// Adds noise to a measurement.
    pub fn disturb(&self, measurement: &mut Measurement, random: &mut Random) {
        let Measurement { x, y, yaw, vx, vy, yaw_rate, .. } = measurement;
        let deviations = [
            (x, self.position),
            (y, self.position),
            (yaw, self.yaw),
            (vx, self.velocity),
            (vy, self.velocity),
            (yaw_rate, self.yaw_rate),
        ];
        for (value, deviation) in deviations {
            *value += deviation * random.normal();
        }
        // Nothing is drawn for a vehicle without articulation.
        let further = [
            (&mut measurement.articulation, self.articulation),
            (&mut measurement.articulation_rate, self.articulation_rate),
        ];
        for (value, deviation) in further.into_iter().filter(|(_, deviation)| *deviation > 0.0) {
            *value += deviation * random.normal();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_deviations_are_those_asked_for() {
        let mut random = Random::new(1);
        let (mut sum, mut squares, count) = (0.0, 0.0, 20_000);
        for _ in 0..count {
            let mut measurement = Measurement::default();
            SensorNoise::TYPICAL.disturb(&mut measurement, &mut random);
            let z = measurement.yaw / SensorNoise::TYPICAL.yaw;
            (sum, squares) = (sum + z, squares + z * z);
        }
        let n = f64::from(count);
        // Five standard deviations of mean and variance.
        assert!((sum / n).abs() < 5.0 / n.sqrt() && (squares / n - 1.0).abs() < 5.0 * (2.0 / n).sqrt());
    }
}
