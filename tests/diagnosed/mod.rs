//! A diagnosis to show: a drive of the car with a late steering, replayed by the car as given, with the effect, and recalibrated.
//! The numbers of the report are made up around these drives; what is tested is how they are shown.

use rfl_mpc::control::{Controller, ControllerParameters};
use rfl_mpc::diagnose::{
    Adjustment, Candidate, Diagnosis, Finding, FindingSeverity, Gap, GapLocation, GapReduction, InputFile,
    Inputs, Manoeuvre, NamedEffect, Observability, Report, Series, Verdict, VerdictKind,
};
use rfl_mpc::log::{CleanLog, DriveLog};
use rfl_mpc::path::Path as Road;
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Car, CarParameters, Effects, Stage, VehicleInput, builtin};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, LazyLock};

pub const STEP: f64 = 0.02;

/// The log of a car with these effects on a road of the project.
pub fn log_of(effects: &Effects, duration: f64) -> DriveLog {
    let car = builtin("c_class").unwrap();
    let road = Path::new(env!("CARGO_MANIFEST_DIR")).join("paths/sudoku_turns.csv");
    let controller =
        Controller::new(ControllerParameters::for_car(&car), Arc::new(Road::read(&road).unwrap())).unwrap();
    let mut closed = ClosedLoop::at_start(controller, &car, effects, STEP).unwrap();
    let mut csv = Vec::new();
    closed.drive(duration, |_| ()).unwrap().write_csv(&mut csv).unwrap();
    DriveLog::from_reader(&csv[..], Path::new("late <steering>.csv")).unwrap()
}

pub fn steering(speed: f64) -> f64 {
    2.6 + 0.002 * speed * speed
}

/// What a car does with a log's commands.
fn replay(log: &CleanLog, car: &CarParameters, effects: &Effects) -> BTreeMap<String, Vec<f64>> {
    let mut car = Car::new(car, effects, None).unwrap();
    car.place(log.columns["x"][0], log.columns["y"][0], log.columns["yaw"][0], log.columns["vx"][0]);
    let mut columns: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for row in 0..log.time.len() {
        let output = *car.output();
        for (name, value) in [("yaw_rate", output.yaw_rate), ("ay", output.ay), ("steer", output.steer)] {
            columns.entry(name.into()).or_default().push(value);
        }
        let input = VehicleInput {
            steer_cmd: log.columns["steer_cmd"][row],
            accel_cmd: log.columns["accel_cmd"][row],
        };
        car.step(&input, STEP).unwrap();
    }
    columns
}

/// The log and its diagnosis, driven once.
pub fn diagnosed() -> (CleanLog, Diagnosis) {
    static ONCE: LazyLock<(CleanLog, Diagnosis)> = LazyLock::new(drive_and_diagnose);
    ONCE.clone()
}

