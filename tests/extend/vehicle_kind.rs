//! Learning and control know no number of states: a linear toy vehicle with a swinging trailer goes the whole way from
//! drives to a forest, a file, a condensed horizon and a drive with the controller.

use crate::counting::allocated;
use nalgebra::{Matrix6, SVector, Vector6};
use rfl_mpc::control::{
    Bound, Choice, ChoiceError, ControlVariant, ControlledParameters, ControlledVehicle, ControllerFor,
    ControllerParametersFor, FurtherState, GuardParameters, Measurement, MpcParameters, ObserverParameters,
    PredictionModelFor, Propagation, Residual, RollOut,
};
use rfl_mpc::nominal::{
    Actuator, ContinuousErrorModel, DiscreteErrorModel, ErrorState, LateralVehicle, SingleTrackError,
};
use rfl_mpc::numerics::Random;
use rfl_mpc::parameter::OutOfRange;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::residual::{
    DataConfig, DataError, DataSet, Drive, FileError, Kind, ModelMismatch, ResidualModel, ResidualModelFor,
    TrainConfig, TreeFeatures, train,
};
use rfl_mpc::signal::{self, Signal};
use rfl_mpc::vehicle::SingleTrack;
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::sync::Arc;

/// A car with a pendulum behind it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Swinging {
    stiffness: f64,
    damping: f64,
    /// How the pendulum pulls at the car.
    pull: f64,
}

const CAR: SingleTrack =
    SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };
const NOMINAL: Swinging = Swinging { stiffness: 6.0, damping: 2.0, pull: 0.8 };
/// The vehicle is another than the model, and its steering is late.
const TRUTH: Swinging = Swinging { stiffness: 5.0, damping: 1.5, pull: 1.0 };
const DEAD_SAMPLES: usize = 5;
const TS: f64 = 0.02;
const SPEED: f64 = 8.0;
const HORIZON: usize = 60;
const WINDOW: usize = 24;

impl LateralVehicle<6> for Swinging {
    const KIND: &'static str = "toy";
    const STATES: [Signal; 6] = [
        signal::E1,
        signal::E1_RATE,
        signal::E2,
        signal::E2_RATE,
        signal::ARTICULATION,
        signal::ARTICULATION_RATE,
    ];

    fn model_at(&self, speed: f64) -> Result<ContinuousErrorModel<6>, SingleTrackError> {
        let car = CAR.model_at(speed)?;
        let mut a = Matrix6::zeros();
        a.fixed_view_mut::<4, 4>(0, 0).copy_from(&car.a);
        (a[(1, 4)], a[(3, 5)]) = (-self.pull, -0.1 * self.pull);
        (a[(4, 5)], a[(5, 3)], a[(5, 4)], a[(5, 5)]) = (1.0, 0.5, -self.stiffness, -self.damping);
        let extended = |x: &ErrorState, last: f64| Vector6::new(x[0], x[1], x[2], x[3], 0.0, last);
        Ok(ContinuousErrorModel {
            a,
            b: extended(&car.b, 3.0),
            d: extended(&car.d, 1.0),
            e: extended(&car.e, 0.0),
        })
    }

    fn steady_state(&self, speed: f64) -> Vector6<f64> {
        let car = CAR.steady_state(speed);
        Vector6::new(car[0], car[1], car[2], car[3], 0.0, 0.0)
    }

    fn steady_steer(&self, speed: f64) -> f64 {
        CAR.steady_steer(speed)
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        vec![("stiffness", self.stiffness), ("damping", self.damping), ("pull", self.pull)]
    }
}

impl ControlledVehicle<6> for Swinging {
    type Nonlinear = Infallible;

    fn state(errors: &ErrorState, measurement: &Measurement) -> Vector6<f64> {
        let Measurement { articulation, articulation_rate, .. } = *measurement;
        Vector6::new(errors[0], errors[1], errors[2], errors[3], articulation, articulation_rate)
    }
}

/// The vehicle and how much its articulation may be.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Toy {
    articulation_max: f64,
}

impl ControlledParameters<6> for Toy {
    type Vehicle = Swinging;

    fn nominal(&self) -> Swinging {
        NOMINAL
    }

