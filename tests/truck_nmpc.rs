//! Nonlinear MPC of a truck: on the vehicle that it predicts with it beats the linear MPC by far, within a few QPs a
//! step; parameters that are none are refused.

use crate::nmpc::drive_articulated;
use rfl_mpc::control::{
    ArticulatedModel, ControllerError, LateralError, PredictionModelFor, TRUCK_STATES, TruckController,
    TruckControllerParameters,
};
use rfl_mpc::nominal::{
    ArticulatedPathState, ArticulatedSingleTrack, ArticulatedState, HeldSpeed, LateralVehicle, PathModel,
};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::simulate::{DriveFor, TRUCK_COLUMNS, TrackingMetrics, TruckClosedLoop};
use rfl_mpc::vehicle::{Articulated, TruckEffects, builtin_truck};
use std::sync::Arc;

type Model = PredictionModelFor<Articulated, TRUCK_STATES>;

fn parameters() -> TruckControllerParameters {
    TruckControllerParameters::of_the_papers(&builtin_truck("truck_simulation").unwrap())
}

fn controller(model: Model) -> Result<TruckController, ControllerError> {
    TruckController::predicting_with(parameters(), Arc::new(Route::TruckUTurn.path().unwrap()), model)
}

/// Drives a truck that is the nonlinear model itself through the U-turn. Gives the lateral error and the mean number of QPs
/// a step.
fn drive(model: Model) -> (TrackingMetrics, f64) {
    let truck = builtin_truck("truck_simulation").unwrap().articulated();
    let plant = ArticulatedSingleTrack::new(&truck, 1.0).unwrap();
    let mut qps = 0.0;
    let errors = drive_articulated(controller(model).unwrap(), &plant, |_, controller, _| {
        qps += f64::from(controller.lateral().qps());
    });
    (errors, qps / errors.count as f64)
}

#[test]
fn on_the_vehicle_that_it_predicts_with_it_beats_the_linear_mpc_by_far() {
    let (linear, one) = drive(Model::Nominal);
    let (nonlinear, few) = drive(Model::Nonlinear(ArticulatedModel::default()));
    // Where the road begins to bend both give way by as much: what that costs is the same for both.
    assert!(
        nonlinear.mae < 0.6 * linear.mae && nonlinear.rmse < 0.8 * linear.rmse,
        "{nonlinear:?} {linear:?}"
    );
    assert!(one == 1.0 && (1.0..6.0).contains(&few), "{one} {few}");
}

#[test]
fn what_cannot_be_is_refused() {
    for friction in [0.0, f64::NAN] {
        let model = ArticulatedModel { friction, ..ArticulatedModel::default() };
        let error = controller(Model::Nonlinear(model)).err().expect("no such friction");
        assert!(matches!(&error, ControllerError::Lateral(LateralError::Model(_))), "{error}");
        assert!(error.to_string().contains("friction"), "{error}");
    }
}

/// Root mean square error of the lateral error after so many steps, m, predicted along the off-road path from what was measured
/// on the plant with the low delay: by the linear and by the nonlinear model, with these steering angles.
fn prediction_errors(log: &DriveFor<TRUCK_COLUMNS>, steer: &[f64], steps: usize) -> [f64; 2] {
    let path = Route::TruckOffRoad.path().unwrap();
    let truck = builtin_truck("truck_simulation").unwrap().articulated();
    let nonlinear = ArticulatedSingleTrack::new(&truck, 1.0).unwrap();
    let road = |station: f64| [path.curvature(station), path.curvature_rate(station)];
    let columns = ["e1", "e1_rate", "e2", "e2_rate", "articulation", "articulation_rate", "vy", "yaw_rate"];
    let columns = columns.map(|name| log.column(name));
    let (speed, station) = (log.column("vx"), log.column("station"));
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for k in (0..speed.len() - steps - 1).step_by(10) {
        let [e1, e1_rate, e2, e2_rate, phi, phi_rate, vy, yaw_rate] = columns.each_ref().map(|of| of[k]);
        // As the linear MPC predicts: at the speed of the beginning.
        let model = truck.model_at(speed[k].max(1.5)).unwrap().discretise(0.02);
        let mut x = ArticulatedState::from([e1, e1_rate, e2, e2_rate, phi, phi_rate]);
        let mut state = ArticulatedPathState::from([station[k], e1, e2, vy, yaw_rate, phi, phi_rate]);
        for j in k..k + steps {
            let mean = 0.5 * (speed[j] + speed[j + 1]);
            let [curvature, rate] = road(0.5 * (station[j] + station[j + 1]));
            let accel = (speed[j + 1] - speed[j]) / 0.02;
            x = model.step(&x, steer[j], mean * curvature, mean * mean * rate + accel * curvature);
            let held = HeldSpeed { path: mean, body: mean.max(1.5) };
            state = nonlinear.step_along(road, &state, held, steer[j], 0.02).state;
        }
        let truth = columns[0][k + steps];
        squares[0] += (x[0] - truth).powi(2);
        squares[1] += (state[1] - truth).powi(2);
        count += 1.0;
    }
    squares.map(|square: f64| (square / count).sqrt())
}

/// Why nonlinear MPC is no better than the linear one on the off-road path: the numbers of docs/fmus.md.
#[test]
fn off_road_the_actuator_is_missed_and_not_the_nonlinearity() {
    let file = builtin_truck("truck_simulation").unwrap();
    let path = Arc::new(Route::TruckOffRoad.path().unwrap());
    let controller = TruckController::new(parameters(), path).unwrap();
    let mut effects = TruckEffects::default();
    (effects.vehicle.steer_delay, effects.vehicle.steer_lag) = (0.04, 0.05);
    let mut closed = TruckClosedLoop::at_start(controller, &file, &effects, 0.02).unwrap();
    let log = closed.drive(60.0, |_| ()).unwrap();
    let angle = log.column("steer");
    let angle: Vec<f64> = angle.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let command = log.column("steer_cmd");
    let errors = [16, 60].map(|steps| [&command, &angle].map(|of| prediction_errors(&log, of, steps)));
    println!("16 and 60 steps, by commands and by steering angles, linear and nonlinear: {errors:?} m");
    for [[linear, nonlinear], [known, _]] in errors {
        // What the nonlinear model knows better is little beside what both do not know of the actuator.
        assert!((linear - nonlinear).abs() < 0.03 * linear, "{errors:?}");
        assert!(linear - known > 5.0 * (linear - nonlinear).abs(), "{errors:?}");
    }
}
