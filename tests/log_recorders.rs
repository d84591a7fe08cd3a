//! What recorders and their users do to a log: columns that come more slowly than rows, rows that are interpolated, rows that
//! are lost, drives in one file. It is found, said, and no cause.

use crate::diagnose;
use rfl_mpc::diagnose::VerdictKind;
use rfl_mpc::log::{CleanError, CleanLog, DriveLog, Finding, FindingSeverity, UnusableLog};
use std::collections::BTreeMap;
use std::path::Path;

type Columns = BTreeMap<&'static str, Vec<f64>>;

/// A simulated drive with sensor noise.
fn drive() -> Columns {
    let drive = diagnose::log(7, &[]);
    let mut columns = drive.columns.clone();
    columns.insert("time", drive.time.clone());
    columns
}

fn cleaned(columns: Columns) -> Result<CleanLog, UnusableLog> {
    let columns = columns.into_iter().map(|(name, values)| (name.to_owned(), values)).collect();
    let log = DriveLog::from_columns(Path::new("log.csv"), columns).unwrap();
    CleanLog::of(&log, &|speed| 2.7 + 0.002 * speed * speed)
}

/// What is said of a column, above notes or with them.
fn said(findings: &[Finding], column: &str, least: FindingSeverity) -> String {
    let of = findings.iter().filter(|it| it.gravity >= least && it.signal.as_deref() == Some(column));
    of.map(|finding| finding.summary.as_str()).collect::<Vec<_>>().join("; ")
}

