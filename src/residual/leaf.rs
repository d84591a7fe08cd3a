//! Models in the leaves: a constant (RT, RF) or linear in the leaf's regressors (RTL, RFL).
//!
//! A leaf has few samples and its commands are nearly collinear, so a linear leaf is shrunk towards the fit of all
//! samples, `theta_g`. Columns are scaled to unit root mean square, so that `lambda` has no unit:
//!
//! ```text
//! theta = theta_g + (Z'Z + lambda n I)^-1 Z'(y - Z theta_g)
//! ```
//!
//! With a prior of the commands' effects (`prior.rs`), `theta` is the deviation from its mean, in units of its spread.
//! The mean is each leaf's own.
//!
//! `lambda = inf` is the global fit: then the trees add nothing. Plain least squares in each leaf is the paper's
//! way, [`LeafFit::LeastSquares`].

use super::least_squares::{Gram, Theta, Triangle};
use crate::nominal::ERRORS;
use crate::numerics::parallel;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// The leaves' coefficients, one leaf behind the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeafModels<const S: usize = ERRORS> {
    /// Regressors of a leaf; the first is the constant 1.
    pub(super) regressors: u32,
    /// For each leaf and regressor its effect on each output.
    #[serde(with = "super::rows")]
    pub(super) theta: Theta<S>,
    /// Smallest and largest command in the windows of each leaf's samples, rad.
    pub(super) command_range: Vec<[f64; 2]>,
}

impl<const S: usize> LeafModels<S> {
    /// Number of regressors, the constant among them.
    #[must_use]
    pub fn regressors(&self) -> usize {
        self.regressors as usize
    }

    /// Coefficients of a leaf.
    #[must_use]
    pub fn theta(&self, leaf: usize) -> &[[f64; S]] {
        &self.theta[leaf * self.regressors()..][..self.regressors()]
    }

    /// Share of these leaves whose training had no command as small, or as large, as one of these.
    pub(super) fn strange(&self, leaves: &[u32], commands: &[f64]) -> f64 {
        let lowest = commands.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = commands.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut strange = 0_u32;
        for &leaf in leaves {
            let [min, max] = self.command_range[leaf as usize];
            strange += u32::from(lowest < min) | u32::from(highest > max);
        }
        f64::from(strange) * (1.0 / leaves.len().max(1) as f64)
    }
}

/// Contribution of each leaf to the mean over the trees: its coefficients divided by the number of trees. The effect of
/// a command that is held over the whole window follows.
///
/// The controller asks for means again and again, and few leaves differ from the last time. So shares are rounded, each
/// to a multiple of a unit of its column that lets the sum of any T of them be exact:
///
/// ```text
/// |share| <= 2^b unit,    (T + 1) 2^b <= 2^53        b = 48 for 20 trees: 14 digits of the largest in the column
/// ```
///
/// Then a mean in which one leaf takes another's place is the mean made anew, to the bit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shares<const S: usize> {
    /// Of a leaf: its regressors and the held command.
    entries: usize,
    /// Leaf behind leaf, and at the end a leaf of zeros.
    values: Theta<S>,
}

impl<const S: usize> Shares<S> {
    /// Shares of leaves of so many trees, whose window has so many commands.
    pub fn new(leaves: &LeafModels<S>, trees: usize, window: usize) -> Self {
        let share = 1.0 / trees as f64;
        let entries = leaves.regressors() + 1;
        let mut values = Theta::with_capacity((leaves.command_range.len() + 1) * entries);
        for theta in leaves.theta.chunks_exact(leaves.regressors()) {
            let mut held = [0.0; S];
            // Constant leaves have no effects of commands.
            for effect in theta.get(1..=window).unwrap_or_default() {
                held.iter_mut().zip(effect).for_each(|(held, effect)| *held += effect);
            }
            values.extend(theta.iter().chain([&held]).map(|theta| theta.map(|x| x * share)));
        }
        values.extend(std::iter::repeat_n([0.0; S], entries));
        let columns = entries * S;
        for column in 0..columns {
            round_for_sums(&mut values.as_flattened_mut()[column..], columns, trees);
        }
        Self { entries, values }
    }

    /// Entries of a leaf, and so of a mean.
    pub fn entries(&self) -> usize {
        self.entries
    }

    /// The leaf that adds nothing: that of a tree in a mean before its first look-up.
    pub fn none(&self) -> u32 {
        (self.values.len() / self.entries - 1) as u32
    }

