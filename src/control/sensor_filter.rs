//! A Kalman filter of a sum and of the sensor errors that drive it away from what another sensor says of it.

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Width of the gate, in standard deviations: beyond it the measured sum has jumped, and tells nothing of the errors.
const GATE: f64 = 6.0;

/// Means and covariance of the states: the sum first, then the errors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct SensorFilter<const STATES: usize> {
    pub mean: SVector<f64, STATES>,
    pub covariance: SMatrix<f64, STATES, STATES>,
}

impl<const STATES: usize> SensorFilter<STATES> {
    /// Nothing is known but the variances.
    pub fn new(variances: [f64; STATES]) -> Self {
        Self { mean: SVector::zeros(), covariance: SMatrix::from_diagonal(&SVector::from(variances)) }
    }

    /// Begins the sum anew. What is known of the errors stays.
    pub fn begin(&mut self, sum: f64, variance: f64) {
        self.mean[0] = sum;
        self.covariance.row_mut(0).fill(0.0);
        self.covariance.column_mut(0).fill(0.0);
        self.covariance[(0, 0)] = variance;
    }

    /// Adds to the sum, with the change of it by each error; the sum's error has a variance, each state wanders by its own.
    pub fn predict(&mut self, added: f64, by_errors: SVector<f64, STATES>, wanders: [f64; STATES]) {
        self.mean[0] += added;
        let mut by = SMatrix::<f64, STATES, STATES>::identity();
        for i in 1..STATES {
            by[(0, i)] = by_errors[i];
        }
        self.covariance = by * self.covariance * by.transpose();
        for (i, wanders) in wanders.into_iter().enumerate() {
            self.covariance[(i, i)] += wanders;
        }
    }

    /// Variance of what is seen of the states.
    pub fn variance(&self, seen: &SVector<f64, STATES>) -> f64 {
        seen.dot(&(self.covariance * seen))
    }

    /// Takes what is seen, `off` from the expected; false beyond the gate, where nothing has changed.
    pub fn update(&mut self, seen: &SVector<f64, STATES>, off: f64, noise: f64) -> bool {
        let column = self.covariance * seen;
        let variance = seen.dot(&column) + noise;
        if off * off > GATE * GATE * variance {
            return false;
        }
        let gain = column / variance;
        self.mean += gain * off;
        let updated = self.covariance - gain * column.transpose();
        self.covariance = (updated + updated.transpose()) * 0.5;
        true
    }

    /// False once numbers have outgrown the arithmetic, as those of a damaged saved state may.
    pub fn is_sound(&self) -> bool {
        let variances = self.covariance.diagonal();
        self.mean.iter().chain(&self.covariance).all(|number| number.is_finite()) && variances.min() >= 0.0
    }
}
