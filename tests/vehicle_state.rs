//! Saved and restored vehicles go on bit for bit, steps do not allocate; nothing makes a vehicle panic or give a number
//! that is none.

use crate::counting::allocated;
use proptest::prelude::*;
use rfl_mpc::fmu::PlantUnit;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::vehicle::{Car, PlantStepError, Truck, VehicleInput, VehicleParameters};
use std::fmt::Debug;
use std::sync::Arc;

/// A vehicle whose outputs can be compared.
trait Case: PlantUnit<Output: Debug + PartialEq> {}

impl Case for Car {}
impl Case for Truck {}

/// Effects with a memory.
fn full<P: Case>() -> P::Effects {
    let mut effects = P::Effects::default();
    let shared = [("steer_delay", 0.3), ("steer_backlash", 0.01), ("sensor_delay", 0.07), ("drive_lag", 0.2)];
    for (id, value) in shared {
        *P::effect(&mut effects, id).unwrap() = value;
    }
    if let Some(friction) = P::effect(&mut effects, "articulation_friction") {
        *friction = 3000.0;
    }
    effects
}

fn input(k: u32) -> VehicleInput {
    let t = 0.01 * f64::from(k);
    VehicleInput { steer_cmd: 0.05 * (2.0 * t).sin(), accel_cmd: 1.2 * (0.7 * t).cos() }
}

/// A banked road, icy from 30 m to 55 m and half so for 5 m before and behind; it begins 20 m behind the origin.
fn road() -> Arc<Path> {
    let sample = |i: u32| {
        let x = 5.0 * f64::from(i) - 20.0;
        let friction = if (30.0..60.0).contains(&x) { 0.2 } else { 1.0 };
        Sample { bank: Some(0.02), friction: Some(friction), ..Sample::at(x, 0.0) }
    };
    Arc::new(Path::from_samples((0..60).map(sample).collect(), Closure::Open).unwrap())
}

fn new<P: Case>(name: &str, effects: &P::Effects, road: Option<Arc<Path>>, speed: f64) -> P {
    let mut vehicle = P::make(&P::Parameters::builtin(name).unwrap(), effects, road).unwrap();
    vehicle.place(0.0, 0.0, 0.0, speed);
    vehicle
}

fn first<P: Case>() -> &'static str {
    P::Parameters::BUILTIN[0]
}

/// The value of an output.
fn value<P: Case>(vehicle: &P, name: &str) -> f64 {
    let known = P::SIGNALS.iter().find(|(signal, _)| signal.name == name).map(|(_, value)| *value);
    let more = P::MORE.iter().find(|more| more.0 == name).map(|more| more.3);
    known.or(more).unwrap_or_else(|| panic!("{name}"))(vehicle.output())
}

fn continues_restored_bit_for_bit<P: Case>() {
    for road in [None, Some(road())] {
        let new = || new::<P>(first::<P>(), &full::<P>(), road.clone(), 14.0);
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
        // And back in time, in the same vehicle.
        original.restore(&bytes).unwrap();
        for k in 137..300 {
            original.step(&input(k), 0.01).unwrap();
            assert_eq!(original.output(), &rewound[k as usize - 137]);
        }
    }
}

