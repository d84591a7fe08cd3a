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
//! from row to row, and is left as it is.

use super::finding::FindingSeverity;
use super::rows::LogRows;
use crate::numerics::statistics::median;
use std::ops::Range;

/// Sensors whose motion goes on between the steps of their numbers.
const SENSORS: [&str; 8] =
    ["vx", "vy", "yaw", "yaw_rate", "steer", "roll", "articulation", "articulation_rate"];
/// Fewest steps that tell a resolution.
const FEWEST: usize = 20;
/// Share of rows in which a coarse number rests.
const RESTING: f64 = 0.6;
/// Share of its changes that are a single step, within [`EVEN`] of it.
const SINGLE: f64 = 0.9;
const EVEN: f64 = 0.01;
/// Step of a speed from which on what is left of it is told, as a share of the usual speed.
const COARSE: f64 = 0.01;

/// Lays lines through the steps of coarse numbers.
pub(super) fn mend(log: &mut LogRows) {
    for name in SENSORS {
        let Some(values) = log.columns.get_mut(name) else { continue };
        let Some(resolution) = resolution(values, &log.spans) else { continue };
        let usual = median(values.iter().map(|value| value.abs()).collect()).unwrap_or(0.0);
        log.spans.iter().for_each(|span| lay_lines(&mut values[span.clone()]));
        log.resolutions.insert(name, resolution);
        let words = format!("{name} is written in steps of {resolution:.4}: lines through them are taken");
        if name == "vx" && resolution > COARSE * usual {
            let words = format!("{words}; what is left of the steps may look like a cause that has no name");
            log.find(FindingSeverity::Warning, name, words);
        } else {
            log.find(FindingSeverity::Note, name, words);
        }
    }
}

/// Size of the single steps of a coarse column; `None` if it is none.
fn resolution(values: &[f64], spans: &[Range<usize>]) -> Option<f64> {
    let steps =
        spans.iter().flat_map(|span| values[span.clone()].windows(2)).map(|pair| (pair[1] - pair[0]).abs());
    let (changes, resting): (Vec<f64>, Vec<f64>) =
        steps.filter(|step| step.is_finite()).partition(|step| *step > 0.0);
    let rests = resting.len() as f64 >= RESTING * (resting.len() + changes.len()) as f64;
    let least = changes.iter().copied().fold(f64::INFINITY, f64::min);
    let single = changes.iter().filter(|step| **step < (1.0 + EVEN) * least).count();
    (changes.len() >= FEWEST && rests && single as f64 >= SINGLE * changes.len() as f64).then_some(least)
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
        let size = resolution(&values, &whole).unwrap();
        assert!((size - 1.0 / 3.6).abs() < 1e-9, "{size}");
        let before = error(&values);
        lay_lines(&mut values);
        assert!(error(&values) < 0.6 * before, "{} {before}", error(&values));
    }

    #[test]
    fn fine_noisy_and_held_numbers_are_left_as_they_are() {
        let whole = std::iter::once(0..4000).collect::<Vec<_>>();
        let none = |value: &dyn Fn(usize) -> f64| {
            assert_eq!(resolution(&(0..4000).map(value).collect::<Vec<_>>(), &whole), None);
        };
        none(&speed);
        none(&|row| (1e3 * speed(row)).round() / 1e3);
        none(&|row| (speed(row) + (1.7 * (row * row) as f64).sin()).round());
        none(&|row| speed(row / 50 * 50));
        none(&|_| 3.0);
    }
}
