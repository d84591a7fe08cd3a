//! Fits of candidates: to convergence, with other weights, from other starting points.
//!
//! Linear steps only choose candidates. Every cost that is kept is that of a replay at the fit's own coordinates.

use super::order::{is_near, may_tell, sort, take};
use super::predicted;
use crate::diagnose::fit::{Fit, Linearisation, Prior, Start, fit};
use crate::diagnose::problem::Problem;
use crate::diagnose::replay::ReplayVehicle;
use crate::numerics::parallel;

/// Singles that are fitted to convergence with the final noise.
const AGAIN: usize = 12;
/// Candidates that are fitted once more from the null optimum.
const AFRESH: usize = 2;
/// Candidates that are relinearised, and the largest number of them; rounds until that gains nothing.
pub(super) const POLISHED: usize = 3;
const MOST_POLISHED: usize = 5;
const ROUNDS: usize = 5;
/// Steps of a fit to convergence.
pub(super) const STEPS: usize = 4;
/// Steps for a promising single effect behind the first [`AGAIN`].
const FEW_STEPS: usize = 2;

/// A search on a log: knowledge of the tolerances, and slopes and weights.
pub(super) struct Search<'s, V> {
    pub problem: &'s Problem<'s, V>,
    pub prior: &'s Prior,
    pub linear: &'s Linearisation,
}

impl<V> Clone for Search<'_, V> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<V> Copy for Search<'_, V> {}

