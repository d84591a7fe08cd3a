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

/// The log with what a satellite receiver gives late by so many rows.
fn late(log: &CleanLog, rows: usize) -> CleanLog {
    let mut other = log.clone();
    for name in ["x", "y", "yaw", "vx", "vy"] {
        let column = &log.columns[name];
        let before = |row: usize| column[row.saturating_sub(rows)];
        other.columns.insert(name, (0..column.len()).map(before).collect());
    }
    other
}

/// The log with place and velocity of the road's point below the CG, in place of a point so much higher.
fn lower(log: &CleanLog, height: f64) -> CleanLog {
    let mut other = log.clone();
    let (roll, yaw) = (&log.columns["roll"], &log.columns["yaw"]);
    let count = roll.len();
    let rate = |i: usize| (roll[(i + 1).min(count - 1)] - roll[i.saturating_sub(1)]) / (2.0 * log.step);
    for i in 0..count {
        let (sin, cos) = yaw[i].sin_cos();
        // A point above leans to the right with a roll to the right.
        let aside = height * roll[i];
        other.columns.get_mut("vy").unwrap()[i] += height * rate(i);
        other.columns.get_mut("x").unwrap()[i] -= aside * sin;
        other.columns.get_mut("y").unwrap()[i] += aside * cos;
    }
    other
}

fn says(report: &Report, signal: &str, words: &str) -> bool {
    report.findings.iter().any(|it| it.signal.as_deref() == Some(signal) && it.summary.contains(words))
}

#[test]
fn a_verdict_does_not_hang_on_the_frame_nor_on_the_side_of_roll() {
    for (put_in, kind) in [(&[][..], VerdictKind::None), (&[("steer_gain", 1.15)], VerdictKind::Effect)] {
        let log = log(11, put_in);
        for (given, levelled, other_side) in
            [(log.clone(), false, false), (level(&log), true, false), (turned(&log), false, true)]
        {
            let report = found(&given, &singles()).report;
            assert_eq!(report.verdict.kind, kind, "{levelled} {other_side}: {}", report.verdict.summary);
            assert_eq!(says(&report, "ay", "level frame"), levelled, "{:?}", report.findings);
            assert_eq!(says(&report, "roll", "its sign was turned"), other_side, "{:?}", report.findings);
            let named = report.verdict.effects.iter().all(|effect| effect.id == put_in[0].0);
            assert!(named, "{}", report.verdict.summary);
        }
    }
}

#[test]
fn neither_a_late_receiver_nor_another_point_of_the_body_is_a_cause() {
    for (put_in, kind) in [(&[][..], VerdictKind::None), (&[("steer_gain", 1.15)], VerdictKind::Effect)] {
        let log = log(11, put_in);
        for (what, given) in
            [("late", late(&log, 3)), ("lower", lower(&log, 0.5)), ("higher", lower(&log, -0.3))]
        {
            let report = found(&given, &singles()).report;
            assert_eq!(report.verdict.kind, kind, "{what}: {}", report.verdict.summary);
            let named = report.verdict.effects.iter().all(|effect| effect.id == put_in[0].0);
            assert!(named, "{what}: {}", report.verdict.summary);
        }
    }
}
