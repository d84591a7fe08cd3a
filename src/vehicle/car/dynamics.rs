//! The equations of motion of the two-track car.
//!
//! The frame of the axles moves in the plane of the road; the body rolls about the axis through the roll centres,
//! pitches and heaves over it on springs; the wheels move vertically between springs and tyres. With the
//! specific force `f = a - g` at the CG, roll `p`, roll arm `h`, and small angles of the body:
//!
//! ```text
//!     m fx                        = sum Fx - drag
//!     m fy - ms h p''             = sum Fy + side wind
//!     Iz r' - ms xs h p''         = sum (x Fy - y Fx + Mz)
//!     Ix p'' + sum (hs - hr) mu (fy + x r') = sum y Fs + ms g h p + sum (hs - hr) Fy
//!     Iy q''                      = -sum x Fs - hs sum Fx + sum (hs - R) mu fx - sum (T - R Fx)
//!     ms z''                      = sum Fs - ms g
//!     mw zw''                     = Fz - Fs - mw g +- G,     G = (hr Fyb + R mu (fy + x r') + sum Mx) / track
//! ```
//!
//! `Fs` are the forces of springs, dampers and anti-roll bars, `Fyb` the side force that an axle passes on to the body
//! through its roll centre, `T` the torques of drive and brakes. Not modelled: jacking, anti-dive and -squat,
//! longitudinal sway of the body, bump stops.

use super::plant::{AxlePlant, Plant};
use super::state::{
    HEAVE, HEAVE_RATE, LIFT, LIFT_RATE, PER_WHEEL, PITCH, PITCH_RATE, ROLL, ROLL_RATE, STATES, VX, VY,
    WHEELS, X, Y, YAW, YAW_RATE,
};
use super::wheel::{Slip, WheelFlow, WheelMotion};
use crate::vehicle::parameters::GRAVITY;
use crate::vehicle::trigonometry::{Of, atan, each, sin_or_cos};
use crate::vehicle::tyre::{Coefficients, Contact};

/// What steering and drive give at an instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stage {
    /// Angle of the road wheels, rad.
    pub steer: f64,
    /// Acceleration of drive and brakes, m/s2.
    pub accel: f64,
}

/// What road and earth give.
#[derive(Debug, Clone, Copy)]
pub(super) struct Environment {
    /// Gravity in body axes in the plane of the road, and into it, m/s2.
    pub gravity_x: f64,
    pub gravity_y: f64,
    pub gravity_z: f64,
    /// Friction factors under the axles.
    pub friction: [f64; 2],
}

/// Forces and accelerations at an instant, for outputs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Flow {
    pub wheels: [WheelFlow; 4],
    /// Specific force at the CG in the plane of the road and out of it, m/s2.
    pub specific_x: f64,
    pub specific_y: f64,
    pub specific_z: f64,
    /// Drive force asked of the wheels (brakes negative), N.
    pub drive_force: f64,
}

/// What one axle gives to the body.
#[derive(Clone, Copy, Default)]
struct AxleFlow {
    /// Forces of the tyres in body axes, N, and their moment about the CG, N m.
    fx: f64,
    fy: f64,
    moment: f64,
    /// Overturning moment of the contacts, N m.
    overturning: f64,
    /// Moment about the y axis that drive and brakes take from the wheels to the body beyond what holds the tyres'
    /// longitudinal forces, N m.
    reaction: f64,
    /// Forces of the suspension on the body beyond those at rest, left and right, N.
    left: f64,
    right: f64,
}

/// Speed over which the steady brake pull builds up, m/s.
const PULLS_FROM: f64 = 1.0;

