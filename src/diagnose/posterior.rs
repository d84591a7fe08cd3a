//! How probable each hypothesis is, given the log.
//!
//! Hypotheses are: nothing (`none`), sets of one to three effects, and a cause that the library does not have. Each has a
//! fit with the tolerances marginalised, whose cost `J` is twice a negative logarithm of the evidence. With `k` effects freed,
//!
//! ```text
//!     log P = -eta (J - J_none) / 2 - log det(1 + eta S' W S P^-1) / 2 - k odds + const,
//! ```
//!
//! `eta` the temper of a likelihood that is no true one, `odds` the price of an effect; the determinant, by the slopes at the fit,
//! is that of Laplace's approximation: freedom that the log narrows costs, what it cannot show is as probable as before. What the library does not have competes
//! with evidence of its own, upon the fit of the best hypothesis that it does have:
//!
//! | a value that is not one | an effect follows angle, speed, place, ...: `constancy.rs` |
//! |---|---|
//! | something else is off | a number of the vehicle that is no effect is freed like one |
//! | a misfit | what is left has a size `m` in units of what the model's form leaves, log-normal with a deviation `known` where the library has the cause, `broad` where it has not |
//!
//! Sources: a tempered posterior as in Bissiri, Holmes and Walker, J. R. Stat. Soc. B 78 (2016); hypotheses found by search as in
//! Madigan and Raftery, J. Am. Stat. Assoc. 89 (1994).

use super::calibration::Calibration;
use super::constancy::{self, Variation};
use super::fit::{Fit, Linear};
use super::problem::{Problem, rms};
use super::rank::Ranking;
use super::replay::ReplayVehicle;
use crate::residual::parallel;

/// Logarithm of the share of the best hypothesis below which one says nothing.
const NEGLIGIBLE: f64 = -20.0;

/// What gives away that a cause is not in the library.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unknown {
    /// The value of an effect would have to change.
    Varies(Variation),
    /// What is no effect of the library would have to be far off: its knob.
    Off(usize),
    /// Too much is left: so many times what the model's form leaves.
    Misfit(f64),
}

/// One of the things that may be the matter.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// Effects that are freed; of an unknown cause those that it comes upon.
    pub effects: Vec<usize>,
    /// Whether the cause is one that the library does not have, and what says so.
    pub unknown: Option<Unknown>,
    /// How much better it explains the log than nothing, `J_none - J`; of an unknown cause, than what it comes upon.
    pub evidence: f64,
    /// What its freedom costs, beside that.
    pub narrowing: f64,
    /// Its probability.
    pub probability: f64,
}

impl Hypothesis {
    /// Whether it is of a set of effects of the library, or of none.
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
}

impl Posterior {
    /// From hypotheses with the logarithms of their weights in place of probabilities.
    #[must_use]
    pub fn normalised(mut hypotheses: Vec<Hypothesis>) -> Self {
        let best = hypotheses.iter().map(|it| it.probability).fold(f64::NEG_INFINITY, f64::max);
        hypotheses.retain(|it| it.probability > best + NEGLIGIBLE);
        hypotheses.iter_mut().for_each(|it| it.probability = (it.probability - best).exp());
        let sum: f64 = hypotheses.iter().map(|it| it.probability).sum();
        hypotheses.iter_mut().for_each(|it| it.probability /= sum);
        hypotheses.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        Self { hypotheses }
    }

