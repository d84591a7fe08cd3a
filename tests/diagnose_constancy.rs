//! A value that changes is no effect of the library, whatever it looks like; one that does not change is no suspicion.

use crate::diagnose;

use diagnose::{found, log, singles};
use rfl_mpc::diagnose::{Cause, Report, VerdictKind};
use rfl_mpc::log::CleanLog;

/// The log with other commands: those that a vehicle must have had whose wheels turn `factor(row, angle)` as far as it is told.
fn commanded(log: &CleanLog, factor: impl Fn(usize, f64) -> f64) -> CleanLog {
    let mut other = log.clone();
    let rows = other.columns["steer_cmd"].iter().enumerate();
    let commands: Vec<f64> = rows.map(|(row, &angle)| angle / factor(row, angle)).collect();
    other.columns.insert("steer_cmd", commands);
    other
}

fn report(log: &CleanLog) -> Report {
    found(log, &singles()).report
}

#[test]
fn one_value_is_a_name() {
    let report = report(&log(3, &[("steer_gain", 1.15)]));
    assert_eq!(report.verdict.kind, VerdictKind::Effect, "{}", report.verdict.summary);
    assert_eq!(report.verdict.effects[0].id, "steer_gain");
    assert!((report.verdict.effects[0].value - 1.15).abs() < 0.03, "{}", report.verdict.effects[0].value);
    assert!(report.verdict.varying.is_none());
    assert!(report.posterior.unwrap().not_in_library < 0.1);
}

#[test]
fn a_ratio_that_varies_with_the_angle_is_none() {
    let log = log(3, &[]);
    let largest = log.columns["steer_cmd"].iter().fold(0.0, |most: f64, angle| most.max(angle.abs()));
    let report = report(&commanded(&log, |_, angle| 1.0 + 0.3 * angle.abs() / largest));
    assert_eq!(report.verdict.kind, VerdictKind::NotInLibrary, "{}", report.verdict.summary);
    let varying = report.verdict.varying.expect("a value that varies");
    assert_eq!(varying.id, "steer_gain", "{}", report.verdict.summary);
    assert!(matches!(varying.with, Cause::SteeringAngle | Cause::LateralAcceleration), "{varying:?}");
    assert!(report.verdict.summary.contains("its value changes with"), "{}", report.verdict.summary);
}

#[test]
fn a_ratio_that_changes_on_the_way_is_none() {
    let log = log(3, &[]);
    let half = log.time.len() / 2;
    let report = report(&commanded(&log, |row, _| if row < half { 1.0 } else { 1.2 }));
    assert_eq!(report.verdict.kind, VerdictKind::NotInLibrary, "{}", report.verdict.summary);
    let varying = report.verdict.varying.expect("a value that varies");
    // A ratio and the front tyres look alike; when it changed does not.
    assert!(
        ["steer_gain", "tyre_stiffness_front"].contains(&varying.id.as_str()),
        "{}",
        report.verdict.summary
    );
    assert_eq!(varying.with, Cause::Time, "{}", report.verdict.summary);
    // From 1 to 1.2 half way: a standard deviation of 0.1.
    assert!((0.05..0.15).contains(&varying.deviation), "{}", report.verdict.summary);
}
