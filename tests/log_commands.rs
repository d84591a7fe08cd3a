//! Commands that are none: `accel_cmd` with another sign or unit or as another quantity, and commands that rest while somebody
//! else drives.

use crate::diagnose::{Columns, cleaned, columns, said};
use rfl_mpc::log::{CleanError, DriveLog, FindingSeverity, SteeringLog};
use std::path::Path;

fn scale(columns: &mut Columns, name: &str, factor: f64) {
    columns.get_mut(name).unwrap().iter_mut().for_each(|value| *value *= factor);
}

fn warned(columns: Columns, of: &str) -> (String, rfl_mpc::log::CleanLog) {
    let log = cleaned(columns).unwrap();
    (said(&log.findings, of, FindingSeverity::Warning), log)
}

#[test]
fn drives_with_effects_keep_their_command() {
    for (seed, put_in) in [
        (7, &[][..]),
        (8, &[("drive_gain", 0.7)]),
        (9, &[("drive_gain", 1.4)]),
        (7, &[("drive_lag", 1.0)]),
        (8, &[("payload", 800.0)]),
        (9, &[("road_grade", 0.06)]),
        (7, &[("drag", 3.0)]),
        (8, &[("steer_gain", 0.8)]),
        (9, &[("steer_lag", 0.4)]),
        (7, &[("steer_offset", 0.03)]),
    ] {
        for dropped in [&[][..], &["ax"], &["vy"], &["steer"], &["ax", "vy", "steer"]] {
            let mut log = columns(seed, put_in);
            log.retain(|name, _| !dropped.contains(name));
            let log = cleaned(log).unwrap();
            assert!(log.columns.contains_key("accel_cmd"), "{put_in:?} without {dropped:?}");
            for name in ["accel_cmd", "steer_cmd", "ax"] {
                let said = said(&log.findings, name, FindingSeverity::Warning);
                assert_eq!(said, "", "{put_in:?} without {dropped:?}");
            }
        }
    }
}

#[test]
fn an_asked_acceleration_with_the_other_sign_is_refused() {
    for dropped in [&[][..], &["ax"], &["vy"], &["ax", "vy", "x", "y"]] {
        let mut log = columns(11, &[]);
        scale(&mut log, "accel_cmd", -1.0);
        log.retain(|name, _| !dropped.contains(name));
        let error = cleaned(log).unwrap_err().to_string();
        assert!(error.contains("accel_cmd has the opposite sign"), "{dropped:?}: {error}");
        assert!(error.contains("positive where the vehicle gets faster"), "{error}");
    }
}

#[test]
fn an_asked_acceleration_in_g_is_converted() {
    for dropped in [&[][..], &["ax"], &["vy"]] {
        let sound = columns(12, &[]);
        let mut log = sound.clone();
        scale(&mut log, "accel_cmd", 1.0 / 9.80665);
        log.retain(|name, _| !dropped.contains(name));
        let (said, log) = warned(log, "accel_cmd");
        assert!(said.contains("taken as g and converted to m/s2"), "{dropped:?}: {said}");
        let pairs = log.columns["accel_cmd"].iter().zip(&sound["accel_cmd"]);
        assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 1e-6), "{dropped:?}");
    }
}

#[test]
fn what_is_no_acceleration_is_left_out_and_the_rest_judged() {
    for (what, factor) in [("per cent", 25.0), ("a torque", 450.0), ("a force", 1500.0), ("a pedal", 0.2)] {
        for dropped in [&[][..], &["ax"], &["vy"]] {
            let mut log = columns(13, &[]);
            scale(&mut log, "accel_cmd", factor);
            log.retain(|name, _| !dropped.contains(name));
            let (said, log) = warned(log, "accel_cmd");
            assert!(
                said.contains("give the asked acceleration in m/s2"),
                "{what} without {dropped:?}: {said}"
            );
            assert!(!log.columns.contains_key("accel_cmd") && log.suspect().is_none(), "{what}");
        }
    }
}

#[test]
fn an_asked_acceleration_that_never_changes_or_lacks_the_brakes_is_left_out() {
    for (what, change) in [
        ("all zero", &(|_: f64| 0.0) as &dyn Fn(f64) -> f64),
        ("constant", &|_| 0.4),
        ("the throttle alone", &|asked| asked.max(0.0)),
        ("the brakes alone", &|asked| asked.min(0.0)),
    ] {
        let mut log = columns(9, &[]);
        log.get_mut("accel_cmd").unwrap().iter_mut().for_each(|asked| *asked = change(*asked));
        let (said, log) = warned(log, "accel_cmd");
        assert!(said.contains("accel_cmd rests for"), "{what}: {said}");
        assert!(!log.columns.contains_key("accel_cmd") && log.suspect().is_none(), "{what}");
    }
}

