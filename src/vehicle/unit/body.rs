//! The equations of motion of one unit.

use super::axle::AxleFlow;
use super::constants::{Gravity, UnitConstants};
use super::wheel_motion::WheelFlow;
use super::{
    BODY, HEAVE, HEAVE_RATE, LIFT, LIFT_RATE, PER_WHEEL, PITCH, PITCH_RATE, ROLL, ROLL_RATE, VX, VY, X, Y,
    YAW, YAW_RATE,
};
use crate::vehicle::parameters::GRAVITY;
use crate::vehicle::tyre::TyreModel;

/// Loads on a unit: forces in N, moments about its CG (roll: about the body's) in N m.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::vehicle) struct Push {
    pub longitudinal: f64,
    pub lateral: f64,
    pub yawing: f64,
    pub rolling: f64,
}

/// Response to a push: specific forces at the CG in m/s2, angular accelerations in rad/s2.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::vehicle) struct Acceleration {
    pub specific_x: f64,
    pub specific_y: f64,
    pub yaw: f64,
    pub roll: f64,
}

impl Push {
    pub fn add(&mut self, more: &Self) {
        self.longitudinal += more.longitudinal;
        self.lateral += more.lateral;
        self.yawing += more.yawing;
        self.rolling += more.rolling;
    }
}

impl<T: TyreModel, const A: usize> UnitConstants<T, A> {
    /// Mean speed of the driven wheels' rims by their shares in the drive force, m/s; the wheels' states follow each other.
    #[inline(always)]
    pub fn rim_speed(&self, wheels: &[f64]) -> f64 {
        (0..A).map(|i| self.axles[i].rim_speed(&wheels[2 * i * PER_WHEEL..])).sum()
    }

    /// Push of the axles and the leaning body's weight on the unit; air and hitch come on top.
    #[inline(always)]
    pub fn push(&self, body: &[f64; BODY], axles: &[AxleFlow; A], gravity: &Gravity) -> Push {
        let sum = |of: &dyn Fn(usize) -> f64| (0..A).map(of).reduce(|sum, of| sum + of).unwrap_or(0.0);
        let springs = sum(&|i| self.axles[i].half_track * (axles[i].left - axles[i].right));
        let leaning = springs + self.sprung_mass * gravity.z * self.roll_arm * body[ROLL];
        let over = |i: usize| self.sprung_height - self.axles[i].roll_centre;
        Push {
            longitudinal: sum(&|i| axles[i].fx),
            lateral: sum(&|i| axles[i].fy),
            yawing: sum(&|i| axles[i].moment),
            rolling: (0..A).fold(leaning, |rolling, i| rolling + over(i) * axles[i].fy),
        }
    }

    /// Response to a push.
    #[inline(always)]
    pub fn acceleration(&self, push: &Push) -> Acceleration {
        let solve = |row: &[f64; 3]| row[0] * push.lateral + row[1] * push.yawing + row[2] * push.rolling;
        Acceleration {
            specific_x: push.longitudinal / self.mass,
            specific_y: solve(&self.inverse_inertia[0]),
            yaw: solve(&self.inverse_inertia[1]),
            roll: solve(&self.inverse_inertia[2]),
        }
    }

    /// Rates of pose, plane velocities and roll; the yaw's sine and cosine.
    #[inline(always)]
    pub fn plane(
        body: &[f64; BODY],
        accel: &Acceleration,
        gravity: &Gravity,
        (sin_yaw, cos_yaw): (f64, f64),
        rates: &mut [f64],
    ) {
        let (vx, vy, yaw_rate) = (body[VX], body[VY], body[YAW_RATE]);
        rates[X] = vx * cos_yaw - vy * sin_yaw;
        rates[Y] = vx * sin_yaw + vy * cos_yaw;
        rates[YAW] = yaw_rate;
        rates[VX] = accel.specific_x + gravity.x + vy * yaw_rate;
        rates[VY] = accel.specific_y + gravity.y - vx * yaw_rate;
        rates[YAW_RATE] = accel.yaw;
        rates[ROLL] = body[ROLL_RATE];
        rates[ROLL_RATE] = accel.roll;
    }

    /// Rates of pitch and heave, and of the wheels' lift; wheels' states follow each other.
    #[inline(always)]
    pub fn vertical(
        &self,
        body: &[f64; BODY],
        axles: &[AxleFlow; A],
        accel: &Acceleration,
        gravity: &Gravity,
        (wheels, flows): (&[f64], &[WheelFlow]),
        (rates, wheel_rates): (&mut [f64], &mut [f64]),
    ) {
        let lighter = gravity.z - GRAVITY;
        let mut pitching = 0.0;
        let mut lifting = -self.sprung_mass * lighter;
        for (axle, given) in self.axles.iter().zip(axles) {
            let springs = given.left + given.right;
            lifting += springs;
            pitching -= axle.x_sprung * springs + self.sprung_height * given.fx
                - (self.sprung_height - axle.radius) * axle.unsprung_mass * accel.specific_x
                + given.reaction;
        }
        rates[PITCH] = body[PITCH_RATE];
        rates[PITCH_RATE] = pitching / self.pitch_inertia;
        rates[HEAVE] = body[HEAVE_RATE];
        rates[HEAVE_RATE] = lifting / self.sprung_mass;

        for (index, (axle, given)) in self.axles.iter().zip(axles).enumerate() {
            let unsprung = axle.unsprung_mass * (accel.specific_y + axle.x * accel.yaw);
            let to_body = given.fy - unsprung;
            let couple = (axle.roll_centre * to_body + axle.radius * unsprung + given.overturning)
                / (2.0 * axle.half_track);
            for (side, force) in [(0, couple - given.left), (1, -couple - given.right)] {
                let wheel = 2 * index + side;
                let at = wheel * PER_WHEEL;
                wheel_rates[at + LIFT] = wheels[at + LIFT_RATE];
                wheel_rates[at + LIFT_RATE] =
                    (flows[wheel].load - axle.static_load + force) / (0.5 * axle.unsprung_mass) - lighter;
            }
        }
    }

    /// Adds the effect of a moment about the body's y axis (N m) and a force upwards (N) on the rates of pitch and
    /// heave.
    #[inline(always)]
    pub fn lift(&self, pitching: f64, force: f64, rates: &mut [f64]) {
        rates[PITCH_RATE] += pitching / self.pitch_inertia;
        rates[HEAVE_RATE] += force / self.sprung_mass;
    }
}
