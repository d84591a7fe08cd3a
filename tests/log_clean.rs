//! Cleaning a log: what is mended, what is refused, and what is said of it.
//!
//! The log is that of a vehicle that steers as in steady cornering with a short lag: every sign and unit in it is known.

use crate::drive_table::DriveTable;
use proptest::prelude::*;
use rfl_mpc::log::{CleanError, CleanLog, DriveLog, FindingSeverity, JoinError, UnusableLog};
use std::path::Path;

const WHEELBASE: f64 = 2.7;
const UNDERSTEER: f64 = 0.002;

fn steering(speed: f64) -> f64 {
    WHEELBASE + UNDERSTEER * speed * speed
}

/// A drive of `length` s with `rate` rows a second.
fn drive(length: f64, rate: f64) -> DriveTable {
    let names =
        ["time", "steer_cmd", "accel_cmd", "x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "steer"];
    let step = 1.0 / rate;
    let (mut x, mut y, mut yaw, mut yaw_rate, mut angle, mut rows) = (3.0, -2.0, 0.4, 0.0, 0.0, Vec::new());
    for row in 0..(length * rate).round() as usize {
        let time = step * row as f64;
        let vx = 10.0 + 3.0 * (0.2 * time).sin();
        let steer = 0.05 * (0.5 * time).sin() + 0.03 * (1.3 * time).sin();
        yaw_rate += (vx * steer / steering(vx) - yaw_rate) * (step / 0.1).min(1.0);
        angle += (steer - angle) * (step / 0.05).min(1.0);
        rows.push(vec![
            time,
            steer,
            0.6 * (0.2 * time).cos(),
            x,
            y,
            yaw,
            vx,
            0.0,
            yaw_rate,
            0.6 * (0.2 * time).cos(),
            vx * yaw_rate,
            angle,
        ]);
        x += step * vx * yaw.cos();
        y += step * vx * yaw.sin();
        yaw += step * yaw_rate;
    }
    // Nothing is exactly constant in a measurement.
    rows.iter_mut().enumerate().for_each(|(i, row)| row[7] = 1e-4 * (i as f64).sin());
    DriveTable::new(&names, rows)
}

/// What cleaning makes of a table.
trait Cleaned {
    fn read(&self) -> Result<CleanLog, UnusableLog>;

    fn clean(&self) -> CleanLog {
        self.read().unwrap()
    }

    fn refused(&self) -> CleanError {
        self.read().unwrap_err().cause
    }
}

impl Cleaned for DriveTable {
    fn read(&self) -> Result<CleanLog, UnusableLog> {
        CleanLog::of(&self.log(), &steering)
    }
}

/// The gravest word on a column, which must contain `part`.
fn said(log: &CleanLog, column: &str, part: &str) -> FindingSeverity {
    let finding = log
        .findings
        .iter()
        .find(|finding| finding.signal.as_deref() == Some(column) && finding.summary.contains(part));
    finding.unwrap_or_else(|| panic!("nothing on {column} with '{part}' in {:#?}", log.findings)).gravity
}

/// Largest difference of a column from that of the sound log, where it is judged.
fn apart(log: &CleanLog, column: &str) -> f64 {
    let sound = drive(40.0, 50.0).clean();
    let pairs = log.columns[column].iter().zip(&sound.columns[column]).zip(&log.valid);
    pairs.filter(|(_, valid)| **valid).map(|((a, b), _)| (a - b).abs()).fold(0.0, f64::max)
}

fn sound() -> DriveTable {
    drive(40.0, 50.0)
}

#[test]
fn a_sound_log_is_left_as_it_is() {
    let log = sound().clean();
    assert_eq!((log.step, log.time.len(), log.commanded), (0.02, 2000, true));
    assert!(log.valid.iter().all(|valid| *valid));
    assert!(
        log.findings.iter().all(|finding| finding.gravity == FindingSeverity::Note),
        "{:#?}",
        log.findings
    );
    for (row, values) in sound().rows.iter().enumerate() {
        let yaw_rate: f64 = values[8].parse().unwrap();
        assert!((log.columns["yaw_rate"][row] - yaw_rate).abs() < 1e-9);
    }
}

#[test]
fn too_little_is_refused() {
    assert_eq!(sound().keep(|_| false).refused(), CleanError::NoRows { rows: 0 });
    assert_eq!(sound().keep(|row| row == 7).refused(), CleanError::NoRows { rows: 1 });
    assert!(matches!(sound().keep(|row| row < 100).refused(), CleanError::TooShort { rows: 100, .. }));
    assert!(matches!(drive(60.0, 1.0).refused(), CleanError::TooSlow { .. }));
    // The last row of a drive of 10 s comes a step before its end.
    for rate in [20.0, 30.0, 50.0, 100.0] {
        assert_eq!(drive(10.0, rate).clean().time.len(), (10.0 * rate) as usize);
        assert!(matches!(drive(9.9, rate).refused(), CleanError::TooShort { .. }));
    }
    assert!(matches!(sound().scaled(&["vx"], 0.01).without(&["x"]).refused(), CleanError::Standing { .. }));
    for column in ["time", "vx", "yaw_rate"] {
        let missing = CleanError::Missing { column, near: Vec::new() };
        assert_eq!(sound().without(&[column]).refused(), missing);
    }
    assert_eq!(
        sound().without(&["steer"]).without(&["steer_cmd"]).refused(),
        CleanError::Missing { column: "steer_cmd", near: Vec::new() }
    );
    let empty = sound().map("yaw_rate", |_, _| f64::NAN);
    assert!(matches!(empty.refused(), CleanError::Sparse { column: "yaw_rate", .. }));
}

#[test]
fn the_measured_angle_stands_in_for_a_missing_command() {
    let log = sound().without(&["steer_cmd"]).clean();
    assert!(!log.commanded);
    assert_eq!(log.columns["steer_cmd"], log.columns["steer"]);
    said(&log, "steer_cmd", "stands in");
}

#[test]
fn rows_out_of_order_are_sorted_and_repeated_ones_dropped() {
    let mut table = sound();
    for i in (0..1900).step_by(40) {
        table.rows.swap(i, i + 5);
    }
    let again = table.rows[300].clone();
    table.rows.insert(300, again);
    let log = table.clean();
    assert_eq!(said(&log, "time", "out of order"), FindingSeverity::Warning);
    said(&log, "time", "stand twice");
    assert_eq!(apart(&log, "yaw_rate"), 0.0);
}

#[test]
fn a_clock_that_is_set_back_parts_the_drive() {
    let log = sound().map("time", |row, time| if row < 1510 { time } else { time - 25.0 }).clean();
    assert_eq!(said(&log, "time", "jumps back"), FindingSeverity::Warning);
    assert_eq!(log.time.len(), 1510);
}

#[test]
fn a_clock_that_is_set_ahead_leaves_no_gap() {
    for ahead in [0.12, 0.35, 3.0] {
        let log = sound().map("time", |row, time| if row < 700 { time } else { time + ahead }).clean();
        assert_eq!(said(&log, "time", "the clock goes ahead by"), FindingSeverity::Warning);
        assert!(
            log.time.len() == sound().clean().time.len() && log.valid[650..750].iter().all(|valid| *valid)
        );
    }
    // Rows that are missing are.
    let mut table = sound();
    table.rows.drain(700..720);
    let log = table.clean();
    said(&log, "time", "1 gaps");
    assert!(!log.findings.iter().any(|finding| finding.summary.contains("ahead")));
}

#[test]
fn a_clock_that_is_set_back_a_little_parts_the_drive() {
    let log = sound().map("time", |row, time| if row < 700 { time } else { time - 0.12 }).clean();
    assert_eq!(said(&log, "time", "jumps back"), FindingSeverity::Warning);
    assert!(apart(&log, "vx") < 1.0 && log.time.len() >= sound().clean().time.len());
}

#[test]
fn other_units_of_time_are_converted() {
    for (factor, word) in [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")] {
        let log = sound().scaled(&["time"], factor).clean();
        assert_eq!(said(&log, "time", word), FindingSeverity::Warning);
        assert!((log.step - 0.02).abs() < 1e-9 && apart(&log, "vx") < 1e-6);
    }
    // A row each millisecond, counted in milliseconds: only the way driven tells that it is not one each second.
    let log = drive(20.0, 1000.0).scaled(&["time"], 1e3).clean();
    assert_eq!(log.step, 0.01);
    said(&log, "time", "averaging");
}

#[test]
fn times_that_repeat_are_spread() {
    let log = sound().map("time", |_, time| (time * 10.0 + 1e-9).floor() / 10.0).clean();
    assert_eq!(said(&log, "time", "repeat the time"), FindingSeverity::Warning);
    assert!((log.step - 0.02).abs() < 1e-3 && apart(&log, "yaw_rate") < 2e-3);
}

#[test]
fn late_stamps_of_even_rows_are_straightened() {
    let late = |row: usize| 0.012 * (0.5 + 0.5 * (row as f64 * 12.9898).sin());
    let log = sound().map("time", |row, time| time + late(row)).clean();
    said(&log, "time", "even clock");
    // A common delay of half the spread stays.
    assert!((log.step - 0.02).abs() < 1e-5 && apart(&log, "yaw_rate") < 3e-3);
}

#[test]
fn gaps_are_filled_and_not_judged() {
    let log = sound().keep(|row| !(500..700).contains(&row)).clean();
    assert_eq!(said(&log, "time", "1 gaps"), FindingSeverity::Warning);
    assert_eq!(log.time.len(), 2000);
    assert!(!log.valid[600] && log.valid[400] && !log.valid[710] && log.valid[800]);
    // Two drives in one file.
    let log = sound().map("time", |row, time| if row < 800 { time } else { time + 1e4 }).clean();
    said(&log, "time", "longest drive");
    assert_eq!(log.time.len(), 1200);
}

#[test]
fn stretches_without_a_value_are_not_judged() {
    let hole = |row: usize, value: f64| if (900..1000).contains(&row) { f64::NAN } else { value };
    let log = sound().map("yaw_rate", hole).clean();
    assert_eq!(said(&log, "yaw_rate", "are missing"), FindingSeverity::Warning);
    assert!(log.columns["yaw_rate"].iter().all(|value| value.is_finite()));
    assert!(!log.valid[950] && log.valid[1100]);
    let infinite = sound().map("ay", |row, value| if row == 70 { f64::INFINITY } else { value }).clean();
    assert_eq!(said(&infinite, "ay", "not finite"), FindingSeverity::Note);
    assert!(infinite.valid[70]);
    // A slow receiver: one row in five has a position.
    let slow = |row: usize, value: f64| if row.is_multiple_of(5) { value } else { f64::NAN };
    let log = sound().map("x", slow).map("y", slow).clean();
    assert!(log.valid.iter().filter(|valid| **valid).count() > 1990 && apart(&log, "x") < 0.02);
}

#[test]
fn a_column_that_never_changes_is_left_out() {
    let log = sound().map("ay", |_, _| 0.0).clean();
    assert_eq!(said(&log, "ay", "never changes"), FindingSeverity::Warning);
    assert!(!log.columns.contains_key("ay"));
    let log = sound().map("yaw_rate", |_, _| 0.0).without(&["yaw"]).clean();
    assert!(log.suspect().is_some());
}

#[test]
fn degrees_are_converted() {
    const DEGREES: f64 = 180.0 / std::f64::consts::PI;
    for columns in [
        &["yaw"][..],
        &["yaw_rate"],
        &["yaw", "yaw_rate"],
        &["steer_cmd"],
        &["steer_cmd", "steer", "yaw", "yaw_rate"],
    ] {
        let table = columns.iter().fold(sound(), |table, column| table.scaled(&[column], DEGREES));
        let log = table.clean();
        for column in columns {
            assert_eq!(said(&log, column, "degrees"), FindingSeverity::Warning);
            assert!(apart(&log, column) < 1e-9, "{columns:?}: {column} off by {}", apart(&log, column));
        }
    }
}

/// The sound log with the angles of body, trailer and road, and what the accelerometer shows of the road.
fn leaning() -> DriveTable {
    let table = sound()
        .and("grade", |of| 0.05 * (0.11 * of("time")).sin())
        .and("bank", |of| 0.04 * (0.07 * of("time")).sin())
        .and("roll", |of| 0.006 * of("vx") * of("yaw_rate"))
        .and("articulation", |of| 6.0 * of("yaw_rate") / of("vx"));
    let column = |name: &str| -> Vec<f64> {
        table.rows.iter().map(|row| row[table.place(name)].parse().unwrap()).collect()
    };
    let (grade, bank, angle) = (column("grade"), column("bank"), column("articulation"));
    let rate = |row: usize| {
        let (before, after) = (row.saturating_sub(1), (row + 1).min(angle.len() - 1));
        (angle[after] - angle[before]) / (0.02 * (after - before) as f64)
    };
    table
        .map("ax", |row, ax| ax + 9.81 * grade[row].sin())
        .map("ay", |row, ay| ay + 9.81 * bank[row].sin())
        .and("pitch", |of| -0.004 * of("ax"))
        .and("articulation_rate", |_| 0.0)
        .map("articulation_rate", |row, _| rate(row))
}

#[test]
fn angles_of_body_trailer_and_road_are_converted() {
    const DEGREES: f64 = 180.0 / std::f64::consts::PI;
    let right = leaning().clean();
    assert!(
        right.findings.iter().all(|finding| finding.gravity == FindingSeverity::Note),
        "{:#?}",
        right.findings
    );
    for (columns, factor, words) in [
        (&["roll"][..], DEGREES, "taken as degrees"),
        (&["pitch"], -DEGREES, "taken as degrees"),
        (&["articulation", "articulation_rate"], DEGREES, "converted to rad"),
        (&["articulation"], DEGREES, "taken as degrees"),
        (&["articulation_rate"], DEGREES, "taken as deg/s"),
        (&["grade"], DEGREES, "taken as degrees"),
        (&["grade"], 100.0, "taken as per cent"),
        (&["bank"], -DEGREES, "taken as degrees"),
        (&["roll", "pitch", "articulation", "articulation_rate", "grade", "bank"], DEGREES, "taken as deg"),
    ] {
        let log = leaning().scaled(columns, factor).clean();
        for &column in columns {
            assert_eq!(said(&log, column, words), FindingSeverity::Warning);
            let off = log.columns[column].iter().zip(&right.columns[column]).map(|(a, b)| {
                let sign = factor.signum();
                (sign * a - b).abs()
            });
            assert!(off.fold(0.0, f64::max) < 1e-9, "{columns:?}: {column}");
        }
    }
    // A soft body is no unit, and what the motion does not tell is left out.
    let soft = leaning().scaled(&["roll"], 4.0).clean();
    assert!(
        soft.findings.iter().all(|finding| finding.gravity == FindingSeverity::Note),
        "{:#?}",
        soft.findings
    );
    let odd = leaning().map("roll", |row, _| 40.0 * (0.9 * row as f64).sin()).clean();
    assert_eq!(said(&odd, "roll", "left out"), FindingSeverity::Warning);
    assert!(!odd.columns.contains_key("roll") && odd.suspect().is_none());
}

#[test]
fn roll_in_degrees_is_told_by_how_far_a_body_leans() {
    // From a racing car, 0.7 degrees for 1 g, to a loaded van, 11.
    for leaning in [0.00125, 0.006, 0.0196] {
        for (unit, is_foreign) in [(1.0, false), (57.29578, true)] {
            let roll = |of: &dyn Fn(&str) -> f64| unit * leaning * of("vx") * of("yaw_rate");
            let log = sound().and("roll", roll).clean();
            let found = log.findings.iter().any(|it| it.signal.as_deref() == Some("roll"));
            assert_eq!(found, is_foreign, "{leaning}: {:?}", log.findings);
            let most = log.columns["roll"].iter().fold(0.0_f64, |most, roll| most.max(roll.abs()));
            assert!(most < 0.15, "{leaning}: {most}");
        }
    }
}

#[test]
fn a_yaw_in_degrees_is_told_beside_noise_that_is_more_than_it_changes_in_a_row() {
    let noisy = |row: usize, yaw: f64| 57.29578 * (yaw + 0.02 * (1.3 * row as f64 * row as f64).sin());
    let log = sound().map("yaw", noisy).clean();
    assert_eq!(said(&log, "yaw", "degrees"), FindingSeverity::Warning);
}

#[test]
fn wrapped_yaw_is_made_continuous() {
    let log = sound().map("yaw", |_, yaw| (yaw - 1.0).rem_euclid(std::f64::consts::TAU) + 1.0).clean();
    said(&log, "yaw", "wraps");
    let steps = log.columns["yaw"].windows(2).map(|pair| (pair[1] - pair[0]).abs());
    assert!(steps.fold(0.0, f64::max) < 0.1);
}

#[test]
fn kilometres_per_hour_and_g_are_converted() {
    let log = sound().scaled(&["vx"], 3.6).scaled(&["vy"], 3.6).clean();
    assert_eq!(said(&log, "vx", "km/h"), FindingSeverity::Warning);
    assert!(apart(&log, "vx") < 1e-9 && apart(&log, "ay") < 1e-9);
    let log = sound().scaled(&["vx"], 3.6).without(&["x"]).clean();
    assert!(apart(&log, "vx") < 1e-9);
    let log = sound().scaled(&["ay"], 1.0 / 9.80665).scaled(&["ax"], 1.0 / 9.80665).clean();
    assert_eq!(said(&log, "ay", "taken as g"), FindingSeverity::Warning);
    assert!(apart(&log, "ay") < 1e-9);
}

#[test]
fn a_turned_sign_is_refused_and_named() {
    for column in ["steer_cmd", "yaw", "yaw_rate", "ay", "y"] {
        match sound().scaled(&[column], -1.0).refused() {
            CleanError::Sign { columns, .. } => assert_eq!(columns, [column]),
            other => panic!("{column}: {other}"),
        }
    }
}

#[test]
fn a_steering_wheel_angle_is_refused_with_its_ratio() {
    for (factor, in_degrees) in [(15.8, false), (15.8 * 57.29578, true)] {
        match sound().scaled(&["steer_cmd"], factor).scaled(&["steer"], factor).refused() {
            CleanError::SteeringWheel { ratio, degrees, .. } => {
                assert!((ratio - 15.8).abs() < 0.5 && degrees == in_degrees, "{ratio}");
            }
            other => panic!("{other}"),
        }
    }
}

#[test]
fn another_vehicle_is_suspected() {
    let log = sound().scaled(&["steer_cmd"], 2.2).scaled(&["steer"], 2.2).clean();
    assert_eq!(said(&log, "steer_cmd", "another vehicle"), FindingSeverity::Suspicion);
    assert!(log.suspect().is_some());
    // Effects are smaller: a ratio of 1.2 is for the diagnosis to find.
    assert!(sound().scaled(&["steer_cmd"], 1.2).clean().suspect().is_none());
}

#[test]
fn other_frames_and_speeds_are_suspected() {
    let log = sound().map("yaw", |_, yaw| yaw - 1.57).clean();
    assert_eq!(said(&log, "yaw", "another axis"), FindingSeverity::Suspicion);
    let log = sound().scaled(&["vx"], 0.5).clean();
    assert_eq!(said(&log, "vx", "another unit"), FindingSeverity::Suspicion);
}

#[test]
fn standstill_is_not_judged() {
    let log = sound().map("vx", |row, vx| if row < 400 { 0.0 } else { vx }).clean();
    said(&log, "vx", "stands");
    assert!(!log.valid[300] && log.valid[401]);
}

#[test]
fn a_log_without_steering_says_so() {
    let straight = |table: DriveTable, name| table.scaled(&[name], 1e-5);
    let log = ["steer_cmd", "steer", "yaw_rate", "ay"]
        .into_iter()
        .fold(sound().without(&["yaw"]), straight)
        .clean();
    assert_eq!(said(&log, "steer_cmd", "hardly steered"), FindingSeverity::Warning);
}

#[test]
fn compressed_logs_are_read_up_to_where_they_are_cut_off_and_damaged_ones_refused() {
    use flate2::{Compression, write::GzEncoder};
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv.gz");
    let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
    std::io::Write::write_all(&mut packer, sound().text().as_bytes()).unwrap();
    let bytes = packer.finish().unwrap();
    std::fs::write(&file, &bytes).unwrap();
    let log = CleanLog::of(&DriveLog::read(&file).unwrap(), &steering).unwrap();
    assert_eq!(log, CleanLog { ..sound().clean() });
    let whole = DriveLog::read(&file).unwrap();
    let rows = whole.column("time").unwrap().len();
    // The checksum alone is missing; a half; hardly anything.
    for (left, least, most) in [(bytes.len() - 4, rows, rows), (bytes.len() / 2, rows / 4, rows - 1)] {
        std::fs::write(&file, &bytes[..left]).unwrap();
        let log = DriveLog::read(&file).unwrap();
        let read = log.column("time").unwrap().len();
        assert!((least..=most).contains(&read), "{left}: {read} of {rows}");
        assert!(
            log.warnings[0].starts_with(&format!("line {}: the packed file is cut off", read + 2)),
            "{:?}",
            log.warnings
        );
        for (name, values) in log.columns() {
            let same =
                values.iter().zip(whole.column(name).unwrap()).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same, "{name}");
        }
    }
    for left in [5, 30] {
        std::fs::write(&file, &bytes[..left]).unwrap();
        assert!(DriveLog::read(&file).unwrap_err().to_string().contains("cut off"));
    }
    let mut damaged = bytes.clone();
    damaged[bytes.len() / 2] ^= 0x55;
    std::fs::write(&file, &damaged).unwrap();
    let error = DriveLog::read(&file).unwrap_err().to_string();
    assert!(error.contains("log.csv.gz: line ") && error.contains("pack it again"), "{error}");
    std::fs::write(&file, "time,vx\n0,1\n").unwrap();
    assert!(DriveLog::read(&file).is_err());
}

