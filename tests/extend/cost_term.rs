//! A term of the cost of one's own: the steering angle itself, as far as it differs from that of the bend.

use crate::counting::allocated;
use rfl_mpc::control::{
    Controller, ControllerParameters, CostTerm, FastSolver, HorizonStep, Measurement, PredictionModel,
    QpSolver as _, TrackingQp,
};
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::vehicle::builtin;
use std::sync::Arc;

/// `1/2 w (u_j - L kappa_j)^2` in each step of the horizon.
struct SteeringEffort {
    weight: f64,
    wheelbase: f64,
}

impl CostTerm for SteeringEffort {
    fn weight(&self, _: f64) -> f64 {
        self.weight
    }

    fn output(&self, step: &HorizonStep<'_>, gain: &mut [f64]) -> [f64; 2] {
        gain[step.step] = 1.0;
        [0.0, self.wheelbase * step.curvature]
    }
}

/// `1/2 w (e1_j + T e1_j')^2`: the error so many seconds ahead.
struct Ahead {
    weight: f64,
    time: f64,
}

impl CostTerm for Ahead {
    fn weight(&self, _: f64) -> f64 {
        self.weight
    }

    fn output(&self, step: &HorizonStep<'_>, gain: &mut [f64]) -> [f64; 2] {
        let (Some(e1), Some(e1_rate)) = (step.state(0), step.state(1)) else { return [0.0; 2] };
        for (gain, (a, b)) in gain.iter_mut().zip(e1.1.iter().zip(e1_rate.1)) {
            *gain = a + self.time * b;
        }
        [e1.0 + self.time * e1_rate.0, 0.0]
    }
}

fn controller(terms: Vec<Box<dyn CostTerm>>) -> Controller {
    let samples = (0..200).map(|k| Sample::at(2.0 * f64::from(k), 0.0)).collect();
    let road = Arc::new(Path::from_samples(samples, Closure::Open).unwrap());
    let parameters = ControllerParameters::for_car(&builtin("c_class").unwrap());
    let mut controller = Controller::predicting_with(parameters, road, PredictionModel::Nominal).unwrap();
    for term in terms {
        controller.add_cost(term).unwrap();
    }
    controller
}

const BESIDE: Measurement = Measurement {
    x: 20.0,
    y: 0.2,
    yaw: 0.01,
    vx: 15.0,
    vy: 0.0,
    yaw_rate: 0.0,
    steer: 0.0,
    articulation: 0.0,
    articulation_rate: 0.0,
};

fn plan(terms: Vec<Box<dyn CostTerm>>) -> (Vec<f64>, TrackingQp) {
    let mut controller = controller(terms);
    controller.step(&BESIDE).unwrap();
    (controller.lateral().plan().to_vec(), controller.lateral().problem().clone())
}

/// The plan of a problem to which rows were added by hand.
fn by_hand(
    problem: &TrackingQp,
    weight: f64,
    row: impl Fn(&TrackingQp, usize) -> (Vec<f64>, f64),
) -> Vec<f64> {
    let mut shape = problem.shape.clone();
    let (outputs, n) = (shape.outputs, shape.horizon);
    shape.outputs += 1;
    shape.output_weight.push(weight);
    let mut wide = TrackingQp::new(shape);
    (wide.previous, wide.free_increments) = (problem.previous.clone(), problem.free_increments.clone());
    for j in 0..n {
        for i in 0..outputs {
            let (from, to) = (j * outputs + i, j * (outputs + 1) + i);
            (wide.free[to], wide.reference[to]) = (problem.free[from], problem.reference[from]);
            for k in 0..n {
                wide.gain[to * n + k] = problem.gain[from * n + k];
            }
        }
        let (gain, free) = row(problem, j);
        let to = j * (outputs + 1) + outputs;
        wide.free[to] = free;
        wide.gain[to * n..][..gain.len()].copy_from_slice(&gain);
    }
    let (mut inputs, mut all) = (vec![0.0; n], vec![0.0; wide.free.len()]);
    FastSolver::new(&wide, 200).unwrap().solve(&wide, f64::INFINITY, &mut inputs, &mut all).unwrap();
    inputs
}

fn differ(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_plan_is_that_of_the_problem_with_the_term() {
    let (none, problem) = plan(vec![]);
    let n = none.len();
    let effort = 200.0;
    let found = plan(vec![Box::new(SteeringEffort { weight: effort, wheelbase: 2.9 })]).0;
    let expected =
        by_hand(&problem, effort, |_, j| ((0..=j).map(|k| f64::from(u8::from(k == j))).collect(), 0.0));
    assert!(differ(&found, &expected) < 1e-9 && differ(&found, &none) > 1e-4, "{found:?} {expected:?}");

    let outputs = problem.shape.outputs;
    let found = plan(vec![Box::new(Ahead { weight: 5.0, time: 0.5 })]).0;
    let expected = by_hand(&problem, 5.0, |problem, j| {
        let row = |i: usize| &problem.gain[(j * outputs + i) * n..][..=j];
        let gain = row(0).iter().zip(row(1)).map(|(a, b)| a + 0.5 * b).collect();
        (gain, problem.free[j * outputs] + 0.5 * problem.free[j * outputs + 1])
    });
    assert!(differ(&found, &expected) < 1e-9 && differ(&found, &none) > 1e-4, "{found:?} {expected:?}");
}

#[test]
fn a_term_without_weight_changes_nothing_and_several_add_up() {
    let none = plan(vec![]).0;
    let nothing = plan(vec![Box::new(SteeringEffort { weight: 0.0, wheelbase: 2.9 })]).0;
    assert!(differ(&none, &nothing) < 1e-9);
    let half = || Box::new(SteeringEffort { weight: 1.0, wheelbase: 2.9 }) as Box<dyn CostTerm>;
    let twice = plan(vec![half(), half()]).0;
    let once = plan(vec![Box::new(SteeringEffort { weight: 2.0, wheelbase: 2.9 })]).0;
    assert!(differ(&once, &twice) < 1e-9);
}

#[test]
fn a_control_step_with_it_allocates_nothing() {
    let mut controller = controller(vec![Box::new(SteeringEffort { weight: 2.0, wheelbase: 2.9 })]);
    for k in 0..50 {
        let at = Measurement { x: 20.0 + 0.3 * f64::from(k), ..BESIDE };
        let allocations = allocated(|| assert!(controller.step(&at).is_ok())).0;
        assert!(k == 0 || allocations == 0, "step {k}: {allocations}");
    }
}
