//! The constants of one car: its parameters with the effects applied.

use super::CarError;
use super::dynamics::Environment;
use crate::vehicle::effects::{Effects, NO_RATE_LIMIT};
use crate::vehicle::parameters::{Axle, CarParameters, GRAVITY, Tyre};
use crate::vehicle::steering::SteeringChain;
use crate::vehicle::tyre::Coefficients;
use nalgebra::Matrix3;

/// One axle with its two wheels.
pub(super) struct AxlePlant {
    pub tyre: Coefficients,
    /// Forward of the CG, m; rear negative.
    pub x: f64,
    /// Forward of the sprung mass's CG, m.
    pub x_sprung: f64,
    /// Half the track, m.
    pub half_track: f64,
    /// Both wheels, kg.
    pub unsprung_mass: f64,
    pub spring: f64,
    pub damper: f64,
    pub anti_roll_bar: f64,
    pub roll_centre: f64,
    pub camber_gain: f64,
    pub roll_steer: f64,
    /// Sideways velocity of the contacts for each radian per second of roll, m.
    pub sway: f64,
    /// Whether the wheels turn with the steering.
    pub steered: f64,
    pub wheel_inertia: f64,
    /// Rolling radius, m.
    pub radius: f64,
    pub lateral_compliance: f64,
    /// Load of one wheel at rest, N.
    pub static_load: f64,
    /// Lateral relaxation length that takes the place of the tyre file's, m; 0: none does.
    pub relaxation: f64,
    /// Share of one wheel in the drive force and in the brake force.
    pub drive_share: f64,
    pub brake_share: f64,
}

/// The constants of one car.
pub(super) struct Plant {
    pub axles: [AxlePlant; 2],
    pub mass: f64,
    pub sprung_mass: f64,
    pub pitch_inertia: f64,
    /// Height of the sprung mass's CG over the road and over the roll axis, m.
    pub sprung_height: f64,
    pub roll_arm: f64,
    /// Inverse of the inertia matrix of (lateral specific force, yaw and roll acceleration).
    pub inverse_inertia: [[f64; 3]; 3],
    /// Place of the reference point (the CG of the file, where the sensors are) forward of the CG, m.
    pub reference_x: f64,
    pub steering: SteeringChain,
    pub drive_lag: f64,
    pub drive_gain: f64,
    /// The mass that drive and brakes are laid out for, kg.
    pub nominal_mass: f64,
    pub max_drive_force: f64,
    pub max_power: f64,
    pub max_brake_force: f64,
    /// Half the air's density times the areas, kg/m.
    pub drag: f64,
    pub side: f64,
    pub pressure_centre: f64,
    pub effects: Effects,
}

