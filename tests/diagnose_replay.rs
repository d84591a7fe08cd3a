//! The reduced model does with an effect what the plant does: the evidence for an effect is what both make of it, and what the
//! replay gets wrong goes to a neighbour.

use rfl_mpc::diagnose::problem::rms;
use rfl_mpc::diagnose::replay::{Channel, Correction, ReplayDrive, Trace, neutral, replay};
use rfl_mpc::diagnose::simulated::{Conditions, DrivableVehicle, drive};
use rfl_mpc::vehicle::{TruckEffects, builtin, builtin_truck};

/// A drive with an effect, without noise and background; its neutral correction.
fn driven<V: DrivableVehicle>(vehicle: &V, effects: &TruckEffects) -> (ReplayDrive, Correction) {
    let ordinary = Conditions { duration: 40.0, background: 0.0, noise: 0.0, ..Conditions::default() };
    let slow = Conditions { speed: (6.0, 18.0), lateral: 2.0, ..ordinary };
    let log = drive(vehicle, effects, if V::TRUCK { &slow } else { &ordinary }).unwrap();
    let drive = ReplayDrive::new(&log, V::TRUCK);
    let correction = neutral(&drive, vehicle).unwrap();
    (drive, correction)
}

fn gap(drive: &ReplayDrive, trace: &Trace, channel: Channel) -> f64 {
    let rows = (0..drive.time.len()).filter(|&row| drive.scored[row]);
    rms(&rows.map(|row| drive.column(channel.name())[row] - trace.column(channel)[row]).collect::<Vec<_>>())
}

/// Asserts that with each effect put into the replay as well, at most this share of the gap without it is left.
fn replayed_within<V: DrivableVehicle>(share: f64, vehicle: &V, all: &[(&str, f64, Channel)]) {
    for &(id, value, channel) in all {
        let left = left(vehicle, id, value, channel);
        assert!(left < share, "{id} {value}: {left:.3} of the gap in {} is left", channel.name());
    }
}

/// Gap that is left with an effect put into the replay as well, over that without.
fn left<V: DrivableVehicle>(vehicle: &V, id: &str, value: f64, channel: Channel) -> f64 {
    let mut effects = TruckEffects::default();
    *effects.get_mut(id).unwrap() = value;
    let (drive, correction) = driven(vehicle, &effects);
    let with = |effects: &TruckEffects| {
        let trace = replay(&drive, vehicle, effects, &correction, None).unwrap();
        assert!(trace.sound);
        gap(&drive, &trace, channel)
    };
    with(&effects) / with(&TruckEffects::default())
}

#[test]
fn a_car_with_an_effect_is_replayed_within_a_twentieth_of_what_it_does() {
    let car = builtin("c_class").unwrap();
    let all = [
        ("steer_delay", 0.1, Channel::YawRate),
        ("steer_backlash", 0.02, Channel::Ay),
        ("tyre_stiffness_rear", 0.75, Channel::Vy),
        ("tyre_relaxation", 1.5, Channel::YawRate),
        ("tyre_relaxation", 1.5, Channel::Ay),
        ("road_friction", 0.55, Channel::Ay),
        ("payload", 400.0, Channel::YawRate),
        ("payload", 400.0, Channel::Ax),
        ("roll_stiffness", 0.6, Channel::Roll),
        ("yaw_inertia", 1.4, Channel::YawRate),
        ("drive_lag", 0.4, Channel::Ax),
        ("wind_y", 12.0, Channel::YawRate),
        ("sensor_delay", 0.1, Channel::YawRate),
    ];
    replayed_within(0.05, &car, &all);
}

#[test]
fn a_truck_with_an_effect_is_replayed_within_a_tenth_of_what_it_does() {
    let truck = builtin_truck("truck_simulation").unwrap();
    let all = [
        ("steer_delay", 0.1, Channel::YawRate),
        ("tyre_relaxation", 1.5, Channel::YawRate),
        ("trailer_payload", 6000.0, Channel::Ax),
        ("brake_pull", 7200.0, Channel::YawRate),
        ("articulation_friction", 15000.0, Channel::ArticulationRate),
    ];
    replayed_within(0.1, &truck, &all);
}

/// Forces that only the log needs (uphill, against more air) are no error of the reduced model's sideways motion.
#[test]
fn what_drives_the_log_uphill_does_not_turn_the_replay() {
    let car = builtin("c_class").unwrap();
    for (id, value) in [("road_grade", 0.05), ("drag", 3.0)] {
        let mut effects = TruckEffects::default();
        *effects.get_mut(id).unwrap() = value;
        let (drive, correction) = driven(&car, &effects);
        let trace = replay(&drive, &car, &effects, &correction, None).unwrap();
        for (channel, least) in [(Channel::YawRate, 3e-4), (Channel::Ay, 5e-3), (Channel::Vy, 1e-3)] {
            let gap = gap(&drive, &trace, channel);
            assert!(gap < least, "{id}: {gap} in {}", channel.name());
        }
    }
}

/// A search tries all sorts of vehicles: short relaxation at walking pace makes the equations stiff, and nothing may ring.
#[test]
fn a_step_of_the_replay_is_short_enough_for_stiff_tyres() {
    for name in ["c_class", "genesis", "bmw_320i"] {
        let car = builtin(name).unwrap();
        for speed in [(2.2, 6.0), (5.0, 12.0), (12.0, 20.0), (18.0, 30.0)] {
            let conditions = Conditions {
                duration: 30.0,
                speed,
                lateral: 2.5,
                background: 0.0,
                noise: 0.0,
                ..Conditions::default()
            };
            let log = drive(&car, &TruckEffects::default(), &conditions).unwrap();
            let coarse = ReplayDrive::new(&log, false);
            let fine = ReplayDrive { substeps: 8 * coarse.substeps, ..coarse.clone() };
            for (id, value) in [("tyre_relaxation", 0.1), ("tyre_relaxation", 0.25), ("yaw_inertia", 0.5)] {
                let mut effects = TruckEffects::default();
                *effects.get_mut(id).unwrap() = value;
                let yaw_rate = |drive: &ReplayDrive| {
                    let trace = replay(drive, &car, &effects, &Correction::default(), None).unwrap();
                    assert!(trace.sound);
                    trace.column(Channel::YawRate).to_vec()
                };
                let (a, b) = (yaw_rate(&coarse), yaw_rate(&fine));
                let gap = rms(&a.iter().zip(&b).map(|(a, b)| a - b).collect::<Vec<_>>());
                assert!(gap < 0.02 * rms(&b), "{name} at {speed:?} m/s, {id} {value}: {gap} of {}", rms(&b));
            }
        }
    }
}
