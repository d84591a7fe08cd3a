//! A linear system of a few equations, by Gaussian elimination with partial pivoting (Golub and Van Loan, Matrix
//! Computations, 3.4). nalgebra has it, but not for a number of equations that is a parameter of the type.

use nalgebra::{SMatrix, SVector};

/// Solves `matrix x = right`; none if the matrix is singular.
pub(super) fn solve<const S: usize>(
    mut matrix: SMatrix<f64, S, S>,
    mut right: SVector<f64, S>,
) -> Option<SVector<f64, S>> {
    for i in 0..S {
        let mut pivot = i;
        for row in i + 1..S {
            if matrix[(row, i)].abs() > matrix[(pivot, i)].abs() {
                pivot = row;
            }
        }
        if matrix[(pivot, i)] == 0.0 {
            return None;
        }
        matrix.swap_rows(i, pivot);
        right.swap_rows(i, pivot);
        let inverse = 1.0 / matrix[(i, i)];
        for row in i + 1..S {
            let factor = matrix[(row, i)] * inverse;
            for column in i + 1..S {
                matrix[(row, column)] -= factor * matrix[(i, column)];
            }
            right[row] -= factor * right[i];
        }
    }
    for i in (0..S).rev() {
        right[i] /= matrix[(i, i)];
        for row in 0..i {
            right[row] -= matrix[(row, i)] * right[i];
        }
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::Random;

    #[test]
    fn it_agrees_with_nalgebra_to_the_bit() {
        let mut random = Random::new(1);
        let mut draw = || 2.0 * random.uniform() - 1.0;
        for _ in 0..200 {
            let matrix = SMatrix::<f64, 4, 4>::from_fn(|_, _| draw());
            let right = SVector::<f64, 4>::from_fn(|_, _| draw());
            assert_eq!(solve(matrix, right), matrix.lu().solve(&right));
        }
    }

    #[test]
    fn a_singular_matrix_has_no_solution() {
        let matrix = SMatrix::<f64, 2, 2>::new(0.0, 1.0, 0.0, 2.0);
        assert_eq!(solve(matrix, SVector::<f64, 2>::new(1.0, 1.0)), None);
    }
}
