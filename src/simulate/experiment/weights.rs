//! The weights that each row may choose, and the search that chooses them: the same budget for every row.
//!
//! The cost is homogeneous, so the lateral error's weight stays 1 and the others are searched, over decades. The search
//! begins with the same few designs for every row, from the default to very tight ones, spread over the gains where a
//! row has an observer; then it refines the best point with random steps that shrink. Nothing but the drives' scores is
//! looked at, and all batches have a fixed size: the result is the same on any number of threads.

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
    [(1e-3, 3.0), (1e-2, 30.0), (1e-4, 1.0), (1e-5, 1.0), (1e-3, 0.5), (1e-3, 1.0)];
/// Candidates that are tried at once.
const BATCH: usize = 4;

impl Default for Weights {
    /// The controller's default weights, without an observer.
    fn default() -> Self {
        let p = MpcParameters::default();
        Self {
            q_e1_rate: p.q_e1_rate,
            q_e2: p.q_e2,
            q_e2_rate: p.q_e2_rate,
            r_rate: p.r_rate,
            observer_gain: 0.0,
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

/// Designs that every search begins with: `q_e1_rate`, `q_e2`, `q_e2_rate`, `r_rate`. The default first, then from
/// damped to tight.
const BEGINNING: [[f64; 4]; 8] = [
    [0.4, 1.0, 1e-4, 0.03],
    [1.0, 2.0, 1e-4, 0.3],
    [0.2, 0.1, 0.5, 0.02],
    [0.1, 0.5, 0.02, 3e-3],
    [0.1, 0.015, 0.5, 1e-3],
    [0.02, 0.2, 1e-3, 1e-3],
    [0.01, 0.05, 1e-3, 1e-4],
    [3e-3, 0.5, 0.1, 5e-3],
];
/// Gains of the observer to go with them: `observer_gain`, `prediction_noise`.
const GAINS: [[f64; 2]; 8] = [
    [0.01, 0.03],
    [0.02, 0.1],
    [3e-3, 0.03],
    [0.03, 0.3],
    [0.01, 0.03],
    [3e-3, 0.03],
    [0.1, 1.0],
    [0.03, 0.3],
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

/// Searches weights with the least score among `budget` candidates.
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
    while tried.len() < budget {
        let batch = BATCH.min(budget - tried.len());
        let candidates: Vec<([f64; AXES], Weights)> = (0..batch)
            .map(|i| {
                let number = tried.len() + i;
                let point = match BEGINNING.get(number) {
                    Some(design) => {
                        let gains = GAINS[number];
                        let values = [design[0], design[1], design[2], design[3], gains[0], gains[1]];
                        std::array::from_fn(|axis| place(axis, values[axis]))
                    }
                    None => {
                        let share = (number - BEGINNING.len()) as f64 / (budget - BEGINNING.len()) as f64;
                        let width = 0.2 * (1.0 - share) + 0.03;
                        best.0.map(|x| (x + width * (2.0 * random.uniform() - 1.0)).clamp(0.0, 1.0))
                    }
                };
                (point, Weights::at(point, observes))
            })
            .collect();
        let scores = parallel::map(threads, batch, |i| score(&candidates[i].1));
        for ((point, weights), score) in candidates.into_iter().zip(scores) {
            if score < best.1 {
                best = (point, score);
            }
            tried.push((weights, score));
        }
    }
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
    fn it_finds_a_valley_and_gives_the_same_on_any_number_of_threads() {
        let valley = |w: &Weights| (w.q_e1_rate.ln() - 0.03_f64.ln()).powi(2) + (w.r_rate.ln() + 7.0).powi(2);
        let found = search(40, 1, false, 1, valley);
        assert!(found.score < 0.3 * found.tried[..8].iter().map(|t| t.1).fold(f64::INFINITY, f64::min));
        assert_eq!(found, search(40, 1, false, 2, valley));
        assert_eq!(found.tried.len(), 40);
    }
}
