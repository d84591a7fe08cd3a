//! On logs whose vehicle is within the tolerances of its model nothing is named.

use crate::diagnose;

use diagnose::{car, clean, found, log, singles};
use rfl_mpc::diagnose::VerdictKind;
use rfl_mpc::vehicle::{Car, Effects, VehicleInput};
use std::collections::BTreeMap;

#[test]
fn nothing_is_named_on_a_sound_log() {
    for seed in [11, 12] {
        let verdict = found(&log(seed, &[]), &singles()).report.verdict;
        assert_eq!(verdict.kind, VerdictKind::None, "seed {seed}: {verdict:?}");
        assert!(verdict.effects.is_empty());
    }
}

#[test]
fn an_accelerometer_high_in_the_body_is_no_effect() {
    const HEIGHT: f64 = 0.3;
    let mut log = log(11, &[]);
    // The logged roll is noisy: a mean over a fifth of a second, twice.
    let smooth = |values: &[f64]| -> Vec<f64> {
        let near = |i: usize| i.saturating_sub(5)..(i + 6).min(values.len());
        (0..values.len()).map(|i| values[near(i)].iter().sum::<f64>() / near(i).len() as f64).collect()
    };
    let roll = smooth(&smooth(&log.columns["roll"]));
    let accel = |i: usize| (roll[i - 1] - 2.0 * roll[i] + roll[i + 1]) / log.step.powi(2);
    let felt: Vec<f64> = (1..roll.len() - 1).map(|i| -HEIGHT * accel(i)).collect();
    let ay = log.columns.get_mut("ay").unwrap();
    ay[1..].iter_mut().zip(felt).for_each(|(ay, felt)| *ay += felt);
    let report = found(&log, &singles()).report;
    assert_eq!(report.verdict.kind, VerdictKind::None, "{:?}", report.verdict);
    let height = report.recalibration.iter().find(|it| it.parameter == "sensor.imu_height").unwrap();
    assert!((height.value - HEIGHT).abs() < 0.15, "{height:?}");
}

#[test]
fn slow_tight_turns_of_the_same_plant_leave_no_gap() {
    // What such turns cost in speed is a quarter of a m/s2: no column but the command tells of it.
    let mut plant = Car::new(&car(), &Effects::default(), None).unwrap();
    plant.place(0.0, 0.0, 0.0, 2.8);
    let mut columns: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    let mut integral = 0.0;
    for row in 0..2000 {
        let o = *plant.output();
        let time = 0.02 * f64::from(row);
        let steer_cmd = 0.4 * (0.4 * time).sin();
        integral += 0.02 * (2.8 - o.vx);
        let accel_cmd = 2.0 * (2.8 - o.vx) + integral;
        let measured =
            [("vx", o.vx), ("vy", o.vy), ("yaw_rate", o.yaw_rate), ("ay", o.ay), ("steer", o.steer)];
        let commanded = [("steer_cmd", steer_cmd), ("accel_cmd", accel_cmd)];
        for (name, value) in measured.into_iter().chain(commanded) {
            columns.entry(name).or_default().push(value);
        }
        plant.step(&VehicleInput { steer_cmd, accel_cmd }, 0.02).unwrap();
    }
    let rate = &columns["yaw_rate"];
    let size = (rate.iter().map(|rate| rate * rate).sum::<f64>() / rate.len() as f64).sqrt();
    let report = found(&clean(columns), &singles()).report;
    assert_eq!(report.verdict.kind, VerdictKind::None, "{:?}", report.verdict);
    let gap = &report.gap_reduction.open_loop["yaw_rate"];
    assert!(gap.before < 0.006 * size, "{} of {size} rad/s", gap.before);
}