#[test]
fn rows_in_which_a_command_rests_and_a_person_drives_are_not_judged() {
    for (name, from, to, dropped) in [
        ("accel_cmd", 500, 800, &[][..]),
        ("accel_cmd", 1200, 1500, &["ax"]),
        ("steer_cmd", 500, 900, &[]),
        ("steer_cmd", 800, 1300, &["steer"]),
        ("steer_cmd", 800, 1300, &["steer", "vy", "ax"]),
    ] {
        let mut log = columns(9, &[]);
        log.get_mut(name).unwrap()[from..to].fill(0.0);
        log.retain(|name, _| !dropped.contains(name));
        let (said, log) = warned(log, name);
        assert!(said.contains("someone else was in control"), "{name} without {dropped:?}: {said}");
        assert!(log.valid[from + 2..to + 40].iter().all(|valid| !valid), "{name} without {dropped:?}");
        assert!(log.valid[60..from - 5].iter().all(|valid| *valid), "{name} without {dropped:?}");
    }
}

/// A controller that is not engaged writes what was measured, in this row or the one before.
#[test]
fn rows_in_which_the_command_is_the_measured_angle_are_not_judged() {
    for late in [0, 1] {
        let mut log = columns(9, &[]);
        let angle = log["steer"].clone();
        log.get_mut("steer_cmd").unwrap()[500..900].copy_from_slice(&angle[500 - late..900 - late]);
        let (said, log) = warned(log, "steer_cmd");
        assert!(
            said.contains("is the measured angle") && said.contains("someone else was in control"),
            "{said}"
        );
        assert!(log.valid[502..940].iter().all(|valid| !valid), "{late}");
        assert!(log.valid[60..495].iter().all(|valid| *valid) && log.commanded, "{late}");
    }
}

#[test]
fn a_measured_angle_that_is_the_command_is_left_out() {
    for (factor, digits) in [(1.0, 1e9), (57.29578, 1e4), (1.0, 1e6)] {
        let mut log = columns(21, &[]);
        let copy = log["steer_cmd"].iter().map(|angle| (digits * factor * angle).round() / digits).collect();
        log.insert("steer", copy);
        let (said, log) = warned(log, "steer");
        assert!(said.contains("steer is a copy of steer_cmd"), "{factor} {digits}: {said}");
        assert!(!log.columns.contains_key("steer") && log.commanded && log.suspect().is_none());
    }
}

#[test]
fn a_command_that_rests_all_along_gives_way_to_the_measured_angle() {
    for value in [0.0, 0.02] {
        let mut log = columns(22, &[]);
        log.get_mut("steer_cmd").unwrap().fill(value);
        let (said, log) = warned(log, "steer_cmd");
        assert!(said.contains("steer_cmd rests for"), "{said}");
        assert!(
            !log.commanded && log.columns["steer_cmd"] == log.columns["steer"] && log.suspect().is_none()
        );
        let mut log = columns(22, &[]);
        log.get_mut("steer_cmd").unwrap().fill(value);
        log.remove("steer");
        let log = cleaned(log).unwrap();
        assert!(
            log.suspect().is_some_and(|it| it.summary.contains("someone else was in control")),
            "{value}"
        );
    }
}

#[test]
fn an_angle_before_its_command_is_refused() {
    let early = |rows: usize| {
        let mut log = columns(7, &[]);
        let command = log["steer_cmd"].clone();
        let late = log.get_mut("steer_cmd").unwrap();
        (0..late.len()).for_each(|row| late[row] = command[row.saturating_sub(rows)]);
        log
    };
    let mut swapped = columns(8, &[("steer_delay", 0.1)]);
    let (command, angle) = (swapped["steer_cmd"].clone(), swapped["steer"].clone());
    swapped.insert("steer_cmd", angle);
    swapped.insert("steer", command);
    for log in [early(10), early(25), swapped] {
        // An identification says the same.
        let named = log.iter().map(|(name, values)| ((*name).to_owned(), values.clone())).collect();
        let file = DriveLog::from_columns(Path::new("log.csv"), named).unwrap();
        let of_steering = SteeringLog::by_angle(&file, &|_| 2.7).unwrap_err();
        assert!(matches!(of_steering.cause, CleanError::Early { .. }), "{of_steering}");
        let error = cleaned(log).unwrap_err();
        assert!(matches!(error.cause, CleanError::Early { .. }), "{error}");
        assert!(error.to_string().contains("s before steer_cmd"), "{error}");
    }
    // A quick actuator is none, nor is one without any lateness.
    let mut log = columns(9, &[("steer_delay", 0.0), ("steer_lag", 0.0)]);
    assert!(cleaned(log.clone()).is_ok());
    let noisy =
        log["steer_cmd"].iter().enumerate().map(|(row, angle)| angle + 3e-4 * (7.3 * row as f64).sin());
    let noisy = noisy.collect();
    log.insert("steer", noisy);
    assert!(cleaned(log).is_ok());
    // A steering that swings in one rhythm is as late as it is early.
    let mut log = columns(9, &[]);
    for (name, late) in [("steer_cmd", 0.0), ("steer", 0.1)] {
        let swing = |time: &f64| 0.05 * (std::f64::consts::TAU * (time - late)).sin();
        let values = log["time"].iter().map(swing).collect();
        log.insert(name, values);
    }
    assert!(!cleaned(log).is_err_and(|error| matches!(error.cause, CleanError::Early { .. })));
}
