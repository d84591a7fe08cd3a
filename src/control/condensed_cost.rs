//! The tracking cost over the inputs alone, which all solvers start from.
//!
//! ```text
//! 1/2 U'HU + f'U    with    H = G'WG + D'RD,    f = G'W (free - ref) - D'R ([u_{-1}; 0; ..] + d)
//! ```
//!
//! with `W` the outputs' weights, `D` the differences from step to step and `R` their weights. The rows of `G` that
//! belong to one step reach equally far. Up to four of them and two columns of `H` are taken at once. So an entry is
//! loaded and stored once for all of them. Rows of weight zero, of outputs that are only bounded, are left out.
//!
//! If an input acts as the one before it did a step earlier, with `e` the last step's rows of `G`,
//!
//! ```text
//! (G'WG)_ij = (G'WG)_{i+1,j+1} + sum over outputs w e_i e_j
//! ```
//!
//! which takes `O(N^2)` instead of `O(N^3)`.

use super::cholesky::{add as add_multiple, begin};
use super::tracking_qp::TrackingQp;
use crate::numerics::lanes::{FOUR, Lanes, Work, compute};

/// A weighted row of `G`, as far as it reaches, and the error there with zero inputs.
#[derive(Clone, Copy)]
struct CostRow<'a> {
    weight: f64,
    gain: &'a [f64],
    error: f64,
}

/// Writes `H`, a packed lower triangle by rows, and `f`.
pub(super) fn condense_cost(problem: &TrackingQp, hessian: &mut [f64], linear: &mut [f64]) {
    hessian.fill(0.0);
    linear.fill(0.0);
    if problem.shift_invariant && problem.shape.inputs == 1 {
        condense_shift_invariant(problem, hessian, linear);
    } else {
        compute(CostRows { problem, hessian, linear });
    }
    add_rates(problem, hessian, linear);
}

/// The outputs' cost, row by row of `G`.
struct CostRows<'a> {
    problem: &'a TrackingQp,
    hessian: &'a mut [f64],
    linear: &'a mut [f64],
}

impl Work for CostRows<'_> {
    type Given = ();

    #[inline(always)]
    fn with<L: Lanes<Stored = [f64; FOUR]>>(self) {
        let Self { problem, hessian, linear } = self;
        let shape = &problem.shape;
        let (n, inputs, outputs) = (problem.columns(), shape.inputs, shape.outputs);
        for j in 0..shape.horizon {
            let reach = (j + 1) * inputs;
            let mut i = 0;
            while i < outputs {
                let mut rows = [CostRow { weight: 0.0, gain: &[], error: 0.0 }; 4];
                let mut count = 0;
                let together = (outputs - i).min(4);
                for i in i..i + together {
                    let (row, weight) = (j * outputs + i, shape.weight(j, i));
                    if weight != 0.0 {
                        let error = problem.free[row] - problem.reference[row];
                        rows[count] = CostRow { weight, gain: &problem.gain[row * n..][..reach], error };
                        count += 1;
                    }
                }
                i += together;
                let [a, b, c, d] = rows;
                match count {
                    4 => add::<L, 4>(hessian, linear, [a, b, c, d]),
                    3 => add::<L, 3>(hessian, linear, [a, b, c]),
                    2 => add::<L, 2>(hessian, linear, [a, b]),
                    1 => add::<L, 1>(hessian, linear, [a]),
                    _ => (),
                }
            }
        }
    }
}

/// Adds the cost of the inputs' increments.
fn add_rates(problem: &TrackingQp, hessian: &mut [f64], linear: &mut [f64]) {
    let (shape, n, inputs) = (&problem.shape, problem.columns(), problem.shape.inputs);
    for column in 0..n {
        // r (u_j - u_{j-1})^2 summed: 2 r on the diagonal but for the last step, -r beside it.
        let weight = shape.rate_weight[column % inputs];
        let last = column + inputs >= n;
        hessian[begin(column) + column] += if last { weight } else { 2.0 * weight };
        if column >= inputs {
            hessian[begin(column) + column - inputs] -= weight;
        } else {
            linear[column] -= weight * problem.previous[column];
        }
        let following = if last { 0.0 } else { problem.free_increments[column + inputs] };
        linear[column] -= weight * (problem.free_increments[column] - following);
    }
}

