//! The covariance of the residual at two inputs: squared exponential with a length scale for each input (ARD).
//!
//! ```text
//! k(a, b) = sf^2 exp(-1/2 sum_d ((a_d - b_d) / l_d)^2)
//! ```
//!
//! (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 5.1.) All in the units of the inputs and
//! of the output.

use super::exp::exp;
use nalgebra::DMatrix;

/// Added to the diagonal of covariances of noise-free values, relative to `sf^2`: they are singular to rounding where
/// points are close.
pub(super) const JITTER: f64 = 1e-10;

/// Hyperparameters of one output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kernel<const D: usize> {
    /// Change of each input over which the residual becomes another, in that input's unit.
    pub length_scales: [f64; D],
    /// Standard deviation of the residual, `sf`, in its unit.
    pub signal: f64,
    /// Standard deviation of the noise on labels, `sn`, in the same unit.
    pub noise: f64,
}

impl<const D: usize> Kernel<D> {
    /// Covariance of the noise-free residuals at two inputs.
    #[must_use]
    pub fn covariance(&self, a: &[f64; D], b: &[f64; D]) -> f64 {
        let scaled = |d: usize| (a[d] - b[d]) / self.length_scales[d];
        let distance: f64 = (0..D).map(|d| scaled(d) * scaled(d)).sum();
        self.signal * self.signal * exp(-0.5 * distance)
    }

    /// Covariances of all of `a`, the rows, with all of `b`, the columns.
    #[must_use]
    pub fn between(&self, a: &[[f64; D]], b: &[[f64; D]]) -> DMatrix<f64> {
        DMatrix::from_fn(a.len(), b.len(), |i, j| self.covariance(&a[i], &b[j]))
    }

    /// Covariances among `a`, with something added to the diagonal.
    #[must_use]
    pub fn among(&self, a: &[[f64; D]], diagonal: f64) -> DMatrix<f64> {
        let mut k = DMatrix::zeros(a.len(), a.len());
        for j in 0..a.len() {
            k[(j, j)] = self.signal * self.signal + diagonal;
            for i in j + 1..a.len() {
                let value = self.covariance(&a[i], &a[j]);
                k[(i, j)] = value;
                k[(j, i)] = value;
            }
        }
        k
    }

    /// True if the values are possible: positive and finite; the noise may be 0.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let positive = |x: &f64| *x > 0.0 && x.is_finite();
        self.length_scales.iter().all(positive)
            && positive(&self.signal)
            && self.noise >= 0.0
            && self.noise.is_finite()
    }
}
