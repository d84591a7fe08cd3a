//! One controller serves many vehicles, each with a state of its own, and steers each as a controller of its own would.

use crate::counting::allocated;
use rfl_mpc::control::{
    BicycleModel, ControlledParameters, Controller, ControllerFor, ControllerParameters, ControllerState,
    Measurement, PredictionModelFor, SpeedController, StepError, StepReport, TruckController,
    TruckControllerParameters,
};
use rfl_mpc::path::Path;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::vehicle::{builtin, builtin_truck};
use std::sync::Arc;

const STEPS: usize = 300;
const VEHICLES: usize = 3;

/// What a vehicle measures that weaves about the path at a speed of its own.
fn measured(path: &Path, vehicle: usize, step: usize) -> Measurement {
    let own = 1.0 + 0.2 * vehicle as f64;
    let time = 0.02 * step as f64;
    let at = path.at(5.0 + 20.0 * vehicle as f64 + 6.0 * own * time);
    let beside = 0.3 * own * (0.7 * time + own).sin();
    let (sin, cos) = at.yaw.sin_cos();
    Measurement {
        x: at.x - beside * sin,
        y: at.y + beside * cos,
        yaw: at.yaw + 0.02 * (1.3 * time).cos(),
        vx: 6.0 * own,
        vy: 0.05 * (2.0 * time).sin(),
        yaw_rate: 6.0 * own * at.curvature,
        articulation: 0.05 * (0.5 * time).sin(),
        ..Measurement::default()
    }
}

/// Everything of a report that is reproducible.
fn bits(report: &StepReport) -> StepReport {
    StepReport { compute_time: 0.0, ..*report }
}

/// Holds one controller with many states to as many controllers.
fn serves_like_many<G: ControlledParameters<S>, const S: usize>(
    path: &Path,
    controller: impl Fn() -> ControllerFor<G, S>,
) {
    let mut one = controller();
    let mut states: Vec<ControllerState<S>> = (0..VEHICLES).map(|_| one.state().clone()).collect();
    let mut many: Vec<_> = (0..VEHICLES).map(|_| controller()).collect();
    for step in 0..STEPS {
        for (vehicle, (state, own)) in states.iter_mut().zip(&mut many).enumerate() {
            let seen = measured(path, vehicle, step);
            let expected = bits(own.step(&seen).unwrap());
            let mut report = StepReport::default();
            let count = allocated(|| report = one.step_for(state, &seen).unwrap());
            assert_eq!(bits(&report), expected, "vehicle {vehicle}, step {step}");
            assert!(step == 0 || count == (0, 0), "vehicle {vehicle}, step {step}: {count:?}");
        }
    }
}

fn turns() -> Arc<Path> {
    Arc::new(Route::TruckUTurn.path().unwrap())
}

#[test]
fn cars_with_each_of_what_a_state_holds() {
    let path = turns();
    for model in [PredictionModelFor::Nominal, PredictionModelFor::Nonlinear(BicycleModel::default())] {
        serves_like_many(&path, || {
            let mut parameters = ControllerParameters::for_car(&builtin("c_class").unwrap());
            parameters.observer.disturbance_noise = 0.1;
            parameters.mpc.dither = 0.01;
            Controller::predicting_with(parameters, path.clone(), model.clone()).unwrap()
        });
    }
}

#[test]
fn trucks_whose_speed_is_tracked_by_mpc() {
    let path = turns();
    serves_like_many(&path, || {
        let parameters = TruckControllerParameters::for_truck(&builtin_truck("truck_simulation").unwrap());
        assert!(matches!(parameters.speed.tracked_by(), SpeedController::Mpc));
        TruckController::new(parameters, path.clone()).unwrap()
    });
}

#[test]
fn a_state_that_is_not_its_own_and_a_bad_measurement_change_nothing() {
    let path = turns();
    let with = |horizon: usize| {
        let mut parameters = ControllerParameters::default();
        parameters.mpc.horizon = horizon;
        Controller::new(parameters, path.clone()).unwrap()
    };
    let (mut controller, other) = (with(16), with(20));
    let seen = measured(&path, 0, 0);
    let mut foreign = other.state().clone();
    assert_eq!(controller.step_for(&mut foreign, &seen), Err(StepError::ForeignState));
    assert_eq!(&foreign, other.state());

    let mut state = controller.state().clone();
    let before = state.clone();
    let bad = Measurement { vx: f64::NAN, ..seen };
    assert!(matches!(controller.step_for(&mut state, &bad), Err(StepError::NotFinite { signal: "vx", .. })));
    assert_eq!(state, before);
    assert_eq!(controller.state(), with(16).state(), "its own state is where it was");
}
