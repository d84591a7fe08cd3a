//! A steering angle that a logging tool has smoothed with a moving average: said, left out or suspect, and no cause.

use crate::diagnose::{self, Columns, cleaned, columns, said};
use rfl_mpc::diagnose::VerdictKind;
use rfl_mpc::log::{DriveLog, FindingSeverity, SteeringLog};
use std::path::Path;

/// Means of so many rows, `after` of them behind.
fn smooth(columns: &mut Columns, name: &str, rows: usize, after: usize) {
    let values = columns.get_mut(name).unwrap();
    let old = values.clone();
    for (row, value) in values.iter_mut().enumerate() {
        let end = (row + 1 + after).min(old.len());
        let part = &old[end.saturating_sub(rows)..end];
        *value = part.iter().sum::<f64>() / part.len() as f64;
    }
}

/// A drive whose command has noise of its own, as of a controller with real sensors, or none.
fn drive(put_in: &[(&str, f64)], noise: f64) -> Columns {
    let mut columns = columns(7, put_in);
    let mut random = rfl_mpc::numerics::Random::new(5);
    for command in columns.get_mut("steer_cmd").unwrap() {
        *command += noise * (0..6).map(|_| random.uniform() - 0.5).sum::<f64>();
    }
    columns
}

#[test]
fn a_smoothed_angle_is_left_out_and_the_cause_is_named() {
    for (rows, after) in [(10, 0), (11, 5)] {
        let mut columns = drive(&[("steer_gain", 1.15)], 5e-4);
        smooth(&mut columns, "steer", rows, after);
        let log = cleaned(columns).unwrap();
        let words = said(&log.findings, "steer", FindingSeverity::Warning);
        assert!(words.contains(&format!("moving average of {rows} rows")), "{words}");
        assert!(!log.columns.contains_key("steer"));
        let verdict = diagnose::found(&log, &diagnose::singles()).report.verdict;
        assert_eq!(verdict.kind, VerdictKind::Effect, "{verdict:?}");
        assert_eq!(verdict.effects[0].id, "steer_gain", "{verdict:?}");
    }
}

#[test]
fn a_command_that_may_be_smoothed_with_it_is_suspect() {
    for (noise, smoothed) in [(0.0, &["steer"][..]), (5e-4, &["steer", "steer_cmd"])] {
        let mut columns = drive(&[], noise);
        smoothed.iter().for_each(|name| smooth(&mut columns, name, 10, 0));
        let log = cleaned(columns).unwrap();
        assert!(
            log.suspect().is_some_and(|finding| finding.summary.contains("moving average")),
            "{:?}",
            log.findings
        );
    }
    let mut columns = drive(&[], 5e-4);
    columns.remove("steer_cmd");
    smooth(&mut columns, "steer", 10, 0);
    assert!(cleaned(columns).unwrap().suspect().is_some());
    for noise in [0.0, 5e-4] {
        assert!(cleaned(drive(&[], noise)).unwrap().suspect().is_none());
    }
}

#[test]
fn an_actuator_is_not_identified_from_one_smoothed_column() {
    let identified = |smoothed: &[&str]| {
        let mut columns = drive(&[], 5e-4);
        smoothed.iter().for_each(|name| smooth(&mut columns, name, 10, 0));
        let columns = columns.into_iter().map(|(name, values)| (name.to_owned(), values)).collect();
        let log = DriveLog::from_columns(Path::new("log.csv"), columns).unwrap();
        SteeringLog::by_angle(&log, &|speed| 2.7 + 0.002 * speed * speed)
    };
    assert!(identified(&[]).is_ok() && identified(&["steer", "steer_cmd"]).is_ok());
    for name in ["steer", "steer_cmd"] {
        let error = identified(&[name]).unwrap_err().to_string();
        assert!(error.contains(&format!("{name} is a moving average of 10 rows")), "{error}");
    }
}
