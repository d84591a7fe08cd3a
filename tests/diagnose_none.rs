//! On logs whose vehicle is within the tolerances of its model nothing is named.

mod diagnose;

use diagnose::{found, log, singles};
use rfl_mpc::diagnose::VerdictKind;

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
