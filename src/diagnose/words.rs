//! The answer in words for a test engineer.

use super::gap_reduction::Predictive;
use super::headline::{behind, value};
use super::observability::short;
use super::report::{
    Adjustment, Finding, FindingSeverity, Gap, GapReduction, Manoeuvre, NamedEffect, ReportedHypothesis,
    Varies,
};

/// Share of the yaw-rate gap from which on it is evidence for the effect.
const TELLING: f64 = 0.2;
/// Least probability of a hypothesis that is mentioned.
const LISTED: f64 = 0.02;
/// Tolerances from which on a number is far off; number of those that are listed.
const FAR: f64 = 3.0;
const LISTED_NUMBERS: usize = 4;
/// Cosine from which on two effects are hardly told apart.
const ALIKE: f64 = 0.9;

fn sure(probability: f64) -> &'static str {
    match probability {
        p if p >= 0.95 => "almost certainly",
        p if p >= 0.8 => "very probably",
        p if p >= 0.6 => "probably",
        _ => "perhaps",
    }
}

fn of_effect(effect: &NamedEffect) -> String {
    let meaning = &effect.meaning;
    let lower = meaning
        .chars()
        .next()
        .map(|c| c.to_lowercase().to_string() + &meaning[c.len_utf8()..])
        .unwrap_or_default();
    match effect.direction {
        Some(direction) => format!(
            "{}: wind (the log tells no heading; where it starts, this wind blows to {:.0} degrees {} of ahead)",
            value(effect),
            direction.abs().to_degrees(),
            if direction < 0.0 { "right" } else { "left" },
        ),
        None => format!("{}: {lower}", value(effect)),
    }
}

/// The yaw rate if the effect shows in it, else the signal of whose gap it takes most, in units of the noise. A gap that is no
/// more than noise tells nothing.
fn told(reduction: &GapReduction) -> Option<(&str, &Gap)> {
    let gaps = reduction.open_loop.iter().map(|(signal, gap)| (signal.as_str(), gap));
    let seen = gaps.filter(|(_, gap)| gap.before > gap.noise && gap.before > 0.0);
    let share = |gap: &Gap| 1.0 - gap.effect / gap.before;
    let taken =
        |gap: &Gap| (gap.before.powi(2) - gap.effect.powi(2)) / gap.noise.powi(2).max(f64::MIN_POSITIVE);
    let yaw = seen.clone().find(|(signal, gap)| *signal == "yaw_rate" && share(gap) >= TELLING);
    yaw.or_else(|| seen.max_by(|a, b| taken(a.1).total_cmp(&taken(b.1))))
}

/// Sign that a cause is not in the library, apart from the remainder of the gap.
#[derive(Clone, Copy)]
pub struct UnknownSign<'a> {
    /// A value that is not one.
    pub varying: Option<&'a Varies>,
    /// Number that is not named and yet far off.
    pub strained: Option<&'a Adjustment>,
    /// A steering that swings.
    pub swings: bool,
}

/// Change of a gap, as in `shrinks by 90 %`.
fn change(now: f64, before: f64) -> String {
    let share = 100.0 * (1.0 - now / before.max(1e-12));
    if share < -0.5 {
        format!("grows by {:.0} %", -share)
    } else {
        format!("shrinks by {:.0} %", share.max(0.0))
    }
}

/// Effects that are named, in a few sentences.
#[must_use]
pub fn effect(effects: &[NamedEffect], reduction: &GapReduction, probability: f64) -> String {
    let named: Vec<String> = effects.iter().map(of_effect).collect();
    let mut words = format!("The gap comes {} from {}.", sure(probability), named.join("; and from "));
    let others: Vec<&str> = effects
        .iter()
        .flat_map(|effect| effect.class.iter().filter(|id| **id != effect.id).map(String::as_str))
        .collect();
    if let Some((signal, gap)) = told(reduction) {
        words += &format!(
            " On parts of the log held out, the gap of {signal} {} with {}; with all else adjusted within tolerance it {}.",
            change(gap.effect, gap.before),
            if effects.len() > 1 { "them" } else { "it" },
            change(gap.recalibrated, gap.before)
        );
    }
    if !others.is_empty() {
        words += &format!(" This log cannot tell it from {}.", others.join(", "));
    }
    words
}

