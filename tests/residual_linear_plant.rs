//! What a window of commands can express: dead time exactly, lag nearly, and how that carries over a horizon.

use crate::residual_plant::{Plant, TS, car, data, drive, step};
use rfl_mpc::nominal::{ContinuousErrorModel, ErrorState};
use rfl_mpc::residual::{DataSet, Kind, LambdaChoice, TrainConfig, Trained, train};

const SPEEDS: [f64; 5] = [6.0, 8.0, 10.0, 12.0, 14.0];

fn quick(kind: Kind) -> TrainConfig {
    TrainConfig { trees: 5, depth: 4, ..TrainConfig::new(kind) }
}

fn trained(data: &DataSet, test: &DataSet, config: &TrainConfig) -> Trained {
    train(data, Some(test), config, &|_| ()).unwrap()
}

#[test]
fn a_dead_time_within_the_window_is_exactly_linear_in_it() {
    // Speed changes the coefficients: they are exact at one.
    for dead_samples in [1, 7, 15] {
        let plant = Plant { dead_samples, ..Plant::exact() };
        let (train_data, test_data) = (data(&plant, &[8.0; 20], 500, 1), data(&plant, &[8.0; 3], 500, 100));
        for kind in [Kind::Linear, Kind::Rtl, Kind::Rfl] {
            let fit = trained(&train_data, &test_data, &quick(kind)).report.test.unwrap();
            assert!(fit.nominal_rmse[1] > 1e-4, "there is something to learn: {fit:?}");
            assert!(fit.rmse.iter().all(|&e| e < 1e-12), "{kind:?}, {dead_samples} samples: {fit:?}");
        }
        let paper = TrainConfig { lambda: LambdaChoice::LeastSquares, ..quick(Kind::Rfl) };
        let fit = trained(&train_data, &test_data, &paper).report.test.unwrap();
        assert!(fit.rmse.iter().all(|&e| e < 1e-12), "plain least squares, {dead_samples} samples: {fit:?}");
    }
}

#[test]
fn a_dead_time_beyond_the_window_is_not() {
    let plant = Plant { dead_samples: 16, ..Plant::exact() };
    let fit =
        trained(&data(&plant, &[8.0; 20], 500, 1), &data(&plant, &[8.0; 3], 500, 100), &quick(Kind::Linear));
    assert!(fit.report.test.unwrap().rmse[1] > 1e-6);
}

#[test]
fn linear_leaves_cut_the_error_of_a_lag_by_ten_against_constant_ones() {
    let plant = Plant { lag: 0.1, ..Plant::exact() };
    let speeds = SPEEDS.repeat(8);
    let (train_data, test_data) = (data(&plant, &speeds, 400, 1), data(&plant, &speeds, 100, 100));
    let rmse = |kind| trained(&train_data, &test_data, &quick(kind)).report.test.unwrap().rmse;
    for (constant, linear) in [(Kind::Rt, Kind::Rtl), (Kind::Rf, Kind::Rfl)] {
        let (constant, linear) = (rmse(constant), rmse(linear));
        for o in [1, 3] {
            assert!(constant[o] > 10.0 * linear[o], "{constant:?} against {linear:?}");
        }
    }
}

#[test]
fn leaves_learn_what_one_linear_model_cannot() {
    // Gains that change with speed: only trees that see the speed can follow.
    let mut vehicle = car();
    vehicle.cf *= 0.8;
    vehicle.cr *= 0.9;
    let plant = Plant { vehicle, dead_samples: 3, lag: 0.0, noise: 0.0 };
    let speeds = SPEEDS.repeat(8);
    let (train_data, test_data) = (data(&plant, &speeds, 400, 1), data(&plant, &speeds, 100, 100));
    let regressors = rfl_mpc::residual::Regressors { road: true, states: 1 };
    let linear = TrainConfig { regressors, ..quick(Kind::Linear) };
    let switched = TrainConfig { regressors, ..quick(Kind::RflS) };
    let linear = trained(&train_data, &test_data, &linear).report.test.unwrap().rmse;
    let switched = trained(&train_data, &test_data, &switched).report.test.unwrap().rmse;
    assert!((0..4).all(|o| switched[o] < 0.5 * linear[o]), "{switched:?} against {linear:?}");
}

/// Method, section 2: `x_{j} = A x_{j-1} + B u + D kappa + r_j` with `r_j` linear in the window; propagated through `A`.
#[test]
fn a_propagated_prediction_is_the_simulation() {
    let plant = Plant { dead_samples: 5, ..Plant::exact() };
    let model =
        trained(&data(&plant, &[8.0; 20], 500, 1), &data(&plant, &[8.0], 500, 50), &quick(Kind::Rfl)).model;
    let (window, horizon) = (model.schema().window, 16);
    let log = drive(&plant, 400, 77, 8.0);
    let mut room = model.workspace();
    for start in [100, 200, 300] {
        let (v, curvature) = (log.vx[start], log.curvature[start]);
        let state = |k: usize| [log.e1[k], log.e1_rate[k], log.e2[k], log.e2_rate[k]];
        // A plan that has nothing to do with what was driven.
        let plan: Vec<f64> = (0..horizon).map(|j| 0.02 * (0.7 * j as f64 + start as f64).sin()).collect();
        let commands: Vec<f64> = log.steer_cmd[start - window..start].iter().chain(&plan).copied().collect();

        let mut truth = ErrorState::from(state(start));
        let mut steer = 0.0;
        let nominal = ContinuousErrorModel::new(&car(), v).unwrap().discretise(TS);
        let mut predicted = truth;
        let mut states: Vec<f64> = (start + 1 - window..=start).flat_map(state).collect();
        for j in 0..horizon {
            truth = step(&plant, &truth, &mut steer, commands[window + j - plant.dead_samples], v, curvature);
            let features: Vec<f64> =
                states[states.len() - 4 * window..].iter().copied().chain([v, curvature, 0.0]).collect();
            let recent = &commands[j + 1..=j + window];
            model.coefficients(&features, recent, &mut room);
            predicted = nominal.step(&predicted, commands[window + j], v * curvature, 0.0)
                + ErrorState::from(room.residual(recent, &[]));
            states.extend(predicted.iter());
            assert!((predicted - truth).norm() < 1e-12, "step {j}: {predicted} against {truth}");
        }
    }
}

#[test]
fn a_model_without_gap_learns_nothing() {
    let plant = Plant::exact();
    let fit =
        trained(&data(&plant, &SPEEDS, 500, 1), &data(&plant, &SPEEDS, 500, 9), &quick(Kind::Rfl)).report;
    assert!(fit.train.nominal_rmse.iter().all(|&e| e < 1e-14), "{fit:?}");
    assert!(fit.test.unwrap().rmse.iter().all(|&e| e < 1e-14), "{fit:?}");
}
