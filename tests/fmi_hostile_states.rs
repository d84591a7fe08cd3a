//! Saved states of strangers: a right checksum, and anything inside. They are refused, or the unit goes on without a panic and
//! without a value that is no number.
//!
//! `RFL_FUZZ=N` tries N states of each unit (default 150), from the seed `RFL_FUZZ_SEED` (default 0).

use crate::counting::took;
use crate::unit::{Silent, Unit};
use rfl_mpc::fmi::{Causality, Model, Value};
use rfl_mpc::fmu::{PlantFmu, RflMpc, TruckRflMpc};
use rfl_mpc::numerics::Random;
use rfl_mpc::vehicle::{Car, Truck};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

/// A unit under way, and what it is driven with.
struct UnderWay<M: Model> {
    unit: Unit<M>,
    inputs: Vec<(usize, f64)>,
    reals: Vec<usize>,
}

const STEP: f64 = 0.02;
const LONGEST: Duration = Duration::from_secs(1);

impl<M: Model> UnderWay<M> {
    fn new(settings: &[(&str, Value)]) -> Self {
        let unit = Unit::<M>::new(settings);
        let declaration = M::declaration();
        let of = |causality: Causality| {
            let variables = declaration.variables.iter().enumerate();
            variables.filter(move |(_, v)| v.causality == causality).map(|(vr, _)| vr)
        };
        let is_real = |vr: &usize| matches!(unit.values.get(*vr), Some(Value::Real(_)));
        let start = |vr: usize| match declaration.variables[vr].name.as_ref() {
            name @ ("x" | "y" | "yaw") => unit.real(&format!("start.{name}")),
            _ => 0.0,
        };
        let inputs = of(Causality::Input).filter(is_real).map(|vr| (vr, start(vr))).collect();
        let reals = of(Causality::Output).filter(is_real).collect();
        Self { unit, inputs, reals }
    }

    /// A unit that has been driven for a while, and its state then.
    fn with_state(settings: &[(&str, Value)]) -> (Self, Vec<u8>) {
        let mut under_way = Self::new(settings);
        assert_eq!(under_way.drive(0, 60), Ok(()));
        let mut sound = Vec::new();
        under_way.unit.model.save(&mut sound);
        assert!(M::check(&sound).is_ok());
        (under_way, sound)
    }

    /// Puts a number into a sound state. True if that is taken: the unit goes on with it then, and back to the sound one.
    fn takes(&mut self, sound: &[u8], at: usize, number: f64) -> bool {
        let mut bytes = sound.to_vec();
        bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
        let taken = M::check(&bytes).is_ok() && self.unit.model.restore(&bytes).is_ok();
        if taken {
            let was = number_at(sound, at);
            self.drive(60, 10).unwrap_or_else(|what| panic!("byte {at}, before {was}: {what}"));
            self.unit.model.restore(sound).unwrap();
        }
        taken
    }

    /// Steps on with inputs that vary; what is not a number ends it.
    fn drive(&mut self, from: u32, steps: u32) -> Result<(), String> {
        let variables = M::declaration().variables;
        for k in from..from + steps {
            for (place, (vr, start)) in self.inputs.iter().enumerate() {
                let wave = 0.05 * (0.3 * f64::from(k) + place as f64).sin();
                self.unit.values.set_by_host(*vr, &variables[*vr], Value::Real(start + wave));
            }
            if self.unit.model.step(&mut self.unit.values, f64::from(k) * STEP, STEP, &mut Silent).is_err() {
                return Ok(());
            }
            if let Some(vr) = self.reals.iter().find(|vr| !self.unit.values.real(**vr).is_finite()) {
                return Err(format!("{} = {}", variables[*vr].name, self.unit.values.real(*vr)));
            }
        }
        Ok(())
    }
}

fn number_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

/// Changes some of the bytes, as damage and as an attacker would.
fn change(bytes: &mut Vec<u8>, random: &mut Random) {
    let mut pick = |count: usize| ((random.uniform() * count as f64) as usize).min(count - 1);
    for _ in 0..=pick(3) {
        let at = pick(bytes.len());
        match pick(5) {
            0 => bytes[at] ^= 1 << pick(8),
            1 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][pick(5)],
            2 => bytes.truncate(at.max(1)),
            _ => {
                let numbers = [f64::NAN, f64::INFINITY, -1e300, 1e29, 9e19, -1e9, 1e-300, 0.0, -1.0];
                let number = numbers[pick(numbers.len())].to_le_bytes();
                for (to, from) in bytes[at..].iter_mut().zip(number) {
                    *to = from;
                }
            }
        }
    }
}

