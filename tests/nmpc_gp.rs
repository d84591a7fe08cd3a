//! GP-NMPC: the prediction is the nonlinear model and the process, with true derivatives, and it drives better for it; of a
//! car and of a truck.

use crate::nmpc::{controller, drive_articulated, drive_bicycle, measure, with_model};
use nalgebra::SVector;
use rfl_mpc::control::{
    ArticulatedModel, BicycleModel, BicycleRollOut, Controller, ControllerError, ControllerParameters,
    LateralError, NonlinearRollOut, PredictionModel, PredictionModelFor, StepReport, StepSpeed,
    TruckController, TruckControllerParameters,
};
use rfl_mpc::nominal::{ArticulatedPathState, ArticulatedSingleTrack, Bicycle, BicycleState};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::gp::{GpConfig, GpModel, GpModelFor, GpVehicle, TruckGpModel, train};
use rfl_mpc::residual::{DataConfig, DataSet, Drive, ModelMismatch};
use rfl_mpc::vehicle::{Articulated, SingleTrack, builtin, builtin_truck};
use std::sync::{Arc, OnceLock};

fn car() -> SingleTrack {
    builtin("c_class").unwrap().single_track()
}

/// What the car really is: heavier, and softer in its tyres.
fn truth() -> Bicycle {
    let SingleTrack { mass, yaw_inertia, lf, lr, cf, cr } = car();
    let truth = SingleTrack {
        mass: 1.15 * mass,
        yaw_inertia: 1.2 * yaw_inertia,
        lf,
        lr,
        cf: 0.7 * cf,
        cr: 0.85 * cr,
    };
    Bicycle::new(&truth, 0.8).unwrap()
}

/// A process learned from a drive of the nonlinear MPC with dither on the true car.
fn process() -> Arc<GpModel> {
    static PROCESS: OnceLock<Arc<GpModel>> = OnceLock::new();
    PROCESS
        .get_or_init(|| {
            let mut log = Drive { name: "collected".into(), ..Drive::default() };
            drive_bicycle(controller(|p| p.mpc.dither = 0.005), &truth(), |time, controller| {
                let vx = controller.lateral().roll_out().unwrap().speed[0].planned;
                push(&mut log, time, controller.report(), vx);
            });
            let data = DataSet::new(&[log], &car(), CONFIG).unwrap();
            Arc::new(train(&data, None, &config(), &|_| ()).unwrap().model)
        })
        .clone()
}

const CONFIG: DataConfig =
    DataConfig { sample_time: 0.02, min_model_speed: 1.5, steer_gain: 1.0, steer_offset: 0.0 };

fn config() -> GpConfig {
    GpConfig { points: 150, hyperparameter_samples: 200, candidates: 1500, starts: 2, ..GpConfig::default() }
}

/// Adds a row to a log.
fn push(log: &mut Drive, time: f64, at: &StepReport, vx: f64) {
    let errors = [at.e1, at.e1_rate, at.e2, at.e2_rate];
    let row = [[time, at.steer_cmd].as_slice(), &errors, &[vx, at.curvature, at.curvature_rate]].concat();
    log.columns_mut().into_iter().zip(row).for_each(|(column, value)| column.push(value));
}

fn truck() -> Articulated {
    builtin_truck("truck_simulation").unwrap().articulated()
}

/// What the truck really is: loaded, and softer in its tyres.
fn true_truck() -> ArticulatedSingleTrack {
    let Articulated { stiffness: [front, rear, trailer], mass2, .. } = truck();
    let stiffness = [0.7 * front, 0.85 * rear, 0.75 * trailer];
    ArticulatedSingleTrack::new(&Articulated { mass2: 1.3 * mass2, stiffness, ..truck() }, 0.8).unwrap()
}

/// The truck's controller on the U-turn's road.
fn truck_controller(gp: Option<Arc<TruckGpModel>>, dither: f64) -> TruckController {
    let mut parameters =
        TruckControllerParameters::of_the_papers(&builtin_truck("truck_simulation").unwrap());
    parameters.mpc.dither = dither;
    let path = Arc::new(Route::TruckUTurn.path().unwrap());
    let model = PredictionModelFor::Nonlinear(ArticulatedModel { gp, ..ArticulatedModel::default() });
    TruckController::predicting_with(parameters, path, model).unwrap()
}

