//! Logs with an effect put in, as the tests of the diagnosis need them.
#![allow(dead_code)]

use rfl_mpc::diagnose::simulated::{Conditions, drive};
use rfl_mpc::diagnose::{Diagnosis, Options, diagnose};
use rfl_mpc::log::{CleanLog, DriveLog, Finding, FindingSeverity, UnusableLog};
use rfl_mpc::vehicle::{CarParameters, TruckEffects, builtin};
use std::collections::BTreeMap;
use std::path::Path;

/// The default car.
pub fn car() -> CarParameters {
    builtin("c_class").expect("built in")
}

/// No effects but these.
pub fn only(put_in: &[(&str, f64)]) -> TruckEffects {
    let mut effects = TruckEffects::default();
    for &(id, value) in put_in {
        *effects.get_mut(id).expect("an effect") = value;
    }
    effects
}

/// Half a minute of driving with an ordinary background.
pub fn log(seed: u64, put_in: &[(&str, f64)]) -> CleanLog {
    let conditions = Conditions { seed, duration: 40.0, step: 0.02, ..Conditions::default() };
    drive(&car(), &only(put_in), &conditions).expect("an ordinary drive")
}

/// The diagnosis of a log of the default car, which names no effect at its neutral value.
pub fn found(log: &CleanLog, options: &Options) -> Diagnosis {
    let diagnosis = diagnose(log, None, &car(), options, &|_, _| {}).expect("a clean log");
    for named in &diagnosis.report.verdict.effects {
        let effect = TruckEffects::all().find(|effect| effect.id == named.id).expect("an effect");
        assert_ne!(named.value, effect.neutral, "{} is named at its neutral value", named.id);
    }
    diagnosis
}

/// Singles only: quick.
pub fn singles() -> Options {
    Options { pairs: false, ..Options::default() }
}

/// A clean log of these columns, 50 rows a second.
pub fn clean(columns: BTreeMap<&'static str, Vec<f64>>) -> CleanLog {
    CleanLog::of_columns(0.02, columns)
}

/// Columns of a log, for a change of one's own.
pub type Columns = BTreeMap<&'static str, Vec<f64>>;

/// The columns of [`log`] as a recorder would write them.
pub fn columns(seed: u64, put_in: &[(&str, f64)]) -> Columns {
    let mut log = log(seed, put_in);
    log.columns.insert("time", log.time);
    log.columns
}

/// The clean log of columns as they are in a file.
pub fn cleaned(columns: Columns) -> Result<CleanLog, UnusableLog> {
    let columns = columns.into_iter().map(|(name, values)| (name.to_owned(), values)).collect();
    let log = DriveLog::from_columns(Path::new("log.csv"), columns).unwrap();
    CleanLog::of_vehicle(&log, &|speed| 2.7 + 0.002 * speed * speed, car().vehicle.cg_to_rear_axle)
}

/// Words about a column, of this gravity and above.
pub fn said(findings: &[Finding], column: &str, least: FindingSeverity) -> String {
    let of = findings.iter().filter(|it| it.gravity >= least && it.signal.as_deref() == Some(column));
    of.map(|finding| finding.summary.as_str()).collect::<Vec<_>>().join("; ")
}
