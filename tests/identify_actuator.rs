//! The steering actuator's constants from recorded steps.

use rfl_mpc::nominal::{
    Actuator, ContinuousErrorModel, DeadTimeModel, DelayModel, IdentifyError, SteeringRecord,
};
use rfl_mpc::numerics::Random;
use rfl_mpc::vehicle::{SingleTrack, SteeringChain, SteeringState};

const TS: f64 = 0.02;

/// Times and commands: a step of 0.05 rad after half a second.
fn step(rows: usize) -> (Vec<f64>, Vec<f64>) {
    (0..rows).map(|k| (TS * k as f64, if k < 25 { 0.0 } else { 0.05 })).unzip()
}

/// Angle of dead time and lag in closed form, `t` after the step.
fn closed_form(t: f64, dead_time: f64, lag: f64) -> f64 {
    let since = t - dead_time;
    if since <= 0.0 { 0.0 } else { 1.0 - (-since / lag).exp() }
}

fn measured(time: &[f64], dead_time: f64, lag: f64, mut noise: impl FnMut() -> f64) -> Vec<f64> {
    time.iter().map(|t| 0.05 * closed_form(t - 0.5, dead_time, lag) + noise()).collect()
}

fn identify(dead_time: f64, lag: f64, noise: impl FnMut() -> f64) -> Actuator {
    let (time, command) = step(150);
    let record = SteeringRecord::new(&time, &command, &measured(&time, dead_time, lag, noise)).unwrap();
    let found = record.identify(DelayModel::DeadTimeLag).unwrap();
    assert!((found.gain - 1.0).abs() < 0.02, "{found:?}");
    found.actuator
}

#[test]
fn dead_time_and_lag_are_found() {
    // Low and high delay of the truck, and dead times that are no whole number of samples.
    for (dead_time, lag) in [(0.3, 0.2), (0.04, 0.05), (0.307, 0.2), (0.0, 0.1), (0.113, 0.03)] {
        let found = identify(dead_time, lag, || 0.0);
        assert!((found.dead_time - dead_time).abs() < 1e-4, "{dead_time} {lag}: {found:?}");
        assert!((found.time_constant - lag).abs() < 1e-4, "{dead_time} {lag}: {found:?}");
    }
}

#[test]
fn dead_time_and_lag_are_found_through_noise() {
    // A sensor's 1 % of the step.
    let mut errors = Vec::new();
    for seed in 0..5 {
        let mut random = Random::new(seed);
        let found = identify(0.3, 0.2, || 5e-4 * 12.0_f64.sqrt() * (random.uniform() - 0.5));
        errors.push([found.dead_time - 0.3, found.time_constant - 0.2]);
    }
    assert!(errors.iter().flatten().all(|error| error.abs() < 0.25 * TS), "{errors:?}");
}

#[test]
fn gain_and_offset_do_no_harm() {
    let (time, command) = step(150);
    let angle = measured(&time, 0.3, 0.2, || 0.0);
    let command: Vec<f64> = command.iter().map(|u| u + 0.02).collect();
    let response: Vec<f64> = angle.iter().map(|y| 1.1 * y - 0.004).collect();
    let found =
        SteeringRecord::new(&time, &command, &response).unwrap().identify(DelayModel::DeadTimeLag).unwrap();
    assert!((found.gain - 1.1).abs() < 1e-4 && (found.offset + 0.004).abs() < 1e-6, "{found:?}");
    assert!((found.actuator.dead_time - 0.3).abs() < 1e-4, "{found:?}");
}

#[test]
fn the_plants_own_chain_is_identified() {
    let chain = SteeringChain {
        dead_time: 0.3,
        lag: 0.2,
        rate_limit: 100.0,
        angle_limit: 1.0,
        backlash: 0.0,
        gain: 1.0,
        offset: 0.0,
    };
    let (time, command) = step(150);
    let mut state = SteeringState::at_rest(&chain, 0.0);
    let angles: Vec<f64> = time
        .iter()
        .zip(&command)
        .map(|(&time, &command)| {
            let angle = state.measured();
            state.command(&chain, time, command);
            state.advance(&chain, time, TS);
            angle
        })
        .collect();
    let found =
        SteeringRecord::new(&time, &command, &angles).unwrap().identify(DelayModel::DeadTimeLag).unwrap();
    assert!((found.actuator.dead_time - 0.3).abs() < 1e-3, "{found:?}");
    assert!((found.actuator.time_constant - 0.2).abs() < 1e-3, "{found:?}");
}

