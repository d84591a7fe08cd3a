//! Columns on an even clock, drive by drive; columns that tell nothing are left out.

use super::clean_log::{CleanError, CleanLog};
use super::clock::Clock;
use super::finding::{Finding, FindingSeverity};
use super::resample::{between, resample};
use super::rows::{LogColumns, WrongRows};
use std::collections::BTreeMap;
use std::ops::Range;

/// Time that the simulator needs after a gap to catch up with the vehicle, s.
pub(super) const SETTLING: f64 = 1.0;
/// Signals without which nothing can be compared.
const NEEDED: [&str; 4] = ["steer_cmd", "steer", "vx", "yaw_rate"];
/// Signals that may be constant.
const MAY_REST: [&str; 10] = [
    "vx",
    "accel_cmd",
    "steer_cmd",
    "curvature",
    "curvature_rate",
    "bank",
    "grade",
    "friction",
    "articulation",
    "articulation_rate",
];

/// Each drive on its even clock, one after the other.
pub(super) fn on_even_clocks(
    drives: &[Clock],
    spans: &[Range<usize>],
    columns: &LogColumns,
    commanded: bool,
    left_out: &WrongRows,
    findings: Vec<Finding>,
) -> Result<CleanLog, CleanError> {
    if let [drive] = drives {
        return on_even_clock(drive, columns, commanded, left_out, findings);
    }
    let (mut logs, mut first_error) = (Vec::new(), None);
    for (i, (drive, span)) in drives.iter().zip(spans).enumerate() {
        let part = columns.iter().map(|(&name, values)| (name, values[span.clone()].to_vec())).collect();
        match on_even_clock(drive, &part, commanded, left_out, Vec::new()) {
            Ok(log) => logs.push((format!("drive {}", i + 1), log)),
            Err(error) => first_error = first_error.or(Some(error)),
        }
    }
    let joined = CleanLog::joined(logs).ok().flatten();
    match (joined, first_error) {
        (Some(mut log), _) => {
            log.findings.splice(0..0, findings);
            Ok(log)
        }
        (None, error) => Err(error.unwrap_or(CleanError::NoRows { rows: 0 })),
    }
}

/// Interpolates all columns; leaves out uninformative ones.
fn on_even_clock(
    clock: &Clock,
    columns: &LogColumns,
    commanded: bool,
    left_out: &WrongRows,
    findings: Vec<Finding>,
) -> Result<CleanLog, CleanError> {
    let (first, last) = (clock.time[0], clock.time[clock.time.len() - 1]);
    let count = ((last - first) / clock.step + 1e-6).floor() as usize + 1;
    let time: Vec<f64> = (0..count).map(|k| first + clock.step * k as f64).collect();
    let mut log = CleanLog {
        step: clock.step,
        time,
        columns: BTreeMap::new(),
        commanded,
        valid: vec![true; count],
        coarse: BTreeMap::new(),
        findings,
    };
    for (&name, values) in columns {
        let needed = NEEDED.contains(&name) && (name != "steer" || !commanded);
        // What was left out was said.
        let said = left_out.get(name).map_or(0, Vec::len);
        let missing = values.iter().filter(|value| !value.is_finite()).count().saturating_sub(said);
        let resampled = resample(&clock.time, values, (first, clock.step, count), between(name));
        let guessed =
            resampled.as_ref().map_or(count, |column| column.guessed.iter().filter(|far| **far).count());
        let Some(resampled) = resampled.filter(|_| 2 * guessed < count) else {
            let share = 100.0 * (count - guessed) as f64 / count as f64;
            if needed {
                let about =
                    |it: &&Finding| it.signal.as_deref() == Some(name) && it.gravity > FindingSeverity::Note;
                let why = log.findings.iter().find(about).map(|finding| finding.summary.clone());
                return Err(CleanError::Sparse { column: name, share, why });
            }
            let words = format!("{name} holds a value in {share:.0} % of the time only, and is left out");
            log.find(FindingSeverity::Warning, name, words);
            continue;
        };
        let constant = resampled.values.iter().all(|value| *value == resampled.values[0]);
        if constant && !needed && !MAY_REST.contains(&name) {
            log.find(
                FindingSeverity::Warning,
                name,
                format!("{name} never changes, and is left out: is its sensor connected?"),
            );
            continue;
        }
        if missing > 0 {
            let seconds = guessed as f64 * clock.step;
            let gravity = if seconds > 0.0 { FindingSeverity::Warning } else { FindingSeverity::Note };
            let words = format!(
                "{missing} of {} values of {name} are missing or not finite; {seconds:.2} s lie in longer holes and are not judged",
                values.len()
            );
            log.find(gravity, name, words);
        }
        let settling = (SETTLING / clock.step).round() as usize;
        let mut wait = 0;
        for (valid, far) in log.valid.iter_mut().zip(&resampled.guessed) {
            wait = if *far { settling + 1 } else { wait.saturating_sub(1) };
            *valid &= wait == 0;
        }
        log.columns.insert(name, resampled.values);
    }
    Ok(log)
}
