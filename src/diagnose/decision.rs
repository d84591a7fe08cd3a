//! From a ranking to what is the matter: which candidate is named, whether nothing is, or whether the cause is none of the library.
//!
//! `J` is a candidate's cost (`rank.rs`). An effect is named where `J_none - J` is more than it needs, a further one where it adds
//! as much to the effects so far, beyond an error of what these do (`echo.rs`). None of the library is the cause where what is
//! named leaves much (`noise.rs`), needs a value that varies (`constancy.rs`) or strains what is not named.

use super::calibration::Calibration;
use super::constancy::{self, Variation};
use super::echo::Echo;
use super::estimate::{estimate, half_width};
use super::fit::{Fit, Linear};
use super::mass;
use super::problem::Problem;
use super::rank::Ranking;
use super::replay::ReplayVehicle;
use super::report::{Scores, VerdictKind};
use nalgebra::DVector;
use std::cell::LazyCell;

/// Evidence from which on something is the matter, however small its gap, and an effect is not too small to be named.
const PLAIN: f64 = 100.0;

/// What is the matter.
pub(super) struct Decision {
    pub kind: VerdictKind,
    pub probability: f64,
    /// The winner; with nothing freed where nothing is named.
    pub fit: Fit,
    /// What of the library comes nearest where the cause is not in it.
    pub nearest: Option<Fit>,
    /// How it varies, if that is what gives it away.
    pub varying: Option<Variation>,
    /// What is not named and yet far off, if that is what gives it away.
    pub strained: Option<usize>,
    /// The next candidate, for the next manoeuvre.
    pub rival: Option<Fit>,
    /// Candidates of one class with each effect of the winner.
    pub classes: Vec<Vec<usize>>,
    /// What it was made from.
    pub scores: Scores,
}

/// The scores of a ranking, before anything is decided: without a margin.
fn scores<V: ReplayVehicle>(problem: &Problem<V>, ranking: &Ranking) -> Scores {
    let best = ranking.singles.first();
    let single = best.map_or(0.0, |best| ranking.none.cost - best.cost);
    let pair = match (best, ranking.pairs.first()) {
        (Some(best), Some(pair)) => best.cost - pair.cost,
        _ => 0.0,
    };
    let gap = ranking.pairs.first().filter(|_| pair > 0.0).or(best).map_or(&ranking.none.gap, |fit| &fit.gap);
    Scores {
        single,
        pair,
        excess: ranking.noise.excess(problem, &ranking.linear.weights.rest(gap)),
        left: ranking.noise.remaining(problem, &ranking.neutral, &ranking.linear.weights.rest(gap)),
        varying: 0.0,
        strained: 0.0,
        unsure: 0.0,
        margin: 0.0,
    }
}

/// Whether a single effect explains as much more than nothing as it needs to be named.
pub(super) fn tells<V: ReplayVehicle>(
    problem: &Problem<V>,
    calibration: &Calibration,
    none: &Fit,
    single: &Fit,
) -> bool {
    none.cost - single.cost > calibration.threshold(problem.knobs[single.freed[0]].effect)
}

/// The effect that is not named and yet most off, and by how many tolerances; what goes with a named one, as its place with a load,
/// counts by its own deviation.
fn strained<V: ReplayVehicle>(problem: &Problem<V>, ranking: &Ranking, fit: &Fit) -> Option<(usize, f64)> {
    let off = ranking.prior.off(&fit.x);
    let companions: Vec<(usize, f64)> = fit.freed.iter().filter_map(|&i| problem.companion(i)).collect();
    let tolerance = |i: usize| {
        let freed = companions.iter().find(|(companion, _)| *companion == i);
        freed.map_or(problem.knobs[i].tolerance, |(_, deviation)| *deviation)
    };
    let is_background =
        |&i: &usize| problem.knobs[i].effect.is_some() && tolerance(i) > 0.0 && !fit.freed.contains(&i);
    let all = (0..problem.knobs.len()).filter(is_background);
    // Less sure than by tolerance is what a reference log has not shown well.
    let expected = |i: usize| tolerance(i).max(ranking.prior.covariance[(i, i)].sqrt());
    all.map(|i| (i, off[i].abs() / expected(i))).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// How unsure the least sure value of a fit is: half of its interval over that and how far it is off. From a half on the interval
/// holds no effect at all.
fn unsure<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    slopes: &Linear,
    fit: &Fit,
    wider: f64,
) -> f64 {
    let covariance = slopes.covariance(&ranking.prior.freed(problem, &fit.freed));
    let of_each = fit.freed.iter().map(|&i| {
        let (x, deviation) = estimate(problem, fit, &covariance, i);
        let (half, off) = (half_width(wider, deviation), (x - ranking.prior.mean[i]).abs());
        half / (half + off).max(f64::MIN_POSITIVE)
    });
    of_each.fold(0.0, f64::max)
}

