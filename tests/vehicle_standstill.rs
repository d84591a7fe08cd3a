//! A standing car stays where it is.

use rfl_mpc::vehicle::{BUILTIN, Car, CarInput, CarStatus, Effects, builtin};

fn car(name: &str, effects: &Effects) -> Car {
    Car::new(&builtin(name).unwrap(), effects, None).unwrap()
}

#[test]
fn it_stays_exactly_where_it_is_on_a_level_road() {
    for name in BUILTIN {
        let mut car = car(name, &Effects::default());
        for _ in 0..500 {
            car.step(&CarInput::default(), 0.01).unwrap();
        }
        let out = car.output();
        assert_eq!(out.status, CarStatus::Standstill, "{name}");
        for (signal, value) in [("y", out.y), ("yaw", out.yaw), ("vy", out.vy), ("yaw_rate", out.yaw_rate)] {
            assert_eq!(value, 0.0, "{name} {signal}");
        }
        // The longitudinal shift of a tyre's characteristic may settle by a fraction of a millimetre.
        assert!(out.x.abs() < 1e-3 && out.vx.abs() < 1e-6, "{name}: {} m, {} m/s", out.x, out.vx);
    }
}

#[test]
fn steering_at_standstill_does_not_move_it() {
    let mut car = car("c_class", &Effects::default());
    for k in 0..1000 {
        car.step(&CarInput { steer_cmd: 0.5 * (0.01 * f64::from(k)).sin(), accel_cmd: -1.0 }, 0.01).unwrap();
    }
    let out = car.output();
    assert!(out.x.hypot(out.y) < 1e-3 && out.yaw.abs() < 1e-3, "{out:?}");
}

#[test]
fn brakes_hold_it_on_a_slope() {
    for (grade, bank) in [(0.15, 0.0), (-0.15, 0.0), (0.1, 0.1)] {
        let effects = Effects { road_grade: grade, road_bank: bank, ..Effects::default() };
        for name in BUILTIN {
            let mut car = car(name, &effects);
            let hold = CarInput { steer_cmd: 0.0, accel_cmd: -4.0 };
            for _ in 0..300 {
                car.step(&hold, 0.01).unwrap();
            }
            let settled = *car.output();
            // Onto springs of tyres and brakes: millimetres, and then no creep.
            assert!(settled.x.hypot(settled.y) < 0.03, "{name}: sank by {} m, {} m", settled.x, settled.y);
            for _ in 0..3000 {
                car.step(&hold, 0.01).unwrap();
            }
            let out = car.output();
            let creep = (out.x - settled.x).hypot(out.y - settled.y);
            assert!(creep < 1e-4, "{name} on {grade} {bank}: {creep} m in 30 s");
            assert_eq!(out.status, CarStatus::Standstill, "{name}");
            let weight: f64 = out.wheels.iter().map(|wheel| wheel.load).sum();
            let mass = builtin(name).unwrap().vehicle.mass;
            let expected = mass * 9.81 * grade.cos() * bank.cos();
            assert!((weight - expected).abs() < 1e-3 * expected, "{name}: {weight} N, expected {expected} N");
        }
    }
}

#[test]
fn braking_ends_at_rest_and_does_not_push_backwards() {
    for name in BUILTIN {
        let mut car = car(name, &Effects::default());
        car.place(0.0, 0.0, 0.0, 8.0);
        let mut furthest = 0.0_f64;
        for _ in 0..600 {
            car.step(&CarInput { steer_cmd: 0.0, accel_cmd: -4.0 }, 0.01).unwrap();
            furthest = furthest.max(car.output().x);
        }
        let out = car.output();
        assert!(out.vx.abs() < 1e-4, "{name}: {} m/s", out.vx);
        // Springs of tyres and suspension swing back a little.
        assert!(furthest - out.x < 0.03, "{name}: {} m back", furthest - out.x);
        // v^2 / 2a, and the lag of the brakes.
        let lag = builtin(name).unwrap().drive.lag;
        let expected = 8.0 + 8.0 * lag;
        assert!(
            (out.x - expected).abs() < 0.08 * expected,
            "{name}: stopped after {} m, {expected} m",
            out.x
        );
    }
}

#[test]
fn without_brakes_it_rolls_down_backwards_and_stays_sound() {
    let effects = Effects { road_grade: 0.1, ..Effects::default() };
    let mut car = car("bmw_320i", &effects);
    for _ in 0..500 {
        car.step(&CarInput::default(), 0.01).unwrap();
    }
    // g sin(grade) t, less what spins the wheels up: 4 I / R^2 beside the mass.
    let p = builtin("bmw_320i").unwrap();
    let radius = 0.344_f64;
    let wheels = 2.0 * (p.axle.front.wheel_inertia + p.axle.rear.wheel_inertia) / (radius * radius);
    let expected = -9.81 * 0.1_f64.sin() * 5.0 * p.vehicle.mass / (p.vehicle.mass + wheels);
    let out = car.output();
    assert!((out.vx - expected).abs() < 0.02 * expected.abs(), "{} m/s, expected {expected} m/s", out.vx);
    assert_eq!(out.vy, 0.0);
}
