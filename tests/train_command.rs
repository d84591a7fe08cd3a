//! `rfl train`: what it learns from logs of any kind, what it says of bad ones, and that the model is the same bits
//! on any number of threads.

use crate::command::{done, refused, rfl, road, text};
use crate::drive_table::DriveTable;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Output;
use std::sync::LazyLock;

const SLOW: [&str; 4] = ["--set", "effect.steer_lag=0.1", "--set", "effect.steer_delay=0.06"];

/// A folder with a drive of the nominal controller on a short road, `drive_1.csv`.
static COLLECTED: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    collect(folder.path(), &SLOW);
    folder
});

fn collect(folder: &Path, more: &[&str]) {
    let road = road();
    let arguments = ["collect", "--quiet", "--runs", "1", "--out", ".", "--path", &road];
    done(&rfl(folder, &[&arguments[..], more].concat()));
}

/// The collected log.
fn collected() -> DriveTable {
    DriveTable::read(&COLLECTED.path().join("drive_1.csv"))
}

/// A quick training of a table, with more arguments; without the proof, which takes longer than all else.
fn train(folder: &Path, table: &DriveTable, more: &[&str]) -> Output {
    table.write(folder);
    rfl(
        folder,
        &[&["train", "log.csv", "--quiet", "--no-proof", "--trees", "3", "--depth", "3"], more].concat(),
    )
}

fn model(folder: &Path) -> Vec<u8> {
    std::fs::read(folder.join("out/residual/rfl_s.rflm")).unwrap()
}

/// The road of a drive of a proof.
fn road_of(drive: &Value) -> &str {
    drive["name"].as_str().unwrap().rsplit(", ").next().unwrap()
}

