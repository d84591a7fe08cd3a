//! A truck's parameters: tractor and semi-trailer, from a file that people can read and edit.
//!
//! As for a car (`parameters.rs`), a key of the file is the name of the FMU's parameter. Axle groups are the front
//! (steered), the rear (driven) and the trailer's. Each has one wheel on each side that stands for all of its tyres.

use super::articulated::Articulated;
use super::builtin::{BUILTIN_TRUCKS, TRUCKS};
use super::effects::TruckEffects;
use super::file::{
    self, Doubt, ParameterDeclaration, VehicleError, VehicleKind, VehicleParameters, VehiclePlace,
    check_body, reading, table,
};
use super::parameters::{Axle, Body, GRAVITY, Steering, relaxation_at_rest};
use super::tolerance::Tolerances;
use super::tyre::{Coefficients, Tyre};
use crate::path::AxleShares;
use serde::{Deserialize, Serialize};

/// All parameters of a truck. Units stand in [`TruckParameters::TABLE`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct TruckParameters {
    /// Name of the truck for people.
    pub name: String,
    /// Source of the figures.
    #[serde(default)]
    pub source: String,
    pub tractor: Body,
    pub trailer: Trailer,
    pub hitch: Hitch,
    pub axle: Triple<Axle>,
    pub tyre: Triple<Tyre>,
    pub tyres_per_side: Triple<f64>,
    pub steering: Steering,
    pub drive: TruckPowertrain,
    pub brake: TruckBrake,
    pub air: TruckAir,
    /// Differences of the real truck from the rest of the file: neutral, or found by a diagnosis.
    #[serde(default)]
    pub effect: TruckEffects,
    /// Uncertainty of the numbers, where a user knows it.
    #[serde(default, skip_serializing_if = "Tolerances::is_empty")]
    pub tolerance: Tolerances,
}

/// The same of the front, the rear and the trailer's axle group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Triple<T> {
    pub front: T,
    pub rear: T,
    pub trailer: T,
}

/// The semi-trailer's masses and inertias, and their places.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Trailer {
    pub mass: f64,
    pub yaw_inertia: f64,
    pub roll_inertia: f64,
    pub pitch_inertia: f64,
    pub cg_to_hitch: f64,
    pub cg_to_axle: f64,
    pub cg_height: f64,
}

/// The fifth wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Hitch {
    pub cg_to_hitch: f64,
    pub height: f64,
    pub vertical_stiffness: f64,
    pub vertical_damping: f64,
    pub roll_stiffness: f64,
    pub roll_damping: f64,
    #[serde(default)]
    pub friction: f64,
    pub articulation_limit: f64,
}

/// The engine's force at the road, at the rear axle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct TruckPowertrain {
    pub max_force: f64,
    pub max_power: f64,
    #[serde(default)]
    pub lag: f64,
}

/// The brakes of all axle groups.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct TruckBrake {
    pub front_share: f64,
    pub trailer_share: f64,
    pub max_force: f64,
}

/// Aerodynamics; the drag acts on the tractor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct TruckAir {
    pub density: f64,
    pub drag_area: f64,
    pub tractor_side_area: f64,
    pub tractor_pressure_centre: f64,
    pub trailer_side_area: f64,
    pub trailer_pressure_centre: f64,
}