/// A process learned from a drive of the truck's nonlinear MPC with dither on the true truck.
fn truck_process() -> Arc<TruckGpModel> {
    static PROCESS: OnceLock<Arc<TruckGpModel>> = OnceLock::new();
    PROCESS
        .get_or_init(|| {
            let mut log = Drive { name: "collected".into(), ..Drive::default() };
            drive_articulated(truck_controller(None, 0.01), &true_truck(), |time, controller, told| {
                push(&mut log, time, controller.report(), told.vx);
                log.articulation.push(told.articulation);
                log.articulation_rate.push(told.articulation_rate);
            });
            let data = DataSet::new(&[log], &truck(), CONFIG).unwrap();
            Arc::new(train(&data, None, &config(), &|_| ()).unwrap().model)
        })
        .clone()
}

fn model(gp: Arc<GpModel>) -> PredictionModel {
    PredictionModel::Nonlinear(BicycleModel { gp: Some(gp), ..BicycleModel::default() })
}

#[test]
fn it_drives_better_than_nonlinear_mpc_alone() {
    let without = drive_bicycle(controller(|_| ()), &truth(), |_, _| ());
    let mut outside = 0.0_f64;
    let mut qps = 0;
    let with = drive_bicycle(with_model(|_| (), model(process())), &truth(), |_, controller| {
        outside += controller.report().residual_outside;
        qps = qps.max(controller.lateral().qps());
    });
    assert!(with.mae < 0.4 * without.mae && with.max < 0.7 * without.max, "{with:?} {without:?}");
    assert!(outside < 0.05 * with.count as f64, "{outside} of {} steps outside its training", with.count);
    assert!(qps <= 8, "{qps}");
}

const HORIZON: usize = 16;

#[test]
fn a_truck_drives_better_than_with_nonlinear_mpc_alone() {
    let without = drive_articulated(truck_controller(None, 0.0), &true_truck(), |_, _, _| ());
    let mut outside = 0.0_f64;
    let with = drive_articulated(truck_controller(Some(truck_process()), 0.0), &true_truck(), |_, at, _| {
        outside += at.report().residual_outside;
    });
    assert!(with.mae < 0.5 * without.mae && with.max < 0.8 * without.max, "{with:?} {without:?}");
    assert!(outside < 0.05 * with.count as f64, "{outside} of {} steps outside its training", with.count);
}

/// A prediction from `start` at 5 m/s, under a plan around a steering angle.
fn check_step<V: GpVehicle<S, N, O>, const S: usize, const N: usize, const O: usize>(
    vehicle: &V,
    gp: Arc<GpModelFor<V, N, O>>,
    path: &Path,
    start: SVector<f64, N>,
) {
    let mut roll_out = NonlinearRollOut::new(vehicle, 1.0, Some(gp.clone()), 0.02, HORIZON).unwrap();
    roll_out.speed.fill(StepSpeed::held(5.0));
    roll_out.start = start;
    let plan: Vec<f64> = (0..HORIZON).map(|j| 0.05 + 0.02 * (0.5 * j as f64).sin()).collect();
    roll_out.follow_anew(path, &plan, 1.0);
    assert_eq!(roll_out.outside_training(), 0.0);
    // Speed, the body's states, command, acceleration.
    let mut input = [0.0; N];
    input[1..N - 2].copy_from_slice(&start.as_slice()[3..]);
    (input[0], input[N - 2]) = (5.0, plan[0]);
    let body = V::step(&vehicle.nonlinear_model(1.0).unwrap(), &input, 5.0, 0.02);
    let missed = gp.residual(&input).mean;
    for (place, state) in body.iter().enumerate().take(N - 2).skip(1) {
        let learned = V::OUTPUTS.iter().position(|output| *output == place).map_or(0.0, |o| missed[o]);
        let gap = roll_out.state(0)[place + 2] - state - learned;
        assert!(gap.abs() < 1e-12, "{place}: {gap}");
    }
    assert!(missed.iter().all(|missed| missed.abs() > 1e-4), "it learned something: {missed:?}");
    let mut gain = vec![0.0; S * HORIZON * HORIZON];
    roll_out.write_gain(&(0..S).collect::<Vec<_>>(), &mut gain);
    let mut errors = |plan: &[f64]| -> Vec<f64> {
        roll_out.follow(path, plan);
        (0..HORIZON).flat_map(|j| roll_out.errors(j).iter().copied().collect::<Vec<_>>()).collect()
    };
    for column in 0..HORIZON {
        let mut moved = |by: f64| {
            let mut plan = plan.clone();
            plan[column] += by;
            errors(&plan)
        };
        let (up, down) = (moved(1e-5), moved(-1e-5));
        for row in 0..S * HORIZON {
            let difference = (up[row] - down[row]) / 2e-5;
            let entry = gain[row * HORIZON + column];
            assert!((entry - difference).abs() < 1e-6, "row {row}, column {column}: {entry} {difference}");
        }
    }
}

