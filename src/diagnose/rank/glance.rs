//! A first look at a log, with little trust: the likeliest of nothing and a few single effects.

use super::candidates;
use super::search::{STEPS, Search};
use crate::diagnose::fit::{Fit, Linearisation, Prior, Start};
use crate::diagnose::noise::Noise;
use crate::diagnose::problem::Problem;
use crate::diagnose::replay::ReplayVehicle;
use crate::numerics::parallel;

/// Single effects that are fitted at a first glance.
const GLANCED: usize = 4;

/// A cost with the odds against each effect that is free for it.
fn priced(fit: &Fit, odds: f64) -> f64 {
    fit.cost + 2.0 * odds * fit.free.len() as f64
}

/// The likeliest of nothing and the few single effects that promise most, by a search with little trust; and the noise
/// that it leaves.
#[must_use]
pub fn glance<V: ReplayVehicle>(problem: &Problem<V>, odds: f64) -> Option<Glance> {
    let prior = Prior::of(problem);
    let trace = problem.trace(&prior.mean).ok()?;
    let neutral = problem.compare(&trace);
    let fine = Noise::of(problem, &trace, &prior.form);
    let weights = fine.coarse(problem, &neutral).weights(problem);
    let linear = Linearisation::new(problem.slopes(&prior.mean, &neutral), weights);
    let search = Search { problem, prior: &prior, linear: &linear };
    let none = search.fit_none(&prior.mean)?;
    let candidates = candidates(problem);
    let mut promised: Vec<(f64, usize, Start)> = parallel::map(problem.threads(), candidates.len(), |k| {
        let i = candidates[k];
        let start = search.best_start(&[i], &none, None);
        let gap = start.gap.as_deref().unwrap_or(&none.gap);
        (prior.step(&linear, &start.x, gap, &prior.free(problem, &[i])).cost, i, start)
    });
    promised.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    promised.truncate(GLANCED);
    let singles = parallel::map(problem.threads(), promised.len(), |k| {
        let (_, i, start) = &promised[k];
        search.fit(&[*i], start.clone(), STEPS)
    });
    let found = singles.into_iter().flatten().chain([none]);
    let best = found.min_by(|a, b| priced(a, odds).total_cmp(&priced(b, odds)))?;
    let noise = fine.with_left(problem, &search.unexplained(&best));
    Some(Glance { prior, best, noise })
}

/// A first look at a log.
pub struct Glance {
    prior: Prior,
    best: Fit,
    /// What it leaves.
    pub noise: Noise,
}

impl Glance {
    /// Least cost of this problem from where it and another look ended, so that both have the same choice.
    #[must_use]
    pub fn cost<V: ReplayVehicle>(
        &self,
        problem: &Problem<V>,
        other: &Self,
        noise: &Noise,
        odds: f64,
    ) -> Option<f64> {
        let from = |best: &Fit| {
            let gap = problem.residual(&best.x)?;
            let linear = Linearisation::new(problem.slopes(&best.x, &gap), noise.weights(problem));
            let search = Search { problem, prior: &self.prior, linear: &linear };
            Some(priced(&search.fit(&best.free, &best.x, STEPS)?, odds))
        };
        [&self.best, &other.best].into_iter().filter_map(from).min_by(f64::total_cmp)
    }
}
