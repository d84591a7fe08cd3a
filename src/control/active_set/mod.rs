//! The tracking problem by a dual active-set method (Goldfarb and Idnani 1983) on the condensed cost.
//!
//! Over the inputs alone, with the rows `a_i'U <= b_i` of rates, bounds and softly bounded outputs,
//!
//! ```text
//! min 1/2 U'HU + f'U    s.t.  a_i'U <= b_i            rates, bounds
//!                             a_i'U <= b_i + s_i      softly, at the cost  1/2 q s^2 + l s,  s >= 0
//! ```
//!
//! A slack needs no variable of its own. Stationarity in `s`, `q s + l = lambda + mu` with `mu >= 0` for `s >= 0`,
//! says that a soft row is inactive, or *held*, or *yields*:
//!
//! ```text
//! a'U < b,  lambda = 0;    a'U = b,  0 <= lambda <= l;    a'U - (lambda - l)/q = b,  lambda >= l
//! ```
//!
//! so that, with `C` the diagonal of `1/q` where a row yields and 0 elsewhere, the working set `W` obeys
//!
//! ```text
//! H U + f + A_W' lambda = 0,    A_W U - C lambda = b_W - C l
//! ```
//!
//! The method begins at the unconstrained minimiser `-H^-1 f`, which is the answer in most steps of a drive. As long as
//! a row is violated, the multiplier of the most violated one grows, while the working set stays satisfied. With
//! `V = H^-1 A_W'`, `K = A_W V + C`, `v = H^-1 a` and `r = K^-1 A_W v`, by one unit of it
//!
//! ```text
//! dU = V r - v,    d lambda_W = -r,    violation falls by  a'v + c - r' A_W v
//! ```
//!
//! until the violation is gone and the row joins `W`, or a multiplier arrives at a limit. At 0 its row leaves; at `l`
//! its row begins to yield, or ceases to. The dual objective rises at each step of non-zero length, so no working set
//! recurs; an iteration bound guards against rounding.
//!
//! An answer is accepted only if its KKT residuals are small. They are computed afresh from `G`, not from accumulated
//! quantities. If they are too large, a few steps of refinement on the KKT system may reduce them. Each solve begins
//! from nothing, so that its bits depend on the problem alone. The time of an iteration is `O(n^2)` for `n` inputs over
//! the horizon.

mod rows;

use super::cholesky::{Cholesky, add, begin, dot};
use super::condensed_cost::condense_cost;
use super::tracking_qp::{QpEnd, QpError, QpReport, QpShape, QpSolver, TrackingQp};
use rows::{ActiveRow, BoundSide, RowFamily, input_width, soft_width};
use std::time::Instant;

/// Violation that counts as none, in widths of the input's or output's range.
const TOLERANCE: f64 = 1e-10;
/// Violation and mismatch of active rows with which a solution is accepted, in the same widths.
const FEASIBLE: f64 = 1e-9;
/// Stationarity with which a solution is accepted: the gradient's share of its own scale.
const STATIONARY: f64 = 1e-11;
/// A Schur complement below this share of its row's own term means that the row depends on the working set.
const DEPENDENT: f64 = 1e-12;
/// Refinements of a solution before it is given up.
const REFINEMENTS: u32 = 3;

/// End of a step along a multiplier.
#[derive(Debug, Clone, Copy)]
enum Event {
    /// The violation is gone.
    Satisfied,
    /// The entering row's multiplier reaches the linear penalty.
    Yields,
    /// A member's multiplier reaches zero.
    Leaves(usize),
    /// A member's multiplier reaches the linear penalty from below or above.
    Switches(usize),
}

