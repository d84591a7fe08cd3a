//! Motion in another frame, in another unit, backwards, or of another point: said, and no cause.

use crate::diagnose::{Columns, cleaned, columns, said};
use rfl_mpc::log::FindingSeverity;

fn turned(columns: &mut Columns, names: &[&'static str]) {
    for name in names {
        columns.get_mut(name).unwrap().iter_mut().for_each(|value| *value *= -1.0);
    }
}

#[test]
fn columns_of_another_handedness_get_one_advice() {
    for (names, words) in [
        (&["yaw_rate", "ay"][..], "yaw_rate and ay have the opposite sign of"),
        (&["yaw_rate", "ay", "vy", "steer", "steer_cmd"], "yaw and y have the opposite sign of"),
        (&["y", "yaw", "yaw_rate", "ay", "vy"], "steer_cmd and steer have the opposite sign of"),
        (&["steer", "steer_cmd"], "steer_cmd and steer have the opposite sign of"),
    ] {
        let mut log = columns(31, &[]);
        turned(&mut log, names);
        let error = cleaned(log).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("ISO 8855"), "{names:?}: {error}");
    }
    // Mirrored as a whole it is a drive like any other.
    let mut log = columns(31, &[]);
    turned(&mut log, &["y", "yaw", "yaw_rate", "ay", "vy", "steer", "steer_cmd", "roll"]);
    assert!(cleaned(log).is_ok_and(|log| log.suspect().is_none()));
}

#[test]
fn yaw_in_hundredths_of_a_degree_is_converted() {
    let sound = columns(32, &[]);
    for wrapped in [false, true] {
        let mut log = sound.clone();
        for yaw in log.get_mut("yaw").unwrap() {
            let hundredths = (100.0 * yaw.to_degrees()).round();
            *yaw = if wrapped { hundredths.rem_euclid(36_000.0) } else { hundredths };
        }
        let log = cleaned(log).unwrap();
        let said = said(&log.findings, "yaw", FindingSeverity::Warning);
        assert!(said.contains("taken as hundredths of a degree"), "{wrapped}: {said}");
        let off = log.columns["yaw"][0] - sound["yaw"][0];
        let pairs = log.columns["yaw"].iter().zip(&sound["yaw"]);
        assert!(pairs.clone().all(|(a, b)| (a - b - off).abs() < 1e-3) && log.suspect().is_none());
    }
}

/// The course of the vehicle's point in place of its heading.
fn course(columns: &Columns) -> Vec<f64> {
    let (yaw, vx, vy) = (&columns["yaw"], &columns["vx"], &columns["vy"]);
    (0..yaw.len()).map(|row| yaw[row] + vy[row].atan2(vx[row])).collect()
}

#[test]
fn a_course_in_place_of_yaw_is_left_out() {
    for (seed, dropped) in [(7, &["vy"][..]), (9, &["vy", "x", "y"]), (12, &["vy", "ax"])] {
        let mut log = columns(seed, &[]);
        log.insert("yaw", course(&log));
        log.retain(|name, _| !dropped.contains(name));
        let log = cleaned(log).unwrap();
        let said = said(&log.findings, "yaw", FindingSeverity::Warning);
        assert!(said.contains("it has the sideslip in it"), "{seed}: {said}");
        assert!(!log.columns.contains_key("yaw") && log.suspect().is_none());
    }
}

#[test]
fn a_heading_that_is_late_or_smoothed_is_no_course() {
    for (seed, rows) in [(7, 0), (8, 3), (34, 6), (35, 10)] {
        let mut log = columns(seed, &[]);
        for name in ["yaw", "yaw_rate"] {
            let mut late = log.clone();
            let values = late.get_mut(name).unwrap();
            let fine = values.clone();
            (0..fine.len()).for_each(|row| values[row] = fine[row.saturating_sub(rows)]);
            let late = cleaned(late).unwrap();
            assert!(late.columns.contains_key("yaw"), "{seed} {name} late by {rows}");
        }
        let yaw = log.get_mut("yaw").unwrap();
        let fine = yaw.clone();
        for row in rows..fine.len() - rows {
            yaw[row] = fine[row - rows..=row + rows].iter().sum::<f64>() / (2 * rows + 1) as f64;
        }
        assert!(cleaned(log).unwrap().columns.contains_key("yaw"), "{seed} smoothed over {rows}");
    }
}

