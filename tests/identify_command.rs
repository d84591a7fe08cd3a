//! `rfl identify`: what it finds in a step, driven or recorded, that the next command can use it, and what it says of a
//! log that holds no step.

use crate::command;

use command::{done, refused, rfl};
use serde_json::Value;
use std::path::Path;

const DEAD_TIME: f64 = 0.16;
const LAG: f64 = 0.1;

/// The model of a name in the results.
fn model(file: &Path, name: &str) -> Value {
    let found: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    let models = found["models"].as_array().unwrap();
    models.iter().find(|model| model["model"] == name).unwrap_or_else(|| panic!("{name} in {found}")).clone()
}

fn number(model: &Value, name: &str) -> f64 {
    model[name].as_f64().unwrap()
}

/// A step of the truck's steering with a delay that its controller does not know.
const DRIVEN: [&str; 8] = [
    "identify",
    "--vehicle",
    "truck_simulation",
    "--set",
    "effect.steer_delay=0.16",
    "--set",
    "effect.steer_lag=0.1",
    "--json=found.json",
];

#[test]
fn a_driven_step_and_its_record_give_the_actuator_and_the_drive_can_use_it() {
    let folder = tempfile::tempdir().unwrap();
    let found = folder.path().join("found.json");
    let said = done(&rfl(folder.path(), &[&DRIVEN[..], &["--record", "step.csv"]].concat()));
    let exact = model(&found, "dead_time_lag");
    assert!((number(&exact, "dead_time") - DEAD_TIME).abs() < 1e-3, "{exact}");
    assert!((number(&exact, "time_constant") - LAG).abs() < 1e-3, "{exact}");
    for name in ["first_order", "pade_1_1", "pade_2_2"] {
        assert!(number(&model(&found, name), "rmse") > 10.0 * number(&exact, "rmse"), "{said}");
    }
    assert_eq!(number(&model(&found, "first_order"), "dead_time"), 0.0);
    assert_eq!(number(&model(&found, "pade_2_2"), "time_constant"), 0.0);

    let again = done(&rfl(folder.path(), &["identify", "step.csv", "--json=again.json"]));
    assert_eq!(model(&folder.path().join("again.json"), "dead_time_lag"), exact);
    assert_eq!(again, said);

    // The line that it prints is one that the drive takes.
    let line =
        said.lines().find(|line| line.trim_start().starts_with("pade_2_2  ") && line.contains("--set"));
    let settings: Vec<&str> = line.unwrap().split_whitespace().skip(1).collect();
    assert!(settings.contains(&"actuator.dead_time_model=pade_2_2"), "{settings:?}");
    let drive =
        ["drive", "--quiet", "--vehicle", "truck_simulation", "--duration", "2", "--variant", "actuator"];
    done(&rfl(folder.path(), &[&drive[..], &settings].concat()));
    let wrong = ["--set", "actuator.dead_time_model=pade_3_3"];
    let error = refused(&rfl(folder.path(), &[&drive[..], &wrong].concat()));
    assert!(error.contains("pade_3_3") && error.contains("pade_1_1, pade_2_2 or first_order"), "{error}");
}

#[test]
fn without_options_a_step_is_told_and_nothing_that_it_does_not_tell() {
    let folder = tempfile::tempdir().unwrap();
    let output = rfl(folder.path(), &["identify", "--json=found.json"]);
    let all = done(&output) + &command::text(&output.stderr);
    assert!(!all.contains("degrees") && !all.contains("opposite"), "{all}");
    let exact = model(&folder.path().join("found.json"), "dead_time_lag");
    assert!((number(&exact, "time_constant") - 0.05).abs() < 1e-3, "{exact}");
}

