//! `PassengerCar`: the nonlinear car as an FMU.

use super::plant::{ExtraOutput, PlantFmu, PlantUnit, SignalOutput, delegate};
use crate::signal::{self, Unit};
use crate::vehicle::{Car, CarOutput, CarParameters, CarStatus, Effect, Effects};

/// The FMU's model.
pub type PassengerCar = PlantFmu<Car>;

impl PlantUnit for Car {
    const NAME: &'static str = "PassengerCar";
    const DESCRIPTION: &'static str = "Nonlinear two-track passenger car: roll, pitch, transient Magic Formula tyres, \
                                       steering chain, unmodelled effects; integrated at 1000 Hz";
    const WHAT: &'static str = "car";

    const SIGNALS: &'static [SignalOutput<CarOutput>] = &[
        (&signal::X, |car| car.x),
        (&signal::Y, |car| car.y),
        (&signal::YAW, |car| car.yaw),
        (&signal::VX, |car| car.vx),
        (&signal::VY, |car| car.vy),
        (&signal::YAW_RATE, |car| car.yaw_rate),
        (&signal::AX, |car| car.ax),
        (&signal::AY, |car| car.ay),
        (&signal::STEER, |car| car.steer),
        (&signal::ROLL, |car| car.roll),
        (&signal::PITCH, |car| car.pitch),
    ];

    const MORE: &'static [ExtraOutput<CarOutput>] = &[
        ("roll_rate", Unit::RADIAN_PER_SECOND, "Roll rate of the body", |car| car.roll_rate),
        (
            "road_wheel_angle",
            Unit::RADIAN,
            "Real angle of the road wheels, behind gain and offset of the linkage",
            |car| car.road_wheel_angle,
        ),
        ("drive_force", Unit::NEWTON, "Force that drive (positive) or brakes (negative) are set to", |car| {
            car.drive_force
        }),
        ("road.station", Unit::METRE, "Arc length on the road of road_file; 0 without one", |car| {
            car.station
        }),
    ];

    const WHEELS: &'static [(&'static str, &'static str)] = &[
        ("front_left", "front left"),
        ("front_right", "front right"),
        ("rear_left", "rear left"),
        ("rear_right", "rear right"),
    ];

    const STATUS: (&'static str, &'static [(i32, &'static str, &'static str)]) =
        ("CarStatus", CarStatus::ITEMS);

    fn all_effects() -> impl Iterator<Item = &'static Effect> {
        Effects::ALL.iter()
    }

    delegate!(CarParameters, Effects, CarOutput);
}
