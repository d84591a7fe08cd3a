//! A learned model that predicts worse than the nominal one is faded out, one that predicts better is not; outside its
//! training the actuator that the drive shows stands in for it.

use rfl_mpc::control::{
    ControlStatus, Controller, ControllerParameters, Measurement, Propagation, Residual, RollOut,
};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::residual::{DataConfig, DataSet, Kind, ResidualModel, TrainConfig, train};
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Effects, builtin};
use std::sync::Arc;

const PLAIN: fn() -> Effects = Effects::default;

/// Faster than any bend of the road lets a car be, m/s.
const FAST: f64 = 50.0;

fn late() -> Effects {
    Effects { steer_lag: 0.1, steer_delay: 0.06, ..PLAIN() }
}

/// The same with a steering that is far off straight: nobody's car.
fn crooked() -> Effects {
    Effects { steer_offset: 0.05, ..late() }
}

fn closed_loop(
    mut parameters: ControllerParameters,
    effects: &Effects,
    model: Option<&Arc<ResidualModel>>,
) -> ClosedLoop {
    let path = Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let car = builtin("c_class").unwrap();
    parameters.mpc.steer_max = 0.6;
    let residual = model.map(|model| Residual {
        model: model.clone(),
        propagation: Propagation::Propagated,
        roll_out: RollOut::Corrected,
    });
    let controller = Controller::predicting_with(parameters, path, residual.into()).unwrap();
    ClosedLoop::at_start(controller, &car, effects, 0.02).unwrap()
}

fn parameters() -> ControllerParameters {
    ControllerParameters::for_car(&builtin("c_class").unwrap())
}

/// A model of a car, from a calm drive with dither, at most so fast (m/s).
fn learned(effects: &Effects, fastest: f64) -> Arc<ResidualModel> {
    let mut collecting = parameters();
    collecting.speed.limit = fastest;
    collecting.mpc.r_rate = 0.3;
    collecting.mpc.q_e1_rate = 1.0;
    collecting.mpc.q_e2 = 2.0;
    collecting.mpc.dither = 0.01;
    let log = closed_loop(collecting, effects, None).drive(60.0, |_| ()).unwrap().to_learn_from();
    let data = DataSet::new(&[log], &collecting.vehicle.single_track(), DataConfig::default()).unwrap();
    let config = TrainConfig { window: 28, ..TrainConfig::new(Kind::Linear) };
    Arc::new(train(&data, None, &config, &|_| ()).unwrap().model)
}

/// Largest lateral error, m, the step at which the model is first called faded, and the number of such steps.
fn drive(effects: &Effects, model: Option<&Arc<ResidualModel>>) -> (f64, Option<u32>, u32) {
    let mut closed = closed_loop(parameters(), effects, model);
    let (mut error, mut first, mut faded) = (0.0_f64, None, 0);
    for step in 0..2200 {
        closed.advance().unwrap();
        error = error.max(closed.lateral_error().abs());
        let report = closed.controller().report();
        if report.status == ControlStatus::ResidualFaded {
            first = first.or(Some(step));
            faded += 1;
        }
        if report.finished {
            break;
        }
    }
    (error, first, faded)
}

#[test]
fn a_wrong_model_is_noticed_within_two_seconds_and_does_no_harm() {
    let wrong = learned(&crooked(), FAST);
    for effects in [PLAIN(), late()] {
        let (nominal, ..) = drive(&effects, None);
        let (error, first, faded) = drive(&effects, Some(&wrong));
        assert!(first.is_some_and(|step| step <= 100), "noticed at step {first:?}");
        assert!(faded > 1000, "and it stays out: {faded}");
        assert!(error <= 2.0 * nominal, "{error} m, nominal {nominal} m");
    }
}

#[test]
fn a_right_model_is_used() {
    for effects in [late(), crooked()] {
        let right = learned(&effects, FAST);
        let (nominal, ..) = drive(&effects, None);
        // What stands beside it knows the actuator, too: for moments it may be the better one.
        let (error, _, faded) = drive(&effects, Some(&right));
        assert!(faded < 100, "{effects:?}: {faded} steps, {error} m, nominal {nominal} m");
        assert!(error < nominal, "{error} m, nominal {nominal} m");
    }
}

#[test]
fn a_model_of_slow_drives_is_no_worse_at_speed_than_none() {
    let slow = learned(&late(), 4.0);
    let (without, ..) = drive(&late(), None);
    let mut closed = closed_loop(parameters(), &late(), Some(&slow));
    let (mut error, mut outside) = (0.0_f64, 0.0);
    for _ in 0..1000 {
        closed.advance().unwrap();
        error = error.max(closed.lateral_error().abs());
        outside += closed.controller().report().residual_outside;
    }
    assert!(outside > 500.0, "outside its training for {outside} of 1000 steps");
    // With the nominal model in its place it was twice as far off.
    assert!(error < 1.2 * without, "{error} m, without a model {without} m");
}

/// Between the two a blend would be neither: the loop is tight for a model that fits.
#[test]
fn mostly_outside_its_training_a_model_is_left_out_as_a_whole() {
    let slow = learned(&late(), 8.0);
    let residual =
        Residual { model: slow, propagation: Propagation::Propagated, roll_out: RollOut::Corrected };
    let straight = [0.0, 100.0, 200.0, 300.0, 400.0].map(|x| Sample::at(x, 0.0)).to_vec();
    let path = Arc::new(Path::from_samples(straight, Closure::Open).unwrap());
    // Half of it fades a quarter above the largest speed of the training, all of it a half above.
    for (speed, same) in [(7.0, false), (11.0, true), (15.0, true)] {
        let mut without = Controller::new(parameters(), path.clone()).unwrap();
        let mut with =
            Controller::predicting_with(parameters(), path.clone(), Some(residual.clone()).into()).unwrap();
        let mut apart = 0.0_f64;
        for step in 0..100 {
            let phase = 0.1 * f64::from(step);
            let measurement = Measurement {
                x: 50.0 + 0.02 * speed * f64::from(step),
                y: 0.02 * phase.sin(),
                yaw: 0.1 * phase.cos() / speed,
                vx: speed,
                yaw_rate: -0.5 * phase.sin() / speed,
                ..Measurement::default()
            };
            let commands = [&mut without, &mut with].map(|of| of.step(&measurement).unwrap().steer_cmd);
            apart = apart.max((commands[0] - commands[1]).abs());
        }
        assert_eq!(apart < 1e-12, same, "{speed} m/s: {apart} rad apart");
    }
}
