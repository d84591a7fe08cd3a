//! Two effects at once are both found, and three are.

use crate::diagnose;

use diagnose::{found, log, only};
use rfl_mpc::diagnose::simulated::{Conditions, drive};
use rfl_mpc::diagnose::{Options, Verdict, VerdictKind, diagnose as diagnosed};
use rfl_mpc::vehicle::builtin_truck;

fn all_are_found(seed: u64, put_in: &[(&str, f64)]) {
    are_named(put_in, &found(&log(seed, put_in), &Options::default()).report.verdict);
}

fn are_named(put_in: &[(&str, f64)], verdict: &Verdict) {
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

/// Where two effects are at work and one only is looked for, nothing is no answer.
#[test]
fn without_pairs_two_effects_are_not_nothing() {
    let mut log = log(9, &[("steer_gain", 1.12)]);
    let steer = log.columns.get_mut("steer").unwrap();
    (0..steer.len()).rev().for_each(|row| steer[row] = steer[row.saturating_sub(5)]);
    let verdict = found(&log, &diagnose::singles()).report.verdict;
    assert_ne!(verdict.kind, VerdictKind::None, "{verdict:?}");
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

/// The trailer's mass takes the place of its load, as far off as no tolerance is.
#[test]
fn a_load_that_a_mass_hides_is_found() {
    let truck = builtin_truck("truck_simulation").unwrap();
    let put_in = [("steer_backlash", 0.028), ("trailer_payload", 10_000.0)];
    let conditions = Conditions {
        seed: 9,
        duration: 40.0,
        step: 0.02,
        speed: (8.0, 20.0),
        lateral: 2.0,
        ..Conditions::default()
    };
    let log = drive(&truck, &only(&put_in), &conditions).unwrap();
    let verdict = diagnosed(&log, None, &truck, &Options::default(), &|_, _| {}).unwrap().report.verdict;
    are_named(&put_in, &verdict);
}
