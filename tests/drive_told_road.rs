//! Roads that tell their slopes, banks and slippery places, and vehicles that tell their steering's gap and their drive's
//! lag: the controller drives with what it was told.

use crate::command::{rfl, text};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

/// A road of bends of both sides, 60 to 200 m radius, with further columns from the station.
fn road(folder: &Path, name: &str, columns: &str, of: impl Fn(f64) -> String) -> String {
    let mut rows = format!("x,y,{columns}\n");
    let (mut x, mut y, mut yaw) = (0.0_f64, 0.0_f64, 0.0_f64);
    for k in 0..800 {
        let s = f64::from(k);
        let _ = writeln!(rows, "{x:.4},{y:.4},{}", of(s));
        yaw += (1.0 - (-s / 30.0).exp()) * (0.008 * (s / 31.0).sin() + 0.004 * (s / 73.0).cos());
        x += yaw.cos();
        y += yaw.sin();
    }
    std::fs::write(folder.join(name), rows).unwrap();
    name.to_owned()
}

/// Drives it with options: results, and values of a column of the log.
fn drive(folder: &Path, options: &[&str]) -> (Value, String) {
    let all = [&["drive", "--quiet", "--json", "drive.json", "--log", "drive.csv"], options].concat();
    let output = rfl(folder, &all);
    let json =
        std::fs::read(folder.join("drive.json")).unwrap_or_else(|_| panic!("{}", text(&output.stderr)));
    (serde_json::from_slice(&json).unwrap(), text(&output.stdout))
}

fn column(folder: &Path, name: &str) -> Vec<f64> {
    let mut log = csv::Reader::from_path(folder.join("drive.csv")).unwrap();
    let place = log.headers().unwrap().iter().position(|column| column == name).unwrap();
    log.records().map(|row| row.unwrap()[place].parse().unwrap()).collect()
}

fn worst(json: &Value) -> f64 {
    json["tracking"]["max"].as_f64().unwrap()
}

#[test]
fn a_truck_climbs_and_descends_slopes_that_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    for (vehicle, grade) in [("truck_simulation", 0.19), ("truck_simulation", -0.15), ("truck_real", 0.15)] {
        let path = road(folder.path(), "slope.csv", "grade", |_| grade.to_string());
        let (json, said) = drive(folder.path(), &["--path", &path, "--vehicle", vehicle]);
        assert_eq!(json["outcome"], "completed", "{vehicle} on {grade}: {said}");
        assert!(worst(&json) < 0.05, "{vehicle} on {grade}: {said}");
    }
}

#[test]
fn a_vehicle_that_rolls_back_is_held_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    for grade in ["0.15", "0.3"] {
        let path =
            road(folder.path(), "slope.csv", "grade", |s| if s < 100.0 { "0" } else { grade }.to_owned());
        let weak = ["--path", &path, "--set", "drive.max_force=1500", "--set", "initial.vx=5"];
        let (json, said) = drive(folder.path(), &weak);
        assert_eq!(json["outcome"], "stopped", "{grade}: {said}");
        assert!(said.contains("rolled_back") && worst(&json) < 0.3, "{grade}: {said}");
        let speed = column(folder.path(), "vx");
        let backwards = speed.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((-9.0..-0.1).contains(&backwards) && speed[speed.len() - 1].abs() < 0.05, "{backwards}");
    }
}

#[test]
fn a_told_bank_is_steered_for_before_it_pushes() {
    let folder = tempfile::tempdir().unwrap();
    let bank = |s: f64| (0.08 * (s / 25.0).sin()).to_string();
    for vehicle in ["c_class", "truck_simulation"] {
        let path = road(folder.path(), "banked.csv", "bank", bank);
        let (json, said) = drive(folder.path(), &["--path", &path, "--vehicle", vehicle]);
        assert_eq!(json["outcome"], "completed", "{said}");
        assert!(worst(&json) < 0.05, "{vehicle}: {said}");
    }
}

#[test]
fn a_slippery_place_is_entered_without_drive() {
    let folder = tempfile::tempdir().unwrap();
    for (friction, bank, grade) in [(0.35, 0.05, 0.08), (0.3, 0.04, 0.06), (0.4, 0.05, 0.08)] {
        // Slow before the place: the vehicle is to accelerate onto it.
        let of = |s: f64| {
            let (speed, friction) =
                (if s < 80.0 { 8.0 } else { 30.0 }, if s < 100.0 { 1.0 } else { friction });
            format!("{bank},{grade},{friction},{speed}")
        };
        let path = road(folder.path(), "ice.csv", "bank,grade,friction,speed", of);
        let (json, said) = drive(folder.path(), &["--path", &path]);
        assert_eq!(json["outcome"], "completed", "{friction}: {said}");
        assert!(worst(&json) < 0.15, "{friction}: {said}");
    }
}

#[test]
fn a_told_backlash_is_taken_up() {
    let folder = tempfile::tempdir().unwrap();
    let path = road(folder.path(), "road.csv", "speed", |_| "22".to_owned());
    let drives = |told: &str| {
        let backlash = "steering.backlash=0.006";
        // Of a variant that finds none by itself.
        let options = ["--path", &path, "--variant", "actuator", "--set", backlash, "--set", told];
        let (json, said) = drive(folder.path(), &options);
        assert_eq!(json["outcome"], "completed", "{said}");
        json["tracking"]["rmse"].as_f64().unwrap()
    };
    let (untold, told) = (drives("actuator.backlash=0"), drives("actuator.backlash=0.006"));
    assert!(told < 0.5 * untold && told < 0.02, "{told} {untold}");
}

