//! Ranges of vehicles: what a vehicle's file may hold, the controller takes, from karts to heavy trucks.

use crate::command::{rfl, text};
use rfl_mpc::control::{ControllerParameters, TruckControllerParameters};
use rfl_mpc::vehicle::{CarParameters, ParameterDeclaration, TruckParameters, builtin, builtin_truck};

/// Gives a vehicle with each number at each end of its range, the others as they are.
fn at_the_ends<V: Clone>(vehicle: &V, table: &[ParameterDeclaration<V>], mut check: impl FnMut(&str, &V)) {
    for parameter in table {
        for value in [parameter.range.0, parameter.range.1] {
            let mut other = vehicle.clone();
            parameter.set(&mut other, value);
            check(&format!("{} = {value}", parameter.name), &other);
        }
    }
}

#[test]
fn what_a_car_s_file_may_hold_the_controller_takes() {
    at_the_ends(&builtin("c_class").unwrap(), CarParameters::TABLE, |name, car| {
        // A tyre's stiffness follows from load and scale; it has no number in the file.
        if let Err(error) = ControllerParameters::for_car(car).check() {
            assert!(error.name.ends_with(".stiffness"), "{name}: {error}");
        }
    });
}

#[test]
fn what_a_truck_s_file_may_hold_the_controller_takes() {
    at_the_ends(&builtin_truck("truck_simulation").unwrap(), TruckParameters::TABLE, |name, truck| {
        if let Err(error) = TruckControllerParameters::for_truck(truck).check() {
            assert!(error.name.ends_with(".stiffness"), "{name}: {error}");
        }
    });
}

#[test]
fn cars_and_trucks_have_the_same_ranges_of_what_both_have() {
    let car =
        CarParameters::TABLE.iter().filter(|of| of.name.starts_with("steering.") || of.name == "drive.lag");
    for parameter in car {
        let truck = TruckParameters::TABLE.iter().find(|other| other.name == parameter.name).unwrap();
        assert_eq!(truck.range, parameter.range, "{}", parameter.name);
    }
}

#[test]
fn a_kart_drives_a_random_road_with_the_defaults() {
    let folder = tempfile::tempdir().unwrap();
    let tyre = concat!(env!("CARGO_MANIFEST_DIR"), "/vehicles/tyres/c_class.tir");
    std::fs::write(folder.path().join("kart.toml"), KART.replace("tyres/c_class.tir", tyre)).unwrap();
    for seed in ["831", "832"] {
        let road = rfl(folder.path(), &["course", "--random", "car", "--seed", seed, "--out", "road.csv"]);
        assert!(road.status.success());
        let call =
            ["drive", "--quiet", "--path", "road.csv", "--vehicle", "kart.toml", "--require", "max_e1<=0.5"];
        let output = rfl(folder.path(), &call);
        assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    }
}

/// A racing kart with its driver.
const KART: &str = r#"
name = "kart"
source = "made for a test"

[vehicle]
mass = 150.0
yaw_inertia = 25.0
roll_inertia = 8.0
pitch_inertia = 20.0
cg_to_front_axle = 0.6
cg_to_rear_axle = 0.45
cg_height = 0.25

[axle.front]
track = 1.1
unsprung_mass = 10.0
spring_rate = 60000.0
damping = 1200.0
anti_roll_bar = 5000.0
roll_centre_height = 0.05
camber_gain = 0.0
roll_steer = 0.0
wheel_inertia = 0.06

[axle.rear]
track = 1.2
unsprung_mass = 14.0
spring_rate = 60000.0
damping = 1200.0
anti_roll_bar = 5000.0
roll_centre_height = 0.05
camber_gain = 0.0
roll_steer = 0.0
wheel_inertia = 0.1

[tyre.front]
file = "tyres/c_class.tir"

[tyre.rear]
file = "tyres/c_class.tir"

[steering]
angle_limit = 0.5
rate_limit = 3.0
dead_time = 0.0
lag = 0.02
backlash = 0.0

[drive]
front_share = 0.0
max_force = 700.0
max_power = 8000.0
lag = 0.1

[brake]
front_share = 0.0
max_force = 1200.0

[air]
density = 1.2
drag_area = 0.7
side_area = 0.8
pressure_centre = 0.0
"#;
