//! The linear problem around a point: steps, evidence, and products with the background marginalised.

use super::prior::{Precision, Prior};
use crate::diagnose::problem::Problem;
use crate::diagnose::profile::SampleWeights;
use crate::diagnose::replay::ReplayVehicle;
use crate::numerics::lanes::{FOUR, Lanes, Work, compute};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::borrow::Cow;
use std::sync::Arc;

/// Slopes at a point with their weighted products.
#[derive(Clone)]
pub struct Linearisation {
    /// Columns, one for each uncertain parameter.
    pub slopes: Vec<Arc<Vec<f64>>>,
    /// Weights of gaps.
    pub weights: Arc<SampleWeights>,
    pub(in crate::diagnose) gram: DMatrix<f64>,
}

/// A slope, and the place of its uncertain parameter.
pub type SlopeColumn = (usize, Arc<Vec<f64>>);

/// A solution of the linear problem.
pub struct LinearSolution {
    /// Change of the coordinates.
    pub change: Vec<f64>,
    /// Remaining cost.
    pub cost: f64,
}

/// Sums of [`dot`] that run side by side: one alone would wait for each addition before the next.
const SIDE_BY_SIDE: usize = 2;

/// Sum of products.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    compute(Dot(a, b))
}

struct Dot<'a>(&'a [f64], &'a [f64]);

impl Work for Dot<'_> {
    type Given = f64;

    #[inline(always)]
    fn with<L: Lanes<Stored = [f64; FOUR]>>(self) -> f64 {
        let ((a, rest_a), (b, rest_b)) = (self.0.as_chunks::<FOUR>(), self.1.as_chunks::<FOUR>());
        let ((a, more_a), (b, more_b)) = (a.as_chunks::<SIDE_BY_SIDE>(), b.as_chunks::<SIDE_BY_SIDE>());
        let mut sums = [L::splat(0.0); SIDE_BY_SIDE];
        for (a, b) in a.iter().zip(b) {
            for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
                *sum = *sum + L::load(a) * L::load(b);
            }
        }
        let last = [(more_a.as_flattened(), more_b.as_flattened()), (rest_a, rest_b)];
        let last = last.into_iter().flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| a * b).sum::<f64>();
        sums.map(L::store).as_flattened().iter().sum::<f64>() + last
    }
}

impl Linearisation {
    /// From slopes and weights.
    #[must_use]
    pub fn new(slopes: Vec<Arc<Vec<f64>>>, weights: Arc<SampleWeights>) -> Self {
        let count = slopes.len();
        let mut made = Self { slopes, weights, gram: DMatrix::zeros(count, count) };
        (0..count).for_each(|i| made.fill_gram(i, i + 1));
        made
    }

    /// Products of a slope with the first `count`.
    fn fill_gram(&mut self, i: usize, count: usize) {
        let weighted = self.weighted(&self.slopes[i]);
        for j in 0..count {
            let value = dot(&weighted, &self.slopes[j]);
            self.gram[(i, j)] = value;
            self.gram[(j, i)] = value;
        }
    }

    fn weighted(&self, gap: &[f64]) -> Vec<f64> {
        self.weights.weighted(gap)
    }

    /// The same weights with slopes taken anew.
    #[must_use]
    pub fn anew<V: ReplayVehicle>(&self, problem: &Problem<V>, x: &[f64], gap: &[f64]) -> Self {
        Self::new(problem.slopes(x, gap), self.weights.clone())
    }

    /// The same with other slopes of some uncertain parameters.
    #[must_use]
    pub fn with(&self, columns: &[SlopeColumn]) -> Self {
        let mut other = self.clone();
        for (i, column) in columns {
            other.slopes[*i] = column.clone();
        }
        for &(i, _) in columns {
            other.fill_gram(i, other.slopes.len());
        }
        other
    }

    /// The weighted square of a gap.
    #[must_use]
    pub fn square(&self, gap: &[f64]) -> f64 {
        dot(gap, &self.weighted(gap))
    }

    /// Products of all slopes with a weighted gap.
    #[must_use]
    pub fn gradient(&self, gap: &[f64]) -> Vec<f64> {
        let weighted = self.weighted(gap);
        self.slopes.iter().map(|slope| dot(slope, &weighted)).collect()
    }

