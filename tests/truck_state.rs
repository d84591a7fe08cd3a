//! Saved and restored trucks go on bit for bit, steps do not allocate; nothing makes a truck panic or give a number that
//! is none.

mod counting;

use counting::allocated;
use proptest::prelude::*;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::vehicle::{BUILTIN_TRUCKS, StepError, Truck, TruckEffects, TruckInput, builtin_truck};
use std::sync::Arc;

fn full() -> TruckEffects {
    let mut effects = TruckEffects::default();
    effects.vehicle.steer_delay = 0.3;
    effects.vehicle.steer_backlash = 0.01;
    effects.vehicle.sensor_delay = 0.07;
    effects.vehicle.drive_lag = 0.2;
    effects.trailer.articulation_friction = 3000.0;
    effects
}

fn input(k: u32) -> TruckInput {
    let t = 0.01 * f64::from(k);
    TruckInput { steer_cmd: 0.05 * (2.0 * t).sin(), accel_cmd: 1.0 * (0.7 * t).cos() }
}

/// A banked road with an icy patch from 30 m to 60 m.
fn road() -> Arc<Path> {
    let sample = |i: u32| {
        let x = 5.0 * f64::from(i) - 20.0;
        let friction = if (30.0..60.0).contains(&x) { 0.2 } else { 1.0 };
        Sample { bank: Some(0.02), friction: Some(friction), ..Sample::at(x, 0.0) }
    };
    Arc::new(Path::from_samples((0..60).map(sample).collect(), Closure::Open).unwrap())
}

fn new(name: &str, effects: &TruckEffects, road: Option<Arc<Path>>) -> Truck {
    let mut truck = Truck::new(&builtin_truck(name).unwrap(), effects, road).unwrap();
    truck.place(0.0, 0.0, 0.0, 14.0);
    truck
}

#[test]
fn restored_trucks_continue_bit_for_bit() {
    for road in [None, Some(road())] {
        let mut original = new("truck_real", &full(), road.clone());
        for k in 0..137 {
            original.step(&input(k), 0.01).unwrap();
        }
        let mut bytes = Vec::new();
        original.save(&mut bytes);
        let mut fresh = new("truck_real", &full(), road.clone());
        fresh.restore(&bytes).unwrap();
        assert_eq!(fresh.output(), original.output());
        let mut rewound = Vec::new();
        for k in 137..300 {
            original.step(&input(k), 0.01).unwrap();
            fresh.step(&input(k), 0.01).unwrap();
            assert_eq!(fresh.output(), original.output(), "step {k}");
            rewound.push(*original.output());
        }
        // And back in time, in the same truck.
        original.restore(&bytes).unwrap();
        for k in 137..300 {
            original.step(&input(k), 0.01).unwrap();
            assert_eq!(original.output(), &rewound[k as usize - 137]);
        }
    }
}