fn json(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

#[test]
fn a_model_is_left_out_where_the_controller_is_called_more_rarely() {
    let folder = tempfile::tempdir().unwrap();
    train(folder.path(), &collected(), &["--kind", "rfl_s"]);
    let (road, model) = (road(), "out/residual/rfl_s.rflm");
    let call = ["drive", "--quiet", "--path", &road, "--step", "0.05", "--json", "drive.json"];
    let with = rfl(folder.path(), &[&call[..], &["--residual", model]].concat());
    let said = String::from_utf8(with.stderr).unwrap();
    assert!(said.contains("rfl_s is of 0.02 s and is left out: --step 0.02 drives with it"), "{said}");
    let figures = || {
        let drive = json(&folder.path().join("drive.json"));
        assert_eq!(drive["variant"], "adaptive", "{drive}");
        drive["tracking"].to_string()
    };
    let left_out = figures();
    done(&rfl(folder.path(), &call));
    assert_eq!(left_out, figures());
}

#[test]
fn a_log_gives_a_model_that_fits_and_drives_better() {
    let folder = tempfile::tempdir().unwrap();
    collected().write(folder.path());
    let proven = ["train", "log.csv", "--quiet", "--trees", "3", "--depth", "3", "--json", "fit.json"];
    let said = done(&rfl(folder.path(), &proven));
    assert!(said.contains("out/residual/rfl_s.rflm") && !said.contains("note"), "{said}");
    let fit = json(&folder.path().join("fit.json"));
    assert_eq!(fit["models"][0]["proven"], Value::from(true), "{said}");
    // Sixteen drives, each on a road of its own; the whole interval of the change is below zero.
    let proof = &fit["models"][0]["proof"];
    let roads: BTreeSet<_> = proof["drives"].as_array().unwrap().iter().map(road_of).collect();
    let [low, high] = [0, 1].map(|end| proof["change"]["interval"][end].as_f64().unwrap());
    let mean = proof["change"]["mean"].as_f64().unwrap();
    assert!(roads.len() == 16 && low < mean && mean < high && high < 0.0, "{proof}");
    let (data, model) = (&fit["data"], &fit["models"][0]);
    assert_eq!((&data["gaps"], &data["not_finite"]), (&Value::from(0), &Value::from(0)));
    assert_eq!((model["kind"].as_str(), model["window"].as_u64()), (Some("rfl_s"), Some(35)));
    for output in 0..4 {
        let rmse = |of: &str| model["train"][of][output].as_f64().unwrap();
        assert!(rmse("rmse") < 0.2 * rmse("nominal_rmse"), "{model}");
    }
    let road = road();
    let mean = |more: &[&str]| {
        let drive = ["drive", "--quiet", "--path", &road, "--json", "drive.json"];
        done(&rfl(folder.path(), &[&drive[..], &SLOW, more].concat()));
        json(&folder.path().join("drive.json"))["tracking"]["mae"].as_f64().unwrap()
    };
    let (nominal, learned) = (mean(&[]), mean(&["--variant", "rfl_s"]));
    assert!(learned < 0.8 * nominal, "{learned} m, nominal {nominal} m");
    let actuator =
        ["--variant", "actuator", "--set", "actuator.dead_time=0.06", "--set", "actuator.time_constant=0.15"];
    // The default finds the actuator as it drives: to be told is worth little more.
    assert!(mean(&actuator) < 1.1 * nominal);
}

#[test]
fn a_model_of_a_vehicle_far_from_its_file_is_proven_on_other_plants_of_its_kind() {
    let folder = tempfile::tempdir().unwrap();
    let soft = ["--set", "effect.tyre_stiffness_front=0.4", "--set", "effect.tyre_stiffness_rear=0.4"];
    collect(folder.path(), &[&SLOW[..], &soft].concat());
    let proven = ["train", "drive_1.csv", "--quiet", "--json", "fit.json"];
    let said = done(&rfl(folder.path(), &proven));
    let at = said.find("no plant close to the vehicle's file explains the logs").expect(&said);
    assert!(said[at..].contains("proof: 16 drives"), "{said}");
    let fit = json(&folder.path().join("fit.json"));
    assert_eq!(fit["models"][0]["proven"], Value::from(true), "{said}");
    let left = |o: usize| fit["models"][0]["proof"]["plants"]["left"][o].as_f64().unwrap();
    assert!(left(0) < 0.2 && left(1) < 0.2, "{} and {} are left: {said}", left(0), left(1));
    for drive in fit["models"][0]["proof"]["drives"].as_array().unwrap() {
        let name = drive["name"].as_str().unwrap();
        let (front, rear) = name["stiffness ".len()..].split_once(',').unwrap().0.split_once('/').unwrap();
        let stiffness = [front, rear].map(|factor| factor.parse::<f64>().unwrap());
        assert!(stiffness.iter().all(|factor| (0.4..0.5).contains(factor)), "{name}");
    }
}

#[test]
fn a_model_that_saw_no_bend_is_not_shown_to_be_better_and_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let points: String = (0..300).map(|x| format!("{x},0\n")).collect();
    std::fs::write(folder.path().join("straight.csv"), format!("x,y\n{points}")).unwrap();
    let slow = ["--set", "effect.steer_lag=0.1", "--set", "effect.steer_delay=0.06"];
    let collect = ["collect", "--quiet", "--runs", "1", "--out", ".", "--path", "straight.csv"];
    done(&rfl(folder.path(), &[&collect[..], &["--vehicle", "bmw_320i"], &slow].concat()));
    let train = ["train", "drive_1.csv", "--quiet", "--vehicle", "bmw_320i", "--trees", "3", "--depth", "3"];
    let more = ["--out", "m.rflm", "--json", "fit.json"];
    let output = rfl(folder.path(), &[&train[..], &more].concat());
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("no model is written") && said.contains("--force"), "{said}");
    assert!(!folder.path().join("m.rflm").exists());
    let model = &json(&folder.path().join("fit.json"))["models"][0];
    assert!(model["proof"]["change"]["interval"][1].as_f64().unwrap() > 0.0, "{model}");
    let forced = done(&rfl(folder.path(), &[&train[..], &more, &["--force"]].concat()));
    assert!(forced.contains("warning: not shown to be better than the default controller"), "{forced}");
    assert!(folder.path().join("m.rflm").is_file());
}

#[test]
fn a_single_wrong_error_to_the_path_is_named_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    for (name, value) in [("e2", -3.0), ("e2", 1.0), ("curvature", 5.0), ("curvature_rate", 99.0)] {
        let table = collected().set(name, 400..401, &value.to_string());
        let said = done(&train(folder.path(), &table, &[]));
        assert!(said.contains(&format!("{name} = {value:.4} in row 401")), "{said}");
    }
}

