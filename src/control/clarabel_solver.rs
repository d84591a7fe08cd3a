//! The tracking problem for the interior-point solver Clarabel (Goulart and Chen 2024).
//!
//! Variables are `z = [U, y, s]`. The cost of all outputs is condensed onto the inputs. Only softly bounded outputs
//! appear as variables, `y = free + G U`, so that a dense row stands once for its two bounds. Rates are bidiagonal rows
//! and bounds unit rows. The solver is built once, on a typical instance, and its data are overwritten in place. This
//! takes half the time of a new solver, at a 117th of the allocations (`facts.md` of the project). Its equilibration is
//! then that of the typical instance; it affects speed, not the solution.

use super::condensed_cost::condense_cost;
use super::tracking_qp::{QpEnd, QpError, QpReport, QpShape, QpSolver, TrackingQp};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Reasons for which the solver cannot be built.
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
    /// Non-zeros of the cost's upper triangle.
    cost: Vec<f64>,
    /// `H`, a packed lower triangle by rows (its upper one by columns), and the places of its entries in `cost`.
    hessian: Vec<f64>,
    cost_places: Vec<usize>,
    /// Non-zeros of the constraint matrix.
    matrix: Vec<f64>,
    /// Places of the entries of `-G` in `matrix`, with their places in `TrackingQp::gain`.
    gain_places: Vec<(usize, usize)>,
    linear: Vec<f64>,
    rhs: Vec<f64>,
    clock: Deadline,
}

/// Numbers of variables and rows, in their order.
#[derive(Clone, Copy)]
struct Layout {
    inputs: usize,
    /// Softly bounded outputs over the horizon; as many slacks.
    bounded: usize,
}

impl Layout {
    fn of(shape: &QpShape) -> Self {
        Self { inputs: shape.horizon * shape.inputs, bounded: shape.horizon * shape.soft.len() }
    }

    fn variables(self) -> usize {
        self.inputs + 2 * self.bounded
    }

    /// First row of the rate bounds, after the equations.
    fn rates(self) -> usize {
        self.bounded
    }

    /// First row of the bounds of the inputs.
    fn bounds(self) -> usize {
        self.rates() + 2 * self.inputs
    }

    /// First row of the soft bounds.
    fn soft(self) -> usize {
        self.bounds() + 2 * self.inputs
    }

    fn rows(self) -> usize {
        self.soft() + 3 * self.bounded
    }
}

/// Deadline of the solver. Clarabel's own time limit can only be changed by replacing all settings, which allocates; a
/// termination callback that reads this does not.
#[derive(Clone)]
struct Deadline {
    begin: Instant,
    /// Nanoseconds after `begin`; `u64::MAX` for no limit.
    stop: Arc<AtomicU64>,
}

impl Deadline {
    fn new() -> Self {
        Self { begin: Instant::now(), stop: Arc::new(AtomicU64::new(u64::MAX)) }
    }