#[test]
fn a_slow_drive_that_is_told_takes_no_bend_too_fast() {
    let folder = tempfile::tempdir().unwrap();
    let path = road(folder.path(), "road.csv", "speed", |_| "30".to_owned());
    let fastest = |told: &str| {
        let options = ["--path", &path, "--set", "drive.lag=1.5", "--set", told];
        let (json, said) = drive(folder.path(), &options);
        assert_eq!(json["outcome"], "completed", "{said}");
        column(folder.path(), "ay").into_iter().map(f64::abs).fold(0.0, f64::max)
    };
    let (untold, told) = (fastest("longitudinal.drive_lag=0"), fastest("longitudinal.drive_lag=1.5"));
    assert!(told < 2.8 && untold > told, "{told} {untold}");
}

#[test]
fn a_drive_begins_where_it_is_set_to() {
    let folder = tempfile::tempdir().unwrap();
    let path = road(folder.path(), "road.csv", "speed", |_| "15".to_owned());
    let options = ["--path", &path, "--set", "initial.y=0.5", "--set", "car.initial.vx=4"];
    let (json, said) = drive(folder.path(), &options);
    assert_eq!(json["outcome"], "completed", "{said}");
    assert!((column(folder.path(), "y")[0] - 0.5).abs() < 1e-12 && column(folder.path(), "vx")[0] == 4.0);
    assert!((worst(&json) - 0.5).abs() < 0.05, "{said}");
    for (setting, words) in [
        ("initial.y=far", "'far' is not a number"),
        ("initial.vy=1", "no number 'initial.vy'"),
        ("initial.x=1e300", "outside its range [-10000000, 10000000]"),
    ] {
        let output = rfl(folder.path(), &["drive", "--path", &path, "--set", setting]);
        assert!(!output.status.success() && text(&output.stderr).contains(words), "{}", text(&output.stderr));
    }
}

#[test]
fn the_start_of_the_help_s_example_is_beside_the_road() {
    let folder = tempfile::tempdir().unwrap();
    let help = text(&rfl(folder.path(), &["drive", "--help"]).stdout);
    let example = help.lines().find(|line| line.contains("initial.y=")).expect("an example");
    let settings = example.split("  ").find(|part| part.contains("initial.y=")).expect("its words");
    let settings: Vec<&str> = settings.split_whitespace().skip(2).collect();
    let (json, said) = drive(folder.path(), &[&settings[..], &["--duration", "0.5"]].concat());
    assert!(column(folder.path(), "station")[0] < 1.0 && json["entered_lane"].is_null(), "{said}");
    assert!((worst(&json) - 1.0).abs() < 0.05, "{said}");
}

#[test]
fn a_straight_drive_shows_no_steering_and_is_driven_whole() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..100).map(|k| format!("{},0\n", 5 * k)).collect();
    std::fs::write(folder.path().join("straight.csv"), format!("x,y\n{rows}")).unwrap();
    let (json, said) = drive(folder.path(), &["--path", "straight.csv", "--require", "driven=1"]);
    assert_eq!(json["outcome"], "completed", "{said}");
    assert!(said.contains("does not show its dead time") && !said.contains("NOT met"), "{said}");
    let path = road(folder.path(), "road.csv", "speed", |_| "15".to_owned());
    let (_, said) = drive(folder.path(), &["--path", &path]);
    assert!(said.contains("steering as driven"), "{said}");
}

#[test]
fn a_told_ratio_and_offset_of_the_steering_are_counted_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = road(folder.path(), "road.csv", "speed", |_| "15".to_owned());
    for (vehicle, kind, gain, offset) in
        [("c_class", "car", "0.85", "0.012"), ("truck_simulation", "truck", "1.2", "-0.006")]
    {
        let plant = [format!("{kind}.steering.gain={gain}"), format!("{kind}.steering.offset={offset}")];
        let told = [format!("actuator.gain={gain}"), format!("actuator.offset={offset}")];
        // The mean error behind the start, at which the wheels stand at the offset.
        let drives = |settings: &[String]| {
            let settings: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
            let options = [&["--path", &path, "--vehicle", vehicle][..], &settings].concat();
            let (json, said) = drive(folder.path(), &options);
            assert_eq!(json["outcome"], "completed", "{said}");
            let [time, e1] = ["time", "e1"].map(|name| column(folder.path(), name));
            let late: Vec<f64> =
                time.iter().zip(&e1).filter(|(time, _)| **time > 20.0).map(|(_, e1)| e1.abs()).collect();
            late.iter().sum::<f64>() / late.len() as f64
        };
        let (sound, untold) = (drives(&[]), drives(&plant));
        let told = drives(&[plant, told].concat());
        assert!(untold > 2.0 * sound, "{vehicle}: {untold} m untold, {sound} m without");
        assert!(told < 1.1 * sound + 1e-4, "{vehicle}: {told} m told, {sound} m without");
    }
}
