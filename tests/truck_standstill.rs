//! A standing truck stays where it is.

use rfl_mpc::vehicle::{
    BUILTIN_TRUCKS, GRAVITY, Truck, TruckEffects, TruckInput, TruckStatus, builtin_truck,
};

fn truck(name: &str, effects: &TruckEffects) -> Truck {
    Truck::new(&builtin_truck(name).unwrap(), effects, None).unwrap()
}

#[test]
fn it_stays_exactly_where_it_is_on_a_level_road() {
    for name in BUILTIN_TRUCKS {
        let mut truck = truck(name, &TruckEffects::default());
        let trailer = truck.output().trailer.x;
        for _ in 0..500 {
            truck.step(&TruckInput::default(), 0.01).unwrap();
        }
        let out = truck.output();
        assert_eq!(out.status, TruckStatus::Standstill, "{name}");
        for (signal, value) in [("y", out.y), ("yaw", out.yaw), ("vy", out.vy), ("yaw_rate", out.yaw_rate)] {
            assert_eq!(value, 0.0, "{name} {signal}");
        }
        assert_eq!((out.articulation, out.trailer.y, out.trailer.roll), (0.0, 0.0, 0.0), "{name}");
        assert!(out.x.abs() < 1e-6 && out.vx.abs() < 1e-9, "{name}: {} m, {} m/s", out.x, out.vx);
        assert!((out.trailer.x - trailer).abs() < 1e-6, "{name}");
    }
}

#[test]
fn steering_at_standstill_does_not_move_it() {
    for name in BUILTIN_TRUCKS {
        let mut truck = truck(name, &TruckEffects::default());
        for k in 0..1000 {
            let steer_cmd = 0.5 * (0.01 * f64::from(k)).sin();
            truck.step(&TruckInput { steer_cmd, accel_cmd: -1.0 }, 0.01).unwrap();
        }
        let out = truck.output();
        assert!(
            out.x.hypot(out.y) < 1e-3 && out.yaw.abs() < 1e-3 && out.articulation.abs() < 1e-3,
            "{out:?}"
        );
    }
}

#[test]
fn brakes_hold_it_on_a_slope() {
    for (grade, bank) in [(0.15, 0.0), (-0.15, 0.0), (0.1, 0.08)] {
        let mut effects = TruckEffects::default();
        (effects.vehicle.road_grade, effects.vehicle.road_bank) = (grade, bank);
        for name in BUILTIN_TRUCKS {
            let mut truck = truck(name, &effects);
            let hold = TruckInput { steer_cmd: 0.0, accel_cmd: -4.0 };
            for _ in 0..600 {
                truck.step(&hold, 0.01).unwrap();
            }
            let settled = *truck.output();
            assert!(settled.x.hypot(settled.y) < 0.06, "{name}: sank by {} m, {} m", settled.x, settled.y);
            for _ in 0..3000 {
                truck.step(&hold, 0.01).unwrap();
            }
            let out = truck.output();
            let creep = (out.x - settled.x).hypot(out.y - settled.y)
                + (out.trailer.x - settled.trailer.x).hypot(out.trailer.y - settled.trailer.y);
            assert!(creep < 5e-4, "{name} on {grade} {bank}: {creep} m in 30 s");
            assert_eq!(out.status, TruckStatus::Standstill, "{name}");
            let weight: f64 = out.wheels.iter().map(|wheel| wheel.load).sum();
            let p = builtin_truck(name).unwrap();
            let expected = (p.tractor.mass + p.trailer.mass) * GRAVITY * grade.cos() * bank.cos();
            assert!((weight / expected - 1.0).abs() < 2e-3, "{name}: {weight} N, expected {expected} N");
        }
    }
}

#[test]
fn braking_ends_at_rest_and_does_not_push_backwards() {
    for name in BUILTIN_TRUCKS {
        for steer_cmd in [0.0, 0.15] {
            let mut truck = truck(name, &TruckEffects::default());
            truck.place(0.0, 0.0, 0.0, 8.0);
            let mut furthest = 0.0_f64;
            for _ in 0..800 {
                truck.step(&TruckInput { steer_cmd, accel_cmd: -3.0 }, 0.01).unwrap();
                furthest = furthest.max(truck.output().x);
            }
            let out = truck.output();
            assert!(out.vx.abs() < 1e-3 && out.articulation_rate.abs() < 1e-3, "{name}: {} m/s", out.vx);
            // Springs of tyres and suspension swing back a little.
            assert!(furthest - out.x < 0.05, "{name}: {} m back", furthest - out.x);
            assert_eq!(out.status, TruckStatus::Standstill, "{name}");
        }
    }
}

#[test]
fn without_brakes_it_rolls_down_backwards_and_stays_sound() {
    let mut effects = TruckEffects::default();
    effects.vehicle.road_grade = 0.1;
    let mut truck = truck("truck_simulation", &effects);
    for _ in 0..500 {
        truck.step(&TruckInput::default(), 0.01).unwrap();
    }
    let out = truck.output();
    // g (sin(grade) - rolling resistance) t, less what spins the wheels up and the air.
    let expected = -GRAVITY * (0.1_f64.sin() - 0.006 * 0.1_f64.cos()) * 5.0;
    assert!((out.vx / expected - 1.0).abs() < 0.04, "{} m/s, expected {expected} m/s", out.vx);
    assert_eq!((out.vy, out.articulation), (0.0, 0.0));
}
