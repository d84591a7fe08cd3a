//! The files of `rfl evaluate`: what is there is not run again, and nothing is put beside what is not comparable.

use crate::command::{done, refused, rfl};
use rfl_mpc::simulate::experiment::vehicle_digest;
use rfl_mpc::vehicle::{CarParameters, builtin};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

const ASKED: [&str; 10] =
    ["evaluate", "--quick", "--plants", "lag", "--noise", "off", "--rows", "MPC,RFL+S", "--out", "one"];

fn row(name: &str, mae: f64) -> Value {
    let weights = json!({ "q_e1_rate": mae, "q_e2": 1.0, "q_e2_rate": 0.0, "r_rate": 0.1,
        "disturbance_noise": 0.0, "prediction_noise": 0.0 });
    let outcome = json!([{ "tracking": { "mae": mae, "rmse": mae, "max": mae }, "steering": { "rate_rms": 0.1 },
        "lost": false }]);
    json!({ "row": name, "weights": weights, "own_best": outcome, "frozen": outcome, "default": outcome })
}

/// Results of the default car, of this budget.
fn results(budget: usize, rows: &[Value]) -> Value {
    let car = builtin("c_class").unwrap();
    json!({ "vehicle": car.name, "vehicle_digest": vehicle_digest(&car), "plant": "lag", "noise": false,
        "effort": { "seeds": 1, "drives": 2, "budget": budget, "threads": 0 }, "rows": rows, "ablations": [] })
}

fn put(folder: &Path, name: &str, results: &Value) {
    fs::create_dir_all(folder.join(name)).unwrap();
    fs::write(folder.join(name).join("lag.json"), results.to_string()).unwrap();
}

fn there(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("one/lag.json")).unwrap()).unwrap()
}

/// The default car in a folder of its own, with one text of it and of its tyres in place of another.
fn other_car(folder: &Path, from: &str, to: &str) {
    let vehicles = Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles");
    fs::create_dir_all(folder.join("tyres")).unwrap();
    for file in ["c_class.toml", "tyres/c_class.tir"] {
        let text = fs::read_to_string(vehicles.join(file)).unwrap();
        fs::write(folder.join(file), text.replace(from, to)).unwrap();
    }
}

#[test]
fn results_of_a_car_of_the_same_name_with_other_numbers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let whole = results(12, &[row("MPC", 2e-3), row("RFL+S", 1e-3)]);
    put(folder, "one", &whole);
    assert!(done(&rfl(folder, &ASKED)).contains("there already"));
    other_car(folder, "mass = 1400.0", "mass = 1503.25");
    let error = refused(&rfl(folder, &[&ASKED[..], &["--vehicle", "c_class.toml"]].concat()));
    assert!(error.contains("with the numbers of") && error.contains("--out"), "{error}");
    // Nothing was touched, and another plant or noise below this name is no less wrong.
    assert_eq!(there(folder), whole);
    for (key, value) in [("plant", json!("as_is")), ("noise", json!(true)), ("vehicle", json!("a bus"))] {
        let mut other = whole.clone();
        other[key] = value;
        put(folder, "one", &other);
        let error = refused(&rfl(folder, &ASKED));
        assert!(error.contains(key) && error.contains("--out"), "{error}");
    }
}

#[test]
fn a_vehicle_s_digest_is_of_its_numbers_and_its_tyres() {
    let digest = |from: &str, to: &str| {
        let folder = tempfile::tempdir().unwrap();
        other_car(folder.path(), from, to);
        vehicle_digest(&CarParameters::read(&folder.path().join("c_class.toml")).unwrap())
    };
    let same = digest("SI units", "SI units");
    assert_eq!(same, digest("SI units", "Units of the SI"));
    assert_ne!(same, digest("mass = 1400.0", "mass = 1400.5"));
    assert_ne!(same, digest("PDY1 = 1.05", "PDY1 = 1.06"));
}

#[test]
fn ablations_that_are_asked_for_are_not_there_already() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Of a file that does not tell its vehicle's numbers: what would be run is refused, at once.
    let mut old = results(12, &[row("MPC", 2e-3), row("RFL+S", 1e-3)]);
    old.as_object_mut().unwrap().remove("vehicle_digest");
    put(folder, "one", &old);
    assert!(done(&rfl(folder, &ASKED)).contains("there already"));
    let with = [&ASKED[..], &["--ablations"]].concat();
    let error = refused(&rfl(folder, &with));
    assert!(error.contains("an earlier rfl") && error.contains("--out"), "{error}");
    old["ablations"] = json!([{ "name": "as it is" }]);
    put(folder, "one", &old);
    assert!(done(&rfl(folder, &with)).contains("there already"));
    // What a stopped run left is not whole.
    old["unfinished"] = json!(true);
    put(folder, "one", &old);
    refused(&rfl(folder, &ASKED));
}

#[test]
fn joined_rows_are_of_one_effort_whichever_and_stand_in_one_table() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    put(folder, "one", &results(7, &[row("MPC", 2e-3)]));
    put(folder, "two", &results(7, &[row("MPC", 2e-3), row("NMPC", 1e-3)]));
    let join = ["evaluate", "--plants", "lag", "--noise", "off", "--join", "two", "--out", "one"];
    let said = done(&rfl(folder, &join));
    let line = said.lines().find(|line| line.starts_with("NMPC")).unwrap();
    assert!(said.contains("1 seed\n") && line.contains(" 50.0 "), "{said}");
    assert_eq!(there(folder)["rows"].as_array().unwrap().len(), 2);
    put(folder, "two", &results(9, &[row("RF", 1e-3)]));
    let error = refused(&rfl(folder, &join));
    for words in ["--budget 7 here", "--budget 9 there", "one", "two", "folder of their own"] {
        assert!(error.contains(words), "{words}: {error}");
    }
    assert!(!error.contains("delete"), "{error}");
}

#[test]
fn a_plant_that_is_named_twice_is_one() {
    let folder = tempfile::tempdir().unwrap();
    let list = ["evaluate", "--plants", "lag,as_is,lag", "--noise", "off", "--list"];
    assert_eq!(done(&rfl(folder.path(), &list)), "lag off\nas_is off\n");
}
