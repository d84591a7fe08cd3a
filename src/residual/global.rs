//! One linear model for all samples: the residual kind `linear`, and the target of linear leaves' shrinkage.
//!
//! Ridge with `lambda` from cross-validation. Folds are made of blocks of consecutive samples: neighbours share most of
//! their window, so a random split would test on its training data.

use super::leaf::Design;
use super::least_squares::{Theta, Triangle};
use crate::numerics::parallel;

/// Folds of the cross-validation.
pub(super) const FOLDS: usize = 5;

/// Consecutive samples that stay together.
const BLOCK: usize = 200;

/// The fold of a sample.
pub(super) fn fold(sample: usize, samples: usize) -> usize {
    (sample / BLOCK.min(samples / (2 * FOLDS)).max(1)) % FOLDS
}

/// The fit, and the error of each candidate.
#[derive(Debug, Clone)]
pub(super) struct GlobalFit<const S: usize> {
    /// For scaled columns.
    pub theta: Theta<S>,
    /// The `lambda` chosen.
    pub lambda: f64,
}

/// Fits `labels` by the `lambda` of `candidates` whose cross-validated error, summed over standardised outputs, is least.
pub(super) fn fit<const S: usize>(
    design: &Design<S>,
    labels: &[[f64; S]],
    candidates: &[f64],
    threads: usize,
) -> GlobalFit<S> {
    let n = design.len();
    let mut folds = parallel::map(threads, FOLDS, |f| {
        let mut triangle = Triangle::<S>::new(design.regressors);
        for i in (0..n).filter(|&i| fold(i, n) == f) {
            triangle.add(design.row(i), &labels[i], 1.0);
        }
        triangle
    });
    let all = |folds: &[Triangle<S>], without: usize| {
        let mut sum = Triangle::new(design.regressors);
        folds.iter().enumerate().filter(|&(f, _)| f != without).for_each(|(_, fold)| sum.merge(fold));
        sum.decompose()
    };
    folds.iter_mut().for_each(Triangle::compact);
    let lambda = if let [only] = candidates {
        *only
    } else {
        let scale = spread(&design.labels);
        let errors = parallel::map(threads, FOLDS, |f| {
            let fit = all(&folds, f);
            let error = |&lambda: &f64| score(&folds[f].squared_error(&fit.solve(lambda)), &scale);
            candidates.iter().map(error).collect::<Vec<f64>>()
        });
        let total = |i: usize| errors.iter().map(|fold| fold[i]).sum::<f64>();
        let best = (0..candidates.len()).min_by(|&a, &b| total(a).total_cmp(&total(b)));
        best.map_or(0.0, |i| candidates[i])
    };
    GlobalFit { theta: all(&folds, FOLDS).solve(lambda), lambda }
}

/// Variance of each output; 1 for a constant one.
pub(super) fn spread<const S: usize>(labels: &[[f64; S]]) -> [f64; S] {
    let n = labels.len() as f64;
    std::array::from_fn(|o| {
        let mean = labels.iter().map(|y| y[o]).sum::<f64>() / n;
        let variance = labels.iter().map(|y| (y[o] - mean).powi(2)).sum::<f64>() / n;
        if variance > 0.0 { variance } else { 1.0 }
    })
}

/// Squared errors in units of the outputs' spread.
pub(super) fn score<const S: usize>(squares: &[f64; S], spread: &[f64; S]) -> f64 {
    squares.iter().zip(spread).map(|(square, spread)| square / spread).sum()
}
