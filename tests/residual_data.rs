//! Recorded drives with everything that goes wrong with recordings.

use crate::residual_plant;

use residual_plant::{CONFIG, Plant, car, drive};
use rfl_mpc::nominal::{ContinuousErrorModel, ErrorState};
use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{DataConfig, DataError, DataSet, Drive};

fn lagging() -> Drive {
    drive(&Plant { lag: 0.1, ..Plant::exact() }, 600, 1, 8.0)
}

fn made(drive: &Drive) -> Result<DataSet, DataError> {
    DataSet::new(std::slice::from_ref(drive), &car(), CONFIG)
}

#[test]
fn labels_are_what_the_nominal_model_missed() {
    let log = lagging();
    let data = made(&log).unwrap();
    let windows = data.windows(4);
    assert_eq!((windows.len(), data.report().labels), (600 - 4, 599));
    let model = ContinuousErrorModel::new(&car(), 8.0).unwrap().discretise(0.02);
    for sample in [0, 1, 595] {
        let k = sample + 3;
        let state = |k: usize| ErrorState::new(log.e1[k], log.e1_rate[k], log.e2[k], log.e2_rate[k]);
        let predicted = model.step(&state(k), log.steer_cmd[k], 8.0 * log.curvature[k], 0.0);
        assert_eq!(ErrorState::from(windows.label(sample)), state(k + 1) - predicted);
        assert_eq!(windows.commands(sample), &log.steer_cmd[k - 3..=k]);
        assert_eq!(ErrorState::from(windows.states(sample)[3]), state(k), "the newest comes last");
        let mut features = [0.0; 19];
        windows.features(sample, &mut features);
        assert_eq!(features[..4], [log.e1[k - 3], log.e1_rate[k - 3], log.e2[k - 3], log.e2_rate[k - 3]]);
        assert_eq!(features[16..], [8.0, log.curvature[k], 0.0]);
    }
}

/// On a clothoid at changing speed the disturbance is the one at the middle of the step.
#[test]
fn an_exact_car_on_a_clothoid_leaves_only_what_the_held_disturbance_misses() {
    let mut log = Drive::default();
    let mut random = Random::new(1);
    let mut x = ErrorState::zeros();
    let (mut v, mut s) = (8.0, 0.0);
    for k in 0..400 {
        let command = 0.02 * residual_plant::normal(&mut random);
        let slope = 1e-4;
        let rows = [k as f64 * 0.02, command, x[0], x[1], x[2], x[3], v, slope * s, slope];
        log.columns_mut().into_iter().zip(rows).for_each(|(column, value)| column.push(value));
        // The car itself, in 200 fine steps with the disturbance of the moment and the model of the step's start.
        let fine = ContinuousErrorModel::new(&car(), v).unwrap().discretise(1e-4);
        for _ in 0..200 {
            let (middle_v, middle_s) = (v + 0.5e-4, s + 0.5e-4 * v);
            let curvature = slope * middle_s;
            x = fine.step(&x, command, middle_v * curvature, middle_v * middle_v * slope + curvature);
            s += 1e-4 * middle_v;
            v += 1e-4;
        }
    }
    let data = made(&log).unwrap();
    let windows = data.windows(1);
    for i in 0..windows.len() {
        let size = ErrorState::from(windows.label(i)).norm();
        // A disturbance that ramps by g within the step, its mean met, leaves |A D| g Ts^3 / 12, about 3e-6 here;
        // held from the step's start it would leave D g Ts^2 / 2, some 4e-5.
        assert!(size < 5e-6, "{i}: {size}");
    }
}

#[test]
fn below_the_minimum_speed_the_model_is_held() {
    let plant = Plant::exact();
    let slow = drive(&plant, 200, 3, 1.0);
    let config = DataConfig { min_model_speed: 1.5, ..CONFIG };
    let data = DataSet::new(std::slice::from_ref(&slow), &car(), config).unwrap();
    let model = ContinuousErrorModel::new(&car(), 1.5).unwrap().discretise(0.02);
    let x = ErrorState::new(slow.e1[5], slow.e1_rate[5], slow.e2[5], slow.e2_rate[5]);
    let next = ErrorState::new(slow.e1[6], slow.e1_rate[6], slow.e2[6], slow.e2_rate[6]);
    let label = next - model.step(&x, slow.steer_cmd[5], slow.curvature[5], 0.0);
    assert_eq!(ErrorState::from(data.windows(6).label(0)), label);
}

#[test]
fn rows_that_are_not_numbers_are_left_out_and_no_window_spans_them() {
    let mut log = lagging();
    log.e2[100] = f64::NAN;
    log.steer_cmd[300] = f64::INFINITY;
    log.time[400] = f64::NAN;
    let data = made(&log).unwrap();
    assert_eq!((data.report().not_finite, data.report().gaps), (3, 3));
    // Stretches of 100, 199, 99 and 199 rows.
    assert_eq!(data.windows(16).len(), [100, 199, 99, 199].iter().map(|rows| rows - 16).sum::<usize>());
}

#[test]
fn glitches_are_left_out_and_counted() {
    let mut log = lagging();
    log.e2[50] = 1e9;
    let report = made(&log).unwrap().report().clone();
    assert_eq!((report.implausible, report.not_finite, report.gaps), (1, 0, 1));
}

#[test]
fn gaps_and_borders_of_drives_are_not_bridged() {
    let mut log = lagging();
    log.time[250..].iter_mut().for_each(|t| *t += 1.7);
    let second = drive(&Plant::exact(), 300, 2, 8.0);
    let data = DataSet::new(&[log, second], &car(), CONFIG).unwrap();
    assert_eq!(data.report().gaps, 1);
    assert_eq!(data.windows(16).len(), 250 - 16 + 350 - 16 + 300 - 16);
}

