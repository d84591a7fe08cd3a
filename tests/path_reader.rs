//! Files of roads: every format is read, and everything that can be wrong is said with file, line and column.

use proptest::prelude::*;
use rfl_mpc::path::{
    Closure, Path, PathError, PathOptions, Sample, Smoothing, SpeedLimits, SpeedPlan, to_csv,
};
use std::path::Path as FilePath;

fn read(text: &str) -> Result<Path, PathError> {
    Path::from_csv(text.as_bytes(), FilePath::new("road.csv"), &PathOptions::default())
}

/// Reads what must be refused; gives the error and its message.
fn refuse(text: &str) -> (PathError, String) {
    let error = read(text).expect_err("was read");
    let message = error.to_string();
    assert!(message.starts_with("road.csv"), "no file in: {message}");
    (error, message)
}

fn has(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "no `{part}` in: {message}");
    }
}

/// `x,y` and a straight road with one more column.
fn with_column(name: &str, values: &[&str]) -> String {
    let rows = values.iter().enumerate().map(|(i, value)| format!("{i},0,{value}\n"));
    format!("x,y,{name}\n{}", rows.collect::<String>())
}

#[test]
fn a_bank_that_no_road_has_in_radians_is_said() {
    for (name, value, warned) in
        [("bank", "0.7", true), ("grade", "-0.7", true), ("bank", "0.57", false), ("bank [deg]", "33", false)]
    {
        let path = read(&with_column(name, &["0", "0", value, "0", value])).unwrap();
        let said: Vec<&str> =
            path.notes().iter().filter(|note| note.warning).map(|note| note.text.as_str()).collect();
        assert_eq!(said.len(), usize::from(warned), "{said:?}");
        said.iter().for_each(|words| has(words, &["line 4", name, "40 degrees", "1 more rows", "[deg]"]));
    }
}

#[test]
fn our_format_is_read() {
    let path = read(
        "x,y,speed,bank,grade,friction,class\n0,0,10,0.01,0.02,0.9,straight\n5,0,,,,,\n10,0,12,0.03,0,1,sweeper\n",
    )
    .unwrap();
    assert!((path.length() - 10.0).abs() < 1e-9);
    let point = path.at(0.0);
    assert_eq!((point.speed, point.bank, point.grade, point.friction), (Some(10.0), 0.01, 0.02, 0.9));
    assert_eq!(point.class.unwrap().name(), "straight");
}

#[test]
fn comments_blank_lines_quotes_spaces_and_a_byte_order_mark_do_no_harm() {
    let path = read("\u{feff}# drawn by hand\r\n\r\nx , y\r\n\"0\", 0\r\n# half way\r\n5,0\r\n\r\n10,0\r\n")
        .unwrap();
    assert!((path.length() - 10.0).abs() < 1e-9);
}

#[test]
fn the_racetrack_database_s_format_is_read() {
    let rows: String = (0..100)
        .map(|i| f64::from(i) * 0.062_831_853)
        .map(|a| format!("{:.6},{:.6},5.076,5.462\n", 80.0 * a.cos(), 80.0 * a.sin()))
        .collect();
    let path = read(&format!("# x_m,y_m,w_tr_right_m,w_tr_left_m\n{rows}")).unwrap();
    assert!(path.is_periodic());
    assert!((path.curvature(20.0) - 0.0125).abs() < 1e-5);
}

#[test]
fn a_driven_lap_is_read_with_its_speed() {
    let path = read("# x_m,y_m,v_driven_mps\n-0.842,23.620,9.768\n-0.026,24.198,9.778\n0.791,24.775,9.773\n")
        .unwrap();
    assert!((path.at(0.0).speed.unwrap() - 9.768).abs() < 1e-9);
    assert!(!path.is_periodic());
}

#[test]
fn a_missing_file_is_named() {
    let error = Path::read(FilePath::new("no/such/road.csv")).unwrap_err();
    assert!(matches!(error, PathError::Io { .. }));
    has(&error.to_string(), &["no/such/road.csv", "cannot be read", "check the name"]);
}

#[test]
fn an_empty_file_is_refused() {
    for text in ["", "\n\n", "x,y\n", "# only a comment\n", "# x_m,y_m\n"] {
        let (error, message) = refuse(text);
        assert!(matches!(error, PathError::Empty { .. }), "{message}");
        has(&message, &["x,y"]);
    }
}

