//! What knowing more gives: rows `identified`, `learned` and `tuned` beside `default`, on a part of the matrix's drives.
//!
//! Each is made by the program `rfl` as a user runs it, built beside this example: `rfl learn` with the road of the matrix as
//! the one to prove on, which nothing was learned on, and, for fewer drives, `rfl identify --into` and `rfl tune`.

use crate::matrix::{CARS, Case, Road, TRUCKS, case, roads};
use crate::{Arguments, map};
use rfl_mpc::path::write_csv;
use rfl_mpc::simulate::experiment::Compared;
use rfl_mpc::simulate::{CAR_COLUMNS, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck};
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path as File, PathBuf};
use std::process::Command;

/// Every so many drives of the matrix are learned for, and every so many of those are tuned for.
const EVERY: [usize; 2] = [8, 12];
const TUNED: usize = 6;
/// Candidates of a search.
const BUDGET: &str = "60";

pub fn run(arguments: &Arguments) -> Result<Value, Box<dyn Error>> {
    let car = part::<Car, 4, CAR_COLUMNS>(arguments, CARS, EVERY[0])?;
    let truck = part::<Truck, 6, TRUCK_COLUMNS>(arguments, TRUCKS, EVERY[1])?;
    Ok(json!({ "budget": BUDGET, "drives": car.into_iter().chain(truck).collect::<Vec<_>>() }))
}

fn part<P: Compared<S, C>, const S: usize, const C: usize>(
    arguments: &Arguments,
    count: usize,
    every: usize,
) -> Result<Vec<Value>, Box<dyn Error>> {
    let roads = roads::<P, S, C>()?;
    let every = if arguments.quick { 10 * every } else { every };
    let cases: Vec<Case> = (0..count)
        .step_by(every)
        .map(|number| case::<P, S, C>(number, roads.len()))
        .filter(|case| arguments.only.as_ref().is_none_or(|only| *only == case.id))
        .collect();
    let drives = map(arguments.threads, P::KIND, cases.len(), |number| {
        let case = &cases[number];
        match climb(case, &roads[case.road], number.is_multiple_of(TUNED), arguments) {
            Ok(value) => value,
            Err(error) => json!({ "id": case.id, "failed": error.to_string() }),
        }
    });
    if arguments.only.is_some() {
        drives.iter().for_each(|drive| println!("{drive:#}"));
    }
    Ok(drives)
}

/// Runs the program; what it wrote as JSON.
fn rfl(words: &[String], json: &File) -> Result<Value, Box<dyn Error>> {
    let program = std::env::current_exe()?.with_file_name("../rfl");
    let done = Command::new(program).args(words).output()?;
    // A lost drive or a refused model is a result.
    match std::fs::read_to_string(json) {
        Ok(text) => Ok(serde_json::from_str(&text)?),
        Err(_) => Err(String::from_utf8_lossy(&done.stderr).trim().to_owned().into()),
    }
}

fn climb(case: &Case, road: &Road, is_tuned: bool, arguments: &Arguments) -> Result<Value, Box<dyn Error>> {
    let folder = arguments.out.join("ladder").join(&case.id);
    std::fs::create_dir_all(&folder)?;
    let at = |name: &str| folder.join(name);
    let text = |file: PathBuf| file.to_string_lossy().into_owned();
    let road_file = match &road.from {
        Ok(file) => file.clone(),
        Err(samples) => {
            write_csv(&at("road.csv"), samples)?;
            at("road.csv")
        }
    };
    let plant = [
        ("effect.steer_lag", case.lag),
        ("effect.steer_delay", case.dead_time),
        ("effect.payload", case.payload),
        ("effect.road_friction", case.friction),
        ("speed.lateral_accel", case.accel),
    ];
    let mut plant: Vec<String> =
        plant.iter().flat_map(|(name, value)| ["--set".to_owned(), format!("{name}={value}")]).collect();
    plant.extend(["--vehicle", case.vehicle, "--quiet"].map(str::to_owned));
    let words = |first: &[&str], further: &[(&str, String)]| -> Vec<String> {
        let first = first.iter().map(|&word| word.to_owned());
        first.chain(further.iter().flat_map(|(name, value)| [(*name).to_owned(), value.clone()])).collect()
    };

    let mut learn = words(
        &["learn", "--threads", "1"],
        &[("--test", text(road_file.clone())), ("--out", text(folder.clone()))],
    );
    learn.extend(plant.iter().cloned());
    let _ = std::fs::remove_file(at("learn.json"));
    let learned = rfl(&learn, &at("learn.json"))?;
    let mut rows: Vec<Value> = learned["proof"]
        .as_array()
        .into_iter()
        .flatten()
        .filter(|row| row["road"] == "test road")
        .cloned()
        .collect();

    let mut tuned = Value::Null;
    if is_tuned {
        let vehicle = text(at("vehicle.toml"));
        let _ = std::fs::remove_file(at("vehicle.toml"));
        let identify = words(
            &["identify", &text(at("drive.csv")), "--no-check"],
            &[
                ("--vehicle", case.vehicle.to_owned()),
                ("--into", vehicle.clone()),
                ("--json", text(at("identify.json"))),
            ],
        );
        rfl(&identify, &at("identify.json"))?;
        let out = at("tune");
        let tune = words(
            &["tune", "--quiet", "--threads", "1", "--budget", BUDGET],
            &[
                ("--vehicle", vehicle),
                ("--set", format!("speed.lateral_accel={}", case.accel)),
                ("--out", text(out.clone())),
            ],
        );
        rfl(&tune, &out.join("tune.json"))?;
        let file = out.join("controller.toml");
        tuned = json!({ "written": file.exists() });
        if file.exists() {
            let mut drive = words(
                &["drive"],
                &[
                    ("--path", text(road_file)),
                    ("--controller", text(file)),
                    ("--json", text(at("tuned.json"))),
                ],
            );
            drive.extend(plant);
            let steering = &learned["steering"];
            let known = [("dead_time", &steering["dead_time"]), ("time_constant", &steering["lag"])];
            let known = known.into_iter().filter_map(|(name, value)| Some((name, value.as_f64()?)));
            drive.extend(
                known.flat_map(|(name, value)| ["--set".to_owned(), format!("actuator.{name}={value}")]),
            );
            let drive = rfl(&drive, &at("tuned.json"))?;
            rows.push(json!({
                "controller": "tuned", "mean": drive["tracking"]["mae"], "max": drive["tracking"]["max"],
                "outcome": drive["outcome"],
            }));
        }
    }
    Ok(json!({
        "id": case.id, "vehicle": case.vehicle, "road": road.name, "lag": case.lag, "dead_time": case.dead_time,
        "lateral_accel": case.accel, "friction": case.friction, "payload": case.payload,
        "steering": learned["steering"], "refused": learned["refused"], "tuned": tuned, "rows": rows,
    }))
}
