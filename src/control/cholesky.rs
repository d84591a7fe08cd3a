//! Cholesky factorisation `A = L L'` of small dense matrices, in place and with rows that come and go.
//!
//! `L` is packed by rows. Appending a row solves for it. Removing one leaves one subdiagonal too many, which plane
//! rotations of the columns take away (Golub and Van Loan, Matrix Computations, 6.5.4). Nothing allocates after
//! construction.

use crate::numerics::lanes::{FOUR, Lanes, Portable, Work, compute};

/// Start of row `row` in a packed lower triangle: after 1 + 2 + .. + `row` entries.
pub(super) fn begin(row: usize) -> usize {
    row * (row + 1) / 2
}

/// Sum of products. Four partial sums, so that it runs on lanes.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    dot_in::<Portable>(a, b)
}

/// The same, with the lanes of some processor.
#[inline(always)]
fn dot_in<L: Lanes<Stored = [f64; FOUR]>>(a: &[f64], b: &[f64]) -> f64 {
    let [dot] = dots_in::<L, 1>(a, [b]);
    dot
}

/// The same with several at once.
#[inline(always)]
fn dots_in<L: Lanes<Stored = [f64; FOUR]>, const K: usize>(a: &[f64], b: [&[f64]; K]) -> [f64; K] {
    let mut sums = [L::splat(0.0); K];
    let (head_a, tail_a) = a.as_chunks::<FOUR>();
    let b = b.map(|b| b[..a.len()].as_chunks::<FOUR>());
    for (i, a) in head_a.iter().enumerate() {
        let a = L::load(a);
        for k in 0..K {
            sums[k] = sums[k] + a * L::load(&b[k].0[i]);
        }
    }
    std::array::from_fn(|k| {
        let sums = sums[k].store();
        let tail: f64 = tail_a.iter().zip(b[k].1).map(|(a, b)| a * b).sum();
        (sums[0] + sums[2]) + (sums[1] + sums[3]) + tail
    })
}

/// Adds a multiple: `y += factor x`.
pub(super) fn add(y: &mut [f64], factor: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

/// Number of rows that are factorised at once: enough to keep a processor busy while one entry waits for another.
const TOGETHER: usize = 4;

/// The factor, with room for a largest size.
pub(super) struct Cholesky {
    factor: Vec<f64>,
    /// Reciprocals of the diagonal; as many as there are rows.
    inverse: Vec<f64>,
    rotations: Vec<(f64, f64)>,
    scratch: Vec<f64>,
}

impl Cholesky {
    /// An empty factor with room for `size` rows.
    pub(super) fn with_capacity(size: usize) -> Self {
        Self {
            factor: Vec::with_capacity(begin(size)),
            inverse: Vec::with_capacity(size),
            rotations: Vec::with_capacity(size),
            scratch: Vec::with_capacity(size + 1),
        }
    }

    pub(super) fn clear(&mut self) {
        self.factor.clear();
        self.inverse.clear();
    }

    fn size(&self) -> usize {
        self.inverse.len()
    }

    fn row(&self, i: usize) -> &[f64] {
        &self.factor[begin(i)..begin(i) + i]
    }

    /// Factorises a packed lower triangle of `size` rows. False if it is not positive definite to rounding.
    pub(super) fn factorise(&mut self, matrix: &[f64], size: usize) -> bool {
        self.clear();
        self.factor.extend_from_slice(&matrix[..begin(size)]);
        compute(Factorise { factor: &mut self.factor, inverse: &mut self.inverse, size })
    }

    /// `x = L^-1 x`, where the first `zeros` entries are known to be zero.
    pub(super) fn solve_lower(&self, x: &mut [f64], zeros: usize) {
        for i in zeros..self.size() {
            let (solved, rest) = x.split_at_mut(i);
            rest[0] = (rest[0] - dot(&self.row(i)[zeros..], &solved[zeros..])) * self.inverse[i];
        }
    }

    /// `x = L'^-1 x`.
    pub(super) fn solve_upper(&self, x: &mut [f64]) {
        for i in (0..self.size()).rev() {
            let (before, rest) = x.split_at_mut(i);
            rest[0] *= self.inverse[i];
            add(before, -rest[0], self.row(i));
        }
    }

    /// Appends a row to the matrix: `solved` is `L^-1` times the row, `pivot` its diagonal entry less `solved`
    /// squared, above zero.
    pub(super) fn append(&mut self, solved: &[f64], pivot: f64) {
        let root = pivot.sqrt();
        self.factor.extend_from_slice(&solved[..self.size()]);
        self.factor.push(root);
        self.inverse.push(1.0 / root);
    }

    /// Removes row and column `i` of the matrix.
    pub(super) fn remove(&mut self, i: usize) {
        let size = self.size() - 1;
        self.rotations.clear();
        for k in i..size {
            // The new row k is the old row k + 1, under the rotations so far.
            self.scratch.clear();
            self.scratch.extend_from_slice(&self.factor[begin(k + 1)..begin(k + 2)]);
            let row = &mut self.scratch;
            for (j, &(cos, sin)) in (i..).zip(&self.rotations) {
                (row[j], row[j + 1]) = (cos * row[j] + sin * row[j + 1], cos * row[j + 1] - sin * row[j]);
            }
            let length = row[k].hypot(row[k + 1]);
            self.rotations.push((row[k] / length, row[k + 1] / length));
            row[k] = length;
            self.inverse[k] = 1.0 / length;
            self.factor[begin(k)..begin(k + 1)].copy_from_slice(&row[..=k]);
        }
        self.factor.truncate(begin(size));
        self.inverse.truncate(size);
    }
}

/// See [`Cholesky::factorise`].
struct Factorise<'a> {
    factor: &'a mut [f64],
    /// Empty, with room for all.
    inverse: &'a mut Vec<f64>,
    size: usize,
}