fn refuses_bytes_of_something_else_and_does_not_change<P: Case>() {
    let mut vehicle = new::<P>(first::<P>(), &full::<P>(), None, 0.0);
    for k in 0..50 {
        vehicle.step(&input(k), 0.01).unwrap();
    }
    let (mut bytes, before) = (Vec::new(), *vehicle.output());
    vehicle.save(&mut bytes);
    for cut in [0, 1, 7, bytes.len() / 2, bytes.len() - 1] {
        assert!(vehicle.restore(&bytes[..cut]).is_err(), "{cut}");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(vehicle.restore(&longer).is_err());
    let mut infinite = bytes.clone();
    infinite[..8].copy_from_slice(&f64::INFINITY.to_le_bytes());
    assert!(vehicle.restore(&infinite).is_err());
    assert_eq!(vehicle.output(), &before);
    vehicle.restore(&bytes).unwrap();
}

fn steps_without_allocation<P: Case>() {
    for name in P::Parameters::BUILTIN {
        for (effects, road) in [(P::Effects::default(), None), (full::<P>(), Some(road()))] {
            let mut vehicle = new::<P>(name, &effects, road, 14.0);
            let mut saved = Vec::new();
            for restored in [false, true] {
                if restored {
                    vehicle.save(&mut saved);
                    vehicle.restore(&saved).unwrap();
                }
                let (count, _) = allocated(|| {
                    for k in 0..1000 {
                        let steer_cmd = 0.02 * (0.01 * f64::from(k)).sin();
                        let input = VehicleInput { steer_cmd, accel_cmd: 0.1 };
                        vehicle.step(&input, if k % 2 == 0 { 0.0005 } else { 0.01 }).unwrap();
                    }
                    // Errors give back the state before, and do not allocate either.
                    assert!(vehicle.step(&VehicleInput::default(), -1.0).is_err());
                });
                assert_eq!(count, 0, "{name}, restored: {restored}");
            }
        }
    }
}

fn is_banked_and_iced_by_the_road<P: Case>() {
    let used = |vehicle: &P| {
        let front = &P::wheels(vehicle.output())[0];
        front.fx.hypot(front.fy) / front.load
    };
    let mut vehicle = new::<P>(first::<P>(), &P::Effects::default(), Some(road()), 26.0);
    let mut most = 0.0_f64;
    for _ in 0..500 {
        vehicle.step(&VehicleInput { steer_cmd: 0.0, accel_cmd: -8.0 }, 0.01).unwrap();
        let x = value(&vehicle, "x");
        assert!((value(&vehicle, "road.station") - x - 20.0).abs() < 0.2);
        if (35.0..52.0).contains(&x) && value(&vehicle, "vx") > 1.0 {
            most = most.max(used(&vehicle));
        }
    }
    // A fifth of what dry tyres have: from 0.5, a locked truck tyre, to 1.3.
    assert!(most > 0.2 * 0.45 && most < 0.2 * 1.35, "friction used on ice: {most}");
    let level = |road: Option<Arc<Path>>| {
        let mut vehicle = new::<P>(first::<P>(), &P::Effects::default(), road, 14.0);
        for _ in 0..100 {
            vehicle.step(&VehicleInput::default(), 0.01).unwrap();
        }
        value(&vehicle, "y")
    };
    assert_eq!(level(None), 0.0);
    assert!(level(Some(road())) < -1e-3, "it drifts to the low side");
}

/// Each behaviour for each vehicle.
macro_rules! for_each_vehicle {
    ($($behaviour:ident)*) => {
        mod car { $(#[test] fn $behaviour() { super::$behaviour::<super::Car>() })* }
        mod truck { $(#[test] fn $behaviour() { super::$behaviour::<super::Truck>() })* }
    };
}

for_each_vehicle! {
    continues_restored_bit_for_bit
    refuses_bytes_of_something_else_and_does_not_change
    steps_without_allocation
    is_banked_and_iced_by_the_road
}

/// A drive: vehicle, speed in m/s, place of each effect in its range, strength of all, commands with steps in s.
type AnyDrive = (usize, f64, Vec<f64>, f64, Vec<(f64, f64, f64)>);

fn any_drive() -> impl Strategy<Value = AnyDrive> {
    (
        0..64_usize,
        -20.0..50.0_f64,
        prop::collection::vec(0.0..1.0_f64, 64),
        0.0..1.0_f64,
        prop::collection::vec((-2.0..2.0_f64, -20.0..20.0_f64, 1e-5..0.2_f64), 1..40),
    )
}

fn is_finite_on<P: Case>((name, speed, effects, strength, inputs): AnyDrive) -> Result<(), TestCaseError> {
    let name = P::Parameters::BUILTIN[name % P::Parameters::BUILTIN.len()];
    let mut chosen = P::Effects::default();
    for (effect, share) in P::all_effects().zip(&effects) {
        let (low, high) = effect.range;
        let extreme = low + share * (high - low);
        *P::effect(&mut chosen, effect.id).unwrap() = effect.neutral + strength * (extreme - effect.neutral);
    }
    let Ok(mut vehicle) = P::make(&P::Parameters::builtin(name).unwrap(), &chosen, None) else {
        return Ok(());
    };
    vehicle.place(0.0, 0.0, 0.0, speed);
    for (steer_cmd, accel_cmd, step) in inputs {
        match vehicle.step(&VehicleInput { steer_cmd, accel_cmd }, step) {
            Ok(()) | Err(PlantStepError::RolledOver { .. } | PlantStepError::JackKnifed { .. }) => {}
            Err(error) => prop_assert!(false, "{error}"),
        }
        let o = vehicle.output();
        let known: f64 = P::SIGNALS.iter().map(|(_, value)| value(o)).sum();
        let more: f64 = P::MORE.iter().map(|(.., value)| value(o)).sum();
        let wheels = P::wheels(o);
        let each = |w: &rfl_mpc::vehicle::WheelOutput| w.load + w.slip + w.slip_angle + w.speed + w.fx + w.fy;
        let of_wheels: f64 = wheels.iter().map(each).sum();
        prop_assert!((known + more + of_wheels).is_finite(), "{o:?}");
        prop_assert!(wheels.iter().all(|wheel| wheel.load >= 0.0));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(50))]

    #[test]
    fn any_drive_of_a_car_is_finite(drive in any_drive()) {
        is_finite_on::<Car>(drive)?;
    }

    #[test]
    fn any_drive_of_a_truck_is_finite(drive in any_drive()) {
        is_finite_on::<Truck>(drive)?;
    }
}