#[test]
fn bytes_of_something_else_are_refused_and_change_nothing() {
    let mut truck = new("truck_real", &full(), None);
    for k in 0..50 {
        truck.step(&input(k), 0.01).unwrap();
    }
    let (mut bytes, before) = (Vec::new(), *truck.output());
    truck.save(&mut bytes);
    for cut in [0, 1, 7, bytes.len() / 2, bytes.len() - 1] {
        assert!(truck.restore(&bytes[..cut]).is_err(), "{cut}");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(truck.restore(&longer).is_err());
    let mut infinite = bytes.clone();
    infinite[..8].copy_from_slice(&f64::INFINITY.to_le_bytes());
    assert!(truck.restore(&infinite).is_err());
    assert_eq!(truck.output(), &before);
    truck.restore(&bytes).unwrap();
}

#[test]
fn steps_do_not_allocate() {
    for name in BUILTIN_TRUCKS {
        for (effects, road) in [(TruckEffects::default(), None), (full(), Some(road()))] {
            let mut truck = new(name, &effects, road);
            let mut saved = Vec::new();
            for restored in [false, true] {
                if restored {
                    truck.save(&mut saved);
                    truck.restore(&saved).unwrap();
                }
                let (count, _) = allocated(|| {
                    for k in 0..1000 {
                        let input =
                            TruckInput { steer_cmd: 0.02 * (0.01 * f64::from(k)).sin(), accel_cmd: 0.1 };
                        truck.step(&input, if k % 2 == 0 { 0.0005 } else { 0.01 }).unwrap();
                    }
                    assert!(truck.step(&TruckInput::default(), -1.0).is_err());
                });
                assert_eq!(count, 0, "{name}, restored: {restored}");
            }
        }
    }
}

#[test]
fn the_road_banks_and_ices_the_truck() {
    let mut truck = new("truck_simulation", &TruckEffects::default(), Some(road()));
    truck.place(0.0, 0.0, 0.0, 20.0);
    let mut trailer_on_ice = false;
    for _ in 0..500 {
        truck.step(&TruckInput { steer_cmd: 0.0, accel_cmd: -3.0 }, 0.01).unwrap();
        let out = truck.output();
        assert!((out.station - out.x - 20.0).abs() < 0.2, "{} {}", out.station, out.x);
        let axle = out.trailer.x - 3.1;
        if (35.0..55.0).contains(&axle) && out.vx > 1.0 {
            trailer_on_ice = true;
            let share = (out.wheels[4].fx.hypot(out.wheels[4].fy)) / out.wheels[4].load;
            assert!(share < 0.2 * 0.9, "friction used on ice: {share}");
        }
    }
    let level = |road: Option<Arc<Path>>| {
        let mut truck = new("truck_simulation", &TruckEffects::default(), road);
        for _ in 0..100 {
            truck.step(&TruckInput::default(), 0.01).unwrap();
        }
        truck.output().y
    };
    assert_eq!(level(None), 0.0);
    assert!(level(Some(road())) < -1e-3, "it drifts to the low side");
    assert!(trailer_on_ice, "the trailer's axles came there");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn any_drive_is_finite(
        name in prop::sample::select(BUILTIN_TRUCKS),
        speed in -10.0..35.0_f64,
        effects in prop::collection::vec(0.0..1.0_f64, 64),
        strength in 0.0..1.0_f64,
        inputs in prop::collection::vec((-2.0..2.0_f64, -20.0..20.0_f64, 1e-5..0.2_f64), 1..40),
    ) {
        let mut chosen = TruckEffects::default();
        for (effect, share) in TruckEffects::all().zip(&effects) {
            let (low, high) = effect.range;
            let extreme = low + share * (high - low);
            *chosen.get_mut(effect.id).unwrap() = effect.neutral + strength * (extreme - effect.neutral);
        }
        let Ok(mut truck) = Truck::new(&builtin_truck(name).unwrap(), &chosen, None) else { return Ok(()) };
        truck.place(0.0, 0.0, 0.0, speed);
        for (steer_cmd, accel_cmd, step) in inputs {
            match truck.step(&TruckInput { steer_cmd, accel_cmd }, step) {
                Ok(()) | Err(StepError::RolledOver { .. } | StepError::JackKnifed { .. }) => {}
                Err(error) => prop_assert!(false, "{error}"),
            }
            let o = truck.output();
            let t = &o.trailer;
            let sum = o.x + o.y + o.yaw + o.vx + o.vy + o.yaw_rate + o.ax + o.ay + o.steer + o.roll + o.pitch
                + o.articulation + o.articulation_rate + t.x + t.y + t.yaw + t.vx + t.vy + t.yaw_rate + t.roll
                + o.hitch.iter().sum::<f64>();
            let wheels: f64 = o.wheels.iter().map(|w| w.load + w.slip + w.slip_angle + w.speed + w.fx + w.fy).sum();
            prop_assert!(sum.is_finite() && wheels.is_finite(), "{o:?}");
            prop_assert!(o.wheels.iter().all(|wheel| wheel.load >= 0.0));
        }
    }
}