#[test]
fn one_point_is_no_road() {
    let (error, message) = refuse("x,y\n1,2\n");
    assert!(matches!(error, PathError::TooFewPoints { count: 1, needed: 2, .. }));
    has(&message, &["1 distinct point"]);
    let (error, _) = refuse("x,y\n1,2\n1,2\n1,2\n");
    assert!(matches!(error, PathError::TooFewPoints { count: 1, .. }));
    let closed = PathOptions { closure: Closure::Closed, ..PathOptions::default() };
    let error = Path::from_csv(b"x,y\n1,2\n4,2\n", FilePath::new("road.csv"), &closed).unwrap_err();
    assert!(matches!(error, PathError::TooFewPoints { count: 2, needed: 3, .. }));
}

#[test]
fn points_that_repeat_the_one_before_are_dropped_and_it_is_said() {
    let path = read("x,y\n0,0\n1,0\n1,0\n1,0\n2,0\n3,0\n").unwrap();
    assert!((path.length() - 3.0).abs() < 1e-9);
    let [note] = path.notes() else { panic!("{:?}", path.notes()) };
    assert!(!note.warning && note.text == "2 point(s) dropped that repeat the one before", "{note}");
}

#[test]
fn what_is_not_a_number_is_found() {
    let (error, message) = refuse("x,y\n0,0\n1,zero\n2,0\n");
    assert!(matches!(error, PathError::NotANumber { column: "y", .. }));
    has(&message, &["line 3", "column `y`", "`zero`", "12.5"]);
    let (_, message) = refuse("x,y\n0,0\n1,\n2,0\n");
    has(&message, &["line 3", "column `y`"]);
    let (_, message) = refuse("x:y\n0:0\n");
    has(&message, &["line 1", "x:y"]);
    let (_, message) = refuse("x,y\n0,0.5\n\"1,5\",0\n");
    has(&message, &["line 3", "column `x`", "1,5"]);
}

#[test]
fn nan_and_infinity_are_found() {
    for text in ["nan", "NaN", "inf", "-inf", "1e999"] {
        let (error, message) = refuse(&format!("x,y\n0,0\n# comment\n1,{text}\n2,0\n"));
        assert!(matches!(error, PathError::NotFinite { column: "y", .. }), "{message}");
        has(&message, &["line 4", "column `y`", "not finite"]);
    }
    let (error, _) = refuse(&with_column("speed", &["1", "nan", "2"]));
    assert!(matches!(error, PathError::NotFinite { column: "speed", .. }));
    let error =
        Path::from_samples(vec![Sample::at(0.0, 0.0), Sample::at(f64::NAN, 0.0)], Closure::Open).unwrap_err();
    has(&error.to_string(), &["point 1", "column `x`"]);
}

#[test]
fn unknown_missing_and_repeated_columns_are_found() {
    let read = read("x,y,velocity,ele\n0,0,1,high\n1,0,1,\n").unwrap();
    let said = read.notes().iter().find(|note| note.warning).unwrap();
    has(&said.text, &["velocity, ele", "not used", "speed", "friction", "latitude"]);
    let (error, message) = refuse("x,speed\n0,0\n");
    assert!(matches!(error, PathError::MissingColumn { column: "y", .. }));
    has(&message, &["line 1", "`y`", "x, speed"]);
    let (error, message) = refuse("x,y,x\n0,0,1\n");
    assert!(matches!(error, PathError::RepeatedColumn { number: 3, .. }), "{message}");
    // A file without a header.
    let (error, message) = refuse("0.5,1.5\n1,2\n");
    assert!(matches!(error, PathError::MissingColumn { column: "x", .. }), "{message}");
    has(&message, &["line 1", "header"]);
}

#[test]
fn short_and_long_rows_are_found() {
    for row in ["1", "1,2,3"] {
        let (error, message) = refuse(&format!("x,y\n0,0\n{row}\n2,0\n"));
        assert!(matches!(error, PathError::RowLength { expected: 2, .. }));
        has(&message, &["line 3", "2 columns"]);
    }
    // Cut off in mid-row.
    let (_, message) = refuse("x,y,speed\n0,0,1\n1,0,1\n2,0");
    has(&message, &["line 4"]);
}

#[test]
fn a_file_that_is_no_text_is_refused() {
    let error = Path::from_csv(b"x,y\n0,0\n\xff\xfe,1\n", FilePath::new("road.csv"), &PathOptions::default())
        .unwrap_err();
    assert!(matches!(error, PathError::NotText { .. }));
    has(&error.to_string(), &["road.csv, line 3", "UTF-8"]);
}

