//! How near the reduced replay comes to the full plant with each effect of the library, in shares of what the effect does.
//!
//! ```text
//! diagnose_replay [VEHICLE] [SEED] [ID..]
//! ```
//!
//! A row is an effect, its moderate value put into the plant and into the replay, without noise and background: for each
//! signal the gap that is left over the gap with the effect neutral, after the neutral correction. Signals that the effect
//! moves by less than its noise have a dash.

use rfl_mpc::diagnose::problem::rms;
use rfl_mpc::diagnose::replay::{Channel, ReplayDrive, Trace, neutral, replay};
use rfl_mpc::diagnose::simulated::{Conditions, DrivableVehicle, drive};
use rfl_mpc::vehicle::{BUILTIN_TRUCKS, TruckEffects, builtin, builtin_truck};

#[path = "diagnose_cases/values.rs"]
mod values;
use values::{VALUES, of_truck};

const SHOWN: [(Channel, f64); 6] = [
    (Channel::YawRate, 0.0005),
    (Channel::Ay, 0.01),
    (Channel::Vy, 0.003),
    (Channel::Ax, 0.01),
    (Channel::Roll, 0.0002),
    (Channel::ArticulationRate, 0.0005),
];

fn show<V: DrivableVehicle>(vehicle: &V, seed: u64, id: &str, value: f64) {
    let mut effects = TruckEffects::default();
    let Some(place) = effects.get_mut(id) else { return };
    *place = value;
    let ordinary = Conditions { seed, background: 0.0, noise: 0.0, ..Conditions::default() };
    let slow = Conditions { speed: (6.0, 18.0), lateral: 2.0, ..ordinary };
    let Some(log) = drive(vehicle, &effects, if V::TRUCK { &slow } else { &ordinary }) else {
        println!("{id:24} not drivable");
        return;
    };
    let ready = ReplayDrive::new(&log, V::TRUCK);
    let correction = neutral(&ready, vehicle).expect("sound");
    let own = replay(&ready, vehicle, &effects, &correction, None).expect("sound");
    let without = replay(&ready, vehicle, &TruckEffects::default(), &correction, None).expect("sound");
    let mut text = format!("{id:24}");
    for (channel, noise) in SHOWN {
        if !ready.channels.contains(&channel) {
            continue;
        }
        let gap = |trace: &Trace| {
            let rows = (0..ready.time.len()).filter(|&row| ready.scored[row]);
            rms(&rows
                .map(|row| ready.column(channel.name())[row] - trace.column(channel)[row])
                .collect::<Vec<_>>())
        };
        let (left, before) = (gap(&own), gap(&without));
        if before < noise {
            text += &format!("  {:>17} {:>13}", channel.name(), "-");
        } else {
            text += &format!("  {:>17} {left:.4}/{before:.4}", channel.name());
        }
    }
    println!("{text}");
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let name = arguments.first().map_or("c_class", String::as_str);
    let seed = arguments.get(1).and_then(|text| text.parse().ok()).unwrap_or(1);
    let wanted = |id: &str| arguments.len() < 3 || arguments[2..].iter().any(|it| it == id);
    for &(id, moderate, _) in VALUES.iter().filter(|(id, ..)| wanted(id)) {
        let is_truck = BUILTIN_TRUCKS.contains(&name);
        if is_truck {
            show(&builtin_truck(name).expect("built in"), seed, id, of_truck(id, moderate));
        } else if rfl_mpc::vehicle::Effects::find(id).is_some() {
            show(&builtin(name).expect("built in"), seed, id, moderate);
        }
    }
}
