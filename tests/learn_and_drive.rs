//! From drives to a controller that tracks better: collect, learn, save, load, drive on another road.

use rfl_mpc::control::{Controller, ControllerParameters, Propagation, Residual, RollOut};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::{DataConfig, DataSet, Drive as Log, Kind, ResidualModel, TrainConfig, train};
use rfl_mpc::simulate::{CarDrive, ClosedLoop};
use rfl_mpc::vehicle::{Effects, builtin};
use std::sync::Arc;

/// A steering actuator slower than the controller thinks.
fn slow() -> Effects {
    Effects { steer_lag: 0.1, steer_delay: 0.06, ..Effects::default() }
}

fn drive(route: Route, parameters: ControllerParameters, residual: Option<Residual>) -> CarDrive {
    let path = Arc::new(Path::from_samples(route.samples(), Closure::Detect).unwrap());
    let controller = Controller::predicting_with(parameters, path.clone(), residual.into()).unwrap();
    let car = builtin("c_class").unwrap();
    ClosedLoop::at_start(controller, &car, &slow(), 0.02).unwrap().drive(400.0, |_| ()).unwrap()
}

fn parameters() -> ControllerParameters {
    ControllerParameters::for_car(&builtin("c_class").unwrap())
}

fn as_log(drive: &CarDrive) -> Log {
    Log {
        name: "collected".to_string(),
        time: drive.column("time"),
        steer_cmd: drive.column("steer_cmd"),
        e1: drive.column("e1"),
        e1_rate: drive.column("e1_rate"),
        e2: drive.column("e2"),
        e2_rate: drive.column("e2_rate"),
        vx: drive.column("vx"),
        curvature: drive.column("curvature"),
        curvature_rate: drive.column("curvature_rate"),
        ..Log::default()
    }
}

fn learn(kind: Kind) -> Arc<ResidualModel> {
    let mut collecting = parameters();
    collecting.mpc.r_rate = 0.3;
    collecting.mpc.q_e1_rate = 1.0;
    collecting.mpc.q_e2 = 2.0;
    collecting.mpc.dither = 0.005;
    let log = as_log(&drive(Route::SudokuTrain, collecting, None));
    let vehicle = collecting.vehicle.single_track();
    let data = DataSet::new(&[log], &vehicle, DataConfig::default()).unwrap();
    let config = TrainConfig { window: 28, ..TrainConfig::new(kind) };
    let trained = train(&data, None, &config, &|_| ()).unwrap();
    // Through the file's bytes, as a user would.
    Arc::new(ResidualModel::from_bytes(&trained.model.to_bytes().unwrap()).unwrap())
}

fn with(model: &Arc<ResidualModel>) -> Option<Residual> {
    let model = model.clone();
    Some(Residual { model, propagation: Propagation::Propagated, roll_out: RollOut::Corrected })
}

#[test]
fn a_learned_residual_tracks_better_on_an_unseen_road() {
    let nominal = drive(Route::SudokuTurns, parameters(), None).tracking();
    for kind in [Kind::Rfl, Kind::RflS] {
        let model = learn(kind);
        let learned = drive(Route::SudokuTurns, parameters(), with(&model));
        assert!(learned.finished, "{kind:?}");
        let learned = learned.tracking();
        let gain = 1.0 - learned.mae / nominal.mae;
        assert!(gain > 0.3, "{kind:?}: mean {} m, nominal {} m", learned.mae, nominal.mae);
        assert!(learned.max < nominal.max, "{kind:?}: max {} m, nominal {} m", learned.max, nominal.max);
    }
}

#[test]
fn a_residual_of_another_car_is_refused_with_the_reason() {
    let model = learn(Kind::Linear);
    let path = Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let other = ControllerParameters::for_car(&builtin("bmw_320i").unwrap());
    let error = Controller::predicting_with(other, path, with(&model).into()).err().unwrap().to_string();
    assert!(error.contains("mass"), "{error}");
}