#[test]
fn a_gap_is_found() {
    // In a bend of 100 m radius.
    let at = |i: u32| (f64::from(i) * 0.01).sin_cos();
    let row = |i: u32| format!("{},{}\n", 100.0 * at(i).0, 100.0 - 100.0 * at(i).1);
    let rows: String = (0..100).filter(|i| !(40..80).contains(i)).map(row).collect();
    let (error, message) = refuse(&format!("x,y\n{rows}"));
    assert!(matches!(error, PathError::Gap { .. }));
    has(&message, &["line 42", "40.7 m", "1.00 m", "fill the gap"]);
    // Uneven spacing of 0.1 m to 20 m is none.
    let rows: String =
        [0.0, 0.1, 0.2, 0.3, 0.4, 20.0, 40.0, 40.1, 40.2].iter().map(|x| format!("{x},0\n")).collect();
    assert!(read(&format!("x,y\n{rows}")).is_ok());
    // A road that is said to be closed and is not.
    let rows: String = (0..200).map(|i| format!("{i},{}\n", (f64::from(i) / 60.0).sin())).collect();
    let closed = PathOptions { closure: Closure::Closed, ..PathOptions::default() };
    let error =
        Path::from_csv(format!("x,y\n{rows}").as_bytes(), FilePath::new("road.csv"), &closed).unwrap_err();
    assert!(matches!(error, PathError::Gap { .. } | PathError::TurnsBack { .. }), "{error}");
}

#[test]
fn points_out_of_order_are_found() {
    let (error, message) = refuse("x,y\n0,0\n1,0\n2,0\n4,0\n3,0\n5,0\n6,0\n");
    assert!(matches!(error, PathError::TurnsBack { .. }));
    has(&message, &["line 5", "180 degrees", "driving order"]);
    let (error, message) = refuse("x,y,s\n0,0,0\n1,0,1\n2,0,3\n3,0,2\n");
    assert!(matches!(error, PathError::Unordered { .. }));
    has(&message, &["line 5", "column `s`", "2 after 3"]);
}

#[test]
fn other_units_are_suspected() {
    // Degrees of latitude and longitude.
    let rows: String = (0..50).map(|i| format!("{:.7},{:.7}\n", 11.5 + f64::from(i) * 1e-5, 48.1)).collect();
    let (error, message) = refuse(&format!("x,y\n{rows}"));
    assert!(matches!(error, PathError::SuspiciousUnit { .. }), "{message}");
    has(&message, &["hardly in m"]);
    // Millimetres.
    let rows: String = (0..50).map(|i| format!("{},0\n", i * 1000)).collect();
    assert!(matches!(refuse(&format!("x,y\n{rows}")).0, PathError::SuspiciousUnit { .. }));
    // Degrees of bank, per cent of grade, km/h, radius for curvature.
    for (column, value) in
        [("bank", "3.5"), ("grade", "-5"), ("speed", "-1"), ("curvature", "25"), ("friction", "85")]
    {
        let (error, message) = refuse(&with_column(column, &["0.5", value, "0.5"]));
        assert!(matches!(error, PathError::OutOfRange { .. }), "{message}");
        has(&message, &["line 3", column, value]);
    }
}

#[test]
fn points_far_apart_on_a_straight_and_points_close_together_are_no_other_unit() {
    assert!((read("x,y\n0,0\n3000,0\n").unwrap().length() - 3000.0).abs() < 1e-6);
    let rows: String = (0..200_000).map(|i| format!("{:.4},0\n", f64::from(i) * 1e-4)).collect();
    assert!((read(&format!("x,y\n{rows}")).unwrap().length() - 20.0).abs() < 1e-3);
}

#[test]
fn a_speed_of_nought_is_refused_or_said_unless_it_begins_or_ends_the_road() {
    let (error, message) = refuse(&with_column("speed", &["0", "0", "0"]));
    assert!(matches!(error, PathError::Standing { .. }));
    has(&message, &["column `speed`", "no vehicle moves"]);
    let road = |speeds: &[&str]| read(&with_column("speed", speeds)).unwrap();
    let said = |path: &Path| path.notes().iter().any(|note| note.text.contains("the speed is 0 at"));
    assert!(!said(&road(&["0", "5", "5", "0"])));
    // A drive that was recorded before it began to move.
    let lasts = |path: &Path| SpeedPlan::new(path, &SpeedLimits::default()).duration();
    let stood = road(&["0", "0", "0", "5", "5", "0", "0"]);
    assert!(said(&stood) && lasts(&stood).is_finite());
    // A lap from rest to rest.
    let lap: String = (0..100)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 100.0).sin_cos();
            format!("{:.4},{:.4},{}\n", 40.0 * cos, 40.0 * sin, if (3..97).contains(&i) { 8 } else { 0 })
        })
        .collect();
    let lap = read(&format!("x,y,speed\n{lap}")).unwrap();
    assert!(lap.is_periodic() && said(&lap) && lasts(&lap).is_finite());
    let path = road(&["0", "5", "0", "", "0", "3", "0"]);
    assert!(said(&path));
    let path = road(&["4", "4", "0", "0", "1", "1"]);
    let duration = SpeedPlan::new(&path, &SpeedLimits::default()).duration();
    assert!(said(&path) && (1.5..4.0).contains(&duration), "{duration}");
}

