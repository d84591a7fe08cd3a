//! Probability of each hypothesis, given the log.
//!
//! Hypotheses are: nothing (`none`), sets of one to three effects, and a cause that the library does not have. Each has a
//! fit with the tolerances marginalised, whose cost `J` is twice a negative logarithm of the evidence. With `k` effects free,
//!
//! ```text
//!     log P = -eta (J - J_none) / 2 - log det(1 + eta S' W S P^-1) / 2 - k odds + const,
//! ```
//!
//! `eta` the temper of a misspecified likelihood, `odds` the price of an effect. The determinant, by the slopes at the
//! fit, is that of Laplace's approximation: freedom that the log narrows has a cost. An effect that it cannot show
//! keeps its prior probability. Slopes carry a fit from the search's weights to those of a world. What they promise
//! under the search's own weights no replay has seen: it is taken off the evidence. A cause outside the library competes
//! with evidence of its own, upon the fit of the best hypothesis of the library:
//!
//! | a varying value | an effect follows angle, speed, place, ...: `constancy.rs` |
//! |---|---|
//! | something else is off | a number of the vehicle that is no effect is free like one |
//! | a resonant steering | `resonance.rs` |
//! | a misfit | the remainder has a size `m` in units of the remainder that the model's form leaves, log-normal with a
//! deviation `known` for a cause in the library, `broad` for one outside |
//!
//! Sources: a tempered posterior as in Bissiri, Holmes and Walker, J. R. Stat. Soc. B 78 (2016); hypotheses found by search as in
//! Madigan and Raftery, J. Am. Stat. Assoc. 89 (1994).

use super::beliefs::{Beliefs, World};
use super::calibration::Calibration;
use super::constancy::{self, Variation};
use super::fit::{Converged, Fit, Linearisation, Precision, Prior};
use super::problem::{Problem, rms};
use super::rank::{Ranking, predicted};
use super::replay::{Channel, ReplayVehicle};
use super::report::Term;
use super::resonance::resonance;
use crate::numerics::parallel;

/// Logarithm of the share of the best hypothesis below which another is negligible.
const NEGLIGIBLE: f64 = -20.0;

/// Scale of the tolerances from which on they are no ordinary ones.
const WIDE: f64 = 2.0;

/// Sign that a cause is not in the library.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unknown {
    /// The value of an effect would have to change.
    Varies(Variation),
    /// A number that is no effect of the library would have to be far off: its uncertain parameter, and its coordinate then.
    Off { uncertain: usize, x: f64 },
    /// The steering swings.
    Swings,
    /// Too large a remainder: its ratio to that of the model's form, and the channel with most of it.
    Misfit(f64, Channel),
}

/// A possible cause.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// Effects that are free; for an unknown cause those of the hypothesis that it extends.
    pub effects: Vec<usize>,
    /// Sign that the cause is not in the library, if it is not.
    pub unknown: Option<Unknown>,
    /// Terms of its weight in each world.
    pub terms: Vec<Term>,
    /// Its probability.
    pub probability: f64,
}

impl Hypothesis {
    /// True for the hypothesis of exactly this set of effects of the library; the empty set is no effect.
    #[must_use]
    pub fn is_of(&self, effects: &[usize]) -> bool {
        self.unknown.is_none()
            && self.effects.len() == effects.len()
            && effects.iter().all(|effect| self.effects.contains(effect))
    }
}

/// Probabilities of all hypotheses, the most probable first.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    /// They add up to 1.
    pub hypotheses: Vec<Hypothesis>,
    /// Probability of each world.
    pub worlds: Vec<(World, f64)>,
}

