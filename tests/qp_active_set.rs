//! The active-set method finds the solutions that Clarabel finds, on problems of drives and on hard ones.
//!
//! Clarabel runs with tolerances of 1e-13 here: with its usual ones its inputs are off by up to 1e-4 where the cost is
//! flat.

use crate::counting::allocated;
use proptest::prelude::*;
use rfl_mpc::control::{
    ActiveSetSolver, ClarabelSolver, Controller, ControllerParameters, FastSolver, PredictionModel, QpEnd,
    QpError, QpReport, QpShape, QpSolver, SoftBound, TrackingQp,
};
use rfl_mpc::numerics::Random;
use rfl_mpc::path::Path;
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Car, Effects, builtin};
use std::sync::Arc;

/// The problems of a drive that begins `beside` metres beside the road.
fn drive(steps: usize, beside: f64, change: impl Fn(&mut ControllerParameters)) -> Vec<TrackingQp> {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("paths/sudoku_turns.csv");
    let path = Arc::new(Path::read(&file).unwrap());
    let car = builtin("c_class").unwrap();
    let mut parameters = ControllerParameters::of_the_papers(&car);
    change(&mut parameters);
    let controller = Controller::predicting_with(parameters, path.clone(), PredictionModel::Nominal).unwrap();
    let mut car = Car::new(&car, &Effects::default(), None).unwrap();
    let start = path.at(5.0);
    let (sin, cos) = start.yaw.sin_cos();
    car.place(start.x - beside * sin, start.y + beside * cos, start.yaw + 0.1 * beside, 2.0);
    let mut closed = ClosedLoop::new(controller, car, 0.02);
    (0..steps)
        .map(|_| {
            closed.advance().unwrap();
            closed.controller().problem().clone()
        })
        .collect()
}

struct Solution {
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    report: QpReport,
}