#[test]
fn a_lap_that_ends_across_its_start_is_open() {
    let eight = |laps: f64, count: usize, noise: f64| -> String {
        let points = (0..count).map(|i| {
            let p = laps * std::f64::consts::PI * i as f64 / (count - 1) as f64;
            let off = |k: usize| noise * ((37 * i + 11 * k) % 7) as f64 / 7.0;
            format!("{:.4},{:.4}\n", 80.0 * p.sin() + off(1), 80.0 * p.sin() * p.cos() + off(2))
        });
        format!("x,y\n{}", points.collect::<String>())
    };
    for (laps, count, noise) in [(1.0, 250, 0.0), (1.0, 250, 0.1), (5.0, 1200, 0.1)] {
        let path = read(&eight(laps, count, noise)).unwrap();
        assert!(!path.is_periodic(), "{laps}, {noise}: {:?}", path.notes());
    }
    assert!(read(&eight(2.0, 500, 0.0)).unwrap().is_periodic());
    // A rectangle from its corner has such corners elsewhere.
    let side = |from: [f64; 2], by: [f64; 2]| {
        (0..20)
            .map(|i| format!("{},{}\n", from[0] + by[0] * f64::from(i), from[1] + by[1] * f64::from(i)))
            .collect::<String>()
    };
    let sides = [
        ([0.0, 0.0], [2.0, 0.0]),
        ([40.0, 0.0], [0.0, 2.0]),
        ([40.0, 40.0], [-2.0, 0.0]),
        ([0.0, 40.0], [0.0, -2.0]),
    ];
    let text: String = sides.into_iter().map(|(from, by)| side(from, by)).collect();
    assert!(read(&format!("x,y\n{text}0,0\n")).unwrap().is_periodic());
}

#[test]
fn an_unknown_class_is_found() {
    let (error, message) = refuse(&with_column("class", &["straight", "roundabout", "straight"]));
    assert!(matches!(error, PathError::UnknownClass { .. }));
    has(&message, &["line 3", "roundabout", "u_turn"]);
}

#[test]
fn a_closed_road_is_told_from_an_open_one() {
    let ring = |from: usize, to: usize| {
        let rows =
            (from..to).map(|i| i as f64 * 0.05).map(|a| format!("{},{}\n", 50.0 * a.cos(), 50.0 * a.sin()));
        format!("x,y\n{}", rows.collect::<String>())
    };
    // 125.66 steps are a lap.
    assert!(read(&ring(0, 125)).unwrap().is_periodic());
    assert!(!read(&ring(0, 115)).unwrap().is_periodic());
    // The last point repeats the first.
    let square = "x,y\n0,0\n5,0\n10,0\n12,3\n10,6\n5,6\n0,6\n-2,3\n0,0\n";
    assert!(read(square).unwrap().is_periodic());
    // A road that passes its start in the other direction is not closed: a U-turn's ends, 3.5 m apart.
    let back: String = (0..=20)
        .map(|i| format!("{},0\n", 2 * i))
        .chain(
            (1..7)
                .map(|i| f64::from(i) * 0.45)
                .map(|a| format!("{},{}\n", 40.0 + 1.75 * a.sin(), 1.75 * (1.0 - a.cos()))),
        )
        .chain((0..=20).map(|i| format!("{},3.5\n", 40 - 2 * i)))
        .collect();
    assert!(!read(&format!("x,y\n{back}")).unwrap().is_periodic());
    // And who knows better says so.
    let open = PathOptions { closure: Closure::Open, ..PathOptions::default() };
    assert!(!Path::from_csv(ring(0, 125).as_bytes(), FilePath::new("r"), &open).unwrap().is_periodic());
}

#[test]
fn what_is_not_used_is_said() {
    let path = read("x,y,yaw\n0,0,0\n1,0,0\n2,0,0\n").unwrap();
    has(&path.notes()[0].text, &["not used", "both"]);
    // A lap that was recorded 20 points too long.
    let rows =
        (0..146).map(|i| f64::from(i) * 0.05).map(|a| format!("{},{}\n", 50.0 * a.cos(), 50.0 * a.sin()));
    let path = read(&format!("x,y\n{}", rows.collect::<String>())).unwrap();
    assert!(!path.is_periodic());
    has(&path.notes()[0].text, &["passes its start again at point 12", "of 146"]);
}

