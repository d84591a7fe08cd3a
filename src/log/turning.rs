//! Yaw and yaw rate: radians, and a yaw without steps of a whole turn.

use super::agreement::{self, Factors};
use super::finding::{Finding, FindingSeverity};
use super::rows::LogColumns;
use super::units::DEGREE;

/// Yaw and yaw rate in radians, yaw continuous: before any row is interpolated.
pub(super) fn mend(
    time: &[f64],
    columns: &mut LogColumns,
    factors: &mut Factors,
    findings: &mut Vec<Finding>,
) {
    let mut multiply = |columns: &mut LogColumns, name: &'static str, by: f64, why: &str, unit: &str| {
        *factors.entry(name).or_insert(1.0) *= by;
        if let Some(column) = columns.get_mut(name) {
            column.iter_mut().for_each(|value| *value *= by);
        }
        let taken = if by < 1.0 {
            format!("was taken as {unit} and converted to radians")
        } else {
            "was radians already, though the file names degrees or was converted twice; taken as radians"
                .to_owned()
        };
        findings.push(Finding::new(FindingSeverity::Warning, Some(name), format!("{why}: {name} {taken}")));
    };
    if !columns.contains_key("yaw_rate") {
        return;
    }
    if agreement::impossible_yaw_rate(&columns["vx"], &columns["yaw_rate"]) {
        multiply(columns, "yaw_rate", DEGREE, "no vehicle turns as fast as yaw_rate says", "degrees");
    }
    let Some(yaw) = columns.get("yaw") else { return };
    let factor = agreement::turn_factor(time, yaw, &columns["yaw_rate"]).map_or(1.0, f64::abs);
    for (unit, named) in [(DEGREE, "degrees"), (0.01 * DEGREE, "hundredths of a degree")] {
        let (small, large) = (agreement::near(factor * unit, 1.0), agreement::near(factor / unit, 1.0));
        let (by, why) = match (small, large) {
            (true, _) => (unit, format!("yaw changes {:.0} times as fast as yaw_rate says", unit.recip())),
            (_, true) => (unit.recip(), format!("yaw_rate is {:.0} times the change of yaw", unit.recip())),
            _ => continue,
        };
        if agreement::is_yaw_rate_wrong(columns, by.recip()) {
            multiply(columns, "yaw_rate", by.recip(), &why, named);
        } else {
            multiply(columns, "yaw", by, &why, named);
        }
    }
    let (mut turns, mut last, mut wraps) = (0.0, f64::NAN, 0_usize);
    for yaw in columns.get_mut("yaw").into_iter().flatten().filter(|yaw| yaw.is_finite()) {
        *yaw += turns * std::f64::consts::TAU;
        let jump = ((*yaw - last) / std::f64::consts::TAU).round();
        if jump.is_finite() && jump != 0.0 {
            turns -= jump;
            wraps += 1;
            *yaw -= jump * std::f64::consts::TAU;
        }
        last = *yaw;
    }
    if wraps > 0 {
        findings.push(Finding::new(FindingSeverity::Note, Some("yaw"), "yaw wraps; it was made continuous"));
    }
}
