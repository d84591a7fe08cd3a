//! A verdict in one line.

use super::report::{NamedEffect, ReportedHypothesis, Verdict, VerdictKind};

/// Number of possible causes in the line.
const SHOWN: usize = 3;

impl VerdictKind {
    /// As `report.json` writes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Effect => "effect",
            Self::None => "none",
            Self::NotInLibrary => "not_in_library",
            Self::CannotTell => "cannot_tell",
        }
    }
}

impl Verdict {
    /// The verdict in one line, e.g. `effect: steer_delay = 0.12 s (0.11 to 0.13), probability 0.93`.
    #[must_use]
    pub fn headline(&self) -> String {
        let what = match self.kind {
            VerdictKind::Effect => self.effects.iter().map(value).collect::<Vec<_>>().join(" and "),
            VerdictKind::None => match self.tolerance_factor {
                None => "nothing worth naming separates the log from the simulator".into(),
                Some(factor) => {
                    format!(
                        "no effect, but the vehicle's numbers are off as by tolerances {factor:.1} times as wide as ordinary ones"
                    )
                }
            },
            VerdictKind::NotInLibrary => "something separates them that is no effect of the library".into(),
            VerdictKind::CannotTell => return self.undecided(),
        };
        format!("{}: {what}, probability {:.2}", self.kind.name(), self.probability)
    }

    /// The likeliest causes, for none of them is the verdict.
    fn undecided(&self) -> String {
        let list: Vec<String> = self.short_list.iter().take(SHOWN).map(possible).collect();
        let may_be = if list.is_empty() { String::new() } else { format!(": perhaps {}", list.join(", ")) };
        format!("{}: this log does not tell{may_be}", self.kind.name())
    }
}

/// A possible cause with its probability.
fn possible(it: &ReportedHypothesis) -> String {
    let what = match (&it.not_in_library, it.effects.is_empty()) {
        (Some(_), _) => "a cause outside the library".to_owned(),
        (None, true) => "nothing".to_owned(),
        (None, false) => it.effects.join(" with "),
    };
    format!("{what} {:.2}", it.probability)
}

/// A unit in its form after a number.
pub(super) fn behind(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {unit}") }
}

/// An effect with its value and interval.
pub(super) fn value(effect: &NamedEffect) -> String {
    let NamedEffect { id, value, low, high, unit, .. } = effect;
    let width = (high - low).abs().max(1e-3 * value.abs());
    // As many decimals as the interval is worth.
    let decimals = if width > 0.0 && width.is_finite() {
        (1.0 - width.log10().floor()).clamp(0.0, 9.0) as usize
    } else {
        3
    };
    let unit = behind(unit);
    format!("{id} = {value:.decimals$}{unit} ({low:.decimals$} to {high:.decimals$})")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Stage;

    #[test]
    fn a_log_that_does_not_tell_has_possible_causes_and_no_probability() {
        let cause = |effects: &[&str], probability| ReportedHypothesis {
            effects: effects.iter().map(|&it| it.to_owned()).collect(),
            not_in_library: None,
            terms: Vec::new(),
            probability,
        };
        let mut verdict = Verdict {
            kind: VerdictKind::CannotTell,
            probability: 0.48,
            effects: Vec::new(),
            nearest: Vec::new(),
            tolerance_factor: None,
            short_list: vec![cause(&[], 0.48), cause(&["cg_shift", "payload"], 0.31)],
            varying: None,
            strained: None,
            summary: String::new(),
        };
        let line = verdict.headline();
        assert_eq!(
            line,
            "cannot_tell: this log does not tell: perhaps nothing 0.48, cg_shift with payload 0.31"
        );
        (verdict.kind, verdict.tolerance_factor) = (VerdictKind::None, Some(4.0));
        let line = verdict.headline();
        assert!(line.starts_with("none: no effect, but") && line.contains(" 4.0 times"), "{line}");
        (verdict.kind, verdict.tolerance_factor) = (VerdictKind::CannotTell, None);
        verdict.short_list.clear();
        assert_eq!(verdict.headline(), "cannot_tell: this log does not tell");
    }

    #[test]
    fn values_have_as_many_digits_as_they_are_sure() {
        let effect = |value, low, high, unit: &str| NamedEffect {
            id: "an_effect".into(),
            meaning: String::new(),
            value,
            low,
            high,
            unit: unit.into(),
            class: vec!["an_effect".into()],
            separated_by: String::new(),
            stage: Stage::Command,
            dominance: 1.0,
            total: value,
            direction: None,
            components: std::collections::BTreeMap::new(),
        };
        assert_eq!(super::value(&effect(0.1203, 0.111, 0.129, "s")), "an_effect = 0.120 s (0.111 to 0.129)");
        assert_eq!(super::value(&effect(312.4, 250.0, 370.0, "kg")), "an_effect = 312 kg (250 to 370)");
        assert_eq!(super::value(&effect(0.6, 0.54, 0.66, "1")), "an_effect = 0.60 (0.54 to 0.66)");
        assert!(super::value(&effect(0.0, 0.0, 0.0, "s")).contains("0.000"));
    }
}
