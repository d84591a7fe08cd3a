//! A control step allocates nothing beyond the QP solver's own allocation.

mod counting;

use counting::allocated;
use rfl_mpc::control::{Controller, ControllerParameters, Measurement};
use rfl_mpc::path::{Closure, Path, Sample};
use std::sync::Arc;

/// Largest number of allocations of a step among all steps after the first.
fn most_allocations(deadline: f64) -> usize {
    let circle = (0..120).map(|k| {
        let angle = f64::from(k) * std::f64::consts::TAU / 120.0;
        Sample::at(40.0 * angle.cos(), 40.0 * angle.sin())
    });
    let path = Arc::new(Path::from_samples(circle.collect(), Closure::Closed).unwrap());
    let mut parameters = ControllerParameters::default();
    parameters.mpc.deadline = deadline;
    let mut controller = Controller::new(parameters, path).unwrap();
    (0..200)
        .map(|k| {
            let angle = f64::from(k) * 0.005;
            let measurement = Measurement {
                x: 40.2 * angle.cos(),
                y: 40.2 * angle.sin(),
                yaw: angle + std::f64::consts::FRAC_PI_2,
                vx: 8.0,
                yaw_rate: 0.2,
                ..Measurement::default()
            };
            allocated(|| assert!(controller.step(&measurement).is_ok())).0
        })
        .skip(1)
        .max()
        .unwrap()
}

#[test]
fn a_control_step_allocates_at_most_once() {
    assert!(most_allocations(0.0) <= 1, "{}", most_allocations(0.0));
}

#[test]
fn a_deadline_costs_no_allocation() {
    assert!(most_allocations(1.0) <= 1, "{}", most_allocations(1.0));
}

#[test]
fn a_missed_deadline_allocates_no_more() {
    assert!(most_allocations(1e-9) <= 1, "{}", most_allocations(1e-9));
}
