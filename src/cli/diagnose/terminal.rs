//! The answer on a terminal: verdict, candidates, shrinkage, findings in the log.

use crate::diagnose::{FindingSeverity, Report};

/// Candidates that are listed.
const SHOWN: usize = 5;

/// Prints the answer.
pub(super) fn print(report: &Report) {
    say!("{}", report.verdict.headline());
    say!("{}", report.verdict.summary);
    if !report.candidates.is_empty() {
        say!("\n{:<44} {:>10}  why", "candidate", "evidence");
        for candidate in report.candidates.iter().take(SHOWN) {
            let values = candidate.effects.iter().zip(&candidate.values);
            let named: Vec<String> = values.map(|(id, value)| format!("{id} = {}", short(*value))).collect();
            say!("{:<44} {:>10.1}  {}", named.join(" and "), candidate.evidence, candidate.why);
        }
    }
    let reduction = &report.gap_reduction;
    if !reduction.open_loop.is_empty() {
        say!(
            "\n{:<16} {:>10} {:>10} {:>12} {:>10} {:>10}",
            "RMS of the gap",
            "before",
            "effect",
            "recalibrated",
            "learnable",
            "noise"
        );
        let closed = reduction.closed_loop.iter().flatten();
        for (name, gap) in reduction.open_loop.iter().chain(closed) {
            let [before, effect, recalibrated, noise] =
                [gap.before, gap.effect, gap.recalibrated, gap.noise].map(short);
            let learnable = gap.learnable.map_or("-".to_owned(), short);
            say!("{name:<16} {before:>10} {effect:>10} {recalibrated:>12} {learnable:>10} {noise:>10}");
        }
    }
    let grave = report.findings.iter().filter(|finding| finding.gravity > FindingSeverity::Note);
    for finding in grave {
        let column = finding.signal.as_deref().map_or(String::new(), |signal| format!("{signal}: "));
        let word = if finding.gravity == FindingSeverity::Suspicion { "suspicion" } else { "warning" };
        say!("{word}: {column}{}", finding.summary);
    }
    if let Some(next) = &report.next_manoeuvre {
        say!("next drive: {}: {}; {}", next.name, next.how, next.also);
    }
}

/// A number with three significant digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let decimals = (2.0 - value.abs().log10().floor()).clamp(0.0, 7.0);
    if value.abs() < 1e-5 { format!("{value:.1e}") } else { format!("{value:.*}", decimals as usize) }
}
