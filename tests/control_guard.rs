//! The guard: what cannot be true is bridged, then the vehicle stops along the road; an ordinary drive hears nothing of it.

use rfl_mpc::control::{
    ControlStatus, Controller, ControllerParameters, ControllerState, Measurement, StepError,
    TruckController, TruckControllerParameters,
};
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::simulate::{ClosedLoop, End, SensorNoise, TruckClosedLoop};
use rfl_mpc::vehicle::{BUILTIN, BUILTIN_TRUCKS, Car, Effects, Truck, TruckEffects, builtin, builtin_truck};
use std::cell::Cell;
use std::sync::Arc;

/// A road by its curvature: straights and bends, each of a length in m and a curvature in 1/m, joined by clothoids.
fn road(pieces: &[(f64, f64)]) -> Arc<Path> {
    const STEP: f64 = 0.5;
    const CLOTHOID: f64 = 40.0;
    let (mut x, mut y, mut yaw, mut before) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0);
    let mut samples = vec![Sample::at(x, y)];
    for &(length, curvature) in pieces {
        for k in 0..(length / STEP) as u32 {
            let share = ((f64::from(k) + 0.5) * STEP / CLOTHOID).min(1.0);
            let here = before + share * (curvature - before);
            let heading = yaw + 0.5 * STEP * here;
            (x, y) = (x + STEP * heading.cos(), y + STEP * heading.sin());
            yaw += STEP * here;
            if k % 2 == 1 {
                samples.push(Sample::at(x, y));
            }
        }
        before = curvature;
    }
    Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
}

/// Straight, left, right, straight: for 27 m/s as for 10 m/s.
fn fast_road() -> Arc<Path> {
    road(&[(150.0, 0.0), (150.0, 1.0 / 360.0), (150.0, -1.0 / 360.0), (150.0, 0.0)])
}

/// Where faults begin, m: on the straight, into the bend, in the bend, from bend to bend.
const STATIONS: [f64; 4] = [20.0, 110.0, 180.0, 280.0];

/// What the controller is told, what it was told last before the fault, and the road.
type Fault = fn(&mut Measurement, &Measurement, &Path);

fn missing(told: &mut Measurement, _: &Measurement, _: &Path) {
    let nan = f64::NAN;
    *told = Measurement { x: nan, y: nan, yaw: nan, vx: nan, vy: nan, yaw_rate: nan, ..*told };
}

const FAULTS: [(&str, Fault); 6] = [
    ("yaw", |told, _, _| told.yaw += 0.2),
    ("yaw rate", |told, _, _| told.yaw_rate = 5.0),
    ("elsewhere", |told, _, _| {
        told.x -= 30.0 * told.yaw.sin();
        told.y += 30.0 * told.yaw.cos();
    }),
    ("frozen", |told, before, _| *told = *before),
    ("missing", missing),
    ("no speed", |told, _, _| told.vx = 0.0),
];

/// What a drive with a fault was like.
#[derive(Default)]
struct Outcome {
    /// Largest true lateral error, m.
    error: f64,
    /// Speed at the end, m/s.
    speed: f64,
    /// Steps that were called optimal while the fault was there.
    optimal: u32,
    finished: bool,
    last: ControlStatus,
    statuses: Vec<ControlStatus>,
}

/// The fast road, a controller that drives as fast as `limit`, and a car at a station and speed.
fn begun(station: f64, limit: f64, speed: f64) -> (Arc<Path>, Controller, Car) {
    let path = fast_road();
    let car = builtin("c_class").unwrap();
    let mut parameters = ControllerParameters::for_car(&car);
    parameters.speed.limit = limit;
    let controller = Controller::new(parameters, path.clone()).unwrap();
    let mut vehicle = Car::new(&car, &Effects::default(), None).unwrap();
    let start = path.at(station);
    vehicle.place(start.x, start.y, start.yaw, speed);
    (path, controller, vehicle)
}

/// Drives from a station on, with a fault after a second.
fn drive(limit: f64, station: f64, length: f64, fault: Fault, duration: f64, noise: f64) -> Outcome {
    let (path, controller, vehicle) = begun(station, limit, limit);
    let during = move |time: f64| time > 0.99 && time < 0.99 + length;
    let mut before = Measurement::default();
    let mut closed = ClosedLoop::new(controller, vehicle, 0.02).with_fault(move |time, told| {
        if during(time) { fault(told, &before, &path) } else { before = *told }
    });
    if noise > 0.0 {
        closed = closed.with_noise(SensorNoise::TYPICAL.scaled(noise), 5);
    }
    let mut outcome = Outcome::default();
    for step in 0..(duration / 0.02) as u32 {
        closed.advance().unwrap();
        let report = closed.controller().report();
        outcome.error = outcome.error.max(closed.lateral_error().abs());
        outcome.optimal +=
            u32::from(during(f64::from(step) * 0.02) && report.status == ControlStatus::Optimal);
        outcome.finished |= report.finished;
        outcome.last = report.status;
        if !outcome.statuses.contains(&report.status) {
            outcome.statuses.push(report.status);
        }
    }
    outcome.speed = closed.vehicle().output().vx;
    outcome
}

