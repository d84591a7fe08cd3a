//! Control steps to count instructions of: prepared by one process, made by another that only makes them, so that a
//! simulator of the processor has nothing else to do.

use crate::Outcome;
use crate::steps::{CAR_WINDOW, Model, car};
use crate::{read_table, write_table};
use rfl_mpc::control::{Controller, Measurement, PredictionModelFor, Propagation, Residual, RollOut};
use rfl_mpc::residual::{Kind, ResidualModel};
use rfl_mpc::simulate::{CAR_COLUMNS, SimulatedVehicle};
use rfl_mpc::vehicle::Car;
use serde_json::json;
use std::any::Any;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// Steps of the test route that are made before any is counted, and that are counted.
const BEFORE: usize = 500;
const COUNTED: usize = 200;
const MODEL: &str = "model.rfl";
/// Numbers of a measurement.
const MEASURED: usize = 9;

fn to_numbers(seen: &Measurement) -> [f64; MEASURED] {
    let Measurement { x, y, yaw, vx, vy, yaw_rate, steer, articulation, articulation_rate } = *seen;
    [x, y, yaw, vx, vy, yaw_rate, steer, articulation, articulation_rate]
}

fn from_numbers(numbers: &[f64; MEASURED]) -> Measurement {
    let [x, y, yaw, vx, vy, yaw_rate, steer, articulation, articulation_rate] = *numbers;
    Measurement { x, y, yaw, vx, vy, yaw_rate, steer, articulation, articulation_rate }
}

/// Learns a residual, and records what the vehicle measures under the nominal controller and the learned one.
pub fn prepare(folder: &Path) -> Outcome {
    let car = car();
    let learned = car.learn(Kind::Rfl, CAR_WINDOW);
    if let PredictionModelFor::Residual(residual) = &learned {
        let model: &dyn Any = &*residual.model;
        model.downcast_ref::<ResidualModel>().ok_or("no forest")?.write(&folder.join(MODEL))?;
    }
    for (name, model) in [("nominal", Model::<Car, 4, CAR_COLUMNS>::Nominal), ("rfl", learned)] {
        let mut closed = car.connect(car.test, car.timed, model);
        let mut seen = vec![];
        for step in 0..BEFORE + COUNTED {
            if step >= BEFORE {
                seen.extend(to_numbers(&SimulatedVehicle::<4, CAR_COLUMNS>::measured(closed.vehicle())));
            }
            closed.advance()?;
        }
        write_table(&folder.join(name), &seen)?;
    }
    Ok(json!({ "steps": COUNTED }))
}

/// The step whose instructions count: a function of its own, to be found by its name.
#[inline(never)]
fn counted_step(controller: &mut Controller, measurement: &Measurement) -> Result<(), Box<dyn Error>> {
    std::hint::black_box(controller.step(measurement)?);
    Ok(())
}

/// Makes the steps that were prepared, of the controller that `name` names.
pub fn run(folder: &Path, name: &str) -> Outcome {
    let model = match name {
        "nominal" => PredictionModelFor::Nominal,
        _ => PredictionModelFor::Residual(Residual {
            model: Arc::new(ResidualModel::read(&folder.join(MODEL))?),
            propagation: Propagation::Propagated,
            roll_out: RollOut::Corrected,
        }),
    };
    let car = car();
    let mut controller = Controller::predicting_with(car.timed, Arc::new(car.test.path()?), model)?;
    let seen = read_table(&folder.join(name))?;
    for numbers in seen.as_chunks::<MEASURED>().0 {
        counted_step(&mut controller, &from_numbers(numbers))?;
    }
    Ok(json!({ "steps": seen.len() / MEASURED }))
}
