//! A decision in the user's terms: effects with values, intervals and classes, and all candidates with the reasons for
//! which they are not named.

use super::beliefs::World;
use super::calibration::Calibration;
use super::constancy::Cause;
use super::dominance::dominance;
use super::estimate::{Wind, estimate, interval, wind_of};
use super::fit::Fit;
use super::observability::{collinearity, information};
use super::posterior::{Posterior, Unknown};
use super::problem::Problem;
use super::rank::Ranking;
use super::replay::ReplayVehicle;
use super::report::{Candidate, NamedEffect, Probabilities, ReportedHypothesis, Spread, VerdictKind};
use super::words;
use std::collections::BTreeMap;

/// Number of the first candidates that are compared with the winner.
const COMPARED: usize = 12;
/// Least probability of hypotheses and effects in the report.
const LEAST_SHOWN: f64 = 1e-5;

/// The effects of the winner, with their values.
pub(super) fn named<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    winner: &Fit,
    classes: &[Vec<usize>],
    covariance: &nalgebra::DMatrix<f64>,
    wider: f64,
) -> Vec<NamedEffect> {
    let mut effects = Vec::new();
    for (place, &i) in winner.free.iter().enumerate() {
        let it = &problem.uncertain[i];
        let Some(effect) = it.effect else { continue };
        let wind = wind_of(problem, winner, i);
        let (x, deviation) = estimate(problem, winner, covariance, i);
        let within = |value: f64| value.clamp(effect.range.0.min(it.value(it.named_least)), effect.range.1);
        let nothing = if wind.is_some() { 0.0 } else { ranking.prior.mean[i] };
        let [a, b] = interval(x, wider * deviation, nothing).map(|x| it.value(x));
        let total = within(it.value(x));
        // What has changed since the reference; neutral without one.
        let known = it.value(ranking.prior.mean[i]);
        let since = |value: f64| match effect.neutral {
            _ if it.stands_for_the_given() => value,
            1.0 => value / known,
            neutral => value - known + neutral,
        };
        let class = classes.get(place).cloned().unwrap_or_default();
        let mut class: Vec<String> = class.iter().map(|&i| problem.uncertain[i].id.to_owned()).collect();
        let mut separated_by = String::new();
        if it.id == "sensor_delay" && !problem.drive.commanded {
            // From the angle on, a later motion and a later sensor are the same.
            class.push("steer_delay".to_owned());
            separated_by = "log the steering command besides the angle".to_owned();
        }
        let of = |i: usize| (problem.uncertain[i].id.to_owned(), problem.uncertain[i].value(winner.x[i]));
        let components = problem.companion(i).map_or_else(BTreeMap::new, |(j, _)| [of(i), of(j)].into());
        let direction = wind.map(|Wind { to: (sin, cos), .. }| sin.atan2(cos));
        if direction.is_some() {
            class.push("wind_y".to_owned());
            separated_by = "log the heading, or the place".to_owned();
        }
        effects.push(NamedEffect {
            id: it.id.to_owned(),
            meaning: effect.meaning.to_owned(),
            value: since(total),
            low: since(within(a.min(b)).min(total)),
            high: since(within(a.max(b)).max(total)),
            unit: effect.unit.symbol.to_owned(),
            class,
            separated_by,
            stage: effect.stage,
            dominance: dominance(problem, ranking, winner, i),
            total,
            direction,
            components,
        });
    }
    effects
}

/// All that was fitted, the winner first.
pub(super) fn candidates<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    posterior: &Posterior,
    winner: &Fit,
    kind: VerdictKind,
    calibration: &Calibration,
) -> Vec<Candidate> {
    let mut all: Vec<Candidate> = ranking
        .singles
        .iter()
        .chain(&ranking.pairs)
        .chain(&ranking.triples)
        .map(|fit| {
            let evidence = ranking.none.cost - fit.cost;
            let pinned =
                fit.free.iter().any(|&i| information(problem, ranking, i) * 16.0 < calibration.telling());
            let probability = posterior.of_set(&fit.free);
            let shown = |i: usize| wind_of(problem, fit, i).map_or(fit.x[i], |wind| wind.speed);
            Candidate {
                effects: fit.free.iter().map(|&i| problem.uncertain[i].id.to_owned()).collect(),
                values: fit.free.iter().map(|&i| problem.uncertain[i].value(shown(i))).collect(),
                evidence,
                collinearity: None,
                probability,
                why: words::why(
                    evidence,
                    calibration.telling() * fit.free.len() as f64,
                    probability,
                    pinned,
                    fit.free == winner.free && kind == VerdictKind::Effect,
                ),
            }
        })
        .collect();
    // The winner stands first, even before a pair that explains a little more.
    let name: Vec<String> = winner.free.iter().map(|&i| problem.uncertain[i].id.to_owned()).collect();
    all.sort_by(|a, b| {
        (a.effects != name)
            .cmp(&(b.effects != name))
            .then(b.evidence.total_cmp(&a.evidence))
            .then(a.effects.cmp(&b.effects))
    });
    if kind == VerdictKind::Effect {
        for candidate in all.iter_mut().take(COMPARED) {
            candidate.collinearity = likeness(problem, ranking, &winner.free, &candidate.effects);
            candidate.why += &words::likeness(candidate.collinearity);
        }
    }
    all
}

/// Likeness of a candidate to the winner where they differ in one effect.
fn likeness<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    winner: &[usize],
    candidate: &[String],
) -> Option<f64> {
    let own: Vec<usize> = candidate.iter().filter_map(|id| problem.find(id)).collect();
    let (both, others): (Vec<usize>, Vec<usize>) = own.iter().partition(|&i| winner.contains(i));
    let [other] = others[..] else { return None };
    let mut lost = winner.iter().filter(|i| !both.contains(i));
    let (Some(&named), None) = (lost.next(), lost.next()) else { return None };
    Some(collinearity(problem, ranking, &both, [named, other]))
}

/// The posterior in the user's terms.
pub(super) fn summary<V: ReplayVehicle>(problem: &Problem<V>, posterior: &Posterior) -> Probabilities {
    let id = |&i: &usize| problem.uncertain[i].id.to_owned();
    let said = |unknown: &Unknown| match unknown {
        Unknown::Varies(it) => {
            format!("{} changes {}", problem.uncertain[it.effect].id, Cause::words(it.with))
        }
        Unknown::Swings => "the steering swings".to_owned(),
        Unknown::Off { uncertain, .. } => format!("{} is off", problem.uncertain[*uncertain].parameter()),
        Unknown::Misfit(size, channel) => {
            let most = channel.name();
            format!("{size:.1} times as much is left as a model of this form leaves, most of it in {most}")
        }
    };
    let hypothesis = |it: &super::posterior::Hypothesis| ReportedHypothesis {
        effects: it.effects.iter().map(id).collect(),
        not_in_library: it.unknown.as_ref().map(said),
        terms: it.terms.clone(),
        probability: it.probability,
    };
    let may_be = (0..problem.uncertain.len()).filter(|&i| problem.uncertain[i].is_candidate());
    let inclusion = may_be.map(|i| (id(&i), posterior.inclusion(i))).filter(|(_, it)| *it >= LEAST_SHOWN);
    Probabilities {
        none: posterior.none(),
        not_in_library: posterior.unknown(),
        tolerances: posterior
            .worlds
            .iter()
            .map(|&(World { factor, .. }, probability)| Spread { factor, probability })
            .collect(),
        inclusion: inclusion.collect(),
        hypotheses: posterior
            .hypotheses
            .iter()
            .filter(|it| it.probability >= LEAST_SHOWN)
            .map(hypothesis)
            .collect(),
    }
}