#[test]
fn faults_of_a_fifth_of_a_second_are_bridged() {
    for limit in [10.0, 26.0] {
        for (name, fault) in FAULTS {
            for (station, noise) in STATIONS.into_iter().zip([0.0, 2.0, 2.0, 0.0]) {
                let outcome = drive(limit, station, 0.2, fault, 4.0, noise);
                let what = format!("{name} at {limit} m/s, {station} m: {:.3} m", outcome.error);
                assert!(outcome.error < 0.5, "{what}");
                assert_eq!(outcome.optimal, 0, "{what}");
                assert_eq!(outcome.last, ControlStatus::Optimal, "{what}");
                assert!(outcome.statuses.contains(&ControlStatus::Bridged), "{what}");
                assert!(outcome.speed > 0.9 * limit, "{what}: driving on");
            }
        }
    }
}

#[test]
fn faults_of_two_seconds_end_in_a_stop_on_the_road() {
    for limit in [10.0, 26.0] {
        for (name, fault) in FAULTS {
            for (station, noise) in STATIONS.into_iter().zip([0.0, 0.0, 2.0, 2.0]) {
                let outcome = drive(limit, station, 2.0, fault, 14.0, noise);
                let what = format!("{name} at {limit} m/s, {station} m: {:.3} m", outcome.error);
                assert!(outcome.error < 1.0, "{what}");
                assert_eq!(outcome.optimal, 0, "{what}");
                assert_eq!(outcome.last, ControlStatus::SafeStop, "{what}");
                assert!(outcome.speed.abs() < 0.1, "{what}: {} m/s", outcome.speed);
            }
        }
    }
}

#[test]
fn a_loss_shorter_than_the_stop_time_brakes_and_drives_on() {
    let outcome = drive(20.0, 20.0, 0.7, missing, 6.0, 0.0);
    assert!(outcome.statuses.contains(&ControlStatus::SafeStop));
    assert_eq!((outcome.last, outcome.optimal), (ControlStatus::Optimal, 0));
    assert!(outcome.error < 0.2 && outcome.speed > 19.0, "{} m, {} m/s", outcome.error, outcome.speed);
}

#[test]
fn a_sample_at_the_roads_end_does_not_finish_the_drive() {
    let at_end: Fault = |told, _, path| {
        let end = path.at(path.length());
        (told.x, told.y, told.yaw) = (end.x, end.y, end.yaw);
    };
    let outcome = drive(10.0, 20.0, 0.02, at_end, 3.0, 0.0);
    assert!(!outcome.finished && outcome.error < 0.1, "{}", outcome.error);
}

/// Drives along the straight that a road begins with, told the truth.
fn along(controller: &mut Controller, from: f64, steps: u32) -> f64 {
    let mut x = from;
    for _ in 0..steps {
        controller.step(&Measurement { x, vx: 5.0, ..Measurement::default() }).unwrap();
        x += 0.1;
    }
    x
}

fn straight() -> Controller {
    Controller::new(ControllerParameters::default(), road(&[(120.0, 0.0)])).unwrap()
}

#[test]
fn what_passes_far_beside_the_roads_end_has_not_finished() {
    let mut controller = straight();
    let length = controller.path().length();
    let mut x = length - 20.0;
    for _ in 0..300 {
        let report = *controller.step(&Measurement { x, y: 8.0, vx: 5.0, ..Measurement::default() }).unwrap();
        assert!(!report.finished && report.status != ControlStatus::Finished, "at {x}");
        x += 0.1;
    }
}

#[test]
fn finished_is_taken_back_when_the_vehicle_is_elsewhere() {
    let mut controller = straight();
    let x = along(&mut controller, 115.0, 48);
    assert_eq!(controller.report().status, ControlStatus::Finished);
    assert!(controller.report().finished && x > 119.0);
    // The host puts it back to the middle: believed after the time to bridge, and no longer finished.
    along(&mut controller, 60.0, 5);
    assert!(controller.report().finished, "not as yet");
    along(&mut controller, 60.5, 60);
    assert!(!controller.report().finished);
    assert_eq!(controller.report().status, ControlStatus::Optimal);
}

#[test]
fn a_vehicle_that_the_host_moves_starts_anew_after_the_time_to_bridge() {
    let mut controller = straight();
    along(&mut controller, 10.0, 50);
    let mut believed = None;
    for k in 0..100 {
        let x = 70.0 + 0.1 * f64::from(k);
        let report =
            *controller.step(&Measurement { x, y: 0.02, vx: 5.0, ..Measurement::default() }).unwrap();
        if report.status == ControlStatus::Optimal {
            assert!((report.e1 - 0.02).abs() < 1e-6 && (report.station - x).abs() < 1e-3);
            believed = believed.or(Some(k));
        } else {
            assert_eq!(report.status, ControlStatus::Bridged, "step {k}");
            assert!(report.station < 20.0, "the prediction stands in");
        }
    }
    let time = 0.02 * f64::from(believed.unwrap());
    let limit = controller.parameters().guard.bridge_time;
    assert!((time - limit).abs() < 0.03, "{time} s");
}