#[test]
fn real_logs_pass_without_suspicion() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/genesis");
    if !folder.is_dir() {
        eprintln!("skipped: no real logs at {}", folder.display());
        return;
    }
    for name in ["real_human_fast_lap", "real_mpc_med_lap", "sim_mpc_med_lap"] {
        let log = DriveLog::read(&folder.join(name).with_extension("csv")).unwrap();
        let log = CleanLog::of(&log, &|speed| 3.02 + 0.003 * speed * speed).unwrap();
        assert!(log.suspect().is_none() && !log.commanded, "{:#?}", log.findings);
        assert!((log.step - 0.01).abs() < 1e-4, "{}", log.step);
        let judged = log.valid.iter().filter(|valid| **valid).count();
        assert!(
            judged as f64 * log.step > 200.0,
            "{name}: {judged} of {}: {:#?}",
            log.valid.len(),
            log.findings
        );
    }
}

/// What a clean log promises, whatever it was made from.
fn check_promises(log: &CleanLog) {
    assert!(log.step > 0.0 && log.step <= 0.25 && log.columns.contains_key("steer_cmd"));
    assert_eq!(log.time.len(), log.valid.len());
    for (name, values) in &log.columns {
        assert_eq!(values.len(), log.time.len(), "{name}");
        assert!(values.iter().all(|value| value.is_finite()), "{name}");
    }
    assert!(log.time.windows(2).all(|pair| pair[1] > pair[0]));
    assert!(log.findings.windows(2).all(|pair| pair[0].gravity >= pair[1].gravity));
}

