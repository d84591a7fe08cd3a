//! The steering actuator from ordinary drives: dead time, lag, gain and offset with intervals that hold the truth.

use rfl_mpc::control::{Controller, ControllerParameters, PredictionModel};
use rfl_mpc::nominal::{
    Actuator, IdentifiedSteering, SteeringDrive, identify_by_yaw_rate_from_drives, identify_from_drives,
};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::residual::Random;
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{CarParameters, Effects, SteeringChain, SteeringState, builtin};
use std::sync::Arc;

const TS: f64 = 0.02;

/// A chain without limits.
fn chain(dead_time: f64, lag: f64) -> SteeringChain {
    SteeringChain {
        dead_time,
        lag,
        rate_limit: f64::MAX,
        angle_limit: 1.0,
        backlash: 0.0,
        gain: 1.0,
        offset: 0.0,
    }
}

/// Commands as of a drive: bends that come and go, and a controller's small corrections.
fn commands(rows: usize, seed: u64, busy: f64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let (mut bend, mut left, mut held, mut fine) = (0.0, 0_usize, 0.0, 0.0);
    (0..rows)
        .map(|_| {
            if left == 0 {
                left = 60 + (140.0 * random.uniform()) as usize;
                bend = 0.12 * (random.uniform() - 0.5);
            }
            left -= 1;
            held += 0.04 * (bend - held);
            fine = 0.9 * fine + busy * 0.01 * (random.uniform() - 0.5);
            held + fine
        })
        .collect()
}

/// What the chain makes of commands.
fn measured(
    chain: &SteeringChain,
    time: &[f64],
    commands: &[f64],
    mut noise: impl FnMut() -> f64,
) -> Vec<f64> {
    let mut state = SteeringState::at_rest(chain, commands[0]);
    let mut now = time[0];
    time.iter()
        .zip(commands)
        .map(|(&time, &command)| {
            state.advance(chain, now, time - now);
            now = time;
            let angle = state.measured();
            state.command(chain, time, command);
            angle + noise()
        })
        .collect()
}

fn even(rows: usize) -> Vec<f64> {
    (0..rows).map(|k| TS * k as f64).collect()
}

fn drive_of(time: Vec<f64>, steer_cmd: Vec<f64>, response: Vec<f64>) -> SteeringDrive {
    SteeringDrive { name: "synthetic".into(), time, steer_cmd, response, speed: Vec::new() }
}

/// A Gaussian's number, nearly: twelve uniform ones.
fn gauss(random: &mut Random) -> f64 {
    (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0
}

fn shown(name: &str, truth: [f64; 2], found: &IdentifiedSteering) {
    let text = |e: &rfl_mpc::nominal::Estimate| {
        format!("{:7.4} [{:7.4} {:7.4}]{}", e.value, e.low, e.high, if e.excited { ' ' } else { '?' })
    };
    println!(
        "{name:<34} T {:.3} tau {:.3} | {} | {} | {} | {} | {} | rmse {:.1e} out {} lim {:?} {:?}",
        truth[0],
        truth[1],
        text(&found.dead_time),
        text(&found.lag),
        text(&found.delay),
        text(&found.gain),
        text(&found.offset),
        found.rmse,
        found.left_out.len(),
        found.rate_limit,
        found.between
    );
}

fn synthetic(dead_time: f64, lag: f64, noise: f64, seed: u64) -> IdentifiedSteering {
    let (time, command) = (even(2000), commands(2000, seed, 1.0));
    let mut random = Random::new(seed + 1000);
    let angle = measured(&chain(dead_time, lag), &time, &command, || noise * gauss(&mut random));
    identify_from_drives(&[drive_of(time, command, angle)]).unwrap()
}

#[test]
fn what_is_true_is_found() {
    for (dead_time, lag) in [
        (0.06, 0.1),
        (0.0, 0.1),
        (0.06, 0.0),
        (0.0, 0.0),
        (0.05, 0.03),
        (0.113, 0.15),
        (0.3, 0.2),
        (0.047, 0.0),
    ] {
        for noise in [0.0, 1e-3] {
            let begin = std::time::Instant::now();
            let found = synthetic(dead_time, lag, noise, 7);
            shown(&format!("noise {noise} {:.2} s", begin.elapsed().as_secs_f64()), [dead_time, lag], &found);
        }
    }
}

/// An ordinary drive of a car, `seconds` long.
fn driven(car: &CarParameters, effects: &Effects, route: Route, seconds: f64) -> SteeringDrive {
    let path = Arc::new(route.path().unwrap());
    let parameters = ControllerParameters::for_car(car);
    let known = Actuator {
        dead_time: car.steering.dead_time + effects.steer_delay,
        time_constant: car.steering.lag + effects.steer_lag,
        ..Actuator::default()
    };
    let controller = Controller::predicting_with(parameters, path, PredictionModel::Actuator(known)).unwrap();
    let mut closed = ClosedLoop::at_start(controller, car, effects, TS).unwrap();
    let drive = closed.drive_until_lost(seconds, |_, error| error.abs() < 20.0).unwrap();
    SteeringDrive {
        name: "driven".into(),
        time: drive.column("time"),
        steer_cmd: drive.column("steer_cmd"),
        response: drive.column("steer"),
        speed: Vec::new(),
    }
}

#[test]
fn ordinary_drives_of_cars() {
    for (name, route, delay, lag) in [
        ("c_class", Route::SudokuTest, 0.06, 0.1),
        ("bmw_320i", Route::SudokuTrain, 0.0, 0.2),
        ("ford_escort", Route::OffRoad, 0.12, 0.0),
        ("vw_vanagon", Route::HairpinCircuit, 0.03, 0.05),
        ("genesis", Route::SudokuTurns, 0.09, 0.1),
    ] {
        let car = builtin(name).unwrap();
        let effects = Effects { steer_delay: delay, steer_lag: lag, ..Effects::default() };
        let begin = std::time::Instant::now();
        let log = driven(&car, &effects, route, 60.0);
        let drove = begin.elapsed().as_secs_f64();
        let found = identify_from_drives(std::slice::from_ref(&log)).unwrap();
        let truth = [car.steering.dead_time + delay, car.steering.lag + lag];
        shown(
            &format!("{name} {route:?} {drove:.1} {:.2}", begin.elapsed().as_secs_f64() - drove),
            truth,
            &found,
        );
    }
}