/// The active-set method behind [`QpSolver`].
///
/// Refuses with [`QpError::Numerical`], [`QpError::Infeasible`] or [`QpError::IterationLimit`] a problem for another
/// solver; [`super::FastSolver`] passes it on.
pub struct ActiveSetSolver {
    hessian: Vec<f64>,
    linear: Vec<f64>,
    factor: Cholesky,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    /// Gradient of the cost, and with the multipliers' part.
    gradient: Vec<f64>,
    residual: Vec<f64>,
    working: Vec<ActiveRow>,
    /// True for rows with a side in the working set.
    in_set: Vec<bool>,
    /// Factor of `K`.
    gram: Cholesky,
    /// `H^-1 a` of each member, and of the row that enters, by slots.
    columns: Vec<f64>,
    free_slots: Vec<usize>,
    /// `L^-1` times the row of `K` that enters, and `r`.
    solved: Vec<f64>,
    direction: Vec<f64>,
    iterations: u32,
    iteration_limit: u32,
    /// True if the shape's bounds are finite and its penalties quadratic.
    usable: bool,
}

/// Stopping criterion.
#[derive(Debug, Clone, Copy)]
struct Watch {
    begin: Option<(Instant, f64)>,
}

impl Watch {
    fn start(time_limit: f64) -> Self {
        Self { begin: time_limit.is_finite().then(|| (Instant::now(), time_limit)) }
    }

    fn is_over(&self) -> bool {
        self.begin.is_some_and(|(begin, limit)| begin.elapsed().as_secs_f64() >= limit)
    }
}

/// True if the method can serve a shape: it measures by the widths of ranges and divides by quadratic penalties.
fn is_usable(shape: &QpShape) -> bool {
    let finite = |x: f64| x.is_finite();
    (0..shape.inputs)
        .all(|i| finite(shape.rate_max[i]) && finite(input_width(shape, i)) && input_width(shape, i) > 0.0)
        && shape.soft.iter().all(|soft| {
            finite(soft.max - soft.min)
                && finite(soft.linear)
                && finite(soft.quadratic)
                && soft.quadratic > 0.0
        })
}

impl ActiveSetSolver {
    /// Room for problems of a shape.
    #[must_use]
    pub fn new(shape: &QpShape) -> Self {
        let n = shape.horizon * shape.inputs;
        // Held rows are independent, so at most as many as inputs; any number of soft ones may yield.
        let room = n + shape.horizon * shape.soft.len();
        Self {
            hessian: vec![0.0; begin(n)],
            linear: vec![0.0; n],
            factor: Cholesky::of_matrices(n),
            inputs: vec![0.0; n],
            outputs: vec![0.0; shape.horizon * shape.outputs],
            gradient: vec![0.0; n],
            residual: vec![0.0; n],
            working: Vec::with_capacity(room),
            in_set: vec![false; room + n],
            gram: Cholesky::with_capacity(room),
            columns: vec![0.0; (room + 1) * n],
            free_slots: Vec::with_capacity(room + 1),
            solved: vec![0.0; room],
            direction: vec![0.0; room],
            iterations: 0,
            iteration_limit: u32::try_from(5 * room).unwrap_or(u32::MAX),
            usable: is_usable(shape),
        }
    }

    /// Most changes of the working set before the method gives up: five for each input and soft row.
    #[must_use]
    pub fn iteration_limit(&self) -> u32 {
        self.iteration_limit
    }

    fn column(&self, slot: usize) -> &[f64] {
        let n = self.inputs.len();
        &self.columns[slot * n..][..n]
    }

    fn numerical(&self) -> QpError {
        QpError::Numerical { iterations: self.iterations }
    }

    /// The most violated row outside the working set, in widths of its range; none if all hold to the tolerance.
    fn most_violated(&self, problem: &TrackingQp, tolerance: f64) -> Option<BoundSide> {
        let shape = &problem.shape;
        let mut worst = tolerance;
        let mut found = None;
        let mut look = |family, index, value: f64, center: f64, half: f64, width: f64| {
            let excess = ((value - center).abs() - half) / width;
            let row = BoundSide { family, index, sign: (value - center).signum() };
            if excess > worst && !self.in_set[row.place(self.inputs.len())] {
                worst = excess;
                found = Some(row);
            }
        };
        for i in 0..shape.inputs {
            let width = input_width(shape, i);
            let center = 0.5 * (shape.input_min[i] + shape.input_max[i]);
            let mut before = problem.previous[i];
            for index in (i..self.inputs.len()).step_by(shape.inputs) {
                let input = self.inputs[index];
                look(RowFamily::Rate, index, input - before, 0.0, shape.rate_max[i], width);
                look(RowFamily::Bound, index, input, center, 0.5 * width, width);
                before = input;
            }
        }
        for (bound, soft) in shape.soft.iter().enumerate() {
            let width = soft_width(shape, bound);
            let (center, half) = (0.5 * (soft.min + soft.max), 0.5 * (soft.max - soft.min));
            for step in 0..shape.horizon {
                let index = step * shape.soft.len() + bound;
                look(
                    RowFamily::Soft,
                    index,
                    self.outputs[step * shape.outputs + soft.output],
                    center,
                    half,
                    width,
                );
            }
        }
        found
    }