impl TruckParameters {
    /// Every number of a truck with name, unit, range and meaning.
    pub const TABLE: &'static [ParameterDeclaration<Self>] = table! {
        tractor.mass: KILOGRAM in 500.0, 1e5; "Mass of the tractor"
        tractor.yaw_inertia: KILOGRAM_METRE2 in 100.0, 1e6; "Yaw inertia of the tractor about its CG"
        tractor.roll_inertia: KILOGRAM_METRE2 in 50.0, 1e6; "Roll inertia of the tractor's sprung mass about its CG"
        tractor.pitch_inertia: KILOGRAM_METRE2 in 100.0, 1e6; "Pitch inertia of the tractor's sprung mass about its CG"
        tractor.cg_to_front_axle: METRE in 0.1, 10.0; "Distance from the tractor's CG to the front axle"
        tractor.cg_to_rear_axle: METRE in 0.1, 10.0; "Distance from the tractor's CG to the rear axle"
        tractor.cg_height: METRE in 0.2, 3.0; "Height of the tractor's CG over the road"
        trailer.mass: KILOGRAM in 500.0, 1e5; "Mass of the semi-trailer"
        trailer.yaw_inertia: KILOGRAM_METRE2 in 100.0, 1e7; "Yaw inertia of the semi-trailer about its CG"
        trailer.roll_inertia: KILOGRAM_METRE2 in 50.0, 1e6; "Roll inertia of the semi-trailer's sprung mass about its CG"
        trailer.pitch_inertia: KILOGRAM_METRE2 in 100.0, 1e7; "Pitch inertia of the semi-trailer's sprung mass about its CG"
        trailer.cg_to_hitch: METRE in 0.1, 20.0; "Distance from the semi-trailer's CG forward to the hitch"
        trailer.cg_to_axle: METRE in 0.1, 20.0; "Distance from the semi-trailer's CG back to its axle group"
        trailer.cg_height: METRE in 0.2, 4.0; "Height of the semi-trailer's CG over the road"
        hitch.cg_to_hitch: METRE in -3.0, 6.0; "Distance from the tractor's CG back to the hitch"
        hitch.height: METRE in 0.2, 2.5; "Height of the hitch over the road"
        hitch.vertical_stiffness: NEWTON_PER_METRE in 1e5, 1e8; "Vertical stiffness of hitch and frames"
        hitch.vertical_damping: NEWTON_SECOND_PER_METRE in 0.0, 1e6; "Vertical damping of hitch and frames"
        hitch.roll_stiffness: NEWTON_METRE_PER_RADIAN in 0.0, 1e7; "Roll stiffness of hitch and frames between tractor and semi-trailer"
        hitch.roll_damping: NEWTON_METRE_SECOND_PER_RADIAN in 0.0, 1e6; "Roll damping of hitch and frames"
        hitch.friction: NEWTON_METRE in 0.0, 50000.0; "Dry friction moment of the fifth wheel against articulation"
        hitch.articulation_limit: RADIAN in 0.3, 3.0; "Articulation at which trailer and cab touch: the truck has jack-knifed"
        axle.front.track: METRE in 0.5, 4.0; "Track width, front"
        axle.front.unsprung_mass: KILOGRAM in 50.0, 5000.0; "Unsprung mass of the axle group, front"
        axle.front.spring_rate: NEWTON_PER_METRE in 1e3, 1e7; "Spring rate of one side, at the track width, front"
        axle.front.damping: NEWTON_SECOND_PER_METRE in 0.0, 1e6; "Damping rate of one side, front"
        axle.front.anti_roll_bar: NEWTON_METRE_PER_RADIAN in 0.0, 1e7; "Roll stiffness beyond that of the springs, front"
        axle.front.roll_centre_height: METRE in -1.0, 2.0; "Height of the roll centre over the road, front"
        axle.front.camber_gain: RADIAN_PER_METRE in -5.0, 5.0; "Change of a wheel's inclination with rebound, left wheel, top to the right positive, front"
        axle.front.roll_steer: ONE in -1.0, 1.0; "Steering of both wheels to the left for each radian of roll, front"
        axle.front.sway: ONE in 0.0, 1.0; "Share of the body's sway over the roll axis that the contacts take part in; 0 where the suspension guides them exactly, front"
        axle.front.wheel_inertia: KILOGRAM_METRE2 in 0.5, 1000.0; "Spin inertia of all wheels of one side, front"
        axle.rear.track: METRE in 0.5, 4.0; "Track width, rear"
        axle.rear.unsprung_mass: KILOGRAM in 50.0, 5000.0; "Unsprung mass of the axle group, rear"
        axle.rear.spring_rate: NEWTON_PER_METRE in 1e3, 1e7; "Spring rate of one side, at the track width, rear"
        axle.rear.damping: NEWTON_SECOND_PER_METRE in 0.0, 1e6; "Damping rate of one side, rear"
        axle.rear.anti_roll_bar: NEWTON_METRE_PER_RADIAN in 0.0, 1e7; "Roll stiffness beyond that of the springs, rear"
        axle.rear.roll_centre_height: METRE in -1.0, 2.0; "Height of the roll centre over the road, rear"
        axle.rear.camber_gain: RADIAN_PER_METRE in -5.0, 5.0; "Change of a wheel's inclination with rebound, left wheel, top to the right positive, rear"
        axle.rear.roll_steer: ONE in -1.0, 1.0; "Steering of both wheels to the left for each radian of roll, rear"
        axle.rear.sway: ONE in 0.0, 1.0; "Share of the body's sway over the roll axis that the contacts take part in; 0 where the suspension guides them exactly, rear"
        axle.rear.wheel_inertia: KILOGRAM_METRE2 in 0.5, 1000.0; "Spin inertia of all wheels of one side, rear"
        axle.trailer.track: METRE in 0.5, 4.0; "Track width, trailer"
        axle.trailer.unsprung_mass: KILOGRAM in 50.0, 10000.0; "Unsprung mass of the axle group, trailer"
        axle.trailer.spring_rate: NEWTON_PER_METRE in 1e3, 1e7; "Spring rate of one side, at the track width, trailer"
        axle.trailer.damping: NEWTON_SECOND_PER_METRE in 0.0, 1e6; "Damping rate of one side, trailer"
        axle.trailer.anti_roll_bar: NEWTON_METRE_PER_RADIAN in 0.0, 1e7; "Roll stiffness beyond that of the springs, trailer"
        axle.trailer.roll_centre_height: METRE in -1.0, 2.0; "Height of the roll centre over the road, trailer"
        axle.trailer.camber_gain: RADIAN_PER_METRE in -5.0, 5.0; "Change of a wheel's inclination with rebound, left wheel, top to the right positive, trailer"
        axle.trailer.roll_steer: ONE in -1.0, 1.0; "Steering of both wheels to the left for each radian of roll, trailer"
        axle.trailer.sway: ONE in 0.0, 1.0; "Share of the body's sway over the roll axis that the contacts take part in; 0 where the suspension guides them exactly, trailer"
        axle.trailer.wheel_inertia: KILOGRAM_METRE2 in 0.5, 1000.0; "Spin inertia of all wheels of one side, trailer"
        tyre.front.stiffness_scale: ONE in 0.1, 10.0; "Factor on the tyre file's cornering stiffness, front"
        tyre.front.friction_scale: ONE in 0.05, 3.0; "Factor on the tyre file's friction, front"
        tyre.front.vertical_stiffness: NEWTON_PER_METRE in 1e4, 1e7; "Vertical stiffness of one tyre, front"
        tyre.front.lateral_compliance: METRE_PER_NEWTON in 0.0, 1e-4; "Sideways shift of the contact patch with lateral force, front"
        tyre.rear.stiffness_scale: ONE in 0.1, 10.0; "Factor on the tyre file's cornering stiffness, rear"
        tyre.rear.friction_scale: ONE in 0.05, 3.0; "Factor on the tyre file's friction, rear"
        tyre.rear.vertical_stiffness: NEWTON_PER_METRE in 1e4, 1e7; "Vertical stiffness of one tyre, rear"
        tyre.rear.lateral_compliance: METRE_PER_NEWTON in 0.0, 1e-4; "Sideways shift of the contact patch with lateral force, rear"
        tyre.trailer.stiffness_scale: ONE in 0.1, 10.0; "Factor on the tyre file's cornering stiffness, trailer"
        tyre.trailer.friction_scale: ONE in 0.05, 3.0; "Factor on the tyre file's friction, trailer"
        tyre.trailer.vertical_stiffness: NEWTON_PER_METRE in 1e4, 1e7; "Vertical stiffness of one tyre, trailer"
        tyre.trailer.lateral_compliance: METRE_PER_NEWTON in 0.0, 1e-4; "Sideways shift of the contact patch with lateral force, trailer"
        tyres_per_side.front: ONE in 1.0, 16.0; "Tyres that share the load of one side, front"
        tyres_per_side.rear: ONE in 1.0, 16.0; "Tyres that share the load of one side, rear"
        tyres_per_side.trailer: ONE in 1.0, 16.0; "Tyres that share the load of one side, trailer"
        steering.angle_limit: RADIAN in 0.01, 1.4; "Greatest road-wheel angle to either side"
        steering.rate_limit: RADIAN_PER_SECOND in 1e-3, 1e6; "Greatest road-wheel steering rate"
        steering.dead_time: SECOND in 0.0, 2.0; "Dead time of the steering actuator"
        steering.lag: SECOND in 0.0, 5.0; "First-order time constant of the steering actuator"
        steering.backlash: RADIAN in 0.0, 0.5; "Full gap width of the steering backlash"
        steering.gain: ONE in 0.2, 3.0; "Ratio behind the steering sensor: real = gain * measured + offset"
        steering.offset: RADIAN in -0.5, 0.5; "Offset behind the steering sensor: real = gain * measured + offset"
        drive.max_force: NEWTON in 0.0, 1e6; "Greatest drive force at the rear wheels"
        drive.max_power: WATT in 0.0, 1e7; "Greatest drive power at the rear wheels"
        drive.lag: SECOND in 0.0, 5.0; "First-order time constant of drive and brakes"
        brake.front_share: ONE in 0.0, 1.0; "Share of the brake force at the front axle"
        brake.trailer_share: ONE in 0.0, 1.0; "Share of the brake force at the trailer's axles; the rear axle has the rest"
        brake.max_force: NEWTON in 0.0, 1e6; "Greatest brake force at the wheels"
        air.density: KILOGRAM_PER_METRE3 in 0.0, 2.0; "Density of the air"
        air.drag_area: METRE2 in 0.0, 50.0; "Drag coefficient times frontal area"
        air.tractor_side_area: METRE2 in 0.0, 200.0; "Side force area of the tractor: side force = density/2 * area * airspeed * lateral airspeed"
        air.tractor_pressure_centre: METRE in -10.0, 10.0; "Where the tractor's side force acts, forward of its CG"
        air.trailer_side_area: METRE2 in 0.0, 200.0; "Side force area of the semi-trailer"
        air.trailer_pressure_centre: METRE in -10.0, 10.0; "Where the semi-trailer's side force acts, forward of its CG"
    };
}

