//! Nonlinear MPC of a truck: on the vehicle that it predicts with it beats the linear MPC by far, within a few QPs a
//! step; parameters that are none are refused.

use rfl_mpc::control::{
    ArticulatedModel, ControllerError, LateralError, Measurement, PredictionModelFor, TRUCK_STATES,
    TruckController, TruckControllerParameters,
};
use rfl_mpc::nominal::{ArticulatedPathState, ArticulatedSingleTrack, HeldSpeed, PathModel};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::simulate::TrackingMetrics;
use rfl_mpc::vehicle::{Articulated, builtin_truck};
use std::sync::Arc;

type Model = PredictionModelFor<Articulated, TRUCK_STATES>;

fn parameters() -> TruckControllerParameters {
    TruckControllerParameters::for_truck(&builtin_truck("truck_simulation").unwrap())
}

fn controller(model: Model) -> Result<TruckController, ControllerError> {
    TruckController::predicting_with(parameters(), Arc::new(Route::TruckUTurn.path().unwrap()), model)
}

/// Drives a truck that is the nonlinear model itself through the U-turn. Gives the lateral error and the mean number of QPs
/// a step.
fn drive(model: Model) -> (TrackingMetrics, f64) {
    let mut controller = controller(model).unwrap();
    let truck = builtin_truck("truck_simulation").unwrap().articulated();
    let plant = ArticulatedSingleTrack::new(&truck, 1.0).unwrap();
    let path = controller.path().clone();
    let (mut state, mut vx) = (ArticulatedPathState::zeros(), 2.0);
    let (mut errors, mut qps, mut steer) = (Vec::new(), 0.0, 0.0);
    for _ in 0..10_000 {
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
        qps += f64::from(controller.lateral().qps());
        if report.finished {
            qps /= errors.len() as f64;
            return (TrackingMetrics::of(errors), qps);
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

#[test]
fn on_the_vehicle_that_it_predicts_with_it_beats_the_linear_mpc_by_far() {
    let (linear, one) = drive(Model::Nominal);
    let (nonlinear, few) = drive(Model::Bicycle(ArticulatedModel::default()));
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
        let error = controller(Model::Bicycle(model)).err().expect("no such friction");
        assert!(matches!(&error, ControllerError::Lateral(LateralError::Model(_))), "{error}");
        assert!(error.to_string().contains("friction"), "{error}");
    }
}
