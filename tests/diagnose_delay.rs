//! A dead time that was put in is found, with its value and where it enters.

use crate::diagnose;

use diagnose::{found, log, singles};
use rfl_mpc::diagnose::VerdictKind;
use rfl_mpc::vehicle::Stage;

#[test]
fn a_delay_is_found_with_its_value() {
    let diagnosis = found(&log(3, &[("steer_delay", 0.1)]), &singles());
    let verdict = &diagnosis.report.verdict;
    assert_eq!(verdict.kind, VerdictKind::Effect, "{verdict:?}");
    let named = &verdict.effects[0];
    assert_eq!(named.id, "steer_delay", "{named:?}");
    assert!((named.value - 0.1).abs() < 0.015, "{named:?}");
    assert!(named.low < named.value && named.value < named.high);
    assert_eq!(diagnosis.report.stage, Some(Stage::Command));
    let gap = diagnosis.report.gap_reduction.open_loop["yaw_rate"];
    assert!(gap.recalibrated < 0.5 * gap.before, "{gap:?}");
}
