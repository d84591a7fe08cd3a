//! Condensing: from a linear model over the horizon to `y = free + G U`.
//!
//! With `x_{j+1} = A x_j + B u_j + w_j` and outputs `y_j = C x_j`, j = 1..N:
//!
//! ```text
//! free_j = C (A^j x_0 + sum_{m<j} A^{j-1-m} w_m),     G_{j,m} = C A^{j-1-m} B   (m < j)
//! ```
//!
//! The model is constant over the horizon, so `G` is block Toeplitz: N products with a vector give all of it.

use super::tracking_qp::TrackingQp;
use nalgebra::{SMatrix, SVector};

/// Writes `free` and `gain` of a one-input problem whose outputs are the states named in `tracked`.
///
/// `disturbance(j)` is `w_j`.
pub fn condense<const N: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SVector<f64, N>,
    start: &SVector<f64, N>,
    disturbance: impl Fn(usize) -> SVector<f64, N>,
    tracked: &[usize],
    problem: &mut TrackingQp,
) {
    let (horizon, outputs) = (problem.shape.horizon, tracked.len());
    debug_assert_eq!((problem.shape.outputs, problem.shape.inputs), (outputs, 1));
    let mut x = *start;
    let mut impulse = *b;
    for j in 0..horizon {
        x = a * x + disturbance(j);
        for (i, &state) in tracked.iter().enumerate() {
            problem.free[j * outputs + i] = x[state];
            // The impulse response after j steps fills one block diagonal.
            for m in 0..horizon - j {
                problem.gain[((m + j) * outputs + i) * horizon + m] = impulse[state];
            }
        }
        impulse = a * impulse;
    }
}