fn drive_and_diagnose() -> (CleanLog, Diagnosis) {
    let effects = Effects { steer_delay: 0.12, yaw_rate_bias: 0.003, ..Effects::default() };
    let clean = CleanLog::of(&log_of(&effects, 40.0), &steering).unwrap();
    let car = builtin("c_class").unwrap();
    let nearly = Effects { steer_delay: 0.115, ..Effects::default() };
    let series = Series {
        time: clean.time.clone(),
        log: clean.columns.iter().map(|(name, values)| ((*name).to_owned(), values.clone())).collect(),
        simulated: replay(&clean, &car, &Effects::default()),
        with_effect: replay(&clean, &car, &nearly),
        corrected: replay(&clean, &car, &effects),
    };
    let gap = |name: &str| {
        let rms = |columns: &BTreeMap<String, Vec<f64>>| {
            let squares: f64 =
                columns[name].iter().zip(&clean.columns[name]).map(|(a, b)| (a - b).powi(2)).sum();
            (squares / clean.time.len() as f64).sqrt()
        };
        let [before, effect, recalibrated] =
            [&series.simulated, &series.with_effect, &series.corrected].map(rms);
        Gap { before, effect, recalibrated, learnable: Some(0.8 * recalibrated), noise: 0.1 * before }
    };
    let gaps: BTreeMap<String, Gap> =
        ["yaw_rate", "ay"].into_iter().map(|name| (name.to_owned(), gap(name))).collect();
    let place = |signal: &str, regime: &str, from: f64, to: f64, rms: f64| GapLocation {
        signal: signal.into(),
        regime: regime.into(),
        from,
        to,
        count: 500,
        rms,
        share: rms / 0.1,
        significance: 40.0 * rms,
    };
    let mut places = Vec::new();
    for signal in ["yaw_rate", "ay"] {
        for (i, speed) in [0.0, 4.0, 8.0, 12.0].into_iter().enumerate() {
            places.push(place(signal, "speed", speed, speed + 4.0, 0.01 + 0.02 * i as f64));
            places.push(place(
                signal,
                "steer_rate",
                0.1 * i as f64,
                0.1 * (i + 1) as f64,
                0.08 - 0.015 * i as f64,
            ));
        }
        places.push(place(signal, "side", -1.0, 0.0, 0.03));
        places.push(place(signal, "side", 0.0, 1.0, 0.035));
        places.push(place(signal, "frequency", 0.5, 1.0, 0.06));
    }
    let named = NamedEffect {
        id: "steer_delay".into(),
        meaning: "Dead time added to the steering command".into(),
        value: 0.118,
        low: 0.111,
        high: 0.126,
        unit: "s".into(),
        class: vec!["steer_delay".into(), "steer_lag".into()],
        separated_by: "fast steering, up to 2 Hz".into(),
        stage: Stage::Command,
        dominance: 2.4,
        total: 0.118,
        direction: None,
        components: BTreeMap::new(),
    };
    let report = Report {
        information: None,
        posterior: None,
        verdict: Verdict {
            kind: VerdictKind::Effect,
            probability: 0.93,
            effects: vec![named],
            nearest: vec![],
            tolerance_factor: None,
            short_list: Vec::new(),
            varying: None,
            strained: None,
            summary: "The steering command takes effect 0.118 s late. With it the yaw-rate gap shrinks by 81 %. This log cannot tell it from steer_lag.".into(),
        },
        candidates: [("steer_delay", 0.118, 215.0), ("steer_lag", 0.13, 188.0), ("sensor_delay", 0.11, 120.0), ("steer_offset", 0.004, 4.1)]
            .into_iter()
            .map(|(id, value, evidence)| Candidate {
                effects: vec![id.into()],
                values: vec![value],
                evidence,
                probability: 0.0,
                collinearity: None,
                why: if evidence > 200.0 { "explains the log best".into() } else { format!("{:.0} behind the best & more", 215.0 - evidence) },
            })
            .collect(),
        gap_reduction: GapReduction {
            open_loop: gaps.clone(),
            horizons: BTreeMap::from([("0.5".into(), gaps.clone()), ("2".into(), gaps)]),
            closed_loop: Some(BTreeMap::from([("e1".into(), Gap { before: 0.21, effect: 0.09, recalibrated: 0.02, learnable: None, noise: 0.004 })])),
        },
        location: places,
        stage: Some(Stage::Command),
        observability: vec![
            Observability { effect: "steer_delay".into(), observable: true, least: Some(0.004), named_from: Some(0.03), why: "steering rates up to 0.4 rad/s".into() },
            Observability { effect: "road_friction".into(), observable: false, least: None, named_from: None, why: "34 % of grip reached".into() },
        ],
        next_manoeuvre: Some(Manoeuvre {
            name: "frequency sweep".into(),
            how: "Steer with 0.02 rad from 0.2 to 2 Hz at 15 m/s".into(),
            also: "drive the same with a sound vehicle".into(),
            separates: vec!["steer_delay".into(), "steer_lag".into()],
            expected_evidence: 60.0,
        }),
        recalibration: vec![
            Adjustment { parameter: "vehicle.mass".into(), given: 1400.0, value: 1432.0, tolerance: 42.0, deviation: 20.0, unit: "kg".into() },
            Adjustment { parameter: "effect.yaw_rate_bias".into(), given: 0.0, value: 0.003, tolerance: 0.002, deviation: 0.0003, unit: "rad/s".into() },
            Adjustment { parameter: "effect.steer_lag".into(), given: 0.0, value: -0.004, tolerance: 0.01, deviation: 0.005, unit: "s".into() },
            Adjustment { parameter: "sensor.ay_scale".into(), given: 1.0, value: 1.004, tolerance: 0.008, deviation: 0.002, unit: "1".into() },
        ],
        findings: [clean.findings.clone(), vec![Finding { gravity: FindingSeverity::Warning, signal: Some("time".into()), summary: "3 gaps".into() }]].concat(),
        inputs: Inputs {
            files: BTreeMap::from([("log".into(), InputFile { file: "late <script>alert(1)</script>.csv".into(), hash: "00c0ffee00c0ffee".into() })]),
            vehicle: "C-class \"car\"".into(),
            tolerances: BTreeMap::from([("vehicle.mass".into(), 42.0)]),
            signals: vec!["yaw_rate".into(), "ay".into()],
            duration: 40.0,
            rate: 50.0,
        },
        seed: 1,
        version: "0.1.0".into(),
    };
    (clean, Diagnosis { report, series })
}
