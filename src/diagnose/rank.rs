//! Candidates and their evidence: single effects, pairs of the best with all others, and triples of the best pairs with
//! all others. Triples follow only where a pair explains much more than one effect: a real vehicle differs in more than
//! one respect.
//!
//! Linear steps only choose candidates. Every cost that is kept is that of a replay at the fit's own coordinates.

use super::fit::{Fit, Linearisation, Prior, Start, fit};
use super::noise::Noise;
use super::problem::Problem;
use super::replay::ReplayVehicle;
use super::uncertain::LOADED;
use crate::numerics::parallel;

/// Singles that are fitted to convergence with the final noise.
const AGAIN: usize = 12;
/// Singles that are fitted with less and then with all trust.
const REFINED: usize = 6;
/// Number of singles that are extended to pairs, and of pairs that are extended to triples.
const BEAM: usize = 8;
const OF_SINGLES: Beam = Beam { bases: BEAM, always: 4, fitted: 12 };
const OF_PAIRS: Beam = Beam { bases: 3, always: 1, fitted: 6 };
/// Candidates that are fitted once more from the null optimum.
const AFRESH: usize = 2;
/// Candidates that are relinearised, and the largest number of them; rounds until that gains nothing.
const POLISHED: usize = 3;
const MOST_POLISHED: usize = 5;
const ROUNDS: usize = 5;
/// Single effects that are fitted at a first glance.
const GLANCED: usize = 4;
/// Steps of a fit to convergence.
const STEPS: usize = 4;
/// Steps for a promising single effect behind the first [`AGAIN`].
const FEW_STEPS: usize = 2;
/// Evidence that no further search turns into an effect: a third of the least required.
const LITTLE: f64 = 4.0;
/// Distance of an effect, in tolerances, from which on freeing it is sure to gain: its square is the evidence.
const STRAINED: f64 = 3.0;
/// Evidence within which candidates are fitted to convergence.
const NEAR: f64 = 60.0;
/// Evidence of a pair over its better half from which on the noise is taken from the pair's remainder.
const TELLING: f64 = 20.0;

/// All that was fitted.
pub struct Ranking {
    /// With nothing free.
    pub none: Fit,
    /// The best first.
    pub singles: Vec<Fit>,
    /// The best first; empty if pairs were not asked for.
    pub pairs: Vec<Fit>,
    /// True if pairs were asked for.
    pub with_pairs: bool,
    /// The best first; empty if the best pair gains little over the best single effect.
    pub triples: Vec<Fit>,
    /// Slopes and weights for the background, at `none`.
    pub linear: Linearisation,
    /// Tolerances.
    pub prior: Prior,
    /// Noise model with which gaps were weighed.
    pub noise: Noise,
    /// The gap with all coordinates as expected: neutral, or by a reference log.
    pub neutral: Vec<f64>,
}

impl Ranking {
    /// The candidate of a set of effects, in any order.
    #[must_use]
    pub fn find(&self, effects: &[usize]) -> Option<&Fit> {
        if effects.is_empty() {
            return Some(&self.none);
        }
        let is_of =
            |fit: &&Fit| fit.free.len() == effects.len() && effects.iter().all(|i| fit.free.contains(i));
        self.of(effects.len()).iter().find(is_of)
    }

    /// Candidates of so many effects, the best first.
    #[must_use]
    pub fn of(&self, effects: usize) -> &[Fit] {
        match effects {
            1 => &self.singles,
            2 => &self.pairs,
            3 => &self.triples,
            _ => &[],
        }
    }

    /// Slopes of all uncertain parameters at a fitted point, taken anew.
    #[must_use]
    pub fn linear_at<V: ReplayVehicle>(&self, problem: &Problem<V>, at: &Fit) -> Linearisation {
        if at.free.is_empty() { self.linear.clone() } else { self.linear.anew(problem, &at.x, &at.gap) }
    }
}

/// Reasons for which candidates could not be ranked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the vehicle cannot be replayed on this log")]
pub struct NoReplay;

