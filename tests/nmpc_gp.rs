//! GP-NMPC: the prediction is the bicycle and the process, with true derivatives, and it drives better for it.

mod nmpc;

use nmpc::{controller, drive_bicycle, measure, with_model};
use rfl_mpc::control::{
    BicycleModel, BicycleRollOut, Controller, ControllerError, ControllerParameters, LateralError,
    PredictionModel, StepSpeed,
};
use rfl_mpc::nominal::{Bicycle, BicycleState};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::gp::{GpConfig, GpModel, train};
use rfl_mpc::residual::{DataConfig, DataSet, Drive, Misfit};
use rfl_mpc::vehicle::{SingleTrack, builtin};
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
                let at = controller.report();
                let row = [
                    time,
                    at.steer_cmd,
                    at.e1,
                    at.e1_rate,
                    at.e2,
                    at.e2_rate,
                    controller.lateral().roll_out().unwrap().speed[0].planned,
                    at.curvature,
                    at.curvature_rate,
                ];
                log.columns_mut().into_iter().zip(row).for_each(|(column, value)| column.push(value));
            });
            let data =
                DataSet::new(&[log], &car(), DataConfig { sample_time: 0.02, min_model_speed: 1.5 }).unwrap();
            let config = GpConfig {
                points: 150,
                hyperparameter_samples: 200,
                candidates: 1500,
                starts: 2,
                ..GpConfig::default()
            };
            Arc::new(train(&data, None, &config, &|_| ()).unwrap().model)
        })
        .clone()
}

fn model(gp: Arc<GpModel>) -> PredictionModel {
    PredictionModel::Bicycle(BicycleModel { gp: Some(gp), ..BicycleModel::default() })
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
fn a_step_is_the_bicycles_and_the_processs_with_their_derivatives() {
    let (gp, path) = (process(), Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let mut roll_out = BicycleRollOut::new(&car(), 1.0, Some(gp.clone()), 0.02, HORIZON).unwrap();
    roll_out.speed.fill(StepSpeed::held(5.0));
    roll_out.start = BicycleState::new(100.0, 0.05, -0.02, 0.05, 0.1);
    let plan: Vec<f64> = (0..HORIZON).map(|j| 0.05 + 0.02 * (0.5 * j as f64).sin()).collect();
    roll_out.follow_anew(&path, &plan, true);
    assert_eq!(roll_out.outside_training(), 0.0);
    let body = Bicycle::new(&car(), 1.0).unwrap().step(0.05, 0.1, 5.0, plan[0], 0.02).value;
    let missed = gp.residual(&[5.0, 0.05, 0.1, plan[0], 0.0]).mean;
    for o in 0..2 {
        assert!((roll_out.state(0)[3 + o] - body[o] - missed[o]).abs() < 1e-12);
    }
    assert!(missed[0].abs() > 1e-4, "it learned something: {missed:?}");
    let mut gain = vec![0.0; 4 * HORIZON * HORIZON];
    roll_out.write_gain(&[0, 1, 2, 3], &mut gain);
    let mut errors = |plan: &[f64]| -> Vec<f64> {
        roll_out.follow(&path, plan);
        (0..HORIZON).flat_map(|j| roll_out.errors(j).iter().copied().collect::<Vec<_>>()).collect()
    };
    for column in 0..HORIZON {
        let mut moved = |by: f64| {
            let mut plan = plan.clone();
            plan[column] += by;
            errors(&plan)
        };
        let (up, down) = (moved(1e-5), moved(-1e-5));
        for row in 0..4 * HORIZON {
            let difference = (up[row] - down[row]) / 2e-5;
            let entry = gain[row * HORIZON + column];
            assert!((entry - difference).abs() < 1e-6, "row {row}, column {column}: {entry} {difference}");
        }
    }
}

#[test]
fn outside_its_training_it_fades_to_the_bicycle() {
    let path = Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap();
    let end = |gp: Option<Arc<GpModel>>, speed: f64, use_process: bool| {
        let mut roll_out = BicycleRollOut::new(&car(), 1.0, gp, 0.02, HORIZON).unwrap();
        roll_out.speed.fill(StepSpeed::held(speed));
        roll_out.start = BicycleState::new(20.0, 0.05, -0.02, 0.05, 0.1);
        roll_out.follow_anew(&path, &[0.05; HORIZON], use_process);
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
        let mut parameters = ControllerParameters::for_car(&builtin("c_class").unwrap());
        change(&mut parameters);
        let bicycle = BicycleModel { friction, gp: Some(process()), ..BicycleModel::default() };
        let model = PredictionModel::Bicycle(bicycle);
        match Controller::predicting_with(parameters, path.clone(), model).err() {
            Some(ControllerError::Lateral(LateralError::Residual(misfit))) => misfit,
            other => panic!("{other:?}"),
        }
    };
    assert!(matches!(refused(&|_| (), 0.5), Misfit::Friction { .. }));
    assert!(matches!(refused(&|p| p.vehicle.mass = 2000.0, 1.0), Misfit::Vehicle { .. }));
    assert!(matches!(refused(&|p| p.mpc.sample_time = 0.01, 1.0), Misfit::SampleTime { .. }));
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