impl Plant {
    /// Rates of all states at an instant. No allocation.
    pub fn derivative(
        &self,
        y: &[f64; STATES],
        stage: &Stage,
        environment: &Environment,
        rates: &mut [f64; STATES],
        flow: &mut Flow,
    ) {
        let (vx, vy, yaw_rate) = (y[VX], y[VY], y[YAW_RATE]);
        let (drive, brake) = self.drive_and_brake(stage.accel, vx);
        flow.drive_force = drive - brake;

        // All wheels at once: their arc tangents and sines are most of the work.
        let steer = [0, 1].map(|axle| self.axles[axle].wheel_angle(y, stage.steer));
        let angles = [steer[0], steer[0], steer[1], steer[1], y[YAW], y[YAW]];
        let [sin_front, cos_front, sin_rear, cos_rear, sin_yaw, cos_yaw] =
            sin_or_cos([Of::Sin, Of::Cos, Of::Sin, Of::Cos, Of::Sin, Of::Cos], angles);
        let steer = [(sin_front, cos_front), (sin_rear, cos_rear)];
        let front = self.axles[0].suspension(0, y, steer[0], drive, brake);
        let rear = self.axles[1].suspension(1, y, steer[1], drive, brake);
        let mut axles = [front.0, rear.0];
        let motions = [front.1[0], front.1[1], rear.1[0], rear.1[1]];
        let at = |wheel: usize| WHEELS + wheel * PER_WHEEL..WHEELS + (wheel + 1) * PER_WHEEL;
        let slips: [Slip; 4] = each(|i| self.axles[i / 2].slip(&y[at(i)], &motions[i], &mut rates[at(i)]));
        let alphas: [f64; 4] = atan(each(|i| slips[i].tangent));
        let contacts: [Contact; 4] = each(|i| Contact {
            kappa: slips[i].kappa,
            alpha: motions[i].side * alphas[i],
            gamma: motions[i].side * motions[i].gamma,
            load: slips[i].load,
            friction: environment.friction_at(i / 2),
        });
        let (front_tyre, rear_tyre) = (&self.axles[0].tyre, &self.axles[1].tyre);
        let forces = Coefficients::forces_of([front_tyre, front_tyre, rear_tyre, rear_tyre], &contacts);
        for i in 0..4 {
            flow.wheels[i] =
                self.axles[i / 2].wheel(&y[at(i)], &motions[i], &contacts[i], forces[i], &mut rates[at(i)]);
        }
        for (index, given) in axles.iter_mut().enumerate() {
            self.axles[index].gather(&flow.wheels[2 * index..2 * index + 2], steer[index], given);
        }
        let [front, rear] = &axles;

        // Air.
        let air_x = vx - (self.effects.wind_x * cos_yaw + self.effects.wind_y * sin_yaw);
        let air_y = vy - (self.effects.wind_y * cos_yaw - self.effects.wind_x * sin_yaw);
        let airspeed = (air_x * air_x + air_y * air_y).sqrt();
        let drag = -self.drag * airspeed * air_x;
        let side = -self.side * airspeed * air_y;
        let pull = self.effects.brake_pull * (vx.abs() / PULLS_FROM).min(1.0);

        // Plane and roll.
        let tyre_x = front.fx + rear.fx;
        let specific_x = (tyre_x + drag) / self.mass;
        let lateral = front.fy + rear.fy + side;
        let yawing = front.moment + rear.moment + side * self.pressure_centre + pull;
        let over = |axle: usize| self.sprung_height - self.axles[axle].roll_centre;
        let rolling = self.axles[0].half_track * (front.left - front.right)
            + self.axles[1].half_track * (rear.left - rear.right)
            + self.sprung_mass * environment.gravity_z * self.roll_arm * y[ROLL]
            + over(0) * front.fy
            + over(1) * rear.fy;
        let solve = |row: &[f64; 3]| row[0] * lateral + row[1] * yawing + row[2] * rolling;
        let specific_y = solve(&self.inverse_inertia[0]);
        let yaw_accel = solve(&self.inverse_inertia[1]);
        let roll_accel = solve(&self.inverse_inertia[2]);

        rates[X] = vx * cos_yaw - vy * sin_yaw;
        rates[Y] = vx * sin_yaw + vy * cos_yaw;
        rates[YAW] = yaw_rate;
        rates[VX] = specific_x + environment.gravity_x + vy * yaw_rate;
        rates[VY] = specific_y + environment.gravity_y - vx * yaw_rate;
        rates[YAW_RATE] = yaw_accel;
        rates[ROLL] = y[ROLL_RATE];
        rates[ROLL_RATE] = roll_accel;

        // Pitch and heave.
        let lighter = environment.gravity_z - GRAVITY;
        let mut pitching = 0.0;
        let mut lifting = -self.sprung_mass * lighter;
        for (axle, given) in self.axles.iter().zip(&axles) {
            let springs = given.left + given.right;
            lifting += springs;
            pitching -= axle.x_sprung * springs + self.sprung_height * given.fx
                - (self.sprung_height - axle.radius) * axle.unsprung_mass * specific_x
                + given.reaction;
        }
        rates[PITCH] = y[PITCH_RATE];
        rates[PITCH_RATE] = pitching / self.pitch_inertia;
        rates[HEAVE] = y[HEAVE_RATE];
        rates[HEAVE_RATE] = lifting / self.sprung_mass;

        // Wheels, vertically.
        for (index, (axle, given)) in self.axles.iter().zip(&axles).enumerate() {
            let unsprung = axle.unsprung_mass * (specific_y + axle.x * yaw_accel);
            let to_body = given.fy - unsprung;
            let couple = (axle.roll_centre * to_body + axle.radius * unsprung + given.overturning)
                / (2.0 * axle.half_track);
            for (side, force) in [(0, couple - given.left), (1, -couple - given.right)] {
                let wheel = 2 * index + side;
                let at = WHEELS + wheel * PER_WHEEL;
                rates[at + LIFT] = y[at + LIFT_RATE];
                rates[at + LIFT_RATE] = (flow.wheels[wheel].load - axle.static_load + force)
                    / (0.5 * axle.unsprung_mass)
                    - lighter;
            }
        }
        flow.specific_x = specific_x;
        // What an accelerometer at the CG feels: the body's sway over the wheels belongs to it.
        flow.specific_y = lateral / self.mass;
        flow.specific_z = environment.gravity_z;
    }

