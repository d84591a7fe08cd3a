//! The fault table: what befalls the measurements, at two speeds and many stations; and learned models that are wrong.
//!
//! The deviation that a fault adds is the largest true lateral error from its beginning on, less that of the same drive
//! without it. The road is BrandsHatch, cut open.

use crate::{Arguments, map, shared};
use rfl_mpc::control::{
    Choice, ControlStatus, ControlVariant, Controller, ControllerParameters, Measurement, Propagation,
    RollOut,
};
use rfl_mpc::path::{Closure, Path, PathOptions};
use rfl_mpc::residual::ResidualModel;
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Car, Effects, builtin};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::error::Error;
use std::path::Path as File;
use std::sync::Arc;

/// What the controller is told, what it was told last before the fault, and the road.
type Fault = fn(&mut Measurement, &Measurement, &Path);

const FAULTS: [(&str, Fault); 9] = [
    ("yaw + 0.2 rad", |m, _, _| m.yaw += 0.2),
    ("yaw rate 5 rad/s", |m, _, _| m.yaw_rate = 5.0),
    ("30 m elsewhere", |m, _, _| {
        m.x -= 30.0 * m.yaw.sin();
        m.y += 30.0 * m.yaw.cos();
    }),
    ("all frozen", |m, before, _| *m = *before),
    ("all NaN", |m, _, _| {
        let nan = f64::NAN;
        *m = Measurement { x: nan, y: nan, yaw: nan, vx: nan, vy: nan, yaw_rate: nan, ..*m };
    }),
    ("vx = 0", |m, _, _| m.vx = 0.0),
    ("vy + 3 m/s", |m, _, _| m.vy += 3.0),
    ("yaw rate + 0.3 rad/s", |m, _, _| m.yaw_rate += 0.3),
    ("at the road's end", |m, _, path| {
        let end = path.at(path.length());
        (m.x, m.y, m.yaw) = (end.x, end.y, end.yaw);
    }),
];
/// When it begins, s: by then the vehicle drives as it does.
const BEGIN: f64 = 3.0;
/// How long a drive goes on, s.
const DURATION: f64 = 16.0;
const STEP: f64 = 0.02;
const SPEEDS: [f64; 2] = [10.0, 26.0];
const LENGTHS: [f64; 2] = [0.2, 2.0];
/// Lag and dead time that are added, s.
const ACTUATORS: [(f64, f64); 2] = [(0.0, 0.0), (0.1, 0.06)];
const STATIONS: usize = 12;

/// How a drive went from the fault on.
#[derive(Default)]
struct Driven {
    error: f64,
    /// Steps that were called optimal while the fault was there.
    optimal: u32,
    /// Whether it ended in a stop along the road.
    safe_stop: bool,
    stands: bool,
    statuses: BTreeSet<&'static str>,
}

pub fn run(arguments: &Arguments) -> Result<Value, Box<dyn Error>> {
    let Some(file) = shared("data/paths/tum_BrandsHatch.csv") else {
        return Ok(json!({ "faults": [], "residuals": [] }));
    };
    let text = std::fs::read_to_string(&file)?;
    let lines: Vec<&str> = text.lines().collect();
    let options = PathOptions { closure: Closure::Open, ..PathOptions::default() };
    let open = lines[..lines.len() - 12].join("\n");
    let path = Arc::new(Path::from_csv(open.as_bytes(), &file, &options)?);
    let stations: Vec<f64> = {
        let count = if arguments.quick { 3 } else { STATIONS };
        let last = path.length() - 500.0;
        (0..count).map(|k| 100.0 + (last - 100.0) * k as f64 / count as f64).collect()
    };
    let mut rows = vec![];
    for (speed, actuator) in SPEEDS.into_iter().flat_map(|speed| ACTUATORS.map(|actuator| (speed, actuator)))
    {
        let mut faults: Vec<(&str, f64, Fault)> = vec![("none", 0.0, |_, _, _| ())];
        for (name, fault) in FAULTS {
            match name {
                "at the road's end" => faults.push((name, STEP, fault)),
                _ => faults.extend(LENGTHS.map(|length| (name, length, fault))),
            }
        }
        rows.extend(faults.into_iter().map(|(name, length, fault)| (speed, actuator, name, length, fault)));
    }
    let drives = map(arguments.threads, "faults", rows.len(), |number| {
        let (speed, actuator, name, length, fault) = rows[number];
        let driven: Result<Vec<Driven>, String> =
            stations.iter().map(|station| drive(&path, speed, actuator, *station, length, fault)).collect();
        let driven = match driven {
            Ok(driven) => driven,
            Err(error) => return json!({ "fault": name, "failed": error }),
        };
        let count = |of: fn(&Driven) -> bool| driven.iter().filter(|d| of(d)).count();
        let statuses: BTreeSet<_> = driven.iter().flat_map(|d| d.statuses.iter().copied()).collect();
        json!({
            "fault": name, "length": length, "speed": speed, "lag": actuator.0, "dead_time": actuator.1,
            "stations": stations, "errors": driven.iter().map(|d| d.error).collect::<Vec<_>>(),
            "optimal_steps": driven.iter().map(|d| d.optimal).sum::<u32>(),
            "safe_stop": count(|d| d.safe_stop), "stands": count(|d| d.stands), "statuses": statuses,
        })
    });
    Ok(json!({ "faults": with_added(drives), "residuals": residuals(arguments, &file)? }))
}

