//! One check of a log behind diagnosis, training and identification: what each kind of damage comes to in all three.

use crate::command::{rfl, text};
use crate::drive_table::DriveTable;
use rfl_mpc::log::{CleanLog, DriveLog, Finding, FindingSeverity, SteeringLog, drives_of};
use std::path::{Path, PathBuf};

fn steering(speed: f64) -> f64 {
    2.7 + 0.002 * speed * speed
}

/// 60 s at 50 Hz along a road, in every column what the others tell, with a little noise.
fn sound() -> DriveTable {
    let names = [
        "time",
        "steer_cmd",
        "steer",
        "x",
        "y",
        "yaw",
        "vx",
        "vy",
        "yaw_rate",
        "ax",
        "ay",
        "e1",
        "e1_rate",
        "e2",
        "e2_rate",
        "station",
        "curvature",
        "curvature_rate",
    ];
    let (mut x, mut y, mut yaw, mut yaw_rate, mut rows) = (3.0, -2.0, 0.4, 0.0, Vec::new());
    let (mut e1, mut e2, mut station) = (0.2, 0.0, 0.0);
    let step = 0.02;
    for row in 0..3000 {
        let time = step * f64::from(row);
        let vx = 12.0 + 3.0 * (0.2 * time).sin();
        let curvature = 0.02 * (0.45 * time).sin();
        let bend = vx * curvature;
        let steer = steering(vx) * curvature - 0.02 * e1 - 0.3 * e2 + 0.01 * (1.7 * time).sin();
        yaw_rate += (vx * steer / steering(vx) - yaw_rate) * 0.2;
        let noise = |size: f64, k: f64| size * (k * f64::from(row) * f64::from(row)).sin();
        let e2_rate = yaw_rate - bend;
        rows.push(vec![
            time,
            steer,
            steer + noise(1e-4, 1.1),
            x,
            y,
            yaw,
            vx + noise(0.01, 1.3),
            noise(1e-3, 1.7),
            yaw_rate + noise(1e-3, 1.9),
            0.6 * (0.2 * time).cos() + noise(0.05, 2.3),
            vx * yaw_rate + noise(0.05, 2.9),
            e1,
            vx * e2,
            e2,
            e2_rate,
            station,
            curvature,
            0.02 * 0.45 * (0.45 * time).cos() / vx,
        ]);
        x += step * vx * yaw.cos();
        y += step * vx * yaw.sin();
        yaw += step * yaw_rate;
        e1 += step * vx * e2;
        e2 += step * e2_rate;
        station += step * vx;
    }
    DriveTable::new(&names, rows)
}

/// What diagnosis, training and identification make of a log: the reason of a refusal, or what was mended.
fn answers(log: &DriveLog) -> [Result<String, String>; 3] {
    let words = |findings: &[Finding]| {
        let grave = findings.iter().filter(|finding| finding.gravity > FindingSeverity::Note);
        grave.map(|finding| finding.summary.as_str()).collect::<Vec<_>>().join("; ")
    };
    let diagnosis = match CleanLog::of(log, &steering) {
        Err(error) => Err(error.to_string()),
        Ok(clean) => match clean.suspect() {
            Some(finding) => Err(finding.summary.clone()),
            None => Ok(words(&clean.findings)),
        },
    };
    let mut notes = Vec::new();
    let training = drives_of(log, None, &steering, &mut |note| notes.push(note));
    let identification = SteeringLog::by_yaw_rate(log, &steering);
    [
        diagnosis,
        training.map(|_| notes.join("; ")).map_err(|error| error.to_string()),
        identification.map(|found| words(&found.findings)).map_err(|error| error.to_string()),
    ]
}

