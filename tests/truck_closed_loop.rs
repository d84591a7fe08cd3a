//! The closed loop of controller and truck: how well it tracks with little and much delay, what identification and
//! learning gain, that it does so again, and how a jack-knife ends it.

use rfl_mpc::control::{
    ArticulatedModel, PredictionModelFor, Propagation, Residual, RollOut, SpeedController, TRUCK_STATES,
    TruckController, TruckControllerParameters,
};
use rfl_mpc::nominal::Actuator;
use rfl_mpc::path::Path;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::residual::{DataConfig, DataSet, Kind, ResidualModelFor, TrainConfig, train};
use rfl_mpc::simulate::{DriveError, SensorNoise, TruckClosedLoop, TruckDrive};
use rfl_mpc::vehicle::{Articulated, TruckEffects, TruckParameters, builtin_truck};
use std::sync::{Arc, LazyLock};

type Model = PredictionModelFor<Articulated, TRUCK_STATES>;

static TRUCK: LazyLock<TruckParameters> = LazyLock::new(|| builtin_truck("truck_simulation").unwrap());

/// Dead time and lag of the steering, s.
const LOW: [f64; 2] = [0.04, 0.05];
const HIGH: [f64; 2] = [0.3, 0.2];

fn road(route: Route) -> Arc<Path> {
    Arc::new(route.path().unwrap())
}

fn effects([dead_time, lag]: [f64; 2]) -> TruckEffects {
    let mut effects = TruckEffects::default();
    (effects.vehicle.steer_delay, effects.vehicle.steer_lag) = (dead_time, lag);
    effects
}

/// Calm enough for a delay that the model does not know.
fn calm() -> TruckControllerParameters {
    let mut parameters = TruckControllerParameters::of_the_papers(&TRUCK);
    (parameters.mpc.r_rate, parameters.mpc.q_e1_rate, parameters.mpc.q_e2) = (30.0, 1.0, 300.0);
    parameters
}

fn connect(
    route: Route,
    delay: [f64; 2],
    parameters: TruckControllerParameters,
    model: Model,
) -> TruckClosedLoop {
    let controller = TruckController::predicting_with(parameters, road(route), model).unwrap();
    TruckClosedLoop::at_start(controller, &TRUCK, &effects(delay), 0.02).unwrap()
}

fn drive(
    route: Route,
    delay: [f64; 2],
    parameters: TruckControllerParameters,
    model: Model,
    duration: f64,
) -> TruckDrive {
    connect(route, delay, parameters, model).drive(duration, |_| ()).unwrap()
}

fn default() -> TruckControllerParameters {
    TruckControllerParameters::of_the_papers(&TRUCK)
}

#[test]
fn the_nominal_controller_is_a_good_one() {
    let drive = drive(Route::TruckUTurn, LOW, default(), Model::Nominal, 300.0);
    assert!(drive.finished && !drive.lost);
    let tracking = drive.tracking();
    assert!(tracking.mae <= 0.05 && tracking.max <= 0.3, "{tracking:?}");
    // The trailer follows through the U-turn, far from jack-knifing.
    let articulation = drive.column("articulation").iter().fold(0.0_f64, |most, phi| most.max(phi.abs()));
    assert!((0.3..0.8).contains(&articulation), "{articulation} rad");
    assert_eq!(drive.rows[0].len(), drive.columns.len());
    let log = drive.to_learn_from();
    assert_eq!(log.articulation.len(), drive.rows.len());
    assert_eq!(log.articulation_rate.len(), drive.rows.len());
}

#[test]
fn the_speed_follows_its_plan_by_mpc_or_pi() {
    for controller in [SpeedController::Mpc, SpeedController::Pi] {
        let mut parameters = default();
        parameters.speed.controller = controller as usize;
        let mut closed = connect(Route::TruckUTurn, LOW, parameters, Model::Nominal);
        let (mut worst, mut seconds) = (0.0_f64, 0.0);
        while !closed.controller().report().finished && seconds < 100.0 {
            let (row, _) = closed.advance().unwrap();
            seconds = row[0];
            let report = closed.controller().report();
            worst = worst.max((row[6] - report.speed_ref).abs());
            // Only the MPC follows a point.
            assert!(report.lag_error == 0.0 || controller == SpeedController::Mpc);
        }
        assert!(closed.controller().report().finished && worst < 1.0, "{controller:?}: {worst} m/s");
    }
}

#[test]
fn a_known_dead_time_and_lag_is_worth_much() {
    // Each at weights that suit it: calm ones let the nominal survive, tight ones are for who knows the delay.
    let nominal = drive(Route::TruckUTurn, HIGH, calm(), Model::Nominal, 300.0);
    let [dead_time, time_constant] = HIGH;
    let known = Model::Actuator(Actuator { dead_time, time_constant, ..Actuator::default() });
    let known = drive(Route::TruckUTurn, HIGH, default(), known, 300.0);
    assert!(known.finished);
    let (known, nominal) = (known.tracking().mae, nominal.tracking().mae);
    assert!(known < 0.5 * nominal, "mean lateral error {known} m, nominal {nominal} m");
}

