//! Corners of a line of points: rounded for the vehicle, said, driven; and bends that somebody drew, which stay.

use crate::command::{rfl, text};
use serde_json::Value;
use std::path::Path;

/// Points of legs (m) with turns (degrees) between them, `step` m apart at most.
fn legs(legs: &[f64], turns: &[f64], step: f64) -> String {
    let (mut place, mut heading) = ([0.0, 0.0], 0.0f64);
    let mut text = "x,y\n0,0\n".to_owned();
    for (leg, length) in legs.iter().enumerate() {
        let count = (length / step).ceil() as u32;
        for _ in 0..count {
            let way = length / f64::from(count);
            place = [place[0] + way * heading.cos(), place[1] + way * heading.sin()];
            text += &format!("{:.3},{:.3}\n", place[0], place[1]);
        }
        heading += turns.get(leg).copied().unwrap_or_default().to_radians();
    }
    text
}

fn read(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

#[test]
fn a_car_and_a_truck_drive_round_the_corners_of_a_street_grid() {
    let folder = tempfile::tempdir().unwrap();
    let grids = [
        legs(&[40.0, 40.0, 40.0, 40.0], &[90.0, -90.0, 90.0], 10.0),
        legs(&[40.0, 40.0, 40.0, 40.0], &[60.0, -120.0, 75.0], 5.0),
        legs(&[40.0, 3.0, 40.0, 4.0, 40.0], &[45.0, 45.0, 45.0, -45.0], 4.0),
    ];
    for (grid, points) in grids.iter().enumerate() {
        let (road, json) = (folder.path().join(format!("{grid}.csv")), folder.path().join("drive.json"));
        std::fs::write(&road, points).unwrap();
        for vehicle in ["c_class", "truck_simulation"] {
            let (path, json) = (road.to_str().unwrap(), json.to_str().unwrap());
            let done = rfl(
                folder.path(),
                &["drive", "--path", path, "--vehicle", vehicle, "--quiet", "--json", json],
            );
            let said = text(&done.stderr);
            let found = read(Path::new(json));
            assert_eq!(found["outcome"], "completed", "{grid} {vehicle}: {said}");
            let largest = found["largest"]["lateral_error"].as_f64().unwrap().abs();
            assert!(largest < 0.05, "{grid} {vehicle}: {largest} m; {said}");
            assert!(
                said.contains("are rounded") && !said.contains("tighter than"),
                "{grid} {vehicle}: {said}"
            );
        }
    }
}

#[test]
fn a_rounded_corner_is_said_with_its_line_and_the_line_that_is_driven_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(file("road.csv"), legs(&[60.0, 60.0], &[90.0], 10.0)).unwrap();
    let look = |road: &str, more: &[&str]| -> Value {
        let done = rfl(folder.path(), &[&["path", road, "--json"], more].concat());
        assert!(done.status.success(), "{}", text(&done.stderr));
        serde_json::from_slice(&done.stdout).unwrap()
    };
    let found = look(&file("road.csv"), &["--write", &file("rounded.csv")]);
    let corner = &found["rounded"][0];
    assert_eq!((corner["row"].as_u64(), corner["corners"].as_u64()), (Some(8), Some(1)), "{corner}");
    let number = |value: &Value| value.as_f64().unwrap();
    assert!((number(&corner["turn"]) - std::f64::consts::FRAC_PI_2).abs() < 1e-3, "{corner}");
    assert!(number(&found["least_radius"]) > 4.5, "{found}");
    // An arc of this radius passes (sqrt 2 - 1) of it from the corner, and one with transitions a little more.
    let arc = (2f64.sqrt() - 1.0) * number(&found["least_radius"]);
    assert!((arc..1.15 * arc).contains(&number(&corner["inside"])), "{corner}: {arc}");
    let said = found["notes"].to_string();
    assert!(said.contains("line 8 (60.0, 0.0) 90 degrees to the left"), "{said}");

    let again = look(&file("rounded.csv"), &[]);
    assert_eq!(again["rounded"].as_array().unwrap().len(), 0);
    assert!((number(&again["length"]) - number(&found["length"])).abs() < 0.01);
    assert!((number(&again["least_radius"]) / number(&found["least_radius"]) - 1.0).abs() < 0.02);
}

#[test]
fn a_closed_road_is_rounded_where_it_begins_and_a_hairpin_that_was_drawn_is_only_said() {
    let folder = tempfile::tempdir().unwrap();
    let road = folder.path().join("road.csv");
    let look = |points: &str, vehicle: &str| -> Value {
        std::fs::write(&road, points).unwrap();
        let done = rfl(folder.path(), &["path", road.to_str().unwrap(), "--json", "--vehicle", vehicle]);
        serde_json::from_slice(&done.stdout).unwrap()
    };
    let block = legs(&[80.0, 40.0, 80.0, 40.0], &[90.0, 90.0, 90.0], 10.0);
    let found = look(&block, "truck_simulation");
    assert_eq!(found["closed"], true);
    let rows: Vec<u64> =
        found["rounded"].as_array().unwrap().iter().filter_map(|corner| corner["row"].as_u64()).collect();
    assert_eq!(rows, [2, 10, 14, 22], "{found}");

    // 19 points of a half circle of 3 m radius.
    let hairpin = legs(&[&[40.0][..], &[0.524; 18], &[40.0]].concat(), &[10.0; 19], 1.0);
    let found = look(&hairpin, "c_class");
    assert_eq!(found["rounded"].as_array().unwrap().len(), 0, "{found}");
    let said = found["notes"].to_string();
    assert!(said.contains("tighter than the vehicle turns"), "{said}");
    assert!((42..=61).any(|line| said.contains(&format!("(line {line})"))), "{said}");
}