    /// Predicts the softly bounded outputs, the only ones that the method uses.
    fn predict_soft(&mut self, problem: &TrackingQp) {
        let shape = &problem.shape;
        for index in 0..shape.horizon * shape.soft.len() {
            let row = BoundSide { family: RowFamily::Soft, index, sign: 1.0 };
            let (step, bound) = row.soft(shape);
            let at = step * shape.outputs + shape.soft[bound].output;
            self.outputs[at] = problem.free[at] + dot(row.gain(problem), &self.inputs);
        }
    }

    /// `A_W x` into `solved`.
    fn rows_times(&mut self, problem: &TrackingQp, slot: usize) {
        let n = self.inputs.len();
        let x = &self.columns[slot * n..][..n];
        for (value, member) in self.solved.iter_mut().zip(&self.working) {
            *value = member.row.dot(problem, x);
        }
    }

    /// Makes a violated row hold, or yield.
    fn enter(&mut self, problem: &TrackingQp, row: BoundSide, watch: &Watch) -> Result<(), QpError> {
        let shape = &problem.shape;
        let n = self.inputs.len();
        let Some(slot) = self.free_slots.pop() else { return Err(self.numerical()) };
        let column = &mut self.columns[slot * n..][..n];
        column.fill(0.0);
        row.add(problem, 1.0, column);
        self.factor.solve_lower(column, row.zeros(shape));
        self.factor.solve_upper(column);
        let own = row.dot(problem, column);
        let mut excess = row.excess(problem, &self.inputs, &self.outputs);
        // A bound that no linear penalty defends yields at once.
        let yields = row.penalty(shape).is_some_and(|(linear, _)| linear <= 0.0);
        let mut entering = ActiveRow { row, slot, multiplier: 0.0, yields };
        loop {
            self.iterations += 1;
            if self.iterations > self.iteration_limit {
                return Err(QpError::IterationLimit { iterations: self.iterations });
            }
            if watch.is_over() {
                return Err(QpError::TimeLimit { iterations: self.iterations });
            }
            let size = self.working.len();
            self.rows_times(problem, slot);
            self.gram.solve_lower(&mut self.solved[..size], 0);
            let diagonal = own + entering.compliance(shape);
            let pivot = diagonal - dot(&self.solved[..size], &self.solved[..size]);
            self.direction[..size].copy_from_slice(&self.solved[..size]);
            self.gram.solve_upper(&mut self.direction[..size]);

            let mut step = f64::INFINITY;
            let mut event = None;
            if pivot > DEPENDENT * diagonal {
                (step, event) = (excess / pivot, Some(Event::Satisfied));
            }
            if let (Some((linear, _)), false) = (row.penalty(shape), entering.yields) {
                let until = linear - entering.multiplier;
                if until < step {
                    (step, event) = (until, Some(Event::Yields));
                }
            }
            for (i, (member, &rate)) in self.working.iter().zip(&self.direction).enumerate() {
                let (until, what) = match member.row.penalty(shape) {
                    Some((linear, _)) if member.yields && rate > 0.0 => {
                        ((member.multiplier - linear) / rate, Event::Switches(i))
                    }
                    Some((linear, _)) if !member.yields && rate < 0.0 => {
                        ((member.multiplier - linear) / rate, Event::Switches(i))
                    }
                    _ if rate > 0.0 => (member.multiplier / rate, Event::Leaves(i)),
                    _ => continue,
                };
                if until < step {
                    (step, event) = (until.max(0.0), Some(what));
                }
            }
            let Some(event) = event else { return Err(QpError::Infeasible) };

            for (member, &rate) in self.working.iter_mut().zip(&self.direction) {
                member.multiplier -= step * rate;
                add(&mut self.inputs, step * rate, &self.columns[member.slot * n..][..n]);
            }
            add(&mut self.inputs, -step, &self.columns[slot * n..][..n]);
            entering.multiplier += step;
            excess -= step * pivot;
            match event {
                Event::Satisfied => {
                    self.gram.append(&self.solved[..size], pivot);
                    self.working.push(entering);
                    self.in_set[row.place(n)] = true;
                    return Ok(());
                }
                Event::Yields => entering.yields = true,
                Event::Leaves(i) => {
                    self.gram.remove(i);
                    let member = self.working.remove(i);
                    self.free_slots.push(member.slot);
                    self.in_set[member.row.place(n)] = false;
                }
                Event::Switches(i) => self.switch(problem, i)?,
            }
        }
    }