#[test]
fn a_short_part_of_a_drive_is_no_step_and_a_log_counts_once() {
    let folder = tempfile::tempdir().unwrap();
    let (path, lag) = (command::road(), ["--set", "effect.steer_lag=0.07", "--log", "whole.csv"]);
    done(&rfl(
        folder.path(),
        &[&["drive", "--quiet", "--duration", "20", "--path", &path], &lag[..]].concat(),
    ));
    let whole = std::fs::read_to_string(folder.path().join("whole.csv")).unwrap();
    let mut lines = whole.lines();
    let header = lines.next().unwrap();
    let rows: Vec<&str> = lines.collect();
    for (name, range) in [("bend.csv", 300..650), ("part.csv", 300..380)] {
        let part: Vec<&str> = std::iter::once(header).chain(rows[range].iter().copied()).collect();
        std::fs::write(folder.path().join(name), part.join("\n")).unwrap();
    }
    // Seven seconds of a bend tell it; less than two are too little, and harm no other log.
    let together = |logs: &[&str]| {
        done(&rfl(folder.path(), &[&["identify", "--json", "found.json"], logs].concat()));
        let found: Value =
            serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
        number(&found["delay"], "value")
    };
    assert!((together(&["bend.csv"]) - 0.12).abs() < 1e-3);
    assert!((together(&["part.csv", "bend.csv"]) - 0.12).abs() < 1e-3);
    let error = refused(&rfl(folder.path(), &["identify", "part.csv"]));
    assert!(error.contains("part.csv") && error.contains("at least 2 s are needed"), "{error}");
    std::fs::copy(folder.path().join("whole.csv"), folder.path().join("again.csv")).unwrap();
    for one in ["identify", "diagnose"] {
        let error = refused(&rfl(folder.path(), &[one, "whole.csv", "again.csv"]));
        assert!(error.contains("again.csv: the same log as whole.csv"), "{error}");
    }
}

#[test]
fn the_yaw_rate_tells_it_nearly_as_well() {
    let folder = tempfile::tempdir().unwrap();
    done(&rfl(folder.path(), &[&DRIVEN[..], &["--by-yaw-rate"]].concat()));
    let found = model(&folder.path().join("found.json"), "dead_time_lag");
    // What the linear model does not know is shared out between the two: only the sum is to be believed.
    let whole = number(&found, "dead_time") + number(&found, "time_constant");
    assert!((whole - DEAD_TIME - LAG).abs() < 0.1, "{found}");
}

/// A record of lag 0.1 s behind dead time 0.2 s as a table of text, with a step after half a second.
fn table(rows: usize) -> Vec<[String; 3]> {
    let row = |k: usize| {
        let time = 0.02 * k as f64;
        let since = time - 0.7;
        let angle = if since < 0.0 { 0.0 } else { 0.05 * (1.0 - (-since / 0.1).exp()) };
        [time, if k < 25 { 0.0 } else { 0.05 }, angle].map(|value| format!("{value:.9}"))
    };
    (0..rows).map(row).collect()
}

fn written(folder: &Path, header: &str, table: &[[String; 3]]) {
    let lines: Vec<String> = table.iter().map(|row| row.join(",")).collect();
    std::fs::write(folder.join("log.csv"), format!("{header}\n{}\n", lines.join("\n"))).unwrap();
}

const HEADER: &str = "time,steer_cmd,steer";

#[test]
fn a_part_of_a_log_is_enough() {
    let folder = tempfile::tempdir().unwrap();
    let mut log = table(150);
    // Before and after, the log holds what is no step.
    log[3][1] = "0.2".into();
    log[140][2] = "nan".into();
    written(folder.path(), HEADER, &log);
    let part = ["identify", "log.csv", "--from", "0.1", "--until", "2.5", "--json", "found.json"];
    done(&rfl(folder.path(), &part));
    let found = model(&folder.path().join("found.json"), "dead_time_lag");
    assert!((number(&found, "dead_time") - 0.2).abs() < 1e-4, "{found}");
    assert!((number(&found, "time_constant") - 0.1).abs() < 1e-4, "{found}");
    let error = refused(&rfl(folder.path(), &["identify", "log.csv", "--from", "50"]));
    assert!(error.contains("--from"), "{error}");
}

