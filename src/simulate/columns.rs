//! Columns of a drive log that every vehicle has.

use crate::signal::{self, Signal};

/// Columns of every drive log of the closed loop, in order; those of a kind of vehicle follow.
pub const COLUMNS: [Signal; 23] = [
    signal::TIME,
    signal::STEER_CMD,
    signal::ACCEL_CMD,
    signal::X,
    signal::Y,
    signal::YAW,
    signal::VX,
    signal::VY,
    signal::YAW_RATE,
    signal::AX,
    signal::AY,
    signal::STEER,
    signal::ROLL,
    signal::E1,
    signal::E1_RATE,
    signal::E2,
    signal::E2_RATE,
    signal::STATION,
    signal::CURVATURE,
    signal::CURVATURE_RATE,
    signal::BANK,
    signal::GRADE,
    signal::FRICTION,
];

/// Place of the time in a row.
pub const TIME: usize = 0;
/// Place of the steering command in a row.
pub(super) const STEER_CMD: usize = 1;
/// Place of the station in a row.
pub const STATION: usize = 17;

/// Last column of a drive log: text, the controller's status.
pub const STATUS: &str = "status";

/// Record of every vehicle at one communication point: the vehicle's motion there, and the controller's decision on it.
pub type Common = [f64; COLUMNS.len()];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_those_of_their_columns() {
        let names = [TIME, STEER_CMD, STATION].map(|place| COLUMNS[place].name);
        assert_eq!(names, ["time", "steer_cmd", "station"]);
    }
}
