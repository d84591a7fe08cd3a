//! Columns of one log in several units, and signs that only the motion tells: each column has a unit of its own.

use crate::diagnose;
use rfl_mpc::log::{CleanLog, DriveLog, Finding, FindingSeverity, UnusableLog};
use std::collections::BTreeMap;
use std::path::Path;

type Columns = BTreeMap<&'static str, Vec<f64>>;

/// A simulated drive with sensor noise, its columns changed.
fn changed(change: impl Fn(&mut Columns)) -> Result<CleanLog, UnusableLog> {
    let drive = diagnose::log(7, &[]);
    let mut columns = drive.columns.clone();
    columns.insert("time", drive.time.clone());
    change(&mut columns);
    let columns = columns.into_iter().map(|(name, values)| (name.to_owned(), values)).collect();
    let log = DriveLog::from_columns(Path::new("log.csv"), columns).unwrap();
    CleanLog::of(&log, &|speed| 2.7 + 0.002 * speed * speed)
}

fn said(findings: &[Finding]) -> String {
    let grave = findings.iter().filter(|finding| finding.gravity > FindingSeverity::Note);
    grave.map(|finding| finding.words.as_str()).collect::<Vec<_>>().join("; ")
}

fn scale(columns: &mut Columns, names: &[&'static str], factor: f64) {
    for name in names {
        columns.get_mut(name).unwrap().iter_mut().for_each(|value| *value *= factor);
    }
}

#[test]
fn each_column_is_converted_by_its_own_unit() {
    let sound = changed(|_| ()).unwrap();
    assert_eq!(said(&sound.findings), "");
    let without = ["x", "y"];
    for (case, names, factor, expected, dropped) in [
        ("km/h in vx alone", &["vx"][..] as &[&'static str], 3.6, "taken as km/h", &[][..]),
        ("mph in vx alone", &["vx"], 2.236_936, "taken as mph", &[]),
        ("ft/s in vx alone", &["vx"], 3.280_84, "taken as ft/s", &[]),
        ("km/h in both", &["vx", "vy"], 3.6, "vy is 3.", &[]),
        ("km/h in vy alone", &["vy"], 3.6, "taken as km/h", &[]),
        ("g in ax alone", &["ax"], 1.0 / 9.80665, "taken as g", &[]),
        ("g in ay alone", &["ay"], 1.0 / 9.80665, "taken as g", &[]),
        ("g in both", &["ax", "ay"], 1.0 / 9.80665, "ax is 0.1", &[]),
        ("km/h in vx alone, no place", &["vx"], 3.6, "taken as km/h", &without),
        ("km/h in both, no place", &["vx", "vy"], 3.6, "what ay tells", &without),
    ] {
        let mended = changed(|columns| {
            scale(columns, names, factor);
            columns.retain(|name, _| !dropped.contains(name));
        })
        .unwrap();
        let said = said(&mended.findings);
        assert!(said.contains(expected), "{case}: {said}");
        for name in ["vx", "vy", "ax", "ay"] {
            let close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-4 || a.is_nan();
            let same = mended.columns[name].iter().zip(&sound.columns[name]).all(close);
            assert!(same, "{case}: {name}, {said}");
        }
    }
}

#[test]
fn signs_of_vy_and_ax_are_those_of_the_motion() {
    for (turned, dropped) in [("vy", &[][..]), ("vy", &["x", "y"]), ("ax", &[])] {
        let error = changed(|columns| {
            scale(columns, &[turned], -1.0);
            columns.retain(|name, _| !dropped.contains(name));
        })
        .unwrap_err();
        assert!(error.to_string().contains(&format!("{turned} has the opposite sign")), "{error}");
    }
    // Of another point of the body, vy may well have the other sign in a bend.
    let moved = changed(|columns| {
        let rate = columns["yaw_rate"].clone();
        columns.get_mut("vy").unwrap().iter_mut().zip(rate).for_each(|(vy, rate)| *vy -= 1.6 * rate);
    });
    assert_eq!(said(&moved.unwrap().findings), "");
}

#[test]
fn gravity_in_the_lateral_acceleration_is_suspected() {
    let suspect =
        changed(|columns| columns.get_mut("ay").unwrap().iter_mut().for_each(|ay| *ay += 9.81)).unwrap();
    assert!(
        suspect.suspect().is_some() && said(&suspect.findings).contains("gravity"),
        "{}",
        said(&suspect.findings)
    );
}

#[test]
fn a_frozen_sensor_is_left_out_and_said() {
    for name in ["vx", "yaw_rate", "steer"] {
        let frozen = changed(|columns| {
            let values = columns.get_mut(name).unwrap();
            let most = values.iter().fold(0.0f64, |most, value| most.max(value.abs()));
            let held = values[750] + 0.5 * most;
            values[600..750].fill(held);
        });
        let said = said(&frozen.unwrap().findings);
        assert!(said.contains(&format!("{name} stays at")) && said.contains("row 601 to row 750"), "{said}");
    }
}
