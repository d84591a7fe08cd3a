//! Two effects at once are both found, and three are.

mod diagnose;

use diagnose::{found, log};
use rfl_mpc::diagnose::{Options, VerdictKind};

fn all_are_found(seed: u64, put_in: &[(&str, f64)]) {
    let log = log(seed, put_in);
    let verdict = found(&log, &Options::default()).report.verdict;
    assert_eq!(verdict.kind, VerdictKind::Effect, "{verdict:?}");
    let mut names: Vec<&str> = verdict.effects.iter().map(|effect| effect.id.as_str()).collect();
    names.sort_unstable();
    let expected: Vec<&str> = put_in.iter().map(|(id, _)| *id).collect();
    assert_eq!(names, expected, "{verdict:?}");
    assert!(verdict.effects.windows(2).all(|two| two[0].dominance >= two[1].dominance), "{verdict:?}");
}

#[test]
fn a_pair_is_found() {
    all_are_found(9, &[("steer_delay", 0.12), ("steer_offset", 0.02)]);
}

#[test]
fn three_are_found() {
    all_are_found(9, &[("lateral_accel_bias", 0.5), ("steer_delay", 0.12), ("steer_offset", 0.02)]);
}

/// Far from the vehicle as given, where slopes taken there tell little.
#[test]
fn a_pair_far_off_is_found() {
    all_are_found(9, &[("payload", 300.0), ("road_friction", 0.45)]);
}
