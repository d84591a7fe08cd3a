//! A car's parameters, from a file that people can read and edit.
//!
//! A key of the file is the name of the FMU's parameter: `mass` in section `[vehicle]` is `vehicle.mass`. The
//! table [`CarParameters::TABLE`] declares unit, range and meaning of each once; range checks, FMU parameters and
//! documentation come from it.

use super::builtin::{BUILTIN, CARS};
use super::effects::Effects;
use super::file::{
    self, Doubt, ParameterDeclaration, VehicleError, VehicleKind, VehicleParameters, VehiclePlace,
    check_body, reading, table,
};
use super::tolerance::Tolerances;
use super::tyre::{Coefficients, Tyre, TyreModel};
use crate::path::AxleShares;
use serde::{Deserialize, Serialize};

pub use crate::signal::GRAVITY;

/// All parameters of a car. Units stand in [`CarParameters::TABLE`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct CarParameters {
    /// Name of the car for people.
    pub name: String,
    /// Source of the figures.
    #[serde(default)]
    pub source: String,
    pub vehicle: Body,
    pub axle: Pair<Axle>,
    pub tyre: Pair<Tyre>,
    pub steering: Steering,
    pub drive: Powertrain,
    pub brake: Brake,
    pub air: Air,
    /// Differences of the real car from the rest of the file: neutral, or found by a diagnosis.
    #[serde(default)]
    pub effect: Effects,
    /// Uncertainty of the numbers, where a user knows it.
    #[serde(default, skip_serializing_if = "Tolerances::is_empty")]
    pub tolerance: Tolerances,
}

/// The same of the front and the rear axle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Pair<T> {
    pub front: T,
    pub rear: T,
}

/// Masses, inertias and where they are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Body {
    pub mass: f64,
    pub yaw_inertia: f64,
    pub roll_inertia: f64,
    pub pitch_inertia: f64,
    pub cg_to_front_axle: f64,
    pub cg_to_rear_axle: f64,
    pub cg_height: f64,
}

/// One axle: suspension and wheels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Axle {
    pub track: f64,
    pub unsprung_mass: f64,
    pub spring_rate: f64,
    pub damping: f64,
    #[serde(default)]
    pub anti_roll_bar: f64,
    #[serde(default)]
    pub roll_centre_height: f64,
    #[serde(default)]
    pub camber_gain: f64,
    #[serde(default)]
    pub roll_steer: f64,
    #[serde(default)]
    pub sway: f64,
    pub wheel_inertia: f64,
}

/// The way from the steering command to the road wheels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Steering {
    pub angle_limit: f64,
    pub rate_limit: f64,
    #[serde(default)]
    pub dead_time: f64,
    #[serde(default)]
    pub lag: f64,
    #[serde(default)]
    pub backlash: f64,
    #[serde(default = "one")]
    pub gain: f64,
    #[serde(default)]
    pub offset: f64,
}

/// The engine's force at the road.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Powertrain {
    pub front_share: f64,
    pub max_force: f64,
    pub max_power: f64,
    #[serde(default)]
    pub lag: f64,
}

/// The brakes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Brake {
    pub front_share: f64,
    pub max_force: f64,
}

/// Aerodynamics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Air {
    pub density: f64,
    pub drag_area: f64,
    pub side_area: f64,
    pub pressure_centre: f64,
}

fn one() -> f64 {
    1.0
}

/// Lateral relaxation length of the first of a vehicle's tyres under its load at rest (N), m. None if one has none, so that
/// its change with the load is unknown.
pub(super) fn relaxation_at_rest<T: TyreModel>(load: f64, tyres: &[T]) -> Option<f64> {
    let lengths: Vec<f64> = tyres.iter().map(|tyre| tyre.lateral_relaxation(load, 0.0)).collect();
    lengths.first().copied().filter(|_| lengths.iter().all(|&length| length > 0.0))
}