    fn further_states(&self) -> Vec<FurtherState> {
        let state = FurtherState {
            weight: 0.0,
            bound: Some(Bound { max: self.articulation_max, quadratic: 1e3, linear: 100.0 }),
            largest_reference: 0.5,
            noise: 1e-3,
            process_noise_gain: 0.0,
            largest_disturbance: 0.02,
        };
        vec![state, FurtherState { bound: None, ..state }]
    }

    fn set_by_name(&mut self, name: &str, value: f64) -> Result<bool, OutOfRange> {
        let mine = name == "articulation_max";
        if mine {
            self.articulation_max = value;
        }
        Ok(mine)
    }

    fn check_all(&self) -> Result<(), OutOfRange> {
        Ok(())
    }
}

type Model = PredictionModelFor<Swinging, 6>;
type Learned = ResidualModelFor<Swinging, 6>;

fn truth(speed: f64) -> DiscreteErrorModel<6> {
    TRUTH.model_at(speed).unwrap().discretise(TS)
}

fn draw(random: &mut Random) -> f64 {
    2.0 * random.uniform() - 1.0
}

/// A drive of the true vehicle: feedback and dither.
fn drive(seed: u64) -> Drive {
    let mut random = Random::new(seed);
    let mut log = Drive { name: format!("drive {seed}"), ..Drive::default() };
    let mut x = Vector6::zeros();
    let (mut issued, mut dither) = (vec![0.0; DEAD_SAMPLES], 0.0);
    let (bend, speed) = (0.01 * draw(&mut random), SPEED + draw(&mut random));
    let truth = truth(speed);
    for k in 0..600 {
        let station = speed * TS * f64::from(k);
        let (curvature, curvature_rate) =
            (bend + 2e-3 * (0.05 * station).sin(), 1e-4 * (0.05 * station).cos());
        dither = 0.9 * dither + 0.01 * draw(&mut random);
        let command = CAR.lf * curvature - 0.03 * x[0] - 0.02 * x[1] - 0.2 * x[2] + dither;
        for (column, value) in log.columns_mut().into_iter().zip([
            f64::from(k) * TS,
            command,
            x[0],
            x[1],
            x[2],
            x[3],
            speed,
            curvature,
            curvature_rate,
        ]) {
            column.push(value);
        }
        log.articulation.push(x[4]);
        log.articulation_rate.push(x[5]);
        issued.push(command);
        x = truth.step(&x, issued.remove(0), speed * curvature, speed * speed * curvature_rate);
    }
    log
}

fn data(seeds: std::ops::Range<u64>) -> DataSet<Swinging, 6> {
    DataSet::new(&seeds.map(drive).collect::<Vec<_>>(), &NOMINAL, DataConfig::default()).unwrap()
}

fn learn(kind: Kind) -> Learned {
    // Trees that look at everything, and leaves with states and road: whatever has a place that depends on `S`.
    let mut config =
        TrainConfig { window: WINDOW, trees: 6, depth: 3, prefilter: 0.0, ..TrainConfig::new(kind) };
    config.regressors.states = 1;
    if kind == Kind::Rfl {
        config.tree_features = TreeFeatures::ErrorsAndRoad;
        config.regressors.road = true;
    }
    let trained = train(&data(1..21), Some(&data(100..104)), &config, &|_| ()).unwrap();
    let fit = trained.report.test.unwrap();
    for state in [1, 3, 5] {
        // Dead time, and what differs of the state's own dynamics, are linear in commands and newest state, nearly so at
        // different speeds.
        assert!(fit.nominal_rmse[state] > 1e-4, "{fit:?}");
        assert!(fit.rmse[state] < 0.2 * fit.nominal_rmse[state], "{kind:?} {fit:?}");
    }
    trained.model
}

fn residual(model: Learned) -> Residual<Swinging, 6> {
    Residual { model: Arc::new(model), propagation: Propagation::Propagated, roll_out: RollOut::Nominal }
}

fn straight() -> Arc<Path> {
    let samples = (0..200).map(|k| Sample::at(2.0 * f64::from(k), 0.0)).collect();
    Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
}

