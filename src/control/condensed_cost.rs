//! The tracking cost over the inputs alone, which all solvers start from.
//!
//! ```text
//! 1/2 U'HU + f'U    with    H = G'WG + D'RD,    f = G'W (free - ref) - D'R [u_{-1}; 0; ..]
//! ```
//!
//! with `W` the outputs' weights, `D` the differences from step to step and `R` their weights. The rows of `G` that
//! belong to one step reach equally far, so each entry of `H` is loaded and stored once a step, not once a row.

use super::cholesky::{add, begin};
use super::tracking_qp::TrackingQp;

/// Writes `H`, a packed lower triangle by rows, and `f`.
pub(super) fn condense_cost(problem: &TrackingQp, hessian: &mut [f64], linear: &mut [f64]) {
    let shape = &problem.shape;
    let (n, inputs, outputs) = (problem.columns(), shape.inputs, shape.outputs);
    hessian.fill(0.0);
    linear.fill(0.0);
    for j in 0..shape.horizon {
        let reach = (j + 1) * inputs;
        let mut i = 0;
        while i < outputs {
            let of = |i: usize| {
                let row = j * outputs + i;
                (
                    shape.weight(j, i),
                    &problem.gain[row * n..][..reach],
                    problem.free[row] - problem.reference[row],
                )
            };
            // Three rows at once, as the car has them; what is left singly.
            if i + 3 <= outputs {
                let ((wa, a, ea), (wb, b, eb), (wc, c, ec)) = (of(i), of(i + 1), of(i + 2));
                for column in 0..reach {
                    let (fa, fb, fc) = (wa * a[column], wb * b[column], wc * c[column]);
                    let entries = &mut hessian[begin(column)..=begin(column) + column];
                    for (((entry, a), b), c) in entries.iter_mut().zip(a).zip(b).zip(c) {
                        *entry += fa * a + (fb * b + fc * c);
                    }
                    linear[column] += fa * ea + (fb * eb + fc * ec);
                }
                i += 3;
                continue;
            }
            let (weight, gain, error) = of(i);
            i += 1;
            for (column, right) in gain.iter().enumerate() {
                let factor = weight * right;
                add(&mut hessian[begin(column)..=begin(column) + column], factor, gain);
                linear[column] += factor * error;
            }
        }
    }
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
    }
}
