//! Exact discretisation under piecewise constant inputs.
//!
//! `x' = A x + B w` with `w` constant over `h` has the solution `x(h) = Phi x + Gamma w`, where
//! `exp([A B; 0 0] h) = [Phi Gamma; 0 I]` (Van Loan 1978). The matrix is block triangular and stays so in every product:
//! only the blocks that change are computed. A chain, such as a vehicle behind its actuator, has a row of blocks more:
//!
//! ```text
//! x' = A x + C z + B w          exp([A C B]     [Phi_xx Phi_xz Gamma_x]
//! z' =       F z + G w              [0 F G] h) = [0      Phi_zz Gamma_z]
//!                                   [0 0 0]      [0      0      I      ]
//! ```

use nalgebra::SMatrix;

/// A chain of two linear systems with held common inputs, in continuous time or over a step. `x` of `N` states is
/// driven by `z` of `K` states.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct Chain<const N: usize, const K: usize, const W: usize> {
    pub x_by_x: SMatrix<f64, N, N>,
    pub x_by_z: SMatrix<f64, N, K>,
    pub z_by_z: SMatrix<f64, K, K>,
    pub x_by_input: SMatrix<f64, N, W>,
    pub z_by_input: SMatrix<f64, K, W>,
}

/// Zero-order hold of `x' = A x + B w` over `h` seconds: `(Phi, Gamma)` with `x(h) = Phi x + Gamma w`.
#[must_use]
pub fn zero_order_hold<const N: usize, const W: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, W>,
    h: f64,
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, W>) {
    let plain = Chain::<N, 0, W> {
        x_by_x: *a,
        x_by_z: SMatrix::zeros(),
        z_by_z: SMatrix::zeros(),
        x_by_input: *b,
        z_by_input: SMatrix::zeros(),
    };
    let step = plain.zero_order_hold(h);
    (step.x_by_x, step.x_by_input)
}

/// Degree of the Taylor polynomial: with a scaled norm of at most 1/2 its remainder is below 1e-17.
const TAYLOR_DEGREE: u32 = 13;

impl<const N: usize, const K: usize, const W: usize> Chain<N, K, W> {
    /// The chain over `h` seconds with held inputs.
    ///
    /// The matrix exponential by scaling and squaring of a Taylor polynomial. It needs no linear solve and no
    /// allocation; for the small, moderately stiff matrices here it is as accurate as a Pade approximant.
    #[must_use]
    pub fn zero_order_hold(&self, h: f64) -> Self {
        let whole = self.map(|entry| entry * h);
        let norm = whole.norm();
        let squarings = if norm > 0.5 { (norm / 0.5).log2().ceil() as u32 } else { 0 };
        let parts = f64::from(2_u32.saturating_pow(squarings.min(31)));
        let scaled = whole.map(|entry| entry / parts);
        let mut sum = Self {
            x_by_x: SMatrix::identity(),
            x_by_z: SMatrix::zeros(),
            z_by_z: SMatrix::identity(),
            x_by_input: SMatrix::zeros(),
            z_by_input: SMatrix::zeros(),
        };
        for k in (1..=TAYLOR_DEGREE).rev() {
            // Horner: I + X (I + X/2 (I + X/3 (...))).
            sum = scaled.times(&sum).map(|entry| entry / f64::from(k));
            sum.x_by_x += SMatrix::<f64, N, N>::identity();
            sum.z_by_z += SMatrix::<f64, K, K>::identity();
        }
        for _ in 0..squarings {
            sum = sum.times(&sum);
        }
        sum
    }

    /// Product of the block matrices, where the last block of the diagonal of `right` is the identity.
    fn times(&self, right: &Self) -> Self {
        Self {
            x_by_x: self.x_by_x * right.x_by_x,
            x_by_z: self.x_by_x * right.x_by_z + self.x_by_z * right.z_by_z,
            z_by_z: self.z_by_z * right.z_by_z,
            x_by_input: self.x_by_x * right.x_by_input + self.x_by_z * right.z_by_input + self.x_by_input,
            z_by_input: self.z_by_z * right.z_by_input + self.z_by_input,
        }
    }

    fn map(&self, change: impl Fn(f64) -> f64 + Copy) -> Self {
        Self {
            x_by_x: self.x_by_x.map(change),
            x_by_z: self.x_by_z.map(change),
            z_by_z: self.z_by_z.map(change),
            x_by_input: self.x_by_input.map(change),
            z_by_input: self.z_by_input.map(change),
        }
    }

    /// Largest sum of magnitudes of a column.
    fn norm(&self) -> f64 {
        let sum = |column: &[f64]| column.iter().map(|entry| entry.abs()).sum::<f64>();
        let of_x = (0..N).map(|j| sum(self.x_by_x.column(j).as_slice()));
        let of_z =
            (0..K).map(|j| sum(self.x_by_z.column(j).as_slice()) + sum(self.z_by_z.column(j).as_slice()));
        let of_inputs = (0..W)
            .map(|j| sum(self.x_by_input.column(j).as_slice()) + sum(self.z_by_input.column(j).as_slice()));
        of_x.chain(of_z).chain(of_inputs).fold(0.0, f64::max)
    }
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

    /// A chain as one matrix.
    fn augmented(chain: &Chain<4, 2, 3>, corner: f64) -> SMatrix<f64, 9, 9> {
        let mut matrix = SMatrix::<f64, 9, 9>::zeros();
        matrix.fixed_view_mut::<4, 4>(0, 0).copy_from(&chain.x_by_x);
        matrix.fixed_view_mut::<4, 2>(0, 4).copy_from(&chain.x_by_z);
        matrix.fixed_view_mut::<4, 3>(0, 6).copy_from(&chain.x_by_input);
        matrix.fixed_view_mut::<2, 2>(4, 4).copy_from(&chain.z_by_z);
        matrix.fixed_view_mut::<2, 3>(4, 6).copy_from(&chain.z_by_input);
        matrix.fixed_view_mut::<3, 3>(6, 6).fill_diagonal(corner);
        matrix
    }

    #[test]
    fn a_chain_agrees_with_nalgebra() {
        let draw = |i: usize, j: usize, k: usize| ((i * 7 + j * 3 + k) as f64 * 0.9).sin() * 40.0;
        let chain = Chain::<4, 2, 3> {
            x_by_x: SMatrix::from_fn(|i, j| draw(i, j, 0)),
            x_by_z: SMatrix::from_fn(|i, j| draw(i, j, 1)),
            z_by_z: SMatrix::from_fn(|i, j| draw(i, j, 2)),
            x_by_input: SMatrix::from_fn(|i, j| draw(i, j, 3)),
            z_by_input: SMatrix::from_fn(|i, j| draw(i, j, 4)),
        };
        let reference = (augmented(&chain, 0.0) * 0.05).exp();
        let step = augmented(&chain.zero_order_hold(0.05), 1.0);
        assert!((step - reference).norm() < 1e-12 * reference.norm());
    }
}
