//! The answer of a diagnosis: contents of `report.json`, and the series of its plots.
//!
//! Field names are the contract with users' scripts; values are SI units and radians.

pub use super::constancy::Cause;
pub use crate::log::{Finding, FindingSeverity};
use crate::vehicle::Stage;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The whole answer.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Report {
    /// The cause found.
    pub verdict: Verdict,
    /// All candidates, the best first.
    pub candidates: Vec<Candidate>,
    /// Reduction of the gap.
    #[serde(flatten, with = "crate::former::gap_reduction")]
    pub gap_reduction: GapReduction,
    /// Location of the gap, the greatest share first.
    #[serde(flatten, with = "crate::former::location")]
    pub location: Vec<GapLocation>,
    /// The stage at which the gap enters, if there is one.
    pub stage: Option<Stage>,
    /// Effects that this log can and cannot show.
    pub observability: Vec<Observability>,
    /// The next manoeuvre, to tell the first candidates apart.
    pub next_manoeuvre: Option<Manoeuvre>,
    /// Adjustments of the simulator besides the named effect, to drive like the log; each within its tolerance.
    pub recalibration: Vec<Adjustment>,
    /// Probability of each hypothesis, from which the verdict was read.
    #[serde(default)]
    pub posterior: Option<Probabilities>,
    /// Likelihood of all parameters at once: summaries of several drives add up (`rfl fleet`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub information: Option<Information>,
    /// Faults, gaps and repairs in the log, in words, the gravest first.
    pub findings: Vec<Finding>,
    /// Inputs of the diagnosis.
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
    /// True if the numbers are of one over the value: of a rate limit, which is infinite where there is none.
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

/// Probabilities of the hypotheses.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Probabilities {
    /// Probability that there is no effect.
    pub none: f64,
    /// Probability that the cause is not in the library.
    pub not_in_library: f64,
    /// Quality of the vehicle's numbers.
    #[serde(default)]
    pub tolerances: Vec<Spread>,
    /// Probability of each effect to be among the causes, by id, the most probable of all.
    pub inclusion: BTreeMap<String, f64>,
    /// Single hypotheses, the most probable first.
    pub hypotheses: Vec<ReportedHypothesis>,
}

/// Weight of a hypothesis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// Width of the vehicle's tolerances, relative to those of a careful measurement.
    pub factor: f64,
    /// Gain in explanation of the log: a difference of costs of the tempered likelihood. It counts from nothing with
    /// the narrowest tolerances, or from the hypothesis that a cause outside the library extends.
    pub evidence: f64,
    /// Cost of its freedom.
    pub narrowing: f64,
}

/// Possible spread of the vehicle's numbers about the true ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Width relative to the tolerances of a careful measurement.
    pub factor: f64,
    /// Probability of this spread.
    pub probability: f64,
}

/// A hypothesis and its probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReportedHypothesis {
    /// Effects; empty for `none`. For a cause outside the library, the nearest ones.
    pub effects: Vec<String>,
    /// Sign that the cause is not in the library, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_in_library: Option<String>,
    /// Weight in each spread of the vehicle's numbers.
    #[serde(default)]
    pub terms: Vec<Term>,
    /// Its probability.
    pub probability: f64,
}

/// The cause found.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Verdict {
    /// An effect, nothing, a cause outside the library, or an undecided log.
    pub kind: VerdictKind,
    /// Probability of the verdict (for an effect: of its class); for an undecided log, of the most probable hypothesis.
    pub probability: f64,
    /// The effects named: one to three.
    pub effects: Vec<NamedEffect>,
    /// For a cause outside the library: the nearest effects of the library. The calibrated simulator has them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nearest: Vec<NamedEffect>,
    /// For no effect: the scale of the tolerances that the log speaks for, where they are wider than ordinary ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance_factor: Option<f64>,
    /// For a log that does not tell: possible causes, the most probable first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub short_list: Vec<ReportedHypothesis>,
    /// For a cause outside the library because an effect would have to change its value: the kind of change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub varying: Option<Varies>,
    /// For a cause outside the library because an unnamed number would have to be far off: that number, and its value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strained: Option<Adjustment>,
    /// The verdict in at most three sentences.
    #[serde(flatten, with = "crate::former::summary")]
    pub summary: String,
}

