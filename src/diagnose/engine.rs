//! From a log and a vehicle to the answer.

use super::beliefs::Beliefs;
use super::calibration::Calibration;
use super::decision::lead;
use super::fit::{Fit, Prior};
use super::information::information;
use super::judged::{Judged, judge};
use super::library::{Library, OwnEffect};
use super::naming::{candidates, summary};
use super::observability::{Excitation, observability};
use super::posterior::Posterior;
use super::problem::Problem;
use super::rank::{NoReplay, rank};
use super::replay::{Channel, Correction, ReplayDrive, ReplayVehicle, Trace, neutral, prepared};
use super::report::{
    Diagnosis, Finding, GapReduction, InputFile, Inputs, Report, Series, Verdict, VerdictKind,
};
use super::select::chosen;
use super::{constancy, conventions, localise, uncertain};
use crate::log::CleanLog;
use crate::numerics::parallel;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Shortest drive that is diagnosed, s of compared rows.
const SHORTEST: f64 = 6.0;
/// Ordinary change of a sound vehicle from log to log, as a share of its tolerance.
const DRIFT: f64 = 0.2;
/// Effects of the day and the road, not of the vehicle: each may change by its whole tolerance.
const ENVIRONMENT: [&str; 4] = ["wind_x", "wind_y", "road_bank", "road_grade"];
/// Tolerances of a vehicle in its reference log, besides the effects named there, relative to the ordinary ones.
const WIDE: f64 = 2.0;

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
    /// Effects of one's own, besides those of the library.
    pub own: Vec<Arc<dyn OwnEffect>>,
    /// Beliefs before the log is seen.
    pub beliefs: Beliefs,
}

impl Options {
    /// Effects that may be named.
    #[must_use]
    pub fn library(&self) -> Library<'_> {
        Library { without: &self.without, own: &self.own }
    }
}

