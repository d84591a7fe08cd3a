//! Symmetric positive definite systems with a narrow band, open or cyclic: the normal equations of a smoothing
//! spline.
//!
//! A cyclic matrix has corners besides its band. Its last `width` unknowns are then a border: with the rest `B`
//! (banded), the border's coupling `C` and block `D`, the border solves `(D - C' B^-1 C) z = d - C' B^-1 b`.

use super::spline::Vector;
use nalgebra::{Cholesky, DMatrix, Dyn};

/// A symmetric banded matrix, perhaps with corners. `band[i][k]` is entry `(i, i + k)`, indices modulo the size if
/// cyclic.
#[derive(Clone)]
pub(super) struct Banded<const W: usize> {
    pub band: Vec<[f64; W]>,
    pub cyclic: bool,
}

impl<const W: usize> Banded<W> {
    /// The zero matrix with `size` rows and entries up to `W - 1` off the diagonal. A cyclic one wants
    /// `size >= 3 * W`.
    pub fn new(size: usize, cyclic: bool) -> Self {
        Self { band: vec![[0.0; W]; size], cyclic }
    }

    /// Adds `value` to the entries `(i, j)` and `(j, i)`, `j = i + k` (modulo the size if cyclic).
    pub fn add(&mut self, i: usize, k: usize, value: f64) {
        self.band[i][k] += value;
    }

    /// The factors of the matrix; `None` if it is not positive definite.
    pub fn factored(&self) -> Option<Factored<W>> {
        let size = self.band.len();
        let width = if self.cyclic { W - 1 } else { 0 };
        let inner = size - width;
        let lower = self.factor(inner)?;
        if width == 0 {
            return Some(Factored { lower, border: None });
        }
        let coupling = |row: usize, column: usize| {
            let j = inner + column;
            let (forward, backward) = (j - row, row + size - j);
            if forward < W {
                self.band[row][forward]
            } else if backward < W {
                self.band[j][backward]
            } else {
                0.0
            }
        };
        let columns = DMatrix::from_fn(inner, width, coupling);
        let mut solved = columns.clone();
        for k in 0..width {
            let mut column: Vec<Vector> = (0..inner).map(|i| [columns[(i, k)], 0.0]).collect();
            solve_factored(&lower, &mut column);
            for i in 0..inner {
                solved[(i, k)] = column[i][0];
            }
        }
        let block = DMatrix::from_fn(width, width, |a, b| {
            let (low, high) = (a.min(b), a.max(b));
            self.band[inner + low][high - low]
        });
        let schur = (block - columns.transpose() * &solved).cholesky()?;
        Some(Factored { lower, border: Some(Border { columns, solved, schur }) })
    }

    /// Cholesky factor of the leading `size` rows: `l[i][k]` is entry `(i, i - k)`.
    fn factor(&self, size: usize) -> Option<Vec<[f64; W]>> {
        let mut l = vec![[0.0; W]; size];
        for i in 0..size {
            for k in (0..W.min(i + 1)).rev() {
                let j = i - k;
                let mut sum = self.band[j][k];
                for m in 1..W - k {
                    if m <= j {
                        sum -= l[i][k + m] * l[j][m];
                    }
                }
                if k == 0 {
                    if sum.is_nan() || sum <= 0.0 {
                        return None;
                    }
                    l[i][0] = sum.sqrt();
                } else {
                    l[i][k] = sum / l[j][0];
                }
            }
        }
        Some(l)
    }
}

/// The factors of a positive definite matrix.
pub(super) struct Factored<const W: usize> {
    /// Of the rows that are not the border.
    lower: Vec<[f64; W]>,
    /// Of a cyclic matrix.
    border: Option<Border>,
}

struct Border {
    /// `C`.
    columns: DMatrix<f64>,
    /// `B^-1 C`.
    solved: DMatrix<f64>,
    schur: Cholesky<f64, Dyn>,
}

impl<const W: usize> Factored<W> {
    /// Solves for two right-hand sides at once.
    pub fn solve(&self, right: &[Vector]) -> Vec<Vector> {
        let inner = self.lower.len();
        let mut x = right[..inner].to_vec();
        solve_factored(&self.lower, &mut x);
        let Some(Border { columns, solved, schur }) = &self.border else { return x };
        let width = columns.ncols();
        let rest = DMatrix::from_fn(width, 2, |k, c| {
            right[inner + k][c] - (0..inner).map(|i| columns[(i, k)] * x[i][c]).sum::<f64>()
        });
        let z = schur.solve(&rest);
        for (i, x) in x.iter_mut().enumerate() {
            for (c, x) in x.iter_mut().enumerate() {
                *x -= (0..width).map(|k| solved[(i, k)] * z[(k, c)]).sum::<f64>();
            }
        }
        x.extend((0..width).map(|k| [z[(k, 0)], z[(k, 1)]]));
        x
    }

    /// The logarithm of the determinant.
    pub fn log_determinant(&self) -> f64 {
        let border = self.border.as_ref().map(|border| border.schur.l_dirty().diagonal());
        let diagonal = self
            .lower
            .iter()
            .map(|row| row[0])
            .chain(border.iter().flat_map(|border| border.iter().copied()));
        2.0 * diagonal.map(f64::ln).sum::<f64>()
    }
}

/// Forward and backward substitution.
fn solve_factored<const W: usize>(l: &[[f64; W]], x: &mut [Vector]) {
    let n = x.len();
    for i in 0..n {
        for k in 1..W.min(i + 1) {
            x[i] = [0, 1].map(|c| x[i][c] - l[i][k] * x[i - k][c]);
        }
        x[i] = x[i].map(|value| value / l[i][0]);
    }
    for i in (0..n).rev() {
        for k in 1..W {
            if i + k < n {
                x[i] = [0, 1].map(|c| x[i][c] - l[i + k][k] * x[i + k][c]);
            }
        }
        x[i] = x[i].map(|value| value / l[i][0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_open_and_cyclic_systems() {
        for cyclic in [false, true] {
            let n = 40;
            let mut matrix = Banded::<6>::new(n, cyclic);
            for i in 0..n {
                for k in 0..6 {
                    if cyclic || i + k < n {
                        matrix.add(i, k, if k == 0 { 9.0 } else { (i as f64 * 1.7 + k as f64).sin() });
                    }
                }
            }
            let want: Vec<Vector> = (0..n).map(|i| [(i as f64).cos(), i as f64]).collect();
            let mut right = vec![[0.0; 2]; n];
            for i in 0..n {
                for k in 0..6 {
                    let j = (i + k) % n;
                    for c in 0..2 {
                        right[i][c] += matrix.band[i][k] * want[j][c];
                        if k > 0 {
                            right[j][c] += matrix.band[i][k] * want[i][c];
                        }
                    }
                }
            }
            let factored = matrix.factored().unwrap();
            let got = factored.solve(&right);
            for (a, b) in got.iter().zip(&want) {
                assert!((a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-10, "{cyclic}: {a:?} {b:?}");
            }
            let dense = DMatrix::from_fn(n, n, |i, j| {
                let entry = |i: usize, j: usize| {
                    let k = if cyclic { (j + n - i) % n } else { j.wrapping_sub(i) };
                    if k < 6 { matrix.band[i][k] } else { 0.0 }
                };
                if i == j { entry(i, i) } else { entry(i, j) + entry(j, i) }
            });
            let want = dense.determinant().ln();
            let got = factored.log_determinant();
            assert!((got - want).abs() < 1e-10 * want.abs(), "{cyclic}: {got} {want}");
        }
    }
}