#[test]
fn a_step_is_the_models_and_the_processs_with_their_derivatives() {
    let path = Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap();
    check_step(&car(), process(), &path, BicycleState::new(100.0, 0.05, -0.02, 0.05, 0.1));
    let (path, start) = (Route::TruckUTurn.path().unwrap(), [40.0, 0.05, -0.02, 0.05, 0.1, 0.1, 0.02]);
    check_step(&truck(), truck_process(), &path, ArticulatedPathState::from(start));
}

#[test]
fn outside_its_training_it_fades_to_the_bicycle() {
    let path = Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap();
    let end = |gp: Option<Arc<GpModel>>, speed: f64, use_process: bool| {
        let mut roll_out = BicycleRollOut::new(&car(), 1.0, gp, 0.02, HORIZON).unwrap();
        roll_out.speed.fill(StepSpeed::held(speed));
        roll_out.start = BicycleState::new(20.0, 0.05, -0.02, 0.05, 0.1);
        roll_out.follow_anew(&path, &[0.05; HORIZON], f64::from(u8::from(use_process)));
        (*roll_out.errors(HORIZON - 1), roll_out.outside_training())
    };
    // Far faster than ever driven.
    assert_eq!(end(Some(process()), 60.0, true), (end(None, 60.0, true).0, 1.0));
    assert_eq!(end(Some(process()), 5.0, false).0, end(None, 5.0, false).0);
    assert_ne!(end(Some(process()), 5.0, true).0, end(None, 5.0, true).0);
}

#[test]
fn a_process_of_another_controller_is_refused() {
    let path = controller(|_| ()).path().clone();
    let refused = |change: &dyn Fn(&mut ControllerParameters), friction: f64| {
        let mut parameters = ControllerParameters::of_the_papers(&builtin("c_class").unwrap());
        change(&mut parameters);
        let bicycle = BicycleModel { friction, gp: Some(process()), ..BicycleModel::default() };
        let model = PredictionModel::Nonlinear(bicycle);
        match Controller::predicting_with(parameters, path.clone(), model).err() {
            Some(ControllerError::Lateral(LateralError::Residual(misfit))) => misfit,
            other => panic!("{other:?}"),
        }
    };
    assert!(matches!(refused(&|_| (), 0.5), ModelMismatch::Friction { .. }));
    assert!(matches!(refused(&|p| p.vehicle.mass = 2000.0, 1.0), ModelMismatch::Vehicle { .. }));
    assert!(matches!(refused(&|p| p.mpc.sample_time = 0.01, 1.0), ModelMismatch::SampleTime { .. }));
}

#[test]
fn it_goes_on_with_the_same_bits_after_a_restore() {
    let new = || with_model(|p| p.observer.disturbance_noise = 0.02, model(process()));
    let (mut first, mut second) = (new(), new());
    let at = |k: u32| measure(&first_road(), 0.1 * (0.05 * f64::from(k)).sin());
    for k in 0..10 {
        first.step(&at(k)).unwrap();
        second.step(&at(50 + k)).unwrap();
    }
    assert!(second.restore(first.state().clone()).is_none());
    for k in 10..30 {
        let bits = [&mut first, &mut second].map(|one| one.step(&at(k)).unwrap().steer_cmd.to_bits());
        assert_eq!(bits[0], bits[1], "step {k}");
    }
}

/// A controller to take the road from.
fn first_road() -> Controller {
    controller(|_| ())
}
