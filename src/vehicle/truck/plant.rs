//! The constants of one truck: its parameters with the effects applied.

use super::error::TruckError;
use super::hitch::{HitchPlant, Pin};
use crate::vehicle::drive::DriveLine;
use crate::vehicle::effects::TruckEffects;
use crate::vehicle::parameters::{Body, relaxation_at_rest};
use crate::vehicle::steering::SteeringChain;
use crate::vehicle::truck_parameters::{RestLoads, Trailer, TruckParameters};
use crate::vehicle::tyre::{Coefficients, Tyre, TyreModel};
use crate::vehicle::unit::{AxleParts, BODY, Laden, Load, Masses, PER_WHEEL, UnitConstants, Wheels};

/// Start of the semi-trailer's states: those of a body from its yaw on, without velocities in the plane.
pub(super) const TRAILER: usize = BODY;
/// Number of them.
pub(super) const TRAILER_STATES: usize = 8;
/// The wind-up of the fifth wheel's friction, rad.
pub(super) const WIND_UP: usize = TRAILER + TRAILER_STATES;
/// The first wheel's states; wheels are front, rear and trailer, left and right each.
pub(super) const WHEELS: usize = WIND_UP + 1;
/// All states.
pub(super) const STATES: usize = WHEELS + 6 * PER_WHEEL;

/// The constants of one truck.
pub(super) struct TruckPlant<T: TyreModel = Coefficients> {
    pub tractor: UnitConstants<T, 2>,
    pub trailer: UnitConstants<T, 1>,
    /// Of the tractor, of the semi-trailer.
    pub wheels: [Wheels<T>; 2],
    pub hitch: HitchPlant,
    pub steering: SteeringChain,
    pub drive: DriveLine,
    /// Half the air's density times the areas, kg/m: drag, side of the tractor, side of the semi-trailer.
    pub drag: f64,
    pub side: [f64; 2],
    /// Centre of the side forces, forward of the unit's CG, m.
    pub pressure_centre: [f64; 2],
    pub effects: TruckEffects,
}

/// The laden units at rest, with places in m forward of their CGs.
struct AtRest {
    tractor: Laden,
    trailer: Laden,
    x_front: f64,
    x_rear: f64,
    x_hitch: f64,
    x_pin: f64,
    x_trailer: f64,
    loads: RestLoads,
}

impl AtRest {
    /// # Errors
    /// An axle of the tractor without load.
    fn new(truck: &TruckParameters, effects: &TruckEffects) -> Result<Self, TruckError> {
        let Body { mass, yaw_inertia, roll_inertia, pitch_inertia, cg_height, .. } = truck.tractor;
        let masses = Masses { mass, yaw_inertia, roll_inertia, pitch_inertia, cg_height };
        let tractor = Laden::new(masses, Load::of(&effects.vehicle));
        let Trailer { mass, yaw_inertia, roll_inertia, pitch_inertia, cg_height, .. } = truck.trailer;
        let masses = Masses { mass, yaw_inertia, roll_inertia, pitch_inertia, cg_height };
        let at_cg = Load { mass: effects.trailer.trailer_payload, x: 0.0, shift: 0.0, yaw_inertia: 1.0 };
        let trailer = Laden::new(masses, at_cg);
        let cg = tractor.cg;
        let (x_front, x_rear) = (truck.tractor.cg_to_front_axle - cg, -truck.tractor.cg_to_rear_axle - cg);
        let x_hitch = -truck.hitch.cg_to_hitch + effects.trailer.hitch_offset - cg;
        let (x_pin, x_trailer) = (truck.trailer.cg_to_hitch, -truck.trailer.cg_to_axle);
        let loads =
            RestLoads::new([tractor.mass, trailer.mass], [x_front, x_rear, x_hitch], [x_pin, x_trailer]);
        for (axle, load) in [("front", loads.front), ("rear", loads.rear)] {
            if load <= 0.0 {
                return Err(TruckError::AxleLifted { axle, load });
            }
        }
        Ok(Self { tractor, trailer, x_front, x_rear, x_hitch, x_pin, x_trailer, loads })
    }