/// A drive that ends with a stop and a stretch in reverse.
fn reversed(seed: u64, is_signed: bool) -> Columns {
    let mut log = columns(seed, &[]);
    let rows = log["time"].len();
    let last = |name: &str| log[name][rows - 1];
    let (mut x, mut y, mut yaw, mut vx) = (last("x"), last("y"), last("yaw"), last("vx"));
    let step = 0.02;
    let mut random = rfl_mpc::numerics::Random::new(seed);
    for row in 0..2500 {
        let wanted = if row < 800 { 0.0 } else { -4.0 };
        let ax = (wanted - vx).clamp(-2.0 * step, 2.0 * step) / step;
        let steer = 0.15 * (0.01 * f64::from(row)).sin();
        let rate = vx * steer / 2.7;
        vx += ax * step;
        yaw += rate * step;
        x += vx * yaw.cos() * step;
        y += vx * yaw.sin() * step;
        let mut noise = |size: f64| size * (random.uniform() - 0.5);
        let sign = if is_signed { 1.0 } else { vx.signum() };
        for (name, value) in [
            ("time", step * (rows as f64 + f64::from(row))),
            ("x", x + noise(0.02)),
            ("y", y + noise(0.02)),
            ("yaw", yaw + noise(0.002)),
            ("vx", sign * vx + noise(0.02)),
            ("vy", noise(0.02)),
            ("yaw_rate", rate + noise(0.004)),
            ("ax", ax + noise(0.1)),
            ("ay", vx * rate + noise(0.1)),
            ("steer", steer + noise(0.001)),
            ("steer_cmd", steer),
            ("accel_cmd", sign * ax),
            ("roll", noise(0.002)),
        ] {
            log.get_mut(name).unwrap().push(value);
        }
    }
    log
}

#[test]
fn reversing_with_a_speed_without_sign_is_not_judged() {
    for dropped in [&["vy", "ax"][..], &["vy", "ax", "x", "y", "yaw"], &["vy", "ax", "x", "y", "yaw", "ay"]] {
        for is_signed in [true, false] {
            let mut log = reversed(36, is_signed);
            log.retain(|name, _| !dropped.contains(name));
            let log = cleaned(log).unwrap();
            let said = said(&log.findings, "vx", FindingSeverity::Warning);
            assert_eq!(said.contains("the vehicle reverses for"), !is_signed, "without {dropped:?}: {said}");
            assert!(log.suspect().is_none(), "without {dropped:?}");
            assert!(log.valid[3200..].iter().all(|valid| !valid), "without {dropped:?}");
            assert!(log.valid[50..1900].iter().filter(|valid| **valid).count() > 1800);
        }
    }
}

#[test]
fn a_spin_is_not_judged() {
    let sound = columns(31, &[]);
    let rows = sound["vx"].len();
    // A spin of a second in the middle, then a column that is no velocity to the left at all.
    for (share, left_out) in [(0.03, true), (0.9, false)] {
        let mut log = sound.clone();
        let spun = (share * rows as f64) as usize;
        let from = (rows - spun) / 2;
        for row in from..from + spun {
            let angle = 0.8 * (std::f64::consts::PI * (row - from) as f64 / spun as f64).sin();
            let (vx, speed) = (log["vx"][row], log["vx"][row].hypot(log["vy"][row]));
            log.get_mut("vy").unwrap()[row] = speed * angle.sin() * vx.signum();
            log.get_mut("vx").unwrap()[row] = vx * angle.cos();
        }
        let log = cleaned(log).unwrap();
        let said = said(&log.findings, "vy", FindingSeverity::Warning);
        assert_eq!(said.contains("spins or slides"), left_out, "{share}: {said}");
        if left_out {
            let valid = |row: usize| log.valid[row * log.valid.len() / rows];
            assert!(!valid(from + spun / 2) && valid(from / 2) && valid(from + spun + 400), "{share}");
        }
    }
}

/// Takes `vy`, or the place, of a point so many m before the centre of gravity.
fn taken_at(columns: &mut Columns, of: &str, lever: f64) {
    let (yaw, rate) = (columns["yaw"].clone(), columns["yaw_rate"].clone());
    let moves: Vec<(&str, Vec<f64>)> = match of {
        "vy" => vec![("vy", rate)],
        _ => vec![
            ("x", yaw.iter().map(|yaw| yaw.cos()).collect()),
            ("y", yaw.iter().map(|yaw| yaw.sin()).collect()),
        ],
    };
    for (name, by) in moves {
        columns.get_mut(name).unwrap().iter_mut().zip(by).for_each(|(value, by)| *value += lever * by);
    }
}

#[test]
fn velocity_and_place_of_another_point_are_brought_to_the_centre_of_gravity() {
    for (seed, of, lever, dropped) in [
        (7, &["vy"][..], -1.53, &[][..]),
        (8, &["vy"], 1.2, &["x", "y"]),
        (9, &["vy"], 1.2, &["ay"]),
        (7, &["x"], -1.53, &["vy"]),
        (9, &["vy", "x"], 1.4, &[]),
    ] {
        let sound = columns(seed, &[]);
        let mut moved = sound.clone();
        of.iter().for_each(|of| taken_at(&mut moved, of, lever));
        moved.retain(|name, _| !dropped.contains(name));
        let log = cleaned(moved).unwrap();
        for of in of {
            let words = said(&log.findings, of, FindingSeverity::Warning);
            assert!(
                words.contains(if lever > 0.0 { "m before the" } else { "m behind the" }),
                "{seed}: {words}"
            );
            let told: f64 = words.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
            assert!((told - lever.abs()).abs() < 0.2 * lever.abs(), "{seed}: {words}");
            let off = log.columns[*of].iter().zip(&sound[*of]).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 0.2 * lever.abs(), "{seed}: {of} is still elsewhere");
        }
        assert!(log.suspect().is_none());
    }
}

