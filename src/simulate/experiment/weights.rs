//! The weights that each row may choose, and the search that chooses them: the same budget for every row.
//!
//! The cost is homogeneous, so the lateral error's weight stays 1 and the others are searched, over decades. The first
//! half of the budget is spread over the whole range (a Halton sequence, the same points for every row), the second
//! refines the best point with random steps that shrink. Nothing but the drives' scores is looked at, and all batches
//! have a fixed size: the result is the same on any number of threads.

use crate::control::{ControllerParameters, MpcParameters};
use crate::residual::{Random, parallel};
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
    pub observer_gain: f64,
    /// 0 where there is no observer, m/s.
    pub prediction_noise: f64,
}

/// Numbers that are searched.
const AXES: usize = 6;

/// Ranges of the search.
const RANGES: [(f64, f64); AXES] =
    [(1e-3, 3.0), (1e-2, 30.0), (1e-4, 1.0), (1e-5, 1.0), (1e-3, 0.1), (3e-4, 0.1)];
/// Candidates that are tried at once.
const BATCH: usize = 4;

impl Weights {
    /// The controller's default weights.
    #[must_use]
    pub fn default_of(observes: bool) -> Self {
        let p = MpcParameters::default();
        Self {
            q_e1_rate: p.q_e1_rate,
            q_e2: p.q_e2,
            q_e2_rate: p.q_e2_rate,
            r_rate: p.r_rate,
            observer_gain: if observes { 0.02 } else { 0.0 },
            prediction_noise: if observes { 0.01 } else { 0.0 },
        }
    }

    /// Takes the weights over into parameters.
    pub fn apply(&self, parameters: &mut ControllerParameters) {
        let ControllerParameters { mpc, observer, .. } = parameters;
        (mpc.q_e1_rate, mpc.q_e2, mpc.q_e2_rate) = (self.q_e1_rate, self.q_e2, self.q_e2_rate);
        mpc.r_rate = self.r_rate;
        (observer.gain, observer.prediction_noise) = (self.observer_gain, self.prediction_noise);
    }

    /// From a point of the unit cube.
    fn at(point: [f64; AXES], observes: bool) -> Self {
        let value = |i: usize| {
            let (low, high) = RANGES[i];
            low * (high / low).powf(point[i])
        };
        Self {
            q_e1_rate: value(0),
            q_e2: value(1),
            q_e2_rate: value(2),
            r_rate: value(3),
            observer_gain: if observes { value(4) } else { 0.0 },
            prediction_noise: if observes { value(5) } else { 0.0 },
        }
    }
}

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

/// Searches weights with the least score among `budget` candidates, the default weights first.
pub fn search(
    budget: usize,
    seed: u64,
    observes: bool,
    threads: usize,
    score: impl Fn(&Weights) -> f64 + Sync,
) -> Found {
    let mut random = Random::new(seed);
    let mut tried: Vec<(Weights, f64)> = Vec::with_capacity(budget);
    let mut best: ([f64; AXES], f64) = ([0.5; AXES], f64::INFINITY);
    let spread = budget / 2;
    while tried.len() < budget {
        let batch = BATCH.min(budget - tried.len());
        let candidates: Vec<([f64; AXES], Weights)> = (0..batch)
            .map(|i| {
                let number = tried.len() + i;
                if number == 0 {
                    return ([f64::NAN; AXES], Weights::default_of(observes));
                }
                let point = if number < spread || best.1 == f64::INFINITY {
                    std::array::from_fn(|axis| halton(number, [2, 3, 5, 7, 11, 13][axis]))
                } else {
                    let share = (number - spread) as f64 / (budget - spread).max(1) as f64;
                    let width = 0.25 * (1.0 - share) + 0.04;
                    best.0.map(|x| (x + width * (2.0 * random.uniform() - 1.0)).clamp(0.0, 1.0))
                };
                (point, Weights::at(point, observes))
            })
            .collect();
        let scores = parallel::map(threads, batch, |i| score(&candidates[i].1));
        for ((point, weights), score) in candidates.into_iter().zip(scores) {
            if score < best.1 && !point[0].is_nan() {
                best = (point, score);
            }
            tried.push((weights, score));
        }
    }
    let (weights, score) = tried
        .iter()
        .copied()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((Weights::default_of(observes), f64::INFINITY));
    Found { weights, score, tried }
}

/// The `index`-th number of the Halton sequence of a base, in 0..1.
fn halton(mut index: usize, base: usize) -> f64 {
    let (mut value, mut share) = (0.0, 1.0);
    while index > 0 {
        share /= base as f64;
        value += share * (index % base) as f64;
        index /= base;
    }
    value
}
