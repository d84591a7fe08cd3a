//! Sensors that rest without noise and without a jump: their partners tell whether they are frozen. Commands that rest and jump: the
//! wheels tell it.

use crate::diagnose::{Columns, cleaned, said};
use rfl_mpc::log::FindingSeverity;

/// A car without slip and without noise, whose accelerometer feels hills of so many m/s2.
fn driven(speed: impl Fn(f64) -> f64, bend: impl Fn(f64) -> f64, hills: f64) -> Columns {
    let mut columns = Columns::new();
    let (mut x, mut y, mut yaw, mut steer) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for row in 0..2000 {
        let time = 0.02 * f64::from(row);
        let (vx, command) = (speed(time), bend(time));
        let rate = vx * steer / 2.7;
        let values = [
            ("time", time),
            ("steer_cmd", command),
            ("steer", steer),
            ("x", x),
            ("y", y),
            ("yaw", yaw),
            ("vx", vx),
            ("yaw_rate", rate),
            ("ax", (speed(time + 0.02) - vx) / 0.02 + hills * (x / 40.0).sin()),
            ("ay", vx * rate),
        ];
        values.into_iter().for_each(|(name, value)| columns.entry(name).or_default().push(value));
        (x, y) = (x + 0.02 * vx * yaw.cos(), y + 0.02 * vx * yaw.sin());
        (yaw, steer) = (yaw + 0.02 * rate, steer + 0.2 * (command - steer));
    }
    columns
}

/// Bends both ways, at changing speed.
fn winding() -> Columns {
    driven(
        |time| 15.0 + 3.0 * (0.25 * time).sin(),
        |time| 0.03 * (0.7 * time).sin() + 0.01 * (0.31 * time).sin(),
        0.0,
    )
}

/// Hills and bends at a speed that is held exactly at times, or from 15 s to the end.
fn held_speed(to_the_end: bool) -> Columns {
    let speed = |time: f64| {
        let since = if to_the_end { f64::min(time, 15.0) } else { time % 20.0 };
        10.0 + (since - 5.0).clamp(0.0, 5.0) - (since - 15.0).clamp(0.0, 5.0)
    };
    driven(speed, |time| 0.03 * (0.7 * (time - 4.0).max(0.0)).sin(), 0.4)
}

/// What the partners of a sensor tell.
fn told(columns: &Columns, name: &str) -> String {
    let findings = cleaned(columns.clone()).expect("a usable log").findings;
    let words = said(&findings, name, FindingSeverity::Warning);
    if words.contains("tells that it changes: frozen") { words } else { String::new() }
}

/// A stretch of 1.5 s and more to whose first value a signal comes back of itself, having been far from it.
fn way_back(values: &[f64]) -> std::ops::Range<usize> {
    let spread = values.iter().fold(0.0f64, |most, value| most.max((value - values[0]).abs()));
    (600..1200)
        .find_map(|from| {
            let crosses =
                |row: &usize| (values[*row] - values[from]) * (values[row - 1] - values[from]) <= 0.0;
            let to = (from + 75..from + 400).find(crosses)?;
            let far = values[from..to].iter().any(|value| (value - values[from]).abs() > 0.4 * spread);
            far.then_some(from..to)
        })
        .expect("a bend")
}

#[test]
fn a_sensor_that_rests_in_a_bend_and_goes_on_without_a_jump_is_left_out() {
    for name in ["yaw_rate", "ay", "steer"] {
        let mut columns = winding();
        let values = columns.get_mut(name).expect("there");
        let rest = way_back(values);
        let value = values[rest.start];
        values[rest.clone()].fill(value);
        let words = told(&columns, name);
        let rows = format!("from row {} to row {}", rest.start + 2, rest.end);
        assert!(words.contains(&rows), "{name}, {rest:?}: {words}");
    }
}