/// A built-in truck by name.
///
/// # Errors
/// [`VehicleError::UnknownBuiltin`].
pub fn builtin_truck(name: &str) -> Result<TruckParameters, VehicleError> {
    TruckParameters::builtin(name)
}

impl VehicleParameters for TruckParameters {
    const TABLE: &'static [ParameterDeclaration<Self>] = Self::TABLE;
    const KIND: VehicleKind = VehicleKind::Truck;
    const BUILTIN: &'static [&'static str] = BUILTIN_TRUCKS;
    type Effects = TruckEffects;

    fn effects(&self) -> &TruckEffects {
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
        file::builtin_of(TRUCKS, name)
    }

    fn tyres(&mut self) -> Vec<(&'static str, &mut Tyre)> {
        vec![
            ("tyre.front.file", &mut self.tyre.front),
            ("tyre.rear.file", &mut self.tyre.rear),
            ("tyre.trailer.file", &mut self.tyre.trailer),
        ]
    }

    fn check_parts(&self, place: &VehiclePlace) -> Result<(), VehicleError> {
        self.effect.check().map_err(|source| VehicleError::Effect { place: place.clone(), source })?;
        let Triple { front, rear, trailer } = &self.tyre;
        if [front, rear, trailer].iter().any(|tyre| tyre.coefficients.is_none()) {
            return Err(VehicleError::NoTyres { place: place.clone() });
        }
        let unsprung = self.axle.front.unsprung_mass + self.axle.rear.unsprung_mass;
        check_body(place, "tractor.mass", self.tractor.mass, unsprung)?;
        check_body(place, "trailer.mass", self.trailer.mass, self.axle.trailer.unsprung_mass)?;
        let TruckBrake { front_share: front, trailer_share: trailer, .. } = self.brake;
        if front + trailer > 1.0 {
            return Err(VehicleError::BrakeShares { place: place.clone(), front, trailer });
        }
        Ok(())
    }

    fn doubts(&self) -> Vec<Doubt> {
        self.contradictions()
    }
}

