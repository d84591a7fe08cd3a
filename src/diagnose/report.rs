//! The answer of a diagnosis: what `report.json` holds, and the series that its plots need.
//!
//! Field names are the contract with users' scripts; values are SI units and radians.

pub use super::constancy::Cause;
pub use crate::log::{Finding, Gravity};
use crate::vehicle::Stage;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The whole answer.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Report {
    /// What is the matter.
    pub verdict: Verdict,
    /// All candidates, the best first.
    pub candidates: Vec<Candidate>,
    /// How far the gap shrinks.
    pub shrink: Shrink,
    /// Where the gap lies, the greatest share first.
    #[serde(rename = "where")]
    pub places: Vec<Place>,
    /// The stage at which the gap enters, if there is one.
    pub stage: Option<Stage>,
    /// What this log can show and what it cannot.
    pub observability: Vec<Observability>,
    /// What to drive next to tell the first candidates apart.
    pub next_manoeuvre: Option<Manoeuvre>,
    /// What the simulator needs besides the named effect to drive like the log, each within its tolerance.
    pub recalibration: Vec<Adjustment>,
    /// How probable each hypothesis is: what the verdict was read from.
    #[serde(default)]
    pub posterior: Option<Probabilities>,
    /// What the log says of all parameters at once: summaries of several drives add up (`rfl fleet`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub information: Option<Information>,
    /// What was found wrong, missing or mended in the log, in words, the gravest first.
    pub findings: Vec<Finding>,
    /// What the diagnosis was made from.
    pub inputs: Inputs,
    /// Seed of everything random.
    pub seed: u64,
    /// Version of this program.
    pub version: String,
}

/// Gaussian likelihood of all parameters around the fit of the first hypothesis, without their priors.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Information {
    /// Parameters, in the order of the rows below.
    pub parameters: Vec<InformedParameter>,
    /// Precision matrix: lower triangle, row after row.
    pub precision: Vec<f64>,
    /// Slope of the log likelihood at the fit.
    pub gradient: Vec<f64>,
    /// Power of the likelihood, within both.
    pub temper: f64,
}

/// A parameter of a summary; all numbers are differences from what is given, or from 0 where it is a `reciprocal`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct InformedParameter {
    /// Name in the vehicle file or of the plant.
    pub name: String,
    /// Value in the simulator.
    pub given: f64,
    /// Symbol of the unit.
    pub unit: String,
    /// Whether the numbers are of one over the value: of a rate limit, which is infinite where there is none.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reciprocal: bool,
    /// Standard deviation of ordinary simulators; 0: none has it.
    pub tolerance: f64,
    /// Standard deviation of what is named; 0: it cannot be named.
    pub change: f64,
    /// Range of what is named; None: no bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<f64>,
    /// Its other end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub greatest: Option<f64>,
    /// Name of the parameter that it is named with, and only with: a payload's place with the payload.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goes_with: Option<String>,
    /// Difference at the fit, about which the likelihood was taken.
    pub value: f64,
}

/// How probable what is.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Probabilities {
    /// That nothing is the matter.
    pub none: f64,
    /// That the cause is not in the library.
    pub not_in_library: f64,
    /// How good the vehicle's numbers are.
    #[serde(default)]
    pub tolerances: Vec<Spread>,
    /// That an effect is among the causes, by id, the most probable of all.
    pub inclusion: BTreeMap<String, f64>,
    /// Single hypotheses, the most probable first.
    pub hypotheses: Vec<Hypothesis>,
}

/// What a hypothesis is weighed by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// Where the vehicle's numbers have heavy tails, or normal ones.
    pub heavy_tails: bool,
    /// How much better it explains the log: a difference of costs of the tempered likelihood, from nothing with normal tails, or from
    /// what a cause that is not in the library comes upon.
    pub evidence: f64,
    /// What its freedom costs.
    pub narrowing: f64,
}

/// How the vehicle's numbers may be spread about the true ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// How many times as wide as the tolerances of a careful measurement.
    pub factor: f64,
    /// Whether with heavy tails (Student's t), so that a few may be far off.
    pub heavy_tails: bool,
    /// How probable that is.
    pub probability: f64,
}

