//! What may not be named keeps its tolerance, and what needs many of them is no effect of the library.

use crate::diagnose;

use diagnose::{car, found, log, singles};
use rfl_mpc::diagnose::{Options, Report, VerdictKind, diagnose as diagnosed};

fn without(effect: &str, put_in: &[(&str, f64)]) -> Report {
    found(&log(3, put_in), &Options { without: vec![effect.to_owned()], ..singles() }).report
}

#[test]
fn an_effect_that_is_left_out_is_not_named() {
    let report = without("steer_delay", &[("steer_delay", 0.12)]);
    assert!(report.candidates.iter().all(|candidate| !candidate.effects.contains(&"steer_delay".to_owned())));
    let seen = report.observability.iter().find(|it| it.effect == "steer_delay").unwrap();
    assert!(!seen.observable && seen.why.contains("left out"), "{seen:?}");
}

#[test]
fn a_cause_that_is_left_out_is_not_taken_for_another() {
    for (effect, value) in [("steer_gain", 1.2), ("speed_scale", 1.1), ("yaw_rate_bias", 0.03)] {
        let report = without(effect, &[(effect, value)]);
        let verdict = report.verdict;
        assert_eq!(verdict.kind, VerdictKind::NotInLibrary, "{}", verdict.summary);
        let strained = verdict.strained.expect("what is far off");
        assert_eq!(strained.parameter, format!("effect.{effect}"), "{}", verdict.summary);
        // All tolerances bear a part of it.
        let part = (strained.value - strained.given) / (value - strained.given);
        assert!((0.3..1.2).contains(&part), "{part}: {}", verdict.summary);
        assert!(
            verdict.summary.contains(effect) && verdict.summary.contains("tolerances off"),
            "{}",
            verdict.summary
        );
    }
}

#[test]
fn a_tolerance_is_no_cause() {
    let report = without("steer_gain", &[("steer_gain", 1.01)]);
    assert_eq!(report.verdict.kind, VerdictKind::None, "{}", report.verdict.summary);
    assert!(report.verdict.strained.is_none());
}

#[test]
fn a_mass_that_is_left_out_is_no_gain_of_the_drive() {
    let verdict = without("payload", &[("payload", 400.0)]).verdict;
    assert_eq!(verdict.kind, VerdictKind::NotInLibrary, "{}", verdict.summary);
    assert_eq!(verdict.strained.expect("what is far off").parameter, "vehicle.mass", "{}", verdict.summary);
    // And a gain is still one.
    let verdict = without("payload", &[("drive_gain", 0.8)]).verdict;
    assert_eq!(verdict.effects[0].id, "drive_gain", "{}", verdict.summary);
}

#[test]
fn a_gain_that_is_left_out_is_no_sure_payload() {
    let verdict = without("drive_gain", &[("drive_gain", 0.8)]).verdict;
    assert!(verdict.kind != VerdictKind::Effect || verdict.probability < 0.8, "{}", verdict.summary);
    if verdict.kind == VerdictKind::NotInLibrary {
        assert_eq!(verdict.strained.expect("what is far off").parameter, "effect.drive_gain");
    }
    // And a payload is still one: its loads and inertia speak for it.
    let verdict = without("drive_gain", &[("payload", 400.0)]).verdict;
    assert_eq!(verdict.effects[0].id, "payload", "{}", verdict.summary);
}

#[test]
fn an_inertia_that_is_left_out_is_no_sure_load_at_the_end_of_the_vehicle() {
    let options = Options { without: vec!["yaw_inertia".to_owned()], ..Options::default() };
    let (sound, heavy) = (log(5, &[]), log(5, &[("yaw_inertia", 1.8)]));
    let verdict = diagnosed(&heavy, Some(&sound), &car(), &options, &|_, _| {}).unwrap().report.verdict;
    assert!(verdict.kind != VerdictKind::Effect || verdict.probability < 0.8, "{}", verdict.summary);
    let nearest = verdict.effects.iter().chain(&verdict.nearest);
    for place in nearest.filter_map(|effect| effect.components.get("payload_x")) {
        assert!(place.abs() <= car().wheelbase(), "{place}: {}", verdict.summary);
    }
}
