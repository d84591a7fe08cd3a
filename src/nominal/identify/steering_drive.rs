//! A drive as recorded, the course of its command between rows, and values of it that are wrong.

use crate::enumeration;

enumeration! {
    /// Course of a command between the rows of a record.
    pub enum Between {
        Held = 0 "held", "Each command stands until the next row";
        Line = 1 "line", "Commands were recorded more slowly than given: on a line between rows";
        Either = 2 "either", "The drives do not show which of the two: the dead time is uncertain by half a row";
    }
}

/// Period of a steering controller, s: 50 Hz. Faster ones are ordinary, slower ones are not.
const CONTROL_PERIOD: f64 = 0.02;

impl Between {
    /// Lateness that a dead time found so lacks at least, ordinarily and at most, s, of rows at every `step`.
    ///
    /// Commands that stand for a period `p` are `p / 2` behind the line through them, and by `(h - p) / 2` ahead of those
    /// that stand for a step `h`. A line through rows that meet each command just as it is given, of a period of half a
    /// step, is a quarter of a step ahead of them.
    pub(super) fn unseen(self, step: f64) -> [f64; 3] {
        match self {
            Between::Held => [0.0; 3],
            Between::Line => [-0.25 * step, 0.0, 0.0],
            Between::Either => [0.0, 0.5 * (step - step.min(CONTROL_PERIOD)), 0.5 * step],
        }
    }
}

/// A drive as recorded. Rows need not be even; a value that is no number is a gap.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SteeringDrive {
    /// Name in messages.
    pub name: String,
    /// s, rising.
    pub time: Vec<f64>,
    /// Command, rad, given at its time.
    pub steer_cmd: Vec<f64>,
    /// Response measured just before: the road-wheel angle in rad, or the yaw rate in rad/s.
    pub response: Vec<f64>,
    /// Forward speed, m/s, for a yaw rate; else empty.
    pub speed: Vec<f64>,
}

/// A value that was taken for wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// Place of the drive.
    pub drive: u32,
    /// Row of the drive.
    pub row: u32,
    /// `steer_cmd` or `response`.
    pub signal: &'static str,
    /// The value.
    pub value: f64,
}
