//! What the controller is not told beside its actuator: errors of sensors and of the steering's linkage, one in each drive, on
//! drives of the matrix at an ordinary lateral acceleration.

use crate::matrix::{CARS, Case, TRUCKS, case, drive, roads};
use crate::{Arguments, map};
use rfl_mpc::simulate::experiment::Compared;
use rfl_mpc::simulate::{CAR_COLUMNS, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck};
use serde_json::{Value, json};
use std::error::Error;

/// Effects and their values: of ordinary sensors that nobody has calibrated, and of a linkage that is worn.
const UNKNOWN: [(&str, f64); 12] = [
    ("yaw_rate_bias", 0.003),
    ("yaw_rate_bias", -0.01),
    ("yaw_rate_bias", 0.02),
    ("steer_backlash", 0.003),
    ("steer_backlash", 0.01),
    ("steer_backlash", 0.02),
    ("steer_offset", 0.01),
    ("steer_gain", 0.85),
    ("speed_scale", 1.03),
    ("heading_misalignment", 0.01),
    ("sensor_delay", 0.06),
    ("wind_y", 12.0),
];

pub fn run(arguments: &Arguments) -> Result<Value, Box<dyn Error>> {
    let car = part::<Car, 4, CAR_COLUMNS>(arguments, CARS)?;
    let truck = part::<Truck, 6, TRUCK_COLUMNS>(arguments, TRUCKS)?;
    Ok(json!({ "drives": car.into_iter().chain(truck).collect::<Vec<_>>() }))
}

fn part<P: Compared<S, C>, const S: usize, const C: usize>(
    arguments: &Arguments,
    count: usize,
) -> Result<Vec<Value>, Box<dyn Error>> {
    let roads = roads::<P, S, C>()?;
    let count = if arguments.quick { count / 10 } else { count / 2 };
    let cases: Vec<Case> = (0..count)
        .map(|number| {
            let mut case = case::<P, S, C>(number, roads.len());
            case.accel = case.accel.min(2.25);
            case.unknown = Some(UNKNOWN[number % UNKNOWN.len()]);
            case
        })
        .collect();
    Ok(map(arguments.threads, P::KIND, cases.len(), |number| {
        let case = &cases[number];
        drive::<P, S, C>(case, &roads[case.road], "default", arguments)
            .unwrap_or_else(|error| json!({ "id": case.id, "failed": error.to_string() }))
    }))
}