impl Work for Factorise<'_> {
    type Given = bool;

    #[inline(always)]
    fn with<L: Lanes<Stored = [f64; FOUR]>>(self) -> bool {
        let Self { factor, inverse, size } = self;
        // An entry waits for those before it in its row, but not for other rows: some rows at once.
        for first in (0..size).step_by(TOGETHER) {
            let end = (first + TOGETHER).min(size);
            let (above, rest) = factor.split_at_mut(begin(first));
            for j in 0..first {
                let of_j = &above[begin(j)..][..j];
                if let Some(rows) = rest.get_mut(..begin(first + TOGETHER) - begin(first)) {
                    let places: [usize; TOGETHER] = std::array::from_fn(|k| begin(first + k) - begin(first));
                    let products = dots_in::<L, TOGETHER>(of_j, places.map(|place| &rows[place..]));
                    for (place, product) in places.into_iter().zip(products) {
                        rows[place + j] = (rows[place + j] - product) * inverse[j];
                    }
                    continue;
                }
                for i in first..end {
                    let row = &mut rest[begin(i) - begin(first)..][..=i];
                    row[j] = (row[j] - dot_in::<L>(of_j, row)) * inverse[j];
                }
            }
            for i in first..end {
                let (above, rest) = rest.split_at_mut(begin(i) - begin(first));
                let row = &mut rest[..=i];
                for j in first..i {
                    let of_j = &above[begin(j) - begin(first)..][..j];
                    row[j] = (row[j] - dot_in::<L>(of_j, row)) * inverse[j];
                }
                let diagonal = row[i];
                let pivot = diagonal - dot_in::<L>(&row[..i], row);
                // A pivot below rounding's share of the diagonal has no correct digit; NaN fails, too.
                if pivot.is_nan() || pivot <= 1e-14 * diagonal {
                    return false;
                }
                row[i] = pivot.sqrt();
                inverse.push(1.0 / row[i]);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    fn matrix(factor: &Cholesky) -> DMatrix<f64> {
        let n = factor.size();
        let l = DMatrix::from_fn(n, n, |i, j| if j <= i { factor.factor[begin(i) + j] } else { 0.0 });
        &l * l.transpose()
    }

    fn example(n: usize) -> DMatrix<f64> {
        let root = DMatrix::from_fn(n, n, |i, j| ((i * n + 3 * j + 1) as f64).sin());
        &root * root.transpose() + DMatrix::identity(n, n)
    }

    fn packed(a: &DMatrix<f64>) -> Vec<f64> {
        (0..a.nrows()).flat_map(|i| (0..=i).map(move |j| a[(i, j)])).collect()
    }

    #[test]
    fn factorises_and_solves() {
        let n = 13;
        let a = example(n);
        let mut factor = Cholesky::with_capacity(n);
        assert!(factor.factorise(&packed(&a), n));
        assert!((matrix(&factor) - &a).amax() < 1e-12);
        let mut x: Vec<f64> = (0..n).map(|k| if k < 5 { 0.0 } else { k as f64 }).collect();
        let b = DMatrix::from_column_slice(n, 1, &x);
        factor.solve_lower(&mut x, 5);
        factor.solve_upper(&mut x);
        assert!((a * DMatrix::from_column_slice(n, 1, &x) - b).amax() < 1e-11);
    }

    #[test]
    fn a_singular_matrix_is_refused() {
        let mut factor = Cholesky::with_capacity(2);
        assert!(!factor.factorise(&[1.0, 1.0, 1.0], 2));
        assert!(!factor.factorise(&[1.0, f64::NAN, 1.0], 2));
    }

    #[test]
    fn rows_come_and_go() {
        let n = 9;
        let a = example(n);
        let mut factor = Cholesky::with_capacity(n);
        let mut kept: Vec<usize> = Vec::new();
        let enter = |factor: &mut Cholesky, kept: &mut Vec<usize>, i: usize| {
            let mut row: Vec<f64> = kept.iter().map(|&j| a[(i, j)]).collect();
            factor.solve_lower(&mut row, 0);
            factor.append(&row, a[(i, i)] - dot(&row, &row));
            kept.push(i);
        };
        for i in 0..n {
            enter(&mut factor, &mut kept, i);
        }
        for place in [8, 0, 3, 2] {
            factor.remove(place);
            kept.remove(place);
        }
        enter(&mut factor, &mut kept, 3);
        let expected = DMatrix::from_fn(kept.len(), kept.len(), |i, j| a[(kept[i], kept[j])]);
        assert!((matrix(&factor) - expected).amax() < 1e-12);
    }
}
