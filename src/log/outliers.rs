//! Values that no motion explains: beyond any road vehicle, or single rows that their neighbours contradict.
//!
//! An outlier is one row or a few. The column leaves its way within one row and is back on it a few rows later. The
//! jump must far exceed the column's bends elsewhere, nearby and in the whole log. A step of steering does not come
//! back, noise is as large everywhere, and inertia takes longer.

use super::answered::{Answer, answers};
use super::clean_log::CleanError;
use super::finding::{Finding, FindingSeverity};
use super::rows::{LogColumns, LogRows, runs};
use crate::numerics::statistics::{median, quantile};
use crate::signal;
use std::ops::Range;

/// Number beyond every recorder's range in any unit: metres as nanometres, say.
const ABSURD: f64 = 1e12;
/// Stamps are counted in nanoseconds since 1970 at most.
const ABSURD_TIME: f64 = 1e20;
/// Longest outlier, rows, and s where rows come slowly.
pub(super) const LONGEST: usize = 5;
const LONGEST_TIME: f64 = 0.1;
/// Number of bends to each side of a row for its local scale.
pub(super) const AROUND: usize = 40;
/// Ratio of an outlier to the typical bend nearby.
pub(super) const LOCAL: f64 = 20.0;
/// Ratio of an outlier to the bend below which 95 % of the column's stay.
pub(super) const GLOBAL: f64 = 10.0;
/// Least size of an outlier, as a share of the column's spread: less changes no answer.
pub(super) const OF_SPREAD: f64 = 0.15;
/// Least size of an outlier, as a share of the signal's typical size: less is its resolution.
const RESOLUTION: f64 = 0.01;
/// Largest distance of the column from its earlier way after an outlier, as a share of the outlier.
const BACK: f64 = 0.25;
/// Largest share of outliers in the rows: more are the column's nature, or its end.
pub(super) const MOST: f64 = 0.01;
/// Outliers that are named.
const NAMED: usize = 4;

/// Least size of an outlier in a column that may jump: more than its whole spread.
pub(super) const WHOLE_SPREAD: f64 = 1.0;

/// Columns that are looked at, and the least outlier of each, as a share of its spread. A command may be anything; of a smaller one
/// the wheels are [asked](answers). Kerbs and holes in the road are honest accelerations. The spread of a position is that of the road.
pub(super) const MOVING: [(&str, f64); 19] = [
    ("steer_cmd", WHOLE_SPREAD),
    ("steer", OF_SPREAD),
    ("x", 0.0),
    ("y", 0.0),
    ("yaw", 0.0),
    ("vx", OF_SPREAD),
    ("vy", OF_SPREAD),
    ("yaw_rate", OF_SPREAD),
    ("ax", WHOLE_SPREAD),
    ("ay", WHOLE_SPREAD),
    ("roll", OF_SPREAD),
    ("articulation", OF_SPREAD),
    ("articulation_rate", OF_SPREAD),
    ("e1", OF_SPREAD),
    ("e1_rate", OF_SPREAD),
    ("e2", OF_SPREAD),
    ("e2_rate", OF_SPREAD),
    ("curvature", WHOLE_SPREAD),
    ("curvature_rate", WHOLE_SPREAD),
];

