//! Logs that cannot be diagnosed give a clear message or an honest "cannot tell", never a panic.

use crate::diagnose;

use diagnose::{car, clean, found, log, singles};
use rfl_mpc::diagnose::{DiagnoseError, Finding, FindingSeverity, Options, VerdictKind, diagnose as run};
use rfl_mpc::log::CleanLog;
use std::collections::BTreeMap;

fn short(log: &CleanLog, rows: usize) -> CleanLog {
    let mut short = log.clone();
    short.time.truncate(rows);
    short.valid.truncate(rows);
    short.columns.values_mut().for_each(|column| column.truncate(rows));
    short
}

#[test]
fn few_rows_cannot_tell() {
    let log = log(1, &[]);
    for rows in [0, 1, 2, 40, 150] {
        let verdict = found(&short(&log, rows), &singles()).report.verdict;
        assert_eq!(verdict.kind, VerdictKind::CannotTell, "{rows} rows");
        assert!(verdict.summary.contains("longer"), "{}", verdict.summary);
    }
}

#[test]
fn columns_that_are_missing_or_broken_are_named() {
    let log = short(&log(1, &[]), 100);
    let fails =
        |log: &CleanLog| run(log, None, &car(), &Options::default(), &|_, _| {}).expect_err("a broken log");
    let mut without = log.clone();
    without.columns.remove("yaw_rate");
    assert!(matches!(fails(&without), DiagnoseError::Missing { column: "yaw_rate" }));
    let mut broken = log.clone();
    broken.columns.get_mut("vx").expect("there")[7] = f64::NAN;
    assert!(matches!(fails(&broken), DiagnoseError::NotFinite { column: "vx", .. }));
    let mut ragged = log.clone();
    ragged.columns.get_mut("ay").expect("there").pop();
    assert!(matches!(fails(&ragged), DiagnoseError::Length { column: "ay", .. }));
    let slow = CleanLog { step: 1.0, ..log.clone() };
    assert!(matches!(fails(&slow), DiagnoseError::Clock { .. }));
    let options = Options { without: vec!["no_such".to_owned()], ..Options::default() };
    assert!(matches!(
        run(&log, None, &car(), &options, &|_, _| {}),
        Err(DiagnoseError::UnknownEffect { .. })
    ));
}

#[test]
fn a_standing_vehicle_cannot_tell() {
    let rows = 2000;
    let columns: BTreeMap<&'static str, Vec<f64>> =
        ["steer_cmd", "vx", "yaw_rate"].into_iter().map(|name| (name, vec![0.0; rows])).collect();
    assert_eq!(found(&clean(columns), &singles()).report.verdict.kind, VerdictKind::CannotTell);
}

#[test]
fn a_suspicious_log_names_nothing() {
    let mut log = log(3, &[("steer_delay", 0.15)]);
    let words = "yaw_rate has its sign turned".to_owned();
    log.findings.push(Finding {
        gravity: FindingSeverity::Suspicion,
        signal: Some("yaw_rate".to_owned()),
        summary: words,
    });
    let verdict = found(&log, &singles()).report.verdict;
    assert_eq!(verdict.kind, VerdictKind::CannotTell);
    assert!(verdict.effects.is_empty() && verdict.summary.contains("sign turned"));
}