#[test]
fn a_vehicle_put_down_at_rest_starts_anew_and_a_sensor_that_says_zero_does_not() {
    for (at, starts) in [(70.0, true), (0.0, false)] {
        let mut controller = straight();
        along(&mut controller, 10.0, 50);
        let still = Measurement { x: at, ..Measurement::default() };
        let last = (0..40).map(|_| controller.step(&still).unwrap().status).last();
        assert_eq!(last == Some(ControlStatus::Optimal), starts, "{last:?}");
    }
}

#[test]
fn a_completed_stop_ends_where_the_host_puts_the_vehicle_and_not_where_its_pose_comes_back() {
    for (at, starts) in [(16.0, false), (90.0, true)] {
        let mut controller = straight();
        along(&mut controller, 10.0, 50);
        let nothing =
            Measurement { x: f64::NAN, y: f64::NAN, yaw: f64::NAN, vx: f64::NAN, ..Measurement::default() };
        for _ in 0..300 {
            controller.step(&nothing).unwrap();
        }
        let there = Measurement { x: at, y: 0.6, ..Measurement::default() };
        let started = (0..100).any(|_| controller.step(&there).unwrap().status == ControlStatus::Optimal);
        assert_eq!(started, starts, "at {at}");
    }
}

#[test]
fn only_the_first_measurement_must_be_finite() {
    let mut controller = straight();
    let nan = Measurement { vx: f64::NAN, ..Measurement::default() };
    let error = controller.step(&nan).unwrap_err();
    assert!(matches!(error, StepError::NotFinite { signal: "vx", .. }));
    let x = along(&mut controller, 10.0, 20);
    let report = controller.step(&Measurement { x, ..nan }).unwrap();
    assert_eq!(report.status, ControlStatus::Bridged);
    assert!((report.station - x).abs() < 0.01);
}

#[test]
fn a_yaw_that_holds_no_direction_counts_as_missing() {
    let mut controller = straight();
    let x = along(&mut controller, 10.0, 60);
    let report = *controller.step(&Measurement { x, yaw: 1e30, vx: 5.0, ..Measurement::default() }).unwrap();
    assert!(report.status == ControlStatus::Bridged && report.steer_cmd.abs() < 1e-3, "{report:?}");
    let refused = straight().step(&Measurement { yaw: -1e30, ..Measurement::default() }).unwrap_err();
    assert!(matches!(refused, StepError::NotFinite { signal: "yaw", .. }), "{refused}");
}

#[test]
fn the_guard_goes_on_from_a_saved_state() {
    let mut controller = straight();
    let x = along(&mut controller, 10.0, 30);
    let nan = Measurement { x: f64::NAN, y: f64::NAN, vx: 5.0, ..Measurement::default() };
    (0..5).for_each(|_| drop(controller.step(&nan).copied()));
    let saved = postcard::to_allocvec(controller.state()).unwrap();
    let mut other = straight();
    let state: ControllerState = postcard::from_bytes(&saved).unwrap();
    assert!(other.restore(state).is_none());
    for k in 0..60 {
        let there = Measurement { x: x + 0.1 * f64::from(k + 5), vx: 5.0, ..Measurement::default() };
        let told = if k < 30 { nan } else { there };
        let reports = [&mut controller, &mut other].map(|one| *one.step(&told).unwrap());
        assert_eq!(reports[0].steer_cmd.to_bits(), reports[1].steer_cmd.to_bits());
        assert_eq!((reports[0].accel_cmd, reports[0].status), (reports[1].accel_cmd, reports[1].status));
    }
}

/// Statuses of a drive but those of an ordinary one, and the largest error.
fn alarms(mut advance: impl FnMut() -> (ControlStatus, f64), steps: u32) -> (Vec<ControlStatus>, f64) {
    let (mut odd, mut error) = (Vec::new(), 0.0_f64);
    for _ in 0..steps {
        let (status, off) = advance();
        error = error.max(off.abs());
        if !matches!(status, ControlStatus::Optimal | ControlStatus::Finished) {
            odd.push(status);
        }
    }
    (odd, error)
}

/// The same of a car.
fn alarms_of_car(closed: &mut ClosedLoop, steps: u32) -> (Vec<ControlStatus>, f64) {
    alarms(
        || {
            closed.advance().unwrap();
            (closed.controller().report().status, closed.lateral_error())
        },
        steps,
    )
}

/// A bend of 20 m radius and back, slowly, and then faster.
fn ordinary_road() -> Arc<Path> {
    road(&[(60.0, 0.0), (70.0, 0.05), (70.0, -0.05), (100.0, 0.0), (60.0, 0.02)])
}

