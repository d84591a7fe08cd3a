//! Poses and motions that reach the controller late, as those of a localisation do: the controller is not told, and the angle
//! of the steering, which comes in time, cannot show it.

use rfl_mpc::control::{ControllerFor, Measurement};
use rfl_mpc::path::RandomRoad;
use rfl_mpc::simulate::{CAR_COLUMNS, ClosedLoopFor, Outcome, SimulatedVehicle, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck, VehicleParameters as _};
use std::collections::VecDeque;
use std::sync::Arc;

/// Largest lateral error, m, on a random road if all but the steering comes so many steps late.
fn drive<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>(
    name: &str,
    family: RandomRoad,
    late: usize,
) -> f64 {
    let vehicle = P::Parameters::builtin(name).unwrap();
    let path = Arc::new(family.path(2001).unwrap());
    let controller = ControllerFor::new(P::controller(&vehicle), path).unwrap();
    let mut past = VecDeque::new();
    let mut closed = ClosedLoopFor::<P, S, C>::at_start(controller, &vehicle, vehicle.effects(), 0.02)
        .unwrap()
        .with_fault(move |_, measurement: &mut Measurement| {
            past.push_back(*measurement);
            if past.len() > late + 1 {
                past.pop_front();
            }
            *measurement = Measurement { steer: measurement.steer, ..past[0] };
        });
    let drive = closed.record(300.0, |_, error| error.abs() < 2.5);
    assert_eq!(drive.ending.outcome, Outcome::Completed, "{name}, {late} steps: {}", drive.ending.reason());
    drive.tracking().max
}

#[test]
fn cars_stand_a_tenth_of_a_second() {
    for name in ["c_class", "vw_vanagon", "genesis"] {
        let max = drive::<Car, 4, CAR_COLUMNS>(name, RandomRoad::CAR, 5);
        assert!(max < 0.15, "{name}: {max} m");
    }
}

#[test]
fn trucks_stand_four_steps() {
    for name in ["truck_simulation", "truck_real"] {
        let max = drive::<Truck, 6, TRUCK_COLUMNS>(name, RandomRoad::TRUCK, 4);
        assert!(max < 0.1, "{name}: {max} m");
    }
}