impl CarParameters {
    /// Every number of a car with name, unit, range and meaning.
    pub const TABLE: &'static [ParameterDeclaration<Self>] = table! {
        vehicle.mass: KILOGRAM in 100.0, 1e5; "Mass of the whole car"
        vehicle.yaw_inertia: KILOGRAM_METRE2 in 10.0, 1e6; "Yaw inertia of the whole car about its CG"
        vehicle.roll_inertia: KILOGRAM_METRE2 in 5.0, 1e6; "Roll inertia of the sprung mass about its CG"
        vehicle.pitch_inertia: KILOGRAM_METRE2 in 10.0, 1e6; "Pitch inertia of the sprung mass about its CG"
        vehicle.cg_to_front_axle: METRE in 0.1, 20.0; "Distance from the whole car's CG to the front axle"
        vehicle.cg_to_rear_axle: METRE in 0.1, 20.0; "Distance from the whole car's CG to the rear axle"
        vehicle.cg_height: METRE in 0.05, 3.0; "Height of the whole car's CG over the road"
        axle.front.track: METRE in 0.3, 4.0; "Track width, front"
        axle.front.unsprung_mass: KILOGRAM in 10.0, 5000.0; "Unsprung mass of both wheels, front"
        axle.front.spring_rate: NEWTON_PER_METRE in 1e3, 1e7; "Spring rate at one wheel, front"
        axle.front.damping: NEWTON_SECOND_PER_METRE in 0.0, 1e5; "Damping rate at one wheel, front"
        axle.front.anti_roll_bar: NEWTON_METRE_PER_RADIAN in 0.0, 1e7; "Roll stiffness of the anti-roll bar, front"
        axle.front.roll_centre_height: METRE in -1.0, 1.0; "Height of the roll centre over the road, front"
        axle.front.camber_gain: RADIAN_PER_METRE in -5.0, 5.0; "Change of a wheel's inclination with rebound, left wheel, top to the right positive, front"
        axle.front.roll_steer: ONE in -1.0, 1.0; "Steering of both wheels to the left for each radian of roll, front"
        axle.front.sway: ONE in 0.0, 1.0; "Share of the body's sway over the roll axis that the contacts take part in; 0 where the suspension guides them exactly, front"
        axle.front.wheel_inertia: KILOGRAM_METRE2 in 0.05, 100.0; "Spin inertia of one wheel, front"
        axle.rear.track: METRE in 0.3, 4.0; "Track width, rear"
        axle.rear.unsprung_mass: KILOGRAM in 10.0, 5000.0; "Unsprung mass of both wheels, rear"
        axle.rear.spring_rate: NEWTON_PER_METRE in 1e3, 1e7; "Spring rate at one wheel, rear"
        axle.rear.damping: NEWTON_SECOND_PER_METRE in 0.0, 1e5; "Damping rate at one wheel, rear"
        axle.rear.anti_roll_bar: NEWTON_METRE_PER_RADIAN in 0.0, 1e7; "Roll stiffness of the anti-roll bar, rear"
        axle.rear.roll_centre_height: METRE in -1.0, 1.0; "Height of the roll centre over the road, rear"
        axle.rear.camber_gain: RADIAN_PER_METRE in -5.0, 5.0; "Change of a wheel's inclination with rebound, left wheel, top to the right positive, rear"
        axle.rear.roll_steer: ONE in -1.0, 1.0; "Steering of both wheels to the left for each radian of roll, rear"
        axle.rear.sway: ONE in 0.0, 1.0; "Share of the body's sway over the roll axis that the contacts take part in; 0 where the suspension guides them exactly, rear"
        axle.rear.wheel_inertia: KILOGRAM_METRE2 in 0.05, 100.0; "Spin inertia of one wheel, rear"
        tyre.front.stiffness_scale: ONE in 0.1, 10.0; "Factor on the tyre file's cornering stiffness, front"
        tyre.front.friction_scale: ONE in 0.05, 3.0; "Factor on the tyre file's friction, front"
        tyre.front.vertical_stiffness: NEWTON_PER_METRE in 1e4, 1e7; "Vertical stiffness of one tyre, front"
        tyre.front.lateral_compliance: METRE_PER_NEWTON in 0.0, 1e-4; "Sideways shift of the contact patch with lateral force, front"
        tyre.rear.stiffness_scale: ONE in 0.1, 10.0; "Factor on the tyre file's cornering stiffness, rear"
        tyre.rear.friction_scale: ONE in 0.05, 3.0; "Factor on the tyre file's friction, rear"
        tyre.rear.vertical_stiffness: NEWTON_PER_METRE in 1e4, 1e7; "Vertical stiffness of one tyre, rear"
        tyre.rear.lateral_compliance: METRE_PER_NEWTON in 0.0, 1e-4; "Sideways shift of the contact patch with lateral force, rear"
        steering.angle_limit: RADIAN in 0.01, 1.4; "Greatest road-wheel angle to either side"
        steering.rate_limit: RADIAN_PER_SECOND in 1e-3, 1e6; "Greatest road-wheel steering rate"
        steering.dead_time: SECOND in 0.0, 2.0; "Dead time of the steering actuator"
        steering.lag: SECOND in 0.0, 5.0; "First-order time constant of the steering actuator"
        steering.backlash: RADIAN in 0.0, 0.5; "Full gap width of the steering backlash"
        steering.gain: ONE in 0.2, 3.0; "Ratio behind the steering sensor: real = gain * measured + offset"
        steering.offset: RADIAN in -0.5, 0.5; "Offset behind the steering sensor: real = gain * measured + offset"
        drive.front_share: ONE in 0.0, 1.0; "Share of the drive force at the front axle"
        drive.max_force: NEWTON in 0.0, 1e6; "Greatest drive force at the wheels"
        drive.max_power: WATT in 0.0, 1e7; "Greatest drive power at the wheels"
        drive.lag: SECOND in 0.0, 5.0; "First-order time constant of drive and brakes"
        brake.front_share: ONE in 0.0, 1.0; "Share of the brake force at the front axle"
        brake.max_force: NEWTON in 0.0, 1e6; "Greatest brake force at the wheels"
        air.density: KILOGRAM_PER_METRE3 in 0.0, 2.0; "Density of the air"
        air.drag_area: METRE2 in 0.0, 20.0; "Drag coefficient times frontal area"
        air.side_area: METRE2 in 0.0, 100.0; "Side force area: side force = density/2 * area * airspeed * lateral airspeed"
        air.pressure_centre: METRE in -10.0, 10.0; "Where the side force acts, forward of the CG"
    };
}

