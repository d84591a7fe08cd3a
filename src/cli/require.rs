//! Requirements on a drive's figures: `--require max_e1<=0.5` turns a figure into a test, for people and for CI.
//!
//! A requirement is a figure, a relation and a bound. `=` takes the better side: an error is at most that, a share
//! driven at least. A figure that a drive does not have (no step was made) fails every requirement.

use super::output::write_file;
use crate::simulate::{DriveFor, Outcome, TimeMetrics, TrackingMetrics};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// Side of a bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Relation {
    /// `<=`.
    AtMost,
    /// `>=`.
    AtLeast,
}

/// Numbers of a drive.
pub(super) struct Figures {
    pub outcome: Outcome,
    pub tracking: TrackingMetrics,
    pub step: TimeMetrics,
    /// Steps of the controller.
    pub steps: usize,
    /// Time driven, s.
    pub duration: f64,
    /// Share of the road that was driven.
    pub driven: f64,
    pub real_time_factor: f64,
}

impl Figures {
    /// Of a drive that took `wall` seconds on the clock.
    pub fn of<const C: usize>(drive: &DriveFor<C>, sample_time: f64, wall: f64) -> Self {
        let duration = drive.duration();
        Self {
            outcome: drive.ending.outcome,
            tracking: drive.tracking(),
            step: drive.times(sample_time).step,
            steps: drive.step_times.len(),
            duration,
            driven: drive.ending.driven_share(),
            real_time_factor: duration / wall,
        }
    }

    fn error(&self, of: fn(&TrackingMetrics) -> f64) -> f64 {
        if self.tracking.count > 0 { of(&self.tracking) } else { f64::NAN }
    }

    fn time(&self, of: fn(&TimeMetrics) -> f64) -> f64 {
        if self.steps > 0 { of(&self.step) } else { f64::NAN }
    }
}

/// A number that a requirement can name.
struct Figure {
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    better: Relation,
    of: fn(&Figures) -> f64,
}

/// The figure that is a word.
const OUTCOME: &str = "outcome";

/// The figures that are numbers.
const FIGURES: [Figure; 10] = {
    use Relation::{AtLeast, AtMost};
    const fn figure(
        name: &'static str,
        unit: &'static str,
        meaning: &'static str,
        better: Relation,
        of: fn(&Figures) -> f64,
    ) -> Figure {
        Figure { name, unit, meaning, better, of }
    }
    [
        figure("max_e1", "m", "largest lateral error", AtMost, |f| f.error(|e1| e1.max)),
        figure("mean_e1", "m", "mean absolute lateral error", AtMost, |f| f.error(|e1| e1.mae)),
        figure("rms_e1", "m", "root mean square of the lateral error", AtMost, |f| f.error(|e1| e1.rmse)),
        figure("driven", "", "share of the road driven, 1 at its end", AtLeast, |f| f.driven),
        figure("duration", "s", "time driven", AtMost, |f| f.duration),
        figure("mean_step_time", "s", "mean time of a control step", AtMost, |f| f.time(|t| t.mean_s)),
        figure("p99_step_time", "s", "time that 99 % of the steps take at most", AtMost, |f| {
            f.time(|t| t.p99_s)
        }),
        figure("max_step_time", "s", "time of the longest step", AtMost, |f| f.time(|t| t.max_s)),
        figure("missed_steps", "", "steps that took longer than the sample time", AtMost, |f| {
            f.time(|t| t.missed as f64)
        }),
        figure("real_time_factor", "", "time driven for each second of computing", AtLeast, |f| {
            f.real_time_factor
        }),
    ]
};

/// The figures, for the help.
pub(super) fn figures_help() -> String {
    let mut text = String::from("Figures of --require:");
    let outcomes: Vec<_> = Outcome::ALL.iter().map(|outcome| outcome.name()).collect();
    let _ = write!(text, "\n  {OUTCOME:<17} one of {}", outcomes.join(", "));
    for Figure { name, unit, meaning, better, .. } in &FIGURES {
        let unit = if unit.is_empty() { String::new() } else { format!(" in {unit}") };
        let side = if *better == Relation::AtMost { "at most" } else { "at least" };
        let _ = write!(text, "\n  {name:<17} {meaning}{unit}; = means {side}");
    }
    text
}

/// A requirement as given.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Requirement {
    /// As given, without blanks: the name of its test.
    text: String,
    wanted: Wanted,
}

#[derive(Debug, Clone, PartialEq)]
enum Wanted {
    Outcome(Outcome),
    /// Place in [`FIGURES`], relation, bound.
    Number(usize, Relation, f64),
}

