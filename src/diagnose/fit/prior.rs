//! Prior over the uncertain parameters, and what is left of it where some are free.

use crate::diagnose::problem::Problem;
use crate::diagnose::replay::{Channel, ReplayVehicle};
use nalgebra::{DMatrix, DVector};

/// Standard deviation of a free coordinate: effects of five units are ordinary.
pub(in crate::diagnose) const FREE: f64 = 5.0;

/// Prior over the uncertain parameters: mean and covariance of the coordinates.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Coordinates that are expected.
    pub mean: Vec<f64>,
    /// Their covariance; a variance of 0: fixed.
    pub covariance: DMatrix<f64>,
    /// Errors of the model's form that a reference log has shown, in the channels' units.
    pub form: Vec<(Channel, f64)>,
}

/// Prior precision of the free coordinates.
#[derive(Debug, Clone)]
pub struct Precision {
    /// Places of the uncertain parameters that are free.
    pub free: Vec<usize>,
    pub(super) matrix: DMatrix<f64>,
}

impl Precision {
    pub(super) fn of(&self, off: &[f64]) -> DVector<f64> {
        DVector::from_iterator(self.free.len(), self.free.iter().map(|&i| off[i]))
    }

    /// Penalty of coordinates that are so far off; infinite where a fixed one is off.
    #[must_use]
    pub fn penalty(&self, off: &[f64]) -> f64 {
        if (0..off.len()).any(|i| off[i] != 0.0 && !self.free.contains(&i)) {
            return f64::INFINITY;
        }
        let off = self.of(off);
        off.dot(&(&self.matrix * &off))
    }

    /// The same prior with standard deviations so many times as large.
    #[must_use]
    pub fn widened(mut self, times: f64) -> Self {
        self.matrix /= times * times;
        self
    }
}

impl Prior {
    /// Tolerances of the uncertain parameters.
    #[must_use]
    pub fn of<V: ReplayVehicle>(problem: &Problem<V>) -> Self {
        let variances: Vec<f64> =
            problem.uncertain.iter().map(|uncertain| uncertain.tolerance.powi(2)).collect();
        Self {
            mean: vec![0.0; problem.uncertain.len()],
            covariance: DMatrix::from_diagonal(&DVector::from_vec(variances)),
            form: Vec::new(),
        }
    }

    /// With the tolerances of the vehicle's own numbers so many times as wide. How good a file is says nothing of sensors,
    /// nor of the model's form.
    #[must_use]
    pub fn times<V>(&self, problem: &Problem<V>, wider: f64) -> Self {
        let of = |i: usize| if problem.uncertain[i].is_of_the_file() { wider } else { 1.0 };
        let count = self.mean.len();
        let covariance = DMatrix::from_fn(count, count, |i, j| self.covariance[(i, j)] * of(i) * of(j));
        Self { covariance, ..self.clone() }
    }

    /// With some uncertain parameters held where they are.
    #[must_use]
    pub fn holding(&self, held: &[usize], x: &[f64]) -> Self {
        let mut prior = self.clone();
        for &i in held {
            prior.mean[i] = x[i];
            prior.covariance.row_mut(i).fill(0.0);
            prior.covariance.column_mut(i).fill(0.0);
        }
        prior
    }

    /// The same prior with some uncertain parameters free, and their companions: a payload takes its place with it.
    #[must_use]
    pub fn free<V: ReplayVehicle>(&self, problem: &Problem<V>, free: &[usize]) -> Precision {
        self.free_but(problem, free, &[])
    }

    /// The same with some uncertain parameters fixed.
    #[must_use]
    pub fn free_but<V: ReplayVehicle>(
        &self,
        problem: &Problem<V>,
        free: &[usize],
        fixed: &[usize],
    ) -> Precision {
        let mut covariance = self.covariance.clone();
        for &i in free {
            covariance[(i, i)] += FREE.powi(2);
            if let Some((companion, deviation)) = problem.companion(i) {
                covariance[(companion, companion)] += deviation.powi(2);
            }
        }
        let free: Vec<usize> =
            (0..self.mean.len()).filter(|&i| covariance[(i, i)] > 0.0 && !fixed.contains(&i)).collect();
        let of_free = DMatrix::from_fn(free.len(), free.len(), |a, b| covariance[(free[a], free[b])]);
        let diagonal = DMatrix::from_diagonal(&of_free.diagonal().map(|variance| 1.0 / variance));
        let matrix = of_free.cholesky().map_or(diagonal, |factor| factor.inverse());
        Precision { free, matrix }
    }

    /// Coordinates of some effects alone, all else as expected.
    #[must_use]
    pub fn only<V: ReplayVehicle>(&self, problem: &Problem<V>, effects: &[usize], x: &[f64]) -> Vec<f64> {
        let effects = problem.with_companions(effects);
        (0..x.len()).map(|i| if effects.contains(&i) { x[i] } else { self.mean[i] }).collect()
    }

    /// Coordinates without some effects: these as expected, a payload's place with it.
    #[must_use]
    pub fn without<V: ReplayVehicle>(&self, problem: &Problem<V>, effects: &[usize], x: &[f64]) -> Vec<f64> {
        let effects = problem.with_companions(effects);
        (0..x.len()).map(|i| if effects.contains(&i) { self.mean[i] } else { x[i] }).collect()
    }

    /// Coordinates less those expected.
    #[must_use]
    pub fn off(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.mean).map(|(x, mean)| x - mean).collect()
    }
}
