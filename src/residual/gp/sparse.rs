//! A Gaussian process of one output through a dictionary: as fast at run time as its number of points, and learned from
//! all samples.
//!
//! With the dictionary `Z` as inducing inputs (projected process, also called DTC; its mean is that of the variational
//! approximation, too),
//!
//! ```text
//! K_ZZ = L L',   V = L^-1 k(Z, X),   B = I + V V' / sn^2 = G G'
//! mean(x)     = k(x, Z) alpha,       alpha = L^-T B^-1 V y / sn^2
//! variance(x) = k(x, x) - |L^-1 k(Z, x)|^2 + |G^-1 L^-1 k(Z, x)|^2
//! ```
//!
//! (Rasmussen and Williams 2006, sec. 8.3.4; Quiñonero-Candela and Rasmussen 2005; Titsias 2009.) With all samples as
//! dictionary it is the exact process. Time to learn grows with samples times the square of the dictionary.

use super::dot::Dot;
use super::kernel::{JITTER, Kernel};
use nalgebra::{Cholesky, DMatrix, DVector};

/// Most points of a dictionary.
pub const MAX_POINTS: usize = 1000;

/// A learned Gaussian process of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Sparse<const D: usize> {
    kernel: Kernel<D>,
    numbers: SparseNumbers<D>,
    /// The same for fast sums.
    dot: Dot<D>,
    /// `L`, rows of the lower triangle one after the other.
    prior: Vec<f64>,
}

/// Learned numbers, besides hyperparameters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SparseNumbers<const D: usize> {
    /// `Z`.
    pub dictionary: Vec<[f64; D]>,
    /// `alpha`.
    pub weights: Vec<f64>,
    /// `G`, rows of the lower triangle one after the other.
    pub posterior: Vec<f64>,
}

/// Sums over samples that the process needs.
pub(super) struct Moments {
    /// `V V'`.
    square: DMatrix<f64>,
    /// `V y`.
    product: DVector<f64>,
}

/// Samples whose covariances are worked on at a time: they stay in the cache.
const BLOCK: usize = 256;
/// Parts of the samples, each for one thread: a fixed number, so that sums do not depend on the threads.
const PARTS: usize = 16;

impl<const D: usize> Sparse<D> {
    /// Learns from all samples with a dictionary; `None` where the covariance is singular to rounding, the noise is zero
    /// or a value is not finite.
    ///
    /// # Panics
    /// If there is not one label for each input: a mistake of the calling code.
    #[must_use]
    pub fn new(
        kernel: Kernel<D>,
        dictionary: Vec<[f64; D]>,
        inputs: &[[f64; D]],
        labels: &[f64],
        threads: usize,
    ) -> Option<Self> {
        assert_eq!(inputs.len(), labels.len(), "labels");
        let m = dictionary.len();
        let prior = prior(&kernel, &dictionary)?;
        let l = prior.l_dirty();
        let part = inputs.len().div_ceil(PARTS).max(1);
        let parts = crate::numerics::parallel::chunks(inputs.len(), part);
        let sums = crate::numerics::parallel::map(threads, parts.len(), |p| {
            let mut sums = Moments { square: DMatrix::zeros(m, m), product: DVector::zeros(m) };
            for block in crate::numerics::parallel::chunks(parts[p].len(), BLOCK) {
                let rows = parts[p].start + block.start..parts[p].start + block.end;
                let mut v = kernel.between(&dictionary, &inputs[rows.clone()]);
                l.solve_lower_triangular_mut(&mut v);
                sums.square.gemm(1.0, &v, &v.transpose(), 1.0);
                sums.product.gemv(1.0, &v, &DVector::from_column_slice(&labels[rows]), 1.0);
            }
            sums
        });
        let mut b = DMatrix::zeros(m, m);
        let mut product = DVector::zeros(m);
        for part in &sums {
            b += &part.square;
            product += &part.product;
        }
        let precision = 1.0 / (kernel.noise * kernel.noise);
        b *= precision;
        (0..m).for_each(|i| b[(i, i)] += 1.0);
        let posterior = Cholesky::new(b)?;
        let mut alpha = posterior.solve(&product) * precision;
        l.tr_solve_lower_triangular_mut(&mut alpha);
        let numbers = SparseNumbers {
            dictionary,
            weights: alpha.iter().copied().collect(),
            posterior: packed(posterior.l_dirty()),
        };
        Self::assemble(kernel, numbers).ok()
    }