/// An effect whose value is not constant.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Varies {
    /// Its id.
    pub id: String,
    /// Quantity that its value changes with.
    pub with: Cause,
    /// Size of the change: standard deviation over the drive, in `unit`.
    pub deviation: f64,
    /// Symbol of the unit.
    pub unit: String,
    /// Evidence for it: gain in explanation of the log over a constant value.
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
    /// Its meaning, in one sentence.
    #[serde(default)]
    pub meaning: String,
    /// Its value with an interval of 95 %, given that the effect is there, in `unit`. With a reference log, the change
    /// since then: a difference, for a factor the quotient.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
    /// Symbol of the unit.
    pub unit: String,
    /// Effects that this log cannot tell from it, itself among them.
    pub class: Vec<String>,
    /// Drive that would tell them apart, in words; empty where the class is the effect alone.
    pub separated_by: String,
    /// Place of its action on the way from command to measurement.
    pub stage: Stage,
    /// Gap by the effect over the gap by the background.
    pub dominance: f64,
    /// Its value on the nominal vehicle: that of the reference log, and the change.
    pub total: f64,
    /// Direction of a wind that is named by its speed, because the log tells no heading. In rad, to the left of the
    /// heading at the log's start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<f64>,
    /// Effects of the simulator and their values where one is not enough: a payload with its place, such a wind by its
    /// components. Empty where the effect and `total` are enough.
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
    /// `J_none - J` of the candidate: its gain in explanation of the log over the background alone.
    pub evidence: f64,
    /// Probability that these effects, and no others, are the causes.
    #[serde(default)]
    pub probability: f64,
    /// Likeness to the verdict on this log, where one place has another effect: the cosine of their sensitivities less
    /// the parts that the tolerances imitate. Given for the first few candidates.
    #[serde(default)]
    pub collinearity: Option<f64>,
    /// Reason for its rank, in words.
    pub why: String,
}

/// Reduction of the gap.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct GapReduction {
    /// For each signal, over the whole of the held-out parts.
    pub open_loop: BTreeMap<String, Gap>,
    /// For each horizon (`0.5`, `1`, `2` s) and signal: the simulator starts anew from the log every horizon.
    pub horizons: BTreeMap<String, BTreeMap<String, Gap>>,
    /// For each path error, if a path and a controller were given.
    pub closed_loop: Option<BTreeMap<String, Gap>>,
}

/// A gap (RMS, in the signal's unit) on held-out parts, and its remainders.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Of the simulator as it was given.
    pub before: f64,
    /// With the named effect.
    pub effect: f64,
    /// With the effect, and all else within its tolerance.
    pub recalibrated: f64,
    /// Remainder after a model learned from past commands; none where none was learned (horizons, closed loop).
    pub learnable: Option<f64>,
    /// Part of noise alone.
    pub noise: f64,
}

/// A place where the gap lies.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct GapLocation {
    /// The signal.
    pub signal: String,
    /// Name of the division: `speed`, `lateral_accel`, `curvature`, `steer_rate`, `side`, `time`, `station`,
    /// `frequency`.
    pub regime: String,
    /// Beginning of the regime, in the unit of the division.
    pub from: f64,
    /// Its end.
    pub to: f64,
    /// Samples in it.
    pub count: usize,
    /// RMS of the gap there, in the signal's unit.
    pub rms: f64,
    /// Its share of the signal's whole squared gap.
    pub share: f64,
    /// Significance against noise and an even spread, in standard deviations.
    pub significance: f64,
}

/// Observability of an effect on a log.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Observability {
    /// The effect's id.
    pub effect: String,
    /// True if the log can show it at all.
    pub observable: bool,
    /// Least value (as a distance from the neutral one) that would be seen, if any.
    pub least: Option<f64>,
    /// Least value that would be named: seen, and beyond a sound vehicle's tolerance.
    #[serde(default)]
    pub named_from: Option<f64>,
    /// The reason, in words, with numbers ("34 % of grip reached").
    pub why: String,
}

/// The next manoeuvre.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Manoeuvre {
    /// Its name, e.g. `speed sweep`.
    pub name: String,
    /// Instructions for driving it, in words.
    pub how: String,
    /// Additional drive where the model's form may look like an effect; empty where the form is known.
    #[serde(flatten, with = "crate::former::also")]
    pub also: String,
    /// The candidates that it tells apart.
    pub separates: Vec<String>,
    /// Expected evidence for one against the other, if the first is true.
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

/// Inputs of a diagnosis.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Inputs {
    /// Each file with its hash, by its role (`log`, `reference`, `vehicle`, `path`, `controller`).
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

/// Data of the plots: every column is as long as `time`.
#[derive(Debug, Clone, Default)]
pub struct Series {
    /// Time, s, on the log's own clock.
    pub time: Vec<f64>,
    /// Columns of the log, by signal, repaired, on an even clock.
    pub log: BTreeMap<String, Vec<f64>>,
    /// Output of the simulator as given, for each compared signal.
    pub simulated: BTreeMap<String, Vec<f64>>,
    /// Output with the named effect.
    pub with_effect: BTreeMap<String, Vec<f64>>,
    /// Output with effect and recalibration.
    pub corrected: BTreeMap<String, Vec<f64>>,
}

/// All that a diagnosis gives.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The answer.
    pub report: Report,
    /// Data of its plots.
    pub series: Series,
}