#[test]
fn jitter_of_clocks_is_no_gap() {
    let mut log = lagging();
    let mut random = Random::new(2);
    log.time.iter_mut().for_each(|t| *t += 0.001 * random.uniform());
    assert_eq!(made(&log).unwrap().report().gaps, 0);
}

#[test]
fn faster_logs_are_thinned_at_the_controllers_steps() {
    let slow = lagging();
    // Five rows for each step of the controller; the first two belong to a step whose begin was not recorded.
    let mut fast = Drive { name: "fast".into(), ..Drive::default() };
    for i in 3..600 * 5 {
        let (k, part) = (i / 5, (i % 5) as f64 / 5.0);
        let next = (k + 1).min(599);
        let mut slow = slow.clone();
        for (c, (from, to)) in slow.columns_mut().into_iter().zip(fast.columns_mut()).enumerate() {
            // Commands are held, the rest moves on.
            let value = if c == 1 { from[k] } else { from[k] + part * (from[next] - from[k]) };
            to.push(if c == 0 { i as f64 * 0.004 } else { value });
        }
    }
    let (slow, fast) = (made(&slow).unwrap(), made(&fast).unwrap());
    assert_eq!(fast.report().thinned, [("fast".to_owned(), 5)]);
    let (slow, fast) = (slow.windows(4), fast.windows(4));
    assert_eq!(fast.len(), slow.len() - 1);
    for i in 0..fast.len() {
        assert_eq!(fast.commands(i), slow.commands(i + 1));
        assert_eq!(fast.states(i), slow.states(i + 1));
    }
}

#[test]
fn other_rates_are_refused() {
    for (factor, name) in [(5.0, "slower"), (0.7, "no whole fraction")] {
        let mut log = lagging();
        log.time.iter_mut().for_each(|t| *t *= factor);
        let error = made(&log).unwrap_err();
        assert!(matches!(error, DataError::Rate { .. }), "{name}: {error}");
        assert!(error.to_string().contains("drive 1 is sampled every"), "{error}");
    }
}

#[test]
fn wrong_units_are_suspected() {
    let degrees = 180.0 / std::f64::consts::PI;
    let plant = Plant { lag: 0.05, ..Plant::exact() };
    // Slow bends, so that steering and yaw rate have to do with one another.
    let log = drive(&plant, 3000, 4, 8.0);
    made(&log).unwrap();
    type Spoil = fn(&mut Drive, f64);
    let cases: [(&str, Spoil); 6] = [
        ("steer_cmd", |log, d| log.steer_cmd.iter_mut().for_each(|x| *x *= d)),
        ("steer_cmd", |log, _| log.steer_cmd.iter_mut().for_each(|x| *x *= 16.0)),
        ("steer_cmd", |log, _| log.steer_cmd.iter_mut().for_each(|x| *x *= -1.0)),
        ("e2", |log, d| log.e2.iter_mut().for_each(|x| *x *= d)),
        ("e2_rate", |log, d| log.e2_rate.iter_mut().for_each(|x| *x *= d)),
        ("e2", |log, d| {
            log.e2.iter_mut().for_each(|x| *x *= d);
            log.e2_rate.iter_mut().for_each(|x| *x *= d);
        }),
    ];
    for (i, (column, spoil)) in cases.into_iter().enumerate() {
        let mut wrong = log.clone();
        spoil(&mut wrong, degrees);
        let error = made(&wrong).unwrap_err();
        let found = match &error {
            DataError::Unit { column, .. } | DataError::OutOfRange { column, .. } => *column,
            other => panic!("case {i}: {other}"),
        };
        // Where all angles are in degrees, any of the two may be named.
        assert!(found == column || (i == 5 && found == "e2_rate"), "case {i}: {error}");
    }
}

#[test]
fn what_cannot_be_repaired_is_refused_with_the_place() {
    let mut stuck = lagging();
    stuck.steer_cmd.fill(0.01);
    assert!(matches!(made(&stuck), Err(DataError::Constant { column: "steer_cmd", .. })));
    let mut stuck = lagging();
    stuck.e1.fill(0.0);
    assert!(matches!(made(&stuck), Err(DataError::Constant { column: "e1", .. })));

    let mut short = lagging();
    short.vx.pop();
    let error = made(&short).unwrap_err();
    assert!(
        matches!(error, DataError::ColumnLength { column: "vx", found: 599, expected: 600, .. }),
        "{error}"
    );

    let mut backwards = lagging();
    backwards.time[200] = backwards.time[199];
    let error = made(&backwards).unwrap_err();
    assert!(matches!(error, DataError::TimeOrder { row: 200, .. }), "{error}");

    assert!(matches!(DataSet::new(&[], &car(), CONFIG), Err(DataError::Empty { rows: 0 })));
    let mut nothing = lagging();
    nothing.e1.fill(f64::NAN);
    assert!(matches!(made(&nothing), Err(DataError::Empty { rows: 600 })));
    let config = DataConfig { sample_time: -1.0, ..CONFIG };
    assert!(matches!(DataSet::new(&[lagging()], &car(), config), Err(DataError::SampleTime { .. })));
}

#[test]
fn columns_that_may_be_constant_are_named() {
    assert_eq!(made(&lagging()).unwrap().report().constant, ["vx", "curvature", "curvature_rate"]);
}

#[test]
fn the_hash_tells_data_apart() {
    let log = lagging();
    let mut other = log.clone();
    other.e1[17] += 1e-15;
    assert_eq!(made(&log).unwrap().hash(), made(&log).unwrap().hash());
    assert_ne!(made(&log).unwrap().hash(), made(&other).unwrap().hash());
}
