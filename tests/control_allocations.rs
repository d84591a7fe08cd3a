//! A control step allocates nothing; with Clarabel, nothing beyond the solver's own allocation.

mod counting;

use counting::allocated;
use rfl_mpc::control::{Controller, ControllerParameters, Measurement};
use rfl_mpc::path::{Closure, Path, Sample};
use std::sync::Arc;

/// Largest number of allocations of a step among all steps after the first.
fn most_allocations(solver: usize, deadline: f64) -> usize {
    let circle = (0..120).map(|k| {
        let angle = f64::from(k) * std::f64::consts::TAU / 120.0;
        Sample::at(40.0 * angle.cos(), 40.0 * angle.sin())
    });
    let path = Arc::new(Path::from_samples(circle.collect(), Closure::Closed).unwrap());
    let mut parameters = ControllerParameters::default();
    parameters.mpc.solver = solver;
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

/// Deadlines: none, one that is kept, one that is missed.
const DEADLINES: [f64; 3] = [0.0, 1.0, 1e-9];

#[test]
fn a_control_step_allocates_nothing() {
    assert_eq!(DEADLINES.map(|deadline| most_allocations(0, deadline)), [0; 3]);
}

#[test]
fn with_clarabel_a_control_step_allocates_at_most_once() {
    let most = DEADLINES.map(|deadline| most_allocations(1, deadline));
    assert!(most.iter().all(|&count| count <= 1), "{most:?}");
}