    /// Lets a soft member begin or cease to yield: it leaves `K` and returns with another diagonal entry.
    fn switch(&mut self, problem: &TrackingQp, i: usize) -> Result<(), QpError> {
        let shape = &problem.shape;
        self.gram.remove(i);
        let mut member = self.working.remove(i);
        member.yields = !member.yields;
        if let Some((linear, _)) = member.row.penalty(shape) {
            member.multiplier = linear;
        }
        let size = self.working.len();
        self.rows_times(problem, member.slot);
        self.gram.solve_lower(&mut self.solved[..size], 0);
        let diagonal = member.row.dot(problem, self.column(member.slot)) + member.compliance(shape);
        let pivot = diagonal - dot(&self.solved[..size], &self.solved[..size]);
        if pivot.is_nan() || pivot <= DEPENDENT * diagonal {
            return Err(self.numerical());
        }
        self.gram.append(&self.solved[..size], pivot);
        self.working.push(member);
        Ok(())
    }

    /// Outputs, gradient of the cost and KKT residual, from the problem's own data. Gives the scale of the gradient.
    fn evaluate(&mut self, problem: &TrackingQp) -> f64 {
        let shape = &problem.shape;
        problem.predict(&self.inputs, &mut self.outputs);
        self.gradient.fill(0.0);
        let n = self.inputs.len();
        for (row, gain) in problem.gain.chunks_exact(n).enumerate() {
            let (j, i) = (row / shape.outputs, row % shape.outputs);
            let force = shape.weight(j, i) * (self.outputs[row] - problem.reference[row]);
            add(&mut self.gradient, force, &gain[..(j + 1) * shape.inputs]);
        }
        for index in 0..n {
            let i = index % shape.inputs;
            let before = index.checked_sub(shape.inputs);
            let change =
                self.inputs[index] - before.map_or(problem.previous[i], |before| self.inputs[before]);
            let force = shape.rate_weight[i] * (change - problem.free_increments[index]);
            self.gradient[index] += force;
            if let Some(before) = before {
                self.gradient[before] -= force;
            }
        }
        self.residual.copy_from_slice(&self.gradient);
        for member in &self.working {
            member.row.add(problem, member.multiplier, &mut self.residual);
        }
        let mut scale: f64 = 0.0;
        for (index, linear) in self.linear.iter().enumerate() {
            let own = self.hessian[begin(index) + index] * input_width(shape, index % shape.inputs);
            scale = scale.max(linear.abs()).max(own);
        }
        scale
    }

