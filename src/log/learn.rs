//! Training data of a residual: nine columns of a log, with missing ones made from others.
//!
//! A controller takes errors and road from the projection of the pose onto the path; a log without them gets them in
//! the same way.

use super::agreement::turn_factor;
use super::clean::check;
use super::clean_log::{CleanError, UnusableLog};
use super::clock::Clock;
use super::error::LogError;
use super::finding::FindingSeverity;
use super::late::taken_earlier;
use super::read::DriveLog;
use super::road::{FAR, follow};
use super::rows::LogColumns;
use crate::path::Path;
use crate::residual::Drive;
use crate::signal;
use std::path::PathBuf;

const NEEDED: &str = "time, steer_cmd (or steer), vx, and e1, e1_rate, e2, e2_rate, curvature, or else x, y, yaw, vy, \
                      yaw_rate and the road";

/// Columns that need the road.
const ERRORS: [&str; 5] = ["e1", "e1_rate", "e2", "e2_rate", "curvature"];
/// Columns from which they are computed.
const POSE: [&str; 6] = ["x", "y", "yaw", "vx", "vy", "yaw_rate"];

/// Error of a heading from which on it is in another unit, rad.
const ASTRAY: f64 = 1.0;
/// Distance from which on a vehicle is searched on the whole road again, m: the controller's, too.
const LOST: f64 = 14.0;

/// Reasons for which nothing is to be learned from a log.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// A column or the road.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A log that a diagnosis refuses, too.
    #[error(transparent)]
    Unusable(#[from] UnusableLog),
}

/// Columns of a log, checked.
struct CheckedRows {
    file: PathBuf,
    columns: LogColumns,
}

