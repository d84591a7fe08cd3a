//! The constants of one car: its parameters with the effects applied.

use super::error::CarError;
use crate::vehicle::drive::DriveLine;
use crate::vehicle::effects::Effects;
use crate::vehicle::parameters::{CarParameters, GRAVITY, relaxation_at_rest};
use crate::vehicle::steering::SteeringChain;
use crate::vehicle::tyre::{Coefficients, TyreModel};
use crate::vehicle::unit::{AxleParts, BODY, Laden, Load, Masses, PER_WHEEL, UnitConstants, Wheels};

/// The first wheel's states; wheels are front left, front right, rear left, rear right.
pub(super) const WHEELS: usize = BODY;
/// All states.
pub(super) const STATES: usize = WHEELS + 4 * PER_WHEEL;

/// The constants of one car.
pub(super) struct CarPlant<T: TyreModel = Coefficients> {
    pub unit: UnitConstants<T, 2>,
    pub wheels: [Wheels<T>; 1],
    pub steering: SteeringChain,
    pub drive: DriveLine,
    /// Half the air's density times the areas, kg/m.
    pub drag: f64,
    pub side: f64,
    pub pressure_centre: f64,
    pub effects: Effects,
}

impl<T: TyreModel> CarPlant<T> {
    /// With tyres on the front and on the rear axle.
    pub fn new(car: &CarParameters, tyres: [T; 2], effects: &Effects) -> Result<Self, CarError> {
        let relaxation = relaxation_at_rest(car.front_tyre_load(), &tyres);
        let [tyre_front, tyre_rear] = tyres;
        let body = &car.vehicle;
        let (front, rear) = (&car.axle.front, &car.axle.rear);
        let wheelbase = car.wheelbase();
        let masses = Masses {
            mass: body.mass,
            yaw_inertia: body.yaw_inertia,
            roll_inertia: body.roll_inertia,
            pitch_inertia: body.pitch_inertia,
            cg_height: body.cg_height,
        };
        let laden = Laden::new(masses, Load::of(effects));
        // Lengths in the file are forward of its CG; `cg` is where payload and shift bring the real one.
        let cg = laden.cg;
        let (x_front, x_rear) = (body.cg_to_front_axle - cg, -body.cg_to_rear_axle - cg);
        if x_front <= 0.0 || x_rear >= 0.0 {
            return Err(CarError::CgOutside { ahead: -x_rear, wheelbase });
        }
        let weight = laden.mass * GRAVITY / (2.0 * wheelbase);
        let front_parts = AxleParts {
            axle: front,
            tyre: tyre_front,
            lateral_compliance: car.tyre.front.lateral_compliance,
            x: x_front,
            static_load: weight * -x_rear,
            tyres: 1.0,
            steered: true,
            stiffness: effects.tyre_stiffness_front,
            drive_share: car.drive.front_share,
            brake_share: car.brake.front_share,
        };
        let rear_parts = AxleParts {
            axle: rear,
            tyre: tyre_rear,
            lateral_compliance: car.tyre.rear.lateral_compliance,
            x: x_rear,
            static_load: weight * x_front,
            tyres: 1.0,
            steered: false,
            stiffness: effects.tyre_stiffness_rear,
            drive_share: 1.0 - car.drive.front_share,
            brake_share: 1.0 - car.brake.front_share,
        };
        // The roll axis goes through both roll centres.
        let slope = (front.roll_centre_height - rear.roll_centre_height) / wheelbase;
        let roll_axis = |x: f64| rear.roll_centre_height + slope * (x - x_rear);
        let unit = UnitConstants::new(&laden, &[front_parts, rear_parts], effects, relaxation, roll_axis);
        Ok(Self {
            wheels: [Wheels::new(unit.axles.each_ref())],
            unit,
            steering: SteeringChain::new(&car.steering, effects),
            drive: DriveLine {
                lag: car.drive.lag + effects.drive_lag,
                gain: effects.drive_gain,
                nominal_mass: body.mass,
                max_force: car.drive.max_force,
                max_power: car.drive.max_power,
                max_brake_force: car.brake.max_force,
            },
            drag: 0.5 * car.air.density * car.air.drag_area * effects.drag,
            side: 0.5 * car.air.density * car.air.side_area,
            pressure_centre: car.air.pressure_centre - cg,
            effects: *effects,
        })
    }
}
