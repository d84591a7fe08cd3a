//! A side wind makes a light semi-trailer hang on a fifth wheel that sticks and slips, and the loop swings with it. The bound
//! of the steering's rate leaves the loop what it needs to hold that swing.

use rfl_mpc::control::{TruckController, TruckControllerParameters};
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::simulate::{Outcome, TruckClosedLoop};
use rfl_mpc::vehicle::{Effects, TruckEffects, TruckParameters, builtin_truck};
use std::sync::Arc;

/// A straight that ends in a bend of 700 m radius.
fn road() -> Arc<Path> {
    let (mut x, mut y, mut yaw) = (0.0f64, 0.0f64, 0.0f64);
    let mut samples = Vec::new();
    for k in 0..=300 {
        samples.push(Sample::at(x, y));
        let curvature = ((5.0 * f64::from(k) - 350.0) / 200.0).clamp(0.0, 1.0) * 0.0014;
        let middle = yaw + 2.5 * curvature;
        (x, y, yaw) = (x + 5.0 * middle.cos(), y + 5.0 * middle.sin(), yaw + 5.0 * curvature);
    }
    Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
}

/// A tractor of 3.5 t with a semi-trailer of 3 t.
fn small_truck() -> TruckParameters {
    let mut truck = builtin_truck("truck_real").unwrap();
    let tractor = &mut truck.tractor;
    (tractor.mass, tractor.yaw_inertia) = (3500.0, 7500.0);
    (tractor.roll_inertia, tractor.pitch_inertia) = (1800.0, 7000.0);
    (tractor.cg_to_front_axle, tractor.cg_to_rear_axle) = (1.2, 1.5);
    let trailer = &mut truck.trailer;
    (trailer.mass, trailer.yaw_inertia) = (3000.0, 20_000.0);
    (trailer.roll_inertia, trailer.pitch_inertia) = (3000.0, 18_000.0);
    (trailer.cg_to_hitch, trailer.cg_to_axle, trailer.cg_height) = (2.5, 1.5, 1.2);
    (truck.hitch.cg_to_hitch, truck.hitch.height) = (1.2, 0.8);
    truck.steering.lag = 0.1;
    truck
}

#[test]
fn a_swing_of_the_trailer_does_not_grow() {
    let truck = small_truck();
    for wind_y in [-10.0, 8.0, 10.0, 12.0] {
        let controller = TruckController::new(TruckControllerParameters::for_truck(&truck), road()).unwrap();
        let vehicle = Effects { wind_y, ..Effects::default() };
        let effects = TruckEffects { vehicle, ..TruckEffects::default() };
        let mut closed = TruckClosedLoop::at_start(controller, &truck, &effects, 0.02).unwrap();
        let drive = closed.record(200.0, |_, error| error.abs() < 2.5);
        let max = drive.tracking().max;
        assert_eq!(drive.ending.outcome, Outcome::Completed, "{wind_y}: {}", drive.ending.reason());
        assert!(max < 0.6, "{wind_y} m/s: {max}");
    }
}
