//! The solution of the tracking QP is optimal: certified by weak duality, without the solver's own multipliers.
//!
//! Written in `z = [U, s]` the problem is `min 1/2 z'Hz + f'z` under `C z <= d` with `H` positive definite. For ANY
//! multipliers `l >= 0`, a feasible `z` costs at most
//!
//! ```text
//!     gap(l) = 1/2 r' H^-1 r + l' (d - C z),    r = H z + f + C' l
//! ```
//!
//! more than the minimum. Coordinate descent on `gap` here finds multipliers that prove the solution good.

use nalgebra::{DMatrix, DVector, Vector4};
use proptest::prelude::*;
use rfl_mpc::control::{
    ActiveSetSolver, Affine, ClarabelSolver, HorizonModel, Propagation, QpError, QpShape, QpSolver,
    SoftBound, TrackingQp, condense,
};
use rfl_mpc::nominal::ContinuousErrorModel;
use rfl_mpc::vehicle::SingleTrack;

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
    let mut affine = Affine::new(horizon, 0);
    affine.known.fill(disturbance);
    let linear = HorizonModel { a: &model.a, b: &model.b };
    let start = Vector4::from(start);
    condense(linear, &start, &mut affine, &[], Propagation::default(), &[0, 2], &mut problem);
    problem.previous[0] = previous;
    problem
}

/// The problem in `z = [U, s]`: `min 1/2 z'Hz + f'z` under `C z <= d`, and the point that belongs to the inputs.
struct Dense {
    h: DMatrix<f64>,
    f: DVector<f64>,
    c: DMatrix<f64>,
    d: DVector<f64>,
    z: DVector<f64>,
}

fn dense(problem: &TrackingQp, u: &[f64]) -> Dense {
    let shape = &problem.shape;
    let (n, soft) = (u.len(), &shape.soft[0]);
    let gain = DMatrix::from_row_slice(problem.free.len(), n, &problem.gain);
    let weight = DMatrix::from_diagonal(&DVector::from_fn(gain.nrows(), |row, _| {
        shape.weight(row / shape.outputs, row % shape.outputs)
    }));
    let change = DMatrix::from_fn(n, n, |j, m| f64::from(u8::from(m == j)) - f64::from(u8::from(m + 1 == j)));
    let mut before = DVector::zeros(n);
    before[0] = problem.previous[0];
    let error = DVector::from_fn(gain.nrows(), |row, _| problem.free[row] - problem.reference[row]);

    let mut h = DMatrix::zeros(2 * n, 2 * n);
    h.view_mut((0, 0), (n, n)).copy_from(
        &(gain.transpose() * &weight * &gain + change.transpose() * &change * shape.rate_weight[0]),
    );
    let mut f = DVector::from_element(2 * n, soft.linear);
    f.rows_mut(0, n).copy_from(
        &(gain.transpose() * &weight * error - change.transpose() * &before * shape.rate_weight[0]),
    );
    let (mut c, mut d) = (DMatrix::zeros(7 * n, 2 * n), DVector::zeros(7 * n));
    let mut z = DVector::zeros(2 * n);
    for j in 0..n {
        h[(n + j, n + j)] = soft.quadratic;
        let row = j * shape.outputs + soft.output;
        let y = problem.free[row] + (gain.row(row) * DVector::from_row_slice(u))[0];
        z[j] = u[j];
        z[n + j] = (y - soft.max).max(soft.min - y).max(0.0);
        for (k, sign) in [1.0, -1.0].into_iter().enumerate() {
            c.view_mut((k * n + j, 0), (1, n)).copy_from(&(change.row(j) * sign));
            d[k * n + j] = shape.rate_max[0] + sign * before[j];
            c[((2 + k) * n + j, j)] = sign;
            d[(2 + k) * n + j] = if k == 0 { shape.input_max[0] } else { -shape.input_min[0] };
            c.view_mut(((4 + k) * n + j, 0), (1, n)).copy_from(&(gain.row(row) * sign));
            c[((4 + k) * n + j, n + j)] = -1.0;
            d[(4 + k) * n + j] = if k == 0 { soft.max } else { -soft.min } - sign * problem.free[row];
        }
        c[(6 * n + j, n + j)] = -1.0;
    }
    Dense { h, f, c, d, z }
}