    /// True if the KKT conditions hold, from the values of [`Self::evaluate`].
    fn is_optimal(&self, problem: &TrackingQp, scale: f64) -> bool {
        let shape = &problem.shape;
        let stationary = self.residual.iter().all(|value| value.abs() <= STATIONARY * scale);
        let complementary = self.working.iter().all(|member| {
            let mismatch = member.row.excess(problem, &self.inputs, &self.outputs) - member.slack(shape);
            mismatch.abs() <= FEASIBLE * member.row.width(shape)
                && member.dual_violation(shape) <= FEASIBLE * scale
        });
        let finite = self.outputs.iter().all(|output| output.is_finite());
        finite && stationary && complementary && self.most_violated(problem, FEASIBLE).is_none()
    }

    /// A Newton step on the KKT system of the working set.
    fn refine(&mut self, problem: &TrackingQp) {
        let shape = &problem.shape;
        let (n, size) = (self.inputs.len(), self.working.len());
        self.factor.solve_lower(&mut self.residual, 0);
        self.factor.solve_upper(&mut self.residual);
        for (value, member) in self.direction.iter_mut().zip(&self.working) {
            let mismatch = member.row.excess(problem, &self.inputs, &self.outputs) - member.slack(shape);
            *value = mismatch - member.row.dot(problem, &self.residual);
        }
        self.gram.solve_lower(&mut self.direction[..size], 0);
        self.gram.solve_upper(&mut self.direction[..size]);
        add(&mut self.inputs, -1.0, &self.residual);
        for (member, &change) in self.working.iter_mut().zip(&self.direction) {
            member.multiplier += change;
            add(&mut self.inputs, -change, &self.columns[member.slot * n..][..n]);
        }
    }

    /// Cost at the solution, with that of the slacks: the excess of the outputs. The multiplier there is a small
    /// difference from the linear penalty.
    fn objective(&self, problem: &TrackingQp) -> f64 {
        let shape = &problem.shape;
        let slack: f64 = self
            .working
            .iter()
            .filter(|member| member.yields)
            .filter_map(|member| {
                let (linear, compliance) = member.row.penalty(shape)?;
                let slack = member.row.excess(problem, &self.inputs, &self.outputs);
                Some(slack * (linear + 0.5 * slack / compliance))
            })
            .sum();
        0.5 * (dot(&self.inputs, &self.gradient) + dot(&self.inputs, &self.linear)) + slack
    }
}

impl QpSolver for ActiveSetSolver {
    fn solve(
        &mut self,
        problem: &TrackingQp,
        time_limit: f64,
        inputs: &mut [f64],
        outputs: &mut [f64],
    ) -> Result<QpReport, QpError> {
        let watch = Watch::start(time_limit);
        let n = self.inputs.len();
        crate::invariant!(n == problem.columns(), "a solver serves one shape");
        self.iterations = 0;
        condense_cost(problem, &mut self.hessian, &mut self.linear);
        if !self.usable || !self.factor.factorise(&self.hessian, n) {
            return Err(self.numerical());
        }
        for (input, linear) in self.inputs.iter_mut().zip(&self.linear) {
            *input = -linear;
        }
        self.factor.solve_lower(&mut self.inputs, 0);
        self.factor.solve_upper(&mut self.inputs);
        if !self.inputs.iter().all(|input| input.is_finite()) {
            return Err(self.numerical());
        }
        if watch.is_over() {
            return Err(QpError::TimeLimit { iterations: 0 });
        }
        self.iterations = 1;
        self.gram.clear();
        self.working.clear();
        self.in_set.fill(false);
        self.free_slots.clear();
        self.free_slots.extend((0..self.columns.len() / n).rev());
        for attempt in 0.. {
            self.predict_soft(problem);
            while let Some(row) = self.most_violated(problem, TOLERANCE) {
                self.enter(problem, row, &watch)?;
                self.predict_soft(problem);
            }
            let scale = self.evaluate(problem);
            if self.is_optimal(problem, scale) {
                break;
            }
            if attempt == REFINEMENTS {
                return Err(self.numerical());
            }
            self.refine(problem);
        }
        inputs.copy_from_slice(&self.inputs);
        outputs.copy_from_slice(&self.outputs);
        Ok(QpReport { end: QpEnd::Solved, iterations: self.iterations, objective: self.objective(problem) })
    }
}