impl Posterior {
    /// Posterior from hypotheses with the logarithms of their weights in place of probabilities.
    #[must_use]
    pub fn normalised(mut hypotheses: Vec<Hypothesis>) -> Self {
        let best = hypotheses.iter().map(|it| it.probability).fold(f64::NEG_INFINITY, f64::max);
        hypotheses.retain(|it| it.probability > best + NEGLIGIBLE);
        hypotheses.iter_mut().for_each(|it| it.probability = (it.probability - best).exp());
        let sum: f64 = hypotheses.iter().map(|it| it.probability).sum();
        hypotheses.iter_mut().for_each(|it| it.probability /= sum);
        hypotheses.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        Self { hypotheses, worlds: Vec::new() }
    }

    /// Posterior of a ranking; `causes` are the quantities that values may vary with.
    pub(super) fn of<V: ReplayVehicle>(
        problem: &Problem<V>,
        ranking: &Ranking,
        calibration: &Calibration,
        beliefs: &Beliefs,
        causes: &[constancy::CauseColumns],
    ) -> Self {
        let fits: Vec<&Fit> =
            std::iter::once(&ranking.none).chain((1..=3).flat_map(|count| ranking.of(count))).collect();
        let linear = ranking.linear.tempered(calibration.temper);
        let linears: Vec<Linearisation> =
            parallel::map(problem.threads(), fits.len(), |k| linear.with(&fits[k].of_free()));
        // Linear steps from a fit that the search could not follow: no replay has seen their gain. To its own best, and to nothing.
        let unseen = parallel::map(problem.threads(), fits.len(), |k| {
            let (own, fit) = (ranking.linear.with(&fits[k].of_free()), fits[k]);
            let gain = |seen: f64, step: Option<Converged>| {
                step.map(|step| calibration.temper * (seen - step.cost).max(0.0))
            };
            [
                gain(fit.cost, converged(problem, &ranking.prior, &own, fit, &fit.free)).unwrap_or(0.0),
                gain(ranking.none.cost, without_effect(problem, &ranking.prior, &own, fit))
                    .unwrap_or(f64::INFINITY),
            ]
        });
        let worlds = beliefs.trust.worlds();
        let mut reference = None;
        let all: Vec<Vec<Hypothesis>> = worlds
            .iter()
            .map(|world| {
                let prior = ranking.prior.times(problem, world.factor);
                let settled = parallel::map(problem.threads(), fits.len(), |k| {
                    converged(problem, &prior, &linears[k], fits[k], &fits[k].free)
                });
                let Some(none) = settled[0].as_ref() else { return Vec::new() };
                // Nothing is held against each hypothesis by the same slopes: its gain is no difference of two linearisations.
                let nothing = parallel::map(problem.threads(), fits.len(), |k| {
                    let there = without_effect(problem, &prior, &linears[k], fits[k]);
                    there.map_or(f64::INFINITY, |there| there.cost + unseen[k][1])
                });
                let nothing = nothing.into_iter().fold(none.cost + unseen[0][0], f64::min);
                let (cost, narrowing) = *reference.get_or_insert((nothing, none.narrowing));
                let hypothesis = |((fit, at), unseen): ((&&Fit, &Option<Converged>), &[f64; 2])| {
                    let at = at.as_ref()?;
                    let left = if fit.free.is_empty() { nothing } else { at.cost + unseen[0] };
                    let (evidence, narrowing) = (cost - left, at.narrowing - narrowing);
                    let odds: f64 =
                        fit.free.iter().map(|&i| beliefs.odds(problem.uncertain[i].id, calibration)).sum();
                    let probability = calibration.weight(evidence, narrowing, odds + world.odds);
                    let effects = fit.free.clone();
                    let terms = vec![Term { factor: world.factor, evidence, narrowing }];
                    Some(Hypothesis { effects, unknown: None, terms, probability })
                };
                let known: Vec<Option<Hypothesis>> =
                    fits.iter().zip(&settled).zip(&unseen).map(hypothesis).collect();
                let given = WorldInputs { problem, calibration, causes, prior: &prior, world };
                let mut all = given.unknown(ranking, &fits, &linears, &settled, &known);
                all.extend(known.into_iter().flatten());
                all
            })
            .collect();
        let weight =
            |all: &Vec<Hypothesis>| all.iter().map(|it| it.probability).fold(f64::NEG_INFINITY, log_sum);
        let weights: Vec<f64> = all.iter().map(weight).collect();
        let total = weights.iter().copied().fold(f64::NEG_INFINITY, log_sum);
        let worlds = worlds.into_iter().zip(weights).map(|(world, weight)| (world, (weight - total).exp()));
        Self { worlds: worlds.collect(), ..Self::normalised(merged(all.into_iter().flatten())) }
    }