    fn start(&self, time_limit: f64) {
        let stop = if time_limit.is_finite() {
            self.begin.elapsed().as_nanos() as u64 + (time_limit.max(0.0) * 1e9) as u64
        } else {
            u64::MAX
        };
        self.stop.store(stop, Ordering::Relaxed);
    }

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
        Self::with_settings(typical, settings(max_iterations))
    }

    /// Builds a slow and exact solver as a reference for others: tolerances of 1e-13 with iterative refinement.
    ///
    /// # Errors
    /// Data that Clarabel refuses.
    pub fn exact(typical: &TrackingQp) -> Result<Self, BuildError> {
        const TOLERANCE: f64 = 1e-13;
        let settings = DefaultSettings {
            tol_gap_abs: TOLERANCE,
            tol_gap_rel: TOLERANCE,
            tol_feas: TOLERANCE,
            iterative_refinement_enable: true,
            iterative_refinement_reltol: 1e-15,
            iterative_refinement_abstol: 1e-15,
            ..settings(500)
        };
        Self::with_settings(typical, settings)
    }

    fn with_settings(typical: &TrackingQp, settings: DefaultSettings<f64>) -> Result<Self, BuildError> {
        let shape = typical.shape.clone();
        let layout = Layout::of(&shape);
        let (n_u, n_b) = (layout.inputs, layout.bounded);
        let soft_of = |k: usize| (k / shape.soft.len(), &shape.soft[k % shape.soft.len()]);

        let mut p = Triplets { entries: Vec::new() };
        let mut cost_entries = Vec::new();
        for column in 0..n_u {
            for row in 0..=column {
                cost_entries.push(p.push(row, column, 0.0));
            }
        }
        for k in 0..n_b {
            p.push(n_u + k, n_u + k, 0.0);
            p.push(n_u + n_b + k, n_u + n_b + k, soft_of(k).1.quadratic);
        }
        let (mut p, place) = p.compress(layout.variables(), layout.variables());
        let cost_places: Vec<usize> = cost_entries.into_iter().map(|entry| place[entry]).collect();

        let mut a = Triplets { entries: Vec::new() };
        let mut gain_entries = Vec::new();
        for k in 0..n_b {
            let (j, soft) = soft_of(k);
            for column in 0..(j + 1) * shape.inputs {
                let at = (j * shape.outputs + soft.output) * n_u + column;
                gain_entries.push((a.push(k, column, -typical.gain[at]), at));
            }
            a.push(k, n_u + k, 1.0);
        }
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            for column in 0..n_u {
                let rate = layout.rates() + side * n_u + column;
                if column >= shape.inputs {
                    a.push(rate, column - shape.inputs, -sign);
                }
                a.push(rate, column, sign);
                a.push(layout.bounds() + side * n_u + column, column, sign);
            }
            for k in 0..n_b {
                let row = layout.soft() + side * n_b + k;
                a.push(row, n_u + k, sign);
                a.push(row, n_u + n_b + k, -1.0);
            }
        }
        for k in 0..n_b {
            a.push(layout.soft() + 2 * n_b + k, n_u + n_b + k, -1.0);
        }
        let (a, place) = a.compress(layout.rows(), layout.variables());
        let gain_places = gain_entries.into_iter().map(|(entry, at)| (place[entry], at)).collect();

        let mut linear = vec![0.0; layout.variables()];
        let mut rhs = vec![0.0; layout.rows()];
        for k in 0..n_b {
            let (_, soft) = soft_of(k);
            linear[n_u + n_b + k] = soft.linear;
            rhs[layout.soft() + k] = soft.max;
            rhs[layout.soft() + n_b + k] = -soft.min;
        }
        let mut hessian = vec![0.0; cost_places.len()];
        condense_cost(typical, &mut hessian, &mut linear[..n_u]);
        for (&place, &entry) in cost_places.iter().zip(&hessian) {
            p.nzval[place] = entry;
        }
        write_rhs(typical, &mut rhs);

        let cones = [SupportedConeT::ZeroConeT(n_b), SupportedConeT::NonnegativeConeT(layout.rows() - n_b)];
        let mut solver = DefaultSolver::new(&p, &linear, &a, &rhs, &cones, settings)?;
        let clock = Deadline::new();
        let watch = clock.clone();
        solver.set_termination_callback(move |_: &_| watch.is_over());
        Ok(Self {
            solver,
            shape,
            cost: p.nzval,
            hessian,
            cost_places,
            matrix: a.nzval,
            gain_places,
            linear,
            rhs,
            clock,
        })
    }
}

fn settings(max_iterations: u32) -> DefaultSettings<f64> {
    DefaultSettingsBuilder::default()
        .verbose(false)
        .max_iter(max_iterations)
        .presolve_enable(false)
        .iterative_refinement_enable(false)
        .direct_solve_method("qdldl".to_string())
        .max_threads(1)
        .build()
        .expect("the settings are constants within their ranges")
}

/// Writes the changing right-hand side of a step.
fn write_rhs(problem: &TrackingQp, rhs: &mut [f64]) {
    let shape = &problem.shape;
    let layout = Layout::of(shape);
    for (k, value) in rhs[..layout.bounded].iter_mut().enumerate() {
        let (j, soft) = (k / shape.soft.len(), &shape.soft[k % shape.soft.len()]);
        *value = problem.free[j * shape.outputs + soft.output];
    }
    for column in 0..layout.inputs {
        let i = column % shape.inputs;
        let before = if column < shape.inputs { problem.previous[i] } else { 0.0 };
        rhs[layout.rates() + column] = shape.rate_max[i] + before;
        rhs[layout.rates() + layout.inputs + column] = shape.rate_max[i] - before;
        rhs[layout.bounds() + column] = shape.input_max[i];
        rhs[layout.bounds() + layout.inputs + column] = -shape.input_min[i];
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
        crate::invariant!(problem.shape.is_like(&self.shape), "a solver serves one shape");
        for &(place, at) in &self.gain_places {
            self.matrix[place] = -problem.gain[at];
        }
        condense_cost(problem, &mut self.hessian, &mut self.linear[..problem.columns()]);
        for (&place, &entry) in self.cost_places.iter().zip(&self.hessian) {
            self.cost[place] = entry;
        }
        write_rhs(problem, &mut self.rhs);
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        if !(finite(&self.cost) && finite(&self.matrix) && finite(&self.linear) && finite(&self.rhs)) {
            return Err(QpError::Numerical { iterations: 0 });
        }
        // The pattern is the one that the solver was built with, so updates cannot be refused.
        let updated = self
            .solver
            .update_P(&self.cost)
            .and_then(|()| self.solver.update_A(&self.matrix))
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
        problem.predict(inputs, outputs);
        Ok(QpReport { end, iterations, objective: solution.obj_val })
    }
}