/// The outputs' cost of one input whose response is the same at each step.
fn condense_shift_invariant(problem: &TrackingQp, hessian: &mut [f64], linear: &mut [f64]) {
    let shape = &problem.shape;
    let (n, outputs) = (shape.horizon, shape.outputs);
    for i in (0..n).rev() {
        let (row, next) = hessian[begin(i)..].split_at_mut(i + 1);
        if let Some(next) = next.get(1..i + 2) {
            row.copy_from_slice(next);
        }
        for (o, &weight) in shape.output_weight.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            let last = &problem.gain[((n - 1) * outputs + o) * n..][..n];
            add_multiple(row, weight * last[i], last);
        }
    }
    let terminal = shape.terminal_factor - 1.0;
    for (o, &weight) in shape.output_weight.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
        if terminal != 0.0 {
            let last = &problem.gain[((n - 1) * outputs + o) * n..][..n];
            for i in 0..n {
                add_multiple(&mut hessian[begin(i)..=begin(i) + i], terminal * weight * last[i], last);
            }
        }
        for j in 0..n {
            let at = j * outputs + o;
            let force = shape.weight(j, o) * (problem.free[at] - problem.reference[at]);
            add_multiple(&mut linear[..=j], force, &problem.gain[at * n..]);
        }
    }
}

/// The terms' sum, the last two first.
#[inline(always)]
fn sum<L: Lanes, const K: usize>(terms: [L; K]) -> L {
    let mut sum = terms[K - 1];
    for k in (0..K - 1).rev() {
        sum = terms[k] + sum;
    }
    sum
}

/// Adds rows to `H` and `f`.
#[inline(always)]
fn add<L: Lanes<Stored = [f64; FOUR]>, const K: usize>(
    hessian: &mut [f64],
    linear: &mut [f64],
    rows: [CostRow<'_>; K],
) {
    let reach = rows[0].gain.len();
    let factors = |column: usize| rows.map(|row| row.weight * row.gain[column]);
    let force = |factors: &[f64; K]| sum::<f64, K>(std::array::from_fn(|k| factors[k] * rows[k].error));
    for column in (0..reach).step_by(2) {
        let left = factors(column);
        linear[column] += force(&left);
        // Entries that both columns have.
        let both = column + 1;
        let gains = rows.map(|row| &row.gain[..both]);
        if both == reach {
            // The last column alone: what stands behind it in the next row of `H` is none of its.
            add_products::<L, K>(&mut hessian[begin(column)..][..both], &mut [], &left, &left, &gains);
            return;
        }
        let right = factors(both);
        linear[both] += force(&right);
        let (of_left, of_right) = hessian[begin(column)..][..2 * both + 1].split_at_mut(both);
        let (of_right, corner) = of_right.split_at_mut(both);
        corner[0] += sum::<f64, K>(std::array::from_fn(|k| right[k] * rows[k].gain[both]));
        add_products::<L, K>(of_left, of_right, &left, &right, &gains);
    }
}

/// Adds the products of factors with the gains to a column of `H`, and to another one where there is one.
#[inline(always)]
fn add_products<L: Lanes<Stored = [f64; FOUR]>, const K: usize>(
    one: &mut [f64],
    other: &mut [f64],
    of_one: &[f64; K],
    of_other: &[f64; K],
    gains: &[&[f64]; K],
) {
    let blocks: [&[[f64; FOUR]]; K] = gains.map(|gain| gain.as_chunks().0);
    let (splat_one, splat_other) = (of_one.map(L::splat), of_other.map(L::splat));
    let is_pair = !other.is_empty();
    let (one, rest_one) = one.as_chunks_mut::<FOUR>();
    let (other, rest_other) = other.as_chunks_mut::<FOUR>();
    for (b, entries) in one.iter_mut().enumerate() {
        let gains = blocks.map(|blocks| L::load(&blocks[b]));
        let more = sum::<L, K>(std::array::from_fn(|k| splat_one[k] * gains[k]));
        *entries = (L::load(entries) + more).store();
        if is_pair {
            let more = sum::<L, K>(std::array::from_fn(|k| splat_other[k] * gains[k]));
            other[b] = (L::load(&other[b]) + more).store();
        }
    }
    let first = FOUR * one.len();
    for (i, entry) in rest_one.iter_mut().enumerate() {
        *entry += sum::<f64, K>(std::array::from_fn(|k| of_one[k] * gains[k][first + i]));
    }
    for (i, entry) in rest_other.iter_mut().enumerate() {
        *entry += sum::<f64, K>(std::array::from_fn(|k| of_other[k] * gains[k][first + i]));
    }
}