    /// Of a ranking; `causes` is what values may vary with.
    pub(super) fn of<V: ReplayVehicle>(
        problem: &Problem<V>,
        ranking: &Ranking,
        calibration: &Calibration,
        causes: &[constancy::Columns],
    ) -> Self {
        let temper = calibration.temper;
        let narrowing =
            |linear: &Linear, freed: &[usize]| linear.narrowing(&ranking.prior.freed(problem, freed), temper);
        let of_none = narrowing(&ranking.linear, &[]);
        let fits: Vec<&Fit> =
            std::iter::once(&ranking.none).chain((1..=3).flat_map(|count| ranking.of(count))).collect();
        let known = parallel::map(problem.threads(), fits.len(), |k| {
            let fit = fits[k];
            let own = ranking.linear.with(&fit.of_freed());
            let evidence = ranking.none.cost - fit.cost;
            let narrowing = narrowing(&own, &fit.freed) - of_none;
            let weight = calibration.weight(evidence, narrowing, fit.freed.len());
            Hypothesis { effects: fit.freed.clone(), unknown: None, evidence, narrowing, probability: weight }
        });
        let upon = |base: &Hypothesis, unknown: Unknown, evidence: f64, narrowing: f64| {
            let more = calibration.unknown_weight(&unknown, evidence, narrowing);
            let unknown = Some(unknown);
            Hypothesis { unknown, evidence, narrowing, probability: base.probability + more, ..base.clone() }
        };
        let varies = |base, it: Variation| upon(base, Unknown::Varies(it), it.gain, it.narrowing);
        // None is always there.
        let weights = known.iter().map(|it| it.probability).enumerate();
        let best = weights.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(place, _)| place);
        let (base, fit) = (&known[best], fits[best]);
        let single = constancy::best_single(problem, ranking, causes, temper);
        let mut unknown: Vec<Hypothesis> = Vec::new();
        unknown.extend(single.map(|(place, variation)| varies(&known[1 + place], variation)));
        let local = ranking.linear_at(problem, fit);
        let here = narrowing(&local, &fit.freed);
        let variations = constancy::variations(problem, ranking, causes, &local, fit, temper);
        unknown.extend(variations.into_iter().map(|it| varies(base, it)));
        for (knob, evidence) in others(problem, ranking, &local, fit) {
            let narrower = narrowing(&local, &[&fit.freed[..], &[knob]].concat()) - here;
            unknown.push(upon(base, Unknown::Off(knob), evidence, narrower));
        }
        let size = misfit(problem, ranking, calibration, fit);
        unknown.push(upon(base, Unknown::Misfit(size), 0.0, 0.0));
        Self::normalised(known.into_iter().chain(unknown).collect())
    }

    /// That nothing is the matter.
    #[must_use]
    pub fn none(&self) -> f64 {
        self.sum(|it| it.is_of(&[]))
    }

    /// That the cause is not in the library.
    #[must_use]
    pub fn unknown(&self) -> f64 {
        self.sum(|it| it.unknown.is_some())
    }

    /// That an effect is among the causes.
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

/// What is no effect of the library, or may not be named, and the evidence of freeing it besides: as the slopes at the fit say.
fn others<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    local: &Linear,
    fit: &Fit,
) -> Vec<(usize, f64)> {
    let cost = |freed: &[usize]| {
        let precision = ranking.prior.freed(problem, freed);
        ranking.prior.step(local, &fit.x, &fit.gap, &precision).cost
    };
    let without = cost(&fit.freed);
    let companions = problem.with_companions(&fit.freed);
    let is_other = |&i: &usize| {
        let knob = &problem.knobs[i];
        knob.tolerance > 0.0 && !knob.is_candidate() && !knob.is_form() && !companions.contains(&i)
    };
    let freed = |i: usize| (i, without - cost(&[&fit.freed[..], &[i]].concat()));
    (0..problem.knobs.len()).filter(is_other).map(freed).collect()
}

/// Size of what a fit leaves beside the likeliest road, in units of what the model's form leaves: of each signal, and of what is
/// explained of it.
fn misfit<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    calibration: &Calibration,
    fit: &Fit,
) -> f64 {
    let weights = &ranking.linear.weights;
    let (rest, before) = (weights.rest(&fit.gap), weights.rest(&ranking.neutral));
    let squares: Vec<f64> = problem
        .blocks
        .iter()
        .zip(&ranking.noise.floor)
        .map(|((_, block), floor)| {
            let explained = calibration.misfit.share * rms(&before[block.clone()]);
            (rms(&rest[block.clone()]) / floor.hypot(explained)).powi(2)
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_add_up_and_what_is_negligible_is_dropped() {
        let of = |effects: &[usize], unknown, weight: f64| Hypothesis {
            effects: effects.to_vec(),
            unknown,
            evidence: 0.0,
            narrowing: 0.0,
            probability: weight,
        };
        let posterior = Posterior::normalised(vec![
            of(&[], None, 0.0),
            of(&[1], None, 3.0_f64.ln()),
            of(&[1, 2], None, 2.0_f64.ln()),
            of(&[1], Some(Unknown::Misfit(3.0)), 4.0_f64.ln()),
            of(&[3], None, -30.0),
        ]);
        assert_eq!(posterior.hypotheses.len(), 4);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(posterior.none(), 0.1) && near(posterior.unknown(), 0.4));
        assert!(near(posterior.inclusion(1), 0.5) && near(posterior.of_set(&[2, 1]), 0.2));
        assert_eq!(posterior.hypotheses[0].unknown, Some(Unknown::Misfit(3.0)));
    }
}
