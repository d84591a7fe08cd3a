//! Linear equations in the complex plane, and the spectral radius of a matrix.

use nalgebra::{Complex, DMatrix};

/// `(z - A)^-1 b` by elimination with pivoting.
pub(super) fn resolve<const N: usize>(
    z: Complex<f64>,
    a: impl Fn(usize, usize) -> f64,
    b: [Complex<f64>; N],
) -> [Complex<f64>; N] {
    solve_shifted(z, |i, j| a(i, j).into(), b)
}

/// The same with a complex `A`.
pub(super) fn solve_shifted<const N: usize>(
    z: Complex<f64>,
    a: impl Fn(usize, usize) -> Complex<f64>,
    mut b: [Complex<f64>; N],
) -> [Complex<f64>; N] {
    let mut m: [[Complex<f64>; N]; N] =
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { z - a(i, j) } else { -a(i, j) }));
    for k in 0..N {
        let pivot =
            (k..N).fold(k, |best, i| if m[i][k].norm_sqr() > m[best][k].norm_sqr() { i } else { best });
        m.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..N {
            let factor = m[i][k] / m[k][k];
            let above = m[k];
            for (entry, above) in m[i].iter_mut().zip(above).skip(k) {
                *entry -= factor * above;
            }
            let above = b[k];
            b[i] -= factor * above;
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            let behind = b[j];
            b[k] -= m[k][j] * behind;
        }
        b[k] /= m[k][k];
    }
    b
}

/// Magnitude of a matrix's largest eigenvalue: `|A^n|^(1/n)` for `n = 2^48`, the powers by squaring. Unlike iterations
/// for eigenvalues it always comes to an end, also for the shifts of a memory, which are far from normal.
#[must_use]
pub(super) fn spectral_radius(mut power: DMatrix<f64>) -> f64 {
    let mut logarithm = 0.0;
    let mut share = 1.0;
    for _ in 0..48 {
        let size = power.norm();
        if size == 0.0 {
            return 0.0;
        }
        logarithm += share * size.ln();
        share *= 0.5;
        power /= size;
        power = &power * &power;
    }
    logarithm.exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn the_spectral_radius_of_known_matrices() {
        let rotation = dmatrix![0.6, -0.7; 0.7, 0.6];
        assert!((spectral_radius(rotation) - 0.85_f64.sqrt()).abs() < 1e-12);
        // A Jordan block, and a memory alone.
        assert!((spectral_radius(dmatrix![0.9, 1.0; 0.0, 0.9]) - 0.9).abs() < 1e-12);
        assert_eq!(spectral_radius(dmatrix![0.0, 0.0; 1.0, 0.0]), 0.0);
        assert!((spectral_radius(dmatrix![1.2, 5.0; 0.0, 0.3]) - 1.2).abs() < 1e-12);
    }
}