#[test]
fn ordinary_drives_of_cars_hear_nothing() {
    let plain = Effects::default;
    let late = Effects { steer_lag: 0.2, steer_delay: 0.12, ..plain() };
    let situations = [
        ("noise", plain(), 2.0, 0.02),
        ("low friction", Effects { road_friction: 0.4, ..plain() }, 2.0, 0.02),
        ("late steering", late, 0.0, 0.02),
        ("crosswind", Effects { wind_y: 15.0, ..plain() }, 0.0, 0.02),
        ("payload", Effects { payload: 300.0, payload_x: -1.0, ..plain() }, 0.0, 0.02),
        ("steps of 5 ms", plain(), 0.0, 0.005),
        ("steps of 50 ms", plain(), 0.0, 0.05),
    ];
    for car in BUILTIN {
        let parameters = builtin(car).unwrap();
        for (what, effects, noise, step) in &situations {
            let path = ordinary_road();
            let mut settings = ControllerParameters::for_car(&parameters);
            if *what == "late steering" {
                // It is the guard that is tested, not how the default stands a late actuator.
                settings.mpc.r_rate = 0.3;
                settings.mpc.q_e1_rate = 1.0;
                settings.mpc.q_e2 = 2.0;
            }
            let controller = Controller::new(settings, path).unwrap();
            let mut closed = ClosedLoop::at_start(controller, &parameters, effects, *step).unwrap();
            if *noise > 0.0 {
                closed = closed.with_noise(SensorNoise::TYPICAL.scaled(*noise), 11);
            }
            let steps = (25.0 / step) as u32;
            let (odd, error) = alarms_of_car(&mut closed, steps);
            let guarded = [ControlStatus::Bridged, ControlStatus::SafeStop, ControlStatus::Slowed];
            let heard: Vec<_> = odd.iter().filter(|status| guarded.contains(status)).collect();
            assert!(heard.is_empty() && error < 1.0, "{car}, {what}: {heard:?}, {error} m");
        }
    }
}

#[test]
fn ordinary_drives_of_trucks_hear_nothing() {
    for truck in BUILTIN_TRUCKS {
        let parameters = builtin_truck(truck).unwrap();
        for noise in [0.0, 2.0] {
            let controller =
                TruckController::new(TruckControllerParameters::for_truck(&parameters), ordinary_road())
                    .unwrap();
            let effects = TruckEffects::default();
            let mut closed = TruckClosedLoop::at_start(controller, &parameters, &effects, 0.02).unwrap();
            if noise > 0.0 {
                closed = closed.with_noise(SensorNoise::TYPICAL_TRUCK.scaled(noise), 3);
            }
            let (odd, error) = alarms(
                || {
                    closed.advance().unwrap();
                    (closed.controller().report().status, closed.lateral_error())
                },
                1500,
            );
            assert!(odd.is_empty() && error < 0.5, "{truck}: {odd:?}, {error} m");
        }
    }
}

#[test]
fn an_articulation_that_is_stuck_is_no_new_start() {
    let parameters = builtin_truck("truck_simulation").unwrap();
    for angle in [1.0, 3.0] {
        let controller =
            TruckController::new(TruckControllerParameters::for_truck(&parameters), ordinary_road()).unwrap();
        let effects = TruckEffects::default();
        let mut closed = TruckClosedLoop::at_start(controller, &parameters, &effects, 0.02)
            .unwrap()
            .with_fault(move |time, told| {
                if time > 9.99 {
                    (told.articulation, told.articulation_rate) = (angle, 0.0);
                }
            });
        let mut error = 0.0_f64;
        for _ in 0..1500 {
            closed.advance().unwrap();
            error = error.max(closed.lateral_error().abs());
        }
        let report = closed.controller().report();
        let bridged: Vec<&str> = closed.controller().bridged_signals().map(|signal| signal.name).collect();
        assert_eq!(report.status, ControlStatus::SafeStop, "{angle}: {error} m");
        assert!(bridged.contains(&"articulation") && error < 0.5, "{angle}: {error} m, {bridged:?}");
    }
}

#[test]
fn a_lost_articulation_is_bridged() {
    let parameters = builtin_truck("truck_simulation").unwrap();
    let controller =
        TruckController::new(TruckControllerParameters::for_truck(&parameters), ordinary_road()).unwrap();
    let effects = TruckEffects::default();
    let mut closed = TruckClosedLoop::at_start(controller, &parameters, &effects, 0.02).unwrap().with_fault(
        |time, told| {
            if time > 9.99 && time < 10.25 {
                told.articulation += 0.5;
            }
        },
    );
    for step in 0..700 {
        closed.advance().unwrap();
        let status = closed.controller().report().status;
        let bridged = (500..513).contains(&step);
        assert_eq!(status == ControlStatus::Bridged, bridged, "step {step}: {status:?}");
    }
    assert!(closed.lateral_error().abs() < 0.2);
}

#[test]
fn a_start_beside_the_path_is_driven_as_before() {
    let mut controller = straight();
    let report =
        controller.step(&Measurement { x: 20.0, y: 8.0, vx: 4.0, ..Measurement::default() }).unwrap();
    assert_eq!((report.status, report.speed_ref), (ControlStatus::FarFromPath, 3.0));
}

