//! The solution of the tracking QP is optimal: certified by its own KKT conditions, found without the solver.
//!
//! The problem is convex, so a point is the minimum if and only if the gradient of the cost is a combination of
//! the active constraints' normals with multipliers of the right sign. The multipliers are found here by
//! non-negative least squares on the inputs alone; nothing of the solver's dual solution is used.

use proptest::prelude::*;
use rfl_mpc::control::{ClarabelSolver, QpError, QpShape, QpSolver, SoftBound, TrackingQp, condense};
use rfl_mpc::nominal::ContinuousErrorModel;
use rfl_mpc::vehicle::SingleTrack;
use nalgebra::Vector4;

const CAR: SingleTrack =
    SingleTrack { mass: 1400.0, yaw_inertia: 1800.0, lf: 1.2, lr: 1.5, cf: 120e3, cr: 130e3 };

fn shape(horizon: usize) -> QpShape {
    QpShape {
        horizon,
        outputs: 2,
        inputs: 1,
        output_weight: vec![1.0, 0.5],
        terminal_factor: 3.0,
        rate_weight: vec![25.0],
        input_min: vec![-0.5],
        input_max: vec![0.5],
        rate_max: vec![0.02],
        soft: vec![SoftBound { output: 0, min: -0.3, max: 0.3, quadratic: 50.0, linear: 2.0 }],
    }
}

fn problem(horizon: usize, start: [f64; 4], curvature: f64, speed: f64, previous: f64) -> TrackingQp {
    let mut problem = TrackingQp::new(shape(horizon));
    let model = ContinuousErrorModel::new(&CAR, speed).unwrap().discretise(0.02);
    let disturbance = model.d * (speed * curvature);
    condense(&model.a, &model.b, &Vector4::from(start), |_| disturbance, &[0, 2], &mut problem);
    problem.previous[0] = previous;
    problem
}

/// Largest component of the cost's gradient that no admissible multiplier explains, relative to the gradient's
/// own scale; and the largest violation of a hard bound.
fn kkt_residual(problem: &TrackingQp, u: &[f64]) -> (f64, f64) {
    let shape = &problem.shape;
    let n = u.len();
    let rows = problem.free.len();
    let y: Vec<f64> = (0..rows)
        .map(|row| problem.free[row] + (0..n).map(|m| problem.gain[row * n + m] * u[m]).sum::<f64>())
        .collect();
    let mut gradient = vec![0.0; n];
    let mut add = |normal: &dyn Fn(usize) -> f64, factor: f64| {
        for (m, value) in gradient.iter_mut().enumerate() {
            *value += factor * normal(m);
        }
    };
    // Normals with the range of their multipliers: hard bounds [0, inf), kinks of the soft bounds [0, linear].
    let mut normals: Vec<(Vec<f64>, f64)> = Vec::new();
    let tolerance = 1e-6;
    for row in 0..rows {
        let (j, i) = (row / shape.outputs, row % shape.outputs);
        let along = |m: usize| problem.gain[row * n + m];
        add(&along, shape.weight(j, i) * (y[row] - problem.reference[row]));
        for soft in shape.soft.iter().filter(|soft| soft.output == i) {
            for (sign, excess) in [(1.0, y[row] - soft.max), (-1.0, soft.min - y[row])] {
                if excess > tolerance {
                    add(&along, sign * (soft.quadratic * excess + soft.linear));
                } else if excess > -tolerance {
                    normals.push(((0..n).map(|m| sign * along(m)).collect(), soft.linear));
                }
            }
        }
    }
    let mut violation = 0.0_f64;
    for j in 0..n {
        let before = if j == 0 { problem.previous[0] } else { u[j - 1] };
        let change = u[j] - before;
        let rate = |m: usize| f64::from(u8::from(m == j)) - f64::from(u8::from(m + 1 == j));
        add(&rate, shape.rate_weight[0] * change);
        let unit = |m: usize| f64::from(u8::from(m == j));
        for (value, limit, normal) in [
            (change, shape.rate_max[0], &rate as &dyn Fn(usize) -> f64),
            (u[j], shape.input_max[0], &unit),
        ] {
            for sign in [1.0, -1.0] {
                let slack = limit - sign * value;
                violation = violation.max(-slack);
                if slack < tolerance {
                    normals.push(((0..n).map(|m| sign * normal(m)).collect(), f64::INFINITY));
                }
            }
        }
    }
    let scale = gradient.iter().map(|value| value.abs()).fold(1.0, f64::max);
    // Coordinate descent on || gradient + sum lambda normal ||^2.
    let mut residual = gradient;
    let mut lambda = vec![0.0; normals.len()];
    for _ in 0..20_000 {
        for (k, (normal, limit)) in normals.iter().enumerate() {
            let square: f64 = normal.iter().map(|value| value * value).sum();
            if square < 1e-30 {
                continue;
            }
            let slope: f64 = normal.iter().zip(&residual).map(|(a, b)| a * b).sum();
            let next = (lambda[k] - slope / square).clamp(0.0, *limit);
            for (value, along) in residual.iter_mut().zip(normal) {
                *value += (next - lambda[k]) * along;
            }
            lambda[k] = next;
        }
    }
    (residual.iter().map(|value| value.abs()).fold(0.0, f64::max) / scale, violation)
}

