//! The search: CMA-ES over decades, its cost a soft worst case, with early stops of losing candidates.
//!
//! The scenarios of a candidate are driven hardest first, a few at once. A candidate is dropped as soon as its cost far
//! exceeds that of the better half of the last generation. The strategy only needs to know that it is among the worse.
//! The number driven at once does not depend on the threads, so the result does not either.
//!
//! Source: Hansen, The CMA evolution strategy: a tutorial, 2016.

use super::axis::{Axis, ControllerNumbers};
use super::goal::MarginGoal;
use super::scenario::{Scenario, ScenarioError, ScenarioResult};
use crate::numerics::parallel;
use crate::simulate::experiment::Compared;
use cmaes::{CMAESOptions, DVector};
use serde::Serialize;

/// Number of scenarios that are driven before the next decision to go on.
const WAVE: usize = 4;
/// Largest cost of a candidate before it is dropped, relative to the better half of the last generation.
const SLACK: f64 = 1.0;
/// Smallest share of its step with which a converged search begins anew.
const FRESH: f64 = 0.5;

/// Scenarios with the cost of a candidate over them.
pub struct Ensemble<P: Compared<S, C>, const S: usize, const C: usize> {
    /// The drives.
    pub scenarios: Vec<Scenario<P, S, C>>,
    /// Share of the mean in the cost, beside the worst.
    pub mean_share: f64,
    /// Margins that are asked for.
    pub goal: Option<MarginGoal>,
    /// Threads; 0 for all.
    pub threads: usize,
}

/// A candidate and how it did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TuneCandidate {
    /// Its numbers.
    pub values: ControllerNumbers,
    /// Its cost, m; for a dropped one the cost until then.
    pub cost: f64,
    /// Cost of missing margins in that, m.
    pub penalty: f64,
    /// True if it was driven to the end.
    pub complete: bool,
    /// Its drives, one for each scenario; none for scenarios that were not driven.
    pub outcomes: Vec<Option<ScenarioResult>>,
}

/// Length and start of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchSettings {
    /// Candidates in all.
    pub budget: usize,
    /// Starting points: the search begins at the best of these.
    pub starts: Vec<ControllerNumbers>,
    /// First standard deviation, in units of the axes.
    pub step: f64,
    /// Candidates of a generation; 0 for the strategy's own number.
    pub population: usize,
    /// Seed of the strategy.
    pub seed: u64,
}

impl TuneCandidate {
    /// Scenarios that were lost.
    #[must_use]
    pub fn lost(&self) -> usize {
        self.outcomes.iter().flatten().filter(|outcome| outcome.lost).count()
    }

    /// Largest lateral error of the drives that were not lost, m.
    #[must_use]
    pub fn worst(&self) -> f64 {
        self.outcomes.iter().flatten().filter(|outcome| !outcome.lost).map(|o| o.max).fold(0.0, f64::max)
    }

    /// Mean over the drives of the mean lateral error, m.
    #[must_use]
    pub fn mean(&self) -> f64 {
        let driven = self.outcomes.iter().flatten().count().max(1);
        self.outcomes.iter().flatten().map(|outcome| outcome.mean).sum::<f64>() / driven as f64
    }

    /// Largest of the drives' root mean square rates of the command, rad/s.
    #[must_use]
    pub fn roughness(&self) -> f64 {
        self.outcomes.iter().flatten().map(|outcome| outcome.roughness).fold(0.0, f64::max)
    }
}

impl<P: Compared<S, C, Effects: Sync, Nominal: Sync>, const S: usize, const C: usize> Ensemble<P, S, C> {
    /// Drives a candidate: all scenarios in this order, or until its cost exceeds a bound.
    ///
    /// # Errors
    /// Parameters out of range.
    pub fn evaluate(
        &self,
        values: &ControllerNumbers,
        order: &[usize],
        bound: f64,
    ) -> Result<TuneCandidate, ScenarioError> {
        let threads = parallel::threads(self.threads);
        let mut candidate = TuneCandidate {
            values: values.clone(),
            cost: 0.0,
            penalty: 0.0,
            complete: false,
            outcomes: vec![None; self.scenarios.len()],
        };
        if let Some(goal) = &self.goal {
            let penalties =
                parallel::map(threads, order.len(), |i| goal.penalty(&self.scenarios[order[i]], values));
            for penalty in penalties {
                candidate.penalty = candidate.penalty.max(penalty?);
            }
        }
        candidate.cost = candidate.penalty;
        for wave in order.chunks(WAVE) {
            if candidate.cost > bound {
                return Ok(candidate);
            }
            // A drive's largest error is part of its cost.
            let left = bound - candidate.penalty;
            let drives = parallel::map(threads, wave.len(), |i| self.scenarios[wave[i]].drive(values, left));
            for (&place, drive) in wave.iter().zip(drives) {
                candidate.outcomes[place] = Some(drive?);
            }
            candidate.cost = candidate.penalty + self.cost(&candidate.outcomes);
        }
        candidate.complete = candidate.outcomes.iter().all(|outcome| outcome.is_some_and(|o| !o.given_up));
        Ok(candidate)
    }