reading!(TruckParameters);

/// Loads of a truck at rest on a level road, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RestLoads {
    pub front: f64,
    pub rear: f64,
    pub trailer: f64,
    /// Load on the hitch.
    pub hitch: f64,
}

impl RestLoads {
    /// From masses in kg and places in m: the tractor's axles and the hitch forward of its CG, hitch and axle group
    /// forward of the trailer's.
    pub fn new(masses: [f64; 2], [front, rear, hitch]: [f64; 3], [pin, axle]: [f64; 2]) -> Self {
        let [tractor, trailer] = masses.map(|mass| mass * GRAVITY);
        let carried = trailer * -axle / (pin - axle);
        let at_front = (tractor * -rear + carried * (hitch - rear)) / (front - rear);
        Self {
            front: at_front,
            rear: tractor + carried - at_front,
            trailer: trailer * pin / (pin - axle),
            hitch: carried,
        }
    }
}

impl TruckParameters {
    /// Load on each axle group of the truck at rest on a level road, N: front, rear, trailer.
    #[must_use]
    pub fn axle_loads(&self) -> [f64; 3] {
        let Body { cg_to_front_axle, cg_to_rear_axle, .. } = self.tractor;
        let loads = RestLoads::new(
            [self.tractor.mass, self.trailer.mass],
            [cg_to_front_axle, -cg_to_rear_axle, -self.hitch.cg_to_hitch],
            [self.trailer.cg_to_hitch, -self.trailer.cg_to_axle],
        );
        [loads.front, loads.rear, loads.trailer]
    }