    /// The most probable scale of the tolerances, where they are wider than ordinary ones.
    #[must_use]
    pub fn wide(&self) -> Option<f64> {
        let likeliest = self.worlds.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        likeliest.map(|(world, _)| world.factor).filter(|factor| *factor >= WIDE)
    }

    /// Probability that there is no effect.
    #[must_use]
    pub fn none(&self) -> f64 {
        self.sum(|it| it.is_of(&[]))
    }

    /// Probability that the cause is not in the library.
    #[must_use]
    pub fn unknown(&self) -> f64 {
        self.sum(|it| it.unknown.is_some())
    }

    /// Probability that an effect is among the causes.
    #[must_use]
    pub fn inclusion(&self, effect: usize) -> f64 {
        self.sum(|it| it.unknown.is_none() && it.effects.contains(&effect))
    }

    /// Of a set of effects.
    #[must_use]
    pub fn of_set(&self, effects: &[usize]) -> f64 {
        self.sum(|it| it.is_of(effects))
    }

    fn sum(&self, of: impl Fn(&Hypothesis) -> bool) -> f64 {
        self.hypotheses.iter().filter(|it| of(it)).map(|it| it.probability).sum()
    }
}

/// Logarithm of the sum of two, by their logarithms.
fn log_sum(one: f64, other: f64) -> f64 {
    let (more, less) = (one.max(other), one.min(other));
    if less == f64::NEG_INFINITY { more } else { more + (less - more).exp().ln_1p() }
}

/// Equal hypotheses joined, with the logarithm of the sum of their weights.
fn merged(all: impl Iterator<Item = Hypothesis>) -> Vec<Hypothesis> {
    let mut found: Vec<Hypothesis> = Vec::new();
    for it in all {
        let is_same =
            |known: &&mut Hypothesis| known.effects == it.effects && same(known.unknown, it.unknown);
        match found.iter_mut().find(is_same) {
            Some(known) => {
                let sum = log_sum(known.probability, it.probability);
                let terms = [&known.terms[..], &it.terms].concat();
                // What it says of itself is said of the likelier world.
                let likelier = if it.probability > known.probability { it } else { known.clone() };
                *known = Hypothesis { terms, probability: sum, ..likelier };
            }
            None => found.push(it),
        }
    }
    found
}

/// True if two causes outside the library are the same.
fn same(one: Option<Unknown>, other: Option<Unknown>) -> bool {
    match (one, other) {
        (None, None)
        | (Some(Unknown::Swings), Some(Unknown::Swings))
        | (Some(Unknown::Misfit(..)), Some(Unknown::Misfit(..))) => true,
        (Some(Unknown::Off { uncertain: one, .. }), Some(Unknown::Off { uncertain: other, .. })) => {
            one == other
        }
        (Some(Unknown::Varies(one)), Some(Unknown::Varies(other))) => {
            one.effect == other.effect && one.with == other.with
        }
        _ => false,
    }
}

/// A fit at its best under a prior, with some uncertain parameters free.
fn converged<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    fit: &Fit,
    free: &[usize],
) -> Option<Converged> {
    let off = prior.off(&fit.x);
    let by = |precision: Precision| linear.converged(&off, &fit.gap, precision);
    let found = by(prior.free(problem, free))?;
    // An effect that would leave its range stays where it was found: at the end of it.
    let is_beyond = |&i: &usize| {
        let x = fit.x[i] + found.change[i];
        problem.uncertain[i].within(x, fit.free.contains(&i)) != x
    };
    let beyond: Vec<usize> = free.iter().copied().filter(is_beyond).collect();
    if beyond.is_empty() { Some(found) } else { by(prior.free_but(problem, free, &beyond)) }
}

