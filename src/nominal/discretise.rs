//! Exact discretisation under piecewise constant inputs.
//!
//! `x' = A x + B w` with `w` constant over `h` has the solution `x(h) = Phi x + Gamma w`, where
//! `exp([A B; 0 0] h) = [Phi Gamma; 0 I]` (Van Loan 1978).

use nalgebra::SMatrix;

/// Zero-order hold of `x' = A x + B w` over `h` seconds: `(Phi, Gamma)` with `x(h) = Phi x + Gamma w`.
///
/// `M` must be `N + W`, the size of the augmented matrix (a limit of const generics).
#[must_use]
pub fn zero_order_hold<const N: usize, const W: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, W>,
    h: f64,
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, W>) {
    const { assert!(M == N + W, "the augmented matrix has N + W rows") };
    let mut augmented = SMatrix::<f64, M, M>::zeros();
    augmented.fixed_view_mut::<N, N>(0, 0).copy_from(&(a * h));
    augmented.fixed_view_mut::<N, W>(0, N).copy_from(&(b * h));
    let exponential = exponential(&augmented);
    (exponential.fixed_view::<N, N>(0, 0).into_owned(), exponential.fixed_view::<N, W>(0, N).into_owned())
}

/// Degree of the Taylor polynomial: with a scaled norm of at most 1/2 its remainder is below 1e-17.
const TAYLOR_DEGREE: u32 = 13;

/// Matrix exponential by scaling and squaring of a Taylor polynomial. Needs no linear solve and no allocation; for
/// the small, moderately stiff matrices here it is as accurate as a Pade approximant.
fn exponential<const M: usize>(matrix: &SMatrix<f64, M, M>) -> SMatrix<f64, M, M> {
    let norm = (0..M).map(|column| matrix.column(column).lp_norm(1)).fold(0.0, f64::max);
    let squarings = if norm > 0.5 { (norm / 0.5).log2().ceil() as u32 } else { 0 };
    let scaled = matrix / f64::from(2_u32.saturating_pow(squarings.min(31)));
    let mut sum = SMatrix::<f64, M, M>::identity();
    for k in (1..=TAYLOR_DEGREE).rev() {
        // Horner: I + X (I + X/2 (I + X/3 (...))).
        sum = SMatrix::identity() + scaled * sum / f64::from(k);
    }
    for _ in 0..squarings {
        sum *= sum;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn double_integrator_has_its_closed_form() {
        let (phi, gamma) =
            zero_order_hold::<2, 1, 3>(&Matrix2::new(0.0, 1.0, 0.0, 0.0), &Vector2::new(0.0, 1.0), 0.3);
        assert!((phi - Matrix2::new(1.0, 0.3, 0.0, 1.0)).norm() < 1e-15);
        assert!((gamma - Vector2::new(0.045, 0.3)).norm() < 1e-15);
    }

    #[test]
    fn stiff_lag_has_its_closed_form() {
        // 150 1/s over 0.02 s: three time constants in one step.
        let (phi, gamma) =
            zero_order_hold::<1, 1, 2>(&nalgebra::Matrix1::new(-150.0), &nalgebra::Matrix1::new(150.0), 0.02);
        assert!((phi[0] - (-3.0_f64).exp()).abs() < 1e-15);
        assert!((gamma[0] - (1.0 - (-3.0_f64).exp())).abs() < 1e-15);
    }

    #[test]
    fn agrees_with_nalgebra() {
        let matrix = SMatrix::<f64, 5, 5>::from_fn(|i, j| ((i * 7 + j * 3) as f64 * 0.9).sin() * 2.0);
        let reference = matrix.exp();
        assert!((exponential(&matrix) - reference).norm() < 1e-12 * reference.norm());
    }
}