impl Plant {
    pub fn new(car: &CarParameters, effects: &Effects) -> Result<Self, CarError> {
        let body = &car.vehicle;
        let (front, rear) = (&car.axle.front, &car.axle.rear);
        let wheelbase = car.wheelbase();
        // Lengths here are forward of the file's CG; `cg` is where payload and shift bring the real one.
        let mass = body.mass + effects.payload;
        let cg = (body.mass * effects.cg_shift + effects.payload * effects.payload_x) / mass;
        let (x_front, x_rear) = (body.cg_to_front_axle - cg, -body.cg_to_rear_axle - cg);
        if x_front <= 0.0 || x_rear >= 0.0 {
            return Err(CarError::CgOutside { ahead: -x_rear, wheelbase });
        }
        let square = |x: f64| x * x;
        let yaw_inertia = body.yaw_inertia * effects.yaw_inertia
            + body.mass * square(effects.cg_shift - cg)
            + effects.payload * square(effects.payload_x - cg);

        let tyres = [&car.tyre.front, &car.tyre.rear].map(Tyre::scaled);
        let radii = [tyres[0].rolling_radius(), tyres[1].rolling_radius()];
        let unsprung = front.unsprung_mass + rear.unsprung_mass;
        let (sprung_empty, sprung_mass) = (body.mass - unsprung, mass - unsprung);
        // The wheels' CG is at the axle's height; what is left of the car's CG height is the body's.
        let height_empty =
            (body.mass * body.cg_height - front.unsprung_mass * radii[0] - rear.unsprung_mass * radii[1])
                / sprung_empty;
        let height = (sprung_empty * height_empty + effects.payload * body.cg_height) / sprung_mass;
        let raised =
            sprung_empty * square(height_empty - height) + effects.payload * square(body.cg_height - height);
        let x_sprung = -(front.unsprung_mass * x_front + rear.unsprung_mass * x_rear) / sprung_mass;

        let weight = mass * GRAVITY / (2.0 * wheelbase);
        let static_loads = [weight * -x_rear, weight * x_front];
        // The roll axis goes through both roll centres.
        let slope = (front.roll_centre_height - rear.roll_centre_height) / wheelbase;
        let roll_arm = height - (rear.roll_centre_height + slope * (x_sprung - x_rear));
        let axle = |index: usize, axle: &Axle, tyre: &Tyre, x: f64| {
            let springs = 0.5 * square(axle.track) * axle.spring_rate;
            let more = (effects.roll_stiffness - 1.0) * (springs + axle.anti_roll_bar);
            let mut coefficients = tyres[index].clone();
            coefficients.lky *= [effects.tyre_stiffness_front, effects.tyre_stiffness_rear][index];
            let share = |front: f64| 0.5 * if index == 0 { front } else { 1.0 - front };
            AxlePlant {
                tyre: coefficients,
                x,
                x_sprung: x - x_sprung,
                half_track: 0.5 * axle.track,
                unsprung_mass: axle.unsprung_mass,
                spring: axle.spring_rate,
                damper: axle.damping,
                anti_roll_bar: axle.anti_roll_bar + more,
                roll_centre: axle.roll_centre_height,
                camber_gain: axle.camber_gain,
                roll_steer: axle.roll_steer,
                sway: -axle.sway * roll_arm,
                steered: if index == 0 { 1.0 } else { 0.0 },
                wheel_inertia: axle.wheel_inertia,
                radius: radii[index],
                lateral_compliance: tyre.lateral_compliance,
                static_load: static_loads[index],
                relaxation: effects.tyre_relaxation,
                drive_share: share(car.drive.front_share),
                brake_share: share(car.brake.front_share),
            }
        };
        let axles = [axle(0, front, &car.tyre.front, x_front), axle(1, rear, &car.tyre.rear, x_rear)];

        let roll_inertia = body.roll_inertia + raised;
        let over = |axle: &AxlePlant| (height - axle.roll_centre) * axle.unsprung_mass;
        let inertia = Matrix3::new(
            mass,
            0.0,
            -sprung_mass * roll_arm,
            0.0,
            yaw_inertia,
            -sprung_mass * x_sprung * roll_arm,
            over(&axles[0]) + over(&axles[1]),
            over(&axles[0]) * x_front + over(&axles[1]) * x_rear,
            roll_inertia,
        );
        // Regular: masses and inertias are positive, and the body's share of the mass is less than all of it.
        let inverse = inertia.try_inverse().unwrap_or_else(Matrix3::identity);
        let row = |i: usize| [inverse[(i, 0)], inverse[(i, 1)], inverse[(i, 2)]];

        let steering = &car.steering;
        let unlimited = |limit: f64| if limit >= NO_RATE_LIMIT { f64::MAX } else { limit };
        Ok(Self {
            axles,
            mass,
            sprung_mass,
            pitch_inertia: body.pitch_inertia + raised,
            sprung_height: height,
            roll_arm,
            inverse_inertia: [row(0), row(1), row(2)],
            reference_x: -cg,
            steering: SteeringChain {
                dead_time: steering.dead_time + effects.steer_delay,
                lag: steering.lag + effects.steer_lag,
                rate_limit: unlimited(steering.rate_limit.min(effects.steer_rate_limit)),
                angle_limit: steering.angle_limit,
                backlash: steering.backlash + effects.steer_backlash,
                gain: steering.gain * effects.steer_gain,
                offset: steering.offset + effects.steer_offset,
            },
            drive_lag: car.drive.lag + effects.drive_lag,
            drive_gain: effects.drive_gain,
            nominal_mass: body.mass,
            max_drive_force: car.drive.max_force,
            max_power: car.drive.max_power,
            max_brake_force: car.brake.max_force,
            drag: 0.5 * car.air.density * car.air.drag_area * effects.drag,
            side: 0.5 * car.air.density * car.air.side_area,
            pressure_centre: car.air.pressure_centre - cg,
            effects: *effects,
        })
    }

    /// Gravity in body axes of the road plane, and friction, for a car heading `yaw` against a road with a bank and
    /// a grade (all rad), and with friction factors under the front and the rear axle.
    pub fn environment(&self, yaw: f64, bank: f64, grade: f64, friction: [f64; 2]) -> Environment {
        let grade = grade + self.effects.road_grade;
        let bank = bank + self.effects.road_bank;
        let along = -GRAVITY * grade.sin();
        let across = -GRAVITY * grade.cos() * bank.sin();
        let (sin, cos) = yaw.sin_cos();
        Environment {
            gravity_x: along * cos + across * sin,
            gravity_y: -along * sin + across * cos,
            gravity_z: GRAVITY * grade.cos() * bank.cos(),
            friction: friction.map(|friction| friction * self.effects.road_friction),
        }
    }
}
