//! A truck rolls over long before its tyres slide: the steering asks for no more lateral acceleration than that leaves.

use nalgebra::SVector;
use rfl_mpc::control::{
    Controller, ControllerParameters, Measurement, TRUCK_STATES, TruckController, TruckControllerParameters,
};
use rfl_mpc::nominal::{ContinuousErrorModel, LateralVehicle};
use rfl_mpc::path::{Closure, Path, Sample};
use rfl_mpc::simulate::{Outcome, TruckClosedLoop, TruckDrive};
use rfl_mpc::vehicle::{BUILTIN_TRUCKS, SingleTrack, TruckEffects, builtin, builtin_truck};
use std::sync::Arc;

fn straight_road() -> Arc<Path> {
    let samples = (0..=160).map(|k| Sample::at(5.0 * f64::from(k), 0.0)).collect();
    Arc::new(Path::from_samples(samples, Closure::Open).unwrap())
}

/// Drives a straight road with a heading that is off at its start, at 25 m/s, even where it leaves the lane.
fn drive(
    name: &str,
    yaw: f64,
    effects: TruckEffects,
    change: impl Fn(&mut TruckControllerParameters),
) -> TruckDrive {
    let truck = builtin_truck(name).unwrap();
    let mut parameters = TruckControllerParameters::for_truck(&truck);
    parameters.speed.limit = 25.0;
    change(&mut parameters);
    let controller = TruckController::new(parameters, straight_road()).unwrap();
    let closed = TruckClosedLoop::at_start(controller, &truck, &effects, 0.02).unwrap();
    closed.placed([None, None, Some(yaw), None]).record(100.0, |_, _| true)
}

#[test]
fn a_truck_that_heads_off_its_road_comes_back_on_its_wheels() {
    for &name in BUILTIN_TRUCKS {
        for yaw in [-0.12, 0.07, 0.12] {
            let drive = drive(name, yaw, TruckEffects::default(), |_| ());
            let roll = drive.column("roll").iter().fold(0.0, |most: f64, roll| most.max(roll.abs()));
            assert!(
                drive.duration() > 30.0 && roll < 0.1,
                "{name}, {yaw}: {roll}, {}",
                drive.ending.reason()
            );
            let last = *drive.column("e1").last().unwrap();
            assert!(last.abs() < 0.05, "{name}, {yaw}: {last}");
        }
    }
}

#[test]
fn without_the_bound_it_would_roll_over_or_jack_knife() {
    let drive = drive("truck_simulation", 0.12, TruckEffects::default(), |p| p.mpc.lateral_accel_max = 1e6);
    let reason = drive.ending.reason();
    assert!(reason.contains("rolled over") || reason.contains("jack-knifed"), "{reason}");
}

#[test]
fn what_the_disturbances_ask_for_is_beside_the_bound() {
    // The steering that is off asks for as much as the bound leaves at this speed.
    for offset in [-0.03, 0.03] {
        let mut effects = TruckEffects::default();
        effects.vehicle.steer_offset = offset;
        let drive = drive("truck_simulation", 0.0, effects, |_| ());
        assert_eq!(drive.ending.outcome, Outcome::Completed, "{}", drive.ending.reason());
        let farthest = drive.tracking().max;
        assert!(farthest < 0.5, "{offset}: {farthest}");
    }
}

/// What steers against an offset of the steering is that offset.
fn holds<const S: usize>(model: &ContinuousErrorModel<S>) {
    let offset = model.b * 0.02;
    assert!((model.steady_steer_against(&offset) + 0.02).abs() < 1e-9);
    // A wind on the flank: steady, the body's motion beside the road is zero.
    let mut wind = SVector::zeros();
    (wind[1], wind[3]) = (0.4, 0.1);
    let steer = model.steady_steer_against(&wind);
    let mut of_unknowns = model.a;
    of_unknowns.set_column(0, &model.b);
    let rest = of_unknowns.try_inverse().unwrap() * -wind;
    let mut state = rest;
    state[0] = 0.0;
    let left = model.a * state + model.b * steer + wind;
    assert!(left.norm() < 1e-9 && state[1].abs() < 1e-12 && state[3].abs() < 1e-12, "{left}, {state}");
}

#[test]
fn a_steady_steer_holds_a_vehicle_straight() {
    let car = SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };
    for speed in [3.0, 12.0, 30.0] {
        holds(&car.model_at(speed).unwrap());
        holds::<TRUCK_STATES>(&builtin_truck("truck_real").unwrap().articulated().model_at(speed).unwrap());
    }
}

#[test]
fn a_model_beyond_its_critical_speed_has_bounds() {
    let car = builtin("c_class").unwrap();
    let mut parameters = ControllerParameters::for_car(&car);
    // So soft behind that steering to the left turns it to the right, at 30 m/s.
    parameters.vehicle.rear_stiffness = 30e3;
    parameters.mpc.lateral_accel_max = 1.0;
    let mut controller = Controller::new(parameters, straight_road()).unwrap();
    for y in [0.0, 0.3, -1.0, 3.0] {
        let measured = Measurement { x: 10.0 + y, y, vx: 30.0, ..Measurement::default() };
        let steer = controller.step(&measured).unwrap().steer_cmd;
        let shape = &controller.problem().shape;
        assert!(shape.input_min[0] < shape.input_max[0], "{:?}", shape.input_min);
        assert!(steer.is_finite() && steer.abs() < 0.1, "{steer}");
    }
}
