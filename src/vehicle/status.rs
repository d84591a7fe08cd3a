//! State of motion of a vehicle, told from its wheels.

use super::unit::WheelOutput;

/// Slip beyond which a wheel counts as locked or spinning, slip angle (rad) beyond which an axle slides.
const WHEEL_SLIP: f64 = 0.3;
const SLIDING: f64 = 0.25;
/// Speed in m/s and spin in rad/s below which a vehicle stands.
const STANDING: f64 = 0.02;
const STILL: f64 = 1.0;

/// True if a wheel has left the road.
pub(super) fn lifted(wheels: &[WheelOutput]) -> bool {
    wheels.iter().any(|wheel| wheel.load <= 0.0)
}

/// True if a vehicle of this speed in m/s stands.
pub(super) fn stands(speed: f64, wheels: &[WheelOutput]) -> bool {
    speed < STANDING && wheels.iter().all(|wheel| wheel.speed.abs() < STILL)
}

/// True if both wheels of an axle slide sideways.
pub(super) fn slides(wheels: &[WheelOutput]) -> bool {
    wheels.chunks(2).any(|axle| axle.iter().all(|wheel| wheel.slip_angle.abs() > SLIDING))
}

/// True if a wheel is locked or spinning.
pub(super) fn slips(wheels: &[WheelOutput]) -> bool {
    wheels.iter().any(|wheel| wheel.slip.abs() > WHEEL_SLIP)
}