fn survive<M: Model>(settings: &[(&str, Value)]) {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    let (count, first) = (number("RFL_FUZZ", 150), number("RFL_FUZZ_SEED", 0));
    let (mut under_way, sound) = UnderWay::<M>::with_state(settings);
    let (mut refused, mut taken, mut longest) = (0, 0, Duration::ZERO);
    for seed in first..first + count {
        let mut bytes = sound.clone();
        change(&mut bytes, &mut Random::new(seed));
        let mut outcome = Ok(Ok(false));
        let elapsed = took(|| {
            outcome = catch_unwind(AssertUnwindSafe(|| {
                if M::check(&bytes).and_then(|()| under_way.unit.model.restore(&bytes)).is_err() {
                    return Ok(false);
                }
                under_way.drive(60, 30).map(|()| true)
            }));
        });
        match outcome {
            Err(_) => panic!("state {seed} ends in a panic"),
            Ok(Err(what)) => panic!("state {seed}: {what}"),
            Ok(Ok(true)) => taken += 1,
            Ok(Ok(false)) => refused += 1,
        }
        assert!(elapsed < LONGEST, "state {seed} takes {elapsed:?}");
        longest = longest.max(elapsed);
    }
    println!("{count} inputs, {taken} taken, longest {:.3} ms", 1e3 * longest.as_secs_f64());
    assert!(refused > count / 10 && taken > count / 10, "{refused} refused, {taken} taken");
    // The unit has suffered nothing that a sound state does not undo.
    under_way.unit.model.restore(&sound).unwrap();
    assert_eq!(under_way.drive(60, 30), Ok(()));
}

fn road(file: &str) -> Value {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("paths").join(file);
    Value::String(file.to_string_lossy().into_owned())
}

#[test]
fn of_the_car_s_controller() {
    survive::<RflMpc>(&[("path_file", road("sudoku_test.csv"))]);
}

#[test]
fn of_the_truck_s_controller() {
    survive::<TruckRflMpc>(&[("path_file", road("off_road.csv"))]);
}

#[test]
fn of_a_car_with_delays() {
    let delays = [("effect.steer_delay", Value::Real(0.06)), ("effect.sensor_delay", Value::Real(0.05))];
    survive::<PlantFmu<Car>>(&[&delays[..], &[("initial.vx", Value::Real(10.0))]].concat());
}

#[test]
fn of_a_truck() {
    survive::<PlantFmu<Truck>>(&[("initial.vx", Value::Real(10.0))]);
}

/// A reference point of the longitudinal MPC that moves back was taken, and the bounds of its next speed crossed: a panic.
#[test]
fn a_reference_that_moves_back_is_none() {
    let (mut under_way, sound) = UnderWay::<TruckRflMpc>::with_state(&[("path_file", road("off_road.csv"))]);
    let reference = under_way.unit.real("speed_ref");
    // Wherever the state holds that speed, or what it is a step later.
    let is_near = |at: &usize| (number_at(&sound, *at) - reference).abs() <= 0.2;
    let places: Vec<usize> = (0..sound.len() - 8).filter(is_near).collect();
    let taken = places.into_iter().filter(|at| under_way.takes(&sound, *at, -1.0)).count();
    assert!(taken > 0, "no place holds {reference}");
}

/// Each place that holds a number, with what is none: no state with it is taken.
#[test]
fn no_infinity_is_taken() {
    let (mut under_way, sound) = UnderWay::<RflMpc>::with_state(&[("path_file", road("sudoku_test.csv"))]);
    // Bytes that look like a number of a drive, and are no others' borders.
    let is_number = |at: &usize| {
        let size = number_at(&sound, *at).abs();
        size.is_nan() || (1e-6..=1e6).contains(&size)
    };
    let places: Vec<usize> = (0..sound.len() - 8).filter(is_number).collect();
    let refused = places.into_iter().filter(|at| !under_way.takes(&sound, *at, f64::INFINITY)).count();
    assert!(refused > 50, "{refused}");
}
