//! Two effects at once are both found.

mod diagnose;

use diagnose::{found, log};
use rfl_mpc::diagnose::{Options, VerdictKind};

#[test]
fn a_pair_is_found() {
    let log = log(9, &[("steer_delay", 0.12), ("steer_offset", 0.02)]);
    let verdict = found(&log, &Options::default()).report.verdict;
    assert_eq!(verdict.kind, VerdictKind::Effect, "{verdict:?}");
    let mut names: Vec<&str> = verdict.effects.iter().map(|effect| effect.id.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["steer_delay", "steer_offset"], "{verdict:?}");
}