/// Each `every`-th value, repeated up to the next.
fn held(columns: &mut Columns, names: &[&'static str], every: usize) {
    for name in names {
        let values = columns.get_mut(name).unwrap();
        (0..values.len()).for_each(|row| values[row] = values[row / every * every]);
    }
}

/// Lines between every `every`-th value.
fn lines(values: &mut [f64], every: usize) {
    let knots: Vec<f64> = values.iter().step_by(every).copied().collect();
    for (row, value) in values.iter_mut().enumerate() {
        let (from, share) = (row / every, (row % every) as f64 / every as f64);
        let next = knots.get(from + 1).unwrap_or(&knots[from]);
        *value = knots[from] + share * (next - knots[from]);
    }
}

#[test]
fn a_slow_sensor_is_laid_on_lines_or_left_out() {
    let sound = cleaned(drive()).unwrap();
    for every in [2, 5] {
        let mut columns = drive();
        held(&mut columns, &["x", "y", "vx", "yaw"], every);
        let log = cleaned(columns).unwrap();
        for (name, most) in [("x", 0.6), ("vx", 0.15), ("yaw", 0.03)] {
            let words = said(&log.findings, name, FindingSeverity::Note);
            assert!(
                words.contains(&format!("for about {every} rows")) && words.contains("on lines"),
                "{name}, {every}: {words}; {:#?}",
                log.findings
            );
            let apart = |row: usize| (log.columns[name][row] - sound.columns[name][row]).abs();
            let judged = (0..log.time.len()).filter(|row| log.valid[*row]);
            assert!(judged.map(apart).fold(0.0, f64::max) < most, "{name} every {every} rows");
            // Lines have no noise from row to row, and yet are not exact.
            let coarse = log.coarse[name];
            assert!((coarse.lasting - log.step * every as f64).abs() < 0.2 * log.step, "{name}: {coarse:?}");
            assert!(coarse.deviation > 1e-5, "{name}: {coarse:?}");
        }
    }
    // Places of once a second: a speed may be laid on lines so far, a place may not.
    let mut columns = drive();
    held(&mut columns, &["x", "y", "vx"], 50);
    let log = cleaned(columns).unwrap();
    assert!(!log.columns.contains_key("x") && log.columns.contains_key("vx"));
    assert!(said(&log.findings, "x", FindingSeverity::Warning).contains("1.000 times a second"));
    let mut columns = drive();
    lines(columns.get_mut("x").unwrap(), 50);
    let log = cleaned(columns).unwrap();
    assert!(said(&log.findings, "x", FindingSeverity::Warning).contains("straight lines of about 50 rows"));
}

#[test]
fn rows_between_measured_ones_are_not_used() {
    let interpolated = |every: usize| {
        let mut columns = drive();
        columns.iter_mut().filter(|(name, _)| **name != "time").for_each(|(_, values)| lines(values, every));
        cleaned(columns)
    };
    let log = interpolated(4).unwrap();
    assert!((log.step - 0.08).abs() < 1e-9);
    assert!(said(&log.findings, "time", FindingSeverity::Warning).contains("interpolated"));
    let mut repeated = drive();
    let names: Vec<&'static str> =
        repeated.keys().copied().filter(|name| !["time", "steer_cmd", "accel_cmd"].contains(name)).collect();
    held(&mut repeated, &names, 5);
    let log = cleaned(repeated).unwrap();
    assert!((log.step - 0.1).abs() < 1e-9);
    assert!(said(&log.findings, "time", FindingSeverity::Warning).contains("repeated"));
    let refused = interpolated(10).unwrap_err();
    assert!(
        matches!(refused.cause, CleanError::TooSlow { rate, .. } if (rate - 5.0).abs() < 1e-6),
        "{refused}"
    );
}

#[test]
fn lost_rows_and_drives_in_one_file_part_the_log() {
    let rows = drive()["time"].len();
    let jumps = |log: &CleanLog| log.time.windows(2).filter(|pair| pair[1] - pair[0] > 1.0).count();
    // Rows are lost, and their clock is numbered anew.
    for lost in [15, 150] {
        let mut columns = drive();
        for (name, values) in &mut columns {
            if *name == "time" {
                values.truncate(rows - lost);
            } else {
                values.drain(900..900 + lost);
            }
        }
        let log = cleaned(columns).unwrap();
        let words = said(&log.findings, "x", FindingSeverity::Warning);
        assert!(words.contains("in row 901") && words.contains("2 drives, of which 2"), "{words}");
        assert_eq!(jumps(&log), 1);
    }
    // Without a place the heading tells it, or else speed and yaw rate at once.
    for (dropped, column) in [(&["x", "y"][..], "yaw"), (&["x", "y", "yaw"], "vx")] {
        let mut columns = drive();
        columns.retain(|name, _| !dropped.contains(name));
        let (time, mut second) = (columns["time"].clone(), columns.clone());
        // The same again, from a row on in which speed and yaw rate are others than in the last one.
        let apart = |name: &str, row: usize| (columns[name][row] - columns[name][rows - 1]).abs();
        let other = |row: &usize| apart("vx", *row) > 2.0 && apart("yaw_rate", *row) > 0.15;
        let from = (100..rows - 600).find(other).unwrap();
        second.values_mut().for_each(|values| {
            values.drain(..from);
        });
        for (name, values) in &mut columns {
            values.extend_from_slice(&second[name]);
        }
        let stamps = (0..columns["vx"].len()).map(|row| time[0] + 0.02 * row as f64).collect();
        columns.insert("time", stamps);
        let log = cleaned(columns).unwrap();
        let words = said(&log.findings, column, FindingSeverity::Warning);
        assert!(words.contains(&format!("in row {}", rows + 1)) && words.contains("2 drives"), "{words}");
        assert_eq!(jumps(&log), 1);
    }
    // Another drive begins elsewhere.
    let mut columns = drive();
    columns.get_mut("y").unwrap()[1000..].iter_mut().for_each(|y| *y -= 70.0);
    assert_eq!(jumps(&cleaned(columns).unwrap()), 1);
    // A receiver is astray for a while: what lies between is too short to be a drive.
    let mut columns = drive();
    columns.get_mut("x").unwrap()[900..1000].iter_mut().for_each(|x| *x += 15.0);
    let log = cleaned(columns).unwrap();
    assert!(said(&log.findings, "x", FindingSeverity::Warning).contains("3 drives, of which 2"));
    // One that is astray all the time tells nothing.
    let mut columns = drive();
    let places = columns.get_mut("x").unwrap();
    (0..rows).filter(|row| row / 150 % 2 == 0).for_each(|row| places[row] += 15.0);
    let log = cleaned(columns).unwrap();
    assert!(!log.columns.contains_key("x"), "{:?}", log.findings);
    assert!(said(&log.findings, "x", FindingSeverity::Warning).contains("are left out"));
}

#[test]
fn a_yaw_from_another_axis_is_suspected() {
    for off in [0.1745, -0.08] {
        let mut columns = drive();
        columns.get_mut("yaw").unwrap().iter_mut().for_each(|yaw| *yaw -= off);
        let log = cleaned(columns).unwrap();
        let words = said(&log.findings, "yaw", FindingSeverity::Suspicion);
        assert!(words.contains("another axis"), "{words}");
        let told: f64 = words.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
        assert!((told - off).abs() < 0.01, "{words}");
    }
    // The point of the receiver is no angle.
    let mut columns = drive();
    let yaw = columns["yaw"].clone();
    for (name, part) in [("x", f64::cos as fn(f64) -> f64), ("y", f64::sin)] {
        columns
            .get_mut(name)
            .unwrap()
            .iter_mut()
            .zip(&yaw)
            .for_each(|(place, yaw)| *place -= 1.5 * part(*yaw));
    }
    assert!(cleaned(columns).unwrap().suspect().is_none());
}

/// The rows, where a log is of no use without the column; else the column, where they are many.
#[test]
fn what_a_sensor_cannot_show_is_left_out() {
    for (name, of_largest, column_goes) in [("ay", 0.4, true), ("ax", 0.8, false), ("yaw_rate", 0.7, false)] {
        let mut columns = drive();
        let values = columns.get_mut(name).unwrap();
        let limit = of_largest * values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        values.iter_mut().for_each(|value| *value = value.clamp(-limit, limit));
        let log = cleaned(columns).unwrap();
        let words = said(&log.findings, name, FindingSeverity::Warning);
        assert!(words.contains("range ends there"), "{name}: {words}; {:#?}", log.findings);
        assert_eq!(log.columns.contains_key(name), !column_goes, "{name}: {words}");
    }
}

#[test]
fn a_speed_that_is_missing_for_long_is_no_cause() {
    let mut columns = drive();
    columns.get_mut("vx").unwrap()[700..900].fill(f64::NAN);
    let found = diagnose::found(&cleaned(columns).unwrap(), &diagnose::singles());
    assert_eq!(found.report.verdict.kind, VerdictKind::None);
}

#[test]
fn ten_rows_a_second_name_a_cause_and_nothing_where_there_is_none() {
    for (put_in, kind) in [(&[][..], VerdictKind::None), (&[("steer_gain", 1.15)], VerdictKind::Effect)] {
        let mut columns = diagnose::log(7, put_in).columns;
        columns.values_mut().for_each(|values| *values = values.iter().step_by(5).copied().collect());
        let rows = columns["vx"].len();
        columns.insert("time", (0..rows).map(|row| 0.1 * row as f64).collect());
        let report = diagnose::found(&cleaned(columns).unwrap(), &diagnose::singles()).report;
        assert_eq!(report.verdict.kind, kind, "{:?}", report.verdict);
        assert!(report.verdict.effects.iter().all(|effect| effect.id == put_in[0].0), "{:?}", report.verdict);
    }
}

#[test]
fn stamps_in_whole_seconds_may_begin_in_the_midst_of_one() {
    let sound = cleaned(drive()).unwrap();
    for begin in [0.0, 0.3, 0.5, 0.94] {
        let mut columns = drive();
        columns.get_mut("time").unwrap().iter_mut().for_each(|time| *time = (*time + begin + 1e-9).floor());
        let log = cleaned(columns).unwrap();
        assert!(
            (log.step - sound.step).abs() < 1e-6 && log.time.len().abs_diff(sound.time.len()) <= 1,
            "{begin}"
        );
        let off = |(time, row): (&f64, usize)| (time - begin - sound.time[row]).abs();
        let farthest = log.time.iter().zip(0..sound.time.len()).map(off).fold(0.0, f64::max);
        assert!(farthest < 0.025, "{begin}: {farthest}");
    }
}

/// Columns that come later by a number of rows.
fn late(columns: &mut Columns, names: &[&'static str], rows: usize) {
    for name in names {
        let values = columns.get_mut(name).unwrap();
        (0..values.len()).rev().for_each(|row| values[row] = values[row.saturating_sub(rows)]);
    }
}

#[test]
fn columns_that_come_later_than_others_are_taken_earlier() {
    let sound = cleaned(drive()).unwrap();
    for column in ["yaw_rate", "yaw", "x"] {
        assert!(!said(&sound.findings, column, FindingSeverity::Note).contains("later"), "{column}");
    }
    for (names, rows, words) in [
        (&["yaw_rate"][..] as &[&'static str], 5, "yaw_rate comes 0."),
        (&["yaw_rate", "ay", "ax"], 2, "ay and ax with it"),
        (&["x", "y"], 5, "x comes 0."),
        (&["x", "y", "yaw"], 8, "yaw comes 0."),
        (&["x", "y", "yaw"], 4, "x comes 0."),
        (&["vx"], 15, "vx comes 0.2"),
        (&["x", "y", "yaw", "vx", "vy"], 5, "vx comes 0.09"),
    ] {
        let mut columns = drive();
        late(&mut columns, names, rows);
        let log = cleaned(columns).unwrap();
        let all: Vec<String> = ["yaw_rate", "yaw", "x", "vx"]
            .iter()
            .map(|it| said(&log.findings, it, FindingSeverity::Warning))
            .collect();
        assert!(all.join("; ").contains(words), "{names:?}: {all:?}");
        for name in names {
            let judged = (0..log.time.len()).filter(|&row| log.valid[row]);
            // To a row: places are noisy.
            let same = |row: usize| {
                let now = log.columns[name][row];
                sound.columns[name][row.saturating_sub(1)..]
                    .iter()
                    .take(3)
                    .any(|was| (now - was).abs() < 1e-12)
            };
            let share = judged.clone().filter(|&row| same(row)).count() as f64 / judged.count() as f64;
            assert!(share > 0.95, "{names:?} {name}: {share}, {all:?}");
        }
    }
}

/// A drive without `vy`, fast in some bends and slow in others, whose rear slips as a saturating tyre does; its places are late by
/// so many rows.
fn slipping(rows: usize) -> Columns {
    const STEP: f64 = 0.02;
    let mut columns: Columns =
        ["time", "x", "y", "yaw", "vx", "yaw_rate", "ax", "ay", "steer_cmd", "accel_cmd"]
            .map(|name| (name, Vec::new()))
            .into();
    let (mut x, mut y, mut yaw, mut last) = (0.0, 0.0, 0.0_f64, 16.0);
    // Sensors' noise, of no random generator: sums of sines without a common period.
    let noise = |row: usize, size: f64, of: f64| {
        let at = row as f64 * of;
        size * ((7.1 * at).sin() + (13.7 * at + of).sin() + (29.3 * at).cos())
    };
    for row in 0..3000 {
        let time = row as f64 * STEP;
        let (speed, rate) =
            (16.0 + 6.0 * (0.23 * time).sin(), 0.22 * (0.41 * time).sin() + 0.08 * (0.9 * time).sin());
        let lateral = speed * rate;
        let slip: f64 = 1.4 * rate - speed * (0.012 * lateral + 0.0004 * lateral.powi(3));
        let [told_x, told_y] = [x + noise(row, 0.02, 1.1), y + noise(row, 0.02, 1.3)];
        let values = [
            ("time", time),
            ("x", told_x),
            ("y", told_y),
            ("yaw", yaw + noise(row, 5e-4, 1.7)),
            ("vx", speed + noise(row, 0.015, 1.9)),
            ("yaw_rate", rate + noise(row, 1e-3, 2.3)),
            ("ax", (speed - last) / STEP - slip * rate + noise(row, 0.03, 2.9)),
            ("ay", lateral + noise(row, 0.03, 3.1)),
            ("steer_cmd", (2.7 + 0.002 * speed * speed) * rate / speed),
            ("accel_cmd", (speed - last) / STEP),
        ];
        for (name, value) in values {
            columns.get_mut(name).unwrap().push(value);
        }
        (x, y) = (
            x + STEP * (speed * yaw.cos() - slip * yaw.sin()),
            y + STEP * (speed * yaw.sin() + slip * yaw.cos()),
        );
        yaw += STEP * rate;
        last = speed;
    }
    late(&mut columns, &["x", "y"], rows);
    columns
}

#[test]
fn a_slip_that_no_column_tells_makes_no_place_late() {
    for (rows, words) in [(0, None), (5, Some("x comes 0.1")), (10, Some("x comes 0.2"))] {
        let log = cleaned(slipping(rows)).unwrap();
        let said = said(&log.findings, "x", FindingSeverity::Warning);
        match words {
            None => assert!(!said.contains("later"), "{said}"),
            Some(words) => assert!(said.contains(words), "{rows} rows: {said}"),
        }
    }
}

#[test]
fn ten_rows_a_second_are_no_wrong_clock() {
    let mut columns = drive();
    columns.values_mut().for_each(|values| *values = values.iter().copied().step_by(5).collect());
    let log = cleaned(columns).unwrap();
    assert_eq!(log.suspect(), None);
}

#[test]
fn a_speed_in_whole_kilometres_an_hour_is_laid_on_lines_and_said() {
    let sound = cleaned(drive()).unwrap();
    let mut columns = drive();
    columns.get_mut("vx").unwrap().iter_mut().for_each(|vx| *vx = (3.6 * *vx).round());
    let stepped = columns["vx"].clone();
    let log = cleaned(columns).unwrap();
    assert!(
        said(&log.findings, "vx", FindingSeverity::Note).contains("in steps of 1.0000"),
        "{:?}",
        log.findings
    );
    let error = |of: &dyn Fn(usize) -> f64| {
        let rows = 0..sound.time.len();
        rows.map(|row| (of(row) - sound.columns["vx"][row]).powi(2)).sum::<f64>()
    };
    let (before, after) = (error(&|row| stepped[row] / 3.6), error(&|row| log.columns["vx"][row]));
    assert!(after < 0.6 * before, "{after} {before}");
}

#[test]
fn a_smoothed_yaw_rate_and_late_places_are_no_cause() {
    let smoothed = |columns: &mut Columns| {
        let values = columns["yaw_rate"].clone();
        let mean = |row: usize| {
            let window = &values[row.saturating_sub(9)..=row];
            window.iter().sum::<f64>() / window.len() as f64
        };
        columns.insert("yaw_rate", (0..values.len()).map(mean).collect());
    };
    let places = |columns: &mut Columns| late(columns, &["x", "y"], 5);
    let instrument = |columns: &mut Columns| late(columns, &["x", "y", "yaw", "vx", "vy"], 4);
    let filtered = |columns: &mut Columns| late(columns, &["vx"], 15);
    let receiver = |columns: &mut Columns| late(columns, &["x", "y", "yaw"], 8);
    for (case, change) in [
        ("moving average of the yaw rate over 0.2 s", &smoothed as &dyn Fn(&mut Columns)),
        ("places 0.1 s late", &places),
        ("places and yaw 0.16 s late", &receiver),
        ("places, yaw and velocities 0.08 s late", &instrument),
        ("a speed 0.3 s late", &filtered),
    ] {
        let mut columns = drive();
        change(&mut columns);
        let verdict = diagnose::found(&cleaned(columns).unwrap(), &diagnose::singles()).report.verdict;
        assert_eq!(verdict.kind, VerdictKind::None, "{case}: {verdict:?}");
    }
}

/// A receiver's places while it knows none: it goes on by itself, or along a line, and jumps back.
#[test]
fn a_receiver_that_drifts_and_jumps_back_is_left_out_for_that_time() {
    let (from, to) = (500, 1000);
    for on_a_line in [false, true] {
        let mut columns = diagnose::log(7, &[("steer_gain", 1.15)]).columns;
        let rows = columns["vx"].len();
        columns.insert("time", (0..rows).map(|row| 0.02 * row as f64).collect());
        let (yaw, vx) = (columns["yaw"].clone(), columns["vx"].clone());
        for (name, part) in [("x", f64::cos as fn(f64) -> f64), ("y", f64::sin)] {
            let places = columns.get_mut(name).unwrap();
            for row in from..to {
                let drift = 4e-4 * (row - from) as f64;
                let heading = if on_a_line { yaw[from] } else { yaw[row] + drift };
                places[row] = places[row - 1] + 0.02 * 0.98 * vx[row] * part(heading);
            }
        }
        let log = cleaned(columns).unwrap();
        let words = said(&log.findings, "x", FindingSeverity::Warning);
        assert!(words.contains("had lost its way") && words.contains("to row 1000"), "{words}");
        let judged = (from + 100..to).filter(|&row| log.time.get(row).is_some() && log.valid[row]).count();
        assert_eq!(judged, 0, "{words}");
        let verdict = diagnose::found(&log, &diagnose::singles()).report.verdict;
        assert_eq!(verdict.kind, VerdictKind::Effect, "{verdict:?}");
        assert_eq!(verdict.effects[0].id, "steer_gain", "{verdict:?}");
    }
}

/// A row for each message of a bus, with the last values of all others: each column is sent every so many rows, some milliseconds late.
fn forward_filled(columns: &Columns, every: &[(&'static str, usize, f64)]) -> Columns {
    let mut messages: Vec<(f64, &'static str, f64)> = Vec::new();
    for &(name, every, late) in every {
        let rows = columns["time"].iter().zip(&columns[name]).step_by(every);
        messages.extend(rows.map(|(time, value)| (time + late, name, *value)));
    }
    messages.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut last: BTreeMap<&'static str, f64> = every.iter().map(|(name, ..)| (*name, f64::NAN)).collect();
    let mut filled = Columns::new();
    for (time, name, value) in messages {
        last.insert(name, value);
        filled.entry("time").or_default().push(time);
        last.iter().for_each(|(name, value)| filled.entry(name).or_default().push(*value));
    }
    filled
}

#[test]
fn a_row_for_each_message_of_a_bus_is_read_by_time() {
    let sound = drive();
    let every = [
        ("steer_cmd", 1, 0.0),
        ("accel_cmd", 2, 0.0012),
        ("steer", 1, 0.0024),
        ("vx", 2, 0.0006),
        ("yaw_rate", 1, 0.0018),
        ("ay", 1, 0.0018),
        ("ax", 1, 0.0018),
        ("x", 5, 0.003),
        ("y", 5, 0.003),
        ("yaw", 5, 0.003),
    ];
    let log = cleaned(forward_filled(&sound, &every)).unwrap();
    assert!(log.suspect().is_none(), "{:#?}", log.findings);
    for (name, rate) in [("yaw_rate", 50.0), ("vx", 25.0), ("x", 10.0)] {
        let words = said(&log.findings, name, FindingSeverity::Note);
        assert!(words.contains(&format!("it comes {rate:.3} times a second")), "{name}: {words}");
    }
    // A row is at most 10 ms from one of the sound drive, and 3 ms late.
    for (name, most) in [("yaw_rate", 0.02), ("vx", 0.1), ("x", 0.35), ("yaw", 0.02)] {
        let rows = (0..log.time.len()).filter(|row| log.valid[*row]);
        let apart = |row: usize| {
            let place = (log.time[row] / 0.02).round() as usize;
            sound[name].get(place).map_or(0.0, |value| (log.columns[name][row] - value).abs())
        };
        let largest = rows.map(apart).fold(0.0, f64::max);
        assert!(largest < most, "{name}: {largest}");
    }
    let report = diagnose::found(&log, &diagnose::singles()).report;
    assert_eq!(report.verdict.kind, VerdictKind::None, "{:?}", report.verdict);
}
