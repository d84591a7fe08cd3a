//! From a log and a vehicle to the answer.

use super::beliefs::Beliefs;
use super::calibration::Calibration;
use super::constancy;
use super::conventions;
use super::decision::{decide, lead};
use super::fit::{Fit, Prior};
use super::information::information;
use super::localise;
use super::manoeuvre;
use super::naming::{candidates, named, summary};
use super::observability::{Excitation, observability};
use super::posterior::{Posterior, Unknown};
use super::problem::Problem;
use super::rank::{NoReplay, rank};
use super::replay::{Channel, ReplayDrive, ReplayVehicle, Trace, neutral, prepared};
use super::report::{
    Adjustment, Diagnosis, Finding, FindingSeverity, InputFile, Inputs, Report, Series, Varies, Verdict,
    VerdictKind,
};
use super::select::chosen;
use super::shrink::{recalibrated, shrink};
use super::uncertain;
use super::words;
use crate::log::CleanLog;
use crate::numerics::parallel;
use std::collections::BTreeMap;

/// Shortest drive that is diagnosed, s of compared rows.
const SHORTEST: f64 = 6.0;
/// Ordinary change of a sound vehicle from log to log, as a share of its tolerance.
const DRIFT: f64 = 0.2;
/// Effects of the day and the road, not of the vehicle: each may change by its whole tolerance.
const ENVIRONMENT: [&str; 4] = ["wind_x", "wind_y", "road_bank", "road_grade"];
/// Tolerances of a vehicle in its reference log, besides the effects named there, relative to the ordinary ones.
const WIDE: f64 = 2.0;
/// Number of other hypotheses that the next manoeuvre separates from the first, and of hypotheses in a short list.
const RIVALS: usize = 4;
const SHORT_LIST: usize = 5;
/// Deviation of the steering below which there is none, rad.
const STRAIGHT: f64 = 1e-3;

/// Options of a diagnosis.
#[derive(Debug, Clone)]
pub struct Options {
    /// Seed of everything random (recorded; the engine itself draws nothing).
    pub seed: u64,
    /// Threads; 0: all there are. The answer does not depend on it.
    pub threads: usize,
    /// True to search for pairs of effects.
    pub pairs: bool,
    /// Effects that are left out of the library, for negative controls; within their tolerances they stay.
    pub without: Vec<String>,
    /// Beliefs before the log is seen.
    pub beliefs: Beliefs,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 1, threads: 0, pairs: true, without: Vec::new(), beliefs: Beliefs::default() }
    }
}

/// Reasons for which there is no answer.
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
    #[error("--prior {id}={probability}: {words}")]
    Prior { id: String, probability: f64, words: &'static str },
    #[error(
        "the vehicle file's tolerance of '{name}' is of nothing that a diagnosis takes into account; inputs.tolerances of a report.json lists what there is, such as vehicle.mass and effect.steer_gain"
    )]
    UnknownTolerance { name: String },
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

/// Checks that all names in the options are known.
fn check_options<V: ReplayVehicle>(vehicle: &V, options: &Options) -> Result<(), DiagnoseError> {
    let is_effect = |id: &str| crate::vehicle::TruckEffects::all().any(|effect| effect.id == id);
    if let Some(id) = options.without.iter().find(|id| !is_effect(id)) {
        return Err(DiagnoseError::UnknownEffect { id: id.clone() });
    }
    for (id, &probability) in &options.beliefs.probabilities {
        let words = match (is_effect(id), probability > 0.0 && probability < 1.0) {
            (false, _) => "there is no such effect; 'rfl diagnose --explain' lists all",
            (_, false) => "a probability before the log is seen is between 0 and 1, and neither",
            _ => continue,
        };
        return Err(DiagnoseError::Prior { id: id.clone(), probability, words });
    }
    match vehicle.tolerances().names().find(|name| !uncertain::is_known(name)) {
        Some(name) => Err(DiagnoseError::UnknownTolerance { name: name.to_owned() }),
        None => Ok(()),
    }
}