    /// The step from `off`, coordinates less those expected, with gap `gap`.
    #[must_use]
    pub fn step(&self, off: &[f64], gap: &[f64], precision: &Precision) -> LinearSolution {
        self.damped(off, gap, precision, 0.0)
    }

    /// The damped step after Levenberg and Marquardt: with the normal matrix `A`, `(A + damping diag A) d = b`.
    #[must_use]
    pub fn damped(&self, off: &[f64], gap: &[f64], precision: &Precision, damping: f64) -> LinearSolution {
        let cost = self.square(gap) + precision.penalty(off);
        let right = self.project(gap, precision) - &precision.matrix * precision.of(off);
        let mut change = vec![0.0; off.len()];
        let mut normal = self.normal(precision);
        let held: DVector<f64> = damping * normal.diagonal();
        (0..held.len()).for_each(|a| normal[(a, a)] += held[a]);
        let Some(solved) = normal.cholesky().map(|c| c.solve(&right)) else {
            return LinearSolution { change, cost };
        };
        for (&i, &value) in precision.free.iter().zip(solved.iter()) {
            change[i] = value;
        }
        // What it gains is d' (2 b - A d), and A d = b - damping diag A d.
        let back = solved.component_mul(&held).dot(&solved);
        LinearSolution { change, cost: cost - right.dot(&solved) - back }
    }

    fn project(&self, gap: &[f64], precision: &Precision) -> DVector<f64> {
        let (free, weighted) = (&precision.free, self.weighted(gap));
        DVector::from_iterator(free.len(), free.iter().map(|&i| dot(&self.slopes[i], &weighted)))
    }

    fn normal(&self, precision: &Precision) -> DMatrix<f64> {
        let free = &precision.free;
        DMatrix::from_fn(free.len(), free.len(), |a, b| {
            let (i, j) = (free[a], free[b]);
            // A hair more on the diagonal keeps what the log does not show regular.
            let hair = if a == b { 1e-9 * (1.0 + self.gram[(i, i)]) } else { 0.0 };
            self.gram[(i, j)] + precision.matrix[(a, b)] + hair
        })
    }

    /// Covariance of the coordinates after the fit, of the uncertain parameters that are free.
    #[must_use]
    pub fn covariance(&self, precision: &Precision) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.slopes.len(), self.slopes.len());
        if let Some(inverse) = self.normal(precision).cholesky().map(|c| c.inverse()) {
            for (a, &i) in precision.free.iter().enumerate() {
                for (b, &j) in precision.free.iter().enumerate() {
                    all[(i, j)] = inverse[(a, b)];
                }
            }
        }
        all
    }

    /// The same with a likelihood to a power.
    #[must_use]
    pub fn tempered(&self, power: f64) -> Self {
        Self::new(self.slopes.clone(), Arc::new(self.weights.times(power)))
    }

    /// The least cost, from coordinates `off` the expected ones with gap `gap`, and the cost of that freedom. None where
    /// slopes are not finite.
    #[must_use]
    pub fn converged(&self, off: &[f64], gap: &[f64], precision: Precision) -> Option<Converged> {
        // What is fixed stays where it is, at no cost.
        let of = |(i, &off): (usize, &f64)| if precision.free.contains(&i) { off } else { 0.0 };
        let off: Vec<f64> = off.iter().enumerate().map(of).collect();
        let LinearSolution { change, cost } = self.step(&off, gap, &precision);
        let half_log = |matrix: DMatrix<f64>| {
            let factor = matrix.cholesky()?;
            Some(factor.l_dirty().diagonal().iter().map(|it| it.ln()).sum::<f64>())
        };
        let narrowing = half_log(self.normal(&precision))? - half_log(precision.matrix.clone())?;
        Some(Converged { cost, narrowing, change, precision })
    }

    /// Products of two gaps with the background marginalised: `a' (W^-1 + U U')^-1 b`.
    #[must_use]
    pub fn marginal(&self, a: &[f64], b: &[f64], precision: &Precision) -> f64 {
        let straight = dot(a, &self.weighted(b));
        let Some(known) = self.marginalised(precision) else { return straight };
        straight - known.seen(a).dot(&known.seen(b))
    }

    /// Shared part of such products, computed once. None where slopes are not finite.
    #[must_use]
    pub fn marginalised<'a>(&'a self, precision: &'a Precision) -> Option<Marginalised<'a>> {
        let factor = self.normal(precision).cholesky()?;
        Some(Marginalised { linear: self, precision, factor })
    }
}

