//! From drives to a process: it learns what a nonlinear model misses, on roads and at speeds it has not seen.

use crate::gp_plant::{CONFIG, Known, Plant, car, data, data_of, drive};
use rfl_mpc::nominal::Bicycle;
use rfl_mpc::residual::gp::{GpConfig, GpTrainError, INPUTS, Samples, StateSmoothing, train};
use rfl_mpc::residual::{ConfigError, DataConfig, DataSet, Progress, TrainingStage};
use rfl_mpc::vehicle::{Articulated, SingleTrack};
use std::sync::Mutex;

/// A fast one; as to smoothing, the default.
fn small() -> GpConfig {
    GpConfig { points: 80, hyperparameter_samples: 150, candidates: 1500, starts: 2, ..GpConfig::default() }
}

/// Samples of a vehicle: its own states, and what its model misses of them.
fn check_samples<V: Known<S, D, O>, const S: usize, const D: usize, const O: usize>() {
    let data = data_of::<V, S, D, O>(&Plant::default(), 2, 400, 1);
    let (nominal, truth) = (V::believed().nonlinear_model(1.0).unwrap(), V::truth());
    let samples = Samples::new(&data, &nominal, 0);
    assert_eq!((samples.inputs.len(), samples.left_out), (2 * 399, 0));
    for (at, label) in samples.inputs.iter().zip(&samples.labels) {
        let (next, believed) = (V::step(&truth, at, at[0], 0.02), V::step(&nominal, at, at[0], 0.02));
        for (label, place) in label.iter().zip(V::OUTPUTS) {
            assert!((label - (next[place] - believed[place])).abs() < 1e-9, "{label:?}");
        }
        assert!(at[D - 1].abs() < 0.7, "speed changes by at most 3 * 0.21 m/s2: {at:?}");
    }
    // Yaw rates of a winding road, and what they make of the vehicle, so that the test means something.
    assert!(samples.inputs.iter().any(|input| input[2].abs() > 0.1));
    for o in 0..O {
        assert!(samples.labels.iter().any(|label| label[o].abs() > 1e-4), "output {o}");
    }
}

#[test]
fn samples_are_the_plants_own_states_and_residuals() {
    check_samples::<SingleTrack, 4, _, _>();
    check_samples::<Articulated, 6, _, _>();
}

/// Predictions of drives that were not learned from, one step and a horizon ahead.
fn check_unseen<V: Known<S, D, O>, const S: usize, const D: usize, const O: usize>(left: f64) {
    let data = |drives, seed| data_of::<V, S, D, O>(&Plant::default(), drives, 700, seed);
    let (learned, unseen) = (data(8, 1), data(3, 9));
    let trained = train(&learned, Some(&unseen), &small(), &|_| ()).unwrap();
    let test = trained.report.test.unwrap();
    for o in 0..O {
        assert!(test.rmse[o] < left * test.nominal_rmse[o], "{test:?}\n{:?}", trained.model.schema());
    }
    assert_eq!(trained.model.schema().training.smoothing, 0, "{:?}", trained.report);
    let [with, without] = trained.model.measure_steps(&unseen, 16).unwrap();
    assert!((0..O).all(|o| with[o] < left * without[o]), "{with:?} {without:?}");
    assert_eq!(trained.model.measure(&unseen).unwrap(), test);
    assert_eq!(trained.report.train.samples, trained.model.schema().training.samples);
}

#[test]
fn it_predicts_unseen_drives_of_a_car() {
    check_unseen::<SingleTrack, 4, _, _>(0.03);
}

#[test]
fn it_predicts_unseen_drives_of_a_truck() {
    // Seven inputs for as many points.
    check_unseen::<Articulated, 6, _, _>(0.05);
}

