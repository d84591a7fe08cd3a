//! Rows of several vehicles in one file: split by a column that tells them apart, refused where none does.

use crate::diagnose::{Columns, cleaned, columns};
use rfl_mpc::log::{CleanError, CleanLog, DriveLog, LogError, Only};
use rfl_mpc::table::Limits;
use std::path::Path;

/// Rows of two drives in turn, `every`-th ones of the second, whose clock is `off` s late.
fn woven(every: usize, off: f64) -> Columns {
    let (one, other) = (columns(7, &[]), columns(8, &[]));
    let weave = |(&name, values): (&&'static str, &Vec<f64>)| {
        let shift = if name == "time" { off } else { 0.0 };
        let pairs = values.iter().zip(&other[name]).enumerate();
        let rows =
            pairs.flat_map(|(row, (a, b))| if row % every == 0 { vec![*a, b + shift] } else { vec![*a] });
        (name, rows.collect())
    };
    one.iter().map(weave).collect()
}

#[test]
fn rows_in_turn_are_refused_in_words() {
    for (every, off) in [(1, 0.0), (1, 0.007), (2, 0.0), (3, 0.011)] {
        let error = cleaned(woven(every, off)).unwrap_err();
        assert!(matches!(error.cause, CleanError::Mixed { .. }), "{every} {off}: {error}");
        assert!(error.to_string().contains("--only"), "{error}");
    }
    let mut few = woven(1, 0.0);
    few.retain(|name, _| ["time", "steer_cmd", "vx", "yaw_rate", "ay"].contains(name));
    assert!(matches!(cleaned(few).unwrap_err().cause, CleanError::Mixed { .. }));
}

#[test]
fn a_column_tells_them_apart() {
    let log = woven(1, 0.0);
    let names: Vec<&str> = log.keys().copied().collect();
    for (id, values, only) in
        [("vehicle_id", ["7", "9"], "vehicle_id=7"), ("Car ID", ["blue", "red"], "car_id=blue")]
    {
        let mut text = format!("{},{id}\n", names.join(","));
        for row in 0..log["time"].len() {
            let fields: Vec<String> = names.iter().map(|name| log[name][row].to_string()).collect();
            text += &format!("{},{}\n", fields.join(","), values[row % 2]);
        }
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("fleet.csv");
        std::fs::write(&file, &text).unwrap();
        let error = DriveLog::read(&file).unwrap_err();
        assert!(matches!(error, LogError::SeveralVehicles { count: 2, .. }), "{error}");
        assert!(error.to_string().contains(&format!("--only {id}={}", values[0])), "{error}");
        let read = |only: &str| {
            DriveLog::read_within(&file, Limits::default(), Some(&only.parse::<Only>().unwrap()))
        };
        let chosen = CleanLog::of(&read(only).unwrap(), &|_| 2.7).unwrap();
        assert_eq!(chosen.columns["vx"], cleaned(columns(7, &[])).unwrap().columns["vx"]);
        for (only, words) in [("vehicle_id=8", "no row has '8'"), ("lap=1", "no column 'lap'")] {
            let error = read(only).unwrap_err().to_string();
            assert!(error.contains(words) || id != "vehicle_id", "{error}");
        }
    }
    assert!("vehicle_id".parse::<Only>().is_err() && Path::new("x").is_relative());
}