/// A linear single-track model: a careful engineer's nominal model of a car.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SingleTrack {
    /// Mass, kg.
    pub mass: f64,
    /// Yaw inertia, kg m2.
    pub yaw_inertia: f64,
    /// Distance from the CG to the front axle, m.
    pub lf: f64,
    /// Distance from the CG to the rear axle, m.
    pub lr: f64,
    /// Cornering stiffness of the front axle (both tyres), N/rad.
    pub cf: f64,
    /// Cornering stiffness of the rear axle (both tyres), N/rad.
    pub cr: f64,
}

/// A built-in car by name.
///
/// # Errors
/// [`VehicleError::UnknownBuiltin`].
pub fn builtin(name: &str) -> Result<CarParameters, VehicleError> {
    CarParameters::builtin(name)
}

impl VehicleParameters for CarParameters {
    const TABLE: &'static [ParameterDeclaration<Self>] = Self::TABLE;
    const KIND: VehicleKind = VehicleKind::Car;
    const BUILTIN: &'static [&'static str] = BUILTIN;
    type Effects = Effects;

    fn effects(&self) -> &Effects {
        &self.effect
    }

    fn tolerances(&self) -> &Tolerances {
        &self.tolerance
    }

    fn effect_mut(&mut self, id: &str) -> Option<&mut f64> {
        self.effect.get_mut(id)
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn builtin(name: &str) -> Result<Self, VehicleError> {
        file::builtin_of(CARS, name)
    }

    fn tyres(&mut self) -> Vec<(&'static str, &mut Tyre)> {
        vec![("tyre.front.file", &mut self.tyre.front), ("tyre.rear.file", &mut self.tyre.rear)]
    }

    fn check_parts(&self, place: &VehiclePlace) -> Result<(), VehicleError> {
        self.effect.check().map_err(|source| VehicleError::Effect { place: place.clone(), source })?;
        if self.tyre.front.coefficients.is_none() || self.tyre.rear.coefficients.is_none() {
            return Err(VehicleError::NoTyres { place: place.clone() });
        }
        let unsprung = self.axle.front.unsprung_mass + self.axle.rear.unsprung_mass;
        check_body(place, "vehicle.mass", self.vehicle.mass, unsprung)
    }

    fn doubts(&self) -> Vec<Doubt> {
        self.contradictions()
    }
}

