//! A log on an even clock, mended, and the reasons for which there is none.

use super::error::perhaps;
use super::finding::{Finding, FindingSeverity};
use super::read::DriveLog;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Speed below which a vehicle stands, for its dynamics, m/s.
pub(super) const STANDING: f64 = 2.0;
/// Least length of a log, s.
pub(super) const LEAST_LENGTH: f64 = 10.0;

/// True for a drive of so many s that is long enough. Each row stands for a step.
pub(super) fn is_long_enough(length: f64) -> bool {
    is_as_long(length, LEAST_LENGTH)
}

/// True for a length of at least so many s, but for the rounding of a clock.
pub(super) fn is_as_long(length: f64, least: f64) -> bool {
    length >= 0.999 * least
}

/// Uncertainty of a column that is written in steps, or that has fewer samples than rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coarseness {
    /// Standard deviation of a value in the column's unit: the step over the root of 12; of a line between two samples the noise
    /// of both.
    pub deviation: f64,
    /// Usual time for which an error stays, s: that for which the number rests, or from sample to sample.
    pub lasting: f64,
}

/// A log on an even clock, mended.
#[derive(Debug, Clone, PartialEq)]
pub struct CleanLog {
    /// Sample time, s: the log's own median step; rates above 100 Hz are brought down to 100 Hz.
    pub step: f64,
    /// Time of each row, s.
    pub time: Vec<f64>,
    /// Columns by signal. `steer_cmd` is always there: `steer` replaces it if the log had none, see `commanded`.
    pub columns: BTreeMap<&'static str, Vec<f64>>,
    /// True if `steer_cmd` is really the command.
    pub commanded: bool,
    /// False for a row that was interpolated over a gap, is at standstill or must not be scored for another reason.
    pub valid: Vec<bool>,
    /// Columns that are written more coarsely than the quantity moves, in value or in time.
    pub coarse: BTreeMap<&'static str, Coarseness>,
    /// Findings and repairs, the gravest first.
    pub findings: Vec<Finding>,
}

impl Coarseness {
    /// Of numbers in steps that usually rest for some seconds.
    pub(super) fn of(step: f64, lasting: f64) -> Self {
        Self { deviation: step / 12.0_f64.sqrt(), lasting }
    }
}

impl CleanLog {
    /// Of columns on an even clock from 0 on, with the command, every row valid and nothing to be said.
    #[must_use]
    pub fn of_columns(step: f64, columns: BTreeMap<&'static str, Vec<f64>>) -> Self {
        let rows = columns.values().next().map_or(0, Vec::len);
        Self {
            step,
            time: (0..rows).map(|row| row as f64 * step).collect(),
            columns,
            commanded: true,
            valid: vec![true; rows],
            coarse: BTreeMap::new(),
            findings: Vec::new(),
        }
    }

    /// Rows of so many seconds, at least one.
    pub(super) fn rows_in(&self, seconds: f64) -> usize {
        ((seconds / self.step).round() as usize).max(1)
    }

    /// Takes rows out of the comparison where enough is left of it, and says so of a column: `what` they are, and `advice`.
    pub(super) fn not_judged(&mut self, valid: Vec<bool>, column: &str, what: &str, advice: &str) {
        let left = self.step * valid.iter().filter(|valid| **valid).count() as f64;
        let (gravity, then) = if is_long_enough(left) {
            self.valid = valid;
            (FindingSeverity::Warning, "not judged there")
        } else {
            (FindingSeverity::Suspicion, "the rest of the drive is too short to be judged alone")
        };
        self.find(gravity, column, format!("{what}: {then}{advice}"));
    }

    /// Notes a finding about a column.
    pub(super) fn find(&mut self, gravity: FindingSeverity, column: &str, words: String) {
        self.findings.push(Finding::new(gravity, Some(column), words));
    }

    /// A finding that makes the log suspect, so that no answer from it is to be trusted.
    #[must_use]
    pub fn suspect(&self) -> Option<&Finding> {
        self.findings.iter().find(|finding| finding.gravity == FindingSeverity::Suspicion)
    }
}

/// An unusable log, with the reason.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}{losses}", file.display())]
pub struct UnusableLog {
    /// The log.
    pub file: PathBuf,
    /// Fault, and advice.
    #[source]
    pub cause: CleanError,
    /// [Losses](DriveLog::losses) in reading: they may be the reason.
    pub losses: String,
}

impl UnusableLog {
    /// A fault of a log that was read.
    pub(super) fn of(log: &DriveLog, cause: CleanError) -> Self {
        Self { file: log.file.clone(), cause, losses: log.losses() }
    }
}

