//! Candidates of one effect more: the best with all others, screened by linear steps.

use super::order::sort;
use super::search::{STEPS, Search};
use crate::diagnose::fit::{Fit, Linearisation, Start};
use crate::diagnose::replay::ReplayVehicle;
use crate::numerics::parallel;

/// Number of singles that are extended to pairs, and of pairs that are extended to triples.
const BEAM: usize = 8;
pub(super) const OF_SINGLES: Beam = Beam { bases: BEAM, always: 4, fitted: 12 };
pub(super) const OF_PAIRS: Beam = Beam { bases: 3, always: 1, fitted: 6 };

/// Construction of candidates from others by one effect more.
pub(super) struct Beam {
    /// Number of the first that are bases.
    bases: usize,
    /// Number of first bases, and of first effects, that are fitted in every combination.
    always: usize,
    /// So many are fitted.
    fitted: usize,
}

impl<V: ReplayVehicle> Search<'_, V> {
    /// Starting point of a fit whose last effect is new to it: the one with the most promising linear step. Candidates are
    /// its starts, and half of `own`, the effect's value when alone. Some effects have no slope at their neutral value, and
    /// friction and wind have more than one optimum.
    pub(super) fn best_start<'a>(self, free: &[usize], from: &'a Fit, own: Option<f64>) -> Start<'a> {
        let Self { problem, prior, linear } = self;
        let Some(&further) = free.last() else { return from.into() };
        let precision = prior.free(problem, free);
        let starts = problem.uncertain[further].starts;
        let half = own.filter(|_| starts.len() > 1).map(|own| 0.5 * own);
        let others = starts.iter().filter(|&&start| start != 0.0).map(|start| prior.mean[further] + start);
        // Where an effect tells nothing at its neutral value, that is no start.
        let here = starts.contains(&0.0).then(|| Start::from(from));
        let there = others.chain(half).filter_map(|at| {
            let mut x = from.x.clone();
            x[further] = problem.uncertain[further].within(at, true);
            let gap = problem.residual(&x)?;
            Some(Start { x: x.into(), gap: Some(gap.into()), slopes: None })
        });
        let promise = |start: Start<'a>| {
            let gap = start.gap.as_deref()?;
            Some((prior.step(linear, &start.x, gap, &precision).cost, start))
        };
        let best = here.into_iter().chain(there).filter_map(promise).min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(|| from.into(), |(_, start)| start)
    }

    /// Candidates of one effect more: each of the first `bases` with each of `singles`.
    pub(super) fn extended(self, bases: &[Fit], singles: &[Fit], beam: &Beam) -> Vec<Fit> {
        let Self { problem, prior, linear } = self;
        let threads = problem.threads();
        // Linear screening at the best point of each of the first, with the slope of the further effect there or at its own
        // best, whichever promises more: some have no slope at their neutral value, and some a best that is far off.
        let screened = parallel::map(threads, bases.len().min(beam.bases), |a| {
            let base = &bases[a];
            let local = linear.with(&base.of_free());
            singles
                .iter()
                .enumerate()
                .filter(|(_, single)| !base.free.contains(&single.free[0]))
                .filter_map(|(b, single)| {
                    let free = [&base.free[..], &single.free[..]].concat();
                    let precision = prior.free(problem, &free);
                    let promise = |linear: &Linearisation| {
                        let step = prior.step(linear, &base.x, &base.gap, &precision);
                        // A promise beyond what an effect can be is none.
                        let beyond = free.iter().any(|&i| {
                            let to = base.x[i] + step.change[i];
                            (problem.uncertain[i].within(to, true) - to).abs() > 1e-9 || to.abs() > 20.0
                        });
                        if beyond || !step.cost.is_finite() { f64::INFINITY } else { step.cost }
                    };
                    let (here, own) = (promise(&local), promise(&local.with(&single.of_free())));
                    // Those of the very first are always tried.
                    let rank = if a < beam.always && b < beam.always { f64::MIN } else { here.min(own) };
                    (rank < f64::INFINITY).then_some((rank, a, b, here < own))
                })
                .collect::<Vec<_>>()
        });
        let mut screened: Vec<(f64, usize, usize, bool)> = screened.into_iter().flatten().collect();
        screened.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        // The same effects may come of several bases: the best promise stands for them.
        let mut seen: Vec<Vec<usize>> = Vec::new();
        screened.retain(|&(_, a, b, _)| {
            let mut free = [&bases[a].free[..], &singles[b].free[..]].concat();
            free.sort_unstable();
            let new = !seen.contains(&free);
            seen.push(free);
            new
        });
        screened.truncate(beam.fitted);
        let mut fits: Vec<Fit> = parallel::map(threads, screened.len(), |k| {
            let (_, a, b, here) = screened[k];
            let (base, single) = (&bases[a], &singles[b]);
            let further = single.free[0];
            let free = [&base.free[..], &[further]].concat();
            if here {
                return self.fit(&free, base, STEPS);
            }
            let own = Some(single.x[further]);
            let start = self.best_start(&free, base, own);
            self.fit(&free, start, STEPS)
        })
        .into_iter()
        .flatten()
        .collect();
        sort(&mut fits);
        fits
    }
}
