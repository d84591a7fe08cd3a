//! The active-set method, with Clarabel for the problems that it refuses.
//!
//! Most problems of a drive have few active bounds, or none: the active-set method solves them in a tenth of an
//! interior-point method's time. Clarabel solves the problems that it refuses: badly scaled, infeasible, or with too
//! many changes of the working set. The longest time is that of both. Iterations of the first are bounded
//! ([`ActiveSetSolver::iteration_limit`]), those of the second by its own limit.

use super::active_set::ActiveSetSolver;
use super::clarabel_solver::{BuildError, ClarabelSolver};
use super::tracking_qp::{QpError, QpReport, QpSolver, TrackingQp};
use std::time::Instant;

/// The solver that `mpc.solver` names, built for the shape of `typical`: 0 for [`FastSolver`], 1 for Clarabel alone.
///
/// # Errors
/// Data that Clarabel refuses.
pub fn build_solver(
    number: usize,
    typical: &TrackingQp,
    max_iterations: u32,
) -> Result<Box<dyn QpSolver>, BuildError> {
    Ok(match number {
        0 => Box::new(FastSolver::new(typical, max_iterations)?),
        _ => Box::new(ClarabelSolver::new(typical, max_iterations)?),
    })
}

/// The active-set method first, then Clarabel.
pub struct FastSolver {
    active_set: ActiveSetSolver,
    clarabel: ClarabelSolver,
}

impl FastSolver {
    /// Builds both solvers for the shape of `typical`; `max_iterations` is for Clarabel.
    ///
    /// # Errors
    /// Data that Clarabel refuses.
    pub fn new(typical: &TrackingQp, max_iterations: u32) -> Result<Self, BuildError> {
        let clarabel = ClarabelSolver::new(typical, max_iterations)?;
        Ok(Self { active_set: ActiveSetSolver::new(&typical.shape), clarabel })
    }
}

impl QpSolver for FastSolver {
    fn solve(
        &mut self,
        problem: &TrackingQp,
        time_limit: f64,
        inputs: &mut [f64],
        outputs: &mut [f64],
    ) -> Result<QpReport, QpError> {
        let begin = time_limit.is_finite().then(Instant::now);
        match self.active_set.solve(problem, time_limit, inputs, outputs) {
            Err(QpError::Numerical { .. } | QpError::Infeasible | QpError::IterationLimit { .. }) => {
                let left = begin.map_or(time_limit, |begin| time_limit - begin.elapsed().as_secs_f64());
                self.clarabel.solve(problem, left, inputs, outputs)
            }
            decided => decided,
        }
    }
}