    /// Drive force and greatest brake force at all wheels together, N, both positive.
    fn drive_and_brake(&self, accel: f64, vx: f64) -> (f64, f64) {
        let force = self.nominal_mass * accel;
        if force >= 0.0 {
            let by_power = self.max_power / vx.abs().max(0.1);
            (force.min(self.max_drive_force).min(by_power), 0.0)
        } else {
            (0.0, (-force).min(self.max_brake_force))
        }
    }
}

impl AxlePlant {
    /// Angle of the wheels to the body, rad.
    #[inline]
    fn wheel_angle(&self, y: &[f64; STATES], steer: f64) -> f64 {
        self.steered * steer + self.roll_steer * y[ROLL]
    }

    /// The suspension's forces on the body, and the motion of both wheels, whose angle has the sine and cosine.
    #[inline(always)]
    fn suspension(
        &self,
        index: usize,
        y: &[f64; STATES],
        (sin, cos): (f64, f64),
        drive: f64,
        brake: f64,
    ) -> (AxleFlow, [WheelMotion; 2]) {
        let mut given = AxleFlow::default();
        let vy = y[VY] + self.x * y[YAW_RATE] + self.sway * y[ROLL_RATE];

        // Springs: how far the body stands over each wheel, beyond rest.
        let centre = y[HEAVE] - self.x_sprung * y[PITCH];
        let centre_rate = y[HEAVE_RATE] - self.x_sprung * y[PITCH_RATE];
        let tilt = self.half_track * y[ROLL];
        let tilt_rate = self.half_track * y[ROLL_RATE];
        let left = WHEELS + 2 * index * PER_WHEEL;
        let right = left + PER_WHEEL;
        let rebound = [centre + tilt - y[left + LIFT], centre - tilt - y[right + LIFT]];
        let rebound_rate =
            [centre_rate + tilt_rate - y[left + LIFT_RATE], centre_rate - tilt_rate - y[right + LIFT_RATE]];
        let twist = (rebound[0] - rebound[1]) / (2.0 * self.half_track);
        let bar = self.anti_roll_bar * twist / (2.0 * self.half_track);
        given.left = -self.spring * rebound[0] - self.damper * rebound_rate[0] - bar;
        given.right = -self.spring * rebound[1] - self.damper * rebound_rate[1] + bar;

        let motion = |side: usize, sign: f64| {
            let vx = y[VX] - sign * self.half_track * y[YAW_RATE];
            WheelMotion {
                vx: vx * cos + vy * sin,
                vy: vy * cos - vx * sin,
                gamma: y[ROLL] + sign * self.camber_gain * rebound[side],
                side: sign,
                drive: drive * self.drive_share * self.radius,
                brake: brake * self.brake_share * self.radius,
            }
        };
        (given, [motion(0, 1.0), motion(1, -1.0)])
    }

    /// What both wheels give to the body.
    #[inline(always)]
    fn gather(&self, wheels: &[WheelFlow], (sin, cos): (f64, f64), given: &mut AxleFlow) {
        let given_by = |wheel: &WheelFlow| {
            let force = &wheel.forces;
            (
                force.fx * cos - force.fy * sin,
                force.fx * sin + force.fy * cos,
                force.mz,
                force.mx + self.lateral_compliance * wheel.load * force.fy,
                (wheel.torque - self.radius * force.fx) * cos,
            )
        };
        let (l, r) = (given_by(&wheels[0]), given_by(&wheels[1]));
        given.fx = l.0 + r.0;
        given.fy = l.1 + r.1;
        given.moment = self.x * given.fy - self.half_track * (l.0 - r.0) + (l.2 + r.2);
        given.overturning = l.3 + r.3;
        given.reaction = l.4 + r.4;
    }
}
