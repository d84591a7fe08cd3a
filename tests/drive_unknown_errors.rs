//! What nobody has told the controller, and what it finds while driving: a bias of the yaw-rate sensor, a gap of the steering;
//! and tyres that grip less than ordinary ones, which the vehicle's file tells.

use rfl_mpc::control::{ControllerFor, TruckControllerParameters};
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::simulate::{
    CAR_COLUMNS, ClosedLoop, Outcome, SensorNoise, SimulatedVehicle, TrackingMetrics, TruckClosedLoop,
};
use rfl_mpc::vehicle::{Car, CarParameters, Effects, TruckEffects, builtin, builtin_truck};
use std::sync::Arc;

/// A motorway: straights of 300 m and bends of 600 m radius to both sides.
fn motorway() -> Arc<Path> {
    let (mut x, mut y, mut yaw) = (0.0f64, 0.0f64, 0.0f64);
    let mut samples = Vec::new();
    for k in 0..=400 {
        samples.push(Sample::at(x, y));
        let s = 5.0 * f64::from(k);
        let ramp =
            |from: f64, to: f64| ((s - from) / 80.0).clamp(0.0, 1.0) * ((to - s) / 80.0).clamp(0.0, 1.0);
        let curvature = (ramp(300.0, 700.0) - ramp(1000.0, 1400.0)) / 600.0;
        let middle = yaw + 2.5 * curvature;
        (x, y, yaw) = (x + 5.0 * middle.cos(), y + 5.0 * middle.sin(), yaw + 5.0 * curvature);
    }
    Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
}

fn loop_of(name: &str, effects: Effects) -> ClosedLoop {
    let car = builtin(name).unwrap();
    loop_told(&car, &car, effects)
}

/// A car whose file says `told`.
fn loop_told(told: &CarParameters, car: &CarParameters, effects: Effects) -> ClosedLoop {
    let parameters = <Car as SimulatedVehicle<4, CAR_COLUMNS>>::controller(told);
    let controller = ControllerFor::new(parameters, motorway()).unwrap();
    ClosedLoop::at_start(controller, car, &effects, 0.02).unwrap()
}

/// Drives to the end.
fn drive(closed: &mut ClosedLoop) -> TrackingMetrics {
    let drive = closed.record(200.0, |_, error| error.abs() < 2.5);
    assert_eq!(drive.ending.outcome, Outcome::Completed, "{}", drive.ending.reason());
    drive.tracking()
}

#[test]
fn a_bias_of_the_yaw_rate_leaves_the_car_on_its_line() {
    for (name, bias) in [("c_class", 0.01), ("vw_vanagon", -0.02), ("ford_escort", 0.005)] {
        let effects = Effects { yaw_rate_bias: bias, ..Effects::default() };
        let sound = drive(&mut loop_of(name, Effects::default()));
        let biased = drive(&mut loop_of(name, effects));
        assert!(
            biased.max < sound.max + 0.02 && biased.mae < sound.mae + 0.01,
            "{name}: {biased:?}, {sound:?}"
        );
        let noisy = drive(&mut loop_of(name, effects).with_noise(SensorNoise::TYPICAL, 3));
        assert!(noisy.max < 0.2, "{name}: {noisy:?}");
    }
}

#[test]
fn a_yaw_angle_askew_leaves_car_and_truck_on_their_lines() {
    let straight = || {
        let samples = [0.0, 500.0, 1000.0].map(|x| Sample::at(x, 0.0)).to_vec();
        Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
    };
    for offset in [0.01, -0.02, 0.05] {
        let mut car = loop_of("c_class", Effects::default()).with_fault(move |_, told| told.yaw += offset);
        let tracking = drive(&mut car);
        assert!(tracking.max < 0.2 && tracking.mae < 0.03, "{offset}: {tracking:?}");

        let truck = builtin_truck("truck_simulation").unwrap();
        let mut parameters = TruckControllerParameters::for_truck(&truck);
        parameters.speed.limit = 25.0;
        let controller = ControllerFor::new(parameters, straight()).unwrap();
        let mut closed = TruckClosedLoop::at_start(controller, &truck, &TruckEffects::default(), 0.02)
            .unwrap()
            .with_fault(move |_, told| told.yaw += offset);
        let drive = closed.record(200.0, |_, error| error.abs() < 2.5);
        assert_eq!(drive.ending.outcome, Outcome::Completed, "{offset}: {}", drive.ending.reason());
        assert!(drive.tracking().max < 0.3, "{offset}: {:?}", drive.tracking());
    }
}

#[test]
fn a_gap_of_the_steering_is_found_and_taken_up() {
    for (name, gap) in [("c_class", 0.002), ("c_class", 0.01), ("bmw_320i", 0.005), ("vw_vanagon", 0.02)] {
        let mut closed = loop_of(name, Effects { steer_backlash: gap, ..Effects::default() });
        let tracking = drive(&mut closed);
        let found = closed.controller().known_actuator().unwrap().backlash;
        assert!((found / gap - 1.0).abs() < 0.4, "{name}: {found} for {gap}");
        assert!(tracking.mae < 0.03 && tracking.max < 0.5, "{name}, {gap}: {tracking:?}");
    }
}