#[test]
fn a_vehicle_that_leaves_the_path_slows_down_and_stops() {
    let mut controller = straight();
    let (mut y, mut last, yaw) = (0.0, f64::INFINITY, 0.2_f64);
    for k in 0..190 {
        // Straight off the road, whatever it steers: ice.
        let x = 10.0 + 0.1 * yaw.cos() * f64::from(k);
        let told = Measurement { x, y, yaw, vx: 5.0, ..Measurement::default() };
        let report = *controller.step(&told).unwrap();
        assert!(report.speed_ref <= last + 1e-9 || y < 1.2, "{} after {last}", report.speed_ref);
        match y {
            ..0.95 => assert_eq!(report.status, ControlStatus::Optimal, "{y}"),
            1.1..3.4 => assert_eq!(report.status, ControlStatus::Slowed, "{y}"),
            3.6.. => assert_eq!((report.status, report.speed_ref), (ControlStatus::FarFromPath, 0.0)),
            _ => (),
        }
        last = report.speed_ref;
        y += 0.1 * yaw.sin();
    }
}

#[test]
fn a_vehicle_that_stands_off_its_path_is_held_there() {
    let mut controller = straight();
    along(&mut controller, 10.0, 60);
    let mut vx = 5.0_f64;
    let (mut x, mut y, yaw) = (16.0, 0.0, 0.35_f64);
    let mut stood = 0;
    for _ in 0..800 {
        // Straight off the road, whatever it steers; the brakes hold it at rest, with the same bits at each step.
        let report = *controller.step(&Measurement { x, y, yaw, vx, ..Measurement::default() }).unwrap();
        if y > 3.6 {
            assert_eq!(
                (report.status, report.speed_ref),
                (ControlStatus::FarFromPath, 0.0),
                "at {y} m, {vx} m/s"
            );
            assert!(report.accel_cmd < 0.0, "{}", report.accel_cmd);
            vx = (vx + 0.02 * report.accel_cmd).max(0.0);
        }
        stood += u32::from(vx == 0.0);
        (x, y) = (x + 0.02 * vx * yaw.cos(), y + 0.02 * vx * yaw.sin());
    }
    assert!(stood > 400, "{stood} steps");
}

/// Brakes take the grip that brings a vehicle back which turns faster than its road.
#[test]
fn a_car_that_comes_to_its_road_at_an_angle_is_not_braked_into_a_spin() {
    let car = builtin("c_class").unwrap();
    for (yaw, speed) in [(0.15, 25.0), (0.25, 18.5), (0.2, 25.0)] {
        let path = road(&[(500.0, 0.0)]);
        let mut parameters = ControllerParameters::for_car(&car);
        parameters.speed.limit = 25.0;
        let controller = Controller::new(parameters, path.clone()).unwrap();
        let mut vehicle = Car::new(&car, &Effects::default(), None).unwrap();
        let start = path.at(0.0);
        vehicle.place(start.x, start.y, start.yaw + yaw, speed);
        let mut closed = ClosedLoop::new(controller, vehicle, 0.02);
        for step in 0..600 {
            closed.advance().unwrap();
            let report = closed.controller().report();
            let at = format!("{yaw} rad, {speed} m/s, step {step}: e1 {} m, e2 {} rad", report.e1, report.e2);
            assert!(report.e1.abs() < 4.0 && report.e2.abs() < 0.7, "{at}");
            assert!(step < 300 || report.e1.abs() < 0.3, "{at}");
        }
    }
}

/// A map's line: 40 m, to the left, 30 m, to the right, 40 m, tighter than a car turns. It stood there, turned by more than 1 rad.
#[test]
fn a_right_angle_is_driven_round_at_a_creep() {
    for spacing in [0.5, 1.0, 2.0] {
        let point = |k: u32| {
            let s = f64::from(k) * spacing;
            Sample::at(s.min(40.0) + (s - 70.0).max(0.0), (s - 40.0).clamp(0.0, 30.0))
        };
        let corners = (0..=(110.0 / spacing) as u32).map(point).collect();
        let path = Arc::new(Path::from_samples(corners, Closure::Open).unwrap());
        let car = builtin("c_class").unwrap();
        let controller = Controller::new(ControllerParameters::for_car(&car), path).unwrap();
        let mut closed = ClosedLoop::at_start(controller, &car, &Effects::default(), 0.02).unwrap();
        let drive = closed.record(200.0, |_, _| true);
        assert_eq!(drive.ending.end, End::Road, "each {spacing} m: {}", drive.ending.reason());
    }
}

#[test]
fn a_vehicle_that_spins_on_a_straight_road_stops() {
    let mut controller = straight();
    let mut stops = 0;
    for k in 0..90 {
        let (time, yaw) = (0.02 * f64::from(k), 0.02 * f64::from(k));
        let (vx, vy) = (8.0 * yaw.cos(), -8.0 * yaw.sin());
        let told = Measurement { x: 10.0 + 8.0 * time, yaw, vx, vy, yaw_rate: 1.0, ..Measurement::default() };
        let report = *controller.step(&told).unwrap();
        assert!(report.status != ControlStatus::FarFromPath || report.speed_ref == 0.0, "{yaw}: {report:?}");
        stops += u32::from(report.speed_ref == 0.0);
    }
    assert!(stops > 30, "{stops}");
}

