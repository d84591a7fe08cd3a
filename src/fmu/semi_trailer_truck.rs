//! `SemiTrailerTruck`: the nonlinear tractor and semi-trailer as an FMU.

use super::plant::{ExtraOutput, PlantFmu, PlantUnit, SignalOutput, delegate};
use crate::signal::{self, Unit};
use crate::vehicle::{Effect, Truck, TruckEffects, TruckOutput, TruckParameters, TruckStatus};

/// The FMU's model.
pub type SemiTrailerTruck = PlantFmu<Truck>;

impl PlantUnit for Truck {
    const NAME: &'static str = "SemiTrailerTruck";
    const DESCRIPTION: &'static str = "Nonlinear tractor and semi-trailer: articulation, roll and load transfer of both \
                                       units, transient Magic Formula tyres, fifth wheel, steering chain, unmodelled \
                                       effects; integrated at 1000 Hz";
    const WHAT: &'static str = "truck";

    const SIGNALS: &'static [SignalOutput<TruckOutput>] = &[
        (&signal::X, |truck| truck.x),
        (&signal::Y, |truck| truck.y),
        (&signal::YAW, |truck| truck.yaw),
        (&signal::VX, |truck| truck.vx),
        (&signal::VY, |truck| truck.vy),
        (&signal::YAW_RATE, |truck| truck.yaw_rate),
        (&signal::AX, |truck| truck.ax),
        (&signal::AY, |truck| truck.ay),
        (&signal::STEER, |truck| truck.steer),
        (&signal::ROLL, |truck| truck.roll),
        (&signal::PITCH, |truck| truck.pitch),
        (&signal::ARTICULATION, |truck| truck.articulation),
        (&signal::ARTICULATION_RATE, |truck| truck.articulation_rate),
    ];

    const MORE: &'static [ExtraOutput<TruckOutput>] = &[
        ("roll_rate", Unit::RADIAN_PER_SECOND, "Roll rate of the tractor's body", |truck| truck.roll_rate),
        ("trailer.x", Unit::METRE, "East position of the semi-trailer's CG", |truck| truck.trailer.x),
        ("trailer.y", Unit::METRE, "North position of the semi-trailer's CG", |truck| truck.trailer.y),
        ("trailer.yaw", Unit::RADIAN, "Yaw angle of the semi-trailer, continuous (not wrapped)", |truck| {
            truck.trailer.yaw
        }),
        (
            "trailer.vx",
            Unit::METRE_PER_SECOND,
            "Longitudinal velocity of the semi-trailer's CG in its axes",
            |truck| truck.trailer.vx,
        ),
        (
            "trailer.vy",
            Unit::METRE_PER_SECOND,
            "Lateral velocity of the semi-trailer's CG in its axes",
            |truck| truck.trailer.vy,
        ),
        ("trailer.yaw_rate", Unit::RADIAN_PER_SECOND, "Yaw rate of the semi-trailer", |truck| {
            truck.trailer.yaw_rate
        }),
        (
            "trailer.roll",
            Unit::RADIAN,
            "Roll angle of the semi-trailer's body against the road, positive with the right side down",
            |truck| truck.trailer.roll,
        ),
        (
            "hitch.fx",
            Unit::NEWTON,
            "Force of the semi-trailer on the tractor, forward in the tractor's axes",
            |truck| truck.hitch[0],
        ),
        (
            "hitch.fy",
            Unit::NEWTON,
            "Force of the semi-trailer on the tractor, to the left in the tractor's axes",
            |truck| truck.hitch[1],
        ),
        ("hitch.load", Unit::NEWTON, "Load of the semi-trailer on the fifth wheel", |truck| truck.hitch[2]),
        (
            "road_wheel_angle",
            Unit::RADIAN,
            "Real angle of the road wheels, behind gain and offset of the linkage",
            |truck| truck.road_wheel_angle,
        ),
        (
            "drive_force",
            Unit::NEWTON,
            "Force that drive (positive) or brakes (negative) are set to",
            |truck| truck.drive_force,
        ),
        ("road.station", Unit::METRE, "Arc length on the road of road_file; 0 without one", |truck| {
            truck.station
        }),
    ];

    const WHEELS: &'static [(&'static str, &'static str)] = &[
        ("front_left", "front left"),
        ("front_right", "front right"),
        ("rear_left", "rear left"),
        ("rear_right", "rear right"),
        ("trailer_left", "trailer's left"),
        ("trailer_right", "trailer's right"),
    ];

    const STATUS: (&'static str, &'static [(i32, &'static str, &'static str)]) =
        ("TruckStatus", TruckStatus::ITEMS);

    fn all_effects() -> impl Iterator<Item = &'static Effect> {
        TruckEffects::all()
    }

    delegate!(TruckParameters, TruckEffects, TruckOutput);
}