/// Nothing free: everything within its tolerance.
fn fit_none<'a, V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    start: impl Into<Start<'a>>,
) -> Option<Fit> {
    fit(problem, prior, linear, &[], start, STEPS)
}

/// A fit with all slopes taken anew at its own best.
pub(super) fn polished<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    at: &Fit,
) -> Fit {
    polished_by(problem, prior, &linear.anew(problem, &at.x, &at.gap), at)
}

/// The same with slopes that were taken there.
fn polished_by<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    local: &Linearisation,
    at: &Fit,
) -> Fit {
    fit(problem, prior, local, &at.free, start_at(problem, local, &at.free, (&at.x, &at.gap)), 5)
        .filter(|new| new.cost < at.cost)
        .unwrap_or_else(|| at.clone())
}

/// A start with the slopes over the free uncertain parameters that `local` has from there.
fn start_at<'a, V: ReplayVehicle>(
    problem: &Problem<V>,
    local: &Linearisation,
    free: &[usize],
    (x, gap): (&'a [f64], &'a [f64]),
) -> Start<'a> {
    let own = problem.with_companions(free).into_iter().map(|i| (i, local.slopes[i].clone())).collect();
    Start { x: x.into(), gap: Some(gap.into()), slopes: Some((x, own)) }
}

/// A fit relinearised until that gains nothing. All evidence is measured against it, so it must not stay in a valley on
/// the way.
fn converged<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    from: Fit,
) -> Fit {
    let mut best = from;
    for _ in 0..ROUNDS {
        let next = polished(problem, prior, linear, &best);
        let gained = best.cost - next.cost;
        best = next;
        if gained < 1.0 {
            break;
        }
    }
    best
}

/// True if a cost is so much below that of nothing that a single effect may be informative.
fn may_tell(cost: f64, none: &Fit) -> bool {
    cost < none.cost - LITTLE
}

/// True if a cost is so near the best that a candidate is fitted to convergence.
fn is_near(cost: f64, best: f64) -> bool {
    cost < best + 0.25 * best.abs() + NEAR
}

/// True if the best candidate of one effect more gains so much over the best one without it.
fn is_ahead(more: &[Fit], fewer: &[Fit], by: f64) -> bool {
    matches!((more.first(), fewer.first()), (Some(more), Some(fewer)) if fewer.cost - more.cost > by)
}

/// Singles fitted again with other weights, from their own best: the first [`AGAIN`], and others whose promise is
/// informative and near.
fn fitted_again<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    none: &Fit,
    singles: &mut Vec<Fit>,
) {
    singles.iter_mut().for_each(|single| reweighed(problem, prior, linear, single));
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
        fit(problem, prior, linear, &single.free, single, if k < AGAIN { STEPS } else { FEW_STEPS })
    });
    take(singles, found.into_iter().flatten());
}

/// Refit from the null optimum of candidates whose linear step from there promises a lower cost than they have. Only
/// the first [`AGAIN`] that promise to be informative are fitted.
fn again_from_none<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    none: &Fit,
    singles: &mut Vec<Fit>,
) {
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
        fit(problem, prior, linear, &singles[*k].free, x, STEPS)
    });
    take(singles, found.into_iter().flatten());
}

/// Refit of the first few of sorted candidates from the null optimum, with their effects as found and all slopes taken
/// there. Background parameters can stick in a local minimum on the way to an effect that is far off.
fn relinearise<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    none: &Fit,
    fits: &mut Vec<Fit>,
) {
    let again = |of: &Fit| {
        let mut x = none.x.clone();
        problem.with_companions(&of.free).into_iter().for_each(|i| x[i] = of.x[i]);
        let gap = problem.residual(&x)?;
        let local = linear.anew(problem, &x, &gap);
        let start = start_at(problem, &local, &of.free, (&x, &gap));
        let found = fit(problem, prior, &local, &of.free, start, STEPS)?;
        Some(polished(problem, prior, linear, &found))
    };
    let first = fits.iter().take(AFRESH).filter(|of| may_tell(of.cost, none));
    let found: Vec<Fit> = first.filter_map(again).collect();
    take(fits, found);
}