    /// The front and rear axle of the tractor, and the group of the semi-trailer.
    fn axles<'a, T>(
        &self,
        truck: &'a TruckParameters,
        [front, rear, trailer]: [T; 3],
        effects: &TruckEffects,
    ) -> ([AxleParts<'a, T>; 2], [AxleParts<'a, T>; 1]) {
        let parts = |axle, (tyre, of_axle): (T, &Tyre), x: f64, load: f64, tyres: f64| AxleParts {
            axle,
            tyre,
            lateral_compliance: of_axle.lateral_compliance,
            x,
            static_load: 0.5 * load,
            tyres,
            steered: false,
            stiffness: 1.0,
            drive_share: 0.0,
            brake_share: 0.0,
        };
        let (axle, tyre, per_side) = (&truck.axle, &truck.tyre, &truck.tyres_per_side);
        let (common, brake, loads) = (&effects.vehicle, &truck.brake, &self.loads);
        let front = AxleParts {
            steered: true,
            stiffness: common.tyre_stiffness_front,
            brake_share: brake.front_share,
            ..parts(&axle.front, (front, &tyre.front), self.x_front, loads.front, per_side.front)
        };
        let rear = AxleParts {
            stiffness: common.tyre_stiffness_rear,
            drive_share: 1.0,
            brake_share: 1.0 - brake.front_share - brake.trailer_share,
            ..parts(&axle.rear, (rear, &tyre.rear), self.x_rear, loads.rear, per_side.rear)
        };
        let group = AxleParts {
            stiffness: effects.trailer.trailer_stiffness,
            brake_share: brake.trailer_share,
            ..parts(&axle.trailer, (trailer, &tyre.trailer), self.x_trailer, loads.trailer, per_side.trailer)
        };
        ([front, rear], [group])
    }
}

impl<T: TyreModel> TruckPlant<T> {
    /// With tyres on the front, rear and trailer axle.
    pub fn new(truck: &TruckParameters, tyres: [T; 3], effects: &TruckEffects) -> Result<Self, TruckError> {
        let relaxation = relaxation_at_rest(truck.front_tyre_load(), &tyres);
        let (common, of_trailer) = (&effects.vehicle, &effects.trailer);
        let rest = AtRest::new(truck, effects)?;
        let (axles, group) = rest.axles(truck, tyres, effects);
        // The tractor rolls about the axis through both roll centres, the semi-trailer about a level one.
        let [front_centre, rear_centre] = axles.each_ref().map(|parts| parts.axle.roll_centre_height);
        let slope = (front_centre - rear_centre) / (rest.x_front - rest.x_rear);
        let tractor_axis = |x: f64| rear_centre + slope * (x - rest.x_rear);
        let trailer_axis = |_: f64| truck.axle.trailer.roll_centre_height;
        let tractor = UnitConstants::new(&rest.tractor, &axles, common, relaxation, tractor_axis);
        let trailer = UnitConstants::new(&rest.trailer, &group, common, relaxation, trailer_axis);
        let height = truck.hitch.height;
        let pins = [
            Pin::new(&tractor, rest.x_hitch, height, tractor_axis(rest.x_hitch)),
            Pin::new(&trailer, rest.x_pin, height, trailer_axis(rest.x_pin)),
        ];
        let friction = truck.hitch.friction + of_trailer.articulation_friction;
        let inertias = [truck.tractor.yaw_inertia, truck.trailer.yaw_inertia];
        let air = &truck.air;
        Ok(Self {
            hitch: HitchPlant::new(&truck.hitch, pins, rest.loads.hitch, friction, inertias),
            wheels: [Wheels::new(tractor.axles.each_ref()), Wheels::new([&trailer.axles[0]; 2])],
            tractor,
            trailer,
            steering: SteeringChain::new(&truck.steering, common),
            drive: DriveLine {
                lag: truck.drive.lag + common.drive_lag,
                gain: common.drive_gain,
                nominal_mass: truck.tractor.mass + truck.trailer.mass,
                max_force: truck.drive.max_force,
                max_power: truck.drive.max_power,
                max_brake_force: truck.brake.max_force,
            },
            drag: 0.5 * air.density * air.drag_area * common.drag,
            side: [air.tractor_side_area, air.trailer_side_area].map(|area| 0.5 * air.density * area),
            pressure_centre: [air.tractor_pressure_centre - rest.tractor.cg, air.trailer_pressure_centre],
            effects: *effects,
        })
    }
}