fn read(bytes: &[u8]) {
    if let Ok(log) = DriveLog::from_reader(bytes, Path::new("random.csv"))
        && let Ok(log) = CleanLog::of(&log, &steering)
    {
        check_promises(&log);
    }
}

/// Numbers as bad files have them.
fn field() -> impl Strategy<Value = String> {
    prop_oneof![
        6 => (-20.0..20.0_f64).prop_map(|value| value.to_string()),
        1 => Just(String::new()),
        1 => Just("NaN".to_owned()),
        1 => Just("-inf".to_owned()),
        1 => Just("1e300".to_owned()),
        1 => Just("0".to_owned()),
        1 => any::<f64>().prop_map(|value| value.to_string()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        read(&bytes);
        read(&[b"time,steer_cmd,vx,yaw_rate,x,y,yaw,ay\n", &bytes[..]].concat());
    }

    #[test]
    fn random_numbers_never_panic(rows in proptest::collection::vec(proptest::collection::vec(field(), 8), 0..60)) {
        let rows: Vec<String> = rows.iter().map(|row| row.join(",")).collect();
        read(format!("time,steer_cmd,vx,yaw_rate,x,y,yaw,ay\n{}\n", rows.join("\n")).as_bytes());
    }

    #[test]
    fn damaged_logs_never_panic_and_keep_the_promises(
        damage in proptest::collection::vec((0..1000_usize, 0..12_usize, field()), 0..40),
        cut in 0..1000_usize,
    ) {
        let mut table = drive(20.0, 50.0);
        for (row, column, value) in damage {
            table.rows[row][column] = value;
        }
        table.rows.drain(cut.min(990)..(cut + 30).min(1000));
        read(table.text().as_bytes());
    }
}

fn joined(tables: &[DriveTable]) -> Result<CleanLog, JoinError> {
    let named = tables.iter().enumerate().map(|(i, table)| (format!("{i}.csv"), table.clean()));
    Ok(CleanLog::joined(named.collect())?.unwrap())
}

#[test]
fn logs_are_joined_on_the_slowest_clock_and_the_columns_of_all() {
    let log = joined(&[drive(40.0, 50.0), drive(20.0, 100.0).without(&["vy"]), drive(30.0, 50.0)]).unwrap();
    assert_eq!((log.step, log.time.len(), log.valid.len()), (0.02, 1000 + 2000 + 1500, 4500));
    assert!(log.columns.values().all(|column| column.len() == 4500));
    assert!(!log.columns.contains_key("vy") && said(&log, "vy", "1.csv") == FindingSeverity::Warning);
    assert!(log.findings.iter().any(|finding| finding.summary.contains("3 logs are taken as one")));
    let jumps: Vec<usize> = (1..4500).filter(|&i| log.time[i] - log.time[i - 1] > 1.0).collect();
    assert_eq!(jumps, [2000, 3000]);
    // The second one, 100 rows a second, is on the clock of the others what it is on its own.
    let alone = drive(20.0, 50.0).clean();
    for name in ["steer_cmd", "vx", "yaw_rate"] {
        let pairs = log.columns[name][2000..3000].iter().zip(&alone.columns[name]);
        let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.02, "{name} {off}");
    }
    let one = joined(&[sound()]).unwrap();
    assert_eq!(one, sound().clean());
    assert_eq!(CleanLog::joined(Vec::new()), Ok(None));
}

#[test]
fn a_log_with_the_command_and_one_without_are_not_joined() {
    let refused = joined(&[sound(), sound().without(&["steer_cmd"])]).unwrap_err();
    assert_eq!(refused, JoinError::Commanded { with: "0.csv".into(), without: "1.csv".into() });
    let words = refused.to_string();
    assert!(
        words.contains("0.csv has steer_cmd") && words.contains("take the column steer_cmd out"),
        "{words}"
    );
}