fn controller(model: Model, articulation_max: f64) -> ControllerFor<Toy, 6> {
    let mut parameters = ControllerParametersFor {
        vehicle: Toy { articulation_max },
        mpc: MpcParameters::default().of_the_papers(),
        observer: ObserverParameters { disturbance_noise: 0.0, ..Default::default() },
        speed: Default::default(),
        longitudinal: Default::default(),
        actuator: Default::default(),
        nmpc: Default::default(),
        guard: GuardParameters { active: 0, ..Default::default() },
        axles: Default::default(),
    };
    parameters.mpc.horizon = HORIZON;
    parameters.mpc.r_rate = 0.3;
    parameters.speed.limit = SPEED;
    ControllerFor::predicting_with(parameters, straight(), model).unwrap()
}

/// What is measured of a state on the straight road.
fn measured(x: &Vector6<f64>, station: f64) -> Measurement {
    Measurement {
        x: station,
        y: x[0],
        yaw: x[2],
        vx: SPEED,
        vy: (x[1] - SPEED * x[2].sin()) / x[2].cos(),
        yaw_rate: x[3],
        steer: 0.0,
        articulation: x[4],
        articulation_rate: x[5],
    }
}

#[test]
fn the_condensed_horizon_is_the_simulated_one() {
    for kind in [Kind::Linear, Kind::Rfl] {
        let model = learn(kind);
        let mut controller = controller(Model::Residual(residual(model.clone())), 0.3);
        let start = Vector6::new(0.02, 0.01, -0.004, 0.003, 0.01, -0.02);
        let report = *controller.step(&measured(&start, 40.0)).unwrap();
        let lateral = controller.lateral();
        assert_eq!(lateral.outside_training(), 0.0, "the residual is not faded");
        let problem = lateral.problem();
        let plan = lateral.plan();
        let mut predicted = vec![0.0; problem.free.len()];
        problem.predict(plan, &mut predicted);

        // The same by hand: coefficients along a nominal roll-out with no steering, then the plan step by step. What was
        // before the first step is the first state and no steering.
        let nominal = NOMINAL.model_at(SPEED).unwrap().discretise(TS);
        let mut rolled = vec![start; WINDOW];
        let commands: Vec<f64> = std::iter::repeat_n(0.0, WINDOW - 1).chain(plan.iter().copied()).collect();
        let (mut features, mut room) = (vec![0.0; model.features()], model.workspace());
        let mut x = start;
        let mut speed = SPEED;
        let tracked = [0, 1, 2, 4];
        assert_eq!(problem.shape.outputs, tracked.len());
        for j in 0..HORIZON {
            for (feature, state) in features.chunks_exact_mut(6).zip(&rolled[j..]).take(WINDOW) {
                feature.copy_from_slice(state.as_slice());
            }
            features[6 * WINDOW..].copy_from_slice(&[speed, 0.0, 0.0]);
            speed += report.accel_cmd * TS;
            model.coefficients(&features, &[], &mut room);
            let newest = rolled[j + WINDOW - 1];
            // States among the regressors are those of the roll-out: the problem stays linear in the commands.
            let missed = room.residual(&commands[j..j + WINDOW], newest.as_slice());
            x = nominal.step(&x, plan[j], 0.0, 0.0) + SVector::from(missed);
            rolled.push(nominal.step(&newest, 0.0, 0.0, 0.0));
            for (output, state) in tracked.into_iter().enumerate() {
                let error = predicted[j * tracked.len() + output] - x[state];
                assert!(error.abs() < 1e-12, "{kind:?}, step {j}, state {state}: {error}");
            }
        }
    }
}

