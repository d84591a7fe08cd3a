//! The plan of nonlinear MPC solves the nonlinear problem, within a few QPs a step, and is a linear MPC's where the
//! problem is linear.

use crate::nmpc::{controller, drive, measure};
use rfl_mpc::control::{BicycleModel, ControlStatus, Controller, ControllerParameters, PredictionModel};
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::vehicle::{Effects, builtin};
use std::sync::Arc;

/// Largest decrease of the nonlinear objective, relative to it, that a brute search finds along directions that keep
/// the bounds: the negative gradient by central differences and each coordinate, projected.
fn decrease_found(controller: &Controller) -> f64 {
    let lateral = controller.lateral();
    let (problem, mut roll_out) = (lateral.problem(), lateral.roll_out().unwrap().clone());
    let mpc = controller.parameters().mpc;
    let mut objective = |plan: &[f64]| {
        roll_out.follow(controller.path(), plan);
        let outputs: Vec<f64> =
            (0..plan.len()).flat_map(|j| [0, 1, 2].map(|state| roll_out.errors(j)[state])).collect();
        problem.objective(plan, &outputs)
    };
    let project = |plan: &mut [f64]| {
        let mut before = problem.previous[0];
        for command in plan {
            let change = mpc.steer_rate_max * mpc.sample_time;
            *command = command.clamp(before - change, before + change).clamp(-mpc.steer_max, mpc.steer_max);
            before = *command;
        }
    };
    let mut plan = lateral.plan().to_vec();
    project(&mut plan);
    let at = objective(&plan);
    let gradient: Vec<f64> = (0..plan.len())
        .map(|i| {
            let mut moved = |by: f64| {
                let mut plan = plan.clone();
                plan[i] += by;
                objective(&plan)
            };
            (moved(1e-6) - moved(-1e-6)) / 2e-6
        })
        .collect();
    let mut best = at;
    for exponent in 2..12 {
        let length = 10.0_f64.powi(-exponent);
        let mut trials = vec![plan.clone()];
        let size = gradient.iter().fold(1e-30_f64, |size, by| size.max(by.abs()));
        for (trial, by) in trials[0].iter_mut().zip(&gradient) {
            *trial -= length * by / size;
        }
        for i in 0..plan.len() {
            for sign in [1.0, -1.0] {
                // A command alone, and all from it on: what rate weights couple.
                let (mut alone, mut rest) = (plan.clone(), plan.clone());
                alone[i] += sign * length;
                rest[i..].iter_mut().for_each(|command| *command += sign * length);
                trials.extend([alone, rest]);
            }
        }
        for trial in &mut trials {
            project(trial);
            best = best.min(objective(trial));
        }
    }
    (at - best) / at.max(1e-9)
}

#[test]
fn no_direction_within_the_bounds_is_better() {
    let mut checked = 0;
    drive(controller(|_| ()), &Effects::default(), |k, controller| {
        if k % 50 == 25 && controller.report().status == ControlStatus::Optimal {
            let found = decrease_found(controller);
            assert!(found < 1e-6, "step {k}: {found} of the objective can be gained");
            checked += 1;
        }
    });
    assert!(checked > 20, "{checked}");
}

#[test]
fn the_check_finds_a_plan_that_is_not_the_best() {
    let mut controller = controller(|_| ());
    let car = measure(&controller, 0.3);
    controller.step(&car).unwrap();
    assert!(decrease_found(&controller) < 1e-6);
    // The same problem, its plan found by the linear MPC.
    let parameters = *controller.parameters();
    let mut linear = Controller::new(parameters, controller.path().clone()).unwrap();
    linear.step(&car).unwrap();
    let lateral = controller.lateral();
    let mut roll_out = lateral.roll_out().unwrap().clone();
    roll_out.follow(controller.path(), linear.lateral().plan());
    let outputs: Vec<f64> =
        (0..lateral.plan().len()).flat_map(|j| [0, 1, 2].map(|state| roll_out.errors(j)[state])).collect();
    let theirs = lateral.problem().objective(linear.lateral().plan(), &outputs);
    roll_out.follow(controller.path(), lateral.plan());
    let outputs: Vec<f64> =
        (0..lateral.plan().len()).flat_map(|j| [0, 1, 2].map(|state| roll_out.errors(j)[state])).collect();
    let ours = lateral.problem().objective(lateral.plan(), &outputs);
    assert!(theirs > ours * (1.0 + 1e-5), "{theirs} {ours}");
}

#[test]
fn a_few_qps_a_step_are_enough() {
    let mut counts = [0; 31];
    drive(controller(|_| ()), &Effects { steer_lag: 0.1, ..Effects::default() }, |_, controller| {
        counts[controller.lateral().qps() as usize] += 1;
        let status = controller.report().status;
        assert!(matches!(status, ControlStatus::Optimal | ControlStatus::Finished), "{status:?}");
    });
    let (all, few): (usize, usize) = (counts.iter().sum(), counts[..=3].iter().sum());
    assert!(few * 100 >= all * 99, "{counts:?}");
    assert!(counts[7..].iter().all(|count| *count == 0), "{counts:?}");
}

#[test]
fn for_small_errors_on_a_straight_it_is_the_linear_mpc() {
    let straight = (0..200).map(|k| Sample::at(f64::from(k), 0.0)).collect();
    let path = Arc::new(Path::from_samples(straight, Closure::Open).unwrap());
    let mut parameters = ControllerParameters::of_the_papers(&builtin("c_class").unwrap());
    parameters.speed.limit = 8.0;
    let plan = |model: PredictionModel, size: f64| {
        let mut controller = Controller::predicting_with(parameters, path.clone(), model).unwrap();
        // As fast as planned: the speed stays.
        let speed = controller.speed_plan().speed(80.0);
        let car = rfl_mpc::control::Measurement {
            x: 80.0,
            y: size,
            yaw: -size,
            vx: speed,
            vy: 0.5 * size,
            yaw_rate: size,
            ..Default::default()
        };
        controller.step(&car).unwrap();
        controller.lateral().plan().to_vec()
    };
    // What is not linear shrinks with the square of the size, down to the accuracy of solver and integration.
    for (size, tolerance) in [(1e-2, 1e-2), (1e-3, 3e-4)] {
        let linear = plan(PredictionModel::Nominal, size);
        let nonlinear = plan(PredictionModel::Nonlinear(BicycleModel::default()), size);
        let largest = linear.iter().fold(0.0_f64, |largest, steer| largest.max(steer.abs()));
        for (linear, nonlinear) in linear.iter().zip(&nonlinear) {
            assert!((linear - nonlinear).abs() < tolerance * largest, "{size}: {linear} {nonlinear}");
        }
    }
}
