//! The tracking problem for the interior-point solver Clarabel (Goulart and Chen 2024).
//!
//! Variables are `z = [U, y, s]` with `y = free + G U` as equations, so that each dense row of `G` stands once;
//! rates are bidiagonal rows and bounds unit rows. The solver is built once, on a typical instance, and its data
//! are overwritten in place: half the time of a new solver, at a 117th of the allocations (`facts.md` of the
//! project). Its equilibration is then that of the typical instance; it affects speed, not the solution.

use super::tracking_qp::{QpEnd, QpError, QpReport, QpShape, QpSolver, TrackingQp};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Why the solver cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// Clarabel refused the problem.
    #[error("the QP of the controller cannot be set up: {0}; check weights, bounds and horizon")]
    Refused(#[from] clarabel::solver::SolverError),
}

/// Clarabel behind [`QpSolver`].
pub struct ClarabelSolver {
    solver: DefaultSolver<f64>,
    shape: QpShape,
    /// Non-zeros of the constraint matrix; those of `G` change from step to step.
    matrix: Vec<f64>,
    /// Where in `matrix` the entries of `-G` stand, with their place in `TrackingQp::gain`.
    gain_places: Vec<(usize, usize)>,
    linear: Vec<f64>,
    rhs: Vec<f64>,
    /// First row of the rate bounds.
    rate_row: usize,
    clock: Clock,
}

/// When the solver has to stop. Clarabel's own time limit can only be changed by replacing all settings, which
/// allocates; a termination callback that reads this does not.
#[derive(Clone)]
struct Clock {
    begin: Instant,
    /// Nanoseconds after `begin`; `u64::MAX` for no limit.
    stop: Arc<AtomicU64>,
}

impl Clock {
    fn new() -> Self {
        Self { begin: Instant::now(), stop: Arc::new(AtomicU64::new(u64::MAX)) }
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    fn start(&self, time_limit: f64) {
        let stop = if time_limit.is_finite() {
            self.begin.elapsed().as_nanos() as u64 + (time_limit.max(0.0) * 1e9) as u64
        } else {
            u64::MAX
        };
        self.stop.store(stop, Ordering::Relaxed);
    }

    #[allow(clippy::cast_possible_truncation)]
    fn is_over(&self) -> bool {
        let stop = self.stop.load(Ordering::Relaxed);
        stop != u64::MAX && self.begin.elapsed().as_nanos() as u64 >= stop
    }
}

/// Collects a sparse matrix column by column.
struct Triplets {
    entries: Vec<(usize, usize, f64)>,
}

impl Triplets {
    fn push(&mut self, row: usize, column: usize, value: f64) -> usize {
        self.entries.push((row, column, value));
        self.entries.len() - 1
    }