#[test]
fn a_gap_and_an_offset_that_the_file_tells_are_the_steerings() {
    for (name, gap, offset) in [("c_class", 0.005, 0.0), ("ford_escort", 0.02, 0.0), ("bmw_320i", 0.0, 0.03)]
    {
        let mut car = builtin(name).unwrap();
        (car.steering.backlash, car.steering.offset) = (gap, offset);
        let mut closed = loop_told(&car, &car, Effects::default());
        let tracking = drive(&mut closed);
        let known = closed.controller().known_actuator().unwrap();
        assert_eq!(known.backlash, gap, "{name}: {known:?}");
        let [told, found] = [
            car.steering.dead_time + car.steering.lag,
            known.actuator.dead_time + known.actuator.time_constant,
        ];
        assert!((found - told).abs() < 0.02, "{name}: {told} {known:?}");
        assert!(tracking.mae < 0.03 && tracking.max < 0.2, "{name}: {tracking:?}");
    }
}

#[test]
fn a_wrong_gap_in_the_file_is_corrected() {
    for (gap_told, true_gap) in [(0.01, 0.0), (0.004, 0.014), (0.0, 0.06)] {
        let [mut told, mut car] = [builtin("c_class").unwrap(), builtin("c_class").unwrap()];
        (told.steering.backlash, car.steering.backlash) = (gap_told, true_gap);
        let mut closed = loop_told(&told, &car, Effects::default());
        let tracking = drive(&mut closed);
        let found = closed.controller().known_actuator().unwrap().backlash;
        assert!((found - true_gap).abs() <= 0.4 * true_gap, "{gap_told} {true_gap}: {found}");
        // Until it is known, a wide one costs most of a lane's margin once.
        assert!(tracking.mae < 0.1 && tracking.max < 1.0, "{gap_told} {true_gap}: {tracking:?}");
    }
}

#[test]
fn a_steering_without_a_gap_is_not_said_to_have_one() {
    for name in ["c_class", "bmw_320i", "genesis"] {
        for (lag, delay) in [(0.0, 0.0), (0.1, 0.06), (0.2, 0.1)] {
            for noise in [None, Some(SensorNoise::TYPICAL)] {
                let mut closed =
                    loop_of(name, Effects { steer_lag: lag, steer_delay: delay, ..Effects::default() });
                if let Some(noise) = noise {
                    closed = closed.with_noise(noise, 5);
                }
                drive(&mut closed);
                let known = closed.controller().known_actuator().unwrap();
                assert_eq!(known.backlash, 0.0, "{name} {lag} {delay} {}: {known:?}", noise.is_some());
            }
        }
    }
}

#[test]
fn slippery_tyres_of_the_file_are_driven_by() {
    let mut car: CarParameters = builtin("c_class").unwrap();
    (car.tyre.front.friction_scale, car.tyre.rear.friction_scale) = (0.7, 0.7);
    let mut samples = Vec::new();
    let (mut x, mut y, mut yaw) = (0.0f64, 0.0f64, 0.0f64);
    for k in 0..=500 {
        let s = f64::from(k);
        samples.push(Sample { friction: Some(0.2), ..Sample::at(x, y) });
        let ramp = ((s - 200.0) / 20.0).clamp(0.0, 1.0) * ((300.0 - s) / 20.0).clamp(0.0, 1.0);
        let middle = yaw + 0.5 * ramp / 40.0;
        (x, y, yaw) = (x + middle.cos(), y + middle.sin(), yaw + ramp / 40.0);
    }
    let road = Arc::new(Path::from_samples(samples, Closure::Open).unwrap());
    let parameters = <Car as SimulatedVehicle<4, CAR_COLUMNS>>::controller(&car);
    assert!(parameters.speed.grip < 6.5, "{}", parameters.speed.grip);
    let controller = ControllerFor::new(parameters, road).unwrap();
    let tracking = drive(&mut ClosedLoop::at_start(controller, &car, &car.effect, 0.02).unwrap());
    assert!(tracking.max < 0.2, "{tracking:?}");
}

/// A car that is put down across its road at speed turns back without rolling over.
#[test]
fn a_car_far_from_its_road_turns_back_within_its_grip() {
    for name in ["vw_vanagon", "bmw_320i"] {
        for yaw in [1.57, -1.2, 3.1] {
            let mut closed = loop_of(name, Effects::default()).placed([None, None, Some(yaw), Some(20.0)]);
            let drive = closed.record(60.0, |_, _| true);
            let rolled = drive.ending.reason().contains("rolled");
            assert!(!rolled, "{name} {yaw}: {}", drive.ending.reason());
        }
    }
}