/// A hypothesis and its probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// Effects; none where nothing is the matter. Of a cause that is not in the library, those that come nearest.
    pub effects: Vec<String>,
    /// What says that the cause is not in the library, if anything does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_in_library: Option<String>,
    /// What it is weighed by where the vehicle's numbers are spread one way or the other.
    #[serde(default)]
    pub terms: Vec<Term>,
    /// Its probability.
    pub probability: f64,
}

/// What is the matter.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Verdict {
    /// An effect, nothing, something that the library does not have, or a log that does not tell.
    pub kind: VerdictKind,
    /// Probability of the verdict (for an effect: of its class); where the log does not tell, of the most probable hypothesis.
    pub probability: f64,
    /// The effects named: one to three.
    pub effects: Vec<NamedEffect>,
    /// Where the cause is not in the library: its effects that come nearest. The calibrated simulator has them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nearest: Vec<NamedEffect>,
    /// Where the log does not tell: what may be the matter, the most probable first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub short_list: Vec<Hypothesis>,
    /// Where the cause is not in the library because an effect of it would have to change its value: how.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub varying: Option<Varies>,
    /// Where it is not because what may not be named, or is not, would have to be far off: that, and where.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strained: Option<Adjustment>,
    /// The verdict in at most three sentences.
    pub words: String,
}

/// An effect whose value is not one.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Varies {
    /// Its id.
    pub id: String,
    /// What its value changes with.
    pub with: Cause,
    /// By how much: standard deviation over the drive, in `unit`.
    pub deviation: f64,
    /// Symbol of the unit.
    pub unit: String,
    /// Evidence that it does: how much better it explains the log than with one value.
    pub evidence: f64,
}

/// Kinds of verdicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum VerdictKind {
    Effect,
    None,
    NotInLibrary,
    CannotTell,
}

/// An effect that was named.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct NamedEffect {
    /// Its id, as in the plant's parameter `effect.<id>`.
    pub id: String,
    /// Its value with an interval of 95 %, in `unit`; with a reference log, what has changed since: a difference, of a
    /// factor the quotient.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
    /// Symbol of the unit.
    pub unit: String,
    /// Effects that this log cannot tell from it, itself among them.
    pub class: Vec<String>,
    /// What would tell them apart, in words; empty where the class is the effect alone.
    pub separated_by: String,
    /// Where on the way from command to measurement it acts.
    pub stage: Stage,
    /// Gap that the effect makes over the gap of the background.
    pub dominance: f64,
    /// Its value on the nominal vehicle: what the reference log says of it, and the change.
    pub total: f64,
    /// Of a wind that is named by its speed, as the log tells no heading: where it blows to, rad to the left of the heading
    /// at the log's start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<f64>,
    /// Effects of the simulator and their values where one does not say it all: a payload with its place, such a wind by its
    /// components. Empty where the effect and `total` do.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub components: BTreeMap<String, f64>,
}

/// A cause that was tried.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Candidate {
    /// One to three effects.
    pub effects: Vec<String>,
    /// Their values, SI units.
    pub values: Vec<f64>,
    /// `J_none - J` of the candidate: how much better it explains the log than the background alone.
    pub evidence: f64,
    /// That these effects, and no others, are the causes.
    #[serde(default)]
    pub probability: f64,
    /// Where it has another effect than the verdict in one place: how alike the two are on this log, the cosine of their
    /// sensitivities less what the tolerances imitate. Of the first few candidates.
    #[serde(default)]
    pub collinearity: Option<f64>,
    /// Why it stands where it does, in words.
    pub why: String,
}

/// How far the gap shrinks.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Shrink {
    /// For each signal, over the whole of the held-out parts.
    pub open_loop: BTreeMap<String, Gap>,
    /// For each horizon (`0.5`, `1`, `2` s) and signal: the simulator starts anew from the log every horizon.
    pub horizons: BTreeMap<String, BTreeMap<String, Gap>>,
    /// For each path error, if a path and a controller were given.
    pub closed_loop: Option<BTreeMap<String, Gap>>,
}