/// No effect at its best under a prior, by the slopes at a fit; none where an effect of the fit has no tolerance.
fn without_effect<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    fit: &Fit,
) -> Option<Converged> {
    let precision = prior.free(problem, &[]);
    let tolerated = fit.free.iter().all(|effect| precision.free.contains(effect));
    tolerated.then(|| converged(problem, prior, linear, fit, &[])).flatten()
}

/// Inputs to the weighing of a world.
struct WorldInputs<'a, V> {
    problem: &'a Problem<'a, V>,
    calibration: &'a Calibration,
    causes: &'a [constancy::CauseColumns],
    prior: &'a Prior,
    world: &'a World,
}

impl<V: ReplayVehicle> WorldInputs<'_, V> {
    /// Causes outside the library, upon the best hypothesis within it; and sensors far off, upon that and upon nothing.
    fn unknown(
        &self,
        ranking: &Ranking,
        fits: &[&Fit],
        linears: &[Linearisation],
        settled: &[Option<Converged>],
        known: &[Option<Hypothesis>],
    ) -> Vec<Hypothesis> {
        let Self { problem, calibration, causes, prior, .. } = *self;
        let weight = |it: &Option<Hypothesis>| it.as_ref().map_or(f64::NEG_INFINITY, |it| it.probability);
        let best = known.iter().enumerate().max_by(|a, b| weight(a.1).total_cmp(&weight(b.1)));
        let Some((best, Some(base))) = best else { return Vec::new() };
        let fit = fits[best];
        let upon = |base: &Hypothesis, unknown: Unknown, evidence: f64, narrowing: f64| {
            let more = calibration.unknown_weight(&unknown, evidence, narrowing);
            let terms = vec![Term { factor: self.world.factor, evidence, narrowing }];
            let (effects, probability) = (base.effects.clone(), base.probability + more);
            Hypothesis { effects, unknown: Some(unknown), terms, probability }
        };
        let varies = |base, it: Variation| upon(base, Unknown::Varies(it), it.gain, it.narrowing);
        let mut unknown: Vec<Hypothesis> = Vec::new();
        // Of a single effect that is the best it is told below.
        let is_other = |&k: &usize| k != best && fits[k].free.len() == 1;
        let places: Vec<usize> = (0..fits.len()).filter(is_other).filter(|&k| settled[k].is_some()).collect();
        let singles: Vec<_> =
            places.iter().filter_map(|&k| Some((fits[k], &linears[k], settled[k].as_ref()?))).collect();
        let single = constancy::best_single(problem, prior, causes, &singles);
        unknown.extend(single.and_then(|(place, it)| Some(varies(known[places[place]].as_ref()?, it))));
        let local = ranking.linear_at(problem, fit).tempered(calibration.temper);
        let Some(here) = self::converged(problem, prior, &local, fit, &fit.free) else {
            return unknown;
        };
        let variations = constancy::variations(problem, prior, causes, (&local, &here.precision), fit);
        unknown.extend(variations.into_iter().map(|it| varies(base, it)));
        let at = [
            (&known[0], fits[0], &linears[0], settled[0].as_ref()),
            (&known[best], fit, &local, Some(&here)),
        ];
        for (base, fit, linear, settled) in at.into_iter().skip(usize::from(best == 0)) {
            if let (Some(base), Some(settled)) = (base, settled)
                && let Some(it) = resonance(problem, prior, (linear, &settled.precision), fit)
            {
                unknown.push(upon(base, Unknown::Swings, it.gain, it.narrowing));
            }
        }
        let off =
            |base: &Hypothesis, fit: &Fit, linear: &Linearisation, here: &Converged, with_file: bool| {
                let free = problem.with_companions(&fit.free);
                let found = parallel::map(problem.threads(), problem.uncertain.len(), |uncertain| {
                    let it = &problem.uncertain[uncertain];
                    let is_other = it.tolerance > 0.0
                        && !it.is_candidate()
                        && !it.is_form()
                        && !free.contains(&uncertain)
                        && (with_file || !it.is_of_the_file());
                    let free = is_other.then(|| [&fit.free[..], &[uncertain]].concat())?;
                    let there = self::converged(problem, prior, linear, fit, &free)?;
                    let x = fit.x[uncertain] + there.change[uncertain];
                    let (evidence, narrowing) = (here.cost - there.cost, there.narrowing - here.narrowing);
                    if it.is_of_the_file() {
                        return Some(upon(base, Unknown::Off { uncertain, x }, evidence, narrowing));
                    }
                    // A sensor far off is a poor sensor, and no cause of its own.
                    let probability =
                        base.probability + calibration.weight(evidence, narrowing, calibration.sensor_odds);
                    let more = |term: &Term| Term {
                        evidence: term.evidence + evidence,
                        narrowing: term.narrowing + narrowing,
                        ..*term
                    };
                    let terms = base.terms.iter().map(more).collect();
                    Some(Hypothesis { effects: base.effects.clone(), unknown: None, terms, probability })
                });
                found.into_iter().flatten().collect::<Vec<_>>()
            };
        unknown.extend(off(base, fit, &local, &here, true));
        if let (Some(nothing), Some(settled)) = (known[0].as_ref().filter(|_| best != 0), settled[0].as_ref())
        {
            unknown.extend(off(nothing, fits[0], &linears[0], settled, false));
        }
        let left = predicted(&local, &fit.gap, &here.change);
        let misfit = misfit(problem, ranking, calibration, &left);
        unknown.extend(misfit.map(|(size, channel)| upon(base, Unknown::Misfit(size, channel), 0.0, 0.0)));
        unknown
    }
}

