//! `rfl path` and `rfl course`: what they print, write and return.

use crate::command::{done, refused, rfl, text};
use std::path::Path;

#[test]
fn course_writes_all_courses_as_committed() {
    let folder = tempfile::tempdir().unwrap();
    let output = rfl(folder.path(), &["course"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("paths");
    let mut files = 0;
    for entry in std::fs::read_dir(folder.path().join("paths")).unwrap() {
        let file = entry.unwrap();
        let written = std::fs::read(file.path()).unwrap();
        assert_eq!(
            written,
            std::fs::read(committed.join(file.file_name())).unwrap(),
            "{:?}",
            file.file_name()
        );
        assert!(text(&output.stdout).contains(file.file_name().to_str().unwrap()));
        files += 1;
    }
    assert_eq!(files, rfl_mpc::path::sudoku::Route::ALL.len());
}

#[test]
fn path_reports_a_road_as_text_and_as_json() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(
        rfl(folder.path(), &["course", "--route", "hairpin_circuit", "--out", "road.csv"]).status.code(),
        Some(0)
    );
    let output = rfl(folder.path(), &["path", "road.csv"]);
    assert_eq!(output.status.code(), Some(0));
    for part in ["870.5 m, closed", "10.00 m radius, to the left", "u_turn"] {
        assert!(text(&output.stdout).contains(part), "no `{part}` in {}", text(&output.stdout));
    }
    let output = rfl(folder.path(), &["path", "road.csv", "--json", "--speed", "5"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((report["length"].as_f64().unwrap() - 870.5).abs() < 0.1);
    assert_eq!(report["closed"], true);
    assert!((report["least_radius"].as_f64().unwrap() - 10.0).abs() < 1e-3);
    assert!((report["speed"]["max"].as_f64().unwrap() - 5.0).abs() < 1e-9);
    // A straight road has no least radius, and JSON no infinity.
    std::fs::write(folder.path().join("straight.csv"), "x,y\n0,0\n50,0\n").unwrap();
    let output = rfl(folder.path(), &["path", "straight.csv", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["least_radius"].is_null());
}

#[test]
fn a_bend_that_no_car_can_drive_is_said() {
    let folder = tempfile::tempdir().unwrap();
    // A right angle, which is rounded, a hairpin, and a bend that a car can drive.
    let angle: String = (0..60).map(|i| format!("{},{}\n", i.min(30), (i - 30).max(0))).collect();
    let arc = |radius: f64| -> String {
        let point = |i: i32| (f64::from(i) * 0.02 * std::f64::consts::PI, radius);
        let points =
            (0..=50).map(point).map(|(turn, r)| format!("{},{}\n", r * turn.sin(), r * (1.0 - turn.cos())));
        format!("-20,0\n-15,0\n-10,0\n-5,0\n-2,0\n{}", points.collect::<String>())
    };
    for (points, tight) in [(angle, false), (arc(2.5), true), (arc(9.0), false)] {
        std::fs::write(folder.path().join("road.csv"), format!("x,y\n{points}")).unwrap();
        let said = done(&rfl(folder.path(), &["path", "road.csv"]));
        assert_eq!(said.contains("tighter than the vehicle turns"), tight, "{said}");
        let json: serde_json::Value =
            serde_json::from_str(&done(&rfl(folder.path(), &["path", "road.csv", "--json"]))).unwrap();
        assert_eq!(json["notes"].to_string().contains("c_class: the road has"), tight, "{json}");
    }
}

#[test]
fn a_road_is_driven_closed_or_open_as_is_asked() {
    let folder = tempfile::tempdir().unwrap();
    let point = |k: u32| {
        let (sin, cos) = (f64::from(k) * 0.05).sin_cos();
        format!("{:.6},{:.6}\n", 50.0 * cos, 50.0 * sin)
    };
    let ring: String = (0..125).map(point).collect();
    std::fs::write(folder.path().join("ring.csv"), format!("x,y\n{ring}")).unwrap();
    for (asked, length) in [(&[][..], 314.2), (&["--closed"], 314.2), (&["--open"], 310.0)] {
        let said = done(&rfl(folder.path(), &[&["path", "ring.csv"], asked].concat()));
        assert!(said.contains(&format!("{length:.1} m")), "{said}");
        assert_eq!(said.contains("taken as closed (--open: it is not)"), asked.is_empty(), "{said}");
        let short = ["drive", "--quiet", "--path", "ring.csv", "--duration", "0.1", "--json", "drive.json"];
        done(&rfl(folder.path(), &[&short, asked].concat()));
        let json = std::fs::read_to_string(folder.path().join("drive.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert!((json["length"].as_f64().unwrap() - length).abs() < 0.1, "{json}");
    }
}

#[test]
fn a_name_of_no_vehicle_lists_those_of_all_kinds() {
    let folder = tempfile::tempdir().unwrap();
    let said = refused(&rfl(folder.path(), &["drive", "--vehicle", "truck_simulatoin"]));
    assert!(said.contains("truck_simulation") && said.contains("c_class"), "{said}");
}

#[test]
fn a_yard_that_a_trailer_cannot_follow_is_said() {
    let folder = tempfile::tempdir().unwrap();
    // A circle of 6 m radius: the tractor drives it, its trailer does not.
    let circle = |i: i32| (f64::from(i) * 0.05, 6.0);
    let points: String = (-40..0)
        .map(|i| format!("{},0\n", f64::from(i) * 0.5))
        .chain((0..240).map(circle).map(|(a, r)| format!("{},{}\n", r * a.sin(), r * (1.0 - a.cos()))))
        .collect();
    std::fs::write(folder.path().join("yard.csv"), format!("x,y\n{points}")).unwrap();
    let path =
        |vehicle: &str| done(&rfl(folder.path(), &["path", "yard.csv", "--open", "--vehicle", vehicle]));
    let said = path("truck_simulation");
    assert!(said.contains("turns the trailer") && said.contains("truck_simulation: "), "{said}");
    let said = path("bmw_320i");
    assert!(!said.contains("turns the trailer") && !said.contains("tighter"), "{said}");
    let error = refused(&rfl(folder.path(), &["path", "yard.csv", "--vehicle", "bmw"]));
    assert!(error.contains("bmw"), "{error}");
}

#[test]
fn roads_have_a_limit_as_logs_have() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..50_000).map(|i| format!("{i}.000000,{}.000000\n", i / 7)).collect();
    std::fs::write(folder.path().join("long.csv"), format!("x,y\n{rows}")).unwrap();
    for command in [
        &["path", "long.csv"][..],
        &["drive", "--path", "long.csv", "--quiet"],
        &["collect", "--path", "long.csv", "--quiet"],
        &["tune", "--path", "long.csv", "--quiet"],
    ] {
        let error = refused(&rfl(folder.path(), &[command, &["--limit", "1"]].concat()));
        assert!(error.contains("long.csv: has more than 1 MB"), "{command:?}: {error}");
    }
}

#[test]
fn path_writes_the_road_that_is_driven() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String =
        (0..200).map(|i| format!("{i};{}\n", if i % 2 == 0 { "0,05" } else { "-0,05" })).collect();
    std::fs::write(folder.path().join("noisy.csv"), format!("x;y\n{rows}")).unwrap();
    let output = rfl(folder.path(), &["path", "noisy.csv", "--write", "smooth.csv"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("measured noise"), "{}", text(&output.stdout));
    let output = rfl(folder.path(), &["path", "smooth.csv", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((report["length"].as_f64().unwrap() - 199.0).abs() < 0.1, "{report}");
    assert!(report["least_radius"].as_f64().is_none_or(|radius| radius > 500.0), "{report}");
    assert!(report["notes"].as_array().unwrap().is_empty(), "{report}");
    // A tolerance that is given counts more than the measure.
    let output = rfl(folder.path(), &["path", "noisy.csv", "--smooth", "0.06"]);
    assert!(text(&output.stdout).contains("smoothed: 60.0 mm RMS"), "{}", text(&output.stdout));
}

#[test]
fn bad_input_is_status_1_and_bad_usage_status_2() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.csv"), "x,y\n0,0\n1,nan\n").unwrap();
    let bad_input: [&[&str]; 5] = [
        &["path", "missing.csv"],
        &["path", "bad.csv"],
        &["path", "bad.csv", "--speed", "0"],
        &["course", "--route", "sudoku_test", "--seed", "3"],
        &["course", "--route", "sudoku_test", "--out", "bad.csv/road.csv"],
    ];
    for arguments in bad_input {
        let output = rfl(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(text(&output.stderr).starts_with("error: "), "{}", text(&output.stderr));
        assert!(output.stdout.is_empty());
    }
    let error = text(&rfl(folder.path(), &["path", "bad.csv"]).stderr);
    assert!(error.contains("bad.csv, line 3, column `y`"), "{error}");
    let bad_usage: [&[&str]; 6] = [
        &[],
        &["path"],
        &["pth", "x"],
        &["course", "--route", "nowhere"],
        &["path", "x", "--open", "--closed"],
        &["drive", "--path", "x", "--open", "--closed"],
    ];
    for arguments in bad_usage {
        assert_eq!(rfl(folder.path(), arguments).status.code(), Some(2), "{arguments:?}");
    }
    for command in ["path", "course", "drive"] {
        assert!(text(&rfl(folder.path(), &[command, "--help"]).stdout).contains("Examples:"), "{command}");
    }
}