/// Adds what each fault adds to the drive without.
fn with_added(mut rows: Vec<Value>) -> Vec<Value> {
    let key = |row: &Value| (row["speed"].to_string(), row["lag"].to_string());
    let errors = |row: &Value| -> Vec<f64> {
        row["errors"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
    };
    let without: Vec<_> =
        rows.iter().filter(|row| row["fault"] == "none").map(|row| (key(row), errors(row))).collect();
    for row in &mut rows {
        let Some((_, base)) = without.iter().find(|(of, _)| *of == key(row)) else { continue };
        let added: Vec<f64> =
            errors(row).iter().zip(base).map(|(with, base)| (with - base).max(0.0)).collect();
        row["added"] = json!(added);
    }
    rows
}

fn drive(
    path: &Arc<Path>,
    speed: f64,
    (lag, dead_time): (f64, f64),
    station: f64,
    length: f64,
    fault: Fault,
) -> Result<Driven, String> {
    let car = builtin("c_class").map_err(|error| error.to_string())?;
    let mut parameters = ControllerParameters::for_car(&car);
    parameters.speed.limit = speed;
    let controller = Controller::new(parameters, path.clone()).map_err(|error| error.to_string())?;
    let effects = Effects { steer_lag: lag, steer_delay: dead_time, ..Effects::default() };
    let mut vehicle = Car::new(&car, &effects, Some(path.clone())).map_err(|error| error.to_string())?;
    let start = path.at(station);
    vehicle.place(start.x, start.y, start.yaw, controller.speed_plan().speed(station));
    let during = move |time: f64| time >= BEGIN - 1e-9 && time < BEGIN + length - 1e-9;
    let (road, mut before) = (path.clone(), Measurement::default());
    let mut closed = ClosedLoop::new(controller, vehicle, STEP).with_fault(move |time, told| {
        if during(time) { fault(told, &before, &road) } else { before = *told }
    });
    let mut driven = Driven::default();
    for step in 0..(DURATION / STEP) as u32 {
        let time = f64::from(step) * STEP;
        closed.advance().map_err(|error| error.to_string())?;
        let report = closed.controller().report();
        if time < BEGIN - 1e-9 {
            continue;
        }
        driven.error = driven.error.max(closed.lateral_error().abs());
        driven.optimal += u32::from(during(time) && report.status == ControlStatus::Optimal);
        driven.statuses.insert(report.status.name());
        driven.safe_stop = report.status == ControlStatus::SafeStop;
    }
    driven.stands = closed.vehicle().output().vx.abs() < 0.3;
    Ok(driven)
}

/// Learned models that are wrong, on the road as it is, against none: up to the speed of their training, where they are asked
/// from the beginning, and as fast as the road is.
fn residuals(arguments: &Arguments, road: &File) -> Result<Vec<Value>, Box<dyn Error>> {
    let path = Arc::new(Path::read(road)?);
    let files = ["residual_x10", "residual_x-1", "residual_const"];
    let files =
        files.into_iter().filter_map(|name| Some((name, shared(&format!("cases/files/{name}.rflm"))?)));
    let models: Vec<_> =
        std::iter::once(("none", None)).chain(files.map(|(name, file)| (name, Some(file)))).collect();
    let mut fastest = f64::INFINITY;
    for file in models.iter().filter_map(|(_, file)| file.as_ref()) {
        let model = ResidualModel::read(file)?;
        let speeds = model.schema().ranges.iter().filter(|range| range.name == "vx");
        fastest = speeds.map(|range| range.max).fold(fastest, f64::min);
    }
    let count = models.len() * ACTUATORS.len() * 2;
    Ok(map(arguments.threads, "models", count, |number| {
        let (name, file) = &models[number % models.len()];
        let number = number / models.len();
        let ((lag, dead_time), as_trained) = (ACTUATORS[number % ACTUATORS.len()], number < ACTUATORS.len());
        let of = || -> Result<Value, Box<dyn Error>> {
            let car = builtin("c_class")?;
            let mut parameters = ControllerParameters::for_car(&car);
            if as_trained {
                parameters.speed.limit = parameters.speed.limit.min(fastest);
            }
            let variant = if file.is_some() { ControlVariant::None } else { ControlVariant::Adaptive };
            let choice = Choice {
                variant,
                file: file.clone(),
                folder: "".into(),
                propagation: Propagation::Propagated,
                roll_out: RollOut::Corrected,
            };
            let (_, model) = choice.prediction_model(&parameters)?;
            let controller = Controller::predicting_with(parameters, path.clone(), model)?;
            let effects = Effects { steer_lag: lag, steer_delay: dead_time, ..Effects::default() };
            let mut closed = ClosedLoop::at_start(controller, &car, &effects, STEP)?;
            let drive = closed.record(600.0, |_, error| error.abs() < 4.0);
            let noticed = drive.statuses.iter().position(|status| *status == ControlStatus::ResidualFaded);
            let faded =
                drive.statuses.iter().filter(|status| **status == ControlStatus::ResidualFaded).count();
            Ok(json!({
                "model": name, "lag": lag, "dead_time": dead_time, "as_trained": as_trained, "max": drive.tracking().max,
                "mean": drive.tracking().mae, "outcome": drive.ending.outcome.name(),
                "noticed_at": noticed.map(|step| step as f64 * STEP),
                "faded_share": faded as f64 / drive.statuses.len().max(1) as f64,
            }))
        };
        of().unwrap_or_else(|error| json!({ "model": name, "failed": error.to_string() }))
    }))
}