/// Size of a fit's remainder beside the likeliest road, in units of the remainder that the model's form leaves. Given
/// for each signal and its explained part, with the signal that has most of it.
fn misfit<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    calibration: &Calibration,
    left: &[f64],
) -> Option<(f64, Channel)> {
    let weights = &ranking.linear.weights;
    let (rest, before) = (weights.rest(left), weights.rest(&ranking.neutral));
    let squares: Vec<(f64, Channel)> = problem
        .blocks
        .iter()
        .zip(&ranking.noise.floor)
        .map(|((channel, block), floor)| {
            let explained = calibration.misfit.share * rms(&before[block.clone()]);
            ((rms(&rest[block.clone()]) / floor.hypot(explained)).powi(2), *channel)
        })
        .collect();
    let mean = squares.iter().map(|(square, _)| square).sum::<f64>() / squares.len().max(1) as f64;
    let (_, most) = squares.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((mean.sqrt(), *most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_add_up_and_what_is_negligible_is_dropped() {
        let of = |effects: &[usize], unknown, weight: f64| Hypothesis {
            effects: effects.to_vec(),
            unknown,
            terms: Vec::new(),
            probability: weight,
        };
        let posterior = Posterior::normalised(vec![
            of(&[], None, 0.0),
            of(&[1], None, 3.0_f64.ln()),
            of(&[1, 2], None, 2.0_f64.ln()),
            of(&[1], Some(Unknown::Misfit(3.0, Channel::Ay)), 4.0_f64.ln()),
            of(&[3], None, -30.0),
        ]);
        assert_eq!(posterior.hypotheses.len(), 4);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(posterior.none(), 0.1) && near(posterior.unknown(), 0.4));
        assert!(near(posterior.inclusion(1), 0.5) && near(posterior.of_set(&[2, 1]), 0.2));
        assert_eq!(posterior.hypotheses[0].unknown, Some(Unknown::Misfit(3.0, Channel::Ay)));
    }
}
