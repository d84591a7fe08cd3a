//! From a log and a vehicle to the answer.

use super::calibration::Calibration;
use super::constancy::{self, Variation};
use super::echo::Echo;
use super::fit::{Fit, Linear, Prior};
use super::localise;
use super::manoeuvre;
use super::mass;
use super::observability::{Excitation, collinearity, information, observability};
use super::problem::Problem;
use super::rank::{NoReplay, Ranking, rank};
use super::replay::{Drive, ReplayVehicle, Trace, is_levelled, neutral, prepared};
use super::report::{
    Adjustment, Candidate, Diagnosis, Finding, Gravity, InputFile, Inputs, NamedEffect, Report, Scores,
    Series, Varies, Verdict, VerdictKind,
};
use super::select::chosen;
use super::shrink::{only, recalibrated, shrink};
use super::words;
use crate::log::CleanLog;
use crate::residual::parallel;
use std::cell::LazyCell;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Shortest drive that is diagnosed, s of compared rows.
const SHORTEST: f64 = 6.0;
/// Share of its tolerance that a vehicle may change from log to log without anything being the matter.
const DRIFT: f64 = 0.2;
/// What is of the day and the road, not of the vehicle: it may change by its whole tolerance.
const ENVIRONMENT: [&str; 4] = ["wind_x", "wind_y", "road_bank", "road_grade"];
/// Tolerances of a vehicle in its reference log, besides what is named there: as many times the ordinary ones.
const WIDE: f64 = 2.0;
/// Evidence from which on something is the matter, however small its gap, and an effect is not too small to be named.
const PLAIN: f64 = 100.0;
/// So many of the first candidates are compared with the winner.
const COMPARED: usize = 12;
/// Steering that is no steering: deviation in rad.
const STRAIGHT: f64 = 1e-3;