/// Numbers that are no measurement in any unit.
///
/// # Errors
/// The first of them, by row.
pub(super) fn absurd(columns: &LogColumns) -> Result<(), CleanError> {
    let mut worst: Option<(usize, &'static str, f64)> = None;
    let mut count = 0;
    for (&column, values) in columns {
        let most = if column == "time" { ABSURD_TIME } else { ABSURD };
        for (row, &value) in values.iter().enumerate() {
            if value.is_finite() && value.abs() > most {
                count += 1;
                if worst.is_none_or(|(first, ..)| row < first) {
                    worst = Some((row, column, value));
                }
            }
        }
    }
    match worst {
        Some((row, column, value)) => Err(CleanError::Absurd { column, row: row + 1, value, count }),
        None => Ok(()),
    }
}

/// Longest outlier of a log, rows.
pub(super) fn longest(log: &LogRows) -> usize {
    LONGEST.min(((LONGEST_TIME / log.spacing) as usize).max(1))
}

/// Least size of an outlier of a column.
pub(super) fn least_size(name: &str) -> f64 {
    RESOLUTION * signal::find(name).map_or(0.0, |signal| signal.nominal)
}

/// Outliers of the command: what the wheels do not answer, and, where they say nothing, what is larger than all else.
fn commands(log: &LogRows, longest: usize) -> Vec<usize> {
    let found = |of_spread| {
        let values = &log.columns["steer_cmd"];
        outliers(values, &log.spans, longest, (of_spread, least_size("steer_cmd")))
    };
    let candidates = found(OF_SPREAD);
    // A command may begin with a step.
    let within =
        |run: &Range<usize>| log.spans.iter().any(|span| span.start < run.start && run.end < span.end);
    let runs: Vec<Range<usize>> = runs(&candidates).filter(within).collect();
    let large = if runs.is_empty() { Vec::new() } else { found(WHOLE_SPREAD) };
    let answers = answers(log, &runs);
    let is_outlier = |(run, answer): &(Range<usize>, Answer)| match answer {
        Answer::None => true,
        Answer::Given => false,
        Answer::Unknown => large.contains(&run.start),
    };
    runs.into_iter().zip(answers).filter(is_outlier).flat_map(|(run, _)| run).collect()
}

/// Leaves out the outliers of all columns.
pub(super) fn leave_out(log: &mut LogRows) {
    let longest = longest(log);
    for (name, of_spread) in MOVING {
        let Some(values) = log.columns.get(name) else { continue };
        let least = least_size(name);
        let places = if name == "steer_cmd" {
            commands(log, longest)
        } else {
            outliers(values, &log.spans, longest, (of_spread, least))
        };
        if places.is_empty() || places.len() as f64 > MOST * values.len() as f64 {
            continue;
        }
        let in_file = |&place: &usize| {
            let row = log.in_file[place];
            (row, log.file.get(name).map_or(f64::NAN, |column| column[row]))
        };
        let named: Vec<(usize, f64)> = places.iter().map(in_file).collect();
        let words = format!(
            "{}: {} no motion explains {}; left out, like missing ones",
            listed(name, &named),
            if named.len() == 1 { "a value that stands alone and" } else { "values that stand alone and" },
            if named.len() == 1 { "it" } else { "them" },
        );
        log.find(FindingSeverity::Warning, name, words);
        log.leave_out(name, places);
    }
}

/// Values of a column with their rows, in words; rows are counted from 1, after the header.
pub(super) fn listed(name: &str, values: &[(usize, f64)]) -> String {
    let each: Vec<String> = values
        .iter()
        .take(NAMED)
        .map(|(row, value)| match value.abs() {
            size if size == 0.0 || (1e-3..1e6).contains(&size) => format!("{value:.4} in row {}", row + 1),
            _ => format!("{value:.3e} in row {}", row + 1),
        })
        .collect();
    let more = match values.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{name} = {}{more}", each.join(", "))
}

/// Distance of the row `at` from the middle of those `apart` rows before and after.
pub(super) fn bend(values: &[f64], at: usize, apart: usize) -> f64 {
    (values[at] - 0.5 * (values[at - apart] + values[at + apart])).abs()
}

/// Places of a column's outliers.
fn outliers(
    values: &[f64],
    spans: &[Range<usize>],
    longest: usize,
    (of_spread, least): (f64, f64),
) -> Vec<usize> {
    let finite: Vec<Vec<usize>> =
        spans.iter().map(|span| span.clone().filter(|&place| values[place].is_finite()).collect()).collect();
    let at = |share| quantile(values.to_vec(), share);
    let (Some(low), Some(high)) = (at(0.01), at(0.99)) else { return Vec::new() };
    let floor = least.max(of_spread * (high - low));
    // The scales of bends over one, two and three rows.
    let whole: Vec<Vec<f64>> =
        finite.iter().map(|places| places.iter().map(|&place| values[place]).collect()).collect();
    let scales: Vec<f64> = (1..=longest.div_ceil(2))
        .map(|apart| {
            let of = |column: &Vec<f64>| -> Vec<f64> {
                (apart..column.len().saturating_sub(apart)).map(|at| bend(column, at, apart)).collect()
            };
            quantile(whole.iter().flat_map(of).collect(), 0.95).unwrap_or(0.0)
        })
        .collect();
    // The first rows of a recording are often wrong; a command may begin with a step.
    let ends = of_spread < WHOLE_SPREAD;
    let mut found = Vec::new();
    for (column, places) in whole.iter().zip(&finite) {
        let end = column.len().saturating_sub(usize::from(!ends));
        let mut row = usize::from(!ends);
        while row < end {
            let length = (1..=longest.min(end - row)).find(|&length| {
                let apart = length.div_ceil(2);
                let least = floor.max(GLOBAL * scales[apart - 1]);
                stands_alone(column, row..row + length, least)
                    && smallest(column, row..row + length) > LOCAL * around(column, row, length, apart)
            });
            if let Some(length) = length {
                found.extend(&places[row..row + length]);
                row += length;
            }
            row += 1;
        }
    }
    found
}

/// The rows before and after a run. At an end of the column, where there is one of them only, the other follows from
/// the way behind that one. `None` where nothing tells it.
fn neighbours(column: &[f64], run: &Range<usize>) -> Option<(f64, f64)> {
    let span = run.len() + 1;
    let before = run.start.checked_sub(1).map(|row| column[row]);
    let after = column.get(run.end).copied();
    match (before, after) {
        (Some(before), None) => Some((before, 2.0 * before - column[(run.start - 1).checked_sub(span)?])),
        (None, Some(after)) => Some((2.0 * after - column.get(run.end + span)?, after)),
        (before, after) => before.zip(after),
    }
}

/// Least distance of rows from the line between their neighbours.
fn smallest(column: &[f64], run: Range<usize>) -> f64 {
    let Some((before, after)) = neighbours(column, &run) else { return 0.0 };
    let span = (run.len() + 1) as f64;
    let first = run.start;
    let line = |row: usize| before + (after - before) * (row + 1 - first) as f64 / span;
    run.map(|row| (column[row] - line(row)).abs()).fold(f64::INFINITY, f64::min)
}

/// True if rows leave the column's way at once by more than `least`, and are back at once.
fn stands_alone(column: &[f64], run: Range<usize>, least: f64) -> bool {
    let Some((before, after)) = neighbours(column, &run) else { return false };
    // Cheap, and true of nearly all rows.
    if (column[run.start] - before).abs() <= least || (column[run.end - 1] - after).abs() <= least {
        return false;
    }
    let size = smallest(column, run);
    size > least && (after - before).abs() < BACK * size
}

/// The typical bend near a run, without the run itself.
fn around(column: &[f64], row: usize, length: usize, apart: usize) -> f64 {
    let own = row.saturating_sub(apart)..row + length + apart;
    let (from, to) = (
        row.saturating_sub(AROUND).max(apart),
        (row + length + AROUND).min(column.len().saturating_sub(apart)),
    );
    let bends = (from..to).filter(|at| !own.contains(at)).map(|at| bend(column, at, apart));
    median(bends.collect()).unwrap_or(0.0)
}

/// Stamps that stand alone, set to not a number.
pub(super) fn stamps(stamps: &mut [f64], findings: &mut Vec<Finding>) {
    let steps = stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    let Some(step) = median(steps) else { return };
    let least = 50.0 * step;
    let alone = |row: usize| {
        let (before, now, after) = (stamps[row - 1], stamps[row], stamps[row + 1]);
        after > before && after - before < 5.0 * step && (now < before - least || now > after + least)
    };
    let places: Vec<usize> = (1..stamps.len().saturating_sub(1)).filter(|&row| alone(row)).collect();
    if places.is_empty() || places.len() as f64 > MOST * stamps.len() as f64 {
        return;
    }
    let named: Vec<(usize, f64)> = places.iter().map(|&row| (row, stamps[row])).collect();
    places.iter().for_each(|&row| stamps[row] = f64::NAN);
    let words = format!("{}: far from the stamps before and after; left out", listed("time", &named));
    findings.push(Finding::new(FindingSeverity::Warning, Some("time"), words));
}

/// Rows of a column that are impossible for a road vehicle, once its unit is known.
pub(super) fn impossible(name: &str, values: &[f64], factor: f64) -> Vec<usize> {
    let Some(signal) = signal::find(name) else { return Vec::new() };
    let (low, high) = signal.range;
    let outside = |value: &f64| value.is_finite() && !(low..=high).contains(&(factor * value));
    (0..values.len()).filter(|&row| outside(&values[row])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn found(values: &[f64]) -> Vec<usize> {
        outliers(values, std::slice::from_ref(&(0..values.len())), LONGEST, (OF_SPREAD, 0.0))
    }

    fn drive(noise: f64) -> Vec<f64> {
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..2000).map(|k| 0.3 * (0.01 * f64::from(k)).sin() + noise * (next() + next() + next())).collect()
    }

    #[test]
    fn rows_that_stand_alone_are_found_in_noise_and_without() {
        for noise in [0.0, 0.01] {
            assert!(found(&drive(noise)).is_empty());
            for length in 1..=LONGEST {
                for size in [-10.0, 1.0] {
                    let mut values = drive(noise);
                    values[700..700 + length].iter_mut().for_each(|value| *value += size);
                    assert_eq!(found(&values), (700..700 + length).collect::<Vec<_>>(), "{noise} {length}");
                }
            }
        }
    }

    #[test]
    fn the_ends_of_a_column_are_looked_at_unless_it_may_jump() {
        for length in 1..=LONGEST {
            for rows in [0..length, 2000 - length..2000] {
                let mut values = drive(0.01);
                values[rows.clone()].iter_mut().for_each(|value| *value += 3.0);
                assert_eq!(found(&values), rows.collect::<Vec<_>>());
                let span = std::slice::from_ref(&(0..2000));
                assert!(outliers(&values, span, LONGEST, (WHOLE_SPREAD, 0.0)).is_empty());
            }
        }
        // Of a quick way, the ends are no outliers.
        let way: Vec<f64> = (0..1000).map(|k| 0.5 * f64::from(k)).collect();
        assert!(found(&way).is_empty());
        assert!(found(&[0.0, 5.0]).is_empty() && found(&[]).is_empty());
    }

    #[test]
    fn steps_ramps_and_holds_are_honest() {
        let step: Vec<f64> = (0..1000).map(|k| f64::from(u8::from((300..600).contains(&k)))).collect();
        assert!(found(&step).is_empty());
        let held: Vec<f64> = (0..1000).map(|k| (0.3 * f64::from(k / 4)).sin()).collect();
        assert!(found(&held).is_empty());
        let pulse: Vec<f64> = (0..1000)
            .map(|k| if (500..520).contains(&k) { (f64::from(k - 500) * 0.157).sin() } else { 0.0 })
            .collect();
        assert!(found(&pulse).is_empty());
    }

    #[test]
    fn absurd_numbers_are_refused_with_their_place() {
        let sound = BTreeMap::from([("vx", vec![0.0, 0.0, f64::NAN])]);
        assert!(absurd(&sound).is_ok());
        let damaged = BTreeMap::from([("yaw_rate", vec![0.0, 1e308, 1.0]), ("vx", vec![0.0; 3])]);
        let error = absurd(&damaged).unwrap_err();
        assert!(error.to_string().contains("yaw_rate = 1e308 in row 2"), "{error}");
    }
}
