//! A log made ready for comparison: an even clock, no gaps, units and signs checked; every repair is said.

use super::finding::Finding;
use std::collections::BTreeMap;

/// A log on an even clock, mended.
#[derive(Debug, Clone, PartialEq)]
pub struct CleanLog {
    /// Sample time, s: the log's own median step; rates above 100 Hz are brought down to 100 Hz.
    pub step: f64,
    /// Time of each row, s.
    pub time: Vec<f64>,
    /// Columns by signal; `steer_cmd` is always there: `steer` stands in if the log had none, see `commanded`.
    pub columns: BTreeMap<&'static str, Vec<f64>>,
    /// Whether `steer_cmd` is really the command.
    pub commanded: bool,
    /// False where the row was interpolated over a gap, is at standstill or must not be scored for another reason.
    pub valid: Vec<bool>,
    /// What was found and done, the gravest first.
    pub findings: Vec<Finding>,
}