    /// Puts a leaf in the place of another in a mean.
    #[inline]
    pub fn exchange(&self, mean: &mut [[f64; S]], old: u32, new: u32) {
        let of = |leaf: u32| self.values[leaf as usize * self.entries..][..self.entries].as_flattened();
        for ((mean, new), old) in mean.as_flattened_mut().iter_mut().zip(of(new)).zip(of(old)) {
            *mean += new - old;
        }
    }
}

/// Rounds every `stride`-th value so that sums of `count` of them are exact, in whatever order, and differences of two.
fn round_for_sums(values: &mut [f64], stride: usize, count: usize) {
    let largest = values.iter().step_by(stride).fold(0.0_f64, |largest, x| largest.max(x.abs()));
    // The next power of two, by carrying the fraction into the exponent.
    const FRACTION: u64 = (1 << (f64::MANTISSA_DIGITS - 1)) - 1;
    let power = f64::from_bits((largest.to_bits() + FRACTION) & !FRACTION);
    let multiples = (1_u64 << f64::MANTISSA_DIGITS) / (count + 1).next_power_of_two() as u64;
    let unit = (power / multiples as f64).max(f64::MIN_POSITIVE);
    for value in values.iter_mut().step_by(stride) {
        *value = (*value / unit).round_ties_even() * unit;
    }
}

/// Fit of linear leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LeafFit {
    /// Shrunk towards the global fit.
    Ridge {
        /// Strength of the shrinkage, without unit; may be infinite.
        lambda: f64,
    },
    /// Each leaf on its own; the solution of least norm if its samples do not determine one.
    LeastSquares,
}

/// Regressors and labels of all samples.
#[derive(Debug, Clone)]
pub(super) struct Design<const S: usize> {
    pub regressors: usize,
    /// Row by row, each column divided by its scale.
    pub z: Vec<f64>,
    pub labels: Vec<[f64; S]>,
    /// Root mean square of each column before scaling; 1 for a column of zeros.
    pub scale: Vec<f64>,
    /// Of a prior of the commands' effects the `L` of `K = L L'`; columns `1..` are then commands times it.
    pub root: Option<DMatrix<f64>>,
}

/// Expectation of the prior for a leaf.
pub(super) struct Expectation<'a, const S: usize> {
    /// Of a leaf's rows the mean coefficients less those of all rows, for scaled columns.
    pub differs: &'a (dyn Fn(&[u32]) -> Theta<S> + Sync),
}

impl<const S: usize> Design<S> {
    /// Scales the columns of `z`.
    pub fn new(regressors: usize, mut z: Vec<f64>, labels: Vec<[f64; S]>) -> Self {
        let mut scale = vec![0.0; regressors];
        for row in z.chunks_exact(regressors) {
            scale.iter_mut().zip(row).for_each(|(sum, z)| *sum += z * z);
        }
        for sum in &mut scale {
            *sum = if *sum > 0.0 { (*sum / labels.len() as f64).sqrt() } else { 1.0 };
        }
        for row in z.chunks_exact_mut(regressors) {
            row.iter_mut().zip(&scale).for_each(|(z, scale)| *z /= scale);
        }
        Self { regressors, z, labels, scale, root: None }
    }

    /// The same with a prior of the commands' effects, whose `K` is `root root'`.
    pub fn with_prior(regressors: usize, mut z: Vec<f64>, labels: Vec<[f64; S]>, root: DMatrix<f64>) -> Self {
        let window = root.nrows();
        let mut squares = 0.0;
        let mut row_times_root = vec![0.0; window];
        for row in z.chunks_exact_mut(regressors) {
            let commands = &mut row[1..=window];
            squares += commands.iter().map(|u| u * u).sum::<f64>();
            for (column, product) in row_times_root.iter_mut().enumerate() {
                let below = root.column(column);
                let below = below.iter().skip(column);
                *product = commands[column..].iter().zip(below).map(|(u, l)| u * l).sum();
            }
            commands.copy_from_slice(&row_times_root);
        }
        let of_commands = (squares / (labels.len() * window).max(1) as f64).sqrt();
        let mut of_others = Self::new(regressors, z, labels);
        // The commands have one scale, lest the spread of the prior be lost.
        let of_commands = if of_commands > 0.0 { of_commands } else { 1.0 };
        for row in of_others.z.chunks_exact_mut(regressors) {
            for (z, scale) in row[1..=window].iter_mut().zip(&of_others.scale[1..]) {
                *z *= scale / of_commands;
            }
        }
        of_others.scale[1..=window].fill(of_commands);
        Self { root: Some(root), ..of_others }
    }

