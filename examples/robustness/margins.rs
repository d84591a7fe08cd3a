//! Margins of the steering loop over speed, linear; and measured: delay and gain of the plant raised until a drive is lost.
//!
//! `calm` and `sure` are the ends of the controller's tightness: before, and after the drive has shown the actuator. Bisected
//! is between the file's value, which must not be lost, and the upper end; the boundary need not be the only one.

use crate::{Arguments, map};
use rfl_mpc::control::{
    ControlledParameters as _, ControllerFor, ControllerParametersFor, LinearController, PredictionModelFor,
    SteeringLoop,
};
use rfl_mpc::path::{Path, RandomRoad};
use rfl_mpc::simulate::experiment::Compared;
use rfl_mpc::simulate::{CAR_COLUMNS, ClosedLoopFor, Outcome, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck, VehicleParameters as _};
use serde_json::{Value, json};
use std::error::Error;
use std::sync::Arc;

const SPEEDS: [f64; 10] = [3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0, 32.0, 35.0];
/// Seed of the road on which delay and gain are raised.
const ROAD: u64 = 910_001;
const BISECTIONS: usize = 8;

pub fn run(arguments: &Arguments) -> Result<Value, Box<dyn Error>> {
    let mut linear = vec![];
    of::<Car, 4, CAR_COLUMNS>(&mut linear)?;
    of::<Truck, 6, TRUCK_COLUMNS>(&mut linear)?;
    let cars = ["c_class", "vw_vanagon"];
    let mut measured = raised::<Car, 4, CAR_COLUMNS>(arguments, &cars, 20.0)?;
    if !arguments.quick {
        measured.extend(raised::<Truck, 6, TRUCK_COLUMNS>(arguments, &["truck_simulation"], 15.0)?);
    }
    Ok(json!({ "linear": linear, "road_seed": ROAD, "measured": measured }))
}

fn of<P: Compared<S, C>, const S: usize, const C: usize>(
    rows: &mut Vec<Value>,
) -> Result<(), Box<dyn Error>> {
    for name in P::Parameters::BUILTIN {
        let parameters = P::controller(&P::Parameters::builtin(name)?);
        for (row, tightness) in [("calm", 0.0), ("sure", 1.0)] {
            let parameters =
                ControllerParametersFor { mpc: parameters.mpc.tightened(tightness), ..parameters };
            let actuator = parameters.actuator.actuator();
            let model = PredictionModelFor::Actuator(actuator);
            for controller in LinearController::at_speeds(&parameters, model, &SPEEDS)? {
                let (speed, vehicle) = (controller.speed, parameters.vehicle.nominal());
                let of = SteeringLoop::new(controller, vehicle, actuator, parameters.mpc.min_model_speed)?;
                let margins = of.margins();
                rows.push(json!({
                    "vehicle": name, "kind": P::KIND, "row": row, "speed": speed, "stable": margins.is_some(),
                    "delay": margins.map(|m| m.delay), "gain": margins.map(|m| m.gain),
                    "sensitivity": margins.map(|m| m.sensitivity), "crossover": margins.map(|m| m.crossover),
                }));
            }
        }
    }
    Ok(())
}

/// Raises delay and gain until the drive is lost.
fn raised<P: Compared<S, C>, const S: usize, const C: usize>(
    arguments: &Arguments,
    vehicles: &[&str],
    limit: f64,
) -> Result<Vec<Value>, Box<dyn Error>> {
    let family = if P::KIND == "truck" { RandomRoad::TRUCK } else { RandomRoad::CAR };
    let path = Arc::new(RandomRoad { length: 1.5 * family.length, ..family }.path(ROAD)?);
    let what = [("steer_delay", 0.0, 1.5), ("steer_gain", 1.0, 3.0)];
    let rows = ["calm", "sure", "default"];
    let count = vehicles.len() * what.len() * rows.len();
    let work = |number: usize| -> Result<Value, Box<dyn Error>> {
        let row = rows[number % rows.len()];
        let (effect, from, to) = what[number / rows.len() % what.len()];
        let vehicle = vehicles[number / rows.len() / what.len()];
        let driven = |value: f64| drive::<P, S, C>(vehicle, &path, row, effect, value, limit);
        let (first, (mut low, mut high)) = (driven(from)?, (from, to));
        let last = driven(to)?;
        let mut at_low = first.1;
        if first.0 || !last.0 {
            (low, high) = if first.0 { (from, from) } else { (to, to) };
        } else {
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                match driven(middle)? {
                    (true, _) => high = middle,
                    (false, max) => (low, at_low) = (middle, max),
                }
            }
        }
        Ok(json!({
            "vehicle": vehicle, "row": row, "effect": effect, "stands": low, "lost_at": high, "upper_end": to,
            "max_without": first.1, "max_where_it_stands": at_low,
        }))
    };
    Ok(map(arguments.threads, "raised", count, |number| {
        work(number).unwrap_or_else(|error| json!({ "failed": error.to_string() }))
    }))
}

/// Whether it is lost, and its largest error, m.
fn drive<P: Compared<S, C>, const S: usize, const C: usize>(
    vehicle: &str,
    path: &Arc<Path>,
    row: &str,
    effect: &str,
    value: f64,
    limit: f64,
) -> Result<(bool, f64), Box<dyn Error>> {
    let vehicle = P::Parameters::builtin(vehicle)?;
    let mut effects = vehicle.effects().clone();
    *P::effect(&mut effects, effect).ok_or("no such effect")? = value;
    let mut parameters = P::controller(&vehicle);
    parameters.speed.limit = limit;
    let known = parameters.actuator.actuator();
    // Calm and sure: what it predicts with stays the file's. A given actuator counts as sure.
    let model = match row {
        "default" => PredictionModelFor::Adaptive(known),
        _ => PredictionModelFor::Actuator(known),
    };
    if row == "calm" {
        parameters.mpc.tightening = 1.0;
    }
    let controller = ControllerFor::predicting_with(parameters, path.clone(), model)?;
    let (step, duration) = (parameters.mpc.sample_time, 2.0 * controller.speed_plan().duration() + 30.0);
    let mut closed = ClosedLoopFor::<P, S, C>::at_start(controller, &vehicle, &effects, step)?;
    let drive = closed.record(duration, |_, error| error.abs() < 2.5);
    Ok((drive.ending.outcome == Outcome::Lost, drive.tracking().max))
}
