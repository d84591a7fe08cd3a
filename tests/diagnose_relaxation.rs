//! Since a reference drive a relaxation length is named whole, not as what it is longer by: it stands in the place of the file's.

use rfl_mpc::diagnose::simulated::{Conditions, drive};
use rfl_mpc::diagnose::{Options, VerdictKind, diagnose};
use rfl_mpc::log::CleanLog;
use rfl_mpc::vehicle::{CarParameters, TruckEffects, VehicleParameters, builtin};

const LONG: f64 = 1.6;

/// The default car, with tyres of some decimetres of relaxation length.
fn car() -> CarParameters {
    let mut car = builtin("c_class").expect("built in");
    for (_, tyre) in car.tyres() {
        let file = tyre.coefficients.as_mut().expect("a tyre");
        (file.pty1, file.pty2) = (1.5, 1.5);
    }
    car
}

fn driven(car: &CarParameters, seed: u64, length: f64) -> CleanLog {
    let mut effects = TruckEffects::default();
    effects.vehicle.tyre_relaxation = length;
    let conditions =
        Conditions { seed, duration: 60.0, step: 0.02, background: 0.0, ..Conditions::default() };
    drive(car, &effects, &conditions).expect("an ordinary drive")
}

#[test]
fn a_length_since_a_reference_is_the_whole_length() {
    let car = car();
    let at_rest = car.relaxation().expect("a length");
    assert!(at_rest > 0.2 && at_rest < 0.8, "{at_rest}");
    let (march, june) = (driven(&car, 4, 0.0), driven(&car, 5, LONG));
    let report = diagnose(&june, Some(&march), &car, &Options::default(), &|_, _| {}).unwrap().report;
    let verdict = report.verdict;
    assert_eq!(verdict.kind, VerdictKind::Effect, "{verdict:?}");
    let names: Vec<&str> = verdict.effects.iter().map(|effect| effect.id.as_str()).collect();
    assert_eq!(names, ["tyre_relaxation"], "{verdict:?}");
    let effect = &verdict.effects[0];
    assert!((effect.value / LONG - 1.0).abs() < 0.05, "{effect:?}");
    assert!(effect.low < LONG && LONG < effect.high, "{effect:?}");
}
