//! Inertial sensors at the end of their range.
//!
//! The signal is cut off: it comes to its greatest (or least) value of the log with a step of the usual size, rests there, and leaves it
//! as suddenly, time and again. A vehicle's own motion comes to its greatest value ever more slowly; a coarsely written
//! number, or a sensor slower than its rows, rests anywhere.

use super::finding::FindingSeverity;
use super::rows::{LogRows, repeats};
use crate::numerics::statistics::median;
use std::ops::Range;

/// Sensors, and whether a log is of use without them.
const SENSORS: [(&str, bool); 3] = [("yaw_rate", false), ("ax", true), ("ay", true)];
/// Shortest rest, s.
const SHORTEST: f64 = 0.1;
/// Least steps at both ends of a rest, over the usual one.
const SUDDEN: f64 = 0.25;
/// Share of the rows beyond which a column tells more falsely than rightly what happens in bends.
const TOO_MANY: f64 = 0.05;

/// Leaves out what a sensor could not show; the column, where that is much.
pub(super) fn leave_out(log: &mut LogRows) {
    let shortest = log.lasting(SHORTEST, 3);
    for (name, optional) in SENSORS {
        let Some(values) = log.columns.get(name) else { continue };
        for limit in limits(values, &log.spans, shortest) {
            let values = &log.columns[name];
            let places: Vec<usize> = (0..values.len()).filter(|&i| values[i] == limit).collect();
            let column = optional && places.len() as f64 > TOO_MANY * values.len() as f64;
            let what = if column { "the column is left out" } else { "left out, like missing values" };
            let words = format!(
                "{name} is cut off at {limit:.4} in {} rows, the first of them row {}: the sensor's range ends there; {what}",
                places.len(),
                log.number(places[0])
            );
            log.find(FindingSeverity::Warning, name, words);
            if column {
                // Nor does a training learn from it.
                log.leave_out(name, 0..log.in_file.len());
                log.columns.remove(name);
                break;
            }
            log.leave_out(name, places);
        }
    }
}

/// Values at which a column is cut off, of its greatest and its least one.
fn limits(values: &[f64], spans: &[Range<usize>], shortest: usize) -> Vec<f64> {
    let rests = spans.iter().flat_map(|span| repeats(values, span.clone(), shortest));
    let rests: Vec<Range<usize>> = rests.collect();
    let steps = spans.iter().flat_map(|span| values[span.clone()].windows(2));
    let steps = steps.map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0).collect();
    let Some(usual) = median(steps) else { return Vec::new() };
    let is_sudden = |rest: &&Range<usize>| {
        let step = |a: usize, b: usize| (values[a] - values[b]).abs() > SUDDEN * usual;
        let within = spans.iter().any(|span| span.start < rest.start && rest.end < span.end);
        within && step(rest.start, rest.start - 1) && step(rest.end, rest.end - 1)
    };
    let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let (at_ends, elsewhere): (Vec<_>, Vec<_>) =
        rests.iter().partition(|rest| [greatest, least].contains(&values[rest.start]));
    let cut: Vec<f64> = at_ends.into_iter().filter(is_sudden).map(|rest| values[rest.start]).collect();
    // Once may be chance.
    if elsewhere.is_empty() && cut.len() >= 2 {
        [greatest, least].into_iter().filter(|end| cut.contains(end)).collect()
    } else {
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(value: impl Fn(f64) -> f64) -> Vec<f64> {
        let values: Vec<f64> = (0..1000).map(|i| value(0.02 * f64::from(i))).collect();
        limits(&values, &[0..500, 500..1000], 5)
    }

    #[test]
    fn a_signal_that_is_cut_off_is_found() {
        assert_eq!(found(|t| t.sin().clamp(-0.8, 0.7)), [0.7, -0.8]);
        assert_eq!(found(|t| t.sin().min(0.7)), [0.7]);
    }

    #[test]
    fn a_plateau_a_coarse_number_and_a_slow_sensor_are_none() {
        assert!(found(f64::sin).is_empty());
        // A steady turn that is entered as vehicles do.
        assert!(found(|t| (1e12 * (3.0 * t.sin()).tanh()).round() / 1e12).is_empty());
        assert!(found(|t| (20.0 * t.sin()).round()).is_empty());
        assert!(found(|t| (t * 5.0).floor().sin()).is_empty());
        assert!(found(|_| 1.0).is_empty());
        // Once only.
        assert!(found(|t| (0.3 * t).sin().min(0.9)).is_empty());
    }
}