/// Relinearises the first few of sorted candidates, until all of the first few have been.
fn refine<V: ReplayVehicle>(problem: &Problem<V>, prior: &Prior, linear: &Linearisation, fits: &mut [Fit]) {
    let mut done: Vec<Vec<usize>> = Vec::new();
    loop {
        let best = fits.first().map_or(0.0, |fit| fit.cost);
        let is_next = |fit: &Fit| !done.contains(&fit.free) && (done.is_empty() || is_near(fit.cost, best));
        let first = fits.iter().take(POLISHED).enumerate().filter(|(_, fit)| is_next(fit)).map(|(i, _)| i);
        let next: Vec<usize> = first.take(MOST_POLISHED - done.len()).collect();
        if next.is_empty() {
            break;
        }
        // Slopes one after the other, as each are taken by all threads.
        let locals: Vec<Linearisation> =
            next.iter().map(|&i| linear.anew(problem, &fits[i].x, &fits[i].gap)).collect();
        let found = parallel::map(problem.threads(), next.len(), |k| {
            polished_by(problem, prior, &locals[k], &fits[next[k]])
        });
        for (i, found) in next.into_iter().zip(found) {
            done.push(fits[i].free.clone());
            fits[i] = found;
        }
        sort(fits);
    }
}

/// The same for single effects, if one is informative: relinearising does not turn the others into effects.
fn polish_singles<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    none: &Fit,
    singles: &mut [Fit],
) {
    if singles.first().is_some_and(|best| may_tell(best.cost, none)) {
        refine(problem, prior, linear, singles);
    }
}

/// Upper bounds from nested models. A candidate with a value within its tolerance is also explained by the background.
/// So its cost with the tolerance's penalty bounds that of nothing free, which in turn bounds every candidate's.
fn bound<V: ReplayVehicle>(problem: &Problem<V>, prior: &Prior, none: &mut Fit, singles: &mut [Fit]) {
    let of_none = prior.free(problem, &[]);
    for single in singles.iter() {
        let off = prior.off(&single.x);
        let of_single = prior.free(problem, &single.free);
        let cost = single.cost - of_single.penalty(&off) + of_none.penalty(&off);
        if cost < none.cost {
            *none = Fit { free: Vec::new(), columns: Vec::new(), cost, ..single.clone() };
        }
    }
    // And where the background strains an effect's tolerance, freeing that effect alone saves the strain's cost.
    let off = prior.off(&none.x);
    let left = none.cost - of_none.penalty(&off);
    for single in singles.iter_mut() {
        let i = single.free[0];
        let free = left + prior.free(problem, &single.free).penalty(&off);
        let may_be = problem.uncertain[i].within(none.x[i], true) == none.x[i];
        if may_be && free < single.cost {
            *single = Fit { x: none.x.clone(), gap: none.gap.clone(), cost: free, ..single.clone() };
        }
    }
    sort(singles);
}

/// Upper bounds from larger candidates. The background also explains the part of an effect within its tolerance,
/// without freeing it. The cost bounds that of the candidate of the others, whose own search may have missed it.
fn bound_fewer<V: ReplayVehicle>(problem: &Problem<V>, prior: &Prior, fewer: &mut Vec<Fit>, more: &[Fit]) {
    for fit in more {
        let off = prior.off(&fit.x);
        let gap = fit.cost - prior.free(problem, &fit.free).penalty(&off);
        for (place, &i) in fit.free.iter().enumerate() {
            if problem.uncertain[i].tolerance == 0.0
                || problem.uncertain[i].within(fit.x[i], false) != fit.x[i]
            {
                continue;
            }
            let mut others = fit.clone();
            others.free.remove(place);
            others.columns.clear();
            others.cost = gap + prior.free(problem, &others.free).penalty(&off);
            match fewer.iter_mut().find(|known| of_the_same(known, &others)) {
                Some(known) if known.cost <= others.cost => {}
                Some(known) => (known.x, known.gap, known.cost) = (others.x, others.gap, others.cost),
                None => fewer.push(others),
            }
        }
    }
    sort(fewer);
}

