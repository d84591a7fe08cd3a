//! Vehicles whose brakes give less than the driver's wish: the plan brakes earlier, and the bend is driven in its lane.

use rfl_mpc::control::ControllerFor;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::simulate::{CAR_COLUMNS, ClosedLoopFor, Outcome, SimulatedVehicle, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck, VehicleParameters, builtin, builtin_truck};
use std::sync::Arc;

/// A straight road on a slope, a bend of a radius, and a straight again.
fn road(grade: f64, radius: f64) -> Arc<Path> {
    let (mut x, mut y, mut yaw) = (0.0f64, 0.0f64, 0.0f64);
    let mut samples = Vec::new();
    for k in 0..=700 {
        let s = f64::from(k);
        samples.push(Sample { grade: Some(grade), ..Sample::at(x, y) });
        let ramp = ((s - 400.0) / 30.0).clamp(0.0, 1.0) * ((560.0 - s) / 30.0).clamp(0.0, 1.0);
        let middle = yaw + 0.5 * ramp / radius;
        (x, y, yaw) = (x + middle.cos(), y + middle.sin(), yaw + ramp / radius);
    }
    Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
}

/// Drives it, and asserts that the vehicle keeps its lane.
fn keeps_its_lane<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>(
    vehicle: &P::Parameters,
    road: Arc<Path>,
) {
    let controller = ControllerFor::new(P::controller(vehicle), road).unwrap();
    let effects = vehicle.effects().clone();
    let mut closed = ClosedLoopFor::<P, S, C>::at_start(controller, vehicle, &effects, 0.02).unwrap();
    let drive = closed.record(600.0, |_, error| error.abs() < 2.5);
    let max = drive.tracking().max;
    eprintln!("{max:.3} m in {:.0} s", drive.duration());
    assert_eq!(drive.ending.outcome, Outcome::Completed, "{}", drive.ending.reason());
    assert!(max < 0.1, "{max}");
}

#[test]
fn a_laden_truck_descends_to_a_bend() {
    // 2 m/s2 by its brakes, 1.5 of which the slope takes.
    let mut truck = builtin_truck("truck_real").unwrap();
    truck.trailer.mass *= 3.0;
    truck.trailer.yaw_inertia *= 3.0;
    truck.brake.max_force = 2.0 * (truck.tractor.mass + truck.trailer.mass);
    keeps_its_lane::<Truck, 6, TRUCK_COLUMNS>(&truck, road(-0.15, 60.0));
}

#[test]
fn a_car_with_weak_brakes_slows_down_early() {
    let mut car = builtin("c_class").unwrap();
    car.brake.max_force = 1.0 * car.vehicle.mass;
    keeps_its_lane::<Car, 4, CAR_COLUMNS>(&car, road(0.0, 25.0));
}