/// Upper bound on how much more the inputs cost than the optimum, relative to the cost (the solver's tolerance is
/// relative, too); and the largest violation of a bound.
fn suboptimality(problem: &TrackingQp, u: &[f64]) -> (f64, f64) {
    let Dense { h, f, c, d, z } = dense(problem, u);
    let slack = d - &c * &z;
    let inverse = h.clone().cholesky().expect("the cost is strictly convex").inverse();
    let scale = 1.0 + (0.5 * (z.transpose() * &h * &z)[0] + f.dot(&z)).abs();
    let gradient = &h * &z + f;
    let k = &c * &inverse * c.transpose();
    let constant = &c * &inverse * &gradient + &slack;
    let mut lambda: DVector<f64> = DVector::zeros(slack.len());
    // Gradient of the gap along the multipliers.
    let mut slope = constant.clone();
    let mut gap = f64::INFINITY;
    for _ in 0..20_000 {
        for i in 0..lambda.len() {
            let next = (lambda[i] - slope[i] / k[(i, i)]).max(0.0);
            let step = next - lambda[i];
            if step != 0.0 {
                slope.axpy(step, &k.column(i), 1.0);
                lambda[i] = next;
            }
        }
        let r = &gradient + c.transpose() * &lambda;
        gap = 0.5 * (r.transpose() * &inverse * r)[0] + lambda.dot(&slack);
        if gap < 1e-9 * scale {
            break;
        }
    }
    (gap / scale, -slack.min())
}

fn solve(solver: &mut dyn QpSolver, problem: &TrackingQp) -> Result<Vec<f64>, QpError> {
    let (mut inputs, mut outputs) = (vec![0.0; problem.columns()], vec![0.0; problem.free.len()]);
    solver.solve(problem, f64::INFINITY, &mut inputs, &mut outputs)?;
    let n = inputs.len();
    for (row, output) in outputs.iter().enumerate() {
        let expected = problem.free[row] + (0..n).map(|m| problem.gain[row * n + m] * inputs[m]).sum::<f64>();
        assert!((output - expected).abs() < 1e-6, "output {row} is {output}, the inputs give {expected}");
    }
    Ok(inputs)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn solutions_are_optimal(
        e1 in -1.0..1.0, e1_rate in -1.0..1.0, e2 in -0.3..0.3, e2_rate in -0.5..0.5,
        curvature in -0.1..0.1, speed in 2.0..25.0, previous in -0.5..0.5,
    ) {
        // The solver is scaled for another problem than the one it solves, as in the closed loop.
        let typical = problem(16, [0.1, 0.0, 0.05, 0.0], 0.0, 10.0, 0.0);
        let mut solver = ClarabelSolver::new(&typical, 50).unwrap();
        let problem = problem(16, [e1, e1_rate, e2, e2_rate], curvature, speed, previous);
        let mut active_set = ActiveSetSolver::new(&problem.shape);
        for solver in [&mut solver as &mut dyn QpSolver, &mut active_set] {
            let inputs = solve(solver, &problem).unwrap();
            let (gap, violation) = suboptimality(&problem, &inputs);
            prop_assert!(violation < 1e-7, "bounds are violated by {violation}");
            prop_assert!(gap < 1e-7, "the inputs may cost {gap} more than the optimum, relative to the cost");
        }
    }
}

#[test]
fn the_certificate_has_teeth() {
    let problem = problem(16, [0.4, 0.1, 0.05, 0.0], 0.02, 10.0, 0.0);
    let mut solver = ClarabelSolver::new(&problem, 50).unwrap();
    let inputs = solve(&mut solver, &problem).unwrap();
    // A step of one percent from the solution towards another feasible point, holding the input.
    let worse: Vec<f64> = inputs.iter().map(|u| 0.99 * u + 0.01 * problem.previous[0]).collect();
    let (best, worse) = (suboptimality(&problem, &inputs).0, suboptimality(&problem, &worse).0);
    assert!(best < 1e-7 && worse > 1e-5, "{best} {worse}");
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