/// Upper bounds from smaller candidates, the reverse of [`bound`]. Among the first few, freeing an effect whose
/// tolerance is strained saves the cost of the strain. True if the result is better than the best known.
fn bound_more<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    more: &mut Vec<Fit>,
    fewer: &[Fit],
) -> bool {
    let before = more.first().map_or(f64::INFINITY, |best| best.cost);
    for fit in fewer.iter().take(POLISHED) {
        let off = prior.off(&fit.x);
        let gap = fit.cost - prior.free(problem, &fit.free).penalty(&off);
        for (i, uncertain) in problem.uncertain.iter().enumerate() {
            let may_be = uncertain.is_candidate() && uncertain.within(fit.x[i], true) == fit.x[i];
            let strains = uncertain.tolerance > 0.0 && off[i].abs() > STRAINED * uncertain.tolerance;
            if !may_be || !strains || fit.free.contains(&i) {
                continue;
            }
            let free = [&fit.free[..], &[i]].concat();
            let cost = gap + prior.free(problem, &free).penalty(&off);
            take(more, [Fit { free, columns: Vec::new(), cost, ..fit.clone() }]);
        }
    }
    more.first().is_some_and(|best| best.cost < before - 1.0)
}

/// Candidates with a payload in place of a strained mass. No tolerance is that wide, and a payload has much the same
/// response; it is fitted from as many kilograms.
fn loaded<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    fewer: &[Fit],
) -> Vec<Fit> {
    let each = fewer.iter().take(POLISHED).flat_map(|fit| LOADED.iter().map(move |it| (fit, it)));
    let swapped = each.filter_map(|(of, (mass, load))| {
        let (mass, load) = (problem.find(mass)?, problem.find(load)?);
        let (uncertain, of_load) = (&problem.uncertain[mass], &problem.uncertain[load]);
        let heavier = of.x[mass] - prior.mean[mass] > STRAINED * uncertain.tolerance;
        if !heavier || !of_load.is_candidate() || of.free.contains(&load) {
            return None;
        }
        let kilograms = |x: f64| uncertain.adjusted(x, problem.vehicle).1;
        let mut x = of.x.clone();
        x[mass] = prior.mean[mass];
        x[load] += (kilograms(of.x[mass]) - kilograms(x[mass])) / of_load.unit;
        Some(([&of.free[..], &[load]].concat(), x))
    });
    swapped.filter_map(|(free, x)| fit(problem, prior, linear, &free, &x, STEPS)).collect()
}

/// Fits candidates of one effect less from the coordinates of the best `count` with one more. The larger search may
/// have found the background and the others in another valley.
fn fewer_from_more<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    fewer: &mut Vec<Fit>,
    more: &[Fit],
    count: usize,
) {
    let starts: Vec<(Vec<usize>, Vec<f64>)> = more
        .iter()
        .take(count)
        .flat_map(|fit| (0..fit.free.len()).map(move |place| (fit, place)))
        .map(|(fit, place)| {
            let mut others = fit.free.clone();
            let gone = others.remove(place);
            (others, prior.without(problem, &[gone], &fit.x))
        })
        .collect();
    let found = parallel::map(problem.threads(), starts.len(), |k| {
        fit(problem, prior, linear, &starts[k].0, &starts[k].1, STEPS)
    });
    take(fewer, found.into_iter().flatten());
}

/// True if both free the same effects.
fn of_the_same(one: &Fit, other: &Fit) -> bool {
    one.free.len() == other.free.len() && one.free.iter().all(|i| other.free.contains(i))
}

/// Adds fits to others; for equal effects the better one stays.
fn take(known: &mut Vec<Fit>, more: impl IntoIterator<Item = Fit>) {
    for new in more {
        match known.iter_mut().find(|old| of_the_same(old, &new)) {
            Some(old) if old.cost <= new.cost => {}
            Some(old) => *old = new,
            None => known.push(new),
        }
    }
    sort(known);
}