#[test]
fn what_holds_no_step_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let said = |header: &str, log: &[[String; 3]], more: &[&str]| {
        written(folder.path(), header, log);
        refused(&rfl(folder.path(), &[&["identify", "log.csv"], more].concat()))
    };
    let changed = |change: fn(usize, &mut [String; 3])| {
        let mut log = table(150);
        log.iter_mut().enumerate().for_each(|(k, row)| change(k, row));
        log
    };
    let constant = changed(|_, row| row[1] = "0.05".into());
    assert!(said(HEADER, &constant, &[]).contains("record a step"));
    let deaf = changed(|k, row| row[2] = format!("{:.3}", (k as f64).sin()));
    assert!(said(HEADER, &deaf, &[]).contains("does not follow"));
    let error = said(
        HEADER,
        &changed(|k, row| {
            if k == 70 {
                row[1] = "nan".into()
            }
        }),
        &[],
    );
    assert!(error.contains("log.csv, line 72") && error.contains("command"), "{error}");
    let error = said(
        HEADER,
        &changed(|k, row| {
            if k > 70 {
                row[0] = format!("{:.2}", 5.0 + 0.02 * k as f64)
            }
        }),
        &[],
    );
    assert!(error.contains("line 73") && error.contains("resample"), "{error}");
    let error = said("time,steer_cmd,handwheel", &table(150), &[]);
    assert!(error.contains("'steer' is missing") && error.contains("--by-yaw-rate"), "{error}");
    let error = said("time,steer_cmd,steer", &table(150), &["--by-yaw-rate"]);
    assert!(error.contains("'yaw_rate' is missing"), "{error}");
    assert!(said(HEADER, &table(10), &[]).contains("only 10 rows"));
    assert!(refused(&rfl(folder.path(), &["identify", "none.csv"])).contains("none.csv"));

    // Through the linear model, the speed matters.
    let slow = "time,steer_cmd,yaw_rate,vx\n".to_owned()
        + &table(150).iter().map(|row| format!("{},0.3\n", row.join(","))).collect::<String>();
    std::fs::write(folder.path().join("slow.csv"), slow).unwrap();
    let error = refused(&rfl(folder.path(), &["identify", "slow.csv", "--by-yaw-rate"]));
    assert!(error.contains("0.3 m/s") && error.contains("faster"), "{error}");
}

/// An ordinary drive of the car with a steering slower than its file says; `more` settings.
fn drive(folder: &Path, log: &str, more: &[&str]) {
    let slow = ["--set", "car.effect.steer_lag=0.05", "--set", "car.effect.steer_delay=0.04"];
    let told =
        ["--variant", "actuator", "--set", "actuator.dead_time=0.04", "--set", "actuator.time_constant=0.1"];
    let path = command::road();
    let drive = ["drive", "--quiet", "--path", &path, "--duration", "20", "--log", log];
    done(&rfl(folder, &[&drive[..], &slow, &told, more].concat()));
}

const CAR: &str = include_str!("../vehicles/c_class.toml");

