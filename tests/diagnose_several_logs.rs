//! Several logs as one: what one ends with says nothing of how the next begins.

use crate::diagnose;

use diagnose::{found, log, singles};
use rfl_mpc::diagnose::VerdictKind;
use rfl_mpc::log::CleanLog;
use std::collections::BTreeMap;

/// Rows of a log as a log of its own, driven elsewhere.
fn part(log: &CleanLog, rows: std::ops::Range<usize>, elsewhere: f64) -> CleanLog {
    let moved = |name: &str| if matches!(name, "x" | "y") { elsewhere } else { 0.0 };
    CleanLog {
        time: log.time[rows.clone()].to_vec(),
        valid: log.valid[rows.clone()].to_vec(),
        columns: log
            .columns
            .iter()
            .map(|(&name, column)| {
                (name, column[rows.clone()].iter().map(|value| value + moved(name)).collect())
            })
            .collect(),
        coarse: log.coarse.clone(),
        findings: Vec::new(),
        ..log.clone()
    }
}

/// The same log on twice its clock.
fn doubled(log: &CleanLog) -> CleanLog {
    let between = |column: &[f64]| -> Vec<f64> {
        column.windows(2).flat_map(|pair| [pair[0], 0.5 * (pair[0] + pair[1])]).collect()
    };
    CleanLog {
        step: 0.5 * log.step,
        time: between(&log.time),
        valid: vec![true; 2 * (log.time.len() - 1)],
        columns: log.columns.iter().map(|(&name, column)| (name, between(column))).collect(),
        ..log.clone()
    }
}

/// RMS of the gap before anything is fitted, by signal.
fn gaps(log: &CleanLog) -> BTreeMap<String, f64> {
    let report = found(log, &singles()).report;
    assert_eq!(report.verdict.kind, VerdictKind::None, "{:?}", report.verdict);
    report.gap_reduction.open_loop.into_iter().map(|(signal, gap)| (signal, gap.before)).collect()
}

#[test]
fn the_gap_of_two_logs_is_that_of_each() {
    let whole = log(11, &[]);
    for whole in [doubled(&whole), whole] {
        let rows = whole.time.len();
        // An odd number of rows, then a jump in place and speed.
        let (one, two) =
            (part(&whole, 0..rows * 2 / 5 / 2 * 2 + 1, 0.0), part(&whole, rows * 3 / 5..rows, 1000.0));
        let named = [("one.csv", &one), ("two.csv", &two)].map(|(name, log)| (name.to_owned(), log.clone()));
        let both = gaps(&CleanLog::joined(named.to_vec()).unwrap().unwrap());
        let (one, two) = (gaps(&one), gaps(&two));
        for (signal, gap) in both {
            let greater = one[&signal].max(two[&signal]);
            assert!(gap < 1.02 * greater, "{signal} at {} s: {gap}, {greater} alone", whole.step);
        }
    }
}