/// Sentences for a log without an effect; `factor` is the scale of the tolerances that the log speaks for, where they are wider
/// than ordinary ones, `adjusted` the numbers within them.
#[must_use]
pub fn none(reduction: &GapReduction, factor: Option<f64>, adjusted: &[Adjustment]) -> String {
    let mut words = match factor {
        None => "Nothing worth naming: the gap is within what ordinary tolerances of the simulator explain."
            .to_owned(),
        Some(factor) => format!(
            "No single cause: many numbers of the vehicle are off, as if of another vehicle, and together they explain the gap. It takes \
             tolerances {factor:.1} times as wide as ordinary ones.{}",
            farthest(adjusted)
        ),
    };
    if let Some(gap) = reduction.open_loop.get("yaw_rate") {
        let adjusted = if gap.recalibrated < gap.before {
            format!("{} rad/s after adjusting within tolerance", short(gap.recalibrated))
        } else {
            "which no adjusting within tolerance makes smaller".to_owned()
        };
        let (before, noise) = (short(gap.before), short(gap.noise));
        words += &format!(" The yaw-rate gap is {before} rad/s, {adjusted}; noise is {noise} rad/s.");
    }
    words
}

/// Numbers that are many tolerances off, those first that the log knows best.
fn farthest(adjusted: &[Adjustment]) -> String {
    let off = |it: &Adjustment| (it.value - it.given).abs();
    let mut far: Vec<&Adjustment> = adjusted.iter().filter(|it| off(it) > FAR * it.tolerance).collect();
    far.sort_by(|a, b| (off(b) * a.deviation).total_cmp(&(off(a) * b.deviation)));
    let of = |it: &&Adjustment| {
        let (unit, tolerances) = (behind(&it.unit), off(it) / it.tolerance);
        format!("{} = {}{unit} ({tolerances:.0} tolerances)", it.parameter, short(it.value))
    };
    let far: Vec<String> = far.iter().take(LISTED_NUMBERS).map(of).collect();
    if far.is_empty() {
        return String::new();
    }
    format!(" Farthest off, the surest first: {}.", far.join(", "))
}

/// Sentence for a cause outside the library; `nearest` are the nearest effects.
#[must_use]
pub fn not_in_library(nearest: &[NamedEffect], why: UnknownSign, reduction: &GapReduction) -> String {
    let mut words = match (why.strained, why.varying) {
        (Some(it), _) => format!(
            "The gap is explained only with {} {:.0} tolerances off ({}{} where {} is expected), which is no tolerance any \
             more, and not to be named.",
            it.parameter,
            (it.value - it.given).abs() / it.tolerance,
            short(it.value),
            behind(&it.unit),
            short(it.given),
        ),
        (None, Some(it)) => format!(
            "Something acts like {}, but its value changes {} (by {}{}, standard deviation): the library has no such effect.",
            it.id,
            it.with.words(),
            short(it.deviation),
            behind(&it.unit),
        ),
        (None, None) if why.swings => {
            "The steering swings after its command, as one with an inertia and a spring does (a \
                                       resonance): no dead time and no lag of the library does that."
                .to_owned()
        }
        (None, None) => {
            "No effect of the library explains the gap whole, nor do two or three together.".to_owned()
        }
    };
    let nearest: Vec<String> = nearest.iter().map(value).collect();
    if !nearest.is_empty() {
        words += &format!(" Nearest come {}.", nearest.join(", "));
    }
    if let Some(gap) = reduction.open_loop.get("yaw_rate") {
        words += &format!(
            " Of the yaw-rate gap of {} rad/s, {} rad/s remain after adjusting{}.",
            short(gap.before),
            short(gap.recalibrated),
            if nearest.is_empty() { "" } else { " with them" }
        );
        if let Some(learnable) = gap.learnable {
            words += &format!(" A learned model would leave {} rad/s.", short(learnable));
        }
    }
    words + " See where it lies, and look there for what the library does not have."
}

/// Advice for an undecided log: the next drive; a search for more than one effect, which was left out.
#[derive(Debug, Clone, Copy)]
pub struct Advice<'a> {
    pub next: Option<&'a Manoeuvre>,
    pub more_than_one: bool,
}

