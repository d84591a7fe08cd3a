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
    grave.map(|finding| finding.summary.as_str()).collect::<Vec<_>>().join("; ")
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

#[test]
fn a_frame_as_a_whole_is_named_and_not_a_sign_of_it() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let refused = |case: &str, change: &dyn Fn(&mut Columns)| match changed(change) {
        Err(error) => error.to_string(),
        Ok(log) => panic!("{case}: {}", said(&log.findings)),
    };
    let compass = |columns: &mut Columns| {
        columns.get_mut("yaw").unwrap().iter_mut().for_each(|yaw| *yaw = quarter - *yaw);
    };
    let degrees = |columns: &mut Columns| {
        columns.get_mut("yaw").unwrap().iter_mut().for_each(|yaw| *yaw = 90.0 - yaw.to_degrees());
    };
    let swapped = |columns: &mut Columns| {
        let (x, y) = (columns["x"].clone(), columns["y"].clone());
        columns.insert("x", y);
        columns.insert("y", x);
    };
    let backwards = |columns: &mut Columns| {
        columns.get_mut("time").unwrap().iter_mut().for_each(|time| *time = 500.0 - *time);
    };
    for (case, change, words) in [
        ("compass", &compass as &dyn Fn(&mut Columns), "heading from north, clockwise"),
        ("compass in degrees", &degrees, "heading from north, clockwise"),
        ("x for y", &swapped, "x and y stand for one another"),
        ("a clock that counts down", &backwards, "time runs backwards"),
    ] {
        let error = refused(case, change);
        assert!(error.contains(words), "{case}: {error}");
    }
}

#[test]
fn a_clock_at_another_rate_is_told_by_two_relations() {
    for (rate, dropped) in
        [(48.0 / 50.0, &[][..]), (1.1, &[]), (0.9, &["ax"]), (1.15, &["yaw"]), (0.86, &["x", "y"])]
    {
        let log = changed(|columns| {
            columns.get_mut("time").unwrap().iter_mut().for_each(|time| *time *= rate);
            columns.retain(|name, _| !dropped.contains(name));
        })
        .unwrap();
        let words = &log.suspect().unwrap_or_else(|| panic!("{rate}: {}", said(&log.findings))).summary;
        assert!(words.contains("the clock runs at another rate"), "{rate}: {words}");
    }
    // A sensor's scale is in one relation.
    for (name, factor) in [("vx", 1.05), ("ax", 1.1), ("vx", 0.96), ("yaw_rate", 1.02)] {
        let log = changed(|columns| scale(columns, &[name], factor)).unwrap();
        assert!(log.suspect().is_none(), "{name} {factor}: {}", said(&log.findings));
    }
}

#[test]
fn a_wrong_scale_of_the_yaw_rate_is_said_and_is_no_clock() {
    for factor in [0.93, 1.05, 1.08, 1.15] {
        let log = changed(|columns| scale(columns, &["yaw_rate"], factor)).unwrap();
        let words = &log.suspect().unwrap_or_else(|| panic!("{factor}: {}", said(&log.findings))).summary;
        let (_, advice) = words.split_once("multiply yaw_rate by ").unwrap_or_else(|| panic!("{words}"));
        let by: f64 = advice.parse().unwrap();
        assert!(
            words.contains("the scale of yaw_rate") && (by * factor - 1.0).abs() < 0.01,
            "{factor}: {words}"
        );
    }
    // A bias, and an angle that comes late, are none.
    for change in [
        (|columns: &mut Columns| {
            columns.get_mut("yaw_rate").unwrap().iter_mut().for_each(|rate| *rate += 0.02);
        }) as fn(&mut Columns),
        |columns| {
            let yaw = columns.get_mut("yaw").unwrap();
            *yaw = (0..yaw.len()).map(|row| yaw[row.saturating_sub(5)]).collect();
        },
    ] {
        let log = changed(change).unwrap();
        assert!(log.suspect().is_none(), "{}", said(&log.findings));
    }
}

#[test]
fn a_clock_in_rare_units_is_read_where_the_way_agrees() {
    for (unit, words) in
        [(86_400.0, "days"), (3600.0, "hours"), (1e-7, "steps of 100 ns"), (1e-5, "steps of 0.01 ms")]
    {
        let log =
            changed(|columns| columns.get_mut("time").unwrap().iter_mut().for_each(|time| *time /= unit))
                .unwrap();
        assert!(said(&log.findings).contains(words), "{unit}: {}", said(&log.findings));
        assert!((log.step - 0.02).abs() < 1e-5, "{unit}: {}", log.step);
    }
    // Numbers of rows are no unit.
    let rows = changed(|columns| {
        columns.get_mut("time").unwrap().iter_mut().enumerate().for_each(|(row, time)| *time = row as f64);
    });
    let error = rows.unwrap_err().to_string();
    assert!(error.contains("one unit of the clock is") && error.contains("e-2 s"), "{error}");
}

/// `yaw_rate [deg/s]` over numbers in rad/s, and `yaw [deg]` over radians: the other columns tell.
#[test]
fn a_unit_that_the_file_names_wrongly_is_found_by_the_other_columns() {
    let sound = changed(|_| ()).unwrap();
    let degree = std::f64::consts::PI / 180.0;
    for (name, dropped) in [
        ("yaw_rate", &[][..]),
        ("yaw_rate", &["ay"]),
        ("yaw_rate", &["yaw", "x", "y"]),
        ("yaw", &[]),
        ("yaw", &["ay", "x", "y"]),
    ] {
        let mended = changed(|columns| {
            scale(columns, &[name], degree);
            columns.retain(|name, _| !dropped.contains(name));
        })
        .unwrap();
        let said = said(&mended.findings);
        assert!(said.contains(&format!("{name} ")) && mended.suspect().is_none(), "{name}: {said}");
        let close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-4 || a.is_nan();
        assert!(mended.columns[name].iter().zip(&sound.columns[name]).all(close), "{name}: {said}");
    }
    // Nothing tells: the turns are too slight to be driven.
    let alone = changed(|columns| {
        scale(columns, &["yaw_rate"], degree);
        columns.retain(|name, _| ["time", "steer_cmd", "vx", "yaw_rate"].contains(name));
    })
    .unwrap();
    assert!(
        alone.suspect().is_some_and(|finding| finding.summary.contains("yaw_rate")),
        "{:?}",
        alone.findings
    );
}
