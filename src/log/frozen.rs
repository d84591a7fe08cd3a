//! Stretches in which a sensor repeats its last value.
//!
//! A signal of a moving vehicle may rest for a while; when it moves again, it begins as it always moves. A frozen one jumps to
//! where the vehicle has gone meanwhile:
//!
//! ```text
//!     v[i] = v[i - 1] for 0.1 s and longer,   then |v[end] - v[end - 1]| > 6 x the 99th percentile of |v[i] - v[i - 1]|
//! ```
//!
//! A sensor that is held from sample to sample, each a tenth of a second or a second, jumps always: it is none. Nor is one of
//! a vehicle that stands, or one that has not moved before.

use super::clean_log::STANDING;
use super::finding::FindingSeverity;
use super::rows::{LogRows, repeats};
use crate::numerics::statistics::{median, quantile};
use std::ops::Range;

/// Sensors, and quantities in which a jump at the end can be told: an angle wraps.
const SENSORS: [&str; 9] = ["x", "y", "vx", "vy", "yaw_rate", "ax", "ay", "steer", "steer_cmd"];
/// Shortest stretch, s.
const SHORTEST: f64 = 0.1;
/// Jump at its end, over the 99th percentile of steps.
const JUMP: f64 = 6.0;

/// Leaves out frozen stretches of all sensors.
pub(super) fn leave_out(log: &mut LogRows) {
    leave_out_of(log, &SENSORS);
}

/// The same of the speed alone: from a value in the place of none, every unit would be told wrongly.
pub(super) fn leave_out_speeds(log: &mut LogRows) {
    leave_out_of(log, &["vx"]);
}

fn leave_out_of(log: &mut LogRows, names: &[&'static str]) {
    let shortest = log.lasting(SHORTEST, 3);
    let Some(vx) = log.columns.get("vx").cloned() else { return };
    let moves = |stretch: &Range<usize>| {
        median(vx[stretch.clone()].iter().map(|vx| vx.abs()).collect()).is_some_and(|vx| vx > STANDING)
    };
    for &name in names {
        let Some(values) = log.columns.get(name) else { continue };
        let may_jump = name.starts_with("steer");
        let of_span = |span: &Range<usize>| frozen(&values[span.clone()], shortest, span.start, may_jump);
        let found: Vec<(f64, Range<usize>)> = log
            .spans
            .iter()
            .flat_map(of_span)
            .filter(moves)
            .map(|stretch| (values[stretch.start], stretch))
            .collect();
        for (value, stretch) in found {
            let words = format!(
                "{name} stays at {value:.4} from row {} to row {} and jumps then: frozen; left out, like missing values",
                log.number(stretch.start),
                log.number(stretch.end - 1)
            );
            log.find(FindingSeverity::Warning, name, words);
            log.leave_out(name, stretch);
        }
    }
}

/// Frozen stretches of a column; `from` is the place of its first value. The value that stays was measured, if the column does not
/// jump to it as well. A column that may jump may also begin or end at rest.
fn frozen(values: &[f64], shortest: usize, from: usize, may_jump: bool) -> Vec<Range<usize>> {
    let steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let moving = steps.iter().copied().filter(|step| *step > 0.0).collect();
    let Some(usual) = quantile(moving, 0.99) else { return Vec::new() };
    let within = |stretch: &Range<usize>| !may_jump || stretch.start > 0 && stretch.end < values.len();
    let jumps = |row: usize| steps[row - 1] > JUMP * usual;
    let is_measured = |row: usize| row > 0 && !jumps(row);
    let is_frozen = |stretch: &Range<usize>| match stretch.end < values.len() {
        true => jumps(stretch.end),
        false => stretch.start > 0 && jumps(stretch.start),
    };
    repeats(values, 0..values.len(), shortest)
        .into_iter()
        .filter(|stretch| within(stretch) && is_frozen(stretch))
        .map(|stretch| from + stretch.start + usize::from(is_measured(stretch.start))..from + stretch.end)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(count: usize) -> Vec<f64> {
        (0..count).map(|i| (0.02 * i as f64).sin()).collect()
    }

    #[test]
    fn a_value_that_is_held_and_jumps_is_found() {
        let mut values = wave(1000);
        let held = values[300];
        values[300..340].fill(held);
        assert_eq!(frozen(&values, 20, 7, false), std::iter::once(308..347).collect::<Vec<_>>());
        values[300..340].fill(9.0);
        assert_eq!(frozen(&values, 20, 7, false), std::iter::once(307..347).collect::<Vec<_>>());
    }

    #[test]
    fn a_value_in_place_of_none_at_an_end_is_found_where_nothing_jumps() {
        let mut values = wave(1000);
        values[..40].fill(9.0);
        values[960..].fill(9.0);
        assert_eq!(frozen(&values, 20, 0, false), [0..40, 960..1000]);
        assert!(frozen(&values, 20, 0, true).is_empty());
    }

    #[test]
    fn rest_short_repeats_and_slow_sensors_are_no_fault() {
        let mut values = wave(1000);
        let held = values[300];
        values[300..310].fill(held);
        assert!(frozen(&values, 20, 0, false).is_empty());
        // A pause without a jump.
        let pause: Vec<f64> = (0..1000).map(|i| (0.02 * (i as f64 - 300.0).max(0.0)).sin()).collect();
        assert!(frozen(&pause, 20, 0, false).is_empty());
        let held: Vec<f64> = (0..1000).map(|i| (0.02 * f64::from(i / 50 * 50)).sin()).collect();
        assert!(frozen(&held, 20, 0, false).is_empty());
        assert!(frozen(&[1.0; 100], 20, 0, false).is_empty());
    }
}
