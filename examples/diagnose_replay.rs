//! How near the reduced replay comes to the full plant, and how fast it is.

use rfl_mpc::diagnose::problem::rms;
use rfl_mpc::diagnose::replay::{Correction, Drive, replay};
use rfl_mpc::diagnose::simulated::{Conditions, SimulatedVehicle, drive};
use rfl_mpc::vehicle::{TruckEffects, builtin, builtin_truck};

fn show<V: SimulatedVehicle>(vehicle: &V, conditions: &Conditions, put_in: &[(&str, f64)]) {
    let mut effects = TruckEffects::default();
    for &(id, value) in put_in {
        *effects.get_mut(id).expect("an effect") = value;
    }
    let conditions = Conditions { background: 0.0, noise: 0.0, ..*conditions };
    let log = drive(vehicle, &effects, &conditions).expect("an ordinary drive");
    let ready = Drive::new(&log, V::TRUCK);
    let begin = std::time::Instant::now();
    let trace = replay(&ready, vehicle, &effects, &Correction::default(), None).expect("sound");
    println!("{} {put_in:?}: {:.1} ms, sound {}", V::TRUCK, begin.elapsed().as_secs_f64() * 1e3, trace.sound);
    for &channel in &ready.channels {
        let (mut gap, mut own) = (Vec::new(), Vec::new());
        for row in (0..ready.time.len()).filter(|&row| ready.scored[row]) {
            let log = if channel.leaks() { 0.0 } else { ready.column(channel.name())[row] };
            gap.push(log - trace.column(channel)[row]);
            own.push(log);
        }
        println!("  {:18} gap {:.5}  signal {:.4}", channel.name(), rms(&gap), rms(&own));
    }
}

fn main() {
    let c = Conditions { duration: 100.0, ..Conditions::default() };
    for name in ["c_class", "genesis"] {
        let car = builtin(name).expect("built in");
        for effects in [
            &[][..],
            &[("steer_delay", 0.1)],
            &[("road_bank", 0.05), ("payload", 300.0)],
            &[("sensor_delay", 0.1)],
            &[("speed_scale", 1.05), ("heading_misalignment", 0.03)],
        ] {
            show(&car, &c, effects);
        }
    }
    let truck = builtin_truck("truck_real").expect("built in");
    let c = Conditions { speed: (6.0, 18.0), lateral: 2.0, ..c };
    for effects in [&[][..], &[("trailer_payload", 5000.0)], &[("articulation_friction", 20000.0)]] {
        show(&truck, &c, effects);
    }
}
