//! The weights that each row may choose, and the search that chooses them: the same budget for every row.
//!
//! The cost is homogeneous, so the lateral error's weight stays 1 and the others are searched, over decades. The search
//! begins with the same few designs for every row, from the default to very tight ones, spread over the noises where a
//! row has an observer, and with what the nominal MPC found; then the covariance matrix adaptation evolution strategy (CMA-ES) goes on from the best of them.
//! Nothing but the drives' scores is looked at: the result is the same on any number of threads.
//!
//! Source: Hansen, The CMA evolution strategy: a tutorial, 2016.

use crate::control::{ControllerParameters, MpcParameters};
use cmaes::{CMAESOptions, DVector};
use serde::{Deserialize, Serialize};

/// What is searched.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Weights {
    pub q_e1_rate: f64,
    pub q_e2: f64,
    pub q_e2_rate: f64,
    pub r_rate: f64,
    /// 0 where there is no observer.
    pub disturbance_noise: f64,
    /// 0 where there is no observer, m/s.
    pub prediction_noise: f64,
}

/// Numbers that are searched.
const AXES: usize = 6;

/// Ranges of the search.
const RANGES: [(f64, f64); AXES] =
    [(1e-3, 3.0), (1e-3, 30.0), (1e-4, 3.0), (1e-6, 1.0), (1e-4, 1.0), (1e-3, 1.0)];
/// First standard deviation of the evolution strategy, as a share of the ranges.
const STEP: f64 = 0.12;
/// What leaving the ranges costs, for each range's width.
const OUTSIDE: f64 = 10.0;

impl Default for Weights {
    /// The controller's default weights, without an observer.
    fn default() -> Self {
        let p = MpcParameters::default();
        Self {
            q_e1_rate: p.q_e1_rate,
            q_e2: p.q_e2,
            q_e2_rate: p.q_e2_rate,
            r_rate: p.r_rate,
            disturbance_noise: 0.0,
            prediction_noise: 0.0,
        }
    }
}

impl Weights {
    /// Takes the weights over into parameters.
    pub fn apply(&self, parameters: &mut ControllerParameters) {
        let ControllerParameters { mpc, observer, .. } = parameters;
        (mpc.q_e1_rate, mpc.q_e2, mpc.q_e2_rate) = (self.q_e1_rate, self.q_e2, self.q_e2_rate);
        mpc.r_rate = self.r_rate;
        (observer.disturbance_noise, observer.prediction_noise) =
            (self.disturbance_noise, self.prediction_noise);
    }

    /// From a point of the unit cube; without an observer the last two numbers are missing.
    fn at(point: &[f64]) -> Self {
        let value = |i: usize| {
            let (low, high) = RANGES[i];
            low * (high / low).powf(point[i])
        };
        let observes = point.len() == AXES;
        Self {
            q_e1_rate: value(0),
            q_e2: value(1),
            q_e2_rate: value(2),
            r_rate: value(3),
            disturbance_noise: if observes { value(4) } else { 0.0 },
            prediction_noise: if observes { value(5) } else { 0.0 },
        }
    }
}

/// Designs that every search begins with: `q_e1_rate`, `q_e2`, `q_e2_rate`, `r_rate`. The default first, then from
/// damped to tight.
const BEGINNING: [[f64; 4]; 9] = [
    [0.4, 1.0, 1e-4, 0.03],
    [1.0, 2.0, 1e-4, 0.3],
    [0.2, 0.1, 0.5, 0.02],
    [0.1, 0.5, 0.02, 3e-3],
    [0.1, 0.015, 0.5, 1e-3],
    [0.02, 0.2, 1e-3, 1e-3],
    [0.01, 0.05, 1e-3, 1e-4],
    [3e-3, 0.5, 0.1, 5e-3],
    [0.06, 0.012, 0.4, 4e-4],
];
/// Noises of the observer to go with them: `disturbance_noise`, `prediction_noise`.
const NOISES: [[f64; 2]; 9] = [
    [0.01, 0.03],
    [0.003, 0.1],
    [0.001, 0.1],
    [0.03, 0.03],
    [0.003, 0.01],
    [0.03, 0.03],
    [0.01, 0.01],
    [0.1, 0.1],
    [1e-3, 0.03],
];

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The best weights.
    pub weights: Weights,
    /// Their score.
    pub score: f64,
    /// Every candidate with its score, in order.
    pub tried: Vec<(Weights, f64)>,
}

/// Searches weights with the least score among `budget` candidates; `known` are good for another row.
pub fn search(
    budget: usize,
    seed: u64,
    observes: bool,
    known: Option<Weights>,
    mut score: impl FnMut(&Weights) -> f64,
) -> Found {
    let axes = if observes { AXES } else { AXES - 2 };
    let mut tried: Vec<(Weights, f64)> = Vec::with_capacity(budget);
    let mut best: (Vec<f64>, f64) = (vec![0.5; axes], f64::INFINITY);
    let known = known.map(|w| ([w.q_e1_rate, w.q_e2, w.q_e2_rate, w.r_rate], NOISES[0]));
    for (design, noises) in BEGINNING.into_iter().zip(NOISES).chain(known).take(budget) {
        let values = [design[0], design[1], design[2], design[3], noises[0], noises[1]];
        let point: Vec<f64> = (0..axes).map(|axis| place(axis, values[axis])).collect();
        let weights = Weights::at(&point);
        let score = score(&weights);
        if score < best.1 {
            best = (point, score);
        }
        tried.push((weights, score));
    }
    let left = budget - tried.len();
    if left > 0 {
        let ask = |point: &DVector<f64>| {
            let inside = point.map(|x| x.clamp(0.0, 1.0));
            let weights = Weights::at(inside.as_slice());
            let found = score(&weights);
            tried.push((weights, found));
            found * (1.0 + OUTSIDE * (point - inside).norm())
        };
        let options = CMAESOptions::new(best.0, STEP).seed(seed).max_function_evals(left);
        // A generation is driven to its end: what is beyond the budget does not count.
        if let Ok(mut strategy) = options.build(ask) {
            while strategy.function_evals() < left && strategy.next().is_none() {}
        }
    }
    tried.truncate(budget);
    let (weights, score) = tried
        .iter()
        .copied()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((Weights::default(), f64::INFINITY));
    Found { weights, score, tried }
}

/// Where a value stands in its range, 0 to 1.
fn place(axis: usize, value: f64) -> f64 {
    let (low, high) = RANGES[axis];
    ((value / low).ln() / (high / low).ln()).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_finds_a_valley_and_gives_the_same_again() {
        // Far from all designs.
        let valley = |w: &Weights| (w.q_e1_rate.ln() - 0.3_f64.ln()).powi(2) + (w.r_rate.ln() + 11.0).powi(2);
        let found = search(64, 1, false, None, valley);
        assert!(found.score < 0.3 * found.tried[..9].iter().map(|t| t.1).fold(f64::INFINITY, f64::min));
        assert_eq!(found, search(64, 1, false, None, valley));
        assert_eq!(found.tried.len(), 64);
    }
}
