//! Choice of the inputs to keep: in each step the one that is least determined by those kept.
//!
//! The variance of the residual at `x` given its values at the dictionary `Z` is `k(x, x) - k(x, Z) K_ZZ^-1 k(Z, x)`.
//! Taking the input with the largest variance, again and again, is the Cholesky factorisation of the covariance with
//! pivoting. Each step makes one row of the factor and takes its squares from the variances: `n m` operations for the
//! `m`-th of `n` inputs.
//!
//! (Kabzan et al. 2019, sec. IV-B, keep a dictionary by posterior variance; Fine and Scheinberg 2001 give the factorisation.)

use super::kernel::Kernel;

/// Indices of at most `most` of the inputs, in the order taken; fewer once the rest has less than `least` of the prior
/// variance.
#[must_use]
pub fn choose<const D: usize>(
    kernel: &Kernel<D>,
    inputs: &[[f64; D]],
    most: usize,
    least: f64,
) -> Vec<usize> {
    let prior = kernel.signal * kernel.signal;
    let mut variance = vec![prior; inputs.len()];
    // One row for each input taken: its factor with all inputs.
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut taken = Vec::new();
    while taken.len() < most.min(inputs.len()) {
        // The first of the largest, so that the result does not depend on anything else.
        let pivot = (0..inputs.len()).rev().max_by(|&a, &b| variance[a].total_cmp(&variance[b]));
        let Some(pivot) = pivot.filter(|&p| variance[p] > least * prior) else { break };
        let scale = 1.0 / variance[pivot].sqrt();
        let mut row: Vec<f64> = inputs.iter().map(|input| kernel.covariance(input, &inputs[pivot])).collect();
        for before in &rows {
            let factor = before[pivot];
            row.iter_mut().zip(before).for_each(|(value, other)| *value -= factor * other);
        }
        for (value, variance) in row.iter_mut().zip(&mut variance) {
            *value *= scale;
            *variance -= *value * *value;
        }
        // Never again.
        variance[pivot] = 0.0;
        rows.push(row);
        taken.push(pivot);
    }
    taken
}