/// Reasons of an undecided log, possible meanings, and advice; `effects` is the most probable set, if it is one.
#[must_use]
pub fn cannot_tell(
    findings: &[Finding],
    straight: bool,
    short_list: &[ReportedHypothesis],
    effects: &[NamedEffect],
    predictive: &Predictive,
    Advice { next, more_than_one }: Advice<'_>,
) -> String {
    let grave = findings.iter().find(|finding| finding.gravity == FindingSeverity::Suspicion);
    if let Some(finding) = grave {
        return format!(
            "This log cannot tell before it is cleared up: {}.",
            finding.summary.trim_end_matches('.')
        );
    }
    if straight {
        return "This log cannot tell: hardly anything is steered in it. Drive turns to both sides at several speeds."
            .to_owned();
    }
    if more_than_one {
        return "This log cannot tell by single effects: one of them explains much, and ordinary tolerances explain the rest only if they are \
                wide. More than one effect is likely; search for pairs of them (leave out --no-pairs)."
            .to_owned();
    }
    let of = |it: &ReportedHypothesis| {
        let what = match (&it.not_in_library, it.effects.is_empty()) {
            (Some(why), _) => format!("something that is not in the library ({why})"),
            (None, true) => "nothing at all".to_owned(),
            (None, false) => it.effects.join(" and "),
        };
        format!("{what} ({:.2})", it.probability)
    };
    let list: Vec<String> = short_list.iter().filter(|it| it.probability >= LISTED).map(of).collect();
    let mut words =
        format!("This log cannot tell. It may be, with these probabilities, {}.", list.join("; "));
    if !effects.is_empty() && !predictive.names(effects.len()) {
        let named: Vec<&str> = effects.iter().map(|it| it.id.as_str()).collect();
        words += &format!(
            " Fitted on one half of the log, {} hardly predicts the other half better than a simulator adjusted without: no cause is \
             named that gains so little.",
            named.join(" and "),
        );
    }
    if let Some(next) = next {
        words += &format!(" What would tell: {}: {}.", next.name, next.how.trim_end_matches('.'));
    }
    words
}

/// Evidence, or a difference of it: a chance of `exp(evidence / 2)` to one; tenths are left out beyond ten.
#[must_use]
pub fn weight(evidence: f64) -> String {
    match evidence.abs() {
        size if size < 0.05 => "0".to_owned(),
        size if size < 9.95 => format!("{evidence:.1}"),
        _ => format!("{evidence:.0}"),
    }
}

/// Meaning of a great likeness between a candidate and the winner.
#[must_use]
pub fn likeness(cosine: Option<f64>) -> String {
    match cosine {
        Some(cosine) if cosine.abs() >= ALIKE => {
            format!("; hard to tell from the best on this log (collinear by {:.2})", cosine.abs())
        }
        _ => String::new(),
    }
}

/// Reason for a candidate's rank.
#[must_use]
pub fn why(evidence: f64, telling: f64, probability: f64, pinned: bool, winner: bool) -> String {
    if winner {
        return "explains the log best".to_owned();
    }
    if evidence < telling {
        let hidden = if pinned { "; the log would hardly show it" } else { "" };
        return format!(
            "explains too little for the odds against it (evidence {} of {}){hidden}",
            weight(evidence.max(0.0)),
            weight(telling)
        );
    }
    match probability {
        p if p >= LISTED => format!("probability {p:.2}"),
        _ => "others explain more, or as much with fewer effects".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adjusted(parameter: &str, value: f64, tolerance: f64, deviation: f64) -> Adjustment {
        let (parameter, unit) = (parameter.to_owned(), "s".to_owned());
        Adjustment { parameter, given: 0.0, value, tolerance, deviation, unit }
    }

    #[test]
    fn ordinary_tolerances_are_called_so_and_wide_ones_are_not() {
        let numbers = [
            adjusted("a.little", 0.02, 0.01, 0.0001),
            adjusted("far.and.unsure", 0.09, 0.01, 0.02),
            adjusted("far.and.sure", 0.048, 0.01, 0.0002),
        ];
        let ordinary = none(&GapReduction::default(), None, &numbers);
        assert!(ordinary.contains("ordinary tolerances of the simulator explain"), "{ordinary}");
        let wide = none(&GapReduction::default(), Some(4.0), &numbers);
        let surest_first = "far.and.sure = 0.048 s (5 tolerances), far.and.unsure = 0.090 s (9 tolerances)";
        assert!(wide.contains("4.0 times") && wide.contains(surest_first), "{wide}");
        assert!(!wide.contains("a.little") && !wide.contains("ordinary tolerances of the"), "{wide}");
    }
}