fn solve(solver: &mut ClarabelSolver, problem: &TrackingQp) -> Result<Vec<f64>, QpError> {
    let (mut inputs, mut outputs) = (vec![0.0; problem.columns()], vec![0.0; problem.free.len()]);
    solver.solve(problem, f64::INFINITY, &mut inputs, &mut outputs)?;
    let n = inputs.len();
    for (row, output) in outputs.iter().enumerate() {
        let expected =
            problem.free[row] + (0..n).map(|m| problem.gain[row * n + m] * inputs[m]).sum::<f64>();
        assert!((output - expected).abs() < 1e-6, "output {row} is {output}, the inputs give {expected}");
    }
    Ok(inputs)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn solutions_satisfy_the_kkt_conditions(
        e1 in -1.0..1.0, e1_rate in -1.0..1.0, e2 in -0.3..0.3, e2_rate in -0.5..0.5,
        curvature in -0.1..0.1, speed in 2.0..25.0, previous in -0.5..0.5,
    ) {
        // The solver is scaled for another problem than the one it solves, as in the closed loop.
        let typical = problem(16, [0.1, 0.0, 0.05, 0.0], 0.0, 10.0, 0.0);
        let mut solver = ClarabelSolver::new(&typical, 50).unwrap();
        let problem = problem(16, [e1, e1_rate, e2, e2_rate], curvature, speed, previous);
        let inputs = solve(&mut solver, &problem).unwrap();
        let (residual, violation) = kkt_residual(&problem, &inputs);
        prop_assert!(violation < 1e-7, "bounds are violated by {violation}");
        prop_assert!(residual < 2e-5, "KKT residual {residual}");
    }
}

#[test]
fn all_rate_bounds_active_is_solved() {
    let problem = problem(16, [3.0, 1.0, 0.5, 0.5], 0.1, 15.0, 0.0);
    let mut solver = ClarabelSolver::new(&problem, 50).unwrap();
    let inputs = solve(&mut solver, &problem).unwrap();
    assert!(inputs.windows(2).take(8).all(|pair| (pair[0] - pair[1] - 0.02).abs() < 1e-6), "{inputs:?}");
}

#[test]
fn an_input_out_of_reach_is_called_infeasible() {
    let typical = problem(16, [0.0; 4], 0.0, 10.0, 0.0);
    let mut solver = ClarabelSolver::new(&typical, 50).unwrap();
    let far = problem(16, [0.0; 4], 0.0, 10.0, 0.7);
    assert_eq!(solve(&mut solver, &far).unwrap_err(), QpError::Infeasible);
    // The solver serves the next problem as if nothing had happened.
    assert!(solve(&mut solver, &typical).is_ok());
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let typical = problem(16, [0.0; 4], 0.0, 10.0, 0.0);
    let mut solver = ClarabelSolver::new(&typical, 50).unwrap();
    let mut bad = typical.clone();
    bad.free[3] = f64::NAN;
    assert_eq!(solve(&mut solver, &bad).unwrap_err(), QpError::Numerical { iterations: 0 });
    assert!(solve(&mut solver, &typical).is_ok());
}

#[test]
fn a_time_limit_of_zero_is_reported() {
    let typical = problem(16, [0.1, 0.0, 0.0, 0.0], 0.0, 10.0, 0.0);
    let mut solver = ClarabelSolver::new(&typical, 50).unwrap();
    let (mut inputs, mut outputs) = (vec![0.0; 16], vec![0.0; 32]);
    let end = solver.solve(&typical, 0.0, &mut inputs, &mut outputs);
    assert!(matches!(end, Err(QpError::TimeLimit { .. })), "{end:?}");
}

#[test]
fn the_same_problem_gives_the_same_bits_whatever_was_solved_before() {
    let typical = problem(16, [0.1, 0.0, 0.05, 0.0], 0.0, 10.0, 0.0);
    let other = problem(16, [0.6, -0.2, 0.1, 0.1], 0.05, 8.0, 0.2);
    let mut fresh = ClarabelSolver::new(&typical, 50).unwrap();
    let expected = solve(&mut fresh, &other).unwrap();
    let mut used = ClarabelSolver::new(&typical, 50).unwrap();
    for curvature in [0.0, 0.02, -0.05] {
        solve(&mut used, &problem(16, [0.3, 0.1, 0.0, 0.0], curvature, 12.0, 0.1)).unwrap();
    }
    assert_eq!(solve(&mut used, &other).unwrap(), expected);
}