/// A receiver beside the middle: the yaw rate moves it back and forth.
#[test]
fn a_place_beside_the_middle_is_brought_to_the_centre_of_gravity() {
    for (seed, ahead, left) in [(7, -1.0, 0.4), (8, 0.0, -0.6), (9, 1.2, 0.3)] {
        let sound = columns(seed, &[]);
        let mut moved = sound.clone();
        taken_at(&mut moved, "x", ahead);
        let yaw = moved["yaw"].clone();
        for (name, by) in [("x", (|yaw: f64| -yaw.sin()) as fn(f64) -> f64), ("y", f64::cos)] {
            let place = moved.get_mut(name).unwrap().iter_mut().zip(&yaw);
            place.for_each(|(place, yaw)| *place += left * by(*yaw));
        }
        let log = cleaned(moved).unwrap();
        let words = said(&log.findings, "x", FindingSeverity::Warning);
        assert!(words.contains(if left > 0.0 { "m left of the" } else { "m right of the" }), "{words}");
        assert_eq!(words.contains("before and") || words.contains("behind and"), ahead != 0.0, "{words}");
        for of in ["x", "y"] {
            let off = log.columns[of].iter().zip(&sound[of]).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 0.25, "{words}: {of} is still elsewhere");
        }
    }
}

#[test]
fn no_vehicle_moves_the_point_of_a_sound_velocity() {
    for (seed, put_in) in [
        (7, &[][..]),
        (8, &[("tyre_stiffness_rear", 0.7)]),
        (9, &[("tyre_stiffness_rear", 1.4)]),
        (7, &[("road_friction", 0.6)]),
        (8, &[("cg_shift", 0.2)]),
        (9, &[("imu_lever_arm", -1.2)]),
        (7, &[("imu_lever_arm", 1.2)]),
        (8, &[("heading_misalignment", 0.03)]),
        (9, &[("sensor_delay", 0.1)]),
    ] {
        for dropped in [&[][..], &["ay"], &["vy"]] {
            let mut log = columns(seed, put_in);
            log.retain(|name, _| !dropped.contains(name));
            let log = cleaned(log).unwrap();
            let said: Vec<&str> = log.findings.iter().map(|finding| finding.summary.as_str()).collect();
            let moved =
                |said: &&str| said.contains("centre of gravity") || said.contains("later than vx, vy");
            assert!(!said.iter().any(moved), "{put_in:?} without {dropped:?}: {said:?}");
        }
    }
}

#[test]
fn a_lever_or_a_low_pass_is_no_unit_of_vy() {
    let mut log = columns(7, &[]);
    taken_at(&mut log, "vy", 1.2);
    log.retain(|name, _| !["x", "y"].contains(name));
    let words = said(&cleaned(log).unwrap().findings, "vy", FindingSeverity::Warning);
    assert!(words.contains("m before the") && !words.contains("taken as"), "{words}");
    let mut log = columns(7, &[]);
    let (mut states, ay) = ([0.0; 2], log["ay"].clone());
    for (row, ay) in ay.into_iter().enumerate() {
        states[0] += 0.2 * (ay - states[0]);
        states[1] += 0.2 * (states[0] - states[1]);
        log.get_mut("ay").unwrap()[row] = states[1];
    }
    log.retain(|name, _| !["x", "y"].contains(name));
    assert_eq!(said(&cleaned(log).unwrap().findings, "vy", FindingSeverity::Warning), "");
}

#[test]
fn an_accelerometer_that_was_computed_is_left_out() {
    let mut log = columns(7, &[]);
    let ay =
        log["vx"].iter().zip(&log["yaw_rate"]).map(|(vx, rate)| (1e6 * vx * rate).round() / 1e6).collect();
    log.insert("ay", ay);
    let log = cleaned(log).unwrap();
    assert!(said(&log.findings, "ay", FindingSeverity::Warning).contains("computed and not measured"));
    assert!(!log.columns.contains_key("ay") && log.suspect().is_none());
}

#[test]
fn an_accelerometer_that_is_turned_by_a_quarter_is_refused() {
    let sound = columns(7, &[]);
    for (along, across) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)] {
        let mut log = sound.clone();
        log.insert("ax", sound["ay"].iter().map(|ay| along * ay).collect());
        log.insert("ay", sound["ax"].iter().map(|ax| across * ax).collect());
        let error = cleaned(log).unwrap_err().to_string();
        assert!(error.contains("turned by a quarter"), "{error}");
    }
}
