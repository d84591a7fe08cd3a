//! A control step allocates nothing; with Clarabel, nothing beyond the solver's own allocation.

use crate::counting::allocated;
use rfl_mpc::control::{
    ArticulatedModel, ControlledParameters, Controller, ControllerFor, ControllerParameters, Measurement,
    PredictionModelFor, Propagation, Residual, RollOut, TRUCK_STATES, TruckController,
    TruckControllerParameters,
};
use rfl_mpc::nominal::{Actuator, DeadTimeModel};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::residual::gp::{self, GpConfig, StateSmoothing};
use rfl_mpc::residual::{DataSet, Kind, TrainConfig, train};
use rfl_mpc::simulate::TruckClosedLoop;
use rfl_mpc::vehicle::{Articulated, TruckEffects, builtin_truck};
use std::sync::Arc;

const RADIUS: f64 = 40.0;

fn circle() -> Arc<Path> {
    let circle = (0..120).map(|k| {
        let angle = f64::from(k) * std::f64::consts::TAU / 120.0;
        Sample::at(RADIUS * angle.cos(), RADIUS * angle.sin())
    });
    Arc::new(Path::from_samples(circle.collect(), Closure::Closed).unwrap())
}

/// Largest number of allocations of a step among all steps after the first.
fn most_allocations_of<G: ControlledParameters<S>, const S: usize>(
    mut controller: ControllerFor<G, S>,
) -> usize {
    (0..200)
        .map(|k| {
            let angle = f64::from(k) * 0.005;
            let measurement = Measurement {
                x: (RADIUS + 0.2) * angle.cos(),
                y: (RADIUS + 0.2) * angle.sin(),
                yaw: angle + std::f64::consts::FRAC_PI_2,
                vx: 8.0,
                yaw_rate: 0.2,
                articulation: 0.1,
                ..Measurement::default()
            };
            allocated(|| assert!(controller.step(&measurement).is_ok())).0
        })
        .skip(1)
        .max()
        .unwrap()
}

fn most_allocations(solver: usize, deadline: f64) -> usize {
    let mut parameters = ControllerParameters::default();
    parameters.mpc.solver = solver;
    parameters.mpc.deadline = deadline;
    most_allocations_of(Controller::new(parameters, circle()).unwrap())
}

/// Deadlines: none, one that is kept, one that is missed.
const DEADLINES: [f64; 3] = [0.0, 1.0, 1e-9];

#[test]
fn a_control_step_allocates_nothing() {
    assert_eq!(DEADLINES.map(|deadline| most_allocations(0, deadline)), [0; 3]);
}

#[test]
fn with_clarabel_a_control_step_allocates_at_most_once() {
    let most = DEADLINES.map(|deadline| most_allocations(1, deadline));
    assert!(most.iter().all(|&count| count <= 1), "{most:?}");
}

/// Half a minute of driving.
fn collected() -> DataSet<Articulated, TRUCK_STATES> {
    let truck = builtin_truck("truck_simulation").unwrap();
    let mut parameters = TruckControllerParameters::for_truck(&truck);
    parameters.mpc.dither = 0.01;
    let path = Arc::new(Route::TruckUTurn.path().unwrap());
    let controller = TruckController::new(parameters, path).unwrap();
    let mut closed = TruckClosedLoop::at_start(controller, &truck, &TruckEffects::default(), 0.02).unwrap();
    let log = closed.drive(30.0, |_| ()).unwrap().to_learn_from();
    DataSet::new(&[log], &parameters.vehicle.articulated(), parameters.data_config()).unwrap()
}

fn residual(data: &DataSet<Articulated, TRUCK_STATES>) -> Residual<Articulated, TRUCK_STATES> {
    let config = TrainConfig { window: 20, trees: 3, ..TrainConfig::new(Kind::Rfl) };
    let model = Arc::new(train(data, None, &config, &|_| ()).unwrap().model);
    Residual { model, propagation: Propagation::Propagated, roll_out: RollOut::Corrected }
}

/// A nonlinear model with a process of what it misses.
fn corrected(data: &DataSet<Articulated, TRUCK_STATES>) -> ArticulatedModel {
    let config = GpConfig {
        smoothing: StateSmoothing::Fixed(0),
        points: 30,
        hyperparameter_samples: 100,
        iterations: 5,
        ..GpConfig::default()
    };
    let process = gp::train(data, None, &config, &|_| ()).unwrap().model;
    ArticulatedModel { gp: Some(Arc::new(process)), ..ArticulatedModel::default() }
}

#[test]
fn a_truck_s_control_step_allocates_nothing_whatever_it_predicts_with() {
    let truck = builtin_truck("truck_simulation").unwrap();
    let actuator = |dead_time_model| {
        PredictionModelFor::Actuator(Actuator { dead_time: 0.3, time_constant: 0.2, dead_time_model })
    };
    let data = collected();
    let models = [
        PredictionModelFor::Nominal,
        actuator(DeadTimeModel::Exact),
        actuator(DeadTimeModel::Pade22),
        PredictionModelFor::Residual(residual(&data)),
        PredictionModelFor::Nonlinear(ArticulatedModel::default()),
        PredictionModelFor::Nonlinear(corrected(&data)),
    ];
    for model in models {
        let name = format!("{model:?}");
        // With the observer and references of the steady state, so that all of a step is made.
        let mut parameters = TruckControllerParameters::for_truck(&truck);
        (parameters.observer.disturbance_noise, parameters.mpc.q_e2) = (0.01, 1.0);
        let controller = TruckController::predicting_with(parameters, circle(), model).unwrap();
        assert_eq!(most_allocations_of(controller), 0, "{}", &name[..name.len().min(200)]);
    }
}
