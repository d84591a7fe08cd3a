//! A drive as recorded, the course of its command between rows, and values of it that are wrong.

use crate::enumeration;

enumeration! {
    /// Course of a command between the rows of a record.
    pub enum Between {
        Held = 0 "held", "Each command stands until the next row";
        Line = 1 "line", "Commands were recorded more slowly than given: on a line between rows";
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
