//! Numbers written in whole steps (km/h, degrees): the steps are measured from the values, and are noise, not a cause.

use crate::diagnose::{self, Columns, cleaned, columns, said};
use rfl_mpc::diagnose::VerdictKind;
use rfl_mpc::log::FindingSeverity;

/// Values in whole steps, and rounded once more as a tool does that converts them.
fn in_steps(columns: &mut Columns, name: &str, step: f64, digits: f64) {
    for value in columns.get_mut(name).unwrap() {
        *value = (digits * step * (*value / step).round()).round() / digits;
    }
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const KMH: f64 = 1.0 / 3.6;

#[test]
fn steps_are_told_from_the_values_in_any_unit() {
    for (name, step, digits) in [
        ("vx", KMH, 1e9),
        ("vx", KMH, 1e2),
        ("steer", DEGREE, 1e9),
        ("steer_cmd", DEGREE, 1e5),
        ("x", 1.0, 1e9),
        ("y", 0.5, 1e9),
        ("ax", 0.5, 1e9),
        ("ay", 1.0, 1e9),
    ] {
        let mut log = columns(7, &[]);
        in_steps(&mut log, name, step, digits);
        let log = cleaned(log).unwrap();
        let coarse = log.coarse[name];
        assert!((coarse.deviation * 12.0_f64.sqrt() / step - 1.0).abs() < 0.03, "{name}: {coarse:?}");
        assert!((0.02..5.0).contains(&coarse.lasting), "{name}: {coarse:?}");
        assert!(said(&log.findings, name, FindingSeverity::Note).contains("in steps of"), "{name}");
    }
    // In km/h altogether: the steps are converted with the speed.
    let mut log = columns(7, &[]);
    in_steps(&mut log, "vx", KMH, 1e9);
    log.get_mut("vx").unwrap().iter_mut().for_each(|vx| *vx *= 3.6);
    let coarse = cleaned(log).unwrap().coarse["vx"];
    assert!((coarse.deviation * 12.0_f64.sqrt() / KMH - 1.0).abs() < 0.01, "{coarse:?}");
    assert!(cleaned(columns(7, &[])).unwrap().coarse.is_empty());
}

#[test]
fn pulses_of_a_command_are_no_steps() {
    let mut log = columns(7, &[]);
    let command = log.get_mut("steer_cmd").unwrap();
    command
        .iter_mut()
        .enumerate()
        .for_each(|(row, value)| *value = if row / 40 % 2 == 0 { 0.05 } else { -0.05 });
    assert!(!cleaned(log).unwrap().coarse.contains_key("steer_cmd"));
}

#[test]
fn a_cause_is_named_behind_coarse_numbers_and_none_where_there_is_none() {
    for (put_in, names, step) in [
        (&[("steer_gain", 1.15)][..], &["vx"][..], KMH),
        (&[("steer_gain", 1.15)], &["steer"], DEGREE),
        (&[("steer_gain", 1.15)], &["x", "y"], 1.0),
        (&[], &["vx"], KMH),
        (&[], &["x", "y"], 1.0),
        (&[], &["ax", "ay"], 0.5),
    ] {
        let mut log = columns(7, put_in);
        names.iter().for_each(|name| in_steps(&mut log, name, step, 1e9));
        let report = diagnose::found(&cleaned(log).unwrap(), &diagnose::singles()).report;
        let kind = if put_in.is_empty() { VerdictKind::None } else { VerdictKind::Effect };
        assert_eq!(report.verdict.kind, kind, "{names:?}: {:?}", report.verdict);
        assert!(report.verdict.effects.iter().all(|effect| effect.id == put_in[0].0), "{:?}", report.verdict);
    }
}