/// Fits candidates of one effect more from the coordinates of the best with one less, where they explain hardly more.
/// Chance alone gives one more effect some gain, so these searches began in another valley.
fn more_from_fewer<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    more: &mut Vec<Fit>,
    fewer: &[Fit],
    singles: &[Fit],
    beam: &Beam,
) {
    if more.is_empty() {
        return;
    }
    take(more, loaded(problem, prior, linear, fewer));
    if bound_more(problem, prior, more, fewer) {
        refine(problem, prior, linear, more);
    }
    let (Some(best), Some(behind)) = (fewer.first(), more.first()) else { return };
    if behind.cost <= best.cost - 1.0 {
        return;
    }
    let local = linear.anew(problem, &best.x, &best.gap);
    take(more, extended(problem, prior, &local, fewer, singles, beam));
    refine(problem, prior, &local, more);
}

fn sort(fits: &mut [Fit]) {
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.free.cmp(&b.free)));
}

/// Costs and coordinates of a fit with other weights, by its own slopes.
fn reweighed<V: ReplayVehicle>(problem: &Problem<V>, prior: &Prior, linear: &Linearisation, fit: &mut Fit) {
    let precision = prior.free(problem, &fit.free);
    fit.cost = linear.square(&fit.gap) + precision.penalty(&prior.off(&fit.x));
}

/// The best `count` fits, refitted with other weights; all costs by these.
fn refined<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    fits: &mut [Fit],
    count: usize,
) {
    fits.iter_mut().for_each(|fit| reweighed(problem, prior, linear, fit));
    sort(fits);
    let found = parallel::map(problem.threads(), fits.len().min(count), |k| {
        fit(problem, prior, linear, &fits[k].free, &fits[k], 3)
    });
    for (old, new) in fits.iter_mut().zip(found) {
        if let Some(new) = new
            && new.cost < old.cost
        {
            *old = new;
        }
    }
    sort(fits);
}

/// Coordinates for slopes: at the best single effect where it is informative.
fn based(none: &Fit, singles: &[Fit]) -> Vec<f64> {
    singles.first().filter(|best| none.cost - best.cost > 50.0).map_or(&none.x, |best| &best.x).clone()
}