fn solve(solver: &mut dyn QpSolver, problem: &TrackingQp) -> Result<Solution, QpError> {
    let (mut inputs, mut outputs) = (vec![0.0; problem.columns()], vec![0.0; problem.free.len()]);
    let report = solver.solve(problem, f64::INFINITY, &mut inputs, &mut outputs)?;
    Ok(Solution { inputs, outputs, report })
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The most by which inputs leave their bounds and rates.
fn largest_violation(problem: &TrackingQp, inputs: &[f64]) -> f64 {
    let shape = &problem.shape;
    let before = problem.previous.iter().chain(inputs);
    inputs.iter().zip(before).enumerate().fold(0.0, |most: f64, (column, (&input, &before))| {
        let i = column % shape.inputs;
        most.max((input - before).abs() - shape.rate_max[i])
            .max(input - shape.input_max[i])
            .max(shape.input_min[i] - input)
    })
}

/// Holds the active-set method to Clarabel on problems of one shape. Gives the share of problems in which it changed
/// the working set, and the most iterations.
fn agree(name: &str, problems: &[TrackingQp]) -> (f64, u32) {
    let mut ours = ActiveSetSolver::new(&problems[0].shape);
    let mut oracle = ClarabelSolver::exact(&problems[0]).unwrap();
    let (mut changed, mut most) = (0, 0);
    for (k, problem) in problems.iter().enumerate() {
        let expected = solve(&mut oracle, problem).unwrap();
        let found = solve(&mut ours, problem).unwrap_or_else(|error| panic!("{name}: problem {k}: {error}"));
        let (cost, least) = (found.report.objective, expected.report.objective);
        let off = largest_difference(&found.inputs, &expected.inputs)
            .max(largest_difference(&found.outputs, &expected.outputs));
        // Where a bound is met with hardly any force, Clarabel's gap of 1e-13 leaves it up to 5e-7 from the minimiser (41 of
        // 200,000 random problems: more than 2e-8). Of two feasible inputs the cheaper one is nearer.
        let nearer = || largest_violation(problem, &found.inputs) <= 1e-12 && cost < least;
        assert!(off <= 1e-7 || nearer(), "{name}: inputs or outputs of problem {k} differ by {off}");
        // Now and then Clarabel stalls before its 1e-13 (one in some thousand random problems): it has the minimiser, but less
        // surely, and its cost is held to that.
        let exact = if expected.report.end == QpEnd::Solved { 1e-10 } else { 1e-7 };
        assert!(
            (cost - least).abs() <= exact * (1.0 + least.abs()),
            "{name}: problem {k} costs {cost}, not {least}"
        );
        changed += usize::from(found.report.iterations > 1);
        most = most.max(found.report.iterations);
    }
    (changed as f64 / problems.len() as f64, most)
}

#[test]
fn drives_are_solved_like_clarabel() {
    for horizon in [2, 3, 16, 30, 60] {
        let steps = if horizon < 30 { 1000 } else { 150 };
        let problems = drive(steps, 0.0, |p| p.mpc.horizon = horizon);
        let (_, most) = agree(&format!("horizon {horizon}"), &problems);
        assert_eq!(most, 1, "an ordinary drive touches no bound");
    }
}

#[test]
fn every_rate_bound_active_is_solved_like_clarabel() {
    for horizon in [2, 16, 60] {
        let problems = drive(120, 3.0, |p| p.mpc.horizon = horizon);
        let (changed, _) = agree(&format!("beside the road, horizon {horizon}"), &problems);
        assert!(changed > 0.2, "{changed}");
    }
    // 3 m beside the road the steering turns as fast as it can from first to last.
    let mut problem = drive(1, 3.0, |p| p.mpc.steer_rate_max = 0.02).remove(0);
    problem.previous[0] = 0.1;
    let found = solve(&mut ActiveSetSolver::new(&problem.shape), &problem).unwrap();
    let rate = problem.shape.rate_max[0];
    let changes = found.inputs.windows(2).map(|pair| pair[1] - pair[0]);
    assert!(changes.into_iter().all(|change| (change.abs() - rate).abs() < 1e-12), "{:?}", found.inputs);
    agree("every rate bound", &[problem]);
}

#[test]
fn input_and_rate_bounds_together_are_solved_like_clarabel() {
    for (horizon, steps) in [(2, 800), (16, 800), (60, 250)] {
        let problems = drive(steps, 0.3, |p| {
            p.mpc.horizon = horizon;
            p.mpc.steer_rate_max = 0.1;
            p.mpc.steer_max = 0.05;
        });
        let (changed, _) = agree(&format!("weak steering, horizon {horizon}"), &problems);
        assert!(changed > 0.1, "{changed}");
    }
}

#[test]
fn soft_bounds_hold_and_yield_like_clarabel() {
    // Strong and weak linear penalties, and none: rows that hold, that yield, and that yield at once.
    for (linear, quadratic) in [(1.0, 100.0), (0.01, 1.0), (0.0, 100.0), (100.0, 1e-3), (1e4, 1e6)] {
        for horizon in [2, 16, 60] {
            let problems = drive(80, 0.3, |p| {
                p.mpc.horizon = horizon;
                p.mpc.e1_max = 0.01;
                p.mpc.slack_linear = linear;
                p.mpc.slack_quadratic = quadratic;
            });
            let (changed, _) =
                agree(&format!("penalties {linear}, {quadratic}, horizon {horizon}"), &problems);
            assert!(changed > 0.05, "{changed}");
        }
    }
}

#[test]
fn nearly_singular_costs_are_solved_like_clarabel() {
    for horizon in [2, 16, 60] {
        let problems = drive(100, 0.3, |p| {
            p.mpc.horizon = horizon;
            p.mpc.r_rate = 1e-9;
        });
        agree(&format!("cheap steering, horizon {horizon}"), &problems);
    }
}

#[test]
fn a_heavy_end_is_solved_like_clarabel() {
    for (horizon, factor) in [(2, 1e4), (16, 1e4), (60, 100.0)] {
        let problems = drive(100, 0.3, |p| {
            p.mpc.horizon = horizon;
            p.mpc.terminal_factor = factor;
        });
        agree(&format!("terminal factor {factor}, horizon {horizon}"), &problems);
    }
}

/// A problem of several inputs and outputs with random numbers, whose previous input is within its bounds.
fn random(shape: QpShape, seed: u64) -> TrackingQp {
    let mut random = Random::new(seed);
    let mut draw = |size: f64| size * (2.0 * random.uniform() - 1.0);
    let mut problem = TrackingQp::new(shape);
    let n = problem.columns();
    // What stands above the block triangle is not read.
    problem.gain.fill(f64::NAN);
    for (row, gain) in problem.gain.chunks_exact_mut(n).enumerate() {
        let reach = (row / problem.shape.outputs + 1) * problem.shape.inputs;
        gain[..reach].fill_with(|| draw(1.0));
    }
    problem.free.fill_with(|| draw(2.0));
    problem.reference.fill_with(|| draw(0.5));
    for i in 0..problem.shape.inputs {
        problem.previous[i] = problem.shape.input_max[i] * draw(1.0);
    }
    problem
}

fn two_inputs(horizon: usize, penalty: f64) -> QpShape {
    QpShape {
        horizon,
        outputs: 4,
        inputs: 2,
        output_weight: vec![1.0, 0.0, 0.3, 2.0],
        terminal_factor: 5.0,
        rate_weight: vec![0.1, 0.02],
        input_min: vec![-0.5, -2.0],
        input_max: vec![0.5, 2.0],
        rate_max: vec![0.1, 0.7],
        soft: vec![
            SoftBound { output: 1, min: -0.5, max: 0.7, quadratic: 10.0, linear: penalty },
            SoftBound { output: 2, min: -1.0, max: 0.2, quadratic: 0.5, linear: 0.1 * penalty },
        ],
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn problems_of_two_inputs_and_two_soft_outputs_are_solved_like_clarabel(
        horizon in 2_usize..14, penalty in prop_oneof![Just(0.0), 0.01..20.0], seed in any::<u64>(),
    ) {
        let problem = random(two_inputs(horizon, penalty), seed);
        agree("two inputs", &[problem]);
    }

    #[test]
    fn problems_of_no_soft_output_are_solved_like_clarabel(horizon in 2_usize..20, seed in any::<u64>()) {
        let shape = QpShape { soft: vec![], ..two_inputs(horizon, 1.0) };
        agree("no soft output", &[random(shape, seed)]);
    }
}

#[test]
fn the_same_problem_gives_the_same_bits_whatever_was_solved_before() {
    let problems: Vec<TrackingQp> = (0..20).map(|seed| random(two_inputs(10, 1.0), seed)).collect();
    let mut used = FastSolver::new(&problems[0], 50).unwrap();
    for problem in &problems {
        let fresh = solve(&mut FastSolver::new(problem, 50).unwrap(), problem).unwrap();
        let again = solve(&mut used, problem).unwrap();
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&fresh.inputs), bits(&again.inputs));
        assert_eq!(bits(&fresh.outputs), bits(&again.outputs));
    }
}