    pub fn len(&self) -> usize {
        self.labels.len()
    }

    pub fn row(&self, i: usize) -> &[f64] {
        &self.z[i * self.regressors..][..self.regressors]
    }

    /// `theta' z_i`.
    pub fn predict(&self, i: usize, theta: &[[f64; S]]) -> [f64; S] {
        let mut sum = [0.0; S];
        for (z, theta) in self.row(i).iter().zip(theta) {
            sum.iter_mut().zip(theta).for_each(|(sum, t)| *sum += z * t);
        }
        sum
    }

    /// Coefficients for columns that are not scaled, of one leaf or of several.
    pub fn unscaled(&self, theta: &[[f64; S]]) -> Theta<S> {
        let scales = self.scale.iter().cycle();
        let mut theta: Theta<S> =
            theta.iter().zip(scales).map(|(theta, scale)| theta.map(|t| t / scale)).collect();
        let Some(root) = &self.root else { return theta };
        for leaf in theta.chunks_exact_mut(self.regressors) {
            let commands = &mut leaf[1..=root.nrows()];
            let product = root * DMatrix::from_fn(root.nrows(), S, |i, o| commands[i][o]);
            for (i, command) in commands.iter_mut().enumerate() {
                *command = std::array::from_fn(|o| product[(i, o)]);
            }
        }
        theta
    }

    /// Coefficients of scaled columns that have these effects of commands, and no others.
    pub fn scaled_commands(&self, effects: &[[f64; S]]) -> Theta<S> {
        let mut theta = vec![[0.0; S]; self.regressors];
        let Some(root) = &self.root else { return theta };
        let mut right = DMatrix::from_fn(effects.len(), S, |i, o| effects[i][o]);
        // The root is a Cholesky factor: its diagonal is positive.
        root.solve_lower_triangular_mut(&mut right);
        for (i, theta) in theta[1..=effects.len()].iter_mut().enumerate() {
            *theta = std::array::from_fn(|o| right[(i, o)] * self.scale[1]);
        }
        theta
    }

    /// Share of the directions of a window of commands that the samples determine against a prior with this `lambda`.
    pub fn determined(&self, window: usize, lambda: f64) -> f64 {
        let mut gram = DMatrix::<f64>::zeros(window, window);
        for i in 0..self.len() {
            let commands = nalgebra::DVectorView::from_slice(&self.row(i)[1..=window], window);
            gram.syger(1.0, &commands, &commands, 1.0);
        }
        let against = lambda * self.len() as f64;
        let shares = gram.symmetric_eigenvalues().map(|s| if s > 0.0 { s / (s + against) } else { 0.0 });
        shares.sum() / window as f64
    }

    /// Remainder of the labels after `theta`.
    pub fn remainder(&self, theta: &[[f64; S]]) -> Vec<[f64; S]> {
        (0..self.len())
            .map(|i| {
                let fit = self.predict(i, theta);
                std::array::from_fn(|o| self.labels[i][o] - fit[o])
            })
            .collect()
    }
}

/// The samples of each leaf of one tree.
#[derive(Debug, Clone)]
pub(super) struct Members {
    rows: Vec<u32>,
    start: Vec<usize>,
}

impl Members {
    /// From each row's leaf; rows without weight are left out.
    pub fn new(leaf_of: &[u32], leaves: usize, weights: &[u16]) -> Self {
        let mut start = vec![0; leaves + 1];
        let kept = || leaf_of.iter().zip(weights).enumerate().filter(|(_, (_, w))| **w > 0);
        kept().for_each(|(_, (&leaf, _))| start[leaf as usize + 1] += 1);
        (0..leaves).for_each(|leaf| start[leaf + 1] += start[leaf]);
        let mut next = start.clone();
        let mut rows = vec![0; start[leaves]];
        for (row, (&leaf, _)) in kept() {
            rows[next[leaf as usize]] = row as u32;
            next[leaf as usize] += 1;
        }
        Self { rows, start }
    }

    pub fn leaves(&self) -> usize {
        self.start.len() - 1
    }

    pub fn of(&self, leaf: usize) -> impl Iterator<Item = usize> + '_ {
        self.rows[self.start[leaf]..self.start[leaf + 1]].iter().map(|&row| row as usize)
    }

    pub fn rows_of(&self, leaf: usize) -> &[u32] {
        &self.rows[self.start[leaf]..self.start[leaf + 1]]
    }

    pub fn count(&self, leaf: usize) -> usize {
        self.start[leaf + 1] - self.start[leaf]
    }
}

