//! How columns are meant is found from the log: a roll of either side, an acceleration in body axes or of a level frame.

use crate::diagnose;

use diagnose::{found, log, singles};
use rfl_mpc::diagnose::{Report, VerdictKind};
use rfl_mpc::log::CleanLog;
use rfl_mpc::vehicle::GRAVITY;

/// The log with `ay` of a level frame: what gravity gives an accelerometer by roll is taken away.
fn level(log: &CleanLog) -> CleanLog {
    let mut other = log.clone();
    let roll = log.columns["roll"].clone();
    let ay = other.columns.get_mut("ay").unwrap();
    ay.iter_mut().zip(roll).for_each(|(ay, roll)| *ay -= GRAVITY * roll.sin());
    other
}

/// The log with the roll to the other side.
fn turned(log: &CleanLog) -> CleanLog {
    let mut other = log.clone();
    other.columns.get_mut("roll").unwrap().iter_mut().for_each(|roll| *roll = -*roll);
    other
}

fn says(report: &Report, signal: &str, words: &str) -> bool {
    report.findings.iter().any(|it| it.signal.as_deref() == Some(signal) && it.words.contains(words))
}

#[test]
fn a_verdict_does_not_hang_on_the_frame_nor_on_the_side_of_roll() {
    for (put_in, kind) in [(&[][..], VerdictKind::None), (&[("steer_gain", 1.15)], VerdictKind::Effect)] {
        let log = log(11, put_in);
        for (given, levelled, other_side) in
            [(log.clone(), false, false), (level(&log), true, false), (turned(&log), false, true)]
        {
            let report = found(&given, &singles()).report;
            assert_eq!(report.verdict.kind, kind, "{levelled} {other_side}: {}", report.verdict.words);
            assert_eq!(says(&report, "ay", "level frame"), levelled, "{:?}", report.findings);
            assert_eq!(says(&report, "roll", "its sign was turned"), other_side, "{:?}", report.findings);
            let named = report.verdict.effects.iter().all(|effect| effect.id == put_in[0].0);
            assert!(named, "{}", report.verdict.words);
        }
    }
}