/// A wheel's radius or an odometer's scale is a few percent off: the poses go on faster or slower than the speed says.
#[test]
fn a_speed_that_is_a_few_percent_off_is_no_fault() {
    for (limit, scale) in [(30.0, 0.97), (30.0, 1.05), (20.0, 0.93), (8.0, 0.95)] {
        let car = builtin("c_class").unwrap();
        let mut parameters = ControllerParameters::for_car(&car);
        parameters.speed.limit = limit;
        let controller = Controller::new(parameters, fast_road()).unwrap();
        let effects = Effects { speed_scale: scale, ..Effects::default() };
        let mut closed = ClosedLoop::at_start(controller, &car, &effects, 0.02).unwrap();
        let (odd, error) = alarms_of_car(&mut closed, 1500);
        assert!(odd.is_empty() && error < 0.5, "{limit} m/s, {scale}: {odd:?}, {error} m");
    }
}

/// Which of x, y, yaw, vx, vy and yaw rate are told anew.
const POSE: [bool; 6] = [true, true, true, false, false, false];
const ALL: [bool; 6] = [true; 6];
/// A satellite receiver's place beside an inertial unit's yaw.
const PLACE: [bool; 6] = [true, true, false, false, false, false];

/// A drive whose sensors, those of `slow`, tell something new at each `every`-th step only, up to a time.
fn drive_with_slow_sensors(slow: [bool; 6], every: u32, speed: f64, until: f64, duration: f64) -> Outcome {
    let (_, controller, vehicle) = begun(20.0, speed, 0.5 * speed);
    let (mut kept, mut step) = (None::<Measurement>, 0);
    let mut closed = ClosedLoop::new(controller, vehicle, 0.02).with_fault(move |time, told| {
        if let Some(kept) = kept.filter(|_| step % every != 0 || time > until) {
            let old = [kept.x, kept.y, kept.yaw, kept.vx, kept.vy, kept.yaw_rate];
            let places =
                [&mut told.x, &mut told.y, &mut told.yaw, &mut told.vx, &mut told.vy, &mut told.yaw_rate];
            for ((place, old), _) in places.into_iter().zip(old).zip(slow).filter(|(_, slow)| *slow) {
                *place = old;
            }
        }
        kept = Some(*told);
        step += 1;
    });
    let mut outcome = Outcome::default();
    for step in 0..(duration / 0.02) as u32 {
        closed.advance().unwrap();
        let report = closed.controller().report();
        outcome.error = outcome.error.max(closed.lateral_error().abs());
        outcome.optimal +=
            u32::from(step % every != 0 && step > 1 && report.status == ControlStatus::Optimal);
        outcome.last = report.status;
    }
    outcome.speed = closed.vehicle().output().vx;
    outcome
}

#[test]
fn sensors_slower_than_the_controller_are_bridged_and_when_they_die_the_vehicle_stops() {
    let receivers = [ALL, POSE, PLACE].into_iter().flat_map(|slow| [2, 5, 10].map(|every| (slow, every)));
    for (slow, every) in receivers {
        for speed in [4.0, 10.0, 20.0] {
            let outcome = drive_with_slow_sensors(slow, every, speed, f64::INFINITY, 18.0);
            let what =
                format!("{slow:?} each {every} at {speed}: {:.3} m, {:.2} m/s", outcome.error, outcome.speed);
            assert!(outcome.error < 0.5 && outcome.speed > 0.9 * speed, "{what}");
            assert_eq!(outcome.optimal, 0, "{what}");
            for until in [0.05, 3.0] {
                let outcome = drive_with_slow_sensors(slow, every, speed, until, 25.0);
                let what = format!(
                    "{slow:?} each {every} at {speed} until {until}: {:.3} m, {:.2} m/s",
                    outcome.error, outcome.speed
                );
                assert!(outcome.error < 2.0 && outcome.speed < 0.1, "{what}");
                assert_eq!(outcome.last, ControlStatus::SafeStop, "{what}");
            }
        }
    }
}

/// One wrong channel of the pose shortens its way, which is no scale of the speed to steer the stop by.
#[test]
fn a_wrong_channel_of_the_pose_teaches_no_scale() {
    let wrong: [(&str, f64, Fault); 3] = [
        ("yaw", 1.0, |told, _, _| told.yaw += 0.6),
        ("yaw the other way", 2.0, |told, _, _| told.yaw -= 0.7),
        ("y stays", 0.2, |told, before, _| told.y = before.y),
    ];
    for (name, length, fault) in wrong {
        for station in STATIONS {
            let outcome = drive(26.0, station, length, fault, 8.0, 0.0);
            let allowed = if length < 0.5 { 0.5 } else { 2.0 };
            assert!(outcome.error < allowed, "{name} at {station} m: {:.3} m", outcome.error);
        }
    }
}

/// A fault that grows, by the time since its begin, s: the measurement, and the last one before.
type Creeping = fn(&mut Measurement, &Measurement, f64);