impl CheckedRows {
    fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.get(name).map(Vec::as_slice)
    }

    fn without(&self, names: &[&'static str]) -> Vec<&'static str> {
        names.iter().copied().filter(|name| !self.columns.contains_key(name)).collect()
    }
}

/// A log as drives to learn from, one for each start of its clock. It passes the check of a diagnosis, with the same
/// repairs. Repairs and computed columns are reported to `note`. `road` is the road driven and its file, `steering` as
/// for [`CleanLog::of`](super::CleanLog::of).
///
/// # Errors
/// A log that a diagnosis refuses; a missing column that cannot be computed; another road.
pub fn drives_of(
    log: &DriveLog,
    road: Option<(&Path, &std::path::Path)>,
    steering: &dyn Fn(f64) -> f64,
    note: &mut dyn FnMut(String),
) -> Result<Vec<Drive>, LearnError> {
    let file = &log.file;
    let columns: LogColumns = log.columns().map(|(name, values)| (name, values.to_vec())).collect();
    let checked = match check(&columns, false, steering, None) {
        Ok(checked) => checked,
        Err(CleanError::Missing { column, .. }) => {
            let near = log.like(column);
            return Err(LogError::Missing { file: file.clone(), column, needed: NEEDED, near }.into());
        }
        Err(cause) => return Err(UnusableLog::of(log, cause).into()),
    };
    if let Some(cause) = checked.errors {
        return Err(UnusableLog::of(log, cause).into());
    }
    if let Some(finding) = checked.log.suspect() {
        let cause = CleanError::Suspect { words: finding.summary.clone() };
        return Err(UnusableLog::of(log, cause).into());
    }
    log.notes.iter().chain(&log.warnings).for_each(|words| note(format!("{}: {words}", file.display())));
    for finding in checked.log.findings.iter().filter(|finding| finding.gravity > FindingSeverity::Note) {
        note(format!("{}: {}", file.display(), finding.summary));
    }
    let columns = checked.file.columns(&columns);
    let in_order = |stamps: &[f64]| {
        let stamps: Vec<f64> = stamps.iter().copied().filter(|stamp| stamp.is_finite()).collect();
        stamps.windows(2).all(|pair| pair[0] < pair[1])
    };
    let road = |note: &mut dyn FnMut(String), mut columns: LogColumns| {
        for (name, seconds) in &checked.late {
            let earlier = |column: &Vec<f64>| taken_earlier(&columns["time"], column, *seconds);
            if let Some(earlier) = columns.get(name).map(earlier) {
                columns.insert(name, earlier);
            }
        }
        drive_of(&CheckedRows { file: file.clone(), columns }, road, note)
    };
    match &checked.file.drives[..] {
        // Gaps are dealt with where windows are laid.
        [one] if one.factor == 1.0 && in_order(&columns["time"]) => Ok(vec![road(note, columns)?]),
        drives => {
            let part = |(i, drive): (usize, &Clock)| {
                let of = |column: &Vec<f64>| drive.rows.iter().map(|&row| column[row]).collect();
                let mut part: LogColumns = columns.iter().map(|(&name, column)| (name, of(column))).collect();
                part.insert("time", drive.time.clone());
                // What is made is made of all of them alike.
                let mut first = |words: String| {
                    if i == 0 {
                        note(words)
                    }
                };
                road(&mut first, part)
            };
            Ok(drives.iter().enumerate().map(part).collect::<Result<_, _>>()?)
        }
    }
}

/// A log as a drive to learn from; computed columns are reported to `note`.
fn drive_of(
    log: &CheckedRows,
    road: Option<(&Path, &std::path::Path)>,
    note: &mut dyn FnMut(String),
) -> Result<Drive, LogError> {
    let name = log.file.display().to_string();
    let missing =
        |column| LogError::Missing { file: log.file.clone(), column, needed: NEEDED, near: Vec::new() };
    let column = |name: &'static str| log.column(name).map(<[f64]>::to_vec).ok_or_else(|| missing(name));
    let mut drive = Drive { name, time: column("time")?, vx: column("vx")?, ..Drive::default() };
    drive.steer_cmd = match log.column("steer_cmd") {
        Some(command) => command.to_vec(),
        None => {
            let steer = log.column("steer").ok_or_else(|| missing("steer_cmd"))?;
            note(format!(
                "{}: there is no steer_cmd: the measured angle steer stands in, and delay and lag before it cannot be \
                 learned",
                drive.name
            ));
            steer.to_vec()
        }
    };
    let further = |name| log.column(name).map(<[f64]>::to_vec).unwrap_or_default();
    drive.articulation = further("articulation");
    drive.articulation_rate = further("articulation_rate");
    drive.bank = further(signal::BANK.name);
    drive.friction = further(signal::FRICTION.name);
    let absent = log.without(&ERRORS);
    let pose = log.without(&POSE);
    let all = [&absent[..], &log.without(&["curvature_rate"])].concat();
    match road {
        Some((road, file)) if !all.is_empty() && pose.is_empty() => {
            project(log, road, file, &mut drive)?;
            note(format!("{}: {} made by projection onto {}", drive.name, all.join(", "), file.display()));
        }
        Some(_) if !absent.is_empty() => {
            return Err(LogError::NoPose { file: log.file.clone(), columns: absent, pose });
        }
        None if !absent.is_empty() => {
            return Err(LogError::NoErrors { file: log.file.clone(), columns: absent, pose });
        }
        _ => {
            for (name, place) in ERRORS.into_iter().zip(errors_of(&mut drive)) {
                *place = column(name)?;
            }
            drive.curvature_rate = match log.column("curvature_rate") {
                Some(rate) => rate.to_vec(),
                None => {
                    let along =
                        if log.column("station").is_some() { "station" } else { "the way driven (vx)" };
                    note(format!("{}: curvature_rate made from curvature along {along}", drive.name));
                    curvature_rate(&drive, log.column("station"))
                }
            };
        }
    }
    Ok(drive)
}

/// The columns of [`ERRORS`].
fn errors_of(drive: &mut Drive) -> [&mut Vec<f64>; 5] {
    let Drive { e1, e1_rate, e2, e2_rate, curvature, .. } = drive;
    [e1, e1_rate, e2, e2_rate, curvature]
}

/// Fills errors and road of a drive from its poses.
fn project(
    log: &CheckedRows,
    road: &Path,
    file: &std::path::Path,
    drive: &mut Drive,
) -> Result<(), LogError> {
    let poses = POSE.map(|name| log.column(name).unwrap_or_default());
    check_turn(log, &drive.time, poses[2], poses[5])?;
    let (mut rows, mut far, mut astray) = (0_usize, 0_usize, 0_usize);
    let mut follow = follow(road, LOST);
    for row in 0..drive.time.len() {
        let [x, y, yaw, vx, vy, yaw_rate] = poses.map(|column| column[row]);
        if ![x, y, yaw, vx, vy, yaw_rate].into_iter().all(f64::is_finite) {
            errors_of(drive).into_iter().for_each(|column| column.push(f64::NAN));
            drive.curvature_rate.push(f64::NAN);
            continue;
        }
        let at = follow([x, y, yaw]);
        rows += 1;
        far += usize::from(at.e1.abs() > FAR);
        // A vehicle that stands or rolls back says nothing about directions.
        astray += usize::from(at.e2.abs() > ASTRAY && vx > 1.0);
        let (e1_rate, e2_rate) = at.error_rates(vx, vy, yaw_rate);
        let values = [at.e1, e1_rate, at.e2, e2_rate, at.curvature];
        errors_of(drive).into_iter().zip(values).for_each(|(column, value)| column.push(value));
        drive.curvature_rate.push(at.curvature_rate);
    }
    let share = |count: usize| 100.0 * count as f64 / rows.max(1) as f64;
    if 2 * far > rows {
        let (file, road) = (log.file.clone(), file.to_owned());
        return Err(LogError::FarFromRoad { file, road, limit: FAR, share: share(far) });
    }
    if 3 * astray > rows {
        return Err(LogError::Heading { file: log.file.clone(), limit: ASTRAY, share: share(astray) });
    }
    Ok(())
}

/// Checks that yaw and yaw rate agree; otherwise one of them has another unit or sign.
fn check_turn(log: &CheckedRows, time: &[f64], yaw: &[f64], yaw_rate: &[f64]) -> Result<(), LogError> {
    let Some(factor) = turn_factor(time, yaw, yaw_rate) else { return Ok(()) };
    let hint = match factor {
        factor if factor < 0.0 => "one of them has its sign turned: both are counter-clockwise",
        factor if factor > 10.0 => "yaw may be in degrees: give radians",
        factor if factor < 0.1 => "yaw_rate may be in degrees per second: give radians per second",
        _ => return Ok(()),
    };
    Err(LogError::Turn { file: log.file.clone(), factor, hint })
}

/// Rows on each side over which the change of curvature is taken: a difference of two rows would be mostly rounding.
const RATE_ROWS: usize = 3;
/// Least way for a change along it, m.
const LEAST_WAY: f64 = 1e-3;

/// Change of a drive's curvature along the way, 1/m2; 0 where the vehicle stands.
fn curvature_rate(drive: &Drive, station: Option<&[f64]>) -> Vec<f64> {
    let rows = drive.time.len();
    let driven = |i: usize| 0.5 * (drive.vx[i] + drive.vx[i + 1]) * (drive.time[i + 1] - drive.time[i]);
    // The station jumps at the end of a lap: there the way driven counts.
    let step = |i: usize| match station.map(|station| station[i + 1] - station[i]) {
        Some(step) if (step - driven(i)).abs() < 1.0 => step,
        _ => driven(i),
    };
    let mut way = vec![0.0; rows];
    for i in 1..rows {
        // A row that is not a number is left out later; the way goes on after it.
        let step = step(i - 1);
        way[i] = way[i - 1] + if step.is_finite() { step } else { 0.0 };
    }
    (0..rows)
        .map(|i| {
            let (from, to) = (i.saturating_sub(RATE_ROWS), (i + RATE_ROWS).min(rows - 1));
            let along = way[to] - way[from];
            let change = drive.curvature[to] - drive.curvature[from];
            if along.abs() < LEAST_WAY || !change.is_finite() { 0.0 } else { change / along }
        })
        .collect()
}
