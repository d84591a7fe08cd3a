//! Least squares, plain and ridge, for several outputs at once.
//!
//! ```text
//! theta = argmin  sum_i w_i |y_i - theta' z_i|^2 + lambda n |theta|^2,     n = sum_i w_i
//! ```
//!
//! Two summaries of the rows serve two needs. [`Triangle`] is the R of a QR decomposition, fed row by row. It does not
//! square the condition number (commands of a closed loop are nearly collinear), and gives the solution of least norm
//! for dependent columns. [`Gram`] is `Z'Z`: quicker, and good enough once `lambda` bounds the condition number.

use crate::nominal::ERRORS;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Coefficients: for each regressor, its effect on each output.
pub type Theta<const S: usize = ERRORS> = Vec<[f64; S]>;

/// `Z'Z`, `Z'Y` and the number of rows.
#[derive(Debug, Clone)]
pub struct Gram<const S: usize = ERRORS> {
    /// Lower triangle, row by row.
    zz: Vec<f64>,
    zy: Theta<S>,
    weight: f64,
}

impl<const S: usize> Gram<S> {
    /// Of no rows, for `regressors` columns.
    #[must_use]
    pub fn new(regressors: usize) -> Self {
        Self { zz: vec![0.0; regressors * (regressors + 1) / 2], zy: vec![[0.0; S]; regressors], weight: 0.0 }
    }

    /// Adds a row `weight` times.
    pub fn add(&mut self, z: &[f64], y: &[f64; S], weight: f64) {
        crate::invariant!(z.len() == self.zy.len());
        let mut rest = self.zz.as_mut_slice();
        for (i, (&zi, zy)) in z.iter().zip(&mut self.zy).enumerate() {
            let (row, below) = rest.split_at_mut(i + 1);
            let scaled = weight * zi;
            row.iter_mut().zip(z).for_each(|(sum, &zj)| *sum += scaled * zj);
            zy.iter_mut().zip(y).for_each(|(sum, &yo)| *sum += scaled * yo);
            rest = below;
        }
        self.weight += weight;
    }

    /// `(Z'Z + lambda n I)^-1 Z'Y`; zero for an infinite `lambda` or no rows; `None` if `Z'Z` is singular and
    /// `lambda` too small to mend it.
    #[must_use]
    pub fn ridge(&self, lambda: f64) -> Option<Theta<S>> {
        let p = self.zy.len();
        if lambda == f64::INFINITY || self.weight == 0.0 {
            return Some(vec![[0.0; S]; p]);
        }
        let mut matrix =
            DMatrix::from_fn(p, p, |i, j| if j <= i { self.zz[i * (i + 1) / 2 + j] } else { 0.0 });
        for i in 0..p {
            matrix[(i, i)] += lambda * self.weight;
        }
        let right = DMatrix::from_fn(p, S, |i, o| self.zy[i][o]);
        // Cholesky reads the lower triangle only.
        let solution = Cholesky::new(matrix)?.solve(&right);
        let theta = rows(&solution);
        theta.iter().flatten().all(|t| t.is_finite()).then_some(theta)
    }
}

/// The triangle `R` of `[Z Y] = Q R`, built up row by row.
#[derive(Debug, Clone)]
pub struct Triangle<const S: usize = ERRORS> {
    regressors: usize,
    /// The triangle so far in the first rows, then rows not yet worked in.
    block: DMatrix<f64>,
    filled: usize,
    weight: f64,
}

/// Number of rows that are worked in at once.
const BLOCK: usize = 256;

impl<const S: usize> Triangle<S> {
    /// Of no rows, for `regressors` columns.
    #[must_use]
    pub fn new(regressors: usize) -> Self {
        let width = regressors + S;
        Self { regressors, block: DMatrix::zeros(width + BLOCK, width), filled: 0, weight: 0.0 }
    }