/// What stays inside every gate draws the estimate along; place, yaw and yaw rate tell of one motion three times.
#[test]
fn a_sensor_that_creeps_away_is_found_and_the_stop_is_on_the_road() {
    // Name, length, s, and largest error, m: of yaw and rate together the place alone is left.
    let faults: [(&str, f64, f64, Creeping); 7] = [
        ("yaw rests", 2.0, 1.5, |told, before, _| told.yaw = before.yaw),
        ("yaw and rate rest", 2.0, 3.0, |told, before, _| {
            (told.yaw, told.yaw_rate) = (before.yaw, before.yaw_rate)
        }),
        ("yaw drifts", 5.0, 1.5, |told, _, time| told.yaw += 0.05 * time),
        ("yaw drifts fast", 2.0, 1.5, |told, _, time| told.yaw += 0.3 * time),
        ("an inertial unit drifts", 5.0, 1.5, |told, _, time| {
            told.yaw += 0.05 * time;
            told.yaw_rate += 0.05;
        }),
        ("rate of the other sign", 2.0, 1.5, |told, _, _| told.yaw_rate *= -1.0),
        ("rate off", 2.0, 1.5, |told, _, _| told.yaw_rate += 0.1),
    ];
    for (name, length, allowed, fault) in faults {
        for limit in [10.0, 26.0] {
            for station in STATIONS {
                for noise in [0.0, 1.0] {
                    let (_, controller, vehicle) = begun(station, limit, limit);
                    let mut before = Measurement::default();
                    let mut closed =
                        ClosedLoop::new(controller, vehicle, 0.02).with_fault(move |time, told| {
                            if time > 0.99 && time < 0.99 + length {
                                fault(told, &before, time - 0.99);
                            } else {
                                before = *told;
                            }
                        });
                    if noise > 0.0 {
                        closed = closed.with_noise(SensorNoise::TYPICAL.scaled(noise), 7);
                    }
                    let (_, error) = alarms_of_car(&mut closed, 500);
                    let what = format!("{name} at {limit} m/s, {station} m, noise {noise}: {error:.3} m");
                    assert!(error < allowed, "{what}");
                }
            }
        }
    }
}

/// What ordinary sensors miss for good is theirs, and no fault.
#[test]
fn ordinary_errors_of_sensors_are_no_fault() {
    let errors: [(&str, Wrong); 8] = [
        ("yaw mounted askew", |told| told.yaw += 0.03),
        ("slip that nobody measures", |told| told.vy = 0.0),
        ("antenna ahead", |told| {
            told.x += told.yaw.cos();
            told.y += told.yaw.sin();
        }),
        ("bias of the rate", |told| told.yaw_rate += 0.05),
        ("large bias of the rate", |told| told.yaw_rate -= 0.1),
        ("scale of the rate", |told| told.yaw_rate *= 1.05),
        ("steps of the yaw", |told| told.yaw = (told.yaw / 0.005).round() * 0.005),
        ("steps of the place", |told| {
            told.x = (told.x / 0.05).round() * 0.05;
            told.y = (told.y / 0.05).round() * 0.05;
        }),
    ];
    for (name, wrong) in errors {
        for limit in [10.0, 26.0] {
            let (_, controller, vehicle) = begun(20.0, limit, 0.7 * limit);
            let mut closed =
                ClosedLoop::new(controller, vehicle, 0.02).with_fault(move |_, told| wrong(told));
            closed = closed.with_noise(SensorNoise::TYPICAL, 9);
            let (odd, error) = alarms_of_car(&mut closed, 900);
            assert!(odd.is_empty() && error < 0.6, "{name} at {limit} m/s: {odd:?}, {error:.3} m");
        }
    }
}

/// A host's outputs are zero until they are first written: no measurements of a vehicle in motion.
#[test]
fn a_vehicle_in_motion_whose_first_samples_are_zero_drives_on() {
    let truck = builtin_truck(BUILTIN_TRUCKS[0]).unwrap();
    for (zeros, speed) in [(1, 9.0), (3, 9.0), (1, 14.0), (15, 9.0)] {
        let mut parameters = TruckControllerParameters::for_truck(&truck);
        (parameters.speed.limit, parameters.speed.controller) = (speed, 1);
        let controller = TruckController::new(parameters, fast_road()).unwrap();
        let mut vehicle = Truck::new(&truck, &TruckEffects::default(), None).unwrap();
        let start = fast_road().at(20.0);
        vehicle.place(start.x, start.y, start.yaw, speed);
        let mut step = 0;
        let mut closed = TruckClosedLoop::new(controller, vehicle, 0.02).with_fault(move |_, told| {
            if step < zeros {
                *told = Measurement::default();
            }
            step += 1;
        });
        let (mut slowest, mut error) = (f64::INFINITY, 0.0_f64);
        for _ in 0..500 {
            closed.advance().unwrap();
            slowest = slowest.min(closed.vehicle().output().vx);
            error = error.max(closed.lateral_error().abs());
        }
        assert!(slowest > 0.9 * speed && error < 0.3, "{zeros} at {speed} m/s: {slowest} m/s, {error} m");
    }
}

/// What is wrong with all measurements.
type Wrong = fn(&mut Measurement);

