//! The vehicle is never left without a command: what the controller does when it has no plan.

use rfl_mpc::control::{ControlStatus, Controller, ControllerParameters, Measurement, StepError};
use rfl_mpc::path::{Closure, Path, Sample};
use std::sync::Arc;

fn straight() -> Arc<Path> {
    let samples = (0..=100).map(|k| Sample::at(f64::from(k), 0.0)).collect();
    Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
}

fn controller(deadline: f64) -> Controller {
    let mut parameters = ControllerParameters::default();
    parameters.mpc.deadline = deadline;
    Controller::new(parameters, straight()).unwrap()
}

const AT: Measurement = Measurement {
    x: 20.0,
    y: 0.3,
    yaw: 0.0,
    vx: 8.0,
    vy: 0.0,
    yaw_rate: 0.0,
    steer: 0.0,
    articulation: 0.0,
    articulation_rate: 0.0,
};

#[test]
fn without_a_plan_steering_is_held_and_the_vehicle_brakes() {
    let mut controller = controller(1e-9);
    let report = *controller.step(&Measurement { steer: 0.1, ..AT }).unwrap();
    assert_eq!(report.status, ControlStatus::SafeHold);
    assert_eq!(report.steer_cmd, 0.1, "held where the steering was");
    assert!(report.accel_cmd < -1.0);
}

#[test]
fn a_missed_deadline_goes_on_with_the_last_plan_and_then_holds() {
    // A plan from a controller with time, continued by one without.
    let mut with_time = controller(0.0);
    let first = *with_time.step(&AT).unwrap();
    assert_eq!(first.status, ControlStatus::Optimal);
    let plan = with_time.lateral().plan().to_vec();
    assert!(plan[1] != plan[0], "the plan moves, so that going on with it shows");
    let mut without = controller(1e-9);
    assert!(without.restore(with_time.state().clone()).is_none());
    // On its way: what stays to the bit would be stale.
    let on = |age: usize| Measurement { x: AT.x + 0.16 * age as f64, ..AT };
    for (age, expected) in plan.iter().enumerate().skip(1) {
        let report = *without.step(&on(age)).unwrap();
        assert_eq!(report.status, ControlStatus::DeadlineMissed, "step {age}");
        assert!((report.steer_cmd - expected).abs() < 1e-6, "step {age}");
    }
    let last = *without.step(&on(plan.len())).unwrap();
    assert_eq!(last.status, ControlStatus::SafeHold);
    assert!((last.steer_cmd - plan[plan.len() - 1]).abs() < 1e-6);
}

#[test]
fn the_iteration_limit_counts_as_a_failed_solver() {
    let mut parameters = ControllerParameters::default();
    // The limit is Clarabel's.
    parameters.mpc.solver = 1;
    parameters.mpc.max_iterations = 1;
    let mut controller = Controller::new(parameters, straight()).unwrap();
    let report = controller.step(&AT).unwrap();
    assert_eq!((report.status, report.iterations), (ControlStatus::SafeHold, 0));
}

#[test]
fn a_first_measurement_that_is_not_finite_is_named_and_changes_nothing() {
    let mut controller = controller(0.0);
    let before = controller.state().clone();
    for (bad, signal) in [
        (Measurement { yaw_rate: f64::NAN, ..AT }, "yaw_rate"),
        (Measurement { x: f64::INFINITY, ..AT }, "x"),
    ] {
        let error = controller.step(&bad).unwrap_err();
        let StepError::NotFinite { signal: named, .. } = error else { panic!("{error}") };
        assert_eq!(named, signal);
        assert_eq!(controller.state(), &before);
    }
}

#[test]
fn a_parameter_out_of_range_is_named() {
    let mut parameters = ControllerParameters::default();
    parameters.mpc.r_rate = 0.0;
    let error = Controller::new(parameters, straight()).err().unwrap();
    assert!(error.to_string().contains("mpc.r_rate"), "{error}");
}

#[test]
fn far_from_the_path_it_steers_back_slowly() {
    let mut controller = controller(0.0);
    let report = *controller.step(&Measurement { y: 30.0, ..AT }).unwrap();
    assert_eq!(report.status, ControlStatus::FarFromPath);
    assert!(report.steer_cmd < 0.0, "to the right, towards the path");
    assert!(report.speed_ref <= 3.0);
}

#[test]
fn at_the_end_of_an_open_path_it_stops() {
    let mut controller = controller(0.0);
    controller.step(&AT).unwrap();
    let report = *controller.step(&Measurement { x: 99.8, y: 0.0, vx: 0.5, ..AT }).unwrap();
    assert_eq!(report.status, ControlStatus::Finished);
    assert!(report.finished && report.accel_cmd < 0.0);
}

#[test]
fn commands_respect_their_bounds_exactly() {
    let mut controller = controller(0.0);
    let p = *controller.parameters();
    let mut before = 0.0;
    for k in 0..200 {
        let side = if k % 40 < 20 { 3.0 } else { -3.0 };
        let report = *controller.step(&Measurement { y: side, ..AT }).unwrap();
        assert!(report.steer_cmd.abs() <= p.mpc.steer_max);
        let step = (report.steer_cmd - before).abs();
        assert!(step <= p.mpc.steer_rate_max * p.mpc.sample_time + 1e-12, "{step}");
        before = report.steer_cmd;
    }
}

#[test]
fn a_state_of_another_horizon_is_given_back() {
    let mut parameters = ControllerParameters::default();
    parameters.mpc.horizon = 20;
    let other = Controller::new(parameters, straight()).unwrap();
    let mut controller = controller(0.0);
    assert!(controller.restore(other.state().clone()).is_some());
}
