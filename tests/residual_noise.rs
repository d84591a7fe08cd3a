//! What the prefilter of training is for: a controller that steers on noisy measurements. Its commands then follow the
//! noise, and so do the labels. The plant is linear, with an actuator lag that the nominal model does not know.

use crate::residual_plant::{CONFIG, Plant, TS, car, data, drive, normal, step};
use rfl_mpc::nominal::ErrorState;
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{DataSet, Drive, Kind, LambdaChoice, ResidualModel, TrainConfig, train};
use rfl_mpc::simulate::experiment::steps_ahead;

const SPEED: f64 = 10.0;
const KINDS: [Kind; 2] = [Kind::Linear, Kind::RflS];

fn lag() -> Plant {
    Plant { lag: 0.1, ..Plant::exact() }
}

fn learned(data: &DataSet, kind: Kind, prefilter: f64) -> ResidualModel {
    // The window covers the lag, so that a linear model is exact but for its tail.
    let config = TrainConfig { window: 28, trees: 8, depth: 4, prefilter, ..TrainConfig::new(kind) };
    train(data, None, &config, &|_| ()).unwrap().model
}

/// Drives steered on the measurement, with white noise on it.
fn steered_on_the_measurement(noise: f64, first_seed: u64) -> DataSet {
    let drives: Vec<Drive> = (first_seed..first_seed + 6)
        .map(|seed| {
            let mut random = Random::new(seed);
            let mut log = Drive { name: format!("drive {seed}"), ..Drive::default() };
            let mut x = ErrorState::zeros();
            let (mut steer, mut dither) = (0.0, 0.0);
            for k in 0..1500 {
                let time = f64::from(k) * TS;
                dither = 0.9 * dither + 0.006 * normal(&mut random);
                let mut measured = x;
                for (state, scale) in measured.iter_mut().zip([5e-3, 10e-3, 1.5e-3, 4e-3]) {
                    *state += noise * scale * normal(&mut random);
                }
                let feedback = -0.03 * measured[0] - 0.02 * measured[1] - 0.25 * measured[2];
                let command = feedback + dither + 0.01 * (1.3 * time).sin();
                let [e1, e1_rate, e2, e2_rate] = measured.into();
                let row = [time, command, e1, e1_rate, e2, e2_rate, SPEED, 0.0, 0.0];
                log.columns_mut().into_iter().zip(row).for_each(|(column, value)| column.push(value));
                x = step(&lag(), &x, &mut steer, command, SPEED, 0.0);
            }
            log
        })
        .collect();
    DataSet::new(&drives, &car(), CONFIG).unwrap()
}

/// Without and with the filter: errors after a horizon, on drives without noise: nothing but the response counts.
fn horizon_errors(learn_from: &DataSet, kind: Kind) -> [Vec<f64>; 2] {
    let truth = data(&lag(), &[SPEED; 2], 1500, 90);
    [0.0, 0.8].map(|prefilter| steps_ahead(&learned(learn_from, kind, prefilter), &truth, 16).rmse)
}

#[test]
fn with_noise_in_the_loop_a_filtered_fit_predicts_several_times_better() {
    for (kind, seed) in KINDS.into_iter().flat_map(|kind| [1, 31].map(|seed| (kind, seed))) {
        let [without, with] = horizon_errors(&steered_on_the_measurement(1.0, seed), kind);
        for o in 0..3 {
            assert!(with[o] < 0.5 * without[o], "{kind:?}: {with:?} against {without:?}");
        }
        // The yaw rate, which does not need it, loses nothing.
        assert!(with[3] < 1.1 * without[3], "{kind:?}: {with:?} against {without:?}");
    }
}

#[test]
fn without_noise_the_filter_does_no_harm() {
    for kind in KINDS {
        let [without, with] = horizon_errors(&steered_on_the_measurement(0.0, 1), kind);
        assert!((0..4).all(|o| with[o] <= without[o]), "{kind:?}: {with:?} against {without:?}");
        // A single step has the tail that the window cuts off: more of it, and still little of what is learned.
        let clean = data(&lag(), &[SPEED; 2], 1500, 90);
        let fit = learned(&data(&lag(), &[SPEED; 6], 1500, 1), kind, 0.8).measure(&clean);
        assert!((0..4).all(|o| fit.rmse[o] < 0.01 * fit.nominal_rmse[o]), "{kind:?}: {fit:?}");
    }
}

/// Coefficients of a plain linear fit to these drives.
fn coefficients(drives: &[Drive]) -> Vec<f64> {
    let samples = DataSet::new(drives, &car(), CONFIG).unwrap();
    let config =
        TrainConfig { prefilter: 0.8, lambda: LambdaChoice::LeastSquares, ..TrainConfig::new(Kind::Linear) };
    let model = train(&samples, None, &config, &|_| ()).unwrap().model;
    model.leaves().theta(0).as_flattened().to_vec()
}

fn noisy_drives() -> Vec<Drive> {
    (1..4).map(|seed| drive(&Plant { noise: 1.0, ..lag() }, 400, seed, SPEED)).collect()
}

/// Which stretch was before another must not matter, but for the rounding of sums in another order.
fn assert_same_fit(one: &[Drive], other: &[Drive]) {
    let (one, other) = (coefficients(one), coefficients(other));
    let difference = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let largest = one.iter().map(|a| a.abs()).fold(0.0, f64::max);
    assert!(difference < 1e-10 * largest, "{difference} of {largest}");
}

#[test]
fn the_filter_does_not_reach_from_one_drive_into_the_next() {
    let drives = noisy_drives();
    let reversed: Vec<Drive> = drives.iter().rev().cloned().collect();
    assert_same_fit(&drives, &reversed);
}

#[test]
fn the_filter_does_not_bridge_a_gap() {
    let mut drives = noisy_drives();
    let mut halves = [drives[0].clone(), drives[0].clone()];
    for (half, rows) in halves.iter_mut().zip([0..200, 201..400]) {
        half.columns_mut().into_iter().for_each(|column| *column = column[rows.clone()].to_vec());
    }
    drives[0].e1[200] = f64::NAN;
    let [first, second] = halves;
    assert_same_fit(&drives, &[second, drives[2].clone(), first, drives[1].clone()]);
}