/// What can be chosen.
#[derive(Debug, Clone)]
pub struct Options {
    /// Seed of everything random (recorded; the engine itself draws nothing).
    pub seed: u64,
    /// Threads; 0: all there are. The answer does not depend on it.
    pub threads: usize,
    /// Whether pairs of effects are looked for.
    pub pairs: bool,
    /// Effects that are left out of the library, for negative controls; within their tolerances they stay.
    pub without: Vec<String>,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 1, threads: 0, pairs: true, without: Vec::new() }
    }
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum DiagnoseError {
    #[error("the log has no {column}; a diagnosis needs time, steer_cmd (or steer), vx and yaw_rate")]
    Missing { column: &'static str },
    #[error("column {column} has {rows} rows and the clock {expected}; give a cleaned log")]
    Length { column: &'static str, rows: usize, expected: usize },
    #[error("column {column} holds {value} at {time} s: not a finite number; give a cleaned log")]
    NotFinite { column: &'static str, value: f64, time: f64 },
    #[error("the sample time is {step} s; it must be more than 0 and at most 0.2 s (5 Hz)")]
    Clock { step: f64 },
    #[error("there is no effect '{id}' to leave out")]
    UnknownEffect { id: String },
    #[error("the vehicle cannot be replayed: {reason}")]
    Replay { reason: String },
    #[error(transparent)]
    NoReplay(#[from] NoReplay),
}

fn check(log: &CleanLog) -> Result<(), DiagnoseError> {
    if !(log.step > 0.0 && log.step <= 0.2) {
        return Err(DiagnoseError::Clock { step: log.step });
    }
    for column in ["steer_cmd", "vx", "yaw_rate"] {
        if !log.columns.contains_key(column) {
            return Err(DiagnoseError::Missing { column });
        }
    }
    for (&column, values) in &log.columns {
        if values.len() != log.time.len() {
            return Err(DiagnoseError::Length { column, rows: values.len(), expected: log.time.len() });
        }
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            return Err(DiagnoseError::NotFinite { column, value: values[row], time: log.time[row] });
        }
    }
    Ok(())
}

/// Diagnoses a log; with a `reference`, a log of the same vehicle when it was as modelled, what has changed since.
///
/// # Errors
/// A log that is not clean, a vehicle that cannot be replayed.
pub fn diagnose<V: ReplayVehicle>(
    log: &CleanLog,
    reference: Option<&CleanLog>,
    vehicle: &V,
    options: &Options,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    check(log)?;
    for id in &options.without {
        if !crate::vehicle::TruckEffects::all().any(|effect| effect.id == id) {
            return Err(DiagnoseError::UnknownEffect { id: id.clone() });
        }
    }
    let threads = parallel::threads(options.threads);
    let calibration = Calibration::of(V::TRUCK, reference.is_some());
    let mut findings = log.findings.clone();
    let (log, left_out) = chosen(log);
    findings.extend(left_out);
    let mut drive = Drive::new(&log, V::TRUCK);
    let prepared_vehicle = prepared(vehicle, drive.commanded);
    let excitation = Excitation::of(&drive, vehicle);
    let mut inputs = Inputs {
        vehicle: vehicle.name().to_owned(),
        signals: drive.channels.iter().map(|channel| channel.name().to_owned()).collect(),
        duration: drive.duration(),
        rate: 1.0 / log.step,
        ..Inputs::default()
    };
    inputs.files.insert(
        "calibration".to_owned(),
        InputFile { file: "calibration.toml".to_owned(), hash: Calibration::hash() },
    );
    let blank = |reason: &str, findings: Vec<Finding>, inputs: Inputs| Diagnosis {
        report: Report {
            verdict: Verdict {
                kind: VerdictKind::CannotTell,
                probability: 1.0,
                effects: Vec::new(),
                nearest: Vec::new(),
                varying: None,
                strained: None,
                words: reason.to_owned(),
            },
            candidates: Vec::new(),
            shrink: super::Shrink::default(),
            places: Vec::new(),
            stage: None,
            observability: Vec::new(),
            next_manoeuvre: None,
            recalibration: Vec::new(),
            scores: None,
            findings,
            inputs,
            seed: options.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        },
        series: Series::default(),
    };
    if drive.duration() < SHORTEST {
        let words = format!(
            "This log cannot tell: only {:.1} s of it are driven faster than 2 m/s without gaps. Give a longer drive \
             (half a minute or more, turns to both sides, several speeds).",
            drive.duration()
        );
        return Ok(blank(&words, findings, inputs));
    }
    progress("full plant", 0.02);
    let correction = neutral(&drive, &prepared_vehicle).map_err(|reason| DiagnoseError::Replay { reason })?;
    drive.levelled = is_levelled(&drive, &prepared_vehicle, &correction);
    if drive.levelled {
        findings.push(Finding {
            gravity: Gravity::Note,
            signal: Some("ay".to_owned()),
            words: "it is that of a level frame, without gravity's share by roll, and is compared so"
                .to_owned(),
        });
    }
    let without = &options.without;
    let problem = Problem::new(&drive, &prepared_vehicle, &correction, without, threads);
    let mut prior = Prior::of(&problem);
    for knob in problem.knobs.iter().filter(|knob| knob.tolerance > 0.0) {
        inputs.tolerances.insert(knob.parameter(), knob.deviation(knob.tolerance, vehicle));
    }
    if let Some(reference) = reference {
        check(reference)?;
        let (reference, _) = chosen(reference);
        let alone = Calibration::of(V::TRUCK, false);
        posterior(&reference, &problem, &prepared_vehicle, without, &alone, &mut prior)?;
    }
    let ranking = rank(&problem, prior, &|_, _| options.pairs, progress)?;
    progress("constancy", 0.91);
    let mut decision = decide(&problem, &ranking, &calibration, &constancy::causes(&problem));
    let suspicion = findings.iter().any(|finding| finding.gravity == Gravity::Suspicion);
    if excitation.steer < STRAIGHT && decision.kind != VerdictKind::None || suspicion {
        (decision.kind, decision.varying, decision.strained) = (VerdictKind::CannotTell, None, None);
    } else if let Some(nearest) = decision.nearest.take() {
        // No cause, but the simulator is nearer with it.
        decision.fit = nearest;
    }

    progress("held-out parts", 0.92);
    let winner = decision.fit.clone();
    let slopes = slopes_at(&problem, &ranking, &winner);
    let local = Linear::new(slopes.clone(), ranking.linear.weights.clone());
    let shrink = shrink(&problem, &ranking, &winner, &slopes);
    let precision = ranking.prior.freed(&problem, &winner.freed);
    let covariance = local.covariance(&precision);
    let simulator = recalibrated(&problem, &ranking.prior, &local, &winner.freed, &winner.x);
    let mut effects = named(&problem, &ranking, &decision, &covariance, calibration.interval);
    progress("next manoeuvre", 0.95);
    let next_manoeuvre = match &decision.rival {
        Some(rival) if decision.kind == VerdictKind::Effect && reference.is_none() => {
            let others: Vec<&Fit> = ranking.fewer(&winner).chain([rival]).collect();
            manoeuvre::next(&problem, &ranking, &winner, &others, without)
        }
        _ => None,
    };
    let adjustment = |i: usize, x: &[f64]| {
        let it = &problem.knobs[i];
        let (given, value) = it.adjusted(x[i], vehicle);
        Adjustment {
            parameter: it.parameter(),
            given,
            value,
            tolerance: it.deviation(it.tolerance, vehicle),
            deviation: it.deviation(covariance[(i, i)].max(0.0).sqrt(), vehicle),
            unit: it.symbol::<V>(),
        }
    };
    let freed = problem.with_companions(&winner.freed);
    let recalibration = (0..problem.knobs.len())
        .filter(|&i| {
            let it = &problem.knobs[i];
            precision.free.contains(&i) && !freed.contains(&i) && it.tolerance > 0.0 && !it.is_form()
        })
        .map(|i| adjustment(i, &simulator))
        .collect();
    let strained = decision.strained.map(|i| adjustment(i, &winner.x));
    let series = series(&problem, &ranking.prior, &drive, &winner, &simulator)?;
    // What matters most stands first.
    effects.sort_by(|a, b| b.dominance.total_cmp(&a.dominance));
    for effect in &mut effects {
        if let Some(next) =
            next_manoeuvre.as_ref().filter(|_| effect.class.len() > 1 && effect.separated_by.is_empty())
        {
            effect.separated_by = format!("{}: {}", next.name, next.how);
        }
    }
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.gravity));
    let varying = decision.varying.map(|it| {
        let knob = &problem.knobs[it.effect];
        Varies {
            id: knob.id.to_owned(),
            with: it.with,
            deviation: knob.deviation(it.deviation, vehicle),
            unit: knob.symbol::<V>(),
            evidence: it.gain,
        }
    });
    let why = words::Unknown { varying: varying.as_ref(), strained: strained.as_ref() };
    let words = words::verdict(decision.kind, &effects, why, &shrink, decision.probability, &findings);
    let (effects, nearest) = match decision.kind {
        VerdictKind::Effect => (effects, Vec::new()),
        VerdictKind::NotInLibrary => (Vec::new(), effects),
        VerdictKind::None | VerdictKind::CannotTell => (Vec::new(), Vec::new()),
    };
    let stage = effects.first().map(|effect| effect.stage);
    let report = Report {
        verdict: Verdict {
            kind: decision.kind,
            probability: decision.probability,
            effects,
            nearest,
            varying,
            strained,
            words,
        },
        candidates: candidates(&problem, &ranking, &decision, &calibration),
        places: localise::places(&problem, &ranking),
        stage,
        observability: observability(&problem, &ranking, &calibration),
        next_manoeuvre,
        recalibration,
        scores: Some(decision.scores),
        findings,
        inputs,
        shrink,
        seed: options.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    progress("done", 1.0);
    Ok(Diagnosis { report, series })
}

/// What a log of the same vehicle says of it: whatever was the matter then belongs to the vehicle as it is known.
fn posterior<V: ReplayVehicle>(
    log: &CleanLog,
    problem: &Problem<V>,
    vehicle: &V,
    without: &[String],
    calibration: &Calibration,
    prior: &mut Prior,
) -> Result<(), DiagnoseError> {
    let drive = Drive { levelled: problem.drive.levelled, ..Drive::new(log, V::TRUCK) };
    if drive.duration() < SHORTEST || drive.commanded != problem.drive.commanded {
        return Ok(());
    }
    let correction = neutral(&drive, vehicle).map_err(|reason| DiagnoseError::Replay { reason })?;
    let own = Problem::new(&drive, vehicle, &correction, without, problem.threads());
    let mut wide = Prior::of(&own);
    let drifts = &prior.covariance * DRIFT.powi(2);
    wide.covariance *= WIDE * WIDE;
    // Where nothing is named, no two are.
    let pairs =
        |none: &Fit, singles: &[Fit]| singles.iter().any(|single| tells(&own, calibration, none, single));
    let ranking = rank(&own, wide, &pairs, &|_, _| {})?;
    let decision = decide(&own, &ranking, calibration, &[]);
    let known = &decision.fit;
    let local = Linear::new(slopes_at(&own, &ranking, known), ranking.linear.weights.clone());
    let covariance = local.covariance(&ranking.prior.freed(&own, &known.freed));
    prior.form = ranking.noise.beyond(&own, &known.gap);
    // A wind by another log's own start is none by this one's.
    let is_shown = |id: &str| (own.drive.compass && problem.drive.compass) || !id.starts_with("wind_");
    let there: Vec<Option<usize>> =
        problem.knobs.iter().map(|knob| own.find(knob.id).filter(|_| is_shown(knob.id))).collect();
    for (i, knob) in problem.knobs.iter().enumerate() {
        for (j, &b) in there.iter().enumerate() {
            // What the reference cannot show stays as it was, and is off together with nothing that it has shown.
            prior.covariance[(i, j)] = match (there[i], b) {
                (Some(a), Some(b)) => covariance[(a, b)] + drifts[(i, j)],
                _ if i == j => prior.covariance[(i, i)],
                _ => drifts[(i, j)],
            };
        }
        if let Some(a) = there[i] {
            prior.mean[i] = known.x[a];
            if ENVIRONMENT.contains(&knob.id) {
                prior.covariance[(i, i)] += knob.tolerance.powi(2);
            }
        }
    }
    Ok(())
}

/// Slopes of all knobs at a fitted point, taken anew.
fn slopes_at<V: ReplayVehicle>(problem: &Problem<V>, ranking: &Ranking, at: &Fit) -> Vec<Arc<Vec<f64>>> {
    if at.freed.is_empty() { ranking.linear.slopes.clone() } else { problem.slopes(&at.x, &at.gap) }
}

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
        excess: ranking.noise.excess(problem, gap),
        left: ranking.noise.remaining(problem, &ranking.neutral, gap),
        varying: 0.0,
        strained: 0.0,
        margin: 0.0,
    }
}

