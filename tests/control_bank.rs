//! The steering actuator that a drive shows: found with and without a measured angle, kept where nothing moves, and predicted
//! with.

use rfl_mpc::control::{Controller, ControllerParameters, KnownActuator};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::simulate::{ClosedLoop, SensorNoise, TrackingMetrics};
use rfl_mpc::vehicle::{Effects, builtin};
use std::sync::Arc;

fn turns() -> Arc<Path> {
    Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap())
}

fn closed_loop(path: Arc<Path>, lag: f64, delay: f64) -> ClosedLoop {
    let car = builtin("c_class").unwrap();
    let controller = Controller::new(ControllerParameters::for_car(&car), path).unwrap();
    let effects = Effects { steer_lag: lag, steer_delay: delay, ..Effects::default() };
    ClosedLoop::at_start(controller, &car, &effects, 0.02).unwrap()
}

fn drive(mut closed: ClosedLoop) -> (KnownActuator, TrackingMetrics) {
    let drive = closed.drive(120.0, |_| ()).unwrap();
    assert!(!drive.lost && drive.finished);
    (closed.controller().known_actuator().unwrap(), drive.tracking())
}

/// What the file says of the default car's lag, s.
const OWN: f64 = 0.05;

#[test]
fn a_late_actuator_is_found_by_the_measured_angle() {
    for (lag, delay) in [(0.0, 0.0), (0.1, 0.06), (0.05, 0.12), (0.2, 0.12)] {
        let (known, tracking) = drive(closed_loop(turns(), lag, delay));
        let sum = known.actuator.dead_time + known.actuator.time_constant;
        assert!((sum - lag - delay - OWN).abs() < 0.04, "{lag} {delay}: {known:?}");
        assert!(known.spread < 0.01, "{known:?}");
        assert!(tracking.max < 0.2, "{lag} {delay}: {tracking:?}");
    }
}

#[test]
fn without_a_measured_angle_the_yaw_rate_shows_it() {
    for noise in [None, Some(SensorNoise::TYPICAL)] {
        let mut closed = closed_loop(turns(), 0.1, 0.06).with_fault(|_, told| told.steer = 0.0);
        if let Some(noise) = noise {
            closed = closed.with_noise(noise, 3);
        }
        let (known, tracking) = drive(closed);
        let sum = known.actuator.dead_time + known.actuator.time_constant;
        // Two turns are little: what is found lies as near as it is said to.
        assert!((sum - 0.16 - OWN).abs() < 0.02 + 2.0 * known.spread, "{known:?}");
        assert!(known.spread < 0.08, "{known:?}");
        assert!(tracking.max < 0.2, "{tracking:?}");
    }
}

#[test]
fn an_actuator_that_rings_is_none_of_the_hypotheses() {
    // Angle and its rate behind a resonance of 5 rad/s with a damping of 0.1, of which the controller is told.
    let (mut angle, mut rate) = (0.0, 0.0);
    let mut closed = closed_loop(turns(), 0.0, 0.0).with_fault(move |_, told| {
        for _ in 0..20 {
            rate += 1e-3 * (25.0 * (told.steer - angle) - rate);
            angle += 1e-3 * rate;
        }
        told.steer = angle;
    });
    closed.drive(120.0, |_| ()).unwrap();
    let known = closed.controller().known_actuator().unwrap();
    assert!(known.spread > 0.03, "{known:?}");
}

#[test]
fn a_straight_road_teaches_nothing() {
    let straight = (0..200).map(|k| Sample::at(5.0 * f64::from(k), 0.0)).collect();
    let path = Arc::new(Path::from_samples(straight, Closure::Open).unwrap());
    let mut closed = closed_loop(path, 0.1, 0.06);
    let before = closed.controller().known_actuator().unwrap();
    closed.drive(20.0, |_| ()).unwrap();
    let after = closed.controller().known_actuator().unwrap();
    assert!(after.spread > 0.5 * before.spread, "{before:?} {after:?}");
}

#[test]
fn what_is_known_goes_with_the_state() {
    let mut closed = closed_loop(turns(), 0.1, 0.06);
    closed.drive(15.0, |_| ()).unwrap();
    let state = closed.controller().state().clone();
    let mut other = closed_loop(turns(), 0.1, 0.06);
    let controller = other.controller();
    assert_ne!(controller.known_actuator(), closed.controller().known_actuator());
    let car = builtin("c_class").unwrap();
    let mut restored = Controller::new(ControllerParameters::for_car(&car), turns()).unwrap();
    assert!(restored.restore(state).is_none());
    assert_eq!(restored.known_actuator(), closed.controller().known_actuator());
    other.advance().unwrap();
}