/// Means of the labels in each leaf.
pub(super) fn constant<const S: usize>(labels: &[[f64; S]], members: &Members, weights: &[u16]) -> Theta<S> {
    (0..members.leaves())
        .map(|leaf| {
            let mut sum = [0.0; S];
            let mut total = 0.0;
            for row in members.of(leaf) {
                let w = f64::from(weights[row]);
                sum.iter_mut().zip(&labels[row]).for_each(|(sum, y)| *sum += w * y);
                total += w;
            }
            sum.map(|sum| if total > 0.0 { sum / total } else { 0.0 })
        })
        .collect()
}

/// Linear leaves of one tree, leaf behind leaf, once for each fit of `fits`.
///
/// `remainder` is the labels less the global fit `global`. With a prior, leaves are shrunk to the global fit moved by
/// the prior's expectation of them.
pub(super) fn linear<const S: usize>(
    design: &Design<S>,
    remainder: &[[f64; S]],
    global: &[[f64; S]],
    expected: Option<&Expectation<'_, S>>,
    members: &Members,
    weights: &[u16],
    fits: &[LeafFit],
) -> Vec<Theta<S>> {
    let p = design.regressors;
    let mut result = vec![Theta::<S>::with_capacity(members.leaves() * p); fits.len()];
    let plain = fits.contains(&LeafFit::LeastSquares);
    let mut moved = vec![];
    for leaf in 0..members.leaves() {
        let mut gram = Gram::new(p);
        let mut triangle = plain.then(|| Triangle::new(p));
        let differs = expected.map(|expected| (expected.differs)(members.rows_of(leaf)));
        let global = match &differs {
            None => global,
            Some(differs) => {
                moved = global.to_vec();
                moved.as_flattened_mut().iter_mut().zip(differs.as_flattened()).for_each(|(t, d)| *t += d);
                &moved
            }
        };
        for row in members.of(leaf) {
            let w = f64::from(weights[row]);
            let mut rest = remainder[row];
            if let Some(differs) = &differs {
                let more = design.predict(row, differs);
                rest.iter_mut().zip(more).for_each(|(rest, more)| *rest -= more);
            }
            gram.add(design.row(row), &rest, w);
            if let Some(triangle) = &mut triangle {
                triangle.add(design.row(row), &design.labels[row], w);
            }
        }
        let decomposed = triangle.map(Triangle::decompose);
        for (fit, result) in fits.iter().zip(&mut result) {
            match (fit, &decomposed) {
                (LeafFit::LeastSquares, Some(decomposed)) => result.extend(decomposed.solve(0.0)),
                (LeafFit::LeastSquares, None) => result.extend(global),
                (LeafFit::Ridge { lambda }, _) => {
                    // A leaf whose equations cannot be solved keeps the global fit.
                    let change = gram.ridge(*lambda).unwrap_or_else(|| vec![[0.0; S]; p]);
                    result.extend(change.iter().zip(global).map(|(change, global)| {
                        let theta: [f64; S] = std::array::from_fn(|o| global[o] + change[o]);
                        theta
                    }));
                }
            }
        }
    }
    result
}

/// Number of samples in a partial sum: sums do not depend on the number of threads.
const CHUNK: usize = 2048;

/// Sum of squares and largest magnitude of `error(i)`, for each output; samples without an error are left out.
pub(super) fn accumulate<const S: usize>(
    threads: usize,
    samples: usize,
    error: impl Fn(usize) -> Option<[f64; S]> + Sync,
) -> (usize, [f64; S], [f64; S]) {
    let chunks = parallel::chunks(samples, CHUNK);
    let parts = parallel::map(threads, chunks.len(), |chunk| {
        let (mut count, mut squares, mut largest) = (0, [0.0; S], [0.0_f64; S]);
        for error in chunks[chunk].clone().filter_map(&error) {
            count += 1;
            for o in 0..S {
                squares[o] += error[o] * error[o];
                largest[o] = largest[o].max(error[o].abs());
            }
        }
        (count, squares, largest)
    });
    parts.into_iter().fold((0, [0.0; S], [0.0; S]), |sum, part| {
        (
            sum.0 + part.0,
            std::array::from_fn(|o| sum.1[o] + part.1[o]),
            std::array::from_fn(|o| f64::max(sum.2[o], part.2[o])),
        )
    })
}