/// Whether all three mend a log (`Ok`) or refuse it, with these words.
fn all(case: &str, table: &DriveTable, expected: Result<&str, &str>) -> Vec<String> {
    let names = ["diagnosis", "training", "identification"];
    let agree = |answer: &Result<String, String>| match (answer, expected) {
        (Ok(said), Ok(words)) | (Err(said), Err(words)) => said.contains(words),
        _ => false,
    };
    let answers = answers(&table.log());
    let off = names.into_iter().zip(answers).filter(|(_, answer)| !agree(answer));
    off.map(|(name, answer)| format!("{case}, {name}: {answer:?}, not {expected:?}")).collect()
}

const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Columns of place and road.
const NOTHING_TELLS: [&str; 10] =
    ["x", "y", "yaw", "station", "curvature", "curvature_rate", "e1", "e1_rate", "e2", "e2_rate"];

/// A log, and what all three say of it: what they mend, or why they refuse it.
type Case = (&'static str, DriveTable, Result<&'static str, &'static str>);

fn cases() -> Vec<Case> {
    let s = sound;
    vec![
        ("sound", s(), Ok("")),
        ("km/h", s().scaled(&["vx", "vy"], 3.6), Ok("taken as km/h")),
        ("mph", s().scaled(&["vx", "vy"], 2.236_936), Ok("taken as mph")),
        ("knots", s().scaled(&["vx", "vy"], 1.943_844), Ok("taken as knots")),
        ("ft/s", s().scaled(&["vx", "vy"], 3.280_84), Ok("taken as ft/s")),
        (
            "mph without positions",
            s().without(&["x", "y", "station"]).scaled(&["vx"], 2.236_936),
            Ok("taken as mph"),
        ),
        (
            "knots without ay",
            s().without(&["ay", "station"]).scaled(&["vx"], 1.943_844),
            Ok("taken as knots"),
        ),
        (
            "mph, and nothing that tells",
            s().without(&NOTHING_TELLS).without(&["ay"]).scaled(&["vx"], 2.236_936),
            Err("no column tells the unit of vx"),
        ),
        (
            "all in foreign units",
            s().without(&NOTHING_TELLS)
                .scaled(&["vx"], 3.6)
                .scaled(&["yaw_rate", "steer", "steer_cmd"], DEGREES)
                .scaled(&["ay"], 1.0 / 9.80665),
            Err("times vx * yaw_rate: its unit, or that of vx"),
        ),
        ("cm/s", s().scaled(&["vx", "vy"], 100.0), Err("check the unit of vx")),
        ("a speed off by a factor", s().scaled(&["vx"], 1.12), Ok("")),
        ("mm", s().scaled(&["x", "y"], 1000.0), Ok("taken as mm")),
        ("feet", s().scaled(&["x", "y"], 3.280_84), Ok("taken as ft")),
        ("g", s().scaled(&["ax", "ay"], 1.0 / 9.80665), Ok("taken as g")),
        ("km/h and g", s().scaled(&["vx"], 3.6).scaled(&["ay"], 1.0 / 9.80665), Ok("taken as km/h")),
        ("yaw in degrees", s().scaled(&["yaw"], DEGREES), Ok("degrees")),
        ("yaw_rate in degrees", s().scaled(&["yaw_rate"], DEGREES), Ok("degrees")),
        ("yaw_rate in degrees, ay tells", s().without(&["yaw"]).scaled(&["yaw_rate"], DEGREES), Ok("deg")),
        ("steering in degrees", s().scaled(&["steer_cmd", "steer"], DEGREES), Ok("degrees")),
        ("e2 in degrees", s().scaled(&["e2"], DEGREES), Ok("e2 changes 57 times")),
        ("e1 in mm", s().scaled(&["e1"], 1000.0), Ok("taken as mm")),
        ("e1 and its rate in cm", s().scaled(&["e1", "e1_rate"], 100.0), Ok("taken as cm")),
        ("a steering wheel", s().scaled(&["steer_cmd", "steer"], 15.8), Err("steering-wheel")),
        ("yaw_rate turned", s().scaled(&["yaw_rate"], -1.0), Err("yaw_rate has the opposite sign")),
        ("steer_cmd turned", s().scaled(&["steer_cmd"], -1.0), Err("steer_cmd has the opposite sign")),
        ("ay turned", s().scaled(&["ay"], -1.0), Err("ay has the opposite sign")),
        ("x turned", s().scaled(&["x"], -1.0), Err("x has the opposite sign of yaw")),
        ("y turned", s().scaled(&["y"], -1.0), Err("y has the opposite sign of yaw")),
        ("an accelerometer turned", s().scaled(&["ax", "ay"], -1.0), Err("ay and ax have the opposite sign")),
        ("yaw from another axis", s().map("yaw", |_, yaw| yaw - 1.57), Err("another axis")),
        ("speed halved", s().scaled(&["vx"], 0.5), Err("another unit")),
        (
            "one row of yaw_rate",
            s().set("yaw_rate", 1499..1500, "10.0"),
            Ok("yaw_rate = 10.0000 in row 1500"),
        ),
        ("three rows of vx", s().set("vx", 700..703, "-4.0"), Ok("vx = -4.0000 in row 701")),
        ("one row of steer_cmd", s().set("steer_cmd", 700..701, "0.9"), Ok("steer_cmd = 0.9000 in row 701")),
        (
            "five rows of steer_cmd",
            s().set("steer_cmd", 700..705, "0.9"),
            Ok("steer_cmd = 0.9000 in row 701"),
        ),
        ("three rows of ay", s().set("ay", 700..703, "-30.0"), Ok("ay = -30.0000 in row 701")),
        ("the first row", s().set("yaw_rate", 0..1, "5.0"), Ok("yaw_rate = 5.0000 in row 1:")),
        (
            "the last rows",
            s().set("vx", 2998..3000, "1.0"),
            Ok("vx = 1.0000 in row 2999, 1.0000 in row 3000"),
        ),
        ("one position", s().set("x", 90..91, "0.0").set("y", 90..91, "0.0"), Ok("in row 91")),
        ("a sentinel", s().set("vx", 20..45, "999.0"), Ok("vx stays at 999.0000 from row 21 to row 45")),
        (
            "a sentinel time and again",
            s().map("vx", |row, vx| if row % 501 < 40 { 655.35 } else { vx }),
            Ok("vx stays at 655.3500"),
        ),
        ("1e308", s().set("yaw_rate", 458..459, "-1e308"), Err("yaw_rate = -1e308 in row 459")),
        ("3e38 in the last row", s().set("ay", 2999..3000, "3.4e38"), Err("ay = 3.4e38 in row 3000")),
        ("infinity", s().set("vx", 300..301, "inf"), Ok("")),
        (
            "impossible speeds",
            s().without(&["x", "y", "ay", "station", "e2"])
                .map("vx", |row, vx| if row < 1000 { 700.0 + 0.01 * row as f64 } else { vx }),
            Err("vx"),
        ),
        ("a gap", s().rows(|rows| [&rows[..900], &rows[1000..]].concat()), Ok("1 gaps")),
        (
            "order",
            s().rows(|mut rows| {
                for i in (0..2900).step_by(60) {
                    rows.swap(i, i + 4);
                }
                rows
            }),
            Ok("sorted"),
        ),
        ("one stamp", s().set("time", 800..801, "5e6"), Ok("in row 801")),
        ("milliseconds", s().scaled(&["time"], 1000.0), Ok("milliseconds")),
        ("the clock starts anew", s().map("time", |row, _| 0.02 * (row % 1000) as f64), Ok("row 1001, 2001")),
        (
            "and once only",
            s().map("time", |row, time| if row < 1400 { time } else { time - 20.0 }),
            Ok("row 1401"),
        ),
        (
            "short drives",
            s().map("time", |row, _| 0.02 * (row % 250) as f64),
            Err("starts anew 11 times, first in row 251; the longest of the 12 drives between is 4.98 s"),
        ),
        ("one time", s().map("time", |_, _| 5.0), Err("all 3000 rows have the same time")),
        (
            "32 bits",
            s().map("time", |_, time| f64::from((1.700_000_04e9 + time) as f32)),
            Err(
                "the 3000 rows have 2 different times only, 128 apart, as seconds since 1970 have in 32 bits",
            ),
        ),
        ("a clock that counts down", s().map("time", |_, time| 90.0 - time), Err("time runs backwards")),
        (
            "the last row first",
            s().rows(|rows| rows.into_iter().rev().collect()),
            Ok("time falls from row to row"),
        ),
        ("too short", s().rows(|rows| rows[..300].to_vec()), Err("at least 10 s")),
        ("too slow", s().scaled(&["time"], 20.0).without(&["x", "y"]), Err("")),
        ("no speed", s().without(&["vx"]), Err("'vx' is missing")),
        ("no time", s().without(&["time"]), Err("'time' is missing")),
        ("no steering", s().without(&["steer", "steer_cmd"]), Err("'steer_cmd' is missing")),
        ("jitter", s().map("time", |row, time| time + 0.004 * (12.9898 * row as f64).sin()), Ok("")),
        (
            "each row twice",
            s().rows(|rows| rows.into_iter().flat_map(|row| [row.clone(), row]).collect()),
            Ok(""),
        ),
    ]
}

#[test]
fn diagnosis_training_and_identification_agree() {
    let cases = cases();
    assert!(cases.len() > 40);
    let off: Vec<String> =
        cases.iter().flat_map(|(case, table, expected)| all(case, table, *expected)).collect();
    assert!(off.is_empty(), "{:#?}", off);
}

#[test]
fn a_clock_that_counts_down_tells_no_angle_after_its_command() {
    let backwards = || sound().map("time", |_, time| 90.0 - time);
    let error = SteeringLog::by_angle(&backwards().log(), &steering).unwrap_err().to_string();
    assert!(error.contains("time runs backwards") && error.contains("--rate HZ"), "{error}");
    // Where nothing tells, a word.
    let found = SteeringLog::by_angle(&backwards().without(&NOTHING_TELLS).log(), &steering).unwrap();
    let words =
        |finding: &Finding| finding.summary.contains("falls") && finding.summary.contains("--rate HZ");
    assert!(found.findings.iter().any(words), "{:?}", found.findings);
}

/// And so do the commands: an error, or, of the diagnosis, a suspicion instead of a verdict.
#[test]
fn the_three_commands_refuse_the_same_logs() {
    let folder = tempfile::tempdir().unwrap();
    let commands: [&[&str]; 3] = [
        &["diagnose", "log.csv", "--no-pairs", "--quiet"],
        &["train", "log.csv", "--no-proof", "--quiet"],
        &["identify", "log.csv", "--by-yaw-rate"],
    ];
    let mut diagnosed = false;
    for (case, table, expected) in cases() {
        let Err(words) = expected else { continue };
        table.write(folder.path());
        // A suspicious log is diagnosed all the same: one of them shows it, what is said of the others is the library's.
        let suspicious = CleanLog::of(&table.log(), &steering).is_ok_and(|clean| clean.suspect().is_some());
        let again = suspicious && std::mem::replace(&mut diagnosed, true);
        for command in commands.into_iter().skip(usize::from(again)) {
            let output = rfl(folder.path(), command);
            let said = text(&output.stdout) + &text(&output.stderr);
            let suspects = command[0] == "diagnose" && said.contains("suspicion: ");
            assert_eq!(
                output.status.code(),
                Some(if suspects { 5 } else { 1 }),
                "{case}, {command:?}: {said}"
            );
            // A linear model of one speed is a demand of the identification's own.
            let own = command[0] == "identify" && said.contains("model is of one speed");
            assert!(own || said.contains(words), "{case}, {command:?}: {said}");
        }
    }
    assert!(!folder.path().join("out/residual").exists());
}

#[test]
fn errors_to_the_path_are_refused_by_the_training_only() {
    for table in [
        sound().scaled(&["e1"], -1.0),
        sound().scaled(&["e2", "e2_rate"], -1.0),
        sound().scaled(&["e1"], 4.5),
        // Without vy the slip stands between e1_rate and e2.
        sound().without(&["vy", "x", "y"]).scaled(&["e1", "e1_rate"], -1.0),
    ] {
        let [diagnosis, training, _] = answers(&table.log());
        assert!(diagnosis.is_ok_and(|said| said.contains("e1") || said.contains("e2")));
        let error = training.unwrap_err();
        assert!(error.contains("opposite sign") || error.contains("another unit"), "{error}");
    }
}

/// On a straight road a controller's plan begins before the vehicle turns, and the other way round.
#[test]
fn a_sign_needs_turns() {
    for (size, is_blamed) in [(1.0, true), (1e-5, false)] {
        let turned = sound().without(&NOTHING_TELLS).scaled(&["steer", "steer_cmd", "ay"], -size);
        for answer in answers(&turned.scaled(&["vy", "yaw_rate"], size).log()).iter().take(1) {
            let blamed = answer.as_ref().is_err_and(|error| error.contains("opposite sign"));
            assert_eq!(blamed, is_blamed, "{size}: {answer:?}");
        }
    }
}

#[test]
fn a_column_that_agrees_with_the_motion_is_not_blamed() {
    for (turned, blamed) in [
        (&["curvature"][..], "curvature has the opposite sign of yaw_rate"),
        (&["curvature_rate"], "curvature_rate has the opposite sign of curvature"),
        (&["e2", "e2_rate"], "e2 and e2_rate have the opposite sign of"),
    ] {
        let [_, training, _] = answers(&sound().scaled(turned, -1.0).log());
        let error = training.unwrap_err();
        assert!(error.contains(blamed), "{turned:?}: {error}");
    }
}

/// Logs to learn from need neither place nor yaw rate.
#[test]
fn the_road_tells_a_speed_in_foreign_units() {
    let log = sound().without(&["x", "y", "yaw", "vy", "yaw_rate", "ax", "ay", "station", "steer"]);
    for (unit, size) in [("mph", 2.236_936), ("knots", 1.943_844), ("km/h", 3.6)] {
        let mut notes = Vec::new();
        let table = log.clone().scaled(&["vx"], size);
        let drives = drives_of(&table.log(), None, &steering, &mut |note| notes.push(note)).unwrap();
        assert!(notes.iter().any(|note| note.contains(&format!("taken as {unit}"))), "{unit}: {notes:?}");
        assert!(drives[0].vx.iter().all(|vx| *vx < 16.0));
    }
    for scaled in [&["curvature"][..], &["curvature_rate"]] {
        let mut notes = Vec::new();
        let table = sound().scaled(scaled, 1000.0);
        assert!(drives_of(&table.log(), None, &steering, &mut |note| notes.push(note)).is_ok());
        assert!(notes.iter().any(|note| note.contains("taken as 1/km")), "{scaled:?}: {notes:?}");
    }
}

/// What is said to be mended is mended in the data that is learned from, too.
#[test]
fn errors_to_the_road_are_those_of_the_mended_columns() {
    let sound =
        sound().without(&["e1", "e1_rate", "e2", "e2_rate", "station", "curvature", "curvature_rate"]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("road.csv");
    let as_driven = sound.log();
    let points = as_driven.column("x").unwrap().iter().zip(as_driven.column("y").unwrap()).step_by(25);
    let lines: Vec<String> = points.map(|(x, y)| format!("{x},{y}\n")).collect();
    std::fs::write(&file, format!("x,y\n{}", lines.concat())).unwrap();
    let road = rfl_mpc::path::Path::read(&file).unwrap();
    let made = |table: &DriveTable| {
        let mut notes = Vec::new();
        let note = &mut |words| notes.push(words);
        let mut drives = drives_of(&table.log(), Some((&road, &file)), &steering, note).unwrap();
        (drives.remove(0), notes.join("; "))
    };
    let (plain, _) = made(&sound);
    let value = |name: &str, row: usize| as_driven.column(name).unwrap()[row];
    let late =
        |name: &'static str, rows: usize| move |row: usize, _: f64| value(name, row.saturating_sub(rows));
    let held = |name: &'static str, rows: usize| move |row: usize, _: f64| value(name, row / rows * rows);
    for (case, table, words) in [
        ("places 0.1 s late", sound.clone().map("x", late("x", 5)).map("y", late("y", 5)), "x comes 0.1"),
        ("yaw rate 0.16 s late", sound.clone().map("yaw_rate", late("yaw_rate", 8)), "yaw_rate comes 0."),
        ("places at 10 Hz", sound.clone().map("x", held("x", 5)).map("y", held("y", 5)), ""),
        (
            "yaw in degrees at 10 Hz",
            sound.clone().map("yaw", held("yaw", 5)).scaled(&["yaw"], 57.29578),
            "taken as degrees",
        ),
    ] {
        let (drive, notes) = made(&table);
        assert!(notes.contains(words), "{case}: {notes}");
        // About the ends there is nothing to mend with; a lateness is known to a row.
        let rows = 50..plain.time.len() - 50;
        for (name, one, other, most) in [
            ("e2", &drive.e2, &plain.e2, 8e-3),
            ("e1_rate", &drive.e1_rate, &plain.e1_rate, 0.12),
            ("e2_rate", &drive.e2_rate, &plain.e2_rate, 0.02),
        ] {
            let off = rows.clone().map(|row| (one[row] - other[row]).abs()).fold(0.0, f64::max);
            assert!(off < most, "{case}: {name} off by {off}");
        }
    }
}

/// Errors of a closed loop change within the blocks that are compared.
#[test]
fn a_quick_error_is_not_taken_for_one_in_another_unit() {
    for (unit, size) in [("", 1.0), ("ft", 3.280_84), ("cm", 100.0)] {
        let table = sound()
            .map("e1", |row, _| 0.01 * (0.06 * row as f64).sin())
            .map("e1_rate", |row, _| 0.03 * (0.06 * row as f64).cos())
            .scaled(&["e1"], size)
            .without(&["e2", "e2_rate"]);
        let clean = CleanLog::of(&table.log(), &steering).unwrap();
        let said: Vec<&str> = clean.findings.iter().map(|finding| finding.summary.as_str()).collect();
        assert_eq!(said.iter().any(|words| words.contains("taken as")), !unit.is_empty(), "{said:?}");
        assert!(said.iter().any(|words| words.contains(unit)), "{unit}: {said:?}");
    }
}

/// A vehicle that follows its path to the millimetre: the slip and the yaw error nearly cancel.
#[test]
fn a_precise_drive_does_not_contradict_itself() {
    let time = |row: usize| 0.02 * row as f64;
    let vx = move |row: usize| 12.0 + 3.0 * (0.2 * time(row)).sin();
    let e2 = move |row: usize| 0.15 * (0.45 * time(row)).sin();
    let e2_rate = move |row: usize| 0.15 * 0.45 * (0.45 * time(row)).cos();
    let e1_rate = move |row: usize| 0.002 * (0.45 * time(row)).sin();
    let curvature = move |row: usize| 0.02 * (0.3 * time(row)).sin();
    let yaw_rate = move |row: usize| vx(row) * curvature(row) + e2_rate(row);
    let log = sound()
        .without(&["x", "y", "yaw", "ax", "ay", "station"])
        .map("vx", |row, _| vx(row))
        .map("e1", |row, _| -0.002 / 0.45 * (0.45 * time(row)).cos())
        .map("e1_rate", |row, _| e1_rate(row))
        .map("e2", |row, _| e2(row))
        .map("e2_rate", |row, _| e2_rate(row))
        .map("vy", |row, _| (e1_rate(row) - vx(row) * e2(row).sin()) / e2(row).cos())
        .map("yaw_rate", |row, _| yaw_rate(row))
        .map("curvature", |row, _| curvature(row))
        .map("curvature_rate", |row, _| 0.02 * 0.3 * (0.3 * time(row)).cos() / vx(row))
        .map("steer", |row, _| steering(vx(row)) * yaw_rate(row) / vx(row))
        .map("steer_cmd", |row, _| steering(vx(row + 2)) * yaw_rate(row + 2) / vx(row + 2))
        .log();
    let [_, training, _] = answers(&log);
    assert_eq!(training, Ok(String::new()));
}

#[test]
fn what_was_left_out_changes_nothing_else() {
    let clean = |table: &DriveTable| CleanLog::of(&table.log(), &steering).unwrap();
    let (whole, mended) = (clean(&sound()), clean(&sound().set("yaw_rate", 1499..1500, "10.0")));
    for (name, column) in &whole.columns {
        let differing = column.iter().zip(&mended.columns[name]).filter(|(a, b)| a != b).count();
        assert!(differing <= usize::from(*name == "yaw_rate"), "{name}: {differing}");
    }
    assert_eq!(whole.valid, mended.valid);
}

/// A file of the shared ones, or a word that there is none.
fn shared(name: &str) -> Option<PathBuf> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(name);
    if !file.is_file() {
        eprintln!("skipped: there is no {}", file.display());
    }
    file.is_file().then_some(file)
}

/// Road-wheel angle of the built-in car in steady cornering.
fn car(speed: f64) -> f64 {
    2.78 + 0.0025 * speed * speed
}

#[test]
fn the_known_bad_logs_are_mended_or_refused() {
    for (name, words) in [
        ("hang_plot", Err("yaw_rate = -1e308 in row 459")),
        ("one_glitch", Ok("yaw_rate = 10.0000 in row 1500")),
        ("laps_time_reset", Ok("starts anew in row 1501, 3001, 4501: 4 drives")),
        ("mph_gain112", Ok("taken as mph")),
        ("knots_gain112", Ok("taken as knots")),
        ("train_vx_kmh", Ok("taken as km/h")),
    ] {
        let Some(file) = shared(&format!("cases/logs/{name}.csv.gz")) else { continue };
        let log = DriveLog::read(&file).unwrap();
        let clean = CleanLog::of(&log, &car);
        match (words, &clean) {
            (Err(words), Err(error)) => assert!(error.to_string().contains(words), "{name}: {error}"),
            (Ok(words), Ok(clean)) => {
                let said = clean.findings.iter().any(|finding| finding.summary.contains(words));
                assert!(said && clean.suspect().is_none(), "{name}: {:#?}", clean.findings);
                eprintln!("{name}: {:#?}", clean.findings);
            }
            other => panic!("{name}: {other:?}"),
        }
        if name == "train_vx_kmh" {
            let mut notes = Vec::new();
            let drives = drives_of(&log, None, &car, &mut |note| notes.push(note)).unwrap();
            assert!(notes.iter().any(|note| note.contains("taken as km/h")), "{notes:?}");
            assert!(drives[0].vx.iter().all(|vx| *vx < 20.0));
        }
    }
}

#[test]
fn real_logs_have_no_outliers_and_no_foreign_units() {
    for name in ["real_human_fast_lap", "real_mpc_med_lap", "sim_mpc_med_lap"] {
        let Some(file) = shared(&format!("data/genesis/{name}.csv")) else { continue };
        let log =
            CleanLog::of(&DriveLog::read(&file).unwrap(), &|speed| 3.02 + 0.003 * speed * speed).unwrap();
        eprintln!("{name}: {:#?}", log.findings);
        let found = |words: &str| log.findings.iter().filter(|it| it.summary.contains(words)).count();
        for words in ["no motion explains", "taken as", "starts anew", "far from the stamps", "farther on"] {
            assert_eq!(found(words), 0, "{:#?}", log.findings);
        }
        // The unit of one drive stopped for a quarter of a second: yaw rate, accelerations and steering.
        assert_eq!(found("frozen"), usize::from(name == "real_mpc_med_lap"));
    }
}