    /// Shares of the axle groups in weight, drive and brakes: front, rear, trailer. Weight that braking moves is left out:
    /// most of it is moved between trailer and hitch.
    #[must_use]
    pub fn axle_shares(&self) -> AxleShares {
        let TruckBrake { front_share: front, trailer_share: trailer, .. } = self.brake;
        let brake = [front, 1.0 - front - trailer, trailer];
        AxleShares::new(self.axle_loads(), [0.0, 1.0, 0.0], brake, 0.0)
    }

    /// Friction coefficient of the axle group that slides first, on a dry road.
    #[must_use]
    pub fn least_friction(&self) -> f64 {
        let Triple { front, rear, trailer } = &self.tyre;
        let Triple { front: n_front, rear: n_rear, trailer: n_trailer } = self.tyres_per_side;
        [(front, n_front), (rear, n_rear), (trailer, n_trailer)]
            .into_iter()
            .zip(self.axle_loads())
            .map(|((tyre, per_side), load)| tyre.axle_friction(load, per_side))
            .fold(f64::INFINITY, f64::min)
    }

    /// Load on a front tyre at rest, N.
    pub(super) fn front_tyre_load(&self) -> f64 {
        0.5 * self.axle_loads()[0] / self.tyres_per_side.front
    }

    /// The tyres of its files, with the factors of their axles: front, rear, trailer.
    pub(super) fn tyres(&self) -> [Coefficients; 3] {
        [self.tyre.front.scaled(), self.tyre.rear.scaled(), self.tyre.trailer.scaled()]
    }

    /// Lateral relaxation length of the front tyres at rest, m; none if a tyre file lacks it.
    #[must_use]
    pub fn relaxation(&self) -> Option<f64> {
        relaxation_at_rest(self.front_tyre_load(), &self.tyres())
    }

    /// The linear model of this truck. Stiffnesses are the slopes of the tyres' lateral force at static load and
    /// straight running, all tyres of an axle group together.
    #[must_use]
    pub fn articulated(&self) -> Articulated {
        let [front, rear, trailer] = self.axle_loads();
        let Triple { front: n_front, rear: n_rear, trailer: n_trailer } = self.tyres_per_side;
        Articulated {
            mass1: self.tractor.mass,
            mass2: self.trailer.mass,
            yaw_inertia1: self.tractor.yaw_inertia,
            yaw_inertia2: self.trailer.yaw_inertia,
            a1: self.tractor.cg_to_front_axle,
            b1: self.tractor.cg_to_rear_axle,
            c1: self.hitch.cg_to_hitch,
            a2: self.trailer.cg_to_hitch,
            b2: self.trailer.cg_to_axle,
            stiffness: [
                self.tyre.front.axle_stiffness(front, n_front),
                self.tyre.rear.axle_stiffness(rear, n_rear),
                self.tyre.trailer.axle_stiffness(trailer, n_trailer),
            ],
        }
    }
}
