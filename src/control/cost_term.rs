//! Terms of the lateral cost beside those of the states and of the steering rate.
//!
//! A term is one more output of the horizon with a weight:
//!
//! ```text
//! sum_j 1/2 w (y_j - ref_j)^2,     y_j = free_j + sum_{k <= j} gain_jk u_k
//! ```
//!
//! The steering itself is such an output, and so is any sum of states, as each of them is known in this form. The problem
//! stays the quadratic program of [`TrackingQp`], for every prediction model and solver.

use super::clarabel_solver::BuildError;
use super::fast_solver::build_solver;
use super::parameters::MpcParameters;
use super::tracking_qp::{QpError, QpReport, QpSolver, TrackingQp};

/// One step of the horizon, as a cost term sees it.
#[derive(Debug, Clone, Copy)]
pub struct HorizonStep<'a> {
    /// Number of the step, from 0; `u_0` to `u_step` act on what stands at its end.
    pub step: usize,
    /// Speed at the vehicle, m/s.
    pub speed: f64,
    /// Curvature of the road in the step, 1/m.
    pub curvature: f64,
    /// Steering command in force, rad.
    pub previous: f64,
    problem: &'a TrackingQp,
    tracked: &'a [usize],
}

impl<'a> HorizonStep<'a> {
    /// The state of a number at the end of the step: its value without steering, and the effect of each command up to this
    /// step, per rad. None for a state without weight and bound.
    #[must_use]
    pub fn state(&self, number: usize) -> Option<(f64, &'a [f64])> {
        let place = self.tracked.iter().position(|&state| state == number)?;
        let row = self.step * self.tracked.len() + place;
        Some((self.problem.free[row], &self.problem.gain[row * self.problem.columns()..][..=self.step]))
    }
}

/// A term of the cost.
pub trait CostTerm: Send {
    /// Weight at a speed in m/s, not negative.
    fn weight(&self, speed: f64) -> f64;

    /// The output at the end of a step: writes the effect of each command up to this step, per rad (`gain` comes with
    /// zeros), and gives its value without steering and its reference.
    fn output(&self, step: &HorizonStep<'_>, gain: &mut [f64]) -> [f64; 2];
}

/// The problem with the outputs of all terms behind those of the states.
struct WideProblem {
    terms: Vec<Box<dyn CostTerm>>,
    problem: TrackingQp,
    speed: f64,
    curvature: Vec<f64>,
}

/// All terms, with a solver for the problem that has them.
pub struct CostTerms {
    wide: WideProblem,
    solver: Box<dyn QpSolver>,
    outputs: Vec<f64>,
}

impl WideProblem {
    fn new(terms: Vec<Box<dyn CostTerm>>, narrow: &TrackingQp) -> Self {
        let mut shape = narrow.shape.clone();
        shape.outputs += terms.len();
        shape.output_weight.extend(terms.iter().map(|_| 0.0));
        let curvature = vec![0.0; shape.horizon];
        Self { terms, problem: TrackingQp::new(shape), speed: 0.0, curvature }
    }

    /// Writes the problem with all terms; `tracked` are the states that are outputs of the one without.
    fn widen(&mut self, narrow: &TrackingQp, tracked: &[usize]) {
        let Self { terms, problem, speed, curvature } = self;
        let (of_states, all, n) = (narrow.shape.outputs, problem.shape.outputs, narrow.columns());
        let shape = &mut problem.shape;
        shape.output_weight[..of_states].copy_from_slice(&narrow.shape.output_weight);
        for (weight, term) in shape.output_weight[of_states..].iter_mut().zip(&*terms) {
            *weight = term.weight(*speed);
        }
        shape.rate_weight.copy_from_slice(&narrow.shape.rate_weight);
        shape.rate_max.copy_from_slice(&narrow.shape.rate_max);
        shape.input_min.copy_from_slice(&narrow.shape.input_min);
        shape.input_max.copy_from_slice(&narrow.shape.input_max);
        problem.previous.copy_from_slice(&narrow.previous);
        problem.free_increments.copy_from_slice(&narrow.free_increments);
        // A term's effects may differ from step to step.
        problem.shift_invariant = false;
        for step in 0..narrow.shape.horizon {
            let (from, to) = (step * of_states, step * all);
            problem.free[to..][..of_states].copy_from_slice(&narrow.free[from..][..of_states]);
            problem.reference[to..][..of_states].copy_from_slice(&narrow.reference[from..][..of_states]);
            problem.gain[to * n..][..of_states * n]
                .copy_from_slice(&narrow.gain[from * n..][..of_states * n]);
            let (speed, curvature, previous) = (*speed, curvature[step], narrow.previous[0]);
            let here = HorizonStep { step, speed, curvature, previous, problem: narrow, tracked };
            for (row, term) in (to + of_states..).zip(&*terms) {
                let gain = &mut problem.gain[row * n..][..=step];
                gain.fill(0.0);
                [problem.free[row], problem.reference[row]] = term.output(&here, gain);
            }
        }
    }
}

impl CostTerms {
    /// Adds a term to those that there are already; `narrow` is the problem without terms, `parameters` name the solver.
    ///
    /// # Errors
    /// A problem that the solver refuses.
    pub fn with(
        term: Box<dyn CostTerm>,
        before: Option<Self>,
        (narrow, tracked): (&TrackingQp, &[usize]),
        parameters: &MpcParameters,
    ) -> Result<Self, BuildError> {
        let mut terms = before.map_or_else(Vec::new, |before| before.wide.terms);
        terms.push(term);
        let mut wide = WideProblem::new(terms, narrow);
        wide.widen(narrow, tracked);
        let solver = build_solver(parameters.solver, &wide.problem, parameters.max_iterations as u32)?;
        Ok(Self { outputs: vec![0.0; wide.problem.free.len()], wide, solver })
    }

    /// Takes the speed, m/s, and the curvature in each step of the horizon, 1/m.
    pub fn look(&mut self, speed: f64, curvature: &[f64]) {
        self.wide.speed = speed;
        self.wide.curvature.copy_from_slice(curvature);
    }

    /// Solves a problem with all terms; writes the outputs of the states alone.
    pub fn solve(
        &mut self,
        (narrow, tracked): (&TrackingQp, &[usize]),
        time_limit: f64,
        inputs: &mut [f64],
        outputs: &mut [f64],
    ) -> Result<QpReport, QpError> {
        self.wide.widen(narrow, tracked);
        let report = self.solver.solve(&self.wide.problem, time_limit, inputs, &mut self.outputs)?;
        let (of_states, all) = (narrow.shape.outputs, self.wide.problem.shape.outputs);
        for (narrow, wide) in outputs.chunks_exact_mut(of_states).zip(self.outputs.chunks_exact(all)) {
            narrow.copy_from_slice(&wide[..of_states]);
        }
        Ok(report)
    }
}