/// Whether a single effect explains as much more than nothing as it needs to be named.
fn tells<V: ReplayVehicle>(
    problem: &Problem<V>,
    calibration: &Calibration,
    none: &Fit,
    single: &Fit,
) -> bool {
    none.cost - single.cost > calibration.threshold(problem.knobs[single.freed[0]].effect)
}

/// The effect that is not named and yet most off, and by how many tolerances.
fn strained<V: ReplayVehicle>(problem: &Problem<V>, ranking: &Ranking, fit: &Fit) -> Option<(usize, f64)> {
    let off = ranking.prior.off(&fit.x);
    let freed = problem.with_companions(&fit.freed);
    let is_background = |&i: &usize| {
        let knob = &problem.knobs[i];
        knob.effect.is_some() && knob.tolerance > 0.0 && !freed.contains(&i)
    };
    let all = (0..problem.knobs.len()).filter(is_background);
    // Less sure than by tolerance is what a reference log has not shown well.
    let expected = |i: usize| problem.knobs[i].tolerance.max(ranking.prior.covariance[(i, i)].sqrt());
    all.map(|i| (i, off[i].abs() / expected(i))).max_by(|a, b| a.1.total_cmp(&b.1))
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
    chosen: Option<&Fit>,
    causes: &[constancy::Columns],
) -> Option<Varying> {
    if causes.is_empty() {
        return None;
    }
    let explained = ranking.none.cost - chosen.map_or(ranking.none.cost, |fit| fit.cost);
    let single = constancy::best_single(problem, ranking, causes).map(|(place, variation)| {
        let fit = ranking.singles[place].clone();
        let more = variation.gain + ranking.none.cost - fit.cost - explained;
        Varying { fit, variation, evidence: variation.gain.min(more) }
    });
    let own = chosen.and_then(|fit| {
        let local = Linear::new(slopes_at(problem, ranking, fit), ranking.linear.weights.clone());
        let all = constancy::variations(problem, ranking, causes, &local, fit);
        let best = all.into_iter().max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        Some(Varying { fit: fit.clone(), variation: best, evidence: best.gain })
    });
    single.into_iter().chain(own).max_by(|a, b| a.evidence.total_cmp(&b.evidence))
}