    /// Drives a candidate to the end.
    ///
    /// # Errors
    /// Parameters out of range.
    pub fn examine(&self, values: &ControllerNumbers) -> Result<TuneCandidate, ScenarioError> {
        let order: Vec<usize> = (0..self.scenarios.len()).collect();
        self.evaluate(values, &order, f64::INFINITY)
    }

    /// The worst and a share of the mean; scenarios that were not driven cost nothing yet.
    fn cost(&self, outcomes: &[Option<ScenarioResult>]) -> f64 {
        let costs = || outcomes.iter().flatten().map(|outcome| outcome.cost);
        let mean = costs().sum::<f64>() / outcomes.len().max(1) as f64;
        costs().fold(0.0, f64::max) + self.mean_share * mean
    }
}

/// Scenarios by a candidate's costs, the hardest first.
fn hardest_first(candidate: &TuneCandidate) -> Vec<usize> {
    let cost = |place: usize| candidate.outcomes[place].map_or(0.0, |outcome| outcome.cost);
    let mut order: Vec<usize> = (0..candidate.outcomes.len()).collect();
    order.sort_by(|&a, &b| cost(b).total_cmp(&cost(a)));
    order
}

/// Searches; gives the candidates that were driven to the end, the best first. `watch` gets every candidate with its
/// number.
///
/// # Errors
/// A start that is out of range.
pub fn search<P: Compared<S, C, Effects: Sync, Nominal: Sync>, const S: usize, const C: usize>(
    ensemble: &Ensemble<P, S, C>,
    axes: &[Axis],
    settings: &SearchSettings,
    mut watch: impl FnMut(usize, &TuneCandidate),
) -> Result<Vec<TuneCandidate>, ScenarioError> {
    let mut complete: Vec<TuneCandidate> = vec![];
    let mut count = 0;
    let mut order: Vec<usize> = (0..ensemble.scenarios.len()).collect();
    for start in settings.starts.iter().take(settings.budget) {
        let candidate = ensemble.evaluate(start, &order, f64::INFINITY)?;
        count += 1;
        watch(count, &candidate);
        order = hardest_first(&candidate);
        complete.push(candidate);
    }
    let mut step = settings.step;
    let mut round = 0;
    while count < settings.budget && !axes.is_empty() {
        sort(&mut complete);
        let Some(start) = complete.first().map(|best| best.values.clone()) else { break };
        let place = |name: &str| start.0.get(name).copied().unwrap_or(0.0);
        let mut bound = f64::INFINITY;
        let mut generation: Vec<f64> = vec![];
        let mut failed = None;
        let size = population(settings, axes.len());
        let left = settings.budget - count;
        let mut asked = 0;
        let ask = |point: &DVector<f64>| {
            asked += 1;
            // Candidates of a generation beyond the budget are not driven.
            if asked > left || failed.is_some() {
                return f64::INFINITY;
            }
            let mut values = start.clone();
            for (axis, &units) in axes.iter().zip(point.iter()) {
                values.0.insert(axis.name.clone(), axis.from::<P::Nominal>(place(&axis.name), units));
            }
            match ensemble.evaluate(&values, &order, bound) {
                Ok(candidate) => {
                    count += 1;
                    watch(count, &candidate);
                    let cost = candidate.cost;
                    generation.push(cost);
                    if generation.len() == size {
                        generation.sort_by(f64::total_cmp);
                        bound = SLACK * generation[size.div_ceil(2) - 1];
                        generation.clear();
                    }
                    if candidate.complete {
                        if complete.iter().all(|other| cost < other.cost) {
                            order = hardest_first(&candidate);
                        }
                        complete.push(candidate);
                    }
                    cost
                }
                Err(error) => {
                    failed = Some(error);
                    f64::INFINITY
                }
            }
        };
        let options = CMAESOptions::new(vec![0.0; axes.len()], step)
            .seed(settings.seed.wrapping_add(round))
            .population_size(size);
        let Ok(mut strategy) = options.build(ask) else { break };
        while strategy.function_evals() < left && strategy.next().is_none() {}
        drop(strategy);
        if let Some(error) = failed {
            return Err(error);
        }
        // Settled before the budget was used up: once more from the best, nearer to it.
        step = (FRESH * step).max(0.05);
        round += 1;
    }
    sort(&mut complete);
    Ok(complete)
}

fn population(settings: &SearchSettings, axes: usize) -> usize {
    match settings.population {
        0 => 4 + (3.0 * (axes as f64).ln()).floor() as usize,
        size => size.max(2),
    }
}

fn sort(candidates: &mut [TuneCandidate]) {
    candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost));
}
