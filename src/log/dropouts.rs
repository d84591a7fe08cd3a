//! One number in the place of none, for single rows or a few: 0 after a lost message, 65535 or -9999.
//!
//! A column falls to this number at once, stays there to the last bit, and is back about where it was a few rows later. A quantity that
//! passes the number on its way comes from one side of it and goes on to the other. What the column does otherwise is told by its
//! other rows alone, so that many such rows hide nothing.
//!
//! A command may fall to 0 and back in earnest: [the wheels answer](super::answered) then.

use super::answered::{Answer, answers};
use super::finding::{Finding, FindingSeverity};
use super::outliers::{
    AROUND, GLOBAL, LOCAL, LONGEST, MOVING, OF_SPREAD, WHOLE_SPREAD, bend, least_size, longest,
};
use super::rows::{LogColumns, LogRows, WrongRows};
use crate::numerics::statistics::{median, quantile};
use std::ops::Range;

/// Largest share of such rows: more are the column's nature.
pub(super) const MOST: f64 = 0.5;
/// Ratio of a fall to the column's bends where others are sure, or where the wheels are asked.
const LESS: f64 = 3.0;
/// Least fall of a column that is written in steps, in steps: one or two down and up again are its last digit.
const STEPS: f64 = 2.5;
/// Share of an angle's range from which on a fall is a full turn.
const TURN: f64 = 0.9;

/// Rows of one value in the place of none.
#[derive(Debug, Clone, PartialEq)]
struct Fall {
    places: Range<usize>,
    /// Distance of the value from those before and after.
    size: f64,
    /// Greater one of the magnitudes before and after.
    beside: f64,
    /// True where it needs no others, and no answer.
    is_sure: bool,
}

/// Leaves out what stands in the place of none.
pub(super) fn leave_out(log: &mut LogRows) {
    for (name, of_spread) in MOVING.into_iter().filter(|(name, _)| *name != "steer_cmd") {
        let Some(values) = log.columns.get(name) else { continue };
        for value in numbers(values, of_spread < WHOLE_SPREAD) {
            let falls = falls(log, name, value);
            if falls.iter().any(|fall| fall.is_sure) {
                leave_out_falls(log, name, value, &falls);
            }
        }
    }
    let Some(command) = log.columns.get("steer_cmd") else { return };
    for value in numbers(command, true) {
        let mut falls = falls(log, "steer_cmd", value);
        let runs: Vec<Range<usize>> = falls.iter().map(|fall| fall.places.clone()).collect();
        let answers = answers(log, &runs);
        if answers.contains(&Answer::None) {
            let mut answers = answers.iter();
            falls.retain(|_| answers.next() != Some(&Answer::Given));
            leave_out_falls(log, "steer_cmd", value, &falls);
        }
    }
}

/// Leaves out rows of a file that hold zeros alone, in which the speed falls, too.
pub(super) fn leave_out_rows(
    columns: &mut LogColumns,
    left_out: &mut WrongRows,
    findings: &mut Vec<Finding>,
) {
    let Some(vx) = columns.get("vx") else { return };
    let falls = falls_of(vx, std::slice::from_ref(&(0..vx.len())), LONGEST, 0.0, least_size("vx"), true);
    if !falls.iter().any(|fall| fall.is_sure) {
        return;
    }
    let is_empty = |row: &usize| columns.values().all(|column| column[*row].is_nan() || column[*row] == 0.0);
    let rows: Vec<usize> = falls.iter().flat_map(|fall| fall.places.clone()).filter(is_empty).collect();
    let Some(first) = rows.first() else { return };
    let words = format!(
        "all columns are 0 in {}, between rows at speeds of up to {:.4}: the recorder had no data; left out, like missing ones",
        rows_from(rows.len(), first + 1),
        greatest(&falls)
    );
    findings.push(Finding::new(FindingSeverity::Warning, Some("vx"), words));
    for (&name, column) in columns {
        let known = rows.iter().copied().filter(|&row| column[row].is_finite()).collect::<Vec<_>>();
        known.iter().for_each(|&row| column[row] = f64::NAN);
        left_out.entry(name).or_default().extend(known);
    }
}

/// Leaves out falls, and says so.
fn leave_out_falls(log: &mut LogRows, name: &'static str, value: f64, falls: &[Fall]) {
    let places: Vec<usize> = falls.iter().flat_map(|fall| fall.places.clone()).collect();
    let words = format!(
        "{name} is {value} in {}, between values of up to {:.4}: a dropout, no measurement; left out, like missing ones",
        rows_from(places.len(), log.number(places[0])),
        greatest(falls)
    );
    log.find(FindingSeverity::Warning, name, words);
    log.leave_out(name, places);
}

fn greatest(falls: &[Fall]) -> f64 {
    falls.iter().map(|fall| fall.beside).fold(0.0, f64::max)
}

fn rows_from(count: usize, first: usize) -> String {
    match count {
        1 => format!("row {first}"),
        _ => format!("{count} rows, the first of them row {first}"),
    }
}

/// Numbers that may stand for none: 0, and of a column that no road shakes the greatest and the least one.
fn numbers(values: &[f64], ends: bool) -> Vec<f64> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let least = finite().fold(f64::INFINITY, f64::min);
    let greatest = finite().fold(f64::NEG_INFINITY, f64::max);
    let ends = [least, greatest].into_iter().filter(|value| ends && *value != 0.0);
    std::iter::once(0.0).chain(ends).collect()
}