/// What is to be named. An effect too small to matter is not: what explains a little of the model's form hides no cause.
/// With no `causes` for values to vary with, all are taken to be constant.
fn decide<'a, V: ReplayVehicle>(
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
        fit.freed.iter().all(|i| {
            plain && !others.freed.contains(i) || dominance(problem, ranking, fit, *i) > calibration.dominance
        })
    };
    // What takes the simulator farther from the log is not what parts them: its tolerances would have to undo what it does,
    // and what is explained is an error of the form.
    let gap_by = |fit: &Fit| {
        let alone = only(problem, &ranking.prior, &fit.freed, &fit.x);
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
    let first = |fits: &'a [Fit], others: &Fit, tells: &dyn Fn(&Fit) -> bool| -> Option<&'a Fit> {
        let most = fits.iter().find(|fit| tells(fit))?.cost;
        let may_be = |fit: &Fit| matters(fit, others) && nears(fit, others) || relieves(fit, others);
        fits.iter()
            .take_while(|fit| fit.cost < most + calibration.class)
            .find(|fit| tells(fit) && may_be(fit))
    };
    let tells = |fit: &Fit| worth && tells(problem, calibration, &ranking.none, fit);
    let best = first(&ranking.singles, &ranking.none, &tells);
    // A further effect has to add what is asked of it, and not as an error of what others do; candidates without the best of one
    // effect less, what is asked of most.
    let (mut chosen, mut added) = (best, best.map_or(0.0, evidence));
    for more in [ranking.of(2), ranking.of(3)] {
        let Some(so_far) = chosen else { break };
        let echo = LazyCell::new(|| Echo::of(problem, ranking, causes, so_far));
        let beyond = |fit: &Fit| echo.evidence(problem, ranking, fit);
        let adds = |fit: &Fit| {
            let others = fit.freed.iter().filter(|i| !so_far.freed.contains(i));
            let asked = |&i: &usize| calibration.further(problem.knobs[i].effect, so_far.freed.len());
            let least = others.map(asked).fold(0.0, f64::max);
            so_far.cost - fit.cost > least && beyond(fit) > least
        };
        let Some(fit) = first(more, so_far, &adds) else { break };
        (added, chosen) = (beyond(fit).min(so_far.cost - fit.cost), Some(fit));
    }
    // Not in the library: much is left that is neither noise nor form; or the value that it needs is not one; or it is
    // something that may not be named, or is one thing too many.
    let varying = varying(problem, ranking, chosen, causes);
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
    let Some(chosen) = chosen else {
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
    let margin = outside.min(added).min((-ahead).max(0.0));
    let scores = Scores { margin, ..scores };
    Decision {
        kind: VerdictKind::Effect,
        probability: calibration.of_effect(&scores),
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
fn dominance<V: ReplayVehicle>(problem: &Problem<V>, ranking: &Ranking, at: &Fit, effect: usize) -> f64 {
    let without = |effects: &[usize]| {
        let mut x = at.x.clone();
        problem.with_companions(effects).into_iter().for_each(|i| x[i] = ranking.prior.mean[i]);
        problem.residual(&x)
    };
    let (Some(gap), Some(background)) = (without(&[effect]), without(&at.freed)) else {
        return f64::INFINITY;
    };
    let weights = &ranking.linear.weights;
    let distance = |a: &[f64], b: &[f64]| {
        a.iter().zip(b).zip(weights.iter()).map(|((a, b), w)| w * (a - b).powi(2)).sum::<f64>().sqrt()
    };
    let (own, background) = (distance(&gap, &at.gap), distance(&background, &ranking.neutral));
    own / background.max(0.05 * own).max(1e-9)
}

fn named<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    decision: &Decision,
    covariance: &nalgebra::DMatrix<f64>,
    wider: f64,
) -> Vec<NamedEffect> {
    let winner = &decision.fit;
    let mut effects = Vec::new();
    for (place, &i) in winner.freed.iter().enumerate() {
        let it = &problem.knobs[i];
        let Some(effect) = it.effect else { continue };
        let wind = wind_of(problem, winner, i);
        let (x, variance) = match wind {
            Some(Wind { speed, to: (sin, cos), across: j }) => {
                let both = cos * cos * covariance[(i, i)] + sin * sin * covariance[(j, j)];
                (speed, both + 2.0 * sin * cos * covariance[(i, j)])
            }
            None => (winner.x[i], covariance[(i, i)]),
        };
        let deviation = wider * variance.max(0.0).sqrt();
        let within = |value: f64| value.clamp(effect.range.0.min(it.value(it.named_least)), effect.range.1);
        let (a, b) = (it.value(x - 1.96 * deviation), it.value(x + 1.96 * deviation));
        let total = within(it.value(x));
        // What has changed since the reference; neutral without one.
        let known = it.value(ranking.prior.mean[i]);
        let since = |value: f64| match effect.neutral {
            // A rate limit or a relaxation length is not added to the file's: it stands in its place.
            _ if matches!(it.id, "steer_rate_limit" | "tyre_relaxation") => value,
            1.0 => value / known,
            neutral => value - known + neutral,
        };
        let class = decision.classes.get(place).cloned().unwrap_or_default();
        let mut class: Vec<String> = class.iter().map(|&i| problem.knobs[i].id.to_owned()).collect();
        let mut separated_by = String::new();
        if it.id == "sensor_delay" && !problem.drive.commanded {
            // From the angle on, a later motion and a later sensor are the same.
            class.push("steer_delay".to_owned());
            separated_by = "log the steering command besides the angle".to_owned();
        }
        let of = |i: usize| (problem.knobs[i].id.to_owned(), problem.knobs[i].value(winner.x[i]));
        let components = problem.companion(i).map_or_else(BTreeMap::new, |(j, _)| [of(i), of(j)].into());
        let direction = wind.map(|Wind { to: (sin, cos), .. }| sin.atan2(cos));
        if direction.is_some() {
            class.push("wind_y".to_owned());
            separated_by = "log the heading, or the place".to_owned();
        }
        effects.push(NamedEffect {
            id: it.id.to_owned(),
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

/// A wind as a log without a compass shows it.
#[derive(Clone, Copy)]
struct Wind {
    /// In units of the coordinate.
    speed: f64,
    /// Sine and cosine of where it blows to, by the heading at the log's start.
    to: (f64, f64),
    /// The knob of its other component.
    across: usize,
}

/// The wind that a knob of a fit stands for, where it is not one component alone.
fn wind_of<V: ReplayVehicle>(problem: &Problem<V>, fit: &Fit, knob: usize) -> Option<Wind> {
    let (across, _) = problem.companion(knob).filter(|_| problem.knobs[knob].id == "wind_x")?;
    let (sin, cos) = fit.x[across].atan2(fit.x[knob]).sin_cos();
    Some(Wind { speed: fit.x[across].hypot(fit.x[knob]), to: (sin, cos), across })
}

fn candidates<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    decision: &Decision,
    calibration: &Calibration,
) -> Vec<Candidate> {
    let best = decision.fit.cost;
    let mut all: Vec<Candidate> = ranking
        .singles
        .iter()
        .chain(&ranking.pairs)
        .chain(&ranking.threes)
        .map(|fit| {
            let evidence = ranking.none.cost - fit.cost;
            let behind = fit.cost - best;
            let pinned =
                fit.freed.iter().any(|&i| information(problem, ranking, i) * 16.0 < calibration.none);
            let stages = fit.freed.iter().map(|&i| calibration.threshold(problem.knobs[i].effect));
            let needed = stages.fold(0.0, f64::max);
            let shown = |i: usize| wind_of(problem, fit, i).map_or(fit.x[i], |wind| wind.speed);
            Candidate {
                effects: fit.freed.iter().map(|&i| problem.knobs[i].id.to_owned()).collect(),
                values: fit.freed.iter().map(|&i| problem.knobs[i].value(shown(i))).collect(),
                evidence,
                collinearity: None,
                why: words::why(
                    evidence,
                    needed,
                    behind,
                    pinned,
                    fit.freed == decision.fit.freed,
                    decision.kind,
                    calibration,
                ),
            }
        })
        .collect();
    // The winner stands first, even before a pair that explains a little more.
    let name: Vec<String> = decision.fit.freed.iter().map(|&i| problem.knobs[i].id.to_owned()).collect();
    all.sort_by(|a, b| {
        (a.effects != name)
            .cmp(&(b.effects != name))
            .then(b.evidence.total_cmp(&a.evidence))
            .then(a.effects.cmp(&b.effects))
    });
    if decision.kind == VerdictKind::Effect {
        for candidate in all.iter_mut().take(COMPARED) {
            candidate.collinearity = likeness(problem, ranking, &decision.fit.freed, &candidate.effects);
            candidate.why += &words::likeness(candidate.collinearity);
        }
    }
    all
}

/// How alike a candidate is to the winner where they differ in one effect.
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

/// What plots are drawn from.
fn series<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    drive: &Drive,
    winner: &Fit,
    simulator: &[f64],
) -> Result<Series, DiagnoseError> {
    let run = |x: &[f64]| problem.trace(x).map_err(|reason| DiagnoseError::Replay { reason });
    let columns = |trace: &Trace| -> BTreeMap<String, Vec<f64>> {
        drive
            .channels
            .iter()
            .map(|&channel| {
                let column = trace.column(channel);
                let log = drive.column(channel.name());
                // What leaks is the difference to the log.
                let whole = channel.leaks() && log.len() == column.len();
                let shown = if whole {
                    column.iter().zip(log).map(|(d, l)| d + l).collect()
                } else {
                    column.to_vec()
                };
                (channel.name().to_owned(), shown)
            })
            .collect()
    };
    let neutral = run(&prior.mean)?;
    let alone = run(&only(problem, prior, &winner.freed, &winner.x))?;
    let corrected = run(simulator)?;
    let mut log: BTreeMap<String, Vec<f64>> =
        drive.columns.iter().map(|(&name, column)| (name.to_owned(), column.clone())).collect();
    for channel in
        drive.channels.iter().filter(|channel| !log.contains_key(channel.name())).copied().collect::<Vec<_>>()
    {
        log.insert(channel.name().to_owned(), vec![0.0; drive.time.len()]);
    }
    Ok(Series {
        time: drive.time.clone(),
        log,
        simulated: columns(&neutral),
        with_effect: columns(&alone),
        corrected: columns(&corrected),
    })
}