/// Ranks all candidates; `prior` is the knowledge of the tolerances. `pairs` decides from the gains of nothing and of
/// single effects if more than one is searched for.
///
/// # Errors
/// A vehicle that cannot be replayed.
pub fn rank<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: Prior,
    pairs: &dyn Fn(&Fit, &[Fit]) -> bool,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Ranking, NoReplay> {
    let threads = problem.threads();
    let start = prior.mean.clone();
    let trace = problem.trace(&start).map_err(|_| NoReplay)?;
    let neutral = problem.compare(&trace);
    let fine = Noise::of(problem, &trace, &prior.form);
    let noise = fine.coarse(problem, &neutral);
    progress("sensitivities", 0.1);
    let at_start = problem.residual(&start).ok_or(NoReplay)?;
    let linear = Linearisation::new(problem.slopes(&start, &at_start), noise.weights(problem));
    let none = fit_none(problem, &prior, &linear, &start).ok_or(NoReplay)?;
    let linear = Linearisation::new(problem.slopes(&none.x, &none.gap), noise.weights(problem));
    let none = fit_none(problem, &prior, &linear, &none).ok_or(NoReplay)?;

    progress("single effects", 0.2);
    let candidates = candidates(problem);
    let mut singles: Vec<Fit> = parallel::map(threads, candidates.len(), |k| {
        let i = candidates[k];
        let start = best_start(problem, &prior, &linear, &[i], &none, None);
        fit(problem, &prior, &linear, &[i], start, 3)
    })
    .into_iter()
    .flatten()
    .collect();
    sort(&mut singles);
    let mut found = vec![none];
    fewer_from_more(problem, &prior, &linear, &mut found, &singles, 3);
    let mut none = found.swap_remove(0);
    progress("noise", 0.5);

    // From there on with all trust.
    let noise = fine;
    let base = based(&none, &singles);
    let at_base = problem.residual(&base).ok_or(NoReplay)?;
    let linear = Linearisation::new(problem.slopes(&base, &at_base), noise.weights(problem));
    reweighed(problem, &prior, &linear, &mut none);
    none = fit_none(problem, &prior, &linear, &none).ok_or(NoReplay)?;
    refined(problem, &prior, &linear, &mut singles, REFINED);

    let noise = singles.first().map_or_else(
        || noise.clone(),
        |best| noise.with_left(problem, &unexplained(problem, &prior, &linear, best)),
    );
    let base = based(&none, &singles);
    let at_base = problem.residual(&base).ok_or(NoReplay)?;
    let linear = Linearisation::new(problem.slopes(&base, &at_base), noise.weights(problem));
    progress("single effects", 0.6);
    let mut none = fit_none(problem, &prior, &linear, &none).ok_or(NoReplay)?;
    fitted_again(problem, &prior, &linear, &none, &mut singles);
    let local = linear.anew(problem, &none.x, &none.gap);
    none = fit(problem, &prior, &local, &[], &none, 5).filter(|new| new.cost < none.cost).unwrap_or(none);
    again_from_none(problem, &prior, &local, &none, &mut singles);
    relinearise(problem, &prior, &linear, &none, &mut singles);
    polish_singles(problem, &prior, &linear, &none, &mut singles);
    bound(problem, &prior, &mut none, &mut singles);
    let with_pairs = pairs(&none, &singles);
    let mut pairs = Vec::new();
    if with_pairs {
        progress("pairs", 0.75);
        pairs = extended(problem, &prior, &linear, &singles, &singles, &OF_SINGLES);
        refine(problem, &prior, &linear, &mut pairs);
    }
    progress("pairs", 0.9);
    // Where a pair tells much more than a single effect, its rest is the measure.
    let (mut linear, mut noise) = (linear, noise);
    let mut threes = Vec::new();
    if let Some(pair) = pairs.first().filter(|_| is_ahead(&pairs, &singles, TELLING)) {
        noise = noise.with_left(problem, &unexplained(problem, &prior, &linear, pair));
        let slopes = problem.slopes(&pair.x, &pair.gap);
        linear = Linearisation::new(slopes, noise.weights(problem));
        none = fit_none(problem, &prior, &linear, &none).ok_or(NoReplay)?;
        for fits in [&mut singles, &mut pairs] {
            refined(problem, &prior, &linear, fits, REFINED);
        }
        if !is_ahead(&pairs, &singles, NEAR) {
            polish_singles(problem, &prior, &linear, &none, &mut singles);
        }
        bound(problem, &prior, &mut none, &mut singles);
        threes = extended(problem, &prior, &linear, &pairs, &singles, &OF_PAIRS);
        if is_ahead(&threes, &pairs, LITTLE) {
            refine(problem, &prior, &linear, &mut threes);
        }
    }
    bound_fewer(problem, &prior, &mut pairs, &threes);
    if is_ahead(&threes, &pairs, LITTLE) {
        fewer_from_more(problem, &prior, &linear, &mut pairs, &threes, 2);
        refine(problem, &prior, &linear, &mut pairs);
    }
    bound_fewer(problem, &prior, &mut singles, &pairs);
    fewer_from_more(problem, &prior, &linear, &mut singles, &pairs, 3);
    polish_singles(problem, &prior, &linear, &none, &mut singles);
    let mut found = vec![none];
    fewer_from_more(problem, &prior, &linear, &mut found, &singles, 2);
    let before = found.swap_remove(0);
    let mut none = converged(problem, &prior, &linear, before.clone());
    if before.cost - none.cost > 1.0 && !is_ahead(&pairs, &singles, NEAR) {
        let local = linear.anew(problem, &none.x, &none.gap);
        again_from_none(problem, &prior, &local, &none, &mut singles);
        polish_singles(problem, &prior, &linear, &none, &mut singles);
    }
    bound(problem, &prior, &mut none, &mut singles);
    // And the other way round: whatever is free besides, a candidate explains no less than without.
    more_from_fewer(problem, &prior, &linear, &mut pairs, &singles, &singles, &OF_SINGLES);
    more_from_fewer(problem, &prior, &linear, &mut threes, &pairs, &singles, &OF_PAIRS);
    Ok(Ranking { none, singles, pairs, with_pairs, triples: threes, linear, prior, noise, neutral })
}

