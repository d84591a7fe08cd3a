//! A nonlinear MPC on the right and left turn of the Sudoku course, and a truck that is the nonlinear model itself.

#![allow(dead_code)]

use rfl_mpc::control::{
    BicycleModel, Controller, ControllerParameters, Measurement, PredictionModel, TruckController,
};
use rfl_mpc::nominal::{ArticulatedPathState, ArticulatedSingleTrack, Bicycle, HeldSpeed, PathModel};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::simulate::{ClosedLoop, TrackingMetrics};
use rfl_mpc::vehicle::{Effects, builtin};
use std::sync::Arc;

/// The default car's controller with changed parameters.
pub fn controller(change: impl Fn(&mut ControllerParameters)) -> Controller {
    with_model(change, PredictionModel::Nonlinear(BicycleModel::default()))
}

/// The same with another prediction.
pub fn with_model(change: impl Fn(&mut ControllerParameters), model: PredictionModel) -> Controller {
    let path = Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let mut parameters = ControllerParameters::of_the_papers(&builtin("c_class").unwrap());
    change(&mut parameters);
    Controller::predicting_with(parameters, path, model).unwrap()
}

/// A car beside the path, in a bend.
pub fn measure(controller: &Controller, e1: f64) -> Measurement {
    let path = controller.path();
    let station = (0..1000)
        .map(|k| path.length() * f64::from(k) / 1000.0)
        .max_by(|a, b| path.curvature(*a).abs().total_cmp(&path.curvature(*b).abs()))
        .unwrap();
    let at = path.at(station);
    let (sin, cos) = at.yaw.sin_cos();
    Measurement {
        x: at.x - e1 * sin,
        y: at.y + e1 * cos,
        yaw: at.yaw,
        vx: controller.speed_plan().speed(station),
        ..Measurement::default()
    }
}

/// Drives the default car to the end; `watch` sees the controller after each step. Gives the lateral tracking error.
pub fn drive(
    controller: Controller,
    effects: &Effects,
    mut watch: impl FnMut(usize, &Controller),
) -> TrackingMetrics {
    let car = builtin("c_class").unwrap();
    let sample_time = controller.parameters().mpc.sample_time;
    let mut closed = ClosedLoop::at_start(controller, &car, effects, sample_time).unwrap();
    let mut errors = Vec::new();
    for k in 0..30_000 {
        closed.advance().unwrap();
        errors.push(closed.controller().report().e1);
        watch(k, closed.controller());
        if closed.controller().report().finished {
            return TrackingMetrics::of(errors);
        }
    }
    panic!("the end of the road is not reached");
}

/// Drives a plant that is a bicycle to the end of the road, integrated at 1 ms. `watch` sees the controller after each
/// step. Gives the lateral tracking error.
pub fn drive_bicycle(
    mut controller: Controller,
    plant: &Bicycle,
    mut watch: impl FnMut(f64, &Controller),
) -> TrackingMetrics {
    let start = controller.path().at(0.0);
    let mut car = Measurement { x: start.x, y: start.y, yaw: start.yaw, vx: 2.0, ..Measurement::default() };
    let mut errors = Vec::new();
    for k in 0..30_000 {
        let report = *controller.step(&car).unwrap();
        errors.push(report.e1);
        watch(0.02 * f64::from(k), &controller);
        if report.finished {
            return TrackingMetrics::of(errors);
        }
        let dt = 1e-3;
        for _ in 0..20 {
            let [vy, yaw_rate] = plant.step(car.vy, car.yaw_rate, car.vx, report.steer_cmd, dt).value;
            let (sin, cos) = (car.yaw + 0.5 * dt * yaw_rate).sin_cos();
            let across = 0.5 * (car.vy + vy);
            car.x += dt * (car.vx * cos - across * sin);
            car.y += dt * (car.vx * sin + across * cos);
            car.yaw += dt * 0.5 * (car.yaw_rate + yaw_rate);
            car.vx = (car.vx + dt * report.accel_cmd).max(0.5);
            (car.vy, car.yaw_rate, car.steer) = (vy, yaw_rate, report.steer_cmd);
        }
    }
    panic!("the end of the road is not reached");
}

/// Drives a truck that is the nonlinear model itself to the end of the road. `watch` sees the controller, and what it was told,
/// after each step. Gives the lateral tracking error.
pub fn drive_articulated(
    mut controller: TruckController,
    plant: &ArticulatedSingleTrack,
    mut watch: impl FnMut(f64, &TruckController, &Measurement),
) -> TrackingMetrics {
    let path = controller.path().clone();
    let (mut state, mut vx) = (ArticulatedPathState::zeros(), 2.0);
    let (mut errors, mut steer) = (Vec::new(), 0.0);
    for k in 0..10_000 {
        let [station, e1, e2, vy, yaw_rate, articulation, articulation_rate] = state.into();
        let at = path.at(station);
        let (sin, cos) = at.yaw.sin_cos();
        let measurement = Measurement {
            x: at.x - e1 * sin,
            y: at.y + e1 * cos,
            yaw: at.yaw + e2,
            vx,
            vy,
            yaw_rate,
            steer,
            articulation,
            articulation_rate,
        };
        let report = *controller.step(&measurement).unwrap();
        errors.push(report.e1);
        watch(0.02 * f64::from(k), &controller, &measurement);
        if report.finished {
            return TrackingMetrics::of(errors);
        }
        steer = report.steer_cmd;
        let next = (vx + 0.02 * report.accel_cmd).max(0.5);
        let held = HeldSpeed { path: 0.5 * (vx + next), body: 0.5 * (vx + next) };
        let road = |station: f64| [path.curvature(station), path.curvature_rate(station)];
        state = plant.step_along(road, &state, held, steer, 0.02).state;
        vx = next;
    }
    panic!("the end of the road is not reached");
}