/// Evidence that a value is not one, and what of the library comes nearest then.
struct Varying {
    fit: Fit,
    variation: Variation,
    evidence: f64,
}

/// What gives most evidence of a value that varies: one of the effects to be named, beside the others; or a single effect
/// that then explains more than all that are to be named.
fn varying<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    chosen: Option<(&Fit, &Linear)>,
    causes: &[constancy::Columns],
) -> Option<Varying> {
    if causes.is_empty() {
        return None;
    }
    let explained = ranking.none.cost - chosen.map_or(ranking.none.cost, |(fit, _)| fit.cost);
    let single = constancy::best_single(problem, ranking, causes).map(|(place, variation)| {
        let fit = ranking.singles[place].clone();
        let more = variation.gain + ranking.none.cost - fit.cost - explained;
        Varying { fit, variation, evidence: variation.gain.min(more) }
    });
    let own = chosen.and_then(|(fit, slopes)| {
        let all = constancy::variations(problem, ranking, causes, slopes, fit);
        let best = all.into_iter().max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        Some(Varying { fit: fit.clone(), variation: best, evidence: best.gain })
    });
    single.into_iter().chain(own).max_by(|a, b| a.evidence.total_cmp(&b.evidence))
}

/// What is to be named. An effect too small to matter is not: what explains a little of the model's form hides no cause.
/// With no `causes` for values to vary with, all are taken to be constant.
pub(super) fn decide<'a, V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &'a Ranking,
    calibration: &Calibration,
    causes: &[constancy::Columns],
) -> Decision {
    let mut scores = scores(problem, ranking);
    let notable = ranking.noise.notable(problem, &ranking.neutral);
    let worth = calibration.form_is_known || scores.single > PLAIN || notable;
    let needed = |i: usize| calibration.threshold(problem.knobs[i].effect);
    let evidence = |fit: &Fit| ranking.none.cost - fit.cost;
    // What adds evidence beyond question is never too small: without it a replay may lose its vehicle, and the gap of that
    // background is anything.
    let matters = |fit: &Fit, others: &Fit| {
        let plain = others.cost - fit.cost > PLAIN;
        let local = LazyCell::new(|| ranking.linear_at(problem, fit));
        fit.freed.iter().all(|i| {
            plain && !others.freed.contains(i)
                || dominance(problem, ranking, fit, *i) > calibration.dominance
                || dominance_by_slopes(problem, ranking, &local, fit, *i) > calibration.dominance
        })
    };
    // What takes the simulator farther from the log is not what parts them: its tolerances would have to undo what it does,
    // and what is explained is an error of the form.
    let gap_by = |fit: &Fit| {
        let alone = ranking.prior.only(problem, &fit.freed, &fit.x);
        problem.residual(&alone).map_or([f64::INFINITY; 2], |gap| ranking.noise.sizes(problem, &gap))
    };
    let nears = |fit: &Fit, others: &Fit| {
        let mut both = gap_by(fit).into_iter().zip(gap_by(others));
        both.any(|(gap, before)| gap <= calibration.farthest * before)
    };
    // What was passed over, and is then too far off for a tolerance, is in the library all the same: named, it strains nothing.
    let off = |fit: &Fit| strained(problem, ranking, fit).filter(|(_, by)| *by > calibration.strained);
    let relieves = |fit: &Fit, others: &Fit| {
        off(others).is_some_and(|(i, _)| fit.freed.contains(&i) && off(fit).is_none())
    };
    // Where what explains most is too small to matter, only what explains as much may stand in for it.
    // With what it adds to the others.
    let first = |fits: &'a [Fit], others: &Fit, adds: &dyn Fn(&Fit) -> Option<f64>| {
        let may_be = |fit: &Fit| matters(fit, others) && nears(fit, others) || relieves(fit, others);
        let mut rest = fits.iter();
        let most = rest.by_ref().find_map(|fit| Some((fit, adds(fit)?)))?;
        let near = rest.take_while(|fit| fit.cost < most.0.cost + calibration.class);
        let behind = near.filter_map(|fit| Some((fit, adds(fit)?)));
        std::iter::once(most).chain(behind).find(|(fit, _)| may_be(fit))
    };
    let tells = |fit: &Fit| worth && tells(problem, calibration, &ranking.none, fit);
    let mut chosen = first(&ranking.singles, &ranking.none, &|fit| tells(fit).then(|| evidence(fit)));
    // What explains most may be too small beside another cause that it leaves to the background: then two are named, or none.
    let mut known = chosen.map(|(fit, _)| fit).or_else(|| ranking.singles.first().filter(|fit| tells(fit)));
    // A further effect has to add what is asked of it, and not as an error of what others do; candidates without the best of one
    // effect less, what is asked of most.
    for more in [ranking.of(2), ranking.of(3)] {
        let Some(so_far) = known else { break };
        let echo = LazyCell::new(|| Echo::of(problem, ranking, causes, so_far));
        let adds = |fit: &Fit| {
            let others = fit.freed.iter().filter(|i| !so_far.freed.contains(i));
            let asked = |&i: &usize| calibration.further(problem.knobs[i].effect, so_far.freed.len());
            let least = others.map(asked).fold(0.0, f64::max);
            let added = so_far.cost - fit.cost;
            let beyond = if added > least { echo.evidence(problem, ranking, fit) } else { 0.0 };
            (beyond > least).then_some(beyond.min(added))
        };
        let Some(more) = first(more, so_far, &adds) else { break };
        (known, chosen) = (Some(more.0), Some(more));
    }
    let (chosen, added) = chosen.unzip();
    let slopes = chosen.map(|fit| ranking.linear_at(problem, fit));
    // Not in the library: much is left that is neither noise nor form; or the value that it needs is not one; or it is
    // something that may not be named, or is one thing too many.
    let varying = varying(problem, ranking, chosen.zip(slopes.as_ref()), causes);
    scores.varying = varying.as_ref().map_or(0.0, |it| it.evidence);
    let rest = scores.excess / calibration.outside - 1.0;
    let rest = if scores.left > calibration.left { rest } else { -1.0 };
    let varies = scores.varying / calibration.varying - 1.0;
    let strained = strained(problem, ranking, chosen.unwrap_or(&ranking.none));
    scores.strained = strained.map_or(0.0, |(_, tolerances)| tolerances);
    let strains = scores.strained / calibration.strained - 1.0;
    let unnamed = |kind, probability, margin| Decision {
        kind,
        probability,
        fit: ranking.none.clone(),
        nearest: None,
        varying: None,
        strained: None,
        rival: None,
        classes: Vec::new(),
        scores: Scores { margin, ..scores },
    };
    if rest.max(varies).max(strains) > 0.0 {
        let margin = 10.0 * rest.max(varies).max(strains);
        let varying = varying.filter(|_| varies > 0.0);
        let strained = strained.filter(|_| strains > varies.max(0.0)).map(|(effect, _)| effect);
        let nearest = chosen.or(varying.as_ref().map(|it| &it.fit)).cloned();
        return Decision {
            nearest,
            varying: varying.map(|it| it.variation),
            strained,
            ..unnamed(VerdictKind::NotInLibrary, calibration.of_unknown(margin), margin)
        };
    }
    let Some((chosen, slopes)) = chosen.zip(slopes) else {
        let most = ranking.singles.iter().map(|fit| evidence(fit) / needed(fit.freed[0])).fold(0.0, f64::max);
        let margin = calibration.none * (1.0 - most).max(0.0);
        return unnamed(VerdictKind::None, calibration.of_nothing(margin), margin);
    };
    // What a mass explains better is no gain of the drive, nor the other way round; what it explains as well may be one.
    let mass = mass::instead(problem, ranking, chosen);
    let ahead = mass.as_ref().map_or(f64::NEG_INFINITY, |(_, fit)| chosen.cost - fit.cost);
    if let Some((i, fit)) = mass.filter(|_| ahead > calibration.class) {
        return Decision {
            nearest: Some(fit),
            strained: Some(i),
            ..unnamed(VerdictKind::NotInLibrary, calibration.of_unknown(ahead - calibration.class), ahead)
        };
    }
    // Alternatives to each effect beside the others.
    let level = ranking.of(chosen.freed.len());
    let class_of = |own: usize| -> Vec<usize> {
        let others = |fit: &&Fit| chosen.freed.iter().all(|i| *i == own || fit.freed.contains(i));
        let near = |fit: &&Fit| (fit.cost - chosen.cost).abs() < calibration.class;
        let rivals = level.iter().filter(others).filter(near).flat_map(|fit| fit.freed.iter().copied());
        let mut class: Vec<usize> =
            rivals.filter(|i| !chosen.freed.contains(i)).chain(std::iter::once(own)).collect();
        class.sort_unstable();
        class.dedup();
        class
    };
    let classes: Vec<Vec<usize>> = chosen.freed.iter().map(|&own| class_of(own)).collect();
    let inside = |fit: &Fit| fit.freed.iter().all(|i| classes.iter().flatten().any(|j| j == i));
    let outside = level
        .iter()
        .find(|rival| rival.cost > chosen.cost && !inside(rival))
        .map_or(f64::INFINITY, |rival| rival.cost - chosen.cost);
    let margin = outside.min(added.unwrap_or(0.0)).min((-ahead).max(0.0));
    let scores =
        Scores { margin, unsure: unsure(problem, ranking, &slopes, chosen, calibration.interval), ..scores };
    Decision {
        kind: VerdictKind::Effect,
        probability: calibration.of_effect(&scores, chosen.freed.len()),
        fit: chosen.clone(),
        nearest: None,
        varying: None,
        strained: None,
        rival: level.iter().find(|rival| rival.freed != chosen.freed).cloned(),
        classes,
        scores,
    }
}

