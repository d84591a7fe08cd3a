//! Steering columns that a logging tool has smoothed with a moving average.
//!
//! A mean of `w` rows changes by what comes in and what goes out,
//!
//! ```text
//!     s[i] - s[i - 1] = (u[i] - u[i - w]) / w
//! ```
//!
//! so that the noise of `u`, which differences of a higher order leave, comes back `w` rows later with the other sign: their
//! correlation is -1/2 at `w` rows, 1/3 beside it, and -2/3 from row to row. No motion and no other filter does that. The mean is
//! `(w - 1) / 2` rows late if its rows lie before it, and not late if they lie on either side. The column does not say which, and a
//! steering that is late looks like a cause. Smoothed speeds, places and headings are told by their relations ([`super::late`]).

use super::differences::{Correlation, own_noise};
use super::finding::FindingSeverity;
use super::rows::LogRows;
use std::ops::Range;

/// Windows that are looked for, rows: shorter ones are late by less than what sensors differ by.
const WINDOWS: Range<usize> = 4..200;
/// Correlation of third differences from row to row, beside the window, and at it; and the distance within which it is that.
const NEXT: f64 = -2.0 / 3.0;
const BESIDE: f64 = 1.0 / 3.0;
const BACK: f64 = -0.5;
const NEARLY: f64 = 0.12;
/// Correlation over two rows from which on a column jumps to and fro.
const TO_AND_FRO: f64 = 0.6;
/// Fewest differences for each row of the longest window.
const FEWEST: usize = 10;

/// Leaves out a smoothed angle where the command's own noise says that it was not smoothed with it; else the log is suspect.
pub(super) fn leave_out(log: &mut LogRows) {
    let commanded = log.columns.contains_key("steer_cmd");
    let [command, angle] = ["steer_cmd", "steer"].map(|name| Some((name, window(log, name)?)));
    let Some((name, rows)) = command.or(angle) else { return };
    let said = words(log, name, rows);
    if !commanded || command.is_some() {
        let words = format!(
            "{said}. An effect would be taken for that, or that for an effect: give it as it was measured"
        );
        log.find(FindingSeverity::Suspicion, name, words);
    } else if own_noise(&log.columns["steer_cmd"], &log.spans).is_some() {
        log.find(FindingSeverity::Warning, name, format!("{said}: left out"));
        let all = 0..log.columns[name].len();
        log.leave_out(name, all);
        log.columns.remove(name);
    } else {
        let words = format!(
            "{said}. Was steer_cmd smoothed with it? That cannot be seen: give both as they were measured, or, if steer_cmd is, \
             delete the column steer"
        );
        log.find(FindingSeverity::Suspicion, name, words);
    }
}

/// A command and an angle of which one was smoothed, in words: the time between them is not that of an actuator.
pub(super) fn contradiction(log: &LogRows) -> Option<String> {
    let [command, angle] = ["steer_cmd", "steer"].map(|name| window(log, name));
    let (name, rows) = match (command, angle) {
        (None, Some(rows)) => ("steer", rows),
        (Some(rows), None) => ("steer_cmd", rows),
        _ => return None,
    };
    Some(format!(
        "{}, and the other column is not: the time between them is not the actuator's. Give both as they were measured",
        words(log, name, rows)
    ))
}

fn words(log: &LogRows, name: &str, rows: usize) -> String {
    let late = 0.5 * (rows - 1) as f64 * log.spacing;
    format!(
        "{name} is a moving average of {rows} rows, which a tool has made of it: up to {late:.3} s late, and without quick motion"
    )
}

/// Rows of the moving average that a column is.
fn window(log: &LogRows, name: &str) -> Option<usize> {
    window_of(log.columns.get(name)?, &log.spans)
}