impl Default for Options {
    fn default() -> Self {
        let (without, own) = (Vec::new(), Vec::new());
        Self { seed: 1, threads: 0, pairs: true, without, own, beliefs: Beliefs::default() }
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
    #[error("there is no effect '{id}' to leave out; there are {}", known.join(", "))]
    UnknownEffect { id: String, known: Vec<String> },
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
    let library = options.library();
    let is_effect = |id: &str| library.effects().any(|effect| effect.id == id);
    if let Some(id) = options.without.iter().find(|id| !is_effect(id)) {
        let known = library.effects().map(|effect| effect.id.to_owned()).collect();
        return Err(DiagnoseError::UnknownEffect { id: id.clone(), known });
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
    let mut findings = log.findings.clone();
    let (log, left_out) = chosen(log);
    findings.extend(left_out);
    let mut drive = ReplayDrive::new(&log, V::TRUCK);
    findings.extend(conventions::turn_roll(&mut drive));
    let mut inputs = inputs_of(vehicle, &drive, log.step);
    if drive.duration() < SHORTEST {
        let words = format!(
            "This log cannot tell: only {:.1} s of it are driven faster than 2 m/s without gaps. Give a longer drive \
             (half a minute or more, turns to both sides, several speeds).",
            drive.duration()
        );
        let report = Report { findings, inputs, ..without_answer(words, options) };
        return Ok(Diagnosis { report, series: Series::default() });
    }
    progress("full plant", 0.02);
    let own = prepared(vehicle, drive.commanded);
    let correction = neutral(&drive, &own).map_err(|reason| DiagnoseError::Replay { reason })?;
    progress("conventions", 0.05);
    let (problem, finding) = framed(&drive, &own, &correction, options);
    findings.extend(finding);
    let mut prior = Prior::of(&problem);
    for uncertain in problem.uncertain.iter().filter(|uncertain| uncertain.tolerance > 0.0) {
        inputs.tolerances.insert(uncertain.parameter(), uncertain.deviation(uncertain.tolerance, vehicle));
    }
    if let Some(reference) = reference {
        check(reference)?;
        let (reference, _) = chosen(reference);
        known_from(&reference, &problem, &own, options, &mut prior)?;
    }
    let ranking = rank(&problem, prior, &|_, _| options.pairs, progress)?;
    progress("posterior", 0.91);
    let causes = constancy::causes(&problem);
    let posterior = Posterior::of(&problem, &ranking, Calibration::built_in(), &options.beliefs, &causes);
    progress("held-out parts", 0.92);
    let straight = Excitation::of(&drive, vehicle).steer < STRAIGHT;
    let judged = judge(&problem, &ranking, &posterior, straight, &findings);
    progress("next manoeuvre", 0.95);
    let next = match reference {
        Some(_) => None,
        None => judged.next_manoeuvre(&problem, &ranking, &posterior),
    };
    let series = series(&problem, &ranking.prior, &drive, &judged.winner, &judged.simulator)?;
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.gravity));
    let summary = summary(&problem, &posterior);
    let calibration = Calibration::built_in();
    let Judged { winner, local, decision, .. } = &judged;
    let verdict = judged.verdict(
        &problem,
        &ranking,
        vehicle,
        (&findings, straight),
        (&posterior, &summary.hypotheses),
        next.as_ref(),
    );
    let report = Report {
        candidates: candidates(&problem, &ranking, &posterior, winner, decision.kind, calibration),
        location: localise::places(&problem, &ranking),
        stage: verdict.effects.first().map(|effect| effect.stage),
        observability: observability(&problem, &ranking, calibration),
        next_manoeuvre: next,
        recalibration: judged.recalibration(&problem, vehicle),
        posterior: Some(summary),
        information: information(&problem, &ranking.prior, local, winner, calibration.temper),
        verdict,
        findings,
        inputs,
        gap_reduction: judged.gap_reduction,
        seed: options.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    progress("done", 1.0);
    Ok(Diagnosis { report, series })
}

/// Inputs of a diagnosis, as its report gives them.
fn inputs_of<V: ReplayVehicle>(vehicle: &V, drive: &ReplayDrive, step: f64) -> Inputs {
    let calibration = InputFile { file: "calibration.toml".to_owned(), hash: Calibration::hash() };
    Inputs {
        vehicle: vehicle.name().to_owned(),
        signals: drive.channels.iter().map(|channel| channel.name().to_owned()).collect(),
        duration: drive.duration(),
        rate: 1.0 / step,
        files: BTreeMap::from([("calibration".to_owned(), calibration)]),
        ..Inputs::default()
    }
}

/// The report of a log that cannot be diagnosed.
fn without_answer(words: String, options: &Options) -> Report {
    Report {
        verdict: Verdict {
            kind: VerdictKind::CannotTell,
            probability: 1.0,
            effects: Vec::new(),
            nearest: Vec::new(),
            tolerance_factor: None,
            short_list: Vec::new(),
            varying: None,
            strained: None,
            summary: words,
        },
        candidates: Vec::new(),
        gap_reduction: GapReduction::default(),
        location: Vec::new(),
        stage: None,
        observability: Vec::new(),
        next_manoeuvre: None,
        recalibration: Vec::new(),
        posterior: None,
        information: None,
        findings: Vec::new(),
        inputs: Inputs::default(),
        seed: options.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    }
}

/// The gap of a drive, its lateral acceleration in the frame that explains it better; the frame, where it is level.
fn framed<'a, V: ReplayVehicle>(
    drive: &'a ReplayDrive,
    vehicle: &'a V,
    correction: &'a Correction,
    options: &'a Options,
) -> (Problem<'a, V>, Option<Finding>) {
    let threads = parallel::threads(options.threads);
    let of_body = || Problem::new(drive, vehicle, correction, options.library(), threads);
    let problem = of_body();
    if drive.channels.contains(&Channel::Ay) {
        let mut level = of_body();
        level.level();
        if conventions::is_level(&problem, &level) {
            return (level, Some(conventions::level_frame()));
        }
    }
    (problem, None)
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
    let mut own = Problem::new(&drive, vehicle, &correction, problem.library, problem.threads());
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
