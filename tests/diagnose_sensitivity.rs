//! Sensitivities of the replay against the closed form of steady turning, and the replay against the full plant.

use crate::diagnose;

use diagnose::{car, clean, log, only};
use rfl_mpc::diagnose::problem::rms;
use rfl_mpc::diagnose::replay::{Channel, Correction, ReplayDrive, replay};
use rfl_mpc::diagnose::simulated::{Conditions, drive};
use rfl_mpc::vehicle::{TruckEffects, builtin};
use std::collections::BTreeMap;

/// A long straight drive at a constant speed with a small angle.
fn straight(vx: f64, steer: f64) -> ReplayDrive {
    let rows = 500;
    let columns = BTreeMap::from([
        ("steer_cmd", vec![steer; rows]),
        ("vx", vec![vx; rows]),
        ("yaw_rate", vec![0.0; rows]),
        ("ay", vec![0.0; rows]),
    ]);
    ReplayDrive::new(&clean(columns), false)
}

#[test]
fn an_offset_turns_the_car_as_the_single_track_says() {
    // A car without what the single track has not: camber thrust and compliances.
    let mut car = builtin("bmw_320i").expect("built in");
    for tyre in [&mut car.tyre.front, &mut car.tyre.rear] {
        tyre.lateral_compliance = 0.0;
        let coefficients = tyre.coefficients.as_mut().expect("a tyre");
        (coefficients.phy3, coefficients.pvy3, coefficients.pdy3) = (0.0, 0.0, 0.0);
    }
    let model = car.single_track();
    for vx in [8.0, 16.0, 24.0] {
        let drive = straight(vx, 0.0);
        let yaw_rate = |offset: f64| {
            let mut effects = TruckEffects::default();
            effects.vehicle.steer_offset = offset;
            let trace = replay(&drive, &car, &effects, &Correction::default(), None).expect("a car");
            trace.column(Channel::YawRate)[499]
        };
        let slope = (yaw_rate(0.002) - yaw_rate(-0.002)) / 0.004;
        // r / delta = v / (L + K v^2), K = m (lr Cr - lf Cf) / (L Cf Cr).
        let length = model.lf + model.lr;
        let gradient =
            model.mass * (model.lr * model.cr - model.lf * model.cf) / (length * model.cf * model.cr);
        let expected = vx / (length + gradient * vx * vx);
        assert!((slope / expected - 1.0).abs() < 0.01, "{vx} m/s: {slope} and {expected}");
    }
}

#[test]
fn a_bank_is_felt_by_the_accelerometer_and_a_bias_is_not_by_the_car() {
    let drive = straight(15.0, 0.0);
    let of = |id: &str, value: f64| {
        let trace =
            replay(&drive, &car(), &only(&[(id, value)]), &Correction::default(), None).expect("a car");
        (trace.column(Channel::YawRate)[499], trace.column(Channel::Ay)[499])
    };
    let (yaw_rate, ay) = of("lateral_accel_bias", 0.3);
    assert!(yaw_rate.abs() < 1e-6 && (ay - 0.3).abs() < 0.02, "{yaw_rate} {ay}");
    let (yaw_rate, _) = of("road_bank", 0.03);
    assert!(yaw_rate.abs() > 1e-4);
}

#[test]
fn the_replay_is_near_the_full_plant() {
    let conditions = Conditions {
        seed: 2,
        duration: 30.0,
        step: 0.02,
        background: 0.0,
        noise: 0.0,
        ..Conditions::default()
    };
    for put_in in [
        &[][..],
        &[("steer_delay", 0.1)],
        &[("payload", 300.0), ("road_bank", 0.03)],
        &[("sensor_delay", 0.08)],
    ] {
        let effects = only(put_in);
        let log = drive(&car(), &effects, &conditions).expect("an ordinary drive");
        let ready = ReplayDrive::new(&log, false);
        let trace = replay(&ready, &car(), &effects, &Correction::default(), None).expect("a car");
        let rows: Vec<usize> = (0..ready.time.len()).filter(|&row| ready.scored[row]).collect();
        let logged = ready.column("yaw_rate");
        let gap: Vec<f64> =
            rows.iter().map(|&row| logged[row] - trace.column(Channel::YawRate)[row]).collect();
        let own: Vec<f64> = rows.iter().map(|&row| logged[row]).collect();
        assert!(rms(&gap) < 0.02 * rms(&own), "{put_in:?}: {} of {}", rms(&gap), rms(&own));
    }
    let _ = log(1, &[]);
}
