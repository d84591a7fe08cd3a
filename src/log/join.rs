//! Several logs of one vehicle as one: one after the other, and the clock jumps between them.
//!
//! Another kind of drive may answer a question that one drive leaves open. So a drive that a diagnosis has proposed
//! belongs beside the log for which it was proposed. More of the same adds little, as the model's form is wrong in the
//! same way again.

use super::clean_log::{CleanLog, Coarseness};
use super::finding::{Finding, FindingSeverity};
use super::resample::{between, resample};
use std::collections::{BTreeMap, BTreeSet};

/// The clock jumps by so much between two logs, s: a replay starts anew after a jump.
pub(super) const JUMP: f64 = 10.0;

/// Reasons for which logs cannot be joined.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum JoinError {
    #[error(
        "{with} has steer_cmd and {without} has the measured angle only; what lies before the sensor is seen in one of \
         them: diagnose them one by one, or take the column steer_cmd out of both"
    )]
    Commanded { with: String, without: String },
}

impl CleanLog {
    /// Logs of one vehicle with their names, one after the other: on the clock of the slowest, with the columns that all of
    /// them have.
    ///
    /// # Errors
    /// Some have the command and some do not.
    pub fn joined(mut logs: Vec<(String, Self)>) -> Result<Option<Self>, JoinError> {
        if logs.len() < 2 {
            return Ok(logs.pop().map(|(_, log)| log));
        }
        let of = |commanded| logs.iter().find(|(_, log)| log.commanded == commanded);
        if let (Some((with, _)), Some((without, _))) = (of(true), of(false)) {
            return Err(JoinError::Commanded { with: with.clone(), without: without.clone() });
        }
        let step = logs.iter().map(|(_, log)| log.step).fold(0.0, f64::max);
        let mut whole = Self {
            step,
            time: Vec::new(),
            columns: logs[0].1.columns.keys().map(|&name| (name, Vec::new())).collect(),
            commanded: logs[0].1.commanded,
            valid: Vec::new(),
            coarse: coarsest(&logs),
            findings: vec![together(&logs)],
        };
        let names: BTreeSet<&'static str> =
            logs.iter().flat_map(|(_, log)| log.columns.keys().copied()).collect();
        for name in names {
            if let Some((file, _)) = logs.iter().find(|(_, log)| !log.columns.contains_key(name)) {
                whole.columns.remove(name);
                let words = format!("{name} is not in {file}, and is left out of all logs");
                whole.find(FindingSeverity::Warning, name, words);
            }
        }
        for (file, log) in logs {
            let log = on_clock(log, step);
            let from = whole.time.last().map_or(0.0, |last| last + JUMP);
            let first = log.time.first().copied().unwrap_or(0.0);
            whole.time.extend(log.time.iter().map(|time| from + time - first));
            whole.valid.extend(log.valid);
            for (name, column) in log.columns {
                if let Some(all) = whole.columns.get_mut(name) {
                    all.extend(column);
                }
            }
            let of_file =
                |finding: Finding| Finding { summary: format!("{file}: {}", finding.summary), ..finding };
            whole.findings.extend(log.findings.into_iter().map(of_file));
        }
        whole.findings.sort_by_key(|finding| std::cmp::Reverse(finding.gravity));
        Ok(Some(whole))
    }
}

fn together(logs: &[(String, CleanLog)]) -> Finding {
    let each = logs.iter().map(|(file, log)| format!("{file} ({:.0} s)", log.time.len() as f64 * log.step));
    let words = format!("{} logs are taken as one: {}", logs.len(), each.collect::<Vec<_>>().join(", "));
    Finding::new(FindingSeverity::Note, None, words)
}

/// The coarsest numbers of each column.
fn coarsest(logs: &[(String, CleanLog)]) -> BTreeMap<&'static str, Coarseness> {
    let mut all = BTreeMap::new();
    for (&name, coarse) in logs.iter().flat_map(|(_, log)| &log.coarse) {
        let most = all.entry(name).or_insert(*coarse);
        if coarse.deviation > most.deviation {
            *most = *coarse;
        }
    }
    all
}

/// A log on a slower clock.
fn on_clock(log: CleanLog, step: f64) -> CleanLog {
    if (log.step / step - 1.0).abs() < 1e-9 {
        return log;
    }
    let count = ((log.time.len() - 1) as f64 * log.step / step + 1e-6) as usize + 1;
    let clock = (log.time[0], step, count);
    // Rows about a point of the slower clock.
    let about = |k: usize| {
        let row = (k as f64 * step / log.step) as usize;
        row..(row + 2).min(log.time.len())
    };
    CleanLog {
        step,
        time: (0..count).map(|k| clock.0 + step * k as f64).collect(),
        columns: log
            .columns
            .iter()
            .filter_map(|(&name, column)| {
                Some((name, resample(&log.time, column, clock, between(name))?.values))
            })
            .collect(),
        commanded: log.commanded,
        valid: (0..count).map(|k| log.valid[about(k)].iter().all(|valid| *valid)).collect(),
        coarse: log.coarse,
        findings: log.findings,
    }
}
