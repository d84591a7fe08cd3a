//! Numbers that are written more coarsely than the quantity moves.
//!
//! A speed in whole km/h rests and steps. Between, the quantity goes on: where the number steps from `a` to `b`, it passes
//! their middle,
//!
//! ```text
//!     v(t of the step) = (a + b) / 2,    on lines between;    where it turns back it comes to the number itself
//! ```
//!
//! Taken as it stands, it tells accelerations that nobody has felt. A finer number, or one with noise of more than a step, moves
//! from row to row, and is left as it is. What the lines leave open, a deviation of at most `step / sqrt(12)` that stays for as
//! long as the number rests, is handed on ([`Coarseness`]). Of a command no lines are taken: an actuator may get it in steps.

use super::clean_log::Coarseness;
use super::finding::FindingSeverity;
use super::rows::LogRows;
use crate::numerics::statistics::median;
use std::ops::Range;

/// Columns whose motion goes on between the steps of their numbers.
const COLUMNS: [&str; 13] = [
    COMMAND,
    "x",
    "y",
    "vx",
    "vy",
    "yaw",
    "yaw_rate",
    "ax",
    "ay",
    "steer",
    "roll",
    "articulation",
    "articulation_rate",
];
const COMMAND: &str = "steer_cmd";
/// Fewest steps that tell a resolution.
const FEWEST: usize = 20;
/// Share of rows in which a coarse number rests.
const RESTING: f64 = 0.6;
/// Share of its changes that are a single step, within [`EVEN`] of it: numbers may have been rounded once more in another unit.
const SINGLE: f64 = 0.9;
const EVEN: f64 = 0.1;
/// Fewest numbers that a command in steps takes: one of fewer was asked so, as a train of pulses.
const MANY: f64 = 5.0;

/// Lays lines through the steps of coarse numbers.
pub(super) fn mend(log: &mut LogRows) {
    for name in COLUMNS {
        let Some(values) = log.columns.get_mut(name) else { continue };
        let Some((step, rests)) = steps(values, &log.spans) else { continue };
        if name == COMMAND && levels(values, step) < MANY {
            continue;
        }
        let coarseness = Coarseness::of(step, rests * log.spacing);
        log.coarse.insert(name, coarseness);
        let unknown = if name == COMMAND {
            ": what lies between is not known"
        } else {
            log.spans.iter().for_each(|span| lay_lines(&mut values[span.clone()]));
            ""
        };
        let words = format!(
            "{name} is written in steps of {step:.4}, a standard deviation of {:.4}{unknown}",
            coarseness.deviation
        );
        log.find(FindingSeverity::Note, name, words);
    }
}

/// Number of steps between the least and the greatest number, and one.
fn levels(values: &[f64], step: f64) -> f64 {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (v.min(a), v.max(b)));
    1.0 + ((high - low) / step).round()
}

/// Size of the single steps of a coarse column, and the rows for which it usually rests; `None` if it is none.
fn steps(values: &[f64], spans: &[Range<usize>]) -> Option<(f64, f64)> {
    let (mut changes, mut rests) = (Vec::new(), Vec::new());
    for span in spans {
        for rest in values[span.clone()].chunk_by(|a, b| a == b || !(a.is_finite() && b.is_finite())) {
            rests.push(rest.len() as f64);
        }
        let all = values[span.clone()].windows(2).map(|pair| (pair[1] - pair[0]).abs());
        changes.extend(all.filter(|step| step.is_finite() && *step > 0.0));
    }
    let rows: f64 = rests.iter().sum();
    let resting = rows - changes.len() as f64;
    let least = changes.iter().copied().fold(f64::INFINITY, f64::min);
    let single: Vec<f64> = changes.iter().copied().filter(|step| *step < (1.0 + EVEN) * least).collect();
    let is_coarse = changes.len() >= FEWEST
        && resting >= RESTING * rows
        && single.len() as f64 >= SINGLE * changes.len() as f64;
    // Long rests count most: in them a number is off for longest.
    let usual = rests.iter().map(|rest| rest * rest).sum::<f64>() / rows;
    Some((median(single)?, usual)).filter(|_| is_coarse)
}

/// Lays lines through the middles of a column's steps. Between two that lead to a number and back it comes to the number itself.
fn lay_lines(values: &mut [f64]) {
    let steps = values.windows(2).enumerate().filter(|(_, pair)| (pair[1] - pair[0]).abs() > 0.0);
    let mut knots: Vec<(f64, f64)> = Vec::new();
    for (row, pair) in steps {
        let (place, middle) = (row as f64 + 0.5, 0.5 * (pair[0] + pair[1]));
        if let Some(&(before, value)) = knots.last()
            && value == middle
        {
            knots.push((0.5 * (before + place), pair[0]));
        }
        knots.push((place, middle));
    }
    for pair in knots.windows(2) {
        let [(from, a), (to, b)] = [pair[0], pair[1]];
        let first = from.ceil() as usize;
        for (row, value) in (first..).zip(&mut values[first..=to.floor() as usize]) {
            // A gap stays one.
            if value.is_finite() {
                *value = a + (b - a) * (row as f64 - from) / (to - from);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn speed(row: usize) -> f64 {
        15.0 + 6.0 * (0.004 * row as f64).sin() + 2.0 * (0.013 * row as f64).sin()
    }

    fn error(values: &[f64]) -> f64 {
        let squares = values.iter().enumerate().map(|(row, value)| (value - speed(row)).powi(2));
        (squares.sum::<f64>() / values.len() as f64).sqrt()
    }

    #[test]
    fn whole_kilometres_an_hour_tell_a_smooth_speed() {
        let mut values: Vec<f64> = (0..5000).map(|row| (3.6 * speed(row)).round() / 3.6).collect();
        let whole = std::iter::once(0..values.len()).collect::<Vec<_>>();
        let (size, rests) = steps(&values, &whole).unwrap();
        assert!((size - 1.0 / 3.6).abs() < 1e-9 && (5.0..200.0).contains(&rests), "{size} {rests}");
        let before = error(&values);
        lay_lines(&mut values);
        assert!(error(&values) < 0.6 * before, "{} {before}", error(&values));
    }

    #[test]
    fn fine_noisy_and_held_numbers_are_left_as_they_are() {
        let whole = std::iter::once(0..4000).collect::<Vec<_>>();
        let none = |value: &dyn Fn(usize) -> f64| {
            assert_eq!(steps(&(0..4000).map(value).collect::<Vec<_>>(), &whole), None);
        };
        none(&speed);
        none(&|row| (1e3 * speed(row)).round() / 1e3);
        none(&|row| (speed(row) + (1.7 * (row * row) as f64).sin()).round());
        none(&|row| speed(row / 50 * 50));
        none(&|_| 3.0);
    }
}
