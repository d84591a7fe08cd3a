//! Our solver beside Clarabel alone on every problem of hard drives: how far apart their inputs are.
//!
//! Problems are compared as the drives make them, none is kept: there are 10 000 and more.

use crate::Outcome;
use crate::problems::{CASES, Case, learn, start};
use rfl_mpc::control::{ActiveSetSolver, ClarabelSolver, QpEnd, QpError, QpSolver, Residual, TrackingQp};
use serde_json::{Value, json};
use std::error::Error;

/// What was found on problems of one drive.
#[derive(Default)]
struct Found {
    problems: usize,
    /// Problems where half of the inputs' changes, or more, are at their bound.
    at_rate_bounds: usize,
    /// Problems whose solution violates a soft bound.
    softened: usize,
    /// Problems that our active-set method left to Clarabel: their agreement says nothing.
    left: usize,
    /// Problems that Clarabel did not solve to its tolerance of 1e-13.
    undecided: usize,
    /// Largest difference of an input, relative to the inputs' bound.
    difference: f64,
    /// Largest share of the objective by which ours is above Clarabel's.
    excess: f64,
}

impl Found {
    /// Compares two solutions' inputs and outputs.
    fn add(&mut self, problem: &TrackingQp, ours: (&[f64], &[f64]), theirs: (&[f64], &[f64])) {
        let shape = &problem.shape;
        self.problems += 1;
        let before = problem.previous.iter().chain(ours.0);
        let at_bound = |(u, before): (&f64, &f64)| (u - before).abs() > (1.0 - 1e-6) * shape.rate_max[0];
        let bounded = ours.0.iter().zip(before).filter(|&(u, before)| at_bound((u, before))).count();
        self.at_rate_bounds += usize::from(2 * bounded >= ours.0.len());
        let violates = |of_step: &[f64]| {
            shape.soft.iter().any(|soft| {
                let output = of_step[soft.output];
                (output - soft.max).max(soft.min - output) > 1e-6 * (soft.max - soft.min)
            })
        };
        self.softened += usize::from(ours.1.chunks_exact(shape.outputs).any(violates));
        for (a, b) in ours.0.iter().zip(theirs.0) {
            self.difference = self.difference.max((a - b).abs() / shape.input_max[0]);
        }
        let [of_ours, of_theirs] = [ours, theirs].map(|(u, y)| problem.objective(u, y));
        self.excess = self.excess.max((of_ours - of_theirs) / of_theirs.abs().max(1e-12));
    }
}

/// Drives a case for `count` steps and solves each of its problems.
fn compare(case: &Case, residual: &Residual, horizon: usize, count: usize) -> Result<Found, Box<dyn Error>> {
    let mut closed = start(case, residual, horizon)?;
    let mut found = Found::default();
    let mut solvers = None;
    for _ in 0..count {
        closed.advance()?;
        let problem = closed.controller().problem();
        let (ours, clarabel) = match &mut solvers {
            Some(solvers) => solvers,
            none => none.insert((ActiveSetSolver::new(&problem.shape), ClarabelSolver::exact(problem)?)),
        };
        let room = || (vec![0.0; problem.columns()], vec![0.0; problem.free.len()]);
        let ((mut u, mut y), (mut v, mut z)) = (room(), room());
        match ours.solve(problem, f64::INFINITY, &mut u, &mut y) {
            Ok(_) => (),
            // What the controller would leave to Clarabel, too.
            Err(QpError::TimeLimit { .. }) => return Err("there is no time limit".into()),
            Err(_) => {
                found.left += 1;
                continue;
            }
        }
        match clarabel.solve(problem, f64::INFINITY, &mut v, &mut z) {
            Ok(report) if report.end == QpEnd::Solved => found.add(problem, (&u, &y), (&v, &z)),
            // Tolerances of 1e-13 are beyond it now and then: then there is nothing to compare with.
            _ => found.undecided += 1,
        }
    }
    Ok(found)
}

/// Compares `count` problems of each case for N = 16 and N = 60.
pub fn run(count: usize) -> Outcome {
    let residual = learn()?;
    let mut result = serde_json::Map::new();
    for horizon in [16, 60] {
        let mut cases = serde_json::Map::new();
        for case in &CASES {
            let found = compare(case, &residual, horizon, count)
                .map_err(|error| format!("{}, N = {horizon}: {error}", case.name))?;
            cases.insert(
                case.name.to_owned(),
                json!({
                    "problems": found.problems, "at_rate_bounds": found.at_rate_bounds, "softened": found.softened,
                    "left_to_clarabel": found.left, "clarabel_failed": found.undecided,
                    "largest_difference": found.difference, "largest_excess": found.excess,
                }),
            );
        }
        result.insert(horizon.to_string(), Value::Object(cases));
    }
    Ok(Value::Object(result))
}
