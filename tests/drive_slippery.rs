//! A road whose file tells of ice is driven by it: brakes and drive ask for no more than the tyres give, and each vehicle
//! keeps its lane. On a wet road that nobody tells of, the speed is not caught up where the bend needs the grip.

use rfl_mpc::control::ControllerFor;
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::simulate::{CAR_COLUMNS, ClosedLoopFor, Outcome, SimulatedVehicle, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck, VehicleParameters as _};
use std::sync::Arc;

/// Straight, a bend of 30 m, straight; ice from before the braking to the end.
fn icy_road() -> Arc<Path> {
    let (mut x, mut y, mut yaw) = (0.0f64, 0.0f64, 0.0f64);
    let mut samples = Vec::new();
    for k in 0..=460 {
        let s = f64::from(k);
        samples.push(Sample { friction: Some(if s < 90.0 { 1.0 } else { 0.2 }), ..Sample::at(x, y) });
        let ramp = ((s - 220.0) / 20.0).clamp(0.0, 1.0) * ((320.0 - s) / 20.0).clamp(0.0, 1.0);
        let middle = yaw + 0.5 * ramp / 30.0;
        (x, y, yaw) = (x + middle.cos(), y + middle.sin(), yaw + ramp / 30.0);
    }
    Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
}

fn drives<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>() {
    for name in P::Parameters::BUILTIN {
        drives_on_ice::<P, S, C>(name, &P::Parameters::builtin(name).unwrap());
    }
}

fn drives_on_ice<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>(
    name: &str,
    vehicle: &P::Parameters,
) {
    let controller = ControllerFor::new(P::controller(vehicle), icy_road()).unwrap();
    let effects = vehicle.effects().clone();
    let mut closed = ClosedLoopFor::<P, S, C>::at_start(controller, vehicle, &effects, 0.02).unwrap();
    let drive = closed.record(300.0, |_, error| error.abs() < 2.5);
    let max = drive.tracking().max;
    eprintln!("{name}: {max:.3} m in {:.0} s", drive.duration());
    assert_eq!(drive.ending.outcome, Outcome::Completed, "{name}: {}", drive.ending.reason());
    assert!(max < 0.3, "{name}: {max}");
}

#[test]
fn cars_brake_for_a_bend_on_ice() {
    drives::<Car, 4, CAR_COLUMNS>();
}

#[test]
fn trucks_brake_for_a_bend_on_ice() {
    drives::<Truck, 6, TRUCK_COLUMNS>();
}

/// An axle whose share of brakes or drive is larger than that of the weight slides first: nothing asks for more than it holds.
#[test]
fn brakes_and_drive_that_do_not_fit_the_loads_keep_within_the_grip_of_each_axle() {
    // Share of the weight in front, and the shares of drive and brakes there.
    let cases = [
        ("light in front, braked there", [0.32, 1.0, 0.68]),
        ("light in front, braked there alone", [0.32, 0.0, 1.0]),
        ("heavy in front, braked behind", [0.66, 1.0, 0.3]),
        ("heavy in front, driven behind", [0.66, 0.0, 0.7]),
    ];
    for (name, [weight, drive, brake]) in cases {
        let mut car = <Car as SimulatedVehicle<4, CAR_COLUMNS>>::Parameters::builtin("c_class").unwrap();
        let wheelbase = car.wheelbase();
        car.vehicle.cg_to_front_axle = (1.0 - weight) * wheelbase;
        car.vehicle.cg_to_rear_axle = weight * wheelbase;
        (car.drive.front_share, car.brake.front_share) = (drive, brake);
        drives_on_ice::<Car, 4, CAR_COLUMNS>(name, &car);
    }
}

/// From standstill on a circle of 62 m, wet and not told so: driven wheels that spin no longer steer.
#[test]
fn the_plan_is_caught_up_with_the_grip_that_a_bend_leaves() {
    let angle = |k: i32| f64::from(k) * std::f64::consts::TAU / 400.0;
    let circle = (0..400).map(|k| Sample::at(62.0 * angle(k).sin(), 62.0 - 62.0 * angle(k).cos()));
    let circle = Arc::new(Path::from_samples(circle.collect(), Closure::Closed).unwrap());
    for name in ["c_class", "ford_escort"] {
        let vehicle = <Car as SimulatedVehicle<4, CAR_COLUMNS>>::Parameters::builtin(name).unwrap();
        let mut parameters = <Car as SimulatedVehicle<4, CAR_COLUMNS>>::controller(&vehicle);
        parameters.speed.lateral_accel = 4.0;
        (parameters.actuator.dead_time, parameters.actuator.time_constant) = (0.12, 0.2);
        let mut effects = *vehicle.effects();
        effects.road_friction *= 0.6;
        effects.steer_delay += 0.12;
        effects.steer_lag += 0.2;
        let controller = ControllerFor::new(parameters, circle.clone()).unwrap();
        let mut closed =
            ClosedLoopFor::<Car, 4, CAR_COLUMNS>::at_start(controller, &vehicle, &effects, 0.02).unwrap();
        let drive = closed.record(60.0, |_, error| error.abs() < 2.5);
        assert_eq!(drive.ending.outcome, Outcome::Completed, "{name}: {}", drive.ending.reason());
        assert!(drive.tracking().max < 0.2, "{name}: {}", drive.tracking().max);
    }
}