/// Diagnoses a log. With a `reference`, a log of the same vehicle when it was as modelled, the result is the change
/// since then.
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
    check_options(vehicle, options)?;
    let threads = parallel::threads(options.threads);
    let calibration = Calibration::built_in();
    let mut findings = log.findings.clone();
    let (log, left_out) = chosen(log);
    findings.extend(left_out);
    let mut drive = ReplayDrive::new(&log, V::TRUCK);
    findings.extend(conventions::turn_roll(&mut drive));
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
                short_list: Vec::new(),
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
            posterior: None,
            information: None,
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
    progress("conventions", 0.05);
    let without = &options.without;
    let mut problem = Problem::new(&drive, &prepared_vehicle, &correction, without, threads);
    if drive.channels.contains(&Channel::Ay) {
        let mut level = Problem::new(&drive, &prepared_vehicle, &correction, without, threads);
        level.level();
        if conventions::is_level(&problem, &level) {
            problem = level;
            findings.push(conventions::level_frame());
        }
    }
    let mut prior = Prior::of(&problem);
    for uncertain in problem.uncertain.iter().filter(|uncertain| uncertain.tolerance > 0.0) {
        inputs.tolerances.insert(uncertain.parameter(), uncertain.deviation(uncertain.tolerance, vehicle));
    }
    if let Some(reference) = reference {
        check(reference)?;
        let (reference, _) = chosen(reference);
        known_from(&reference, &problem, &prepared_vehicle, options, &mut prior)?;
    }
    let ranking = rank(&problem, prior, &|_, _| options.pairs, progress)?;
    progress("posterior", 0.91);
    let posterior =
        Posterior::of(&problem, &ranking, calibration, &options.beliefs, &constancy::causes(&problem));
    let lead = lead(&posterior);
    let winner = ranking.find(&lead.effects).unwrap_or(&ranking.none).clone();

    progress("held-out parts", 0.92);
    let local = ranking.linear_at(&problem, &winner);
    let (shrink, predictive) = shrink(&problem, &ranking, &winner, &local.slopes);
    let mut decision = decide(lead, predictive.names());
    let suspicion = findings.iter().any(|finding| finding.gravity == FindingSeverity::Suspicion);
    if excitation.steer < STRAIGHT && decision.kind != VerdictKind::None || suspicion {
        decision.kind = VerdictKind::CannotTell;
    }
    let precision = ranking.prior.free(&problem, &winner.free);
    let covariance = local.covariance(&precision);
    // What is calibrated beside the effects has to hold on what its fit has not seen.
    let simulator = if predictive.recalibration_gains() {
        recalibrated(&problem, &ranking.prior, &local, &winner.free, &winner.x)
    } else {
        ranking.prior.only(&problem, &winner.free, &winner.x)
    };
    let mut effects =
        named(&problem, &ranking, &winner, &decision.classes, &covariance, calibration.interval);
    progress("next manoeuvre", 0.95);
    // What else the log may mean: what is to be told apart next.
    let rivals: Vec<&Fit> = posterior
        .hypotheses
        .iter()
        .filter(|it| it.unknown.is_none() && !it.is_of(&winner.free))
        .filter_map(|it| ranking.find(&it.effects))
        .take(RIVALS)
        .collect();
    let tells_apart = matches!(decision.kind, VerdictKind::Effect | VerdictKind::CannotTell);
    let next_manoeuvre = if tells_apart && !winner.free.is_empty() && reference.is_none() {
        manoeuvre::next(&problem, &ranking, &winner, &rivals, without)
    } else {
        None
    };
    let adjustment = |i: usize, x: &[f64]| {
        let it = &problem.uncertain[i];
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
    let free = problem.with_companions(&winner.free);
    let recalibration = (0..problem.uncertain.len())
        .filter(|&i| {
            let it = &problem.uncertain[i];
            predictive.recalibration_gains()
                && precision.free.contains(&i)
                && !free.contains(&i)
                && it.tolerance > 0.0
                && !it.is_form()
        })
        .map(|i| adjustment(i, &simulator))
        .collect();
    let unknown = decision.unknown.filter(|_| decision.kind == VerdictKind::NotInLibrary);
    let strained = match unknown {
        Some(Unknown::Off { uncertain, x }) => {
            let mut free = winner.x.clone();
            free[uncertain] = x;
            Some(adjustment(uncertain, &free))
        }
        _ => None,
    };
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
    let varying = match unknown {
        Some(Unknown::Varies(it)) => {
            let uncertain = &problem.uncertain[it.effect];
            Some(Varies {
                id: uncertain.id.to_owned(),
                with: it.with,
                deviation: uncertain.deviation(it.deviation, vehicle),
                unit: uncertain.symbol::<V>(),
                evidence: it.gain,
            })
        }
        _ => None,
    };
    let summary = summary(&problem, &posterior);
    let short_list = match decision.kind {
        VerdictKind::CannotTell => summary.hypotheses.iter().take(SHORT_LIST).cloned().collect(),
        _ => Vec::new(),
    };
    let swings = unknown == Some(Unknown::Swings);
    let why = words::UnknownSign { varying: varying.as_ref(), strained: strained.as_ref(), swings };
    let straight = excitation.steer < STRAIGHT;
    let words = match decision.kind {
        VerdictKind::CannotTell => words::cannot_tell(
            &findings,
            straight,
            &short_list,
            &effects,
            &predictive,
            next_manoeuvre.as_ref(),
        ),
        VerdictKind::Effect => words::effect(&effects, &shrink, decision.probability),
        VerdictKind::None => words::none(&shrink),
        VerdictKind::NotInLibrary => words::not_in_library(&effects, why, &shrink),
    };
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
            short_list,
            varying,
            strained,
            words,
        },
        candidates: candidates(&problem, &ranking, &posterior, &winner, decision.kind, calibration),
        places: localise::places(&problem, &ranking),
        stage,
        observability: observability(&problem, &ranking, calibration),
        next_manoeuvre,
        recalibration,
        posterior: Some(summary),
        information: information(&problem, &ranking.prior, &local, &winner, calibration.temper),
        findings,
        inputs,
        shrink,
        seed: options.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    progress("done", 1.0);
    Ok(Diagnosis { report, series })
}

