//! Saved and restored cars go on bit for bit; nothing makes a car panic or give a number that is none.

use proptest::prelude::*;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::vehicle::{BUILTIN, Car, CarInput, Effects, StepError, builtin};
use std::sync::Arc;

fn full() -> Effects {
    Effects {
        steer_delay: 0.12,
        steer_backlash: 0.01,
        sensor_delay: 0.07,
        drive_lag: 0.2,
        ..Effects::default()
    }
}

fn input(k: u32) -> CarInput {
    let t = 0.01 * f64::from(k);
    CarInput { steer_cmd: 0.05 * (2.0 * t).sin(), accel_cmd: 1.5 * (0.7 * t).cos() }
}

/// A banked road with an icy patch from 30 m to 60 m.
fn road() -> Arc<Path> {
    let sample = |i: u32| {
        let x = 5.0 * f64::from(i);
        let friction = if (30.0..60.0).contains(&x) { 0.2 } else { 1.0 };
        Sample { bank: Some(0.02), friction: Some(friction), ..Sample::at(x, 0.0) }
    };
    Arc::new(Path::from_samples((0..60).map(sample).collect(), Closure::Open).unwrap())
}

#[test]
fn restored_cars_continue_bit_for_bit() {
    for road in [None, Some(road())] {
        let new = || {
            let mut car = Car::new(&builtin("c_class").unwrap(), &full(), road.clone()).unwrap();
            car.place(0.0, 0.0, 0.0, 14.0);
            car
        };
        let mut original = new();
        for k in 0..137 {
            original.step(&input(k), 0.01).unwrap();
        }
        let mut bytes = Vec::new();
        original.save(&mut bytes);
        let mut fresh = new();
        fresh.restore(&bytes).unwrap();
        assert_eq!(fresh.output(), original.output());
        let mut rewound = Vec::new();
        for k in 137..300 {
            original.step(&input(k), 0.01).unwrap();
            fresh.step(&input(k), 0.01).unwrap();
            assert_eq!(fresh.output(), original.output(), "step {k}");
            rewound.push(*original.output());
        }
        // And back in time, in the same car.
        original.restore(&bytes).unwrap();
        for k in 137..300 {
            original.step(&input(k), 0.01).unwrap();
            assert_eq!(original.output(), &rewound[k as usize - 137]);
        }
    }
}

#[test]
fn bytes_of_something_else_are_refused_and_change_nothing() {
    let mut car = Car::new(&builtin("c_class").unwrap(), &full(), None).unwrap();
    for k in 0..50 {
        car.step(&input(k), 0.01).unwrap();
    }
    let (mut bytes, before) = (Vec::new(), *car.output());
    car.save(&mut bytes);
    for cut in [0, 1, 7, bytes.len() / 2, bytes.len() - 1] {
        assert!(car.restore(&bytes[..cut]).is_err(), "{cut}");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(car.restore(&longer).is_err());
    let mut infinite = bytes.clone();
    infinite[..8].copy_from_slice(&f64::INFINITY.to_le_bytes());
    assert!(car.restore(&infinite).is_err());
    assert_eq!(car.output(), &before);
    car.restore(&bytes).unwrap();
}

#[test]
fn the_road_banks_and_ices_the_car() {
    let mut car = Car::new(&builtin("c_class").unwrap(), &Effects::default(), Some(road())).unwrap();
    car.place(0.0, 0.0, 0.0, 20.0);
    let mut slowest = 0.0_f64;
    for _ in 0..300 {
        car.step(&CarInput { steer_cmd: 0.0, accel_cmd: -4.0 }, 0.01).unwrap();
        let out = car.output();
        let ice = (33.0..57.0).contains(&out.x);
        if ice && out.vx > 1.0 {
            slowest = slowest.max(-out.ax);
        }
        assert!((out.station - out.x).abs() < 0.1);
    }
    assert!(slowest < 0.2 * 1.25 * 9.81, "braking on ice: {slowest} m/s2");
    assert!(slowest > 0.5);
    let level = |bank: Option<Arc<Path>>| {
        let mut car = Car::new(&builtin("c_class").unwrap(), &Effects::default(), bank).unwrap();
        car.place(80.0, 0.0, 0.0, 15.0);
        for _ in 0..100 {
            car.step(&CarInput::default(), 0.01).unwrap();
        }
        car.output().y
    };
    assert_eq!(level(None), 0.0);
    assert!(level(Some(road())) < -1e-3, "it drifts to the low side");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn any_drive_is_finite(
        name in 0..BUILTIN.len(),
        speed in -20.0..50.0_f64,
        effects in prop::collection::vec(0.0..1.0_f64, Effects::ALL.len()),
        strength in 0.0..1.0_f64,
        inputs in prop::collection::vec((-2.0..2.0_f64, -20.0..20.0_f64, 1e-5..0.2_f64), 1..40),
    ) {
        let mut chosen = Effects::default();
        for (effect, share) in Effects::ALL.iter().zip(&effects) {
            let (low, high) = effect.range;
            let extreme = low + share * (high - low);
            *chosen.get_mut(effect.id).unwrap() = effect.neutral + strength * (extreme - effect.neutral);
        }
        let Ok(mut car) = Car::new(&builtin(BUILTIN[name]).unwrap(), &chosen, None) else { return Ok(()) };
        car.place(0.0, 0.0, 0.0, speed);
        for (steer_cmd, accel_cmd, step) in inputs {
            match car.step(&CarInput { steer_cmd, accel_cmd }, step) {
                Ok(()) | Err(StepError::RolledOver { .. }) => {}
                Err(error) => prop_assert!(false, "{error}"),
            }
            let o = car.output();
            let sum = o.x + o.y + o.yaw + o.vx + o.vy + o.yaw_rate + o.ax + o.ay + o.steer + o.roll + o.pitch;
            let wheels: f64 = o.wheels.iter().map(|w| w.load + w.slip + w.slip_angle + w.speed + w.fx + w.fy).sum();
            prop_assert!(sum.is_finite() && wheels.is_finite(), "{o:?}");
            prop_assert!(o.wheels.iter().all(|wheel| wheel.load >= 0.0));
        }
    }
}