#[test]
fn an_ordinary_drive_goes_into_a_vehicle_file_whose_comments_stay() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    drive(folder.path(), "drive.csv", &[]);
    let mine = format!("# measured by me\n{CAR}");
    std::fs::write(at("my_car.toml"), &mine).unwrap();
    let into = ["identify", "drive.csv", "--into", "my_car.toml", "--json", "found.json"];
    let said = done(&rfl(folder.path(), &into));
    let found: Value = serde_json::from_str(&std::fs::read_to_string(at("found.json")).unwrap()).unwrap();
    for (name, truth) in [("dead_time", 0.04), ("lag", 0.1), ("delay", 0.14), ("gain", 1.0), ("offset", 0.0)]
    {
        let [value, low, high] = ["value", "low", "high"].map(|key| found[name][key].as_f64().unwrap());
        assert!((value - truth).abs() < 1e-3 && low <= value && value <= high, "{name}: {found}");
        assert_eq!(found[name]["excited"], true, "{name}: {found}");
    }
    let rows = found["closed_loop"].as_array().unwrap();
    assert!(rows.len() == 3 && rows.iter().all(|row| row["better"] == true), "{found}");
    assert!(said.contains("next: rfl drive --vehicle my_car.toml"), "{said}");
    // Only the two numbers are others.
    let text = std::fs::read_to_string(at("my_car.toml")).unwrap();
    let changed: Vec<(&str, &str)> =
        mine.lines().zip(text.lines()).filter(|(before, after)| before != after).collect();
    assert_eq!(mine.lines().count(), text.lines().count());
    assert_eq!(changed.len(), 2, "{changed:?}");
    assert!(changed[0].1.starts_with("dead_time = 0.04 ") && changed[0].1.ends_with("# s"), "{changed:?}");
    assert!(changed[1].1.contains("# s, of the steering actuator"), "{changed:?}");
    // The same again changes nothing, and a name that is none yet becomes the vehicle's file.
    let again = done(&rfl(folder.path(), &[&into[..], &["--no-check"]].concat()));
    assert!(again.contains("nothing changes"), "{again}");
    assert_eq!(std::fs::read_to_string(at("my_car.toml")).unwrap(), text);
    done(&rfl(folder.path(), &["identify", "drive.csv", "--no-check", "--into", "new.toml"]));
    assert!(std::fs::read_to_string(at("new.toml")).unwrap().contains("dead_time = 0.04 "));
}

#[test]
fn a_backlash_goes_into_the_file_and_two_cars_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    drive(folder.path(), "loose.csv", &["--set", "effect.steer_backlash=0.008"]);
    drive(folder.path(), "slow.csv", &["--set", "effect.steer_lag=0.1"]);
    std::fs::write(at("my_car.toml"), CAR).unwrap();
    let both = ["identify", "loose.csv", "slow.csv", "--no-check", "--into", "my_car.toml"];
    let output = rfl(folder.path(), &both);
    let error = String::from_utf8_lossy(&output.stderr);
    let words = "not written: the logs contradict each other: dead time and lag together";
    assert!(output.status.code() == Some(1) && error.contains(words), "{error}");
    assert_eq!(std::fs::read_to_string(at("my_car.toml")).unwrap(), CAR);
    done(&rfl(folder.path(), &["identify", "loose.csv", "--no-check", "--into", "my_car.toml"]));
    let text = std::fs::read_to_string(at("my_car.toml")).unwrap();
    assert!(text.contains("\nbacklash = 0.008 "), "{text}");
}

#[test]
fn what_is_not_excited_is_said_and_written_nowhere() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // Slow steering: the angle follows 0.16 s later, however that is shared out.
    let rows: String = (0..1000)
        .map(|k| {
            let time = 0.02 * f64::from(k);
            let noise = 1e-3 * (f64::from(k * k % 89) / 44.0 - 1.0);
            format!(
                "{time:.2},{:.6},{:.6}\n",
                0.02 * (0.3 * time).sin(),
                0.02 * (0.3 * (time - 0.16)).sin() + noise
            )
        })
        .collect();
    std::fs::write(at("slow.csv"), format!("time,steer_cmd,steer\n{rows}")).unwrap();
    std::fs::write(at("my_car.toml"), CAR).unwrap();
    let slow = ["identify", "slow.csv", "--no-check"];
    let said = done(&rfl(folder.path(), &slow));
    assert!(said.contains("not excited: how the delay is shared out") && said.contains("slalom"), "{said}");
    let error = refused(&rfl(folder.path(), &[&slow[..], &["--into", "my_car.toml"]].concat()));
    assert!(error.contains("my_car.toml") && error.contains("not excited"), "{error}");
    assert_eq!(std::fs::read_to_string(at("my_car.toml")).unwrap(), CAR);
    let error = refused(&rfl(folder.path(), &["identify", "none.csv", "--into", "my_car.toml"]));
    assert!(error.contains("none.csv"), "{error}");
}