impl Prior {
    /// The linear step under this prior.
    #[must_use]
    pub fn step(
        &self,
        linear: &Linearisation,
        x: &[f64],
        gap: &[f64],
        precision: &Precision,
    ) -> LinearSolution {
        linear.step(&self.off(x), gap, precision)
    }
}

/// A linear problem at its best.
pub struct Converged {
    /// Remaining cost.
    pub cost: f64,
    /// Narrowing of the prior range by the log, half the logarithm of the ratio of determinants: the cost of freedom in
    /// the evidence (Laplace's approximation).
    pub narrowing: f64,
    /// Change of the coordinates.
    pub change: Vec<f64>,
    /// Prior precision there.
    pub precision: Precision,
}

/// The background of a linear problem, marginalised.
pub struct Marginalised<'a> {
    linear: &'a Linearisation,
    precision: &'a Precision,
    factor: Cholesky<f64, Dyn>,
}

/// A gap with the part that the background can imitate.
pub struct ReducedGap<'a> {
    gap: Cow<'a, [f64]>,
    weighted: Vec<f64>,
    imitated: DVector<f64>,
}

impl Marginalised<'_> {
    /// Part of a gap that the background can imitate, `L^-1 S' W a`.
    fn seen(&self, gap: &[f64]) -> DVector<f64> {
        let right = self.linear.project(gap, self.precision);
        self.factor.l_dirty().solve_lower_triangular(&right).unwrap_or(right)
    }

    /// A gap, ready for products.
    #[must_use]
    pub fn reduced<'a>(&self, gap: impl Into<Cow<'a, [f64]>>) -> ReducedGap<'a> {
        let gap = gap.into();
        ReducedGap { imitated: self.seen(&gap), weighted: self.linear.weighted(&gap), gap }
    }

    /// `a' (W^-1 + U U')^-1 b`.
    #[must_use]
    pub fn product(&self, a: &ReducedGap, b: &ReducedGap) -> f64 {
        dot(&a.gap, &b.weighted) - a.imitated.dot(&b.imitated)
    }

    /// Explanation of a gap `e` by columns `D`, each with a coordinate of standard deviation `s`, and these
    /// coordinates: `b' (G + 1 / s^2)^-1 b` with `b_k = <D_k, e>`, `G_kl = <D_k, D_l>`. The cost of their freedom is as
    /// [`Converged::narrowing`]. None where they are not finite.
    #[must_use]
    pub fn explained<'a, C: Into<Cow<'a, [f64]>>>(
        &self,
        gap: &ReducedGap,
        columns: impl Iterator<Item = C>,
        deviation: f64,
    ) -> Option<Explained> {
        let all: Vec<ReducedGap> = columns.map(|column| self.reduced(column)).collect();
        let right = DVector::from_iterator(all.len(), all.iter().map(|column| self.product(column, gap)));
        let gram = DMatrix::from_fn(all.len(), all.len(), |k, l| {
            self.product(&all[k], &all[l]) + if k == l { deviation.powi(-2) } else { 0.0 }
        });
        let factor = gram.cholesky()?;
        let narrowing = factor.l_dirty().diagonal().iter().map(|it| (it * deviation).ln()).sum();
        let shares = factor.solve(&right);
        Some(Explained { gain: right.dot(&shares), narrowing, shares })
    }
}

/// Explanation by columns.
#[derive(Debug, Clone)]
pub struct Explained {
    /// Of the cost.
    pub gain: f64,
    /// Cost of their freedom in the evidence.
    pub narrowing: f64,
    /// Their coordinates.
    pub shares: DVector<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights(rows: usize) -> Arc<SampleWeights> {
        Arc::new(vec![1.0; rows].into())
    }