impl std::str::FromStr for Requirement {
    type Err = String;

    fn from_str(given: &str) -> Result<Self, String> {
        let text: String = given.chars().filter(|c| !c.is_whitespace()).collect();
        let sign = ["<=", ">=", "="].into_iter().find(|sign| text.contains(sign));
        let parts = sign.and_then(|sign| Some((sign, text.split_once(sign)?)));
        let Some((sign, (name, value))) = parts else {
            return Err("write it as FIGURE<=VALUE, FIGURE>=VALUE or FIGURE=VALUE".to_owned());
        };
        if name == OUTCOME {
            let found = Outcome::ALL.iter().find(|outcome| outcome.name() == value && sign == "=");
            let names: Vec<_> = Outcome::ALL.iter().map(|outcome| outcome.name()).collect();
            let outcome =
                *found.ok_or_else(|| format!("write {OUTCOME}= and one of {}", names.join(", ")))?;
            return Ok(Self { text, wanted: Wanted::Outcome(outcome) });
        }
        let place = FIGURES.iter().position(|figure| figure.name == name).ok_or_else(|| {
            let names: Vec<_> = FIGURES.iter().map(|figure| figure.name).collect();
            format!("there is no figure '{name}'; there are {OUTCOME}, {}", names.join(", "))
        })?;
        let bound = value.parse().ok().filter(|bound: &f64| bound.is_finite());
        let bound = bound.ok_or_else(|| format!("'{value}' is not a number"))?;
        let relation = match sign {
            "<=" => Relation::AtMost,
            ">=" => Relation::AtLeast,
            _ => FIGURES[place].better,
        };
        Ok(Self { text, wanted: Wanted::Number(place, relation, bound) })
    }
}

/// What a test that is not met says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CheckKind {
    /// A drive that is not as required.
    Requirement,
    /// No drive.
    Error,
}

/// A test and how it went.
pub(super) struct Check {
    pub name: String,
    pub met: bool,
    pub kind: CheckKind,
    /// Figure found, and requirement.
    pub words: String,
}

impl Check {
    /// The outcome of a drive that could not be made.
    pub fn error(words: String) -> Self {
        Self { name: OUTCOME.to_owned(), met: false, kind: CheckKind::Error, words }
    }
}

impl Requirement {
    /// True if it asks for this outcome.
    pub fn asks_for(&self, outcome: Outcome) -> bool {
        self.wanted == Wanted::Outcome(outcome)
    }

    /// Checks a drive.
    pub fn check(&self, figures: &Figures) -> Check {
        let (met, words) = match self.wanted {
            Wanted::Outcome(outcome) => (
                figures.outcome == outcome,
                format!("{OUTCOME} is {}, {} is required", figures.outcome.name(), outcome.name()),
            ),
            Wanted::Number(place, relation, bound) => {
                let Figure { name, unit, of, .. } = &FIGURES[place];
                let value = of(figures);
                let (met, side) = match relation {
                    Relation::AtMost => (value <= bound, "at most"),
                    Relation::AtLeast => (value >= bound, "at least"),
                };
                let found = if value.is_nan() { "not known".to_owned() } else { format!("{}", short(value)) };
                (
                    met,
                    format!("{name} is {found}, {side} {bound} is required")
                        .replace(" is required", &with(unit)),
                )
            }
        };
        Check { name: self.text.clone(), met, kind: CheckKind::Requirement, words }
    }
}

/// The end of a sentence on a bound with this unit.
fn with(unit: &str) -> String {
    if unit.is_empty() { " is required".to_owned() } else { format!(" {unit} is required") }
}