impl<'s, V: ReplayVehicle> Search<'s, V> {
    /// The same with other slopes and weights.
    pub(super) fn at<'t>(self, linear: &'t Linearisation) -> Search<'t, V>
    where
        's: 't,
    {
        Search { problem: self.problem, prior: self.prior, linear }
    }

    /// A fit of so many steps.
    pub(super) fn fit<'a>(self, free: &[usize], start: impl Into<Start<'a>>, steps: usize) -> Option<Fit> {
        fit(self.problem, self.prior, self.linear, free, start, steps)
    }

    /// Nothing free: everything within its tolerance.
    pub(super) fn fit_none<'a>(self, start: impl Into<Start<'a>>) -> Option<Fit> {
        self.fit(&[], start, STEPS)
    }

    /// Costs and coordinates of a fit with other weights, by its own slopes.
    pub(super) fn reweighed(self, fit: &mut Fit) {
        let Self { problem, prior, linear } = self;
        let precision = prior.free(problem, &fit.free);
        fit.cost = linear.square(&fit.gap) + precision.penalty(&prior.off(&fit.x));
    }

    /// The best `count` fits, refitted with other weights; all costs by these.
    pub(super) fn refined(self, fits: &mut [Fit], count: usize) {
        let Self { problem, .. } = self;
        fits.iter_mut().for_each(|fit| self.reweighed(fit));
        sort(fits);
        let found =
            parallel::map(problem.threads(), fits.len().min(count), |k| self.fit(&fits[k].free, &fits[k], 3));
        for (old, new) in fits.iter_mut().zip(found) {
            if let Some(new) = new
                && new.cost < old.cost
            {
                *old = new;
            }
        }
        sort(fits);
    }

    /// A fit with all slopes taken anew at its own best.
    pub(super) fn polished(self, at: &Fit) -> Fit {
        let Self { problem, linear, .. } = self;
        self.at(&linear.anew(problem, &at.x, &at.gap)).polished_by(at)
    }

    /// The same with slopes that were taken there.
    pub(super) fn polished_by(self, at: &Fit) -> Fit {
        self.fit(&at.free, self.start_at(&at.free, (&at.x, &at.gap)), 5)
            .filter(|new| new.cost < at.cost)
            .unwrap_or_else(|| at.clone())
    }

    /// A start with the slopes over the free uncertain parameters that `local` has from there.
    pub(super) fn start_at<'a>(self, free: &[usize], (x, gap): (&'a [f64], &'a [f64])) -> Start<'a> {
        let Self { problem, linear, .. } = self;
        let own = problem.with_companions(free).into_iter().map(|i| (i, linear.slopes[i].clone())).collect();
        Start { x: x.into(), gap: Some(gap.into()), slopes: Some((x, own)) }
    }

    /// A fit relinearised until that gains nothing. All evidence is measured against it, so it must not stay in a valley on
    /// the way.
    pub(super) fn converged(self, from: Fit) -> Fit {
        let mut best = from;
        for _ in 0..ROUNDS {
            let next = self.polished(&best);
            let gained = best.cost - next.cost;
            best = next;
            if gained < 1.0 {
                break;
            }
        }
        best
    }

    /// Singles fitted again with other weights, from their own best: the first [`AGAIN`], and others whose promise is
    /// informative and near.
    pub(super) fn fitted_again(self, none: &Fit, singles: &mut Vec<Fit>) {
        let Self { problem, prior, linear } = self;
        singles.iter_mut().for_each(|single| self.reweighed(single));
        sort(singles);
        let best = singles.first().map_or(0.0, |best| best.cost);
        let found = parallel::map(problem.threads(), singles.len(), |k| {
            let single = &singles[k];
            let promise = || {
                let local = linear.with(&single.of_free());
                prior.step(&local, &single.x, &single.gap, &prior.free(problem, &single.free)).cost
            };
            let is_worth = |cost: f64| is_near(cost, best) && may_tell(cost, none);
            if k >= AGAIN && !is_worth(promise()) {
                return None;
            }
            self.fit(&single.free, single, if k < AGAIN { STEPS } else { FEW_STEPS })
        });
        take(singles, found.into_iter().flatten());
    }

    /// Refit from the null optimum of candidates whose linear step from there promises a lower cost than they have. Only
    /// the first [`AGAIN`] that promise to be informative are fitted.
    pub(super) fn again_from_none(self, none: &Fit, singles: &mut Vec<Fit>) {
        let Self { problem, prior, linear } = self;
        let mut promised: Vec<(f64, usize, Vec<f64>)> = Vec::new();
        for (k, single) in singles.iter().enumerate() {
            let precision = prior.free(problem, &single.free);
            // What has no tolerance may have no slope at its neutral value, either.
            let mut columns = single.of_free();
            columns.retain(|(i, _)| problem.uncertain[*i].tolerance == 0.0);
            let step = prior.step(&linear.with(&columns), &none.x, &none.gap, &precision);
            if step.cost < single.cost - 0.5 && may_tell(step.cost, none) {
                promised.push((step.cost, k, none.x.iter().zip(&step.change).map(|(x, d)| x + d).collect()));
            }
        }
        promised.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let found = parallel::map(problem.threads(), promised.len().min(AGAIN), |place| {
            let (_, k, x) = &promised[place];
            self.fit(&singles[*k].free, x, STEPS)
        });
        take(singles, found.into_iter().flatten());
    }

    /// Refit of the first few of sorted candidates from the null optimum, with their effects as found and all slopes taken
    /// there. Background parameters can stick in a local minimum on the way to an effect that is far off.
    pub(super) fn relinearise(self, none: &Fit, fits: &mut Vec<Fit>) {
        let Self { problem, linear, .. } = self;
        let again = |of: &Fit| {
            let mut x = none.x.clone();
            problem.with_companions(&of.free).into_iter().for_each(|i| x[i] = of.x[i]);
            let gap = problem.residual(&x)?;
            let local = linear.anew(problem, &x, &gap);
            let start = self.at(&local).start_at(&of.free, (&x, &gap));
            let found = self.at(&local).fit(&of.free, start, STEPS)?;
            Some(self.polished(&found))
        };
        let first = fits.iter().take(AFRESH).filter(|of| may_tell(of.cost, none));
        let found: Vec<Fit> = first.filter_map(again).collect();
        take(fits, found);
    }

    /// Relinearises the first few of sorted candidates, until all of the first few have been.
    pub(super) fn refine(self, fits: &mut [Fit]) {
        let Self { problem, linear, .. } = self;
        let mut done: Vec<Vec<usize>> = Vec::new();
        loop {
            let best = fits.first().map_or(0.0, |fit| fit.cost);
            let is_next =
                |fit: &Fit| !done.contains(&fit.free) && (done.is_empty() || is_near(fit.cost, best));
            let first =
                fits.iter().take(POLISHED).enumerate().filter(|(_, fit)| is_next(fit)).map(|(i, _)| i);
            let next: Vec<usize> = first.take(MOST_POLISHED - done.len()).collect();
            if next.is_empty() {
                break;
            }
            // Slopes one after the other, as each are taken by all threads.
            let locals: Vec<Linearisation> =
                next.iter().map(|&i| linear.anew(problem, &fits[i].x, &fits[i].gap)).collect();
            let found = parallel::map(problem.threads(), next.len(), |k| {
                self.at(&locals[k]).polished_by(&fits[next[k]])
            });
            for (i, found) in next.into_iter().zip(found) {
                done.push(fits[i].free.clone());
                fits[i] = found;
            }
            sort(fits);
        }
    }

    /// The same for single effects, if one is informative: relinearising does not turn the others into effects.
    pub(super) fn polish_singles(self, none: &Fit, singles: &mut [Fit]) {
        if singles.first().is_some_and(|best| may_tell(best.cost, none)) {
            self.refine(singles);
        }
    }

    /// Remainder of a fit with all else free within three tolerances: no noise, and yet told by nothing.
    pub(super) fn unexplained(self, fit: &Fit) -> Vec<f64> {
        let Self { problem, prior, linear } = self;
        let precision = prior.free(problem, &fit.free).widened(3.0);
        let step = prior.step(linear, &fit.x, &fit.gap, &precision);
        predicted(linear, &fit.gap, &step.change)
    }
}
