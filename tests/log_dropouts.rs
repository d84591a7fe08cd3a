//! Rows that hold one number in the place of none: 0, or a placeholder such as 65535.

use crate::diagnose::{Columns, cleaned, columns, said};
use rfl_mpc::log::{CleanLog, FindingSeverity};
use std::collections::BTreeMap;

/// Largest difference of a column from that of the sound log, where it is judged.
fn apart(log: &CleanLog, sound: &CleanLog, name: &str) -> f64 {
    let pairs = log.columns[name].iter().zip(&sound.columns[name]).zip(&log.valid);
    pairs.filter(|(_, valid)| **valid).map(|((a, b), _)| (a - b).abs()).fold(0.0, f64::max)
}

fn greatest(column: &[f64]) -> f64 {
    column.iter().fold(0.0, |most, value| most.max(value.abs()))
}

/// Rows in which the command is far from 0, each `every` of them, and the rows after each.
fn falls(columns: &Columns, every: usize, length: usize) -> Vec<usize> {
    let command = &columns["steer_cmd"];
    let least = 0.4 * greatest(command);
    let bends: Vec<usize> = (50..command.len() - 50).filter(|&row| command[row].abs() > least).collect();
    bends.iter().step_by(every).flat_map(|&row| row..row + length).collect()
}

fn warned(log: &CleanLog, name: &str) -> String {
    said(&log.findings, name, FindingSeverity::Warning)
}

#[test]
fn a_command_that_falls_to_zero_in_bends_is_left_out() {
    let sound = cleaned(columns(7, &[])).unwrap();
    for (every, length) in [(100_000, 1), (60, 1), (60, 3), (60, 5)] {
        for response in ["steer", "yaw_rate"] {
            let mut log = columns(7, &[]);
            if response == "yaw_rate" {
                log.remove("steer");
            }
            for row in falls(&log, every, length) {
                log.get_mut("steer_cmd").unwrap()[row] = 0.0;
            }
            let log = cleaned(log).unwrap();
            assert!(warned(&log, "steer_cmd").contains("steer_cmd is 0 in"), "{every} {length} {response}");
            let most = 0.3 * greatest(&sound.columns["steer_cmd"]);
            assert!(apart(&log, &sound, "steer_cmd") < most, "{every} {length} {response}");
        }
    }
}

#[test]
fn a_command_to_which_the_wheels_answer_is_kept() {
    for (every, length) in [(100_000, 1), (60, 1), (60, 3), (60, 4)] {
        let mut log = columns(7, &[]);
        let before = log["steer_cmd"].clone();
        for row in falls(&log, every, length) {
            log.get_mut("steer_cmd").unwrap()[row] = 0.0;
        }
        // The actuator: what it is asked for comes a little later.
        let command = log["steer_cmd"].clone();
        let (mut late, mut state) = (Vec::new(), 0.0);
        for (now, was) in command.iter().zip(&before) {
            state += 0.2 * (now - was - state);
            late.push(state);
        }
        log.get_mut("steer").unwrap().iter_mut().zip(&late).for_each(|(angle, more)| *angle += more);
        let log = cleaned(log).unwrap();
        assert_eq!(warned(&log, "steer_cmd"), "", "{every} {length}");
        assert_eq!(log.columns["steer_cmd"], command, "{every} {length}");
    }
}

#[test]
fn many_rows_of_one_number_are_left_out_and_named() {
    let sound = cleaned(columns(8, &[])).unwrap();
    for (name, value) in
        [("vx", 0.0), ("vx", 655.35), ("yaw_rate", 65535.0), ("yaw_rate", -9999.0), ("ay", 0.0)]
    {
        for every in [23, 97] {
            let mut log = columns(8, &[]);
            let column = log.get_mut(name).unwrap();
            column.iter_mut().skip(7).step_by(every).for_each(|it| *it = value);
            let log = cleaned(log).unwrap();
            let words = warned(&log, name);
            assert!(words.contains(&format!("{name} is {value} in ")), "{name} {value} {every}: {words}");
            let wide = 0.2 * greatest(&sound.columns[name]);
            assert!(apart(&log, &sound, name) < wide, "{name} {value} {every}");
        }
    }
}

#[test]
fn rows_of_zeros_alone_are_no_rows() {
    let sound = cleaned(columns(9, &[])).unwrap();
    let mut log: BTreeMap<_, _> = columns(9, &[]);
    let rows = log["time"].len();
    let empty: Vec<usize> = (60..rows).step_by(37).collect();
    for (_, column) in log.iter_mut().filter(|(name, _)| **name != "time") {
        empty.iter().for_each(|&row| column[row] = 0.0);
    }
    let log = cleaned(log).unwrap();
    let words = format!("all columns are 0 in {} rows, the first of them row 61", empty.len());
    assert!(warned(&log, "vx").contains(&words), "{:#?}", log.findings);
    for name in ["steer_cmd", "steer", "vx", "yaw_rate"] {
        assert!(apart(&log, &sound, name) < 0.1 * greatest(&sound.columns[name]), "{name}");
    }
}
