//! A few linear equations, many times with but one column different, by Gaussian elimination with partial pivoting
//! (Golub and Van Loan, Matrix Computations, 3.4).
//!
//! ```text
//! v x_0 + [m_1 .. m_{S-1}] [x_1 .. x_{S-1}]' = r            m once, v and r each time
//! ```
//!
//! The columns that stay are eliminated once; the one that changes comes last.

use nalgebra::{SMatrix, SVector};

/// The equations without their first column.
#[derive(Debug, Clone)]
pub(super) struct Equations<const S: usize> {
    /// Factors below the diagonal and the remainder above it, of the columns from the second on, in the rows' new
    /// order.
    factor: [[f64; S]; S],
    /// Reciprocals of the pivots.
    inverse: [f64; S],
    /// Equation in each row.
    order: [usize; S],
}

impl<const S: usize> Equations<S> {
    /// Eliminates all columns of `matrix` but the first, which is not read; none if they depend on each other.
    pub(super) fn new(matrix: &SMatrix<f64, S, S>) -> Option<Self> {
        let mut factor: [[f64; S]; S] = std::array::from_fn(|row| {
            std::array::from_fn(|k| if k + 1 < S { matrix[(row, k + 1)] } else { 0.0 })
        });
        let mut order = std::array::from_fn(|row| row);
        let mut inverse = [0.0; S];
        for k in 0..S - 1 {
            let mut pivot = k;
            for row in k + 1..S {
                if factor[row][k].abs() > factor[pivot][k].abs() {
                    pivot = row;
                }
            }
            if factor[pivot][k] == 0.0 {
                return None;
            }
            factor.swap(k, pivot);
            order.swap(k, pivot);
            inverse[k] = 1.0 / factor[k][k];
            let of_pivot = factor[k];
            for of_row in &mut factor[k + 1..] {
                of_row[k] *= inverse[k];
                for column in k + 1..S - 1 {
                    of_row[column] -= of_row[k] * of_pivot[column];
                }
            }
        }
        Some(Self { factor, inverse, order })
    }

    /// Solves for a first column and a right side; none if the matrix is singular.
    pub(super) fn solve(&self, column: &SVector<f64, S>, right: &SVector<f64, S>) -> Option<SVector<f64, S>> {
        let mut v: [f64; S] = std::array::from_fn(|row| column[self.order[row]]);
        let mut r: [f64; S] = std::array::from_fn(|row| right[self.order[row]]);
        for row in 1..S {
            for k in 0..row {
                v[row] -= self.factor[row][k] * v[k];
                r[row] -= self.factor[row][k] * r[k];
            }
        }
        if v[S - 1] == 0.0 {
            return None;
        }
        let mut x = SVector::zeros();
        x[0] = r[S - 1] / v[S - 1];
        for k in (0..S - 1).rev() {
            let mut rest = r[k] - v[k] * x[0];
            for column in k + 1..S - 1 {
                rest -= self.factor[k][column] * x[column + 1];
            }
            x[k + 1] = rest * self.inverse[k];
        }
        Some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;

    #[test]
    fn it_agrees_with_nalgebra() {
        let mut random = Random::new(1);
        let mut draw = || 2.0 * random.uniform() - 1.0;
        for _ in 0..200 {
            let mut matrix = SMatrix::<f64, 4, 4>::from_fn(|_, _| draw());
            let equations = Equations::new(&matrix).unwrap();
            for _ in 0..3 {
                let column = SVector::<f64, 4>::from_fn(|_, _| draw());
                let right = SVector::<f64, 4>::from_fn(|_, _| draw());
                matrix.set_column(0, &column);
                let (found, expected) =
                    (equations.solve(&column, &right).unwrap(), matrix.lu().solve(&right).unwrap());
                assert!((found - expected).norm() < 1e-9 * expected.norm(), "{found} {expected}");
            }
        }
    }

    #[test]
    fn a_singular_matrix_has_no_solution() {
        let matrix = SMatrix::<f64, 2, 2>::new(9.0, 1.0, 9.0, 2.0);
        let equations = Equations::new(&matrix).unwrap();
        let dependent = SVector::<f64, 2>::new(0.5, 1.0);
        assert_eq!(equations.solve(&dependent, &SVector::<f64, 2>::new(1.0, 1.0)), None);
        assert!(Equations::new(&SMatrix::<f64, 2, 2>::new(1.0, 0.0, 1.0, 0.0)).is_none());
    }
}
