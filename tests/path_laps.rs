//! Logs of laps as roads: the station starts anew, and one lap is the road. Messages name columns as the file does.

use crate::command::{done, rfl, text};
use rfl_mpc::path::{Path, PathOptions, RandomRoad};
use std::fmt::Write as _;
use std::path::Path as FilePath;

fn read(csv: &str) -> Result<Path, String> {
    Path::from_csv(csv.as_bytes(), FilePath::new("log.csv"), &PathOptions::default())
        .map_err(|error| error.to_string())
}

/// A log along a closed road from a station on, m, for so many laps, with a row each 0.7 m.
fn log(road: &Path, from: f64, laps: f64) -> String {
    let mut csv = "time,x,y,station,vx\n".to_owned();
    let mut driven = 0.0;
    while driven < laps * road.length() {
        let station = (from + driven) % road.length();
        let at = road.at(station);
        let _ = writeln!(csv, "{:.2},{:.6},{:.6},{station:.4},10", driven / 10.0, at.x, at.y);
        driven += 0.7;
    }
    csv
}

#[test]
fn a_log_of_laps_is_the_road() {
    let road = RandomRoad { closed: true, length: 600.0, ..RandomRoad::CAR }.path(820).unwrap();
    for (from, laps, anew) in
        [(0.0, 0.9985, false), (0.0, 1.02, true), (0.0, 3.3, true), (150.0, 1.0, true), (420.0, 2.5, true)]
    {
        let found = read(&log(&road, from, laps)).unwrap();
        assert!(found.is_periodic(), "{from} {laps}: {:?}", found.notes());
        assert!((found.length() / road.length() - 1.0).abs() < 1e-3, "{from} {laps}: {} m", found.length());
        let said = found.notes().iter().any(|note| note.text.contains("one lap is the road"));
        assert_eq!(said, anew, "{from} {laps}: {:?}", found.notes());
    }
    // Less than a lap over the line is no lap.
    let part = read(&log(&road, 400.0, 0.6)).unwrap();
    assert!(!part.is_periodic() && (part.length() / road.length() - 0.6).abs() < 0.01);
}

#[test]
fn columns_are_named_as_the_file_names_them() {
    for (csv, words) in [
        (
            "x,y,station\n0,0,0\n1,0,1\n2,0,3\n3,0,2\n",
            &["line 5, column `station`", "sort the rows by `station`"][..],
        ),
        ("easting,northing\n0,0\n1,east\n", &["line 3, column `northing`"]),
        ("x,y,v_max\n0,0,3\n1,0,nan\n", &["line 3, column `v_max`"]),
        ("x,y,grade [rad]\n0,0,0\n1,0,7\n2,0,0\n", &["line 3, column `grade [rad]`"]),
        ("x,y,v\n0,0,0\n1,0,0\n2,0,0\n", &["column `v`"]),
    ] {
        let message = read(csv).unwrap_err();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
}

#[test]
fn the_log_of_a_lap_is_driven_again() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| rfl(folder.path(), arguments);
    done(&run(&["course", "--random", "car", "--closed", "--seed", "821", "--out", "lap.csv"]));
    done(&run(&["drive", "--quiet", "--path", "lap.csv", "--log", "drive.csv"]));
    let again = run(&["drive", "--quiet", "--path", "drive.csv", "--require", "max_e1<=0.1"]);
    assert_eq!(again.status.code(), Some(0), "{}{}", text(&again.stdout), text(&again.stderr));
    let said = done(&run(&["path", "drive.csv"]));
    assert!(said.contains("m, closed"), "{said}");
}
