//! The parts of the comparison: predictions over a horizon, one drive.

use crate::residual_plant::{Plant as Linear, TS, car, data};
use rfl_mpc::control::{ControllerParameters, PredictionModel};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::{DataSet, Kind, ResidualModel, TrainConfig, train};
use rfl_mpc::simulate::experiment::{CAR_PLANTS, CostWeights, Trial, steps_ahead};
use rfl_mpc::simulate::{CarDrive, SensorNoise};
use rfl_mpc::vehicle::builtin;
use std::sync::Arc;

fn learned(data: &DataSet, kind: Kind) -> ResidualModel {
    train(data, None, &TrainConfig { trees: 5, depth: 3, ..TrainConfig::new(kind) }, &|_| ()).unwrap().model
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9 * b.abs() + 1e-15
}

/// Dead time at one speed: a linear model in the commands is exact.
fn late() -> Linear {
    Linear { dead_samples: 5, ..Linear::exact() }
}

#[test]
fn one_step_is_the_one_step_error() {
    let samples = data(&Linear { lag: 0.1, noise: 1.0, ..Linear::exact() }, &[8.0, 12.0], 600, 1);
    let windows = samples.windows(16);
    for kind in [Kind::Rf, Kind::RflS] {
        let model = learned(&samples, kind);
        let mut rows = 0.0;
        let (mut mine, mut nominal, mut max) = ([0.0; 4], [0.0; 4], [0.0_f64; 4]);
        let (mut features, mut room) = (vec![0.0; model.features()], model.workspace());
        // A prediction begins at every fifth sample that is followed by another.
        for i in (0..windows.len() - 1).step_by(5).filter(|&i| windows.follows(i + 1)) {
            windows.features(i, &mut features);
            model.coefficients(&features, &[], &mut room);
            let residual = room.residual(windows.commands(i), &[]);
            for (o, label) in windows.label(i).into_iter().enumerate() {
                mine[o] += (label - residual[o]).powi(2);
                nominal[o] += label.powi(2);
                max[o] = max[o].max((label - residual[o]).abs());
            }
            rows += 1.0;
        }
        let found = steps_ahead(&model, &samples, 1);
        for o in 0..4 {
            assert!(near(found.rmse[o], (mine[o] / rows).sqrt()), "{kind:?}: {found:?}");
            assert!(near(found.nominal_rmse[o], (nominal[o] / rows).sqrt()), "{kind:?}: {found:?}");
            assert!(near(found.max[o], max[o]), "{kind:?}: {found:?}");
        }
        // And it is about that of all samples.
        let all = model.measure(&samples).rmse;
        assert!((0..4).all(|o| (found.rmse[o] / all[o] - 1.0).abs() < 0.2), "{found:?}, {all:?}");
    }
}

#[test]
fn without_a_residual_it_is_the_nominal_prediction() {
    let samples = data(&late(), &[8.0, 12.0], 400, 1);
    let none = ResidualModel::none(&car(), TS, 1.5, 16);
    for steps in [1, 16] {
        let found = steps_ahead(&none, &samples, steps);
        assert!(found.nominal_rmse.iter().all(|&e| e > 0.0));
        assert_eq!(found.rmse, found.nominal_rmse);
    }
    // Errors add up over a horizon.
    let [one, many] = [1, 16].map(|steps| steps_ahead(&none, &samples, steps).rmse);
    assert!((0..4).all(|o| many[o] > 2.0 * one[o]), "{one:?} {many:?}");
}

#[test]
fn a_perfect_model_predicts_a_horizon() {
    let model = learned(&data(&late(), &[8.0; 4], 600, 1), Kind::Linear);
    let found = steps_ahead(&model, &data(&late(), &[8.0], 600, 50), 16);
    assert!(found.max.iter().all(|&e| e < 1e-9), "{found:?}");
    assert!(found.nominal_rmse.iter().all(|&e| e > 1e-4), "{found:?}");
}

fn drive(noise: Option<(SensorNoise, u64)>, give_up: f64) -> CarDrive {
    let car = builtin("c_class").unwrap();
    let path = Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let trial = Trial {
        vehicle: &car,
        plant: &CAR_PLANTS[0],
        path,
        model: PredictionModel::Nominal,
        weights: CostWeights::of(&ControllerParameters::default().mpc),
        noise,
        give_up,
        dither: None,
    };
    trial.drive().unwrap()
}

#[test]
fn a_trial_is_the_same_again_and_noise_is_another() {
    let errors = |noise| {
        let drive = drive(noise, 3.5);
        assert!(drive.finished && !drive.lost);
        drive.column("e1").iter().map(|e| e.to_bits()).collect::<Vec<_>>()
    };
    let noisy = |seed| Some((SensorNoise::TYPICAL, seed));
    let (calm, one, other) = (errors(None), errors(noisy(1)), errors(noisy(2)));
    assert_eq!(calm, errors(None));
    assert_eq!(one, errors(noisy(1)));
    assert!(calm != one && one != other);
}

#[test]
fn a_trial_ends_where_the_car_is_given_up() {
    let drive = drive(None, 0.005);
    assert!(drive.lost && !drive.finished);
    let errors = drive.column("e1");
    let (last, before) = errors.split_last().unwrap();
    assert!(last.abs() >= 0.005 && before.iter().all(|e| e.abs() < 0.005), "{last}");
}
