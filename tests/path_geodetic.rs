//! Roads in latitude and longitude drive like the same roads in metres.

use rfl_mpc::path::{Path, PathOptions};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path as FilePath;

/// A circle of 50 m about a place, with a point each 2 m: degrees with `decimals`.
fn circle(latitude: f64, longitude: f64, decimals: usize) -> Vec<[String; 2]> {
    let (sin, cos) = latitude.to_radians().sin_cos();
    // Radii of curvature of WGS 84 along and across the meridian.
    let w = (1.0 - 6.694_379_990_14e-3 * sin * sin).sqrt();
    let (along, across) = (6_378_137.0 * (1.0 - 6.694_379_990_14e-3) / (w * w * w), 6_378_137.0 / w);
    (0..150)
        .map(|k| {
            let (north, east) = (TAU * f64::from(k) / 157.0).sin_cos();
            let point = [
                latitude + (50.0 * north / along).to_degrees(),
                longitude + (50.0 * east / (across * cos)).to_degrees(),
            ];
            point.map(|degrees| format!("{degrees:.decimals$}"))
        })
        .collect()
}

fn parse(text: &str) -> Result<Path, String> {
    let options = PathOptions::default();
    Path::from_csv(text.as_bytes(), FilePath::new("road.csv"), &options).map_err(|error| error.to_string())
}

fn read(head: &str, rows: &[[String; 2]], order: [usize; 2], delimiter: &str) -> Result<Path, String> {
    let mut text = format!("{head}\n");
    for row in rows {
        writeln!(text, "{}{delimiter}{}", row[order[0]], row[order[1]]).unwrap();
    }
    parse(&text)
}

#[test]
fn a_circle_has_its_radius_wherever_it_lies() {
    for (latitude, longitude, head, order, delimiter) in [
        (48.137, 11.575, "lat,lon", [0, 1], ","),
        (-33.86, 151.21, "Longitude [deg];Latitude [deg]", [1, 0], ";"),
        (0.001, -179.999, "gps_lat\tgps_lon", [0, 1], "\t"),
        (64.1, -21.9, "# latitude, longitude", [0, 1], ","),
    ] {
        let road = read(head, &circle(latitude, longitude, 9), order, delimiter).unwrap();
        let middle = road.length() / 2.0;
        let radius = 1.0 / road.at(middle).curvature;
        assert!((radius - 50.0).abs() < 0.05, "{head}: {radius}");
        assert!((road.length() - 50.0 * TAU * 149.0 / 157.0).abs() < 0.1, "{head}: {}", road.length());
        let said = road.notes().iter().any(|note| note.to_string().contains("WGS 84") && !note.warning);
        assert!(said, "{:?}", road.notes());
        // It starts at the origin, eastmost on the circle: to the north.
        let start = road.at(0.0);
        assert!(start.x.hypot(start.y) < 0.01 && (start.yaw - TAU / 4.0).abs() < 0.03, "{start:?}");
    }
}

/// Receivers write seven decimals, 11 mm: what the last digit does to the curvature is smoothed.
#[test]
fn seven_decimals_are_enough() {
    let road = read("lat,lon", &circle(48.137, 11.575, 7), [0, 1], ",").unwrap();
    for share in [0.2, 0.5, 0.8] {
        let radius = 1.0 / road.at(share * road.length()).curvature;
        assert!((radius - 50.0).abs() < 2.5, "{radius}");
    }
}

#[test]
fn metres_come_first_and_what_lies_nowhere_is_refused() {
    let both = "x,y,lat,lon\n0,0,48,11\n10,0,48,11\n20,1,48,11\n30,3,48,11\n";
    let road = parse(both).unwrap();
    assert!((road.length() - 30.2).abs() < 0.2, "{}", road.length());
    let mut rows = circle(48.0, 11.0, 8);
    rows[7][0] = "95.1".into();
    let error = read("lat,lon", &rows, [0, 1], ",").err().unwrap();
    assert!(
        error.contains("line 9") && error.contains("column `lat`") && error.contains("degrees"),
        "{error}"
    );
    let error = parse("lat,y\n48,1\n48,2\n48,3\n").err().unwrap();
    assert!(error.contains('x'), "{error}");
}