#[test]
fn each_approximant_finds_its_own_constant() {
    let mut random = Random::new(2);
    // Rich commands: held for a few steps each.
    let command: Vec<f64> = (0..300)
        .scan(0.0, |held, k| {
            if k % 7 == 0 {
                *held = 0.05 * random.uniform();
            }
            Some(*held)
        })
        .collect();
    let time: Vec<f64> = (0..300).map(|k| TS * f64::from(k)).collect();
    let truths = [
        (DelayModel::FirstOrder, Actuator { time_constant: 0.37, ..Actuator::default() }),
        (
            DelayModel::Pade11,
            Actuator { dead_time: 0.43, dead_time_model: DeadTimeModel::Pade11, ..Actuator::default() },
        ),
        (
            DelayModel::Pade22,
            Actuator { dead_time: 0.51, dead_time_model: DeadTimeModel::Pade22, ..Actuator::default() },
        ),
    ];
    for (model, truth) in truths {
        let sampled = truth.sample(TS);
        let response: Vec<f64> =
            (0..300).map(|k| if k == 0 { command[0] } else { sampled.angle(&command[..k]) }).collect();
        let record = SteeringRecord::new(&time, &command, &response).unwrap().with_gain(1.0);
        let found = record.identify(model).unwrap();
        assert!((found.actuator.dead_time - truth.dead_time).abs() < 1e-4, "{found:?}");
        assert!((found.actuator.time_constant - truth.time_constant).abs() < 1e-4, "{found:?}");
        assert!(found.rmse < 1e-6, "{found:?}");
    }
}

#[test]
fn what_does_not_fit_is_fitted_as_well_as_it_can_be() {
    let (time, command) = step(150);
    let record = SteeringRecord::new(&time, &command, &measured(&time, 0.3, 0.2, || 0.0)).unwrap();
    let fits = DelayModel::ALL.iter().map(|&model| record.identify(model).unwrap());
    let [exact, first_order, pade11, pade22] = <[_; 4]>::try_from(fits.collect::<Vec<_>>()).unwrap();
    assert!(exact.rmse < 1e-7, "{exact:?}");
    // The whole delay is 0.5 s: each takes it up in its own constant, and leaves an error that shows.
    assert!((0.3..0.7).contains(&first_order.actuator.time_constant), "{first_order:?}");
    assert!((0.3..0.6).contains(&pade11.actuator.dead_time), "{pade11:?}");
    assert!((0.3..0.6).contains(&pade22.actuator.dead_time), "{pade22:?}");
    for fit in [first_order, pade11, pade22] {
        assert!(fit.rmse > 1e-3 && fit.explained > 0.8, "{fit:?}");
    }
}

#[test]
fn the_yaw_rate_serves_where_the_angle_is_not_measured() {
    let car = SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };
    let vehicle = ContinuousErrorModel::new(&car, 12.0).unwrap();
    // The record comes from steps twenty times as fine, through Euler's rule: not from what identifies.
    let (time, command) = step(110);
    let fine = TS / 200.0;
    let (mut x, mut response) = (nalgebra::Vector4::zeros(), Vec::new());
    for k in 0..110 {
        response.push(x[3]);
        for i in 0..200 {
            let t = TS * f64::from(k) + fine * f64::from(i) - 0.5;
            x += (vehicle.a * x + vehicle.b * (0.05 * closed_form(t + 0.5 * fine, 0.113, 0.09))) * fine;
        }
    }
    let record = SteeringRecord::new(&time, &command, &response).unwrap();
    let found = record.identify_by_yaw_rate(DelayModel::DeadTimeLag, &vehicle).unwrap();
    assert!((found.actuator.dead_time - 0.113).abs() < 0.1 * TS, "{found:?}");
    assert!((found.actuator.time_constant - 0.09).abs() < 0.1 * TS, "{found:?}");
}

#[test]
fn gaps_are_left_out() {
    let (time, command) = step(150);
    let mut response = measured(&time, 0.3, 0.2, || 0.0);
    response[40..45].fill(f64::NAN);
    let found =
        SteeringRecord::new(&time, &command, &response).unwrap().identify(DelayModel::DeadTimeLag).unwrap();
    assert!((found.actuator.dead_time - 0.3).abs() < 1e-4, "{found:?}");
}

#[test]
fn what_is_wrong_is_said() {
    let (mut time, mut command) = step(150);
    let response = measured(&time, 0.3, 0.2, || 0.0);
    let refuse = |time: &[f64], command: &[f64], response: &[f64]| {
        SteeringRecord::new(time, command, response).unwrap_err()
    };
    assert!(matches!(refuse(&time, &command, &response[1..]), IdentifyError::Lengths { .. }));
    assert!(matches!(refuse(&time[..9], &command[..9], &response[..9]), IdentifyError::TooShort { .. }));
    assert_eq!(refuse(&time, &[0.1; 150], &response), IdentifyError::NoExcitation);
    assert!(matches!(refuse(&time, &command, &[f64::NAN; 150]), IdentifyError::Gaps { found: 0, .. }));
    let mut late = response.clone();
    late[..30].fill(f64::NAN);
    assert_eq!(refuse(&time, &command, &late), IdentifyError::NoRest { row: 25 });
    let silent = SteeringRecord::new(&time, &command, &[0.3; 150]).unwrap().identify(DelayModel::FirstOrder);
    assert!(matches!(silent, Err(IdentifyError::NoResponse { .. })), "{silent:?}");
    command[7] = f64::NAN;
    assert!(matches!(refuse(&time, &command, &response), IdentifyError::NotFinite { row: 7, .. }));
    command[7] = 0.0;
    time[60..].iter_mut().for_each(|t| *t += 0.1);
    let error = refuse(&time, &command, &response);
    assert!(matches!(error, IdentifyError::Uneven { row: 60, .. }), "{error}");
}
