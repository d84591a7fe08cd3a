//! A road's bank and grade are no cause: known, the replay drives on them; unknown, they are left to the road.

use crate::diagnose;

use diagnose::{car, clean, found, singles};
use rfl_mpc::diagnose::VerdictKind;
use rfl_mpc::log::CleanLog;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::vehicle::{Car, CarParameters, Effects, VehicleInput};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Way, m, at which bank and grade are as large again.
const WAVES: (f64, f64) = (310.0, 530.0);

fn bank(way: f64) -> f64 {
    0.03 * (TAU * way / WAVES.0).sin()
}

fn grade(way: f64) -> f64 {
    0.02 * (TAU * way / WAVES.1).sin()
}

/// A straight road whose bank and grade swing; steering is so small that the car stays on it.
fn road() -> Arc<Path> {
    let sample = |i: i32| {
        let x = 5.0 * f64::from(i);
        Sample { bank: Some(bank(x)), grade: Some(grade(x)), ..Sample::at(x, 0.0) }
    };
    Arc::new(Path::from_samples((0..300).map(sample).collect(), Closure::Open).unwrap())
}

/// Forty seconds of weaving along that road, by a driver who steers against what the bank does.
fn log(parameters: &CarParameters, gain: f64) -> CleanLog {
    driven(parameters, &Effects { steer_gain: gain, ..Effects::default() }, Some(road()))
}

/// The same of other effects on another road; without one, on a level plane.
fn driven(parameters: &CarParameters, effects: &Effects, road: Option<Arc<Path>>) -> CleanLog {
    let mut plant = Car::new(parameters, effects, road).unwrap();
    plant.place(0.0, 0.0, 0.0, 15.0);
    let mut columns: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for row in 0..2000 {
        let o = *plant.output();
        let time = 0.02 * f64::from(row);
        let weave = 3.0 * (TAU * 0.2 * time).sin() + 0.8 * (TAU * 0.9 * time).sin();
        let steer_cmd = 0.01 * (weave - o.y) - 0.2 * o.yaw;
        let accel_cmd = 2.0 * (15.0 + 4.0 * (TAU * 0.05 * time).sin() - o.vx);
        let measured = [
            ("x", o.x),
            ("y", o.y),
            ("yaw", o.yaw),
            ("vx", o.vx),
            ("vy", o.vy),
            ("yaw_rate", o.yaw_rate),
            ("ax", o.ax),
            ("ay", o.ay),
            ("steer", o.steer),
            ("roll", o.roll),
        ];
        for (name, value) in measured.into_iter().chain([("steer_cmd", steer_cmd), ("accel_cmd", accel_cmd)])
        {
            columns.entry(name).or_default().push(value);
        }
        plant.step(&VehicleInput { steer_cmd, accel_cmd }, 0.02).unwrap();
    }
    clean(columns)
}

#[test]
fn an_unknown_road_is_no_cause_and_hides_none() {
    let sound = found(&log(&car(), 1.0), &singles()).report;
    assert_eq!(sound.verdict.kind, VerdictKind::None, "{}", sound.verdict.summary);
    let geared = found(&log(&car(), 1.12), &singles()).report;
    assert_eq!(geared.verdict.kind, VerdictKind::Effect, "{}", geared.verdict.summary);
    let named = &geared.verdict.effects[0];
    assert!(named.id == "steer_gain" && named.low < 1.12 && 1.12 < named.high, "{named:?}");
}

#[test]
fn a_steady_climb_is_named() {
    // It makes no road rough, which would explain it.
    let climb = Effects { road_grade: -0.025, ..Effects::default() };
    let report = found(&driven(&car(), &climb, None), &singles()).report;
    assert_eq!(report.verdict.kind, VerdictKind::Effect, "{}", report.verdict.summary);
    let named = &report.verdict.effects[0];
    assert!(named.id == "road_grade" && named.low < -0.025 && -0.025 < named.high, "{named:?}");
}

#[test]
fn a_road_that_is_known_leaves_no_gap() {
    let unknown = log(&car(), 1.0);
    let mut known = unknown.clone();
    known.lay_on(&road()).unwrap();
    let gap =
        |log: &CleanLog, signal: &str| found(log, &singles()).report.gap_reduction.open_loop[signal].before;
    for (signal, share) in [("ay", 0.1), ("vx", 0.1)] {
        let (before, after) = (gap(&unknown, signal), gap(&known, signal));
        assert!(after < share * before, "{signal}: {before} {after}");
    }
}

#[test]
fn stiff_springs_leave_no_gap() {
    for spring in [120e3, 300e3] {
        let mut stiff = car();
        (stiff.axle.front.spring_rate, stiff.axle.rear.spring_rate) = (spring, spring);
        let mut log = log(&stiff, 1.0);
        log.lay_on(&road()).unwrap();
        let report = rfl_mpc::diagnose::diagnose(&log, None, &stiff, &singles(), &|_, _| {})
            .expect("a clean log")
            .report;
        for (signal, largest) in [("ax", 0.05), ("ay", 0.02), ("yaw_rate", 0.001)] {
            let gap = report.gap_reduction.open_loop[signal].before;
            assert!(gap < largest, "{spring} N/m, {signal}: {gap}");
        }
        assert_eq!(report.verdict.kind, VerdictKind::None, "{spring} N/m: {}", report.verdict.summary);
    }
}
