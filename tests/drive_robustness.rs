//! The default controller stands what vehicles are: twelve fixed drives on random roads, and margins over speed.

use rfl_mpc::control::{
    ControlledParameters as _, ControllerFor, ControllerParametersFor, LinearController, PredictionModelFor,
    SteeringLoop,
};
use rfl_mpc::path::RandomRoad;
use rfl_mpc::simulate::{CAR_COLUMNS, ClosedLoopFor, Outcome, SensorNoise, SimulatedVehicle, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Truck, VehicleParameters as _};
use std::sync::Arc;

/// Seed of the first road: none of a search's.
const FIRST_ROAD: u64 = 930_001;

/// Vehicle, lag, dead time, lateral acceleration, friction, payload, noise.
type Case = (&'static str, f64, f64, f64, f64, f64, f64);

const CARS: [Case; 9] = [
    ("c_class", 0.0, 0.0, 2.25, 1.0, 0.0, 0.0),
    ("bmw_320i", 0.2, 0.12, 2.25, 1.0, 0.0, 1.0),
    ("ford_escort", 0.1, 0.06, 4.0, 0.6, 300.0, 0.0),
    ("genesis", 0.0, 0.12, 4.0, 1.0, 0.0, 1.0),
    ("vw_vanagon", 0.2, 0.0, 2.25, 0.6, 300.0, 0.0),
    ("c_class", 0.2, 0.12, 4.0, 1.0, 300.0, 0.0),
    ("bmw_320i", 0.05, 0.04, 4.0, 0.6, 0.0, 1.0),
    ("genesis", 0.1, 0.12, 2.25, 1.0, 300.0, 0.0),
    ("vw_vanagon", 0.15, 0.1, 2.25, 1.0, 0.0, 1.0),
];
const TRUCKS: [Case; 3] = [
    ("truck_simulation", 0.2, 0.3, 1.0, 1.0, 0.0, 0.0),
    ("truck_real", 0.1, 0.12, 1.0, 0.6, 3000.0, 1.0),
    ("truck_real", 0.0, 0.0, 1.0, 1.0, 0.0, 0.0),
];

fn drives<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>(
    cases: &[Case],
    family: RandomRoad,
    typical: SensorNoise,
) {
    for (number, (name, lag, dead_time, accel, friction, payload, noise)) in (0..).zip(cases) {
        let vehicle = P::Parameters::builtin(name).unwrap();
        let mut effects = vehicle.effects().clone();
        let values = [
            ("steer_lag", *lag),
            ("steer_delay", *dead_time),
            ("road_friction", *friction),
            ("payload", *payload),
        ];
        for (id, value) in values {
            *P::effect(&mut effects, id).unwrap() = value;
        }
        let mut parameters = P::controller(&vehicle);
        parameters.speed.lateral_accel = *accel;
        let family = RandomRoad { closed: number % 3 == 2, length: 300.0, ..family };
        let path = Arc::new(family.path(FIRST_ROAD + number).unwrap());
        let controller = ControllerFor::new(parameters, path).unwrap();
        let mut closed = ClosedLoopFor::<P, S, C>::at_start(controller, &vehicle, &effects, 0.02).unwrap();
        if *noise > 0.0 {
            closed = closed.with_noise(typical, 1 + number);
        }
        let drive = closed.record(300.0, |_, error| error.abs() < 2.5);
        let max = drive.tracking().max;
        let what = format!("{name}, lag {lag}, dead time {dead_time}, road {}", FIRST_ROAD + number);
        eprintln!("{what}: {max:.3} m in {:.0} s", drive.duration());
        assert_eq!(drive.ending.outcome, Outcome::Completed, "{what}: {}", drive.ending.reason());
        assert!(max <= 0.6, "{what}: {max} m");
    }
}

#[test]
fn nine_cars_stay_on_the_road() {
    drives::<Car, 4, CAR_COLUMNS>(&CARS, RandomRoad::CAR, SensorNoise::TYPICAL);
}

#[test]
fn three_trucks_stay_on_the_road() {
    drives::<Truck, 6, TRUCK_COLUMNS>(&TRUCKS, RandomRoad::TRUCK, SensorNoise::TYPICAL_TRUCK);
}

/// Before the drive has shown the actuator: with the file's, calm.
fn margins<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>() {
    let speeds = [3.0, 5.0, 8.0, 12.0, 18.0, 25.0, 30.0, 35.0];
    for name in P::Parameters::BUILTIN {
        let parameters = P::controller(&P::Parameters::builtin(name).unwrap());
        let parameters = ControllerParametersFor { mpc: parameters.mpc.tightened(0.0), ..parameters };
        let (actuator, vehicle) = (parameters.actuator.actuator(), parameters.vehicle.nominal());
        let model = PredictionModelFor::Actuator(actuator);
        for controller in LinearController::at_speeds(&parameters, model, &speeds).unwrap() {
            let speed = controller.speed;
            let of =
                SteeringLoop::new(controller, vehicle, actuator, parameters.mpc.min_model_speed).unwrap();
            let margins = of.margins().unwrap_or_else(|| panic!("{name} at {speed} m/s: unstable"));
            assert!(margins.delay >= 0.15 && margins.gain >= 2.0, "{name} at {speed} m/s: {margins:?}");
        }
    }
}

#[test]
fn every_built_in_vehicle_has_delay_and_gain_in_hand() {
    margins::<Car, 4, CAR_COLUMNS>();
    margins::<Truck, 6, TRUCK_COLUMNS>();
}