#[test]
fn nothing_is_allocated() {
    for problem in (0..20).map(|seed| random(two_inputs(10, 1.0), seed)) {
        let mut solver = FastSolver::new(&problem, 50).unwrap();
        let (mut inputs, mut outputs) = (vec![0.0; problem.columns()], vec![0.0; problem.free.len()]);
        for limit in [f64::INFINITY, 10.0] {
            let count =
                allocated(|| assert!(solver.solve(&problem, limit, &mut inputs, &mut outputs).is_ok()));
            assert_eq!(count, (0, 0));
        }
    }
}

#[test]
fn what_clarabel_refuses_is_refused_with_its_words() {
    let sound = random(two_inputs(8, 1.0), 1);
    let with = |change: &dyn Fn(&mut TrackingQp)| {
        let mut problem = sound.clone();
        change(&mut problem);
        problem
    };
    let cases = [
        with(&|p| p.free[3] = f64::NAN),
        with(&|p| p.reference[0] = f64::INFINITY),
        with(&|p| p.previous[1] = f64::NAN),
        // Output 1 has no weight and a soft bound.
        with(&|p| p.free[1] = f64::NAN),
        with(&|p| p.gain[16] = f64::NEG_INFINITY),
        with(&|p| p.previous[0] = 0.7),
        with(&|p| p.gain[0] = 1e200),
    ];
    let mut fast = FastSolver::new(&sound, 50).unwrap();
    let mut clarabel = ClarabelSolver::new(&sound, 50).unwrap();
    for (k, case) in cases.iter().enumerate() {
        let (ours, theirs) = (solve(&mut fast, case).err(), solve(&mut clarabel, case).err());
        assert!(ours.is_some() && ours == theirs, "case {k}: {ours:?}, Clarabel says {theirs:?}");
        assert!(solve(&mut ActiveSetSolver::new(&sound.shape), case).is_err(), "case {k} alone");
        assert!(solve(&mut fast, &sound).is_ok(), "the next problem is solved");
    }
}

#[test]
fn clarabel_solves_what_has_no_curvature() {
    // Nothing weighs the first input: no Cholesky factor, but a solution.
    let mut shape = two_inputs(4, 1.0);
    shape.rate_weight[0] = 0.0;
    let mut problem = random(shape, 3);
    for gain in problem.gain.chunks_exact_mut(8) {
        gain.iter_mut().step_by(2).for_each(|entry| *entry = 0.0);
    }
    assert!(matches!(
        solve(&mut ActiveSetSolver::new(&problem.shape), &problem).err(),
        Some(QpError::Numerical { .. })
    ));
    assert!(solve(&mut FastSolver::new(&problem, 50).unwrap(), &problem).is_ok());
}

#[test]
fn time_limits_are_kept() {
    let problem = random(two_inputs(8, 1.0), 1);
    let mut solver = FastSolver::new(&problem, 50).unwrap();
    let (mut inputs, mut outputs) = (vec![0.0; problem.columns()], vec![0.0; problem.free.len()]);
    let mut solve = |limit: f64| solver.solve(&problem, limit, &mut inputs, &mut outputs);
    assert_eq!(solve(0.0).unwrap_err(), QpError::TimeLimit { iterations: 0 });
    assert_eq!(solve(-1.0).unwrap_err(), QpError::TimeLimit { iterations: 0 });
    assert!(solve(10.0).is_ok());
}
