//! The diagnosis of a log of 100 s on two threads, whole. `cargo bench --bench diagnose`.
//!
//! Logs of the plants themselves: of a car and a truck, sound and with an effect. Another vehicle's log takes longer, for its search
//! meets the errors of the model's form; the blind check times those (docs/results/blind.md).

use criterion::{Criterion, criterion_group, criterion_main};
use rfl_mpc::diagnose::replay::ReplayVehicle;
use rfl_mpc::diagnose::simulated::{Conditions, DrivableVehicle, drive};
use rfl_mpc::diagnose::{Options, diagnose};
use rfl_mpc::vehicle::{TruckEffects, builtin, builtin_truck};
use std::hint::black_box;
use std::time::Duration;

/// Length of the log, s; rows a second.
const DURATION: f64 = 100.0;
const STEP: f64 = 0.02;

fn one<V: ReplayVehicle + DrivableVehicle>(criterion: &mut Criterion, name: &str, vehicle: &V, gain: f64) {
    let conditions = Conditions { seed: 3, duration: DURATION, step: STEP, ..Conditions::default() };
    let mut effects = TruckEffects::default();
    effects.vehicle.steer_gain = gain;
    let log = drive(vehicle, &effects, &conditions).expect("an ordinary drive");
    let options = Options { threads: 2, ..Options::default() };
    criterion.bench_function(&format!("{name}, 100 s, steer_gain {gain}"), |bencher| {
        bencher.iter(|| {
            diagnose(black_box(&log), None, vehicle, &options, &|_, _| {}).expect("a clean log").report
        });
    });
}

fn all(criterion: &mut Criterion) {
    let car = builtin("c_class").expect("built in");
    let truck = builtin_truck("truck_simulation").expect("built in");
    for gain in [1.0, 1.1] {
        one(criterion, "car", &car, gain);
        one(criterion, "truck", &truck, gain);
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).measurement_time(Duration::from_secs(30));
    targets = all
}
criterion_main!(benches);