reading!(CarParameters);

impl CarParameters {
    /// Wheelbase, m.
    #[must_use]
    pub fn wheelbase(&self) -> f64 {
        self.vehicle.cg_to_front_axle + self.vehicle.cg_to_rear_axle
    }

    /// Load on each axle of the car at rest on a level road, N: front, rear.
    #[must_use]
    pub fn axle_loads(&self) -> (f64, f64) {
        let weight = self.vehicle.mass * GRAVITY / self.wheelbase();
        (weight * self.vehicle.cg_to_rear_axle, weight * self.vehicle.cg_to_front_axle)
    }

    /// Shares of the axles in weight, drive and brakes.
    #[must_use]
    pub fn axle_shares(&self) -> AxleShares {
        let (front, rear) = self.axle_loads();
        let of = |share: f64| [share, 1.0 - share, 0.0];
        let moved = self.vehicle.cg_height / (self.wheelbase() * GRAVITY);
        AxleShares::new([front, rear, 0.0], of(self.drive.front_share), of(self.brake.front_share), moved)
    }

    /// Friction coefficient of the axle that slides first, on a dry road.
    #[must_use]
    pub fn least_friction(&self) -> f64 {
        let (front, rear) = self.axle_loads();
        self.tyre.front.axle_friction(front, 1.0).min(self.tyre.rear.axle_friction(rear, 1.0))
    }

    /// Load on a front tyre at rest, N.
    pub(super) fn front_tyre_load(&self) -> f64 {
        0.5 * self.axle_loads().0
    }

    /// The tyres of its files, with the factors of their axles: front, rear.
    pub(super) fn tyres(&self) -> [Coefficients; 2] {
        [self.tyre.front.scaled(), self.tyre.rear.scaled()]
    }

    /// Lateral relaxation length of the front tyres at rest, m; none if a tyre file lacks it.
    #[must_use]
    pub fn relaxation(&self) -> Option<f64> {
        relaxation_at_rest(self.front_tyre_load(), &self.tyres())
    }

    /// The linear single-track model of this car. Axle stiffnesses are the slopes of the tyres' lateral force at static
    /// load and straight running, both wheels of an axle together.
    #[must_use]
    pub fn single_track(&self) -> SingleTrack {
        let (front, rear) = self.axle_loads();
        SingleTrack {
            mass: self.vehicle.mass,
            yaw_inertia: self.vehicle.yaw_inertia,
            lf: self.vehicle.cg_to_front_axle,
            lr: self.vehicle.cg_to_rear_axle,
            cf: self.tyre.front.axle_stiffness(front, 1.0),
            cr: self.tyre.rear.axle_stiffness(rear, 1.0),
        }
    }
}
