//! The weights that each row may choose, and the search that chooses them: the same budget for every row.
//!
//! The cost is homogeneous, so the lateral error's weight stays 1 and the others are searched, over decades. The search
//! begins with the same few designs for every row, from the default to very tight ones, and with the nominal MPC's
//! result. They are spread over the noises where a row has an observer. From the best of them the covariance matrix
//! adaptation evolution strategy (CMA-ES) goes on. It uses nothing but the drives' scores: the result is the same on
//! any number of threads.
//!
//! Source: Hansen, The CMA evolution strategy: a tutorial, 2016.

use crate::control::{ControllerParametersFor, MpcParameters};
use cmaes::{CMAESOptions, DVector};
use serde::{Deserialize, Serialize};

/// Weights that are searched.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct CostWeights {
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

/// Ranges of a kind of vehicle's weights in the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Space {
    /// Ranges, in the order of [`CostWeights`].
    pub ranges: [(f64, f64); AXES],
    /// Designs that every search begins with: `q_e1_rate`, `q_e2`, `q_e2_rate`, `r_rate`. The default first.
    pub beginning: &'static [[f64; 4]],
    /// Noises of the observer to go with them: `disturbance_noise`, `prediction_noise`.
    pub noises: &'static [[f64; 2]],
}

/// First standard deviation of the evolution strategy, as a share of the ranges.
const STEP: f64 = 0.12;
/// Cost of leaving the ranges, for each range's width.
const OUTSIDE: f64 = 10.0;

impl CostWeights {
    /// A controller's, without an observer.
    #[must_use]
    pub fn of(p: &MpcParameters) -> Self {
        Self {
            q_e1_rate: p.q_e1_rate,
            q_e2: p.q_e2,
            q_e2_rate: p.q_e2_rate,
            r_rate: p.r_rate,
            disturbance_noise: 0.0,
            prediction_noise: 0.0,
        }
    }

    /// Takes the weights over into parameters.
    pub fn apply<G>(&self, parameters: &mut ControllerParametersFor<G>) {
        let ControllerParametersFor { mpc, observer, .. } = parameters;
        (mpc.q_e1_rate, mpc.q_e2, mpc.q_e2_rate) = (self.q_e1_rate, self.q_e2, self.q_e2_rate);
        mpc.r_rate = self.r_rate;
        (observer.disturbance_noise, observer.prediction_noise) =
            (self.disturbance_noise, self.prediction_noise);
    }

    /// The weights of the cost.
    fn of_cost(&self) -> [f64; 4] {
        [self.q_e1_rate, self.q_e2, self.q_e2_rate, self.r_rate]
    }
}

impl Space {
    /// From a point of the unit cube; without an observer the last two numbers are missing.
    fn at(&self, point: &[f64]) -> CostWeights {
        let value = |i: usize| {
            let (low, high) = self.ranges[i];
            low * (high / low).powf(point[i])
        };
        let observes = point.len() == AXES;
        CostWeights {
            q_e1_rate: value(0),
            q_e2: value(1),
            q_e2_rate: value(2),
            r_rate: value(3),
            disturbance_noise: if observes { value(4) } else { 0.0 },
            prediction_noise: if observes { value(5) } else { 0.0 },
        }
    }

    /// Place of a value in its range, 0 to 1.
    fn place(&self, axis: usize, value: f64) -> f64 {
        let (low, high) = self.ranges[axis];
        ((value / low).ln() / (high / low).ln()).clamp(0.0, 1.0)
    }

    /// Weights on the way from some to others, over decades, without an observer; a share of the way from 0 to 1.
    #[must_use]
    pub fn between(&self, from: &CostWeights, to: &CostWeights, share: f64) -> CostWeights {
        let ends = [from, to].map(CostWeights::of_cost);
        let point: Vec<f64> = (0..AXES - 2)
            .map(|axis| {
                let [from, to] = ends.map(|values| self.place(axis, values[axis]));
                from + share * (to - from)
            })
            .collect();
        self.at(&point)
    }
}

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightSearch {
    /// The best weights.
    pub weights: CostWeights,
    /// Their score.
    pub score: f64,
    /// Every candidate with its score, in order.
    pub tried: Vec<(CostWeights, f64)>,
}

impl WeightSearch {
    /// Score of a candidate; infinity for weights that were not tried.
    #[must_use]
    pub fn score_of(&self, weights: &CostWeights) -> f64 {
        self.tried.iter().find(|(tried, _)| tried == weights).map_or(f64::INFINITY, |(_, score)| *score)
    }
}

/// Searches weights with the least score among `budget` candidates; `known` are good for another row.
pub fn search(
    space: &Space,
    budget: usize,
    seed: u64,
    observes: bool,
    known: Option<CostWeights>,
    mut score: impl FnMut(&CostWeights) -> f64,
) -> WeightSearch {
    let axes = if observes { AXES } else { AXES - 2 };
    let mut tried: Vec<(CostWeights, f64)> = Vec::with_capacity(budget);
    let mut best: (Vec<f64>, f64) = (vec![0.5; axes], f64::INFINITY);
    let known = known.map(|weights| (weights.of_cost(), space.noises[0]));
    let beginning = space.beginning.iter().copied().zip(space.noises.iter().copied());
    for (design, noises) in beginning.chain(known).take(budget) {
        let values = [design[0], design[1], design[2], design[3], noises[0], noises[1]];
        let point: Vec<f64> = (0..axes).map(|axis| space.place(axis, values[axis])).collect();
        let weights = space.at(&point);
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
            let weights = space.at(inside.as_slice());
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
        .unwrap_or_else(|| (space.at(&vec![0.5; axes]), f64::INFINITY));
    WeightSearch { weights, score, tried }
}

#[cfg(test)]
mod tests {
    use super::super::vehicle::CAR_SPACE;
    use super::*;

    #[test]
    fn it_finds_a_valley_and_gives_the_same_again() {
        // Far from all designs.
        let valley =
            |w: &CostWeights| (w.q_e1_rate.ln() - 0.3_f64.ln()).powi(2) + (w.r_rate.ln() + 11.0).powi(2);
        let found = search(&CAR_SPACE, 64, 1, false, None, valley);
        assert!(found.score < 0.3 * found.tried[..9].iter().map(|t| t.1).fold(f64::INFINITY, f64::min));
        assert_eq!(found, search(&CAR_SPACE, 64, 1, false, None, valley));
        assert_eq!(found.tried.len(), 64);
    }

    #[test]
    fn each_candidate_has_the_score_that_it_got() {
        let found = search(&CAR_SPACE, 12, 1, false, None, |w| w.r_rate);
        assert!(found.tried.iter().all(|(weights, score)| found.score_of(weights) == *score));
        assert_eq!(found.score_of(&found.weights), found.score);
        let other = CostWeights { r_rate: 0.123, ..found.weights };
        assert_eq!(found.score_of(&other), f64::INFINITY);
    }
}