fn window_of(values: &[f64], spans: &[Range<usize>]) -> Option<usize> {
    let correlation = Correlation::of(values, spans).filter(|it| it.at(2) < TO_AND_FRO)?;
    // The first that correlates at all beyond the difference itself: a held value does where it changes.
    let first = |apart: &usize| correlation.at(*apart).abs() > BESIDE - NEARLY;
    let rows = (WINDOWS.start - 1..WINDOWS.end.min(correlation.count() / FEWEST)).find(first)? + 1;
    let pattern = [(1, NEXT), (rows - 1, BESIDE), (rows, BACK), (rows + 1, BESIDE)];
    let is_told = pattern.iter().all(|&(apart, told)| (correlation.at(apart) - told).abs() < NEARLY);
    // And nothing comes back a second time, as of what recurs.
    let is_alone = (rows + 3..=2 * rows).all(|apart| !first(&apart));
    (is_told && is_alone).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;

    fn angle(noise: f64) -> Vec<f64> {
        let mut random = Random::new(3);
        let mut next = || (0..6).map(|_| random.uniform() - 0.5).sum::<f64>();
        (0..3000)
            .map(|row| {
                let time = 0.02 * f64::from(row);
                0.1 * (0.6 * time).sin() + 0.02 * (3.0 * time).sin() + noise * next()
            })
            .collect()
    }

    fn mean(values: &[f64], rows: usize, after: usize) -> Vec<f64> {
        let at = |row: usize| {
            let end = (row + 1 + after).min(values.len());
            let part = &values[end.saturating_sub(rows)..end];
            part.iter().sum::<f64>() / part.len() as f64
        };
        (0..values.len()).map(at).collect()
    }

    fn found(values: &[f64]) -> Option<usize> {
        window_of(values, std::slice::from_ref(&(0..values.len())))
    }

    #[test]
    fn a_moving_average_is_found_by_what_leaves_it() {
        for rows in [5, 10, 11, 50] {
            for after in [0, rows / 2] {
                let mut values = mean(&angle(5e-4), rows, after);
                values[700] += 0.3;
                assert_eq!(found(&values), Some(rows), "{rows} {after}");
            }
        }
    }

    #[test]
    fn what_is_measured_filtered_held_or_without_noise_is_none() {
        assert_eq!(found(&angle(5e-4)), None);
        let whole = std::iter::once(0..3000).collect::<Vec<_>>();
        // Six numbers between -1/2 and 1/2 have a standard deviation of the square root of a half.
        assert!((own_noise(&angle(5e-4), &whole).unwrap() / 5e-4 - 0.5_f64.sqrt()).abs() < 0.05);
        assert_eq!(own_noise(&angle(0.0), &whole), None);
        assert_eq!(own_noise(&mean(&angle(5e-4), 10, 0), &whole), None);
        assert_eq!(found(&angle(0.0)), None);
        assert_eq!(found(&mean(&angle(0.0), 10, 0)), None);
        let coarse: Vec<f64> = angle(5e-4).iter().map(|value| (200.0 * value).round() / 200.0).collect();
        assert_eq!(found(&coarse), None);
        let fine = angle(5e-4);
        // Held for some rows; for two and three in turn, as a command of 20 Hz in a log of 50 Hz.
        for (rows, of) in [(5, 1), (2, 1), (5, 2), (7, 3)] {
            let held: Vec<f64> = (0..fine.len()).map(|row| fine[row * of / rows * rows / of]).collect();
            assert_eq!(found(&held), None, "{rows} / {of}");
        }
        let lines: Vec<f64> = (0..fine.len())
            .map(|row| {
                let (from, share) = (row / 5 * 5, (row % 5) as f64 / 5.0);
                fine[from] + share * (fine[(from + 5).min(fine.len() - 1)] - fine[from])
            })
            .collect();
        assert_eq!(found(&lines), None);
        let recurring: Vec<f64> =
            (0..3000_u32).map(|row| f64::from(row % 89 * (row % 89) % 89) / 44.0 - 1.0).collect();
        assert_eq!(found(&recurring), None);
        let mut low = 0.0;
        let passed: Vec<f64> = fine
            .iter()
            .map(|value| {
                low += 0.2 * (value - low);
                low
            })
            .collect();
        assert_eq!(found(&passed), None);
    }
}
