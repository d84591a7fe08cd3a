//! A wind is fixed in the world. A log without heading and place tells how strong it is, and where it blows to by the heading at
//! the log's start; one with the place alone tells all of it.

use crate::diagnose;

use diagnose::{found, log};
use rfl_mpc::diagnose::{Options, VerdictKind};
use std::f64::consts::TAU;

const WIND: f64 = 11.0;

#[test]
fn without_a_heading_a_wind_has_a_speed_and_a_direction_from_the_start() {
    let mut log = log(21, &[("wind_y", WIND)]);
    let start = log.columns["yaw"][0];
    for name in ["yaw", "x", "y"] {
        log.columns.remove(name);
    }
    let report = found(&log, &Options::default()).report;
    assert_eq!(report.verdict.kind, VerdictKind::Effect, "{}", report.verdict.summary);
    let [wind] = &report.verdict.effects[..] else { panic!("{}", report.verdict.summary) };
    assert_eq!(wind.class, ["wind_x", "wind_y"]);
    assert!((wind.value / WIND - 1.0).abs() < 0.1, "{}", wind.value);
    assert!(wind.low < WIND && WIND < wind.high, "{} to {}", wind.low, wind.high);
    // The wind blows north: a quarter turn from east, less the heading.
    let off = wind.direction.unwrap() - (0.25 * TAU - start);
    let off = off - TAU * (off / TAU).round();
    assert!(off.abs() < 0.15, "{off} rad off");
    assert!(report.verdict.summary.contains("no heading"), "{}", report.verdict.summary);
    let across = report.observability.iter().find(|entry| entry.effect == "wind_y").unwrap();
    assert!(!across.observable && across.why.contains("named wind_x"), "{}", across.why);
    // A simulator that starts at heading 0 is given the components.
    let [x, y] = ["wind_x", "wind_y"].map(|id| wind.components[id]);
    assert!((x.hypot(y) - wind.total).abs() < 1e-9 && (y.atan2(x) - wind.direction.unwrap()).abs() < 1e-9);
    assert!(report.recalibration.iter().all(|it| it.parameter != "effect.wind_y"));
}

#[test]
fn the_place_alone_tells_the_heading() {
    let mut log = log(21, &[("wind_y", WIND)]);
    log.columns.remove("yaw");
    let report = found(&log, &Options::default()).report;
    let [wind] = &report.verdict.effects[..] else { panic!("{}", report.verdict.summary) };
    assert_eq!((wind.id.as_str(), wind.direction), ("wind_y", None));
    assert!((wind.value / WIND - 1.0).abs() < 0.1, "{}", wind.value);
}

#[test]
fn neither_component_is_named_where_one_may_not_be() {
    let mut log = log(21, &[("wind_y", WIND)]);
    for name in ["yaw", "x", "y"] {
        log.columns.remove(name);
    }
    let options = Options { without: vec!["wind_y".into()], ..Options::default() };
    let report = found(&log, &options).report;
    assert!(report.verdict.effects.iter().all(|effect| !effect.id.starts_with("wind_")));
}
