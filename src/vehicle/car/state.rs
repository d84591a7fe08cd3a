//! What changes while a car drives.

use super::plant::Plant;
use super::sensors::SensorState;
use crate::vehicle::steering::SteeringState;
use serde::{Deserialize, Serialize};

/// Place of the CG on the road (under the CG, on the roll axis), m.
pub(super) const X: usize = 0;
pub(super) const Y: usize = 1;
/// rad
pub(super) const YAW: usize = 2;
/// Velocity of that place in body axes, m/s.
pub(super) const VX: usize = 3;
pub(super) const VY: usize = 4;
/// rad/s
pub(super) const YAW_RATE: usize = 5;
/// Attitude of the body against the road, rad and rad/s.
pub(super) const ROLL: usize = 6;
pub(super) const ROLL_RATE: usize = 7;
pub(super) const PITCH: usize = 8;
pub(super) const PITCH_RATE: usize = 9;
/// Height of the body against rest, m and m/s.
pub(super) const HEAVE: usize = 10;
pub(super) const HEAVE_RATE: usize = 11;
/// The first wheel's states; wheels are front left, front right, rear left, rear right.
pub(super) const WHEELS: usize = 12;
/// States of one wheel.
pub(super) const PER_WHEEL: usize = 6;
/// Spin, rad/s.
pub(super) const SPIN: usize = 0;
/// Longitudinal and lateral deflection of the tyre's contact, m.
pub(super) const DEFLECTION_X: usize = 1;
pub(super) const DEFLECTION_Y: usize = 2;
/// Height of the wheel against rest, m and m/s.
pub(super) const LIFT: usize = 3;
pub(super) const LIFT_RATE: usize = 4;
/// Wind-up of the brake, rad.
pub(super) const WIND_UP: usize = 5;
/// All of them.
pub(super) const STATES: usize = WHEELS + 4 * PER_WHEEL;

/// Everything that steps change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct CarState {
    /// Since the car was placed, s.
    pub time: f64,
    #[serde(with = "array")]
    pub y: [f64; STATES],
    pub steering: SteeringState,
    /// Acceleration that drive and brakes give, m/s2.
    pub drive: f64,
    /// Arc length on the road, m.
    pub station: f64,
    pub sensors: SensorState,
}

impl CarState {
    pub fn at_rest(plant: &Plant) -> Self {
        Self::placed(plant, 0.0, 0.0, 0.0, 0.0)
    }

    /// At a place of the reference point, at a speed, wheels rolling.
    pub fn placed(plant: &Plant, x: f64, y: f64, yaw: f64, vx: f64) -> Self {
        let mut states = [0.0; STATES];
        let (sin, cos) = yaw.sin_cos();
        states[X] = x - plant.reference_x * cos;
        states[Y] = y - plant.reference_x * sin;
        states[YAW] = yaw;
        states[VX] = vx;
        for wheel in 0..4 {
            states[WHEELS + wheel * PER_WHEEL + SPIN] = vx / plant.axles[wheel / 2].radius;
        }
        Self {
            time: 0.0,
            y: states,
            steering: SteeringState::at_rest(&plant.steering, 0.0),
            drive: 0.0,
            station: 0.0,
            sensors: SensorState::new(plant),
        }
    }

    /// Drive and brakes follow what is asked with a first-order lag, exactly.
    pub fn advance_drive(&mut self, plant: &Plant, asked: f64, h: f64) {
        if plant.drive_lag > 0.0 {
            self.drive += (asked - self.drive) * -(-h / plant.drive_lag).exp_m1();
        } else {
            self.drive = asked;
        }
    }

    pub fn copy_from(&mut self, other: &Self) {
        self.time = other.time;
        self.y = other.y;
        self.steering.copy_from(&other.steering);
        self.drive = other.drive;
        self.station = other.station;
        self.sensors.copy_from(&other.sensors);
    }

    /// Room for all that may be under way.
    pub fn reserve(&mut self, plant: &Plant) {
        self.steering.reserve(&plant.steering);
        self.sensors.reserve(plant);
    }

    pub fn is_sound(&self) -> bool {
        self.time.is_finite()
            && self.drive.is_finite()
            && self.station.is_finite()
            && self.steering.measured().is_finite()
            && self.y.iter().all(|value| value.is_finite())
    }
}

/// Serde knows arrays up to 32 numbers only.
mod array {
    use super::STATES;
    use serde::de::{Error, SeqAccess, Visitor};
    use serde::ser::SerializeTuple;
    use serde::{Deserializer, Serializer};

    pub fn serialize<S: Serializer>(values: &[f64; STATES], serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(STATES)?;
        for value in values {
            tuple.serialize_element(value)?;
        }
        tuple.end()
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; STATES], D::Error> {
        struct Numbers;
        impl<'de> Visitor<'de> for Numbers {
            type Value = [f64; STATES];
            fn expecting(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
                write!(formatter, "{STATES} numbers")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Self::Value, A::Error> {
                let mut values = [0.0; STATES];
                for (index, value) in values.iter_mut().enumerate() {
                    *value =
                        sequence.next_element()?.ok_or_else(|| A::Error::invalid_length(index, &self))?;
                }
                Ok(values)
            }
        }
        deserializer.deserialize_tuple(STATES, Numbers)
    }
}