#[test]
fn drives_of_an_earlier_run_are_not_mixed_with_new_ones() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["drive_1.csv", "drive_2.csv"] {
        std::fs::write(folder.path().join(name), "time\n").unwrap();
    }
    let arguments = ["collect", "--quiet", "--runs", "1", "--out", ".", "--path", &road()];
    let error = refused(&rfl(folder.path(), &arguments));
    assert!(error.contains("drive_2.csv") && error.contains("--out"), "{error}");
    assert_eq!(std::fs::read_to_string(folder.path().join("drive_1.csv")).unwrap(), "time\n");
}

#[test]
fn what_was_learned_collects_again() {
    let folder = tempfile::tempdir().unwrap();
    done(&train(folder.path(), &collected(), &["--kind", "linear", "--out", "linear.rflm"]));
    let road = road();
    let again = |more: &[&str]| {
        let slow = ["--set", "effect.steer_lag=0.1", "--set", "effect.steer_delay=0.06"];
        let known = ["collect", "--quiet", "--runs", "1", "--out", "again", "--path", &road];
        rfl(folder.path(), &[&known[..], &slow, more].concat())
    };
    done(&again(&["--residual", "linear.rflm"]));
    let log = std::fs::read_to_string(folder.path().join("again/drive_1.csv")).unwrap();
    // Tighter weights and a model that knows the delay, the same dither: nearer to the path.
    let mean = |rows: &[Vec<String>], column: usize| {
        let errors = rows.iter().map(|row| row[column].parse::<f64>().unwrap().abs());
        errors.sum::<f64>() / rows.len() as f64
    };
    let first = collected();
    let e1 = first.place("e1");
    let rows: Vec<Vec<String>> =
        log.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect();
    let (first, second) = (mean(&first.rows, e1), mean(&rows, e1));
    assert!(second < 0.7 * first, "{second} m, in the first round {first} m");
    assert!(refused(&again(&["--residual", "none.rflm"])).contains("none.rflm"));
}

