//! Measurements that were not measured: an angle that is the command, written a second time, and an acceleration that was computed.
//!
//! ```text
//!     steer = k steer_cmd + c, ay = k vx yaw_rate + c, to the digits of the file
//! ```
//!
//! Every actuator is late by something, and every sensor has noise. A copy has neither, and tells nothing of an actuator. A product
//! has no part of the sideways velocity's change, and would tell that the accelerometer is at another place.

use super::differences::noise;
use super::finding::FindingSeverity;
use super::rows::{LogRows, runs};
use crate::numerics::statistics::quantile;
use std::ops::Range;

/// Remainder of a copy, as a share of the angle's spread: the digits of a file. An actuator of 5 ms leaves more of slow steering.
const DIGITS: f64 = 1e-3;

/// Leaves out a `steer` that is a copy of `steer_cmd`, and an `ay` that was computed.
pub(super) fn leave_out(log: &mut LogRows) {
    for (name, words) in [("steer", copy(log)), ("ay", product(log))] {
        let Some(words) = words else { continue };
        log.find(FindingSeverity::Warning, name, format!("{words}; left out"));
        let all = 0..log.columns[name].len();
        log.leave_out(name, all);
        log.columns.remove(name);
    }
}

/// Words on an `ay` that is the product of speed and yaw rate with their noise. Without noise a simulation may have no sideways velocity.
fn product(log: &LogRows) -> Option<String> {
    let (vx, rate, ay) = (log.columns.get("vx")?, log.columns.get("yaw_rate")?, log.columns.get("ay")?);
    let turning: Vec<f64> = vx.iter().zip(rate).map(|(vx, rate)| vx * rate).collect();
    let spread = quantile(turning.iter().map(|value| value.abs()).collect(), 0.9)?;
    let is_noisy = noise(&turning, &log.spans)? > DIGITS * spread;
    (is_noisy && is_copy(&turning, ay)).then(|| {
        "ay is vx * yaw_rate, computed and not measured, and tells nothing besides them: give the accelerometer's".to_owned()
    })
}

/// Words on a `steer` that is a copy of `steer_cmd`.
pub(super) fn copy(log: &LogRows) -> Option<String> {
    let (command, angle) = (log.columns.get("steer_cmd")?, log.columns.get("steer")?);
    is_copy(command, angle).then(|| {
        "steer is a copy of steer_cmd, without any actuator's lateness or sensor's noise: give the measured angle (or, if steer_cmd was \
         written from the measured angle, delete steer_cmd)"
            .to_owned()
    })
}

/// Least length of a stretch in which the command is the angle, s, and least number of its changes there: angles in coarse steps
/// are the command's by chance.
const COPIED_FOR: f64 = 1.0;
const CHANGES: usize = 20;
/// Rows by which such a command is late: it is written when the angle has been read.
const LATE: usize = 2;
/// Difference of the same number, read twice and converted, rad.
const SAME: f64 = 1e-6;

/// Stretches in which the command is the angle that was measured, in that row or just before: a person drives, and a controller that
/// is not engaged writes that it asks for what is.
pub(super) fn stretches(command: &[f64], angle: &[f64], spacing: f64) -> Vec<Range<usize>> {
    let mut copied = vec![false; command.len()];
    for late in 0..=LATE {
        let is_same = |row: &usize| (command[*row] - angle[row - late]).abs() <= SAME;
        let mut row = late;
        while row < command.len() {
            let end = (row..command.len()).find(|row| !is_same(row)).unwrap_or(command.len());
            let changes =
                (row + 1..end).filter(|&row| (command[row] - command[row - 1]).abs() > SAME).count();
            if changes >= CHANGES && (end - row) as f64 * spacing >= COPIED_FOR {
                copied[row..end].fill(true);
            }
            row = end + 1;
        }
    }
    let rows: Vec<usize> = (0..copied.len()).filter(|&row| copied[row]).collect();
    runs(&rows).collect()
}

fn is_copy(command: &[f64], angle: &[f64]) -> bool {
    let pairs: Vec<(f64, f64)> = command
        .iter()
        .copied()
        .zip(angle.iter().copied())
        .filter(|(a, b)| a.is_finite() && b.is_finite())
        .collect();
    let count = pairs.len().max(1) as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (asked, given) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
    let xx = mean(&|pair| (pair.0 - asked).powi(2));
    let xy = mean(&|pair| (pair.0 - asked) * (pair.1 - given));
    let yy = mean(&|pair| (pair.1 - given).powi(2));
    // A negative remainder is one of rounding.
    xx > 0.0 && yy > 0.0 && yy - xy * xy / xx < DIGITS * DIGITS * yy
}

#[cfg(test)]
mod tests {
    use super::{is_copy, stretches};

    #[test]
    fn a_command_that_follows_the_angle_is_found_where_it_does() {
        let angle: Vec<f64> = (0..1000).map(|i| 0.1 * (0.01 * f64::from(i)).sin()).collect();
        let mut command: Vec<f64> = angle.iter().map(|angle| 1.1 * angle + 0.01).collect();
        assert!(stretches(&command, &angle, 0.01).is_empty());
        command[301..600].copy_from_slice(&angle[300..599]);
        let found = stretches(&command, &angle, 0.01);
        assert!(found.len() == 1 && found[0] == (301..600), "{found:?}");
        // For a moment, or while both stand.
        assert!(stretches(&command[..350], &angle[..350], 0.01).is_empty());
        assert!(stretches(&[0.1; 1000], &[0.1; 1000], 0.01).is_empty());
        // On a straight of a simulation, where both die away.
        let dying =
            |late: i32| (0..1000).map(|i| 5e-6 * (-0.01 * f64::from(i - late)).exp()).collect::<Vec<f64>>();
        assert!(stretches(&dying(0), &dying(12), 0.01).is_empty());
    }

    #[test]
    fn a_copy_is_told_from_a_quick_actuator_and_a_good_sensor() {
        let command: Vec<f64> = (0..2000).map(|i| 0.1 * (0.01 * f64::from(i)).sin()).collect();
        let digits = |value: f64| (value * 1e5).round() / 1e5;
        let degrees: Vec<f64> = command.iter().map(|angle| digits(57.29578 * angle)).collect();
        assert!(is_copy(&command, &command) && is_copy(&command, &degrees));
        let late: Vec<f64> = (0..2000).map(|i| 0.1 * (0.01 * (f64::from(i) - 0.5)).sin()).collect();
        assert!(!is_copy(&command, &late));
        let noisy: Vec<f64> =
            command.iter().enumerate().map(|(i, angle)| angle + 2e-4 * (7.3 * i as f64).sin()).collect();
        assert!(!is_copy(&command, &noisy));
        assert!(
            !is_copy(&[0.0; 100], &command[..100]) && !is_copy(&command, &[0.0; 2000]) && !is_copy(&[], &[])
        );
    }
}
