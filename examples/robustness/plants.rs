//! A foreign plant: the equations of `../shared/cases/controller/suv_plant.py`, not ours, behind the controller's own steps.
//!
//! Single track with tanh tyres, `F = mu Fz tanh(C alpha / (mu Fz))`, a steering lag of first order at a bounded rate behind a
//! dead time, and a lag of the drive; a midpoint step of 1 ms. The controller knows `suv.toml`; it is not told the
//! steering. The FMU is not part of it.

use crate::{Arguments, map};
use rfl_mpc::control::{Controller, ControllerParameters, Measurement};
use rfl_mpc::path::{Path, RandomRoad};
use rfl_mpc::vehicle::{CarParameters, builtin};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::error::Error;
use std::sync::Arc;

const MASS: f64 = 1900.0;
const YAW_INERTIA: f64 = 3200.0;
const TO_AXLE: [f64; 2] = [1.35, 1.5];
const STIFFNESS: [f64; 2] = [105e3, 135e3];
const FRICTION: f64 = 0.9;
const LAG: f64 = 0.1;
const DELAY: usize = 60;
const DT: f64 = 0.001;
const FIRST_ROAD: u64 = 920_001;
const ROADS: usize = 8;

struct Suv {
    /// x, y, yaw, vx, vy, yaw rate, steering angle, acceleration.
    state: [f64; 8],
    commands: VecDeque<f64>,
}

fn rate(state: &[f64; 8], steer_cmd: f64, accel_cmd: f64) -> [f64; 8] {
    let [_, _, yaw, vx, vy, r, steer, accel] = *state;
    let (v, [lf, lr]) = (vx.max(0.5), TO_AXLE);
    let angles = [steer - (vy + lf * r).atan2(v), -(vy - lr * r).atan2(v)];
    let loads = [lr, lf].map(|arm| MASS * 9.81 * arm / (lf + lr));
    let force = |i: usize| FRICTION * loads[i] * (STIFFNESS[i] * angles[i] / (FRICTION * loads[i])).tanh();
    let (front, rear) = (force(0), force(1));
    [
        vx * yaw.cos() - vy * yaw.sin(),
        vx * yaw.sin() + vy * yaw.cos(),
        r,
        accel + vy * r - front * steer.sin() / MASS - 0.5 * 1.2 * 0.9 * vx * vx.abs() / MASS,
        (front * steer.cos() + rear) / MASS - vx * r,
        (lf * front * steer.cos() - lr * rear) / YAW_INERTIA,
        ((steer_cmd - steer) / LAG).clamp(-0.5, 0.5),
        (accel_cmd - accel) / 0.2,
    ]
}

impl Suv {
    fn step(&mut self, steer_cmd: f64, accel_cmd: f64, steps: usize) {
        for _ in 0..steps {
            self.commands.push_back(steer_cmd);
            let delayed = self.commands.pop_front().unwrap_or(steer_cmd);
            let moved = |by: f64, slope: [f64; 8]| std::array::from_fn(|i| self.state[i] + by * slope[i]);
            let middle = moved(0.5 * DT, rate(&self.state, delayed, accel_cmd));
            self.state = moved(DT, rate(&middle, delayed, accel_cmd));
        }
    }
}

pub fn run(arguments: &Arguments) -> Result<Value, Box<dyn Error>> {
    let car = suv()?;
    let accels = [2.25, 4.0];
    let rows = ["default", "told"];
    let drives = map(arguments.threads, "foreign", ROADS * accels.len() * rows.len(), |number| {
        let (row, accel) = (rows[number % 2], accels[number / 2 % 2]);
        let seed = FIRST_ROAD + (number / 4) as u64;
        drive(&car, seed, accel, row == "told").unwrap_or_else(|error| json!({ "failed": error.to_string() }))
    });
    Ok(
        json!({ "plant": "suv_plant.py", "road_seeds": { "first": FIRST_ROAD, "count": ROADS }, "drives": drives }),
    )
}

/// The figures of `suv.toml` that the controller uses, set into the default car.
fn suv() -> Result<CarParameters, Box<dyn Error>> {
    let mut car = builtin("c_class")?;
    let axle = |name: &str| -> f64 { if name.contains("front") { TO_AXLE[0] } else { TO_AXLE[1] } };
    for parameter in CarParameters::TABLE {
        match parameter.name {
            "vehicle.mass" => parameter.set(&mut car, MASS),
            "vehicle.yaw_inertia" => parameter.set(&mut car, YAW_INERTIA),
            "vehicle.cg_to_front_axle" | "vehicle.cg_to_rear_axle" => {
                parameter.set(&mut car, axle(parameter.name));
            }
            _ => (),
        }
    }
    Ok(car)
}

fn drive(car: &CarParameters, seed: u64, accel: f64, told: bool) -> Result<Value, Box<dyn Error>> {
    let path: Arc<Path> = Arc::new(RandomRoad { length: 600.0, ..RandomRoad::CAR }.path(seed)?);
    let mut parameters = ControllerParameters::for_car(car);
    parameters.speed.lateral_accel = accel;
    if told {
        (parameters.actuator.time_constant, parameters.actuator.dead_time) = (LAG, DELAY as f64 * DT);
    }
    let mut controller = Controller::new(parameters, path.clone())?;
    let start = path.at(0.0);
    let state = [start.x, start.y, start.yaw, controller.start_speed(), 0.0, 0.0, 0.0, 0.0];
    let mut plant = Suv { state, commands: VecDeque::from(vec![0.0; DELAY]) };
    let steps = ((2.0 * controller.speed_plan().duration() + 30.0) / 0.02) as u32;
    let (mut max, mut after, mut sum, mut count, mut hint) = (0.0_f64, 0.0_f64, 0.0, 0_u32, None);
    let mut finished = false;
    for step in 0..steps {
        let time = 0.02 * f64::from(step);
        let [x, y, yaw, vx, vy, yaw_rate, steer, _] = plant.state;
        let at = path.project(x, y, yaw, hint);
        hint = Some(at.station);
        max = max.max(at.e1.abs());
        (sum, count) = (sum + at.e1.abs(), count + 1);
        if time >= 20.0 {
            after = after.max(at.e1.abs());
        }
        let report = controller
            .step_at(time, &Measurement { x, y, yaw, vx, vy, yaw_rate, steer, ..Measurement::default() })?;
        finished = report.finished;
        if finished || max > 2.0 {
            break;
        }
        let (steer_cmd, accel_cmd) = (report.steer_cmd, report.accel_cmd);
        plant.step(steer_cmd, accel_cmd, 20);
    }
    Ok(json!({
        "row": if told { "told" } else { "default" }, "road": seed, "lateral_accel": accel, "lost": max > 2.0,
        "finished": finished, "max": max, "mean": sum / f64::from(count.max(1)), "max_after_20_s": after,
    }))
}
