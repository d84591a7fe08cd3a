//! Exact discretisation under piecewise constant inputs.
//!
//! `x' = A x + B w` with `w` constant over `h` has the solution `x(h) = Phi x + Gamma w`, where
//! `exp([A B; 0 0] h) = [Phi Gamma; 0 I]` (Van Loan 1978). The exponential is computed on the two blocks that are not
//! trivial, so that any number of states and inputs is served.

use nalgebra::SMatrix;

/// Degree of the Taylor polynomial: with a scaled norm of at most 1/2 its remainder is below 1e-17.
const TAYLOR_DEGREE: u32 = 13;

/// Zero-order hold of `x' = A x + B w` over `h` seconds: `(Phi, Gamma)` with `x(h) = Phi x + Gamma w`.
///
/// Scaling and squaring of a Taylor polynomial: needs no linear solve and no allocation; for the small, moderately
/// stiff matrices here it is as accurate as a Pade approximant.
#[must_use]
pub fn zero_order_hold<const N: usize, const W: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, W>,
    h: f64,
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, W>) {
    let columns = a.column_iter().map(|column| column.lp_norm(1));
    let norm = columns.chain(b.column_iter().map(|column| column.lp_norm(1))).fold(0.0, f64::max) * h;
    let squarings = if norm > 0.5 { (norm / 0.5).log2().ceil() as u32 } else { 0 };
    let scale = h / f64::from(2_u32.saturating_pow(squarings.min(31)));
    let (a, b) = (a * scale, b * scale);
    let mut phi = SMatrix::<f64, N, N>::identity();
    let mut gamma = SMatrix::<f64, N, W>::zeros();
    for k in (1..=TAYLOR_DEGREE).rev() {
        // Horner, X = [A B; 0 0]: I + X (I + X/2 (I + X/3 (...))).
        gamma = (a * gamma + b) / f64::from(k);
        phi = SMatrix::identity() + a * phi / f64::from(k);
    }
    for _ in 0..squarings {
        gamma += phi * gamma;
        phi *= phi;
    }
    (phi, gamma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn double_integrator_has_its_closed_form() {
        let (phi, gamma) = zero_order_hold(&Matrix2::new(0.0, 1.0, 0.0, 0.0), &Vector2::new(0.0, 1.0), 0.3);
        assert!((phi - Matrix2::new(1.0, 0.3, 0.0, 1.0)).norm() < 1e-15);
        assert!((gamma - Vector2::new(0.045, 0.3)).norm() < 1e-15);
    }

    #[test]
    fn stiff_lag_has_its_closed_form() {
        // 150 1/s over 0.02 s: three time constants in one step.
        let (phi, gamma) =
            zero_order_hold(&nalgebra::Matrix1::new(-150.0), &nalgebra::Matrix1::new(150.0), 0.02);
        assert!((phi[0] - (-3.0_f64).exp()).abs() < 1e-15);
        assert!((gamma[0] - (1.0 - (-3.0_f64).exp())).abs() < 1e-15);
    }

    #[test]
    fn agrees_with_nalgebra() {
        let a = SMatrix::<f64, 5, 5>::from_fn(|i, j| ((i * 7 + j * 3) as f64 * 0.9).sin() * 2.0);
        let b = SMatrix::<f64, 5, 2>::from_fn(|i, j| ((i * 3 + j * 5) as f64 * 1.3).cos() * 30.0);
        let mut augmented = SMatrix::<f64, 7, 7>::zeros();
        augmented.fixed_view_mut::<5, 5>(0, 0).copy_from(&a);
        augmented.fixed_view_mut::<5, 2>(0, 5).copy_from(&b);
        let reference = (augmented * 0.3).exp();
        let (phi, gamma) = zero_order_hold(&a, &b, 0.3);
        assert!((phi - reference.fixed_view::<5, 5>(0, 0)).norm() < 1e-12 * reference.norm());
        assert!((gamma - reference.fixed_view::<5, 2>(0, 5)).norm() < 1e-12 * reference.norm());
    }
}