/// A number to five digits.
fn short(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

/// A text with a replacement for each character that XML 1.0 does not allow.
fn xml_text(text: &str) -> String {
    let allowed = |c: char| matches!(c, '\t' | '\n' | '\r' | ' '..='\u{fffd}' | '\u{10000}'..);
    text.chars().map(|c| if allowed(c) { c } else { char::REPLACEMENT_CHARACTER }).collect()
}

/// Writes checks as a JUnit file, one test case each.
///
/// # Errors
/// A file that cannot be written.
pub(super) fn write_junit(
    file: &Path,
    suite: &str,
    class: &str,
    time: f64,
    checks: &[Check],
) -> Result<(), Box<dyn Error>> {
    let count = checks.len().to_string();
    let missed = |kind| checks.iter().filter(|check| !check.met && check.kind == kind).count().to_string();
    let (failures, errors) = (missed(CheckKind::Requirement), missed(CheckKind::Error));
    let time = format!("{time:.3}");
    let totals = [("tests", &*count), ("failures", &*failures), ("errors", &*errors), ("time", &*time)];
    let class = xml_text(class);
    write_file(file, |to| {
        let mut xml = Writer::new_with_indent(to, b' ', 2);
        xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        xml.create_element("testsuites").with_attributes(totals).write_inner_content(|xml| {
            let suites =
                xml.create_element("testsuite").with_attribute(("name", suite)).with_attributes(totals);
            suites.write_inner_content(|xml| {
                for Check { name, met, kind, words } in checks {
                    let (name, words) = (xml_text(name), xml_text(words));
                    let (element, kind) = match kind {
                        CheckKind::Requirement => ("failure", "requirement"),
                        CheckKind::Error => ("error", "error"),
                    };
                    let case = xml
                        .create_element("testcase")
                        .with_attributes([("classname", &*class), ("name", &*name)]);
                    let case = case.with_attribute(("time", "0"));
                    if *met {
                        case.write_inner_content(|xml| {
                            let out = xml.create_element("system-out");
                            out.write_text_content(BytesText::new(&words)).map(|_| ())
                        })?;
                    } else {
                        case.write_inner_content(|xml| {
                            let failure = xml.create_element(element);
                            let attributes = [("type", kind), ("message", &*words)];
                            failure
                                .with_attributes(attributes)
                                .write_text_content(BytesText::new(&words))
                                .map(|_| ())
                        })?;
                    }
                }
                Ok(())
            })?;
            Ok(())
        })?;
        xml.into_inner().write_all(b"\n")?;
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures() -> Figures {
        Figures {
            outcome: Outcome::Completed,
            tracking: TrackingMetrics { mae: 0.01, rmse: 0.02, max: 0.5, count: 10 },
            step: TimeMetrics { p99_s: 3e-4, ..TimeMetrics::default() },
            steps: 10,
            duration: 60.0,
            driven: 1.0,
            real_time_factor: 200.0,
        }
    }

    fn met(text: &str, figures: &Figures) -> bool {
        text.parse::<Requirement>().unwrap().check(figures).met
    }

    #[test]
    fn figures_are_required_from_the_better_side() {
        let figures = figures();
        for text in [
            "max_e1=0.5",
            "max_e1 <= 0.5",
            "outcome=completed",
            "driven=0.9",
            "p99_step_time<=3e-4",
            "duration>=10",
        ] {
            assert!(met(text, &figures), "{text}");
        }
        for text in ["max_e1=0.49", "max_e1>=0.6", "outcome=lost", "real_time_factor=300"] {
            assert!(!met(text, &figures), "{text}");
        }
        let check = "max_e1=0.49".parse::<Requirement>().unwrap().check(&figures);
        assert_eq!(check.words, "max_e1 is 0.5, at most 0.49 m is required");
        // A drive without a step meets nothing.
        let none = Figures { tracking: TrackingMetrics::default(), steps: 0, ..figures };
        assert!(!met("max_e1=0.5", &none) && !met("missed_steps=0", &none));
    }

    #[test]
    fn a_junit_file_is_well_formed_whatever_a_name_has() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("drive.xml");
        let check = Check::error("no \u{1b}[31mroad\u{0} <&> \u{ffff}\u{1f600}".to_owned());
        write_junit(&file, "rfl drive", "a\u{7}b", 0.0, &[check]).unwrap();
        let xml = std::fs::read_to_string(&file).unwrap();
        assert!(xml.contains("failures=\"0\" errors=\"1\"") && xml.contains("<error type"), "{xml}");
        assert!(xml.contains("a\u{fffd}b") && xml.contains("\u{1f600}"), "{xml}");
        assert!(!xml.contains(['\u{0}', '\u{7}', '\u{1b}', '\u{ffff}']), "{xml}");
    }

    #[test]
    fn what_is_no_requirement_is_refused_with_the_list() {
        for (text, words) in [
            ("max_e1", "FIGURE<=VALUE"),
            ("max_e7=1", "there is no figure 'max_e7'; there are outcome, max_e1, mean_e1"),
            ("max_e1=small", "'small' is not a number"),
            ("max_e1=nan", "'nan' is not a number"),
            ("outcome=won", "timed_out, completed"),
            ("outcome<=completed", "outcome="),
        ] {
            let error = text.parse::<Requirement>().unwrap_err();
            assert!(error.contains(words), "{error}");
        }
        let help = figures_help();
        assert!(FIGURES.iter().all(|figure| help.contains(figure.name)));
    }
}
