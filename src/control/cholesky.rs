//! Cholesky factorisation `A = L L'` of small dense matrices, in place and with rows that come and go.
//!
//! `L` is packed by rows. Appending a row solves for it. Removing one leaves one subdiagonal too many, which plane
//! rotations of the columns take away (Golub and Van Loan, Matrix Computations, 6.5.4). A whole matrix is factorised
//! column by column, four rows at once, `l_j = (a_j - sum_k L_jk l_k) / L_jj`: no sum runs across a register. Nothing
//! allocates after construction.

use crate::numerics::lanes::{FOUR, Lanes, Portable, Work, compute};

/// Start of row `row` in a packed lower triangle: after 1 + 2 + .. + `row` entries.
pub(super) fn begin(row: usize) -> usize {
    row * (row + 1) / 2
}

/// Sum of products. Four partial sums, so that it runs on lanes.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (head_a, tail_a) = a.as_chunks::<FOUR>();
    let (head_b, tail_b) = b[..a.len()].as_chunks::<FOUR>();
    let mut sums = Portable::splat(0.0);
    for (a, b) in head_a.iter().zip(head_b) {
        sums = sums + Portable::load(a) * Portable::load(b);
    }
    let sums = sums.store();
    let tail: f64 = tail_a.iter().zip(tail_b).map(|(a, b)| a * b).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + tail
}

/// Adds a multiple: `y += factor x`.
pub(super) fn add(y: &mut [f64], factor: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

/// Number of registers that are factorised at once: enough to keep a processor busy while one waits for another.
const TOGETHER: usize = 4;

/// The factor, with room for a largest size.
pub(super) struct Cholesky {
    factor: Vec<f64>,
    /// Reciprocals of the diagonal; as many as there are rows.
    inverse: Vec<f64>,
    rotations: Vec<(f64, f64)>,
    scratch: Vec<f64>,
    /// A matrix by its columns, which begin at whole registers; empty where only rows come and go.
    columns: Vec<[f64; FOUR]>,
}

impl Cholesky {
    /// An empty factor, with room for a matrix of `size` rows.
    pub(super) fn of_matrices(size: usize) -> Self {
        let columns = vec![[0.0; FOUR]; size.div_ceil(FOUR) * size];
        Self { columns, ..Self::with_capacity(size) }
    }

    /// An empty factor, with room for `size` rows that come one by one.
    pub(super) fn with_capacity(size: usize) -> Self {
        Self {
            columns: Vec::new(),
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

    /// Factorises a packed lower triangle of `size` rows, for which there is room. False if it is not positive definite
    /// to rounding.
    pub(super) fn factorise(&mut self, matrix: &[f64], size: usize) -> bool {
        self.clear();
        let height = size.div_ceil(FOUR);
        let columns = &mut self.columns[..height * size];
        // What an earlier matrix left above the diagonal would be scaled again and again.
        columns.fill([0.0; FOUR]);
        for row in 0..size {
            let entries = &matrix[begin(row)..=begin(row) + row];
            for (entry, block) in entries.iter().zip(columns[row / FOUR..].iter_mut().step_by(height)) {
                block[row % FOUR] = *entry;
            }
        }
        if !compute(Factorise { columns, inverse: &mut self.inverse, height }) {
            return false;
        }
        for row in 0..size {
            let blocks = self.columns[row / FOUR..].iter().step_by(height);
            self.factor.extend(blocks.take(row + 1).map(|block| block[row % FOUR]));
        }
        true
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

/// See [`Cholesky::factorise`]. What rows above the diagonal, and below the last, become is used for no other.
struct Factorise<'a> {
    columns: &'a mut [[f64; FOUR]],
    /// Empty, with room for all.
    inverse: &'a mut Vec<f64>,
    /// Registers of a column.
    height: usize,
}

impl Work for Factorise<'_> {
    type Given = bool;

    #[inline(always)]
    fn with<L: Lanes<Stored = [f64; FOUR]>>(self) -> bool {
        let Self { columns, inverse, height } = self;
        for j in 0..columns.len() / height {
            let (done, rest) = columns.split_at_mut(j * height);
            let column = &mut rest[..height];
            let (block, lane) = (j / FOUR, j % FOUR);
            let diagonal = column[block][lane];
            let mut first = block;
            while first + TOGETHER <= height {
                eliminate::<L, TOGETHER>(done, column, first, j);
                first += TOGETHER;
            }
            match height - first {
                3 => eliminate::<L, 3>(done, column, first, j),
                2 => eliminate::<L, 2>(done, column, first, j),
                1 => eliminate::<L, 1>(done, column, first, j),
                _ => (),
            }
            let pivot = column[block][lane];
            // A pivot below rounding's share of the diagonal has no correct digit; NaN fails, too.
            if pivot.is_nan() || pivot <= 1e-14 * diagonal {
                return false;
            }
            let root = pivot.sqrt();
            inverse.push(1.0 / root);
            let scale = L::splat(1.0 / root);
            for entries in &mut column[block..] {
                *entries = (L::load(entries) * scale).store();
            }
            column[block][lane] = root;
        }
        true
    }
}

/// Subtracts the columns before column `j` from `K` registers of it.
#[inline(always)]
fn eliminate<L: Lanes<Stored = [f64; FOUR]>, const K: usize>(
    done: &[[f64; FOUR]],
    column: &mut [[f64; FOUR]],
    first: usize,
    j: usize,
) {
    let column_height = column.len();
    let Some(target) = column.get_mut(first..first + K) else { return };
    let mut left: [L; K] = std::array::from_fn(|k| L::load(&target[k]));
    for before in done.chunks_exact(column_height) {
        let factor = L::splat(before[j / FOUR][j % FOUR]);
        let Some(before) = before.get(first..first + K) else { return };
        for k in 0..K {
            left[k] = left[k] - factor * L::load(&before[k]);
        }
    }
    for k in 0..K {
        target[k] = left[k].store();
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
        for n in [1, 3, 4, 13, 16, 33] {
            factorises_and_solves_of_size(n);
        }
    }

    fn factorises_and_solves_of_size(n: usize) {
        let a = example(n);
        let mut factor = Cholesky::of_matrices(n);
        assert!(factor.factorise(&packed(&a), n));
        assert!((matrix(&factor) - &a).amax() < 1e-12);
        let mut x: Vec<f64> = (0..n).map(|k| if k < 5 { 0.0 } else { k as f64 }).collect();
        let b = DMatrix::from_column_slice(n, 1, &x);
        factor.solve_lower(&mut x, n.min(5));
        factor.solve_upper(&mut x);
        assert!((a * DMatrix::from_column_slice(n, 1, &x) - b).amax() < 1e-11);
    }

    #[test]
    fn a_singular_matrix_is_refused() {
        let mut factor = Cholesky::of_matrices(2);
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