    /// The matrix, and for each pushed entry its place among the non-zeros. Explicit zeros stay, so that the
    /// pattern does not depend on the values.
    fn compress(self, rows: usize, columns: usize) -> (CscMatrix<f64>, Vec<usize>) {
        let mut order: Vec<usize> = (0..self.entries.len()).collect();
        order.sort_by_key(|&k| (self.entries[k].1, self.entries[k].0));
        let mut place = vec![0; order.len()];
        let mut colptr = vec![0; columns + 1];
        let (mut rowval, mut nzval) = (Vec::with_capacity(order.len()), Vec::with_capacity(order.len()));
        for (position, &k) in order.iter().enumerate() {
            let (row, column, value) = self.entries[k];
            place[k] = position;
            colptr[column + 1] += 1;
            rowval.push(row);
            nzval.push(value);
        }
        for column in 0..columns {
            colptr[column + 1] += colptr[column];
        }
        (CscMatrix::new(rows, columns, colptr, rowval, nzval), place)
    }
}

impl ClarabelSolver {
    /// Builds the solver for the shape of `typical`, scaled for its data.
    ///
    /// # Errors
    /// Data that Clarabel refuses.
    pub fn new(typical: &TrackingQp, max_iterations: u32) -> Result<Self, BuildError> {
        let shape = typical.shape.clone();
        let (n_u, n_y) = (typical.columns(), shape.horizon * shape.outputs);
        let n_s = shape.horizon * shape.soft.len();
        let variables = n_u + n_y + n_s;

        let mut p = Triplets { entries: Vec::new() };
        for j in 0..shape.horizon {
            for i in 0..shape.inputs {
                // r (u_j - u_{j-1})^2 summed: 2 r on the diagonal but for the last step, -r beside it.
                let column = j * shape.inputs + i;
                let factor = if j + 1 == shape.horizon { 1.0 } else { 2.0 };
                if j > 0 {
                    p.push(column - shape.inputs, column, -shape.rate_weight[i]);
                }
                p.push(column, column, factor * shape.rate_weight[i]);
            }
        }
        for j in 0..shape.horizon {
            for i in 0..shape.outputs {
                let column = n_u + j * shape.outputs + i;
                p.push(column, column, shape.weight(j, i));
            }
        }
        for k in 0..n_s {
            let column = n_u + n_y + k;
            p.push(column, column, shape.soft[k % shape.soft.len()].quadratic);
        }
        let (p, _) = p.compress(variables, variables);

        let mut a = Triplets { entries: Vec::new() };
        let mut gain_entries = Vec::new();
        for row in 0..n_y {
            let reach = (row / shape.outputs + 1) * shape.inputs;
            for column in 0..reach {
                let at = row * n_u + column;
                gain_entries.push((a.push(row, column, -typical.gain[at]), at));
            }
            a.push(row, n_u + row, 1.0);
        }
        let mut row = n_y;
        let rate_row = row;
        for sign in [1.0, -1.0] {
            for column in 0..n_u {
                if column >= shape.inputs {
                    a.push(row, column - shape.inputs, -sign);
                }
                a.push(row, column, sign);
                row += 1;
            }
        }
        for sign in [1.0, -1.0] {
            for column in 0..n_u {
                a.push(row, column, sign);
                row += 1;
            }
        }
        for sign in [1.0, -1.0] {
            for k in 0..n_s {
                let (j, soft) = (k / shape.soft.len(), &shape.soft[k % shape.soft.len()]);
                a.push(row, n_u + j * shape.outputs + soft.output, sign);
                a.push(row, n_u + n_y + k, -1.0);
                row += 1;
            }
        }
        for k in 0..n_s {
            a.push(row, n_u + n_y + k, -1.0);
            row += 1;
        }
        let rows = row;
        let (a, place) = a.compress(rows, variables);
        let gain_places = gain_entries.iter().map(|&(entry, at)| (place[entry], at)).collect();

        let mut linear = vec![0.0; variables];
        let mut rhs = vec![0.0; rows];
        for k in 0..n_s {
            linear[n_u + n_y + k] = shape.soft[k % shape.soft.len()].linear;
        }
        let bounds = rate_row + 2 * n_u;
        for column in 0..n_u {
            let i = column % shape.inputs;
            rhs[bounds + column] = shape.input_max[i];
            rhs[bounds + n_u + column] = -shape.input_min[i];
        }
        for k in 0..n_s {
            let soft = &shape.soft[k % shape.soft.len()];
            rhs[bounds + 2 * n_u + k] = soft.max;
            rhs[bounds + 2 * n_u + n_s + k] = -soft.min;
        }
        write_vectors(typical, rate_row, &mut linear, &mut rhs);

        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .max_iter(max_iterations)
            .presolve_enable(false)
            .iterative_refinement_enable(false)
            .direct_solve_method("qdldl".to_string())
            .max_threads(1)
            .build()
            .expect("the settings are constants within their ranges");
        let cones = [SupportedConeT::ZeroConeT(n_y), SupportedConeT::NonnegativeConeT(rows - n_y)];
        let mut solver = DefaultSolver::new(&p, &linear, &a, &rhs, &cones, settings)?;
        let clock = Clock::new();
        let watch = clock.clone();
        solver.set_termination_callback(move |_: &_| watch.is_over());
        Ok(Self { solver, shape, matrix: a.nzval, gain_places, linear, rhs, rate_row, clock })
    }
}

/// Writes what changes from step to step into the linear cost and the right-hand side.
fn write_vectors(problem: &TrackingQp, rate_row: usize, linear: &mut [f64], rhs: &mut [f64]) {
    let shape = &problem.shape;
    let (n_u, n_y) = (problem.columns(), problem.free.len());
    for i in 0..shape.inputs {
        linear[i] = -shape.rate_weight[i] * problem.previous[i];
    }
    for row in 0..n_y {
        linear[n_u + row] = -shape.weight(row / shape.outputs, row % shape.outputs) * problem.reference[row];
        rhs[row] = problem.free[row];
    }
    for column in 0..n_u {
        let i = column % shape.inputs;
        let before = if column < shape.inputs { problem.previous[i] } else { 0.0 };
        rhs[rate_row + column] = shape.rate_max[i] + before;
        rhs[rate_row + n_u + column] = shape.rate_max[i] - before;
    }
}

impl QpSolver for ClarabelSolver {
    fn solve(
        &mut self,
        problem: &TrackingQp,
        time_limit: f64,
        inputs: &mut [f64],
        outputs: &mut [f64],
    ) -> Result<QpReport, QpError> {
        debug_assert_eq!(problem.shape, self.shape, "a solver serves one shape");
        for &(place, at) in &self.gain_places {
            self.matrix[place] = -problem.gain[at];
        }
        write_vectors(problem, self.rate_row, &mut self.linear, &mut self.rhs);
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        if !(finite(&self.matrix) && finite(&self.linear) && finite(&self.rhs)) {
            return Err(QpError::Numerical { iterations: 0 });
        }
        // The pattern is the one that the solver was built with, so updates cannot be refused.
        let updated = self
            .solver
            .update_A(&self.matrix)
            .and_then(|()| self.solver.update_q(&self.linear))
            .and_then(|()| self.solver.update_b(&self.rhs));
        if updated.is_err() {
            return Err(QpError::Numerical { iterations: 0 });
        }
        self.clock.start(time_limit);
        self.solver.solve();
        let solution = &self.solver.solution;
        let iterations = solution.iterations;
        let end = match solution.status {
            SolverStatus::Solved => QpEnd::Solved,
            SolverStatus::AlmostSolved => QpEnd::ReducedAccuracy,
            SolverStatus::MaxIterations => return Err(QpError::IterationLimit { iterations }),
            SolverStatus::MaxTime | SolverStatus::CallbackTerminated => {
                return Err(QpError::TimeLimit { iterations });
            }
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                return Err(QpError::Infeasible);
            }
            _ => return Err(QpError::Numerical { iterations }),
        };
        inputs.copy_from_slice(&solution.x[..inputs.len()]);
        outputs.copy_from_slice(&solution.x[inputs.len()..inputs.len() + outputs.len()]);
        Ok(QpReport { end, iterations, objective: solution.obj_val })
    }
}