/// What an effect does to the motion, over what the background does: the tolerances without any of the effects.
pub(super) fn dominance<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    at: &Fit,
    effect: usize,
) -> f64 {
    let without = |effects: &[usize]| problem.residual(&ranking.prior.without(problem, effects, &at.x));
    let (Some(gap), Some(background)) = (without(&[effect]), without(&at.freed)) else {
        return f64::INFINITY;
    };
    ratio(distance(ranking, &gap, &at.gap), distance(ranking, &background, &ranking.neutral))
}

/// The same by `slopes` at the fit: without what keeps it a replay may lose its vehicle, and is then no measure of anything.
fn dominance_by_slopes<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    slopes: &Linear,
    at: &Fit,
    effect: usize,
) -> f64 {
    let off = ranking.prior.off(&at.x);
    let (own, all) = (problem.with_companions(&[effect]), problem.with_companions(&at.freed));
    let does = |counts: &dyn Fn(usize) -> bool| {
        let change = off.iter().enumerate().map(|(i, off)| if counts(i) { *off } else { 0.0 });
        slopes.square_of(&DVector::from_iterator(off.len(), change)).sqrt()
    };
    ratio(does(&|i| own.contains(&i)), does(&|i| !all.contains(&i)))
}

fn distance(ranking: &Ranking, a: &[f64], b: &[f64]) -> f64 {
    let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    ranking.linear.square(&apart).sqrt()
}

fn ratio(own: f64, background: f64) -> f64 {
    own / background.max(0.05 * own).max(1e-9)
}