/// Reasons for which nothing can be computed from a log.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum CleanError {
    #[error(
        "column '{column}' is missing; a log to diagnose needs time, steer_cmd (or steer), vx and yaw_rate{}",
        perhaps(column, near)
    )]
    Missing { column: &'static str, near: Vec<String> },
    #[error("the log has {rows} rows with a time; a drive of at least {LEAST_LENGTH} s is needed")]
    NoRows { rows: usize },
    #[error(
        "{}, as seconds since 1970 have in 32 bits or six digits; write them in full, or delete the column and give the rate of the \
         rows (--rate HZ)",
        match times {
            1 => format!("all {rows} rows have the same time"),
            _ => format!("the {rows} rows have {times} different times only, {apart} apart"),
        }
    )]
    FewTimes { rows: usize, times: usize, apart: f64 },
    #[error(
        "the clock starts anew {} times, first in row {row}; the longest of the {drives} drives between is {length:.2} s \
         long, and at least {least} s are needed",
        drives - 1
    )]
    ShortDrives { row: usize, drives: usize, length: f64, least: f64 },
    #[error(
        "the drive is {length:.2} s long ({rows} rows); at least {least} s are needed{}",
        unit.map_or(String::new(), |unit| format!(
            ". By x, y and vx one unit of the clock is {unit:.3e} s: give time in seconds"
        ))
    )]
    TooShort { length: f64, rows: usize, least: f64, unit: Option<f64> },
    #[error(
        "{rate:.2} rows a second: steering cannot be seen below {least}; record with 20 or more, and give time in seconds"
    )]
    TooSlow { rate: f64, least: f64 },
    #[error(
        "column '{column}' holds a value in {share:.0} % of the time only; at least half is needed{}",
        why.as_ref().map_or(String::new(), |why| format!(". {why}"))
    )]
    Sparse { column: &'static str, share: f64, why: Option<String> },
    #[error(
        "the vehicle drives faster than {STANDING} m/s for {moving:.1} s only; at least {LEAST_LENGTH} s are needed. Is vx \
         in m/s?"
    )]
    Standing { moving: f64 },
    #[error(
        "{} jump to and fro from row to row: the rows of two vehicles or recordings in turn; give each in a file of its own, or, \
         where a column tells them apart, --only COLUMN=VALUE",
        columns.join(", ")
    )]
    Mixed { columns: Vec<&'static str> },
    #[error("{words}; nothing is to be learned from it before that is cleared up")]
    Suspect { words: String },
    #[error("{column} {words}: one of the two has another unit")]
    Contradicts { column: &'static str, words: String },
    #[error(
        "{column} = {value:e} in row {row}{}: that is no measurement in any unit, and the file is damaged; correct the \
         value, or leave the field empty if there was none",
        if *count > 1 { format!(", and {} more such values", count - 1) } else { String::new() }
    )]
    Absurd { column: &'static str, row: usize, value: f64, count: usize },
    #[error(
        "{column} = {value:.4} in row {row}, and as impossible in {count} rows: no road vehicle does that; check the unit \
         of {column} (SI units and radians are needed)"
    )]
    Impossible { column: &'static str, row: usize, value: f64, count: usize },
    #[error("{}", opposite(columns, against, *tied))]
    Sign { columns: Vec<&'static str>, against: Vec<&'static str>, tied: bool },
    #[error("{words}")]
    Frame { words: &'static str },
    #[error(
        "steer answers {seconds:.2} s before steer_cmd, as no actuator does: the two columns are swapped, another clock wrote one of \
         them, or steer_cmd was recorded more seldom than it was given; correct that, or delete steer_cmd"
    )]
    Early { seconds: f64 },
    #[error(
        "time runs backwards: the vehicle moves against yaw, and turns against yaw_rate; count time from the start of the drive, or \
         delete the column and give the rate of the rows (--rate HZ)"
    )]
    Backwards,
    #[error(
        "{column} is a steering-wheel angle{}: {ratio:.1} times the road-wheel angle that the turns need; divide it by \
         the steering ratio{} (scripts/import_log.py can){}",
        if *degrees { " in degrees" } else { "" },
        if *degrees { " and convert it to radians" } else { "" },
        if *degrees && (*ratio / MILLIRADIANS - 1.0).abs() < 0.1 { ", or it is in milliradians: then divide it by 1000" } else { "" }
    )]
    SteeringWheel { column: &'static str, ratio: f64, degrees: bool },
}

impl CleanError {
    /// True for a log whose only fault is that it ended early.
    #[must_use]
    pub fn is_too_short(&self) -> bool {
        matches!(self, Self::NoRows { .. } | Self::TooShort { .. } | Self::ShortDrives { .. })
    }
}

/// Milliradians in a degree: the steering ratio that they look like.
const MILLIRADIANS: f64 = 17.453;

/// Words on columns of the opposite sign: one advice for all of a frame.
fn opposite(columns: &[&str], against: &[&str], tied: bool) -> String {
    let first = against.first().copied().unwrap_or_default();
    let is_along = |column: &&str| matches!(*column, "ax" | "accel_cmd" | "vx");
    let across = "steering, yaw, yaw_rate and ay are all positive to the left";
    let along = "ax and accel_cmd are positive where the vehicle gets faster";
    let rule = match columns.iter().filter(|column| is_along(column)).count() {
        _ if columns == ["x"] => {
            "yaw counts from the x axis to the y axis, which is to the left of it".to_owned()
        }
        0 => across.to_owned(),
        count if count == columns.len() => along.to_owned(),
        _ => format!("{across}, {along}"),
    };
    if let [column] = columns {
        let which = if tied {
            " (which of the two is wrong cannot be told from this log)"
        } else {
            ", and the other columns agree"
        };
        return format!(
            "{column} has the opposite sign of {first}{which}; {rule}: turn the sign of {column} (scripts/import_log.py can)"
        );
    }
    let is_steering = |columns: &[&str]| columns.iter().all(|column| column.starts_with("steer"));
    let (all, others) = (listed(columns), listed(against));
    let frame = if is_steering(columns) || is_steering(against) {
        "the steering is positive to one side and the motion to the other, as in a frame with y to the right and z down".to_owned()
    } else {
        "a sensor or a frame with y to the right and z down".to_owned()
    };
    let turn = if tied {
        format!("turn the signs of all of one group, {all} or {others}")
    } else {
        format!("turn the signs of all of {all}")
    };
    format!(
        "{all} have the opposite sign of {others}: {frame}? Here x is forward, y to the left and z up (ISO 8855), and {rule}: {turn} (scripts/import_log.py can)"
    )
}

fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