/// Falls of a column to a value; none where they are its nature, or where a number that is not 0 comes once.
fn falls(log: &LogRows, name: &'static str, value: f64) -> Vec<Fall> {
    let Some(values) = log.columns.get(name) else { return Vec::new() };
    let mut found = falls_of(values, &log.spans, longest(log), value, least_size(name), name != "steer_cmd");
    if name == "yaw" {
        let of = |share| quantile(values.clone(), share).unwrap_or_default();
        let turn = of(1.0) - of(0.0);
        found.retain(|fall| fall.size < TURN * turn);
    }
    if value != 0.0 && found.len() < 2 {
        return Vec::new();
    }
    let count: usize = found.iter().map(|fall| fall.places.len()).sum();
    if count as f64 > MOST * values.len() as f64 { Vec::new() } else { found }
}

/// The same of values in spans. `ends`: the first rows and the last ones may be a fall, too.
fn falls_of(
    values: &[f64],
    spans: &[Range<usize>],
    longest: usize,
    value: f64,
    least: f64,
    ends: bool,
) -> Vec<Fall> {
    if !values.contains(&value) {
        return Vec::new();
    }
    // The column's other rows.
    let others = |span: &Range<usize>| -> Vec<usize> {
        span.clone().filter(|&place| values[place].is_finite() && values[place] != value).collect()
    };
    let others: Vec<Vec<usize>> = spans.iter().map(others).collect();
    let ways: Vec<Vec<f64>> =
        others.iter().map(|places| places.iter().map(|&place| values[place]).collect()).collect();
    let at = |share| quantile(ways.concat(), share).unwrap_or_default();
    let floor = OF_SPREAD * (at(0.99) - at(0.01));
    let steps = ways.iter().flat_map(|way| way.windows(2)).map(|pair| (pair[1] - pair[0]).abs());
    let step = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    let least = least.max(if step.is_finite() { STEPS * step } else { 0.0 });
    let scale = |apart: usize| {
        let of = |way: &Vec<f64>| -> Vec<f64> {
            (apart..way.len().saturating_sub(apart)).map(|at| bend(way, at, apart)).collect()
        };
        quantile(ways.iter().flat_map(of).collect(), 0.95).unwrap_or(0.0)
    };
    let scales: Vec<f64> = (1..=longest.div_ceil(2)).map(scale).collect();
    let mut found = Vec::new();
    for ((span, places), way) in spans.iter().zip(&others).zip(&ways) {
        for next in 0..=places.len() {
            let from = next.checked_sub(1).map_or(span.start, |last| places[last] + 1);
            let to = places.get(next).copied().unwrap_or(span.end);
            let mut run = (from..to).filter(|&place| values[place] == value);
            let Some(first) = run.next() else { continue };
            let run = first..run.next_back().unwrap_or(first) + 1;
            let (before, after) = (next.checked_sub(1).map(|last| way[last]), way.get(next).copied());
            let is_end = before.is_none() || after.is_none();
            let Some((before, after)) = before.or(after).zip(after.or(before)) else { continue };
            let size = (before - value).abs().min((after - value).abs());
            let is_back = (after - before).abs() < size && (before - value) * (after - value) > 0.0;
            if run.len() > longest || !is_back || size <= least || (is_end && !ends) {
                continue;
            }
            let apart = run.len().div_ceil(2);
            let around =
                next.saturating_sub(AROUND).max(apart)..(next + AROUND).min(way.len().saturating_sub(apart));
            let near = median(around.map(|at| bend(way, at, apart)).collect()).unwrap_or(0.0);
            if size > LESS * scales[apart - 1].max(near) {
                let is_sure = size > floor.max(GLOBAL * scales[apart - 1]).max(LOCAL * near);
                let beside = before.abs().max(after.abs());
                found.push(Fall { places: run, size, beside, is_sure });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places of the falls to 0.
    fn found(values: &[f64]) -> Vec<usize> {
        let falls = falls_of(values, std::slice::from_ref(&(0..values.len())), 5, 0.0, 0.0, true);
        falls.into_iter().flat_map(|fall| fall.places).collect()
    }

    fn speed(row: usize) -> f64 {
        11.0 + 2.0 * (0.01 * row as f64).sin() + 0.01 * (1.7 * row as f64).sin()
    }

    #[test]
    fn falls_are_found_however_many_there_are() {
        for every in [7, 40, 1900] {
            for length in 1..=5 {
                let is_fall = |row: usize| row % every < length;
                let values: Vec<f64> =
                    (0..2000).map(|row| if is_fall(row) { 0.0 } else { speed(row) }).collect();
                assert_eq!(found(&values), (0..2000).filter(|&row| is_fall(row)).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn what_passes_the_value_or_rests_there_is_no_fall() {
        let wave = |row: usize| {
            if row.is_multiple_of(25) { 0.0 } else { (std::f64::consts::TAU * row as f64 / 50.0).sin() }
        };
        let wave: Vec<f64> = (0..2000).map(wave).collect();
        assert!(found(&wave).is_empty());
        let standing: Vec<f64> = (0..2000).map(|row| if row % 200 < 6 { 0.0 } else { speed(row) }).collect();
        assert!(found(&standing).is_empty());
        // Steps of a tenth: one or two of them down are the last digit, three are a fall.
        let digits: Vec<f64> = (0..2000)
            .map(|row| 0.1 * ((row / 300) as f64 - 1.0) * f64::from(u8::from(row % 97 != 0)))
            .collect();
        let large: Vec<usize> = (1200..2000).filter(|row| row % 97 == 0).collect();
        assert_eq!(found(&digits), large);
    }
}