    /// From what a file holds.
    pub(super) fn assemble(kernel: Kernel<D>, numbers: SparseNumbers<D>) -> Result<Self, &'static str> {
        let SparseNumbers { dictionary, weights, posterior } = &numbers;
        let ensure = |holds: bool, what: &'static str| if holds { Ok(()) } else { Err(what) };
        ensure(kernel.is_valid(), "a hyperparameter is no positive number")?;
        let m = dictionary.len();
        ensure(m <= MAX_POINTS, "its dictionary is too large")?;
        ensure(weights.len() == m, "weights of its dictionary are missing or too many")?;
        ensure(posterior.len() == m * (m + 1) / 2, "its covariance has not the size of its dictionary")?;
        let all = dictionary.as_flattened().iter().chain(weights).chain(posterior);
        ensure(all.into_iter().all(|x| x.is_finite()), "a number of its dictionary is not finite")?;
        let diagonal = (0..m).all(|i| posterior[i * (i + 1) / 2 + i] > 0.0);
        ensure(diagonal, "its covariance is not positive")?;
        let prior =
            prior(&kernel, dictionary).ok_or("its dictionary has points that cannot be told apart")?;
        let dot = Dot::new(&kernel, dictionary, weights);
        Ok(Self { kernel, prior: packed(prior.l_dirty()), dot, numbers })
    }

    /// The hyperparameters.
    #[must_use]
    pub fn kernel(&self) -> &Kernel<D> {
        &self.kernel
    }

    /// The dictionary.
    #[must_use]
    pub fn dictionary(&self) -> &[[f64; D]] {
        &self.numbers.dictionary
    }

    /// The weight of each point's covariance in the mean.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.numbers.weights
    }

    pub(super) fn numbers(&self) -> &SparseNumbers<D> {
        &self.numbers
    }

    /// Mean of the residual at an input, and its derivatives by the inputs. Allocates nothing.
    #[must_use]
    pub fn mean(&self, input: &[f64; D]) -> (f64, [f64; D]) {
        self.dot.sum(input)
    }

    /// Variance of the noise-free residual at an input: `sf^2` far from all data. `room` is made once and grows to the
    /// size of the dictionary; then nothing is allocated.
    pub fn variance(&self, input: &[f64; D], room: &mut Vec<f64>) -> f64 {
        room.clear();
        room.extend(self.numbers.dictionary.iter().map(|point| self.kernel.covariance(point, input)));
        let explained = solve(&self.prior, room);
        let uncertain = solve(&self.numbers.posterior, room);
        (self.kernel.signal * self.kernel.signal - explained + uncertain).max(0.0)
    }
}

fn prior<const D: usize>(
    kernel: &Kernel<D>,
    dictionary: &[[f64; D]],
) -> Option<Cholesky<f64, nalgebra::Dyn>> {
    Cholesky::new(kernel.among(dictionary, JITTER * kernel.signal * kernel.signal))
}

/// The lower triangle, row after row.
fn packed(l: &DMatrix<f64>) -> Vec<f64> {
    (0..l.nrows()).flat_map(|i| (0..=i).map(move |j| l[(i, j)])).collect()
}

/// Solves `L x = b` in place, and gives `|x|^2`.
fn solve(packed: &[f64], b: &mut [f64]) -> f64 {
    let mut square = 0.0;
    let mut start = 0;
    for i in 0..b.len() {
        let (known, rest) = b.split_at_mut(i);
        let row = &packed[start..=start + i];
        let sum: f64 = row.iter().zip(&*known).map(|(l, x)| l * x).sum();
        rest[0] = (rest[0] - sum) / row[i];
        square += rest[0] * rest[0];
        start += i + 1;
    }
    square
}
