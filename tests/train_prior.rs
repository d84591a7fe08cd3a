//! The prior of the commands' effects: the closed form of a dead time, and that held commands have no effect.

use rfl_mpc::nominal::{Actuator, ContinuousErrorModel};
use rfl_mpc::residual::residual_of_actuator;
use rfl_mpc::vehicle::SingleTrack;

const CAR: SingleTrack =
    SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };

#[test]
fn a_dead_time_moves_the_effect_of_a_command() {
    let actuator = Actuator { dead_time: 0.06, ..Actuator::default() };
    let effects = residual_of_actuator::<_, 4>(&CAR, &actuator, 12.0, 0.02, 10).unwrap();
    let nominal = ContinuousErrorModel::<4>::new(&CAR, 12.0).unwrap().discretise(0.02).b;
    for (place, effect) in effects.iter().enumerate() {
        for o in 0..4 {
            let expected = match 9 - place {
                0 => -nominal[o],
                3 => nominal[o],
                _ => 0.0,
            };
            assert!((effect[o] - expected).abs() < 1e-12, "{place} {o}");
        }
    }
}

#[test]
fn a_held_command_has_no_effect() {
    let actuator = Actuator { dead_time: 0.05, time_constant: 0.2, ..Actuator::default() };
    let effects = residual_of_actuator::<_, 4>(&CAR, &actuator, 8.0, 0.02, 20).unwrap();
    for o in 0..4 {
        let sum: f64 = effects.iter().map(|effect| effect[o]).sum();
        assert!(sum.abs() < 1e-12, "{sum}");
    }
}