/// Drives the true vehicle 10 s from beside the road; root mean square of `e1` and largest articulation.
fn closed_loop(model: Model, articulation_max: f64) -> [f64; 2] {
    let mut controller = controller(model, articulation_max);
    let mut x = Vector6::new(0.3, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut issued = vec![0.0; DEAD_SAMPLES];
    let (mut sum, mut articulation) = (0.0, 0.0_f64);
    for k in 0..500 {
        let report = controller.step(&measured(&x, 40.0 + f64::from(k) * TS * SPEED)).unwrap();
        issued.push(report.steer_cmd);
        x = truth(SPEED).step(&x, issued.remove(0), 0.0, 0.0);
        sum += x[0] * x[0];
        articulation = articulation.max(x[4].abs());
    }
    [(sum / 500.0).sqrt(), articulation]
}

#[test]
fn it_is_driven_and_its_articulation_bounded() {
    let learned = learn(Kind::Linear);
    let with = |articulation_max| closed_loop(Model::Residual(residual(learned.clone())), articulation_max);
    let free = with(0.5);
    let nominal = closed_loop(Model::Nominal, 0.5);
    let oracle = Actuator { dead_time: DEAD_SAMPLES as f64 * TS, ..Actuator::default() };
    let known = closed_loop(Model::Actuator(oracle), 0.5);
    // What was learned drives as one does who knows the dead time; the nominal model does not.
    let away = |rms: f64| (rms / known[0] - 1.0).abs();
    assert!(away(free[0]) < 0.01 && away(nominal[0]) > 0.05, "{free:?} {known:?} {nominal:?}");
    let bound = 0.5 * free[1];
    let bounded = with(bound);
    assert!(bounded[1] < 1.1 * bound, "articulation {} with a bound of {bound}", bounded[1]);
}

#[test]
fn a_control_step_allocates_nothing() {
    let learned = Model::Residual(residual(learn(Kind::Rfl)));
    for model in [learned, Model::Actuator(Actuator { dead_time: 0.07, ..Actuator::default() })] {
        let mut parameters = *controller(Model::Nominal, 0.3).parameters();
        (parameters.observer.disturbance_noise, parameters.observer.prediction_noise) = (0.02, 0.01);
        let mut controller = ControllerFor::predicting_with(parameters, straight(), model).unwrap();
        for k in 0..100 {
            let e1 = 0.02 * (0.3 * f64::from(k)).sin();
            let at = measured(&Vector6::new(e1, 0.0, 0.0, 0.0, 0.01, 0.0), 40.0 + 0.16 * f64::from(k));
            let allocations = allocated(|| assert!(controller.step(&at).is_ok())).0;
            assert!(k == 0 || allocations == 0, "step {k}: {allocations}");
        }
    }
}

#[test]
fn a_file_is_for_its_vehicle_alone() {
    let model = learn(Kind::Linear);
    let bytes = model.to_bytes().unwrap();
    assert_eq!(Learned::from_bytes(&bytes).unwrap(), model);
    let car = ResidualModel::none(&CAR, TS, 1.5, WINDOW);
    for (error, words) in [
        (
            ResidualModel::from_bytes(&bytes).unwrap_err(),
            "holds a model for a toy, and one for a car is needed",
        ),
        (
            Learned::from_bytes(&car.to_bytes().unwrap()).unwrap_err(),
            "holds a model for a car, and one for a toy is needed",
        ),
    ] {
        assert!(matches!(error, FileError::OtherVehicle { .. }), "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }
    let other = Swinging { pull: 0.9, ..NOMINAL };
    let expected =
        rfl_mpc::residual::Expected { vehicle: other, sample_time: TS, min_model_speed: 1.5, window: None };
    let misfit = model.check_fits(&expected).unwrap_err();
    assert!(matches!(misfit, ModelMismatch::Vehicle { parameter: "pull", .. }), "{misfit}");
}

#[test]
fn a_drive_without_the_vehicles_states_is_refused() {
    let mut log = drive(1);
    log.articulation.clear();
    let error = DataSet::new(&[log], &NOMINAL, DataConfig::default()).unwrap_err();
    assert!(matches!(error, DataError::NoColumn { column: "articulation", .. }), "{error}");
}

#[test]
fn a_vehicle_without_a_nonlinear_model_says_so() {
    let choice = Choice {
        variant: ControlVariant::Nmpc,
        file: None,
        folder: "no/such".into(),
        propagation: Propagation::default(),
        roll_out: RollOut::default(),
    };
    let controller = controller(Model::Nominal, 0.3);
    let error = choice.prediction_model(controller.parameters()).unwrap_err();
    assert!(matches!(error, ChoiceError::NoNonlinear { .. }), "{error}");
    assert!(error.to_string().contains("nmpc") && error.to_string().contains("toy"), "{error}");

    // Nor is anything learned of one.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("gp.rflm");
    std::fs::write(&file, "rfl-gp 1 0 0 0\n").unwrap();
    let choice = Choice { variant: ControlVariant::None, file: Some(file), ..choice };
    let error = choice.prediction_model(controller.parameters()).unwrap_err();
    assert!(matches!(error, ChoiceError::File(_)) && error.to_string().contains("toy has none"), "{error}");
}
