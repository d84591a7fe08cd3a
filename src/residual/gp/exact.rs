//! The Gaussian process itself, without approximation: for hyperparameters, on some hundred samples.
//!
//! ```text
//! K = k(X, X) + sn^2 I = L L',   alpha = K^-1 y
//! mean(x)     = k(x, X) alpha
//! variance(x) = k(x, x) - k(x, X) K^-1 k(X, x)
//! log p(y|X)  = -1/2 y' alpha - sum_i log L_ii - n/2 log 2 pi
//! d log p / d theta = 1/2 tr((alpha alpha' - K^-1) dK/d theta)
//! ```
//!
//! (Rasmussen and Williams 2006, algorithm 2.1 and eq. 5.9.) Time grows with the cube of the samples.

use super::kernel::{JITTER, Kernel};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A Gaussian process of one output on all of its samples.
#[derive(Debug, Clone)]
pub struct Exact<'a, const D: usize> {
    kernel: Kernel<D>,
    inputs: &'a [[f64; D]],
    labels: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    alpha: DVector<f64>,
}

/// Derivatives of the log likelihood by the logarithms of the hyperparameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LikelihoodGradient<const D: usize> {
    /// By the logarithm of each length scale.
    pub length_scales: [f64; D],
    /// By the logarithm of the signal's standard deviation.
    pub signal: f64,
    /// By the logarithm of the noise's standard deviation.
    pub noise: f64,
}

impl<'a, const D: usize> Exact<'a, D> {
    /// The process given these samples; `None` where the covariance is singular to rounding or a value is not finite.
    ///
    /// # Panics
    /// If there is not one label for each input: a mistake of the calling code.
    #[must_use]
    pub fn new(kernel: Kernel<D>, inputs: &'a [[f64; D]], labels: &[f64]) -> Option<Self> {
        assert_eq!(inputs.len(), labels.len(), "labels");
        let Kernel { signal, noise, .. } = kernel;
        let factor = Cholesky::new(kernel.among(inputs, noise * noise + JITTER * signal * signal))?;
        let labels = DVector::from_column_slice(labels);
        let alpha = factor.solve(&labels);
        alpha.iter().all(|a| a.is_finite()).then_some(Self { kernel, inputs, labels, factor, alpha })
    }

    /// Logarithm of the labels' probability density.
    #[must_use]
    pub fn log_likelihood(&self) -> f64 {
        let n = self.labels.len();
        let l = self.factor.l_dirty();
        let log_determinant: f64 = (0..n).map(|i| l[(i, i)].ln()).sum();
        -0.5 * self.labels.dot(&self.alpha) - log_determinant - 0.5 * n as f64 * std::f64::consts::TAU.ln()
    }

    /// Its derivatives.
    #[must_use]
    pub fn gradient(&self) -> LikelihoodGradient<D> {
        let n = self.labels.len();
        let Kernel { length_scales, signal, noise } = self.kernel;
        // K^-1 = L^-T L^-1, where L^-1 is triangular as L is: a sixth of a full product, and a third of a full solution.
        let l = self.factor.l_dirty();
        let mut half = DMatrix::identity(n, n);
        for j in 0..n {
            let below = (n - j, n - j);
            l.view((j, j), below).solve_lower_triangular_mut(&mut half.view_mut((j, j), (n - j, 1)));
        }
        let inverse = |i: usize, j: usize| half.view((i, i), (n - i, 1)).dot(&half.view((i, j), (n - i, 1)));
        let mut sums = [0.0; D];
        let mut by_signal = 0.0;
        let mut trace = 0.0;
        for j in 0..n {
            let (x, alpha, diagonal) = (&self.inputs[j], self.alpha[j], inverse(j, j));
            trace += alpha * alpha - diagonal;
            // Half of the sum over the symmetric matrix: what lies below the diagonal. On it, distances are zero.
            by_signal += 0.5 * (alpha * alpha - diagonal) * signal * signal * (1.0 + JITTER);
            for i in j + 1..n {
                let weight =
                    (self.alpha[i] * alpha - inverse(i, j)) * self.kernel.covariance(&self.inputs[i], x);
                by_signal += weight;
                for d in 0..D {
                    let difference = self.inputs[i][d] - x[d];
                    sums[d] += weight * difference * difference;
                }
            }
        }
        LikelihoodGradient {
            length_scales: std::array::from_fn(|d| sums[d] / (length_scales[d] * length_scales[d])),
            signal: 2.0 * by_signal,
            noise: trace * noise * noise,
        }
    }

    /// Mean of the residual at an input.
    #[must_use]
    pub fn mean(&self, input: &[f64; D]) -> f64 {
        self.covariances(input).dot(&self.alpha)
    }

    /// Variance of the noise-free residual at an input.
    #[must_use]
    pub fn variance(&self, input: &[f64; D]) -> f64 {
        let k = self.covariances(input);
        self.kernel.signal * self.kernel.signal - k.dot(&self.factor.solve(&k))
    }

    fn covariances(&self, input: &[f64; D]) -> DVector<f64> {
        DVector::from_fn(self.inputs.len(), |i, _| self.kernel.covariance(&self.inputs[i], input))
    }
}