/// The gap after a linear step.
#[must_use]
pub fn predicted(linear: &Linearisation, gap: &[f64], change: &[f64]) -> Vec<f64> {
    let mut left = gap.to_vec();
    for (slope, &change) in linear.slopes.iter().zip(change) {
        if change != 0.0 {
            left.iter_mut().zip(slope.iter()).for_each(|(left, slope)| *left -= slope * change);
        }
    }
    left
}

/// Remainder of a fit with all else free within three tolerances: no noise, and yet told by nothing.
fn unexplained<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    fit: &Fit,
) -> Vec<f64> {
    let precision = prior.free(problem, &fit.free).widened(3.0);
    let step = prior.step(linear, &fit.x, &fit.gap, &precision);
    predicted(linear, &fit.gap, &step.change)
}

/// Uncertain parameters that may be named.
fn candidates<V: ReplayVehicle>(problem: &Problem<V>) -> Vec<usize> {
    (0..problem.uncertain.len()).filter(|&i| problem.uncertain[i].is_candidate()).collect()
}

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
    let none = fit_none(problem, &prior, &linear, &prior.mean)?;
    let candidates = candidates(problem);
    let mut promised: Vec<(f64, usize, Start)> = parallel::map(problem.threads(), candidates.len(), |k| {
        let i = candidates[k];
        let start = best_start(problem, &prior, &linear, &[i], &none, None);
        let gap = start.gap.as_deref().unwrap_or(&none.gap);
        (prior.step(&linear, &start.x, gap, &prior.free(problem, &[i])).cost, i, start)
    });
    promised.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    promised.truncate(GLANCED);
    let singles = parallel::map(problem.threads(), promised.len(), |k| {
        let (_, i, start) = &promised[k];
        fit(problem, &prior, &linear, &[*i], start.clone(), STEPS)
    });
    let found = singles.into_iter().flatten().chain([none]);
    let best = found.min_by(|a, b| priced(a, odds).total_cmp(&priced(b, odds)))?;
    let noise = fine.with_left(problem, &unexplained(problem, &prior, &linear, &best));
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
            Some(priced(&fit(problem, &self.prior, &linear, &best.free, &best.x, STEPS)?, odds))
        };
        [&self.best, &other.best].into_iter().filter_map(from).min_by(f64::total_cmp)
    }
}

/// The gap of a fit with all coordinates as expected, by its slopes.
#[must_use]
pub fn expected(linear: &Linearisation, prior: &Prior, fit: &Fit) -> Vec<f64> {
    let back: Vec<f64> = prior.off(&fit.x).iter().map(|off| -off).collect();
    predicted(linear, &fit.gap, &back)
}

/// Starting point of a fit whose last effect is new to it: the one with the most promising linear step. Candidates are
/// its starts, and half of `own`, the effect's value when alone. Some effects have no slope at their neutral value, and
/// friction and wind have more than one optimum.
fn best_start<'a, V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    free: &[usize],
    from: &'a Fit,
    own: Option<f64>,
) -> Start<'a> {
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

/// Construction of candidates from others by one effect more.
struct Beam {
    /// Number of the first that are bases.
    bases: usize,
    /// Number of first bases, and of first effects, that are fitted in every combination.
    always: usize,
    /// So many are fitted.
    fitted: usize,
}