#[test]
fn noise_is_averaged_out() {
    let plant = Plant { noise: 1.0, ..Plant::default() };
    let learned = data(&plant, 10, 1500, 1);
    // Measured on drives without noise: the labels of noisy ones say little about the prediction.
    let clean = data(&Plant::default(), 3, 700, 9);
    let trained = train(&learned, Some(&clean), &small(), &|_| ()).unwrap();
    let test = trained.report.test.unwrap();
    for o in 0..2 {
        assert!(test.rmse[o] < 0.3 * test.nominal_rmse[o], "{test:?}\n{:?}", trained.report);
    }
    assert!(trained.model.schema().training.smoothing >= 2, "{:?}", trained.report);
    // Free predictions, too, and clearly better than from states taken as they come.
    let [with, without] = trained.model.measure_steps(&clean, 16).unwrap();
    let config = GpConfig { smoothing: StateSmoothing::Fixed(0), ..small() };
    let raw = train(&learned, None, &config, &|_| ()).unwrap().model.measure_steps(&clean, 16).unwrap()[0];
    for o in 0..2 {
        assert!(with[o] < 0.3 * without[o] && with[o] < 0.6 * raw[o], "{with:?} {raw:?} {without:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let data = data(&Plant { lag: 0.1, noise: 1.0 }, 3, 500, 1);
    let config = GpConfig {
        smoothing: StateSmoothing::Choose(vec![0, 3]),
        points: 40,
        hyperparameter_samples: 80,
        iterations: 15,
        threads: 1,
        ..small()
    };
    let one = train(&data, None, &config, &|_| ()).unwrap();
    let bytes = one.model.to_bytes().unwrap();
    for threads in [2, 3] {
        let more = train(&data, None, &GpConfig { threads, ..config.clone() }, &|_| ()).unwrap();
        assert_eq!(more, one);
        assert_eq!(more.model.to_bytes().unwrap(), bytes);
    }
    let other = train(&data, None, &GpConfig { seed: 2, ..config.clone() }, &|_| ()).unwrap();
    assert_ne!(other.model.to_bytes().unwrap(), bytes);
}

#[test]
fn it_says_how_far_it_is_and_ends_complete() {
    let data = data(&Plant::default(), 2, 300, 1);
    let seen = Mutex::new(vec![]);
    train(
        &data,
        None,
        &GpConfig { smoothing: StateSmoothing::Fixed(0), points: 20, iterations: 5, ..small() },
        &|p| seen.lock().unwrap().push(p),
    )
    .unwrap();
    let seen = seen.into_inner().unwrap();
    for (stage, total) in
        [(TrainingStage::Hyperparameters, 4), (TrainingStage::Weights, 2), (TrainingStage::Report, 1)]
    {
        assert!(seen.contains(&Progress { stage, done: 0, total }), "{seen:?}");
        assert!(seen.contains(&Progress { stage, done: total, total }), "{seen:?}");
    }
}

#[test]
fn outside_the_training_range_it_says_so_and_falls_back_to_nominal() {
    let data = data(&Plant::default(), 4, 400, 1);
    let model = train(&data, None, &GpConfig { smoothing: StateSmoothing::Fixed(0), ..small() }, &|_| ())
        .unwrap()
        .model;
    let samples = Samples::new(&data, &Bicycle::new(&car(), 1.0).unwrap(), 0);
    let mut room = vec![];
    let prior: Vec<f64> = model.schema().outputs.iter().map(|o| o.signal * o.signal).collect();
    for input in samples.inputs.iter().step_by(50) {
        assert_eq!(model.excess(input), 0.0);
        let variance = model.variance(input, &mut room);
        assert!((0..2).all(|o| variance[o] < 0.1 * prior[o]), "{variance:?} {prior:?}");
    }
    let range = &model.schema().inputs[2];
    assert_eq!((range.name.as_str(), range.unit.as_str()), ("yaw_rate", "rad/s"));
    let mut input = samples.inputs[100];
    input[2] = range.max + 0.5 * (range.max - range.min);
    assert!((model.excess(&input) - 0.5).abs() < 1e-12);
    input[2] = f64::NAN;
    assert_eq!(model.excess(&input), f64::INFINITY);
    let far: [f64; INPUTS] = [1e5; INPUTS];
    assert!(model.residual(&far).mean.iter().all(|mean| mean.abs() < 1e-9));
    assert!((model.variance(&far, &mut room)[0] / prior[0] - 1.0).abs() < 1e-6);
}

#[test]
fn what_cannot_be_learned_from_is_refused_with_the_reason() {
    let refused = |data: &DataSet, test: Option<&DataSet>, config: &GpConfig| {
        train(data, test, config, &|_| ()).unwrap_err()
    };
    let short = data(&Plant::default(), 1, 50, 1);
    let message = refused(&short, None, &small()).to_string();
    assert!(message.contains("49 steps") && message.contains("drive longer"), "{message}");

    let long = data(&Plant::default(), 1, 200, 1);
    let config = GpConfig { points: 0, ..small() };
    assert!(matches!(
        refused(&long, None, &config),
        GpTrainError::Config(ConfigError::Range { name: "points", .. })
    ));
    let config = GpConfig { smoothing: StateSmoothing::Choose(vec![]), ..small() };
    assert!(matches!(refused(&long, None, &config), GpTrainError::Config(ConfigError::NoCandidate { .. })));
    let message = refused(&long, None, &GpConfig { friction: f64::NAN, ..small() }).to_string();
    assert!(message.contains("friction"), "{message}");

    let drives = [drive(&Plant::default(), 200, 1)];
    let heavier = SingleTrack { mass: 2000.0, ..car() };
    for other in [
        DataSet::new(&drives, &heavier, CONFIG).unwrap(),
        DataSet::new(&drives, &car(), DataConfig { min_model_speed: 3.0, ..CONFIG }).unwrap(),
    ] {
        assert_eq!(refused(&long, Some(&other), &small()), GpTrainError::TestData);
    }
}

#[test]
fn steps_across_the_path_are_left_out() {
    let mut turned = drive(&Plant::default(), 300, 1);
    turned.e2[100] = 1.57;
    turned.curvature[200] = 0.5;
    turned.e1[200] = 2.0;
    let data = DataSet::new(&[turned], &car(), CONFIG).unwrap();
    let samples = Samples::new(&data, &Bicycle::new(&car(), 1.0).unwrap(), 0);
    assert_eq!((samples.left_out, samples.inputs.len()), (4, 295));
    assert!(samples.labels.as_flattened().iter().all(|x| x.is_finite()));
}