#[test]
fn an_input_that_nobody_connects_ends_in_a_stop_on_the_road() {
    let unconnected: [(&str, Wrong); 2] =
        [("yaw rate", |told| told.yaw_rate = 0.0), ("speed", |told| told.vx = 0.0)];
    // From rest: there is nothing that an earlier measurement could contradict.
    for (name, fault) in unconnected {
        let (_, controller, vehicle) = begun(20.0, 20.0, 0.0);
        let mut closed = ClosedLoop::new(controller, vehicle, 0.02).with_fault(move |_, told| fault(told));
        let (mut error, mut moved, mut stood) = (0.0_f64, 0, 0);
        for _ in 0..3000 {
            closed.advance().unwrap();
            error = error.max(closed.lateral_error().abs());
            let moves = closed.vehicle().output().vx > 0.05;
            moved += u32::from(moves);
            stood = if moves { 0 } else { stood + 1 };
        }
        let what = format!("{name}: {error:.3} m, moved for {moved} steps, stood for {stood}");
        assert_eq!(closed.controller().report().status, ControlStatus::SafeStop, "{what}");
        let bridged: Vec<&str> = closed.controller().bridged_signals().map(|signal| signal.name).collect();
        assert_eq!(bridged, [if name == "speed" { "vx" } else { "yaw_rate" }], "{what}");
        // It does not set off again.
        assert!(error < 0.5 && moved > 10 && stood > 1000, "{what}");
    }
}

#[test]
fn signals_that_contradict_one_another_from_the_start_stop_the_vehicle() {
    let wrong: [(&str, Wrong); 4] = [
        ("a speed in km/h", |told| told.vx *= 3.6),
        ("a speed in mph", |told| told.vx *= 2.237),
        ("five times the speed", |told| told.vx *= 5.0),
        ("a yaw rate in degrees", |told| told.yaw_rate *= 57.3),
    ];
    for (name, fault) in wrong {
        let path = road(&[(40.0, 1.0 / 60.0), (300.0, -1.0 / 80.0)]);
        let car = builtin("c_class").unwrap();
        let controller = Controller::new(ControllerParameters::for_car(&car), path.clone()).unwrap();
        let mut vehicle = Car::new(&car, &Effects::default(), None).unwrap();
        let start = path.at(5.0);
        vehicle.place(start.x, start.y, start.yaw, 8.0);
        let mut closed = ClosedLoop::new(controller, vehicle, 0.02).with_fault(move |_, told| fault(told));
        let mut error = 0.0_f64;
        let mut fastest_after_stop = None::<f64>;
        for _ in 0..3000 {
            closed.advance().unwrap();
            error = error.max(closed.lateral_error().abs());
            let speed = closed.vehicle().output().vx.abs();
            if fastest_after_stop.is_some() || speed < 0.05 {
                fastest_after_stop = Some(fastest_after_stop.unwrap_or(0.0).max(speed));
            }
        }
        let status = closed.controller().report().status;
        let what = format!("{name}: {status:?}, {error:.3} m, {fastest_after_stop:?} m/s");
        assert_eq!(status, ControlStatus::SafeStop, "{what}");
        // It does not set off again.
        assert!(error < 2.0 && fastest_after_stop.is_some_and(|speed| speed < 0.1), "{what}");
    }
}

#[test]
fn a_controller_that_is_told_nothing_asks_for_no_drive() {
    let mut controller = straight();
    for step in 0..500 {
        let report = *controller.step(&Measurement::default()).unwrap();
        if step > 150 {
            assert_eq!(report.status, ControlStatus::SafeStop, "step {step}");
            assert!(report.accel_cmd <= 0.0, "step {step}: {}", report.accel_cmd);
        }
    }
}

#[test]
fn a_yaw_rate_at_the_rail_of_its_converter_is_no_new_start() {
    for rate in [9999.0, 32767.0, -65535.0] {
        for length in [0.2, 0.5, 1.0] {
            RATE.with(|it| it.set(rate));
            let outcome =
                drive(10.0, 20.0, length, |told, _, _| told.yaw_rate = RATE.with(Cell::get), 6.0, 0.0);
            let what = format!("{rate} rad/s for {length} s: {:.3} m", outcome.error);
            assert!(outcome.error < 0.5 && outcome.optimal == 0, "{what}");
        }
    }
}

thread_local! {
    /// The yaw rate of the test above: a fault is a function.
    static RATE: Cell<f64> = const { Cell::new(0.0) };
}

#[test]
fn a_vehicle_that_has_stopped_without_sensors_stands_in_the_estimate_as_well() {
    for begin in [0.14, 3.0, 3.7] {
        let path = fast_road();
        let car = builtin("c_class").unwrap();
        let controller = Controller::new(ControllerParameters::for_car(&car), path.clone()).unwrap();
        let mut vehicle = Car::new(&car, &Effects::default(), None).unwrap();
        let start = path.at(20.0);
        vehicle.place(start.x, start.y, start.yaw, 10.0);
        let mut kept = Measurement::default();
        let mut closed = ClosedLoop::new(controller, vehicle, 0.02)
            .with_fault(move |time, told| if time > begin { *told = kept } else { kept = *told });
        for step in 0..1500 {
            closed.advance().unwrap();
            let report = closed.controller().report();
            let there = f64::from(step) * 0.02;
            let what = format!(
                "from {begin} s, at {there:.2} s: e1 {:.3} m, steer {:.3} rad",
                report.e1, report.steer_cmd
            );
            assert!(report.e1.abs() < 1.0 && report.steer_cmd.abs() < 0.3, "{what}");
        }
        assert!(closed.vehicle().output().vx.abs() < 0.05);
    }
}