/// A gap (RMS, in the signal's unit) on held-out parts, and what is left of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Of the simulator as it was given.
    pub before: f64,
    /// With the named effect.
    pub effect: f64,
    /// With the effect, and all else within its tolerance.
    pub recalibrated: f64,
    /// What a model learned from past commands still removes from that: the rest after it; none where none was learned
    /// (horizons, closed loop).
    pub learnable: Option<f64>,
    /// What noise alone leaves.
    pub noise: f64,
}

/// A place where the gap lies.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Place {
    /// The signal.
    pub signal: String,
    /// What is divided into regimes: `speed`, `lateral_accel`, `curvature`, `steer_rate`, `side`, `time`, `station`, `frequency`.
    pub regime: String,
    /// Beginning of the regime, in the unit of what is divided.
    pub from: f64,
    /// Its end.
    pub to: f64,
    /// Samples in it.
    pub count: usize,
    /// RMS of the gap there, in the signal's unit.
    pub rms: f64,
    /// Its share of the signal's whole squared gap.
    pub share: f64,
    /// How unlikely as much is by noise and an even spread, in standard deviations.
    pub significance: f64,
}

/// Whether a log can show an effect.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Observability {
    /// The effect's id.
    pub effect: String,
    /// Whether the log can show it at all.
    pub observable: bool,
    /// Least value (as a distance from the neutral one) that would be seen, if any.
    pub least: Option<f64>,
    /// Least value that would be named: seen, and more than a sound vehicle has within tolerance.
    #[serde(default)]
    pub named_from: Option<f64>,
    /// The reason, in words, with numbers ("34 % of grip reached").
    pub why: String,
}

/// What to drive next.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Manoeuvre {
    /// Its name, e.g. `speed sweep`.
    pub name: String,
    /// How it is driven, in words.
    pub how: String,
    /// What to drive besides where the model's form may look like an effect; empty where it is known.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub besides: String,
    /// The candidates that it tells apart.
    pub separates: Vec<String>,
    /// Evidence that it is expected to give for one against the other, if the first is true.
    pub expected_evidence: f64,
}

/// A number of the simulator that is adjusted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Adjustment {
    /// `effect.<id>` or a vehicle's parameter, e.g. `vehicle.mass`.
    pub parameter: String,
    /// Its value in the simulator as it was given.
    pub given: f64,
    /// Its adjusted value.
    pub value: f64,
    /// Its tolerance: standard deviation before the log was seen.
    pub tolerance: f64,
    /// Standard deviation after.
    pub deviation: f64,
    /// Symbol of the unit.
    pub unit: String,
}

/// What a diagnosis was made from.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Inputs {
    /// Each file with its hash, by what it is (`log`, `reference`, `vehicle`, `path`, `controller`).
    pub files: BTreeMap<String, InputFile>,
    /// The vehicle's name.
    pub vehicle: String,
    /// Tolerances (standard deviations) of the background, by parameter, SI units.
    pub tolerances: BTreeMap<String, f64>,
    /// Signals that were compared.
    pub signals: Vec<String>,
    /// Length of the log that was used, s.
    pub duration: f64,
    /// Its samples per second.
    pub rate: f64,
}

/// A file that was read.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct InputFile {
    /// As it was named.
    pub file: String,
    /// Hash of its content, hexadecimal.
    pub hash: String,
}

/// What plots are drawn from: every column is as long as `time`.
#[derive(Debug, Clone, Default)]
pub struct Series {
    /// Time, s, on the log's own clock.
    pub time: Vec<f64>,
    /// Columns of the log, by signal, repaired, on an even clock.
    pub log: BTreeMap<String, Vec<f64>>,
    /// What the simulator says as it was given, for each signal compared.
    pub simulated: BTreeMap<String, Vec<f64>>,
    /// What it says with the named effect.
    pub with_effect: BTreeMap<String, Vec<f64>>,
    /// What it says with effect and recalibration.
    pub corrected: BTreeMap<String, Vec<f64>>,
}

/// All that a diagnosis gives.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The answer.
    pub report: Report,
    /// What its plots are drawn from.
    pub series: Series,
}
