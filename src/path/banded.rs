//! Symmetric positive definite systems with a narrow band, open or cyclic: the normal equations of a smoothing
//! spline.
//!
//! A cyclic matrix has corners besides its band. Its last `width` unknowns are then a border: with the rest `B`
//! (banded), the border's coupling `C` and block `D`, the border solves `(D - C' B^-1 C) z = d - C' B^-1 b`.

use super::spline::Vector;

/// A symmetric banded matrix, perhaps with corners. `band[i][k]` is entry `(i, i + k)`, indices modulo the size if
/// cyclic.
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

    /// Solves for two right-hand sides at once; `None` if the matrix is not positive definite.
    pub fn solve(&self, right: &[Vector]) -> Option<Vec<Vector>> {
        let size = self.band.len();
        let border = if self.cyclic { W - 1 } else { 0 };
        let inner = size - border;
        let factor = self.factor(inner)?;
        let mut x = right[..inner].to_vec();
        solve_factored(&factor, &mut x);
        if border == 0 {
            return Some(x);
        }
        // Columns of C, two at a time in the two components of a Vector.
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
        let columns = nalgebra::DMatrix::from_fn(inner, border, coupling);
        let mut solved = columns.clone();
        for k in 0..border {
            let mut column: Vec<Vector> = (0..inner).map(|i| [columns[(i, k)], 0.0]).collect();
            solve_factored(&factor, &mut column);
            for i in 0..inner {
                solved[(i, k)] = column[i][0];
            }
        }
        let block = nalgebra::DMatrix::from_fn(border, border, |a, b| {
            let (low, high) = (a.min(b), a.max(b));
            self.band[inner + low][high - low]
        });
        let schur = block - columns.transpose() * &solved;
        let rest = nalgebra::DMatrix::from_fn(border, 2, |k, c| {
            right[inner + k][c] - (0..inner).map(|i| columns[(i, k)] * x[i][c]).sum::<f64>()
        });
        let z = schur.cholesky()?.solve(&rest);
        for i in 0..inner {
            for c in 0..2 {
                x[i][c] -= (0..border).map(|k| solved[(i, k)] * z[(k, c)]).sum::<f64>();
            }
        }
        x.extend((0..border).map(|k| [z[(k, 0)], z[(k, 1)]]));
        Some(x)
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
            let got = matrix.solve(&right).unwrap();
            for (a, b) in got.iter().zip(&want) {
                assert!((a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-10, "{cyclic}: {a:?} {b:?}");
            }
        }
    }
}