#[test]
fn two_laps_in_one_are_said_and_one_is_not() {
    for laps in [1, 2] {
        let point = |i: i32| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 100.0).sin_cos();
            format!("{:.3},{:.3}\n", 50.0 * cos, 50.0 * sin)
        };
        let path = read(&format!("x,y\n{}", (0..100 * laps).map(point).collect::<String>())).unwrap();
        assert!(path.is_periodic());
        let said =
            path.notes().iter().any(|note| note.warning && note.text.contains("passes its start again"));
        assert_eq!(said, laps == 2, "{:?}", path.notes());
    }
}

#[test]
fn noisy_points_are_noticed() {
    let rows: String = (0..200).map(|i| format!("{i},{}\n", if i % 2 == 0 { 0.02 } else { -0.02 })).collect();
    let none = PathOptions { smoothing: Smoothing::None, ..PathOptions::default() };
    let path = Path::from_csv(format!("x,y\n{rows}").as_bytes(), FilePath::new("r"), &none).unwrap();
    has(&path.notes()[0].text, &["noisy", "smoothing tolerance"]);
    let smooth = PathOptions { smoothing: Smoothing::Within(0.03), ..PathOptions::default() };
    let path = Path::from_csv(format!("x,y\n{rows}").as_bytes(), FilePath::new("r"), &smooth).unwrap();
    assert!((0..190).all(|s| path.curvature(f64::from(s)).abs() < 1e-3));
    has(&path.notes()[0].text, &["smoothed: 30.0 mm RMS"]);
}

#[test]
fn a_road_survives_writing_and_reading() {
    let samples: Vec<Sample> = (0..60)
        .map(|i| f64::from(i) * 0.1)
        .map(|a| Sample {
            speed: Some(7.25),
            bank: (a < 3.0).then_some(0.0123),
            ..Sample::at(40.0 * a.sin(), -40.0 * a.cos())
        })
        .collect();
    let text = to_csv(&samples);
    assert!(text.starts_with("x,y,speed,bank\n"), "{text}");
    let (before, after) = (Path::from_samples(samples, Closure::Detect).unwrap(), read(&text).unwrap());
    assert!((before.length() - after.length()).abs() < 1e-5);
    for i in 0..200 {
        let s = f64::from(i);
        assert!((before.curvature(s) - after.curvature(s)).abs() < 1e-5);
        assert!((before.at(s).bank - after.at(s).bank).abs() < 1e-4);
    }
}

/// Text that looks like a path file, mostly.
fn almost_a_file() -> impl Strategy<Value = String> {
    let field = prop_oneof![
        6 => (-1e3..1e3f64).prop_map(|value| value.to_string()),
        1 => any::<f64>().prop_map(|value| value.to_string()),
        1 => "[a-z#\",;\\-. \r0-9]{0,6}",
    ];
    let row = proptest::collection::vec(field, 1..5).prop_map(|fields| fields.join(","));
    let header = prop_oneof![
        4 => Just("x,y".to_string()),
        1 => Just("x,y,speed".to_string()),
        1 => Just("# x_m,y_m,w_tr_right_m,w_tr_left_m".to_string()),
        1 => Just("s,yaw,curvature,x,y,class".to_string()),
        1 => "[a-z_,#\"]{0,20}",
    ];
    (header, proptest::collection::vec(row, 0..30))
        .prop_map(|(header, rows)| format!("{header}\n{}", rows.join("\n")))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = Path::from_csv(&bytes, FilePath::new("fuzz.csv"), &PathOptions::default());
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in almost_a_file(), within in proptest::option::of(0.0..1.0f64)) {
        let smoothing = within.map_or(Smoothing::AsAccurate, Smoothing::Within);
        for closure in [Closure::Detect, Closure::Open, Closure::Closed] {
            let options = PathOptions { closure, smoothing, ..PathOptions::default() };
            if let Ok(path) = Path::from_csv(text.as_bytes(), FilePath::new("fuzz.csv"), &options) {
                // What is accepted is usable.
                prop_assert!(path.length().is_finite() && path.length() > 0.0);
                for i in -2..12 {
                    let s = path.length() * f64::from(i) / 10.0;
                    let point = path.at(s);
                    prop_assert!(point.x.is_finite() && point.y.is_finite() && point.yaw.is_finite());
                    prop_assert!(point.curvature.is_finite() && point.curvature_rate.is_finite());
                    prop_assert!(path.project(point.x, point.y, point.yaw, Some(s)).e1.is_finite());
                }
            }
        }
    }
}