    #[test]
    fn a_column_explains_what_the_background_does_not() {
        // One tolerance of 1 along the first row: <a, b> = a_1 b_1 / 2 + a_2 b_2.
        let linear = Linearisation::new(vec![Arc::new(vec![1.0, 0.0])], weights(2));
        let precision = Precision { free: vec![0], matrix: DMatrix::identity(1, 1) };
        let background = linear.marginalised(&precision).unwrap();
        let column_square = |[a, b]: [f64; 2]| 0.5 * a * a + b * b;
        let explained = |gap: [f64; 2], column: [f64; 2], deviation: f64| {
            let gap = background.reduced(gap.to_vec());
            let found = background.explained(&gap, [column.to_vec()].into_iter(), deviation).unwrap();
            let expected = 0.5 * (1.0 + deviation * deviation * column_square(column)).ln();
            assert!((found.narrowing - expected).abs() < 1e-8, "{} {expected}", found.narrowing);
            (found.gain, found.shares[0])
        };
        // b^2 / (G + 1 / s^2) and b / (G + 1 / s^2).
        for ((gain, share), (expected, coordinate)) in [
            (explained([0.0, 3.0], [0.0, 1.0], 2.0), (9.0 / 1.25, 3.0 / 1.25)),
            (explained([1.0, 0.0], [1.0, 0.0], 2.0), (0.25 / 0.75, 0.5 / 0.75)),
            (explained([1.0, 0.0], [0.0, 1.0], 2.0), (0.0, 0.0)),
        ] {
            assert!((gain - expected).abs() < 1e-8, "{gain} {expected}");
            assert!((share - coordinate).abs() < 1e-8, "{share} {coordinate}");
        }
    }

    #[test]
    fn evidence_is_that_of_numerical_integration() {
        // One uncertain parameter of tolerance 1, seen ten times as finely.
        let linear = Linearisation::new(vec![Arc::new(vec![10.0])], weights(1));
        for value in [0.0, 1.0, 4.0] {
            let precision = Precision { free: vec![0], matrix: DMatrix::identity(1, 1) };
            let found = linear.converged(&[0.0], &[10.0 * value], precision).unwrap();
            let step = 1e-3;
            let density = |x: f64| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
            let seen = |x: f64| (-50.0 * (value - x).powi(2)).exp();
            let grid = (-20_000..=20_000).map(|i| f64::from(i) * step);
            let exact = grid.map(|x| density(x) * seen(x) * step).sum::<f64>().ln();
            let laplace = -0.5 * found.cost - found.narrowing;
            assert!((laplace - exact).abs() < 1e-6, "{value}: {laplace} {exact}");
        }
    }

    #[test]
    fn a_step_held_back_promises_what_it_gains_and_turns_to_the_steepest_descent() {
        // Two rows that do nearly the same: what tells them apart is small.
        let slopes = vec![Arc::new(vec![1.0, 0.0, 0.1]), Arc::new(vec![1.0, 0.1, 0.0])];
        let linear = Linearisation::new(slopes.clone(), weights(3));
        let precision = Precision { free: vec![0, 1], matrix: DMatrix::identity(2, 2) * 1e-6 };
        let (off, gap) = ([0.5, -0.5], [3.0, 2.0, -1.0]);
        let cost = |change: &[f64]| {
            let off: Vec<f64> = off.iter().zip(change).map(|(off, change)| off + change).collect();
            let left = |k: usize| gap[k] - slopes[0][k] * change[0] - slopes[1][k] * change[1];
            (0..3).map(|k| left(k).powi(2)).sum::<f64>() + precision.penalty(&off)
        };
        let mut before = f64::INFINITY;
        for damping in [0.0, 1.0, 10.0, 100.0] {
            let step = linear.damped(&off, &gap, &precision, damping);
            assert!((step.cost - cost(&step.change)).abs() < 1e-6, "{damping}: {}", step.cost);
            let length = step.change[0].hypot(step.change[1]);
            assert!(length < before, "{damping}: {length} {before}");
            before = length;
        }
        // Far along what hardly tells without it, and with it both the same way, as the gradient goes.
        let whole = linear.damped(&off, &gap, &precision, 0.0).change;
        let held = linear.damped(&off, &gap, &precision, 100.0).change;
        assert!(whole[0] * whole[1] < 0.0 && held[0] * held[1] > 0.0, "{whole:?} {held:?}");
    }
}