/// Candidates of one effect more: each of the first `bases` with each of `singles`.
fn extended<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    bases: &[Fit],
    singles: &[Fit],
    beam: &Beam,
) -> Vec<Fit> {
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
            return fit(problem, prior, linear, &free, base, STEPS);
        }
        let own = Some(single.x[further]);
        let start = best_start(problem, prior, linear, &free, base, own);
        fit(problem, prior, linear, &free, start, STEPS)
    })
    .into_iter()
    .flatten()
    .collect();
    sort(&mut fits);
    fits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::library::Library;
    use crate::diagnose::replay::{ReplayDrive, neutral};
    use crate::diagnose::simulated::{Conditions, drive};
    use crate::vehicle::{TruckEffects, builtin};

    #[test]
    fn a_load_is_fitted_in_place_of_a_mass_that_is_strained() {
        let car = builtin("c_class").unwrap();
        let mut effects = TruckEffects::default();
        (effects.vehicle.payload, effects.vehicle.steer_offset) = (300.0, 0.02);
        let conditions = Conditions { seed: 3, duration: 20.0, step: 0.02, ..Conditions::default() };
        let log = drive(&car, &effects, &conditions).unwrap();
        let drive = ReplayDrive::new(&log, false);
        let correction = neutral(&drive, &car).unwrap();
        let problem = Problem::new(&drive, &car, &correction, Library::default(), 0);
        let prior = Prior::of(&problem);
        let [mass, load, offset] =
            ["vehicle.mass", "payload", "steer_offset"].map(|id| problem.find(id).unwrap());
        let start = prior.mean.clone();
        let gap = problem.residual(&start).unwrap();
        let noise = Noise::of(&problem, &problem.trace(&start).unwrap(), &prior.form);
        let linear = Linearisation::new(problem.slopes(&start, &gap), noise.weights(&problem));
        let with_mass_at = |x: f64| {
            let mut at = start.clone();
            at[mass] = x;
            fit(&problem, &prior.holding(&[mass], &at), &linear, &[offset], &at, STEPS).unwrap()
        };
        let strained = with_mass_at(6.0);
        let found = loaded(&problem, &prior, &linear, std::slice::from_ref(&strained));
        let [of_load] = found.as_slice() else { panic!("{}", found.len()) };
        assert_eq!(of_load.free, [offset, load]);
        let kilograms = of_load.x[load] * problem.uncertain[load].unit;
        assert!((kilograms - 300.0).abs() < 60.0, "{kilograms}");
        assert!(of_load.x[mass].abs() < STRAINED, "{}", of_load.x[mass]);
        // Within its tolerance a mass is no load.
        assert!(loaded(&problem, &prior, &linear, &[with_mass_at(2.0)]).is_empty());
    }

    #[test]
    fn what_a_search_gave_to_the_background_is_got_back_afresh() {
        let car = builtin("c_class").unwrap();
        let mut effects = TruckEffects::default();
        effects.vehicle.steer_delay = 0.1;
        let conditions = Conditions { seed: 3, duration: 20.0, step: 0.02, ..Conditions::default() };
        let log = drive(&car, &effects, &conditions).unwrap();
        let drive = ReplayDrive::new(&log, false);
        let correction = neutral(&drive, &car).unwrap();
        let problem = Problem::new(&drive, &car, &correction, Library::default(), 0);
        let prior = Prior::of(&problem);
        let [delay, rear] = ["steer_delay", "tyre_stiffness_rear"].map(|id| problem.find(id).unwrap());
        let start = prior.mean.clone();
        let gap = problem.residual(&start).unwrap();
        let noise = Noise::of(&problem, &problem.trace(&start).unwrap(), &prior.form);
        let linear = Linearisation::new(problem.slopes(&start, &gap), noise.weights(&problem));
        let none = fit_none(&problem, &prior, &linear, &start).unwrap();
        // Found with a rear axle that is too soft by two tolerances.
        let mut astray = start;
        (astray[delay], astray[rear]) = (4.0, -0.8);
        let mut found =
            fit(&problem, &prior.holding(&[rear], &astray), &linear, &[delay], &astray, STEPS).unwrap();
        reweighed(&problem, &prior, &linear, &mut found);
        let before = found.cost;
        let mut fits = vec![found];
        relinearise(&problem, &prior, &linear, &none, &mut fits);
        let [now] = fits.as_slice() else { panic!("{}", fits.len()) };
        assert!(now.cost < 0.5 * before, "{} {before} {}", now.cost, none.cost);
        let seconds = problem.uncertain[delay].value(now.x[delay]);
        assert!((seconds - 0.1).abs() < 0.01, "{seconds}");
        assert!(now.x[rear].abs() < 3.0 * problem.uncertain[rear].tolerance, "{}", now.x[rear]);
    }
}