#[test]
fn a_sensor_that_dies_is_left_out_to_the_end() {
    for name in ["yaw_rate", "ay", "vx", "yaw", "x", "y", "steer"] {
        let mut columns = winding();
        let values = columns.get_mut(name).expect("there");
        let value = values[1400];
        values[1400..].fill(value);
        let words = told(&columns, name);
        assert!(words.contains("from row 1402 to row 2000"), "{name}: {words}");
    }
}

#[test]
fn coarse_slow_and_repeated_rows_are_no_frozen_sensors() {
    let steps = [("yaw_rate", 0.01), ("vx", 0.1), ("ay", 0.05), ("steer", 0.002), ("x", 0.1), ("y", 0.1)];
    let round = |columns: &mut Columns| {
        for (name, step) in steps {
            let values = columns.get_mut(name).expect("there");
            values.iter_mut().for_each(|value| *value = (*value / step).round() * step);
        }
    };
    let measured = |columns: &mut Columns, place: &dyn Fn(usize) -> usize| {
        for values in columns.iter_mut().filter(|(name, _)| **name != "time").map(|(_, values)| values) {
            *values = (0..values.len()).map(|row| values[place(row)]).collect();
        }
    };
    let slow = |columns: &mut Columns| measured(columns, &|row| row - row % 5);
    let stopped = |columns: &mut Columns| measured(columns, &|row| if row / 30 == 30 { 900 } else { row });
    for (case, change) in [
        ("exact", &(|_: &mut Columns| ()) as &dyn Fn(&mut Columns)),
        ("coarse", &round),
        ("a value for five rows", &slow),
        ("a recorder that stops for 0.6 s", &stopped),
    ] {
        let mut columns = winding();
        change(&mut columns);
        for (name, _) in steps {
            assert_eq!(told(&columns, name), "", "{case}");
        }
    }
}

#[test]
fn a_speed_that_is_held_on_hills_and_a_yaw_rate_that_rests_on_a_straight_are_sound() {
    for to_the_end in [false, true] {
        for place in [true, false] {
            let mut columns = held_speed(to_the_end);
            columns.retain(|name, _| place || !["x", "y", "yaw"].contains(name));
            for name in ["vx", "yaw_rate", "y", "ay"] {
                assert_eq!(told(&columns, name), "", "{to_the_end} {place}");
            }
        }
    }
}

#[test]
fn a_needed_sensor_that_is_dead_for_most_of_a_log_is_refused_with_the_reason() {
    let mut columns = winding();
    let values = columns.get_mut("vx").expect("there");
    let value = values[700];
    values[700..].fill(value);
    let error = cleaned(columns).expect_err("mostly dead").to_string();
    assert!(error.contains("at least half") && error.contains("frozen"), "{error}");
}

/// Commands of a sine, then some that are held for 2 s each.
fn held_commands() -> Columns {
    let held = [0.0, 0.04, -0.04, 0.02, 0.0];
    let command = |time: f64| match time {
        time if time < 14.0 => 0.03 * (0.9 * time).sin(),
        time => held.get(((time - 14.0) / 2.0) as usize).map_or(0.02 * (0.7 * time).sin(), |held| *held),
    };
    driven(|_| 15.0, command, 0.0)
}

/// What is said of the command.
fn said_of_command(columns: Columns) -> String {
    let findings = cleaned(columns).expect("a usable log").findings;
    said(&findings, "steer_cmd", FindingSeverity::Warning)
}

#[test]
fn held_commands_that_the_wheels_follow_are_kept() {
    for is_measured in [true, false] {
        let mut columns = held_commands();
        columns.retain(|name, _| is_measured || *name != "steer");
        assert_eq!(said_of_command(columns), "", "{is_measured}");
    }
}

#[test]
fn a_command_that_is_frozen_while_the_wheels_go_on_is_left_out() {
    for is_measured in [true, false] {
        let mut columns = winding();
        columns.retain(|name, _| is_measured || *name != "steer");
        let values = columns.get_mut("steer_cmd").expect("there");
        let value = values[700];
        values[700..800].fill(value);
        let words = said_of_command(columns);
        assert!(words.contains("from row 702 to row 800 and jumps then: frozen"), "{is_measured}: {words}");
    }
}