#[test]
fn real_logs_without_the_command_are_refused_with_the_reason() {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/genesis/real_human_fast_lap.csv");
    if !log.exists() {
        eprintln!("skipped: {} is not there", log.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for more in [&[][..], &["--by-yaw-rate"]] {
        let error = refused(&rfl(folder.path(), &[&["identify", log.to_str().unwrap()], more].concat()));
        assert!(error.contains("steer_cmd"), "{error}");
    }
}

#[test]
fn a_single_wrong_value_changes_no_number() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    drive(folder.path(), "drive.csv", &[]);
    let identified = |log: &str| {
        done(&rfl(folder.path(), &["identify", log, "--no-check", "--json", "found.json"]));
        let found: Value = serde_json::from_slice(&std::fs::read(at("found.json")).unwrap()).unwrap();
        (
            found["findings"].to_string(),
            ["dead_time", "lag"].map(|name| found[name]["value"].as_f64().unwrap()),
        )
    };
    let (_, sound) = identified("drive.csv");
    let text = std::fs::read_to_string(at("drive.csv")).unwrap();
    let column = |name: &str| text.lines().next().unwrap().split(',').position(|it| it == name).unwrap();
    for (name, value) in [("steer_cmd", "1"), ("steer_cmd", "-0.5"), ("steer", "1.5")] {
        let place = column(name);
        let with = |(row, line): (usize, &str)| {
            let mut fields: Vec<&str> = line.split(',').collect();
            if row == 500 {
                fields[place] = value;
            }
            fields.join(",") + "\n"
        };
        std::fs::write(at("wrong.csv"), text.lines().enumerate().map(with).collect::<String>()).unwrap();
        let (said, found) = identified("wrong.csv");
        assert!(said.contains(&format!("{name} = ")) && said.contains("in row 500"), "{said}");
        assert!(
            found.iter().zip(sound).all(|(found, sound)| (found - sound).abs() < 2e-4),
            "{found:?} {sound:?}"
        );
    }
}

#[test]
fn a_new_vehicle_file_elsewhere_has_its_tyres_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    drive(folder.path(), "drive.csv", &[]);
    for name in ["a/tyres", "b"] {
        std::fs::create_dir_all(at(name)).unwrap();
    }
    std::fs::write(at("a/tyres/mine.tir"), include_str!("../vehicles/tyres/c_class.tir")).unwrap();
    std::fs::write(at("a/car.toml"), CAR.replace("tyres/c_class.tir", "tyres/mine.tir")).unwrap();
    let into = ["identify", "drive.csv", "--no-check", "--vehicle", "a/car.toml", "--into", "b/car.toml"];
    done(&rfl(folder.path(), &into));
    let path = command::road();
    done(&rfl(
        folder.path(),
        &["drive", "--quiet", "--vehicle", "b/car.toml", "--duration", "2", "--path", &path],
    ));
}

#[test]
fn a_header_without_rows_is_said_and_a_missing_folder_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("head.csv"), "time,steer_cmd,steer,vx,yaw_rate\n").unwrap();
    for more in [&[][..], &["--by-yaw-rate"], &["--from", "1"]] {
        let error = refused(&rfl(folder.path(), &[&["identify", "head.csv"], more].concat()));
        assert!(error.contains("head.csv: no row follows the header"), "{error}");
    }
    drive(folder.path(), "drive.csv", &[]);
    for (place, words) in [("none/car.toml", "its folder is missing"), (".", "is a folder")] {
        let output = rfl(folder.path(), &["identify", "drive.csv", "--into", place]);
        assert!(refused(&output).contains(words) && output.stdout.is_empty(), "{output:?}");
    }
}