    /// Adds a row `weight` times.
    pub fn add(&mut self, z: &[f64], y: &[f64; S], weight: f64) {
        if self.filled == self.block.nrows() {
            self.reduce();
        }
        let root = weight.sqrt();
        let mut row = self.block.row_mut(self.filled);
        for (entry, &value) in row.iter_mut().zip(z.iter().chain(y)) {
            *entry = root * value;
        }
        self.filled += 1;
        self.weight += weight;
    }

    /// Adds the rows that another triangle has seen.
    pub fn merge(&mut self, other: &Self) {
        let weight = self.weight + other.weight;
        let mut y = [0.0; S];
        for row in other.block.row_iter().take(other.filled) {
            let row: Vec<f64> = row.iter().copied().collect();
            let (z, outputs) = row.split_at(self.regressors);
            y.copy_from_slice(outputs);
            self.add(z, &y, 1.0);
        }
        self.weight = weight;
    }

    /// Works in the rows that wait, so that few remain to be read.
    pub fn compact(&mut self) {
        self.reduce();
    }

    fn reduce(&mut self) {
        if self.filled == 0 {
            return;
        }
        let triangle = self.block.rows(0, self.filled).into_owned().qr().r();
        self.block.fill(0.0);
        self.block.rows_mut(0, triangle.nrows()).copy_from(&triangle);
        self.filled = triangle.nrows();
    }

    /// Sum of the squared errors of `theta` on the rows, for each output.
    #[must_use]
    pub fn squared_error(&self, theta: &[[f64; S]]) -> [f64; S] {
        let mut sum = [0.0; S];
        for row in self.block.row_iter().take(self.filled) {
            for (o, sum) in sum.iter_mut().enumerate() {
                let fit: f64 = theta.iter().zip(row.iter()).map(|(t, z)| t[o] * z).sum();
                *sum += (row[self.regressors + o] - fit).powi(2);
            }
        }
        sum
    }

    /// Prepares the solutions for all `lambda`.
    #[must_use]
    pub fn decompose(mut self) -> Decomposed<S> {
        self.reduce();
        let p = self.regressors;
        // Fewer rows than regressors leave rows of zeros below: they change nothing.
        let svd = self.block.view((0, 0), (p, p)).into_owned().svd(true, true);
        let right = self.block.view((0, p), (p, S));
        let (u, v_t) =
            (svd.u.unwrap_or_else(|| DMatrix::zeros(p, p)), svd.v_t.unwrap_or_else(|| DMatrix::zeros(p, p)));
        Decomposed {
            projected: u.transpose() * right,
            singular: svd.singular_values,
            v_t,
            weight: self.weight,
        }
    }
}

/// The singular value decomposition of `Z`: from it the solution for any `lambda` is one product.
#[derive(Debug, Clone)]
pub struct Decomposed<const S: usize = ERRORS> {
    singular: DVector<f64>,
    v_t: DMatrix<f64>,
    projected: DMatrix<f64>,
    weight: f64,
}

impl<const S: usize> Decomposed<S> {
    /// The solution. For `lambda = 0` plain least squares, the one of least norm if there are many: singular values
    /// below `n eps` of the largest count as zero.
    #[must_use]
    pub fn solve(&self, lambda: f64) -> Theta<S> {
        let largest = self.singular.max();
        let cutoff = largest * f64::EPSILON * self.weight.max(self.singular.len() as f64);
        let mut filtered = self.projected.clone();
        for (i, &s) in self.singular.iter().enumerate() {
            let factor = if lambda == f64::INFINITY || s == 0.0 || (lambda == 0.0 && s <= cutoff) {
                0.0
            } else {
                s / (s * s + lambda * self.weight)
            };
            filtered.row_mut(i).scale_mut(factor);
        }
        rows(&(self.v_t.transpose() * filtered))
    }
}

fn rows<const S: usize>(matrix: &DMatrix<f64>) -> Theta<S> {
    matrix.row_iter().map(|row| std::array::from_fn(|o| row[o])).collect()
}
