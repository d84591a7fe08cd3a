//! The quadratic program of one control step, in the form that all solvers share.
//!
//! Over the inputs `U = [u_0 .. u_{N-1}]` (absolute values, not increments) and one slack `s` for each step and
//! soft bound:
//!
//! ```text
//! min  1/2 sum_i w_i (y_i - ref_i)^2 + 1/2 sum_j r (u_j - u_{j-1} - d_j)^2 + sum_s (1/2 quadratic s^2 + linear s)
//! s.t. y = free + G U
//!      |u_j - u_{j-1}| <= rate_max,   u_min <= u_j <= u_max
//!      min - s <= y_i <= max + s,  s >= 0     for softly bounded outputs
//! ```
//!
//! `G` is block lower triangular. Each step has its own slacks: one for the whole horizon lets a single bad step
//! switch the bound off for all others. The problem always has a solution as long as `u_{-1}` is within reach of
//! its bounds.

use super::cholesky::dot;
use serde::{Deserialize, Serialize};

/// A softly bounded output, at every step of the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SoftBound {
    /// Output within a step.
    pub output: usize,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// Weight of the slack's square.
    pub quadratic: f64,
    /// Weight of the slack (an exact penalty if it exceeds the bound's multiplier).
    pub linear: f64,
}

/// Constant part of the problem from step to step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QpShape {
    /// Steps of the horizon, `N`.
    pub horizon: usize,
    /// Outputs of one step.
    pub outputs: usize,
    /// Inputs of one step.
    pub inputs: usize,
    /// Weights of the outputs, `outputs` values.
    pub output_weight: Vec<f64>,
    /// Factor on the weights at the last step of the horizon.
    pub terminal_factor: f64,
    /// Weights of the inputs' increments, `inputs` values.
    pub rate_weight: Vec<f64>,
    /// Lower bounds of the inputs.
    pub input_min: Vec<f64>,
    /// Upper bounds of the inputs.
    pub input_max: Vec<f64>,
    /// Largest change of an input from step to step.
    pub rate_max: Vec<f64>,
    /// Softly bounded outputs.
    pub soft: Vec<SoftBound>,
}

/// The problem of one step. Vectors over the horizon are step by step: `free[j * outputs + i]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrackingQp {
    /// The constant part.
    pub shape: QpShape,
    /// `G`, row-major, `N outputs` x `N inputs`; only the block lower triangle is read.
    pub gain: Vec<f64>,
    /// Response to zero inputs, `N outputs`.
    pub free: Vec<f64>,
    /// References of the outputs, `N outputs`.
    pub reference: Vec<f64>,
    /// Inputs before the first step, `inputs`.
    pub previous: Vec<f64>,
    /// Increments of the inputs that cost nothing, `d`, `N inputs`.
    pub free_increments: Vec<f64>,
    /// True if an input acts as the one before it did a step earlier, `G` being constant along its diagonals. The cost
    /// is then condensed in `O(N^2)`.
    pub shift_invariant: bool,
}

/// End of a solver's run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QpEnd {
    /// To full accuracy.
    Solved,
    /// To reduced accuracy, good enough to be applied.
    ReducedAccuracy,
}

/// Report of a solver beside the solution.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct QpReport {
    pub end: QpEnd,
    pub iterations: u32,
    /// Objective at the solution, without the constant that `free` and `reference` add.
    pub objective: f64,
}

/// Reasons for which there is no solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum QpError {
    #[error("the time limit was reached after {iterations} iterations")]
    TimeLimit { iterations: u32 },
    #[error("the iteration limit of {iterations} was reached")]
    IterationLimit { iterations: u32 },
    #[error(
        "no input satisfies the bounds: the previous input is further from them than one step's largest change"
    )]
    Infeasible,
    #[error("the numbers of the problem are too badly scaled or not finite (after {iterations} iterations)")]
    Numerical { iterations: u32 },
}

/// A solver of the tracking problem. One instance serves one shape for its whole life.
pub trait QpSolver: Send {
    /// Solves; writes the inputs (`N inputs`) and outputs (`N outputs`) of the solution.
    ///
    /// `time_limit` in seconds, infinite for none.
    ///
    /// # Errors
    /// No solution was found; the buffers' content is then unspecified.
    fn solve(
        &mut self,
        problem: &TrackingQp,
        time_limit: f64,
        inputs: &mut [f64],
        outputs: &mut [f64],
    ) -> Result<QpReport, QpError>;
}

impl QpShape {
    /// True if a solver for the other serves this one: weights and bounds of inputs may differ from step to step, nothing else.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        (self.horizon, self.outputs, self.inputs, &self.soft)
            == (other.horizon, other.outputs, other.inputs, &other.soft)
    }

    /// Weight of output `i` at step `j` of the horizon (0 is the first predicted step).
    #[must_use]
    pub fn weight(&self, step: usize, output: usize) -> f64 {
        let factor = if step + 1 == self.horizon { self.terminal_factor } else { 1.0 };
        self.output_weight[output] * factor
    }
}

impl TrackingQp {
    /// A problem of the given shape with zero data.
    #[must_use]
    pub fn new(shape: QpShape) -> Self {
        let rows = shape.horizon * shape.outputs;
        let columns = shape.horizon * shape.inputs;
        Self {
            gain: vec![0.0; rows * columns],
            free: vec![0.0; rows],
            reference: vec![0.0; rows],
            previous: vec![0.0; shape.inputs],
            free_increments: vec![0.0; columns],
            shift_invariant: false,
            shape,
        }
    }

    /// The objective of inputs and the outputs that belong to them, with the best slacks. It is complete: it includes
    /// the part that no input changes.
    #[must_use]
    pub fn objective(&self, inputs: &[f64], outputs: &[f64]) -> f64 {
        let shape = &self.shape;
        let mut sum = 0.0;
        for (j, (of_step, references)) in
            outputs.chunks_exact(shape.outputs).zip(self.reference.chunks_exact(shape.outputs)).enumerate()
        {
            for (i, (output, reference)) in of_step.iter().zip(references).enumerate() {
                sum += 0.5 * shape.weight(j, i) * (output - reference).powi(2);
            }
            for soft in &shape.soft {
                let output = of_step[soft.output];
                let excess = (output - soft.max).max(soft.min - output).max(0.0);
                sum += (0.5 * soft.quadratic * excess + soft.linear) * excess;
            }
        }
        let before = self.previous.iter().chain(inputs);
        for (k, (input, before)) in inputs.iter().zip(before).enumerate() {
            let change = input - before - self.free_increments[k];
            sum += 0.5 * shape.rate_weight[k % shape.inputs] * change.powi(2);
        }
        sum
    }

    /// Number of columns of the gain.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.shape.horizon * self.shape.inputs
    }

    /// Writes the outputs that inputs cause, `free + G U`.
    pub fn predict(&self, inputs: &[f64], outputs: &mut [f64]) {
        for (row, (output, gain)) in outputs.iter_mut().zip(self.gain.chunks_exact(inputs.len())).enumerate()
        {
            let reach = (row / self.shape.outputs + 1) * self.shape.inputs;
            *output = self.free[row] + dot(&gain[..reach], inputs);
        }
    }
}