/// Prior knowledge from a reference log of the same vehicle: whatever was wrong then belongs to the vehicle as it is
/// known.
fn known_from<V: ReplayVehicle>(
    log: &CleanLog,
    problem: &Problem<V>,
    vehicle: &V,
    options: &Options,
    prior: &mut Prior,
) -> Result<(), DiagnoseError> {
    let mut drive = ReplayDrive::new(log, V::TRUCK);
    conventions::turn_roll(&mut drive);
    if drive.duration() < SHORTEST || drive.commanded != problem.drive.commanded {
        return Ok(());
    }
    let correction = neutral(&drive, vehicle).map_err(|reason| DiagnoseError::Replay { reason })?;
    let mut own = Problem::new(&drive, vehicle, &correction, &options.without, problem.threads());
    if problem.is_level() {
        own.level();
    }
    let mut wide = Prior::of(&own);
    let drifts = &prior.covariance * DRIFT.powi(2);
    wide.covariance *= WIDE * WIDE;
    // Where nothing is named, no two are.
    let calibration = Calibration::built_in();
    let pairs =
        |none: &Fit, singles: &[Fit]| singles.iter().any(|it| none.cost - it.cost > calibration.telling());
    let ranking = rank(&own, wide, &pairs, &|_, _| {})?;
    let lead = lead(&Posterior::of(&own, &ranking, calibration, &options.beliefs, &[]));
    let known = ranking.find(&lead.effects).unwrap_or(&ranking.none);
    let covariance = ranking.linear_at(&own, known).covariance(&ranking.prior.free(&own, &known.free));
    prior.form = ranking.noise.beyond(&own, &known.gap);
    // A wind by another log's own start is none by this one's.
    let is_shown = |id: &str| (own.drive.compass && problem.drive.compass) || !id.starts_with("wind_");
    let there: Vec<Option<usize>> = problem
        .uncertain
        .iter()
        .map(|uncertain| own.find(uncertain.id).filter(|_| is_shown(uncertain.id)))
        .collect();
    for (i, uncertain) in problem.uncertain.iter().enumerate() {
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
            if ENVIRONMENT.contains(&uncertain.id) {
                prior.covariance[(i, i)] += uncertain.tolerance.powi(2);
            }
        }
    }
    Ok(())
}

/// Data of the plots.
fn series<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    drive: &ReplayDrive,
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
    let alone = run(&prior.only(problem, &winner.free, &winner.x))?;
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