#[test]
fn nonlinear_mpc_tracks_as_well_as_the_linear_one() {
    // What both miss, the delay, is the same; `tests/truck_nmpc.rs` shows what the model alone is worth.
    let nmpc = || Model::Nonlinear(ArticulatedModel::default());
    let nominal = drive(Route::TruckTest, LOW, default(), Model::Nominal, 60.0).tracking();
    let nonlinear = drive(Route::TruckTest, LOW, default(), nmpc(), 60.0).tracking();
    assert!(
        nonlinear.mae < 1.2 * nominal.mae && nonlinear.max < 1.3 * nominal.max,
        "{nonlinear:?} {nominal:?}"
    );
    let turned = drive(Route::TruckUTurn, LOW, default(), nmpc(), 300.0);
    assert!(turned.finished && !turned.lost);
    assert!(turned.tracking().max < 0.3, "{:?}", turned.tracking());
}

fn learn(kind: Kind, delay: [f64; 2]) -> Residual<Articulated, TRUCK_STATES> {
    let logs = [1, 2].map(|seed| {
        let mut parameters = calm();
        (parameters.mpc.dither, parameters.mpc.dither_seed) = (0.01, seed);
        let route = [Route::TruckTrain, Route::TruckUTurn][seed - 1];
        drive(route, delay, parameters, Model::Nominal, 120.0).to_learn_from()
    });
    let data = DataSet::new(&logs, &default().vehicle.articulated(), DataConfig::default()).unwrap();
    let config = TrainConfig { window: 60, trees: 8, ..TrainConfig::new(kind) };
    let model = train(&data, None, &config, &|_| ()).unwrap().model;
    // Through the file's bytes, as a user would.
    let model = Arc::new(ResidualModelFor::from_bytes(&model.to_bytes().unwrap()).unwrap());
    Residual { model, propagation: Propagation::Propagated, roll_out: RollOut::Corrected }
}

#[test]
fn a_learned_residual_tracks_better_on_an_unseen_road() {
    let nominal = drive(Route::TruckTest, LOW, default(), Model::Nominal, 60.0).tracking();
    for kind in [Kind::Linear, Kind::Rfl] {
        let model = Model::Residual(learn(kind, LOW));
        let learned = drive(Route::TruckTest, LOW, default(), model, 60.0).tracking();
        assert!(learned.mae < 0.9 * nominal.mae, "{kind:?}: {} m, nominal {} m", learned.mae, nominal.mae);
    }
}

#[test]
fn a_jack_knife_ends_the_drive_with_a_message() {
    // Ice, and brakes that only the tractor has.
    let mut truck = TRUCK.clone();
    (truck.brake.front_share, truck.brake.trailer_share) = (0.0, 0.0);
    let mut slippery = effects([0.0, 0.0]);
    slippery.vehicle.road_friction = 0.15;
    let mut parameters = default();
    (parameters.speed.lateral_accel, parameters.speed.decel) = (4.0, 6.0);
    parameters.speed.decel_cmd_max = 8.0;
    let connected = || {
        let controller = TruckController::new(parameters, road(Route::TruckTest)).unwrap();
        TruckClosedLoop::at_start(controller, &truck, &slippery, 0.02).unwrap()
    };
    let error = connected().drive(300.0, |_| ()).unwrap_err();
    assert!(matches!(error, DriveError::Vehicle { vehicle: "truck", .. }), "{error}");
    assert!(error.to_string().contains("jack-knifed"), "{error}");
    // Or it counts as lost, with what was driven until then.
    let drive = connected().drive_until_lost(300.0, |_, _| true).unwrap();
    assert!(drive.lost && !drive.finished && !drive.rows.is_empty());
}

#[test]
fn the_same_drive_gives_the_same_bits_and_noise_is_felt() {
    let with = |seed| {
        let closed = connect(Route::TruckUTurn, LOW, default(), Model::Nominal);
        let mut closed = closed.with_noise(SensorNoise::TYPICAL_TRUCK, seed);
        let drive = closed.drive(10.0, |_| ()).unwrap();
        drive.rows.iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(with(1), with(1));
    assert_ne!(with(1), with(2));
    // At rest on the straight the truck has no articulation; what is told of it is noise.
    let mut closed =
        connect(Route::TruckUTurn, LOW, default(), Model::Nominal).with_noise(SensorNoise::TYPICAL_TRUCK, 3);
    let drive = closed.drive(4.0, |_| ()).unwrap();
    let angles = drive.column("articulation");
    let deviation = (angles.iter().map(|phi| phi * phi).sum::<f64>() / angles.len() as f64).sqrt();
    assert!((0.001..0.005).contains(&deviation), "{deviation} rad");
}

#[test]
fn a_saved_state_goes_on_to_the_bit() {
    let path = road(Route::TruckUTurn);
    let mut closed = connect(Route::TruckUTurn, LOW, default(), Model::Nominal);
    let mut rows = Vec::new();
    for _ in 0..150 {
        rows.push(closed.advance().unwrap().0);
    }
    // Another controller goes on from the state of the first: with what the first was told it decides the same.
    let mut other = TruckController::predicting_with(default(), path, Model::Nominal).unwrap();
    assert!(other.restore(closed.controller().state().clone()).is_none());
    for _ in 0..50 {
        let told = rfl_mpc::simulate::SimulatedVehicle::measured(closed.vehicle());
        closed.advance().unwrap();
        let mut mine = *other.step(&told).unwrap();
        mine.compute_time = closed.controller().report().compute_time;
        assert_eq!(mine, *closed.controller().report());
    }
    // One that tracks its speed in another way refuses it.
    let mut parameters = default();
    parameters.speed.controller = SpeedController::Pi as usize;
    let mut pi = TruckController::new(parameters, road(Route::TruckUTurn)).unwrap();
    assert!(pi.restore(closed.controller().state().clone()).is_some());
}