#[test]
fn all_kinds_are_trained_each_to_its_file() {
    let folder = tempfile::tempdir().unwrap();
    // What rfl_s cannot have is left to the others.
    let more = [
        "--all",
        "models",
        "--window",
        "16",
        "--tree-features",
        "errors_and_road",
        "--points",
        "40",
        "--hyperparameter-samples",
        "80",
        "--json",
        "fit.json",
    ];
    let said = done(&train(folder.path(), &collected(), &more));
    let fit = json(&folder.path().join("fit.json"));
    let kinds: Vec<&str> =
        fit["models"].as_array().unwrap().iter().map(|m| m["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["linear", "rt", "rf", "rtl", "rfl", "rfl_s", "gp_nmpc"]);
    for kind in kinds {
        assert!(folder.path().join(format!("models/{kind}.rflm")).is_file() && said.contains(kind), "{said}");
    }
}

#[test]
fn one_and_two_threads_give_the_same_bytes_and_another_seed_others() {
    let folder = tempfile::tempdir().unwrap();
    let log = collected();
    let mut models = Vec::new();
    for more in [["--threads", "1"], ["--threads", "2"], ["--seed", "7"]] {
        done(&train(folder.path(), &log, &more));
        models.push(model(folder.path()));
    }
    assert!(models[0] == models[1]);
    assert!(models[0] != models[2]);
}

#[test]
fn options_reach_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let more = [
        ["--kind", "rfl"],
        ["--window", "12"],
        ["--lambda", "0.01"],
        ["--tree-features", "errors_and_road"],
        ["--state-regressors", "2"],
        ["--min-leaf", "150"],
        ["--features-per-split", "5"],
        ["--set", "mpc.sample_time=0.04"],
        ["--set", "vehicle.mass=1500"],
        ["--set", "mpc.min_model_speed=2"],
        ["--out", "a/model.rflm"],
        ["--json", "fit.json"],
    ];
    let more = [&more.concat()[..], &["--road-regressors"]].concat();
    let said = done(&train(folder.path(), &collected(), &more));
    assert!(said.contains("2 times as fast as the controller steps, and thinned"), "{said}");
    let file = std::fs::read(folder.path().join("a/model.rflm")).unwrap();
    let file = String::from_utf8_lossy(&file);
    for words in [
        "kind = \"rfl\"",
        "window = 12",
        "leaf_lambda = 0.01",
        "tree_features = \"errors_and_road\"",
        "states = 2",
        "road = true",
        "sample_time = 0.04",
        "mass = 1500",
        "min_model_speed = 2",
    ] {
        assert!(file.contains(words), "no `{words}` in {}", &file[..2000]);
    }
    let model = &json(&folder.path().join("fit.json"))["models"][0];
    assert!(
        model["leaves"].as_u64().unwrap() <= 3 * 8 && model["smallest_leaf"].as_u64().unwrap() >= 75,
        "{model}"
    );
}

#[test]
fn the_prefilter_is_on_but_for_the_papers_least_squares() {
    let folder = tempfile::tempdir().unwrap();
    let learned = |more: &[&str]| {
        done(&train(folder.path(), &collected(), more));
        model(folder.path())
    };
    let paper = ["--lambda", "least-squares"];
    let [plain, none, some] = [&[][..], &["--prefilter", "0"], &["--prefilter", "0.8"]]
        .map(|more| [learned(more), learned(&[&paper[..], more].concat())]);
    assert!(plain[0] == some[0] && plain[0] != none[0]);
    assert!(plain[1] == none[1] && plain[1] != some[1]);
    for wrong in ["1", "-0.1", "nan"] {
        let wrong = format!("--prefilter={wrong}");
        let error = refused(&train(folder.path(), &collected(), &[&wrong]));
        assert!(error.contains("rfl_s: prefilter = ") && error.contains("less than 1"), "{error}");
    }
}

#[test]
fn a_log_of_poses_gives_with_the_road_the_model_of_the_whole_log() {
    let folder = tempfile::tempdir().unwrap();
    done(&train(folder.path(), &collected(), &[]));
    let whole = model(folder.path());
    let poses = collected().without(&[
        "e1",
        "e1_rate",
        "e2",
        "e2_rate",
        "station",
        "curvature",
        "curvature_rate",
        "ay",
        "accel_cmd",
    ]);
    let said = done(&train(folder.path(), &poses, &["--path", &road()]));
    assert!(said.contains("made by projection onto"), "{said}");
    assert!(model(folder.path()) == whole);

    let error = refused(&train(folder.path(), &poses, &[]));
    assert!(
        error.contains("columns e1, e1_rate, e2, e2_rate, curvature are missing") && error.contains("--path"),
        "{error}"
    );
    let error = refused(&train(folder.path(), &poses.clone().without(&["vy"]), &["--path", &road()]));
    assert!(error.contains("and column 'vy' is missing, too: record it"), "{error}");
    assert!(!error.contains("give the road"), "{error}");
    let error = refused(&train(folder.path(), &poses.clone().without(&["vy", "yaw"]), &[]));
    assert!(error.contains("give the road") && error.contains("columns yaw, vy are also missing"), "{error}");
    let other = road().replace("sudoku_turns", "hairpin_circuit");
    let error = refused(&train(folder.path(), &poses, &["--path", &other]));
    assert!(error.contains("hairpin_circuit.csv the road that was driven"), "{error}");
    for (table, words) in [
        (poses.clone().map("yaw", |_, yaw| -yaw), "sign"),
        (poses.clone().map("yaw", |_, yaw| yaw + 1.57), "another axis"),
    ] {
        let error = refused(&train(folder.path(), &table, &["--path", &road()]));
        assert!(error.contains(words), "{error}");
    }
    for column in ["yaw", "yaw_rate"] {
        let said = done(&train(
            folder.path(),
            &poses.clone().map(column, |_, x| x.to_degrees()),
            &["--path", &road()],
        ));
        assert!(said.contains(&format!("{column} was taken as degrees")), "{said}");
    }
}

#[test]
fn what_a_log_lacks_is_made_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let fit = |table: &DriveTable| {
        let said = done(&train(folder.path(), table, &["--json", "fit.json"]));
        let rmse = json(&folder.path().join("fit.json"))["models"][0]["train"]["rmse"][2].as_f64().unwrap();
        (said, rmse)
    };
    let whole = fit(&collected()).1;
    let lacking = collected().without(&["curvature_rate"]);
    for (table, words) in [
        (lacking.clone(), "curvature_rate made from curvature along station"),
        (lacking.without(&["station"]), "curvature_rate made from curvature along the way driven"),
    ] {
        let (said, rmse) = fit(&table);
        assert!(said.contains(words), "{said}");
        assert!((rmse / whole - 1.0).abs() < 0.2, "{rmse} {whole}");
    }
    let (said, _) = fit(&collected().without(&["steer_cmd"]));
    assert!(said.contains("the measured angle steer stands in"), "{said}");
    let holes = collected()
        .set("e1", 100..101, "")
        .set("vx", 200..201, "nan")
        .set("e2", 300..301, "20")
        .rows(|rows| [&rows[..500], &rows[600..]].concat());
    let (said, _) = fit(&holes);
    // Single values that are missing are bridged, as for a diagnosis; a wrong one is left out.
    for words in [
        "e2 = 20.0000 in row 301",
        "1 rows left out: a value is missing",
        "2 gaps",
        "values of e1 are missing",
    ] {
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn units_and_clocks_are_mended_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let log = collected;
    for (table, words) in [
        (log().map("vx", |_, vx| 3.6 * vx), "taken as km/h"),
        (log().map("e1", |_, e1| 1e3 * e1), "taken as mm"),
        (log().map("steer_cmd", |_, x| x.to_degrees()), "steer_cmd is 5"),
        (log().map("e2", |_, x| x.to_degrees()), "e2 changes 57 times"),
        (log().map("e2_rate", |_, x| x.to_degrees()), "e2_rate is 57 times"),
        (log().map("time", |_, t| 1e3 * t), "milliseconds"),
        (log().rows(|rows| [&rows[..], &rows].concat()), "2 drives"),
        (log().set("yaw_rate", 700..701, "7"), "yaw_rate = 7.0000 in row 701"),
        (
            log().rows(|mut rows| {
                rows.last_mut().unwrap().truncate(3);
                rows
            }),
            "1 line(s) at the end left out",
        ),
    ] {
        let said = done(&train(folder.path(), &table, &[]));
        assert!(said.contains(words), "no `{words}`: {said}");
    }
}

#[test]
fn bad_logs_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let log = collected;
    let cases: Vec<(&str, DriveTable, &[&str])> = vec![
        ("steering wheel", log().map("steer_cmd", |_, x| 16.0 * x), &["steer_cmd", "steering-wheel"]),
        ("right-handed", log().map("steer_cmd", |_, x| -x), &["steer_cmd", "sign"]),
        ("another rate", log().map("time", |_, t| 1.25 * t), &["log.csv", "the clock runs at another rate"]),
        ("a clock half as fast", log().map("time", |_, t| 1.5 * t), &["log.csv", "x and y move 0.6"]),
        ("e1 turned", log().map("e1", |_, e1| -e1), &["e1 has the opposite sign of e1_rate"]),
        ("no number at all", log().set("yaw_rate", 10..11, "1e308"), &["yaw_rate = 1e308 in row 11"]),
        ("time stands", log().map("time", |_, _| 3.0), &["log.csv", "rows have the same time", "--rate HZ"]),
        ("a stuck sensor", log().map("e1", |_, _| 0.1), &["`e1` is 0.1 in every row", "stuck"]),
        ("no steering", log().map("steer_cmd", |_, _| 0.0), &["`steer_cmd` is 0", "dither"]),
        ("too short", log().rows(|rows| rows[..150].to_vec()), &["150 rows", "at least 10 s"]),
        ("no rows", log().rows(|_| vec![]), &["0 rows"]),
        ("text", log().set("vx", 10..11, "fast"), &["log.csv, line 12, column vx", "'fast'"]),
        ("no speed", log().without(&["vx"]), &["'vx' is missing"]),
        ("no steering angle", log().without(&["steer", "steer_cmd"]), &["'steer_cmd' is missing"]),
        (
            "a row cut short",
            log().rows(|mut rows| {
                rows[700].truncate(3);
                rows
            }),
            &["log.csv, line 702", "same number of columns"],
        ),
    ];
    for (case, table, words) in cases {
        let error = refused(&train(folder.path(), &table, &[]));
        assert!(words.iter().all(|word| error.contains(word)), "{case}: {error}");
        assert!(!folder.path().join("out").exists(), "{case}: a model was written");
    }
    for (arguments, words) in [
        (&["train", "nowhere.csv"][..], "nowhere.csv"),
        (&["train", "log.csv", "--set", "effect.steer_lag=0.1"], "no number 'effect.steer_lag'"),
        (&["train", "log.csv", "--set", "vehicle.mass=1"], "vehicle.mass = 1 kg is outside"),
        (&["train", "log.csv", "--set", "vehicle.mass"], "NAME=VALUE"),
        (&["train", "log.csv", "--vehicle", "batmobile"], "batmobile"),
        (&["train", "log.csv", "--path", "no_road.csv"], "no_road.csv"),
    ] {
        log().write(folder.path());
        let error = refused(&rfl(folder.path(), arguments));
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn a_trucks_log_and_a_log_that_is_given_twice_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let truck =
        ["drive", "--quiet", "--duration", "20", "--vehicle", "truck_simulation", "--log", "truck.csv"];
    done(&rfl(folder.path(), &truck));
    let error = refused(&rfl(folder.path(), &["train", "truck.csv", "--quiet", "--no-proof"]));
    assert!(error.contains("truck.csv: the log has an articulation angle"), "{error}");
    let table = collected();
    let error = refused(&train(folder.path(), &table, &["--test", "log.csv"]));
    assert!(error.contains("log.csv: the same log as log.csv"), "{error}");
}

#[test]
fn what_is_no_model_for_the_car_does_not_drive() {
    let folder = tempfile::tempdir().unwrap();
    done(&train(folder.path(), &collected(), &[]));
    let bytes = model(folder.path());
    std::fs::write(folder.path().join("half.rflm"), &bytes[..bytes.len() / 2]).unwrap();
    let good = "out/residual/rfl_s.rflm";
    for (arguments, words) in [
        (&["--residual", good, "--vehicle", "bmw_320i"][..], "mass"),
        (&["--residual", good, "--set", "mpc.sample_time=0.01"], "sample time of 0.02 s"),
        (&["--residual", good, "--variant", "rfl"], "kind rfl_s, and the variant is rfl"),
        (&["--residual", good, "--variant", "actuator"], "leave the file out"),
        (&["--residual", "half.rflm"], "half.rflm"),
        (&["--residual", "nowhere.rflm"], "nowhere.rflm"),
        (&["--variant", "rtl"], "rfl train out/collect/*.csv --kind rtl"),
        (&["--variant", "rtl", "--models", "."], "./rtl.rflm"),
    ] {
        let error = refused(&rfl(folder.path(), &[&["drive", "--quiet"], arguments].concat()));
        assert!(error.contains(words), "{arguments:?}: {error}");
    }
}

#[test]
fn the_steering_is_that_of_the_measured_angle_or_else_of_the_yaw_rate() {
    let shown = |table: &DriveTable| {
        let folder = tempfile::tempdir().unwrap();
        done(&train(folder.path(), table, &["--json", "fit.json"]));
        json(&folder.path().join("fit.json"))["coverage"]["steering"].clone()
    };
    let number = |of: &Value, name: &str| of[name].as_f64().unwrap();
    // Dead time 0.06 s; lag 0.1 s on top of the 0.05 s of the vehicle's file.
    let by_angle = shown(&collected());
    assert_eq!(by_angle["by"], "steer", "{by_angle}");
    assert!((number(&by_angle, "dead_time") - 0.06).abs() < 0.002, "{by_angle}");
    assert!((number(&by_angle, "lag") - 0.15).abs() < 0.002, "{by_angle}");
    // A copy of the command is no measured angle.
    let copied = collected().without(&["steer"]).and("steer", |of| of("steer_cmd"));
    for table in [collected().without(&["steer"]), copied] {
        let by_yaw_rate = shown(&table);
        assert_eq!(by_yaw_rate["by"], "yaw_rate", "{by_yaw_rate}");
        let sum = number(&by_yaw_rate, "dead_time") + number(&by_yaw_rate, "lag");
        assert!((sum - 0.21).abs() < 0.03, "{by_yaw_rate}");
        // No grid's resolution is a certainty.
        assert!(number(&by_yaw_rate, "sum_spread") > 1e-4, "{by_yaw_rate}");
    }
}
