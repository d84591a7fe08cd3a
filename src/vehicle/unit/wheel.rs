//! One wheel: transient slip, forces, spin and brake.
//!
//! The contact's deflections `u`, `v` (m) follow the slip velocities with the relaxation lengths `s`:
//!
//! ```text
//!     u' = -Vsx - V u / sx,   kappa = u / sx          v' = Vsy - V v / sy,   tan(alpha) = v / sy
//! ```
//!
//! At speed this is first-order relaxation; at rest `V = 0` it is a spring, so that nothing divides by the speed and
//! a braked car holds on a slope (Pacejka, section 8.6). `V` is the rolling speed, and no less than a share of the
//! slip velocity, which bounds the slip of a spinning or sideways wheel.

use super::axle::Axle;
use super::dry_friction::DryFriction;
use super::{DEFLECTION_X, DEFLECTION_Y, LIFT, LIFT_RATE, PER_WHEEL, SPIN, WIND_UP};
use crate::vehicle::trigonometry::{atan, each};
use crate::vehicle::tyre::{Coefficients, Contact, TyreForces};

/// Shortest relaxation length, m: that of a file without one, and of a wheel that lifts.
pub(in crate::vehicle) const SHORTEST_RELAXATION: f64 = 0.1;
/// Greatest longitudinal slip and greatest tangent of the slip angle.
const GREATEST_SLIP: f64 = 1.5;
const GREATEST_TANGENT: f64 = 3.0;
/// Damping of the deflections at rest, s/m, and the speed at which it has gone, m/s.
const DAMPING_AT_REST: f64 = 0.15;
const DAMPED_BELOW: f64 = 2.5;
/// The brake's wind-up is a spring: natural frequency of the wheel on it (rad/s) and damping ratio.
const BRAKE_FREQUENCY: f64 = 300.0;
const BRAKE_DAMPING: f64 = 0.7;
/// Fastest relaxation of the wind-up, 1/s.
const BRAKE_RELAXATION: f64 = 500.0;
/// Rolling speed over which rolling resistance builds up, m/s.
const ROLLING_FROM: f64 = 0.1;

/// Motion of the wheel's contact in axes of the wheel, and what acts on the wheel.
#[derive(Clone, Copy)]
pub(in crate::vehicle) struct WheelMotion {
    /// Velocity of the contact point, m/s.
    pub vx: f64,
    pub vy: f64,
    /// Inclination, rad.
    pub gamma: f64,
    /// +1 on the left, -1 on the right, where the tyre is mounted mirrored.
    pub side: f64,
    /// Drive torque and greatest brake torque, N m.
    pub drive: f64,
    pub brake: f64,
}

/// Load and transient slip of a wheel, the lateral one by its tangent in axes of the wheel.
#[derive(Clone, Copy, Default)]
struct Slip {
    load: f64,
    kappa: f64,
    tangent: f64,
}

/// What a wheel does at an instant.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::vehicle) struct WheelFlow {
    pub load: f64,
    pub forces: TyreForces,
    pub kappa: f64,
    pub alpha: f64,
    /// Torque of drive and brake on the wheel, N m.
    pub torque: f64,
}

/// All wheels of a vehicle at once (their arc tangents and sines are most of the work): what they do, and the rates of
/// their spins, deflections and brakes. States of the wheels follow each other, left and right of each axle.
#[inline(always)]
pub(in crate::vehicle) fn roll<const W: usize>(
    axles: [&Axle; W],
    states: &[f64],
    motions: &[WheelMotion; W],
    friction: [f64; W],
    rates: &mut [f64],
) -> [WheelFlow; W] {
    let at = |wheel: usize| wheel * PER_WHEEL..(wheel + 1) * PER_WHEEL;
    let slips: [Slip; W] = each(|i| axles[i].slip(&states[at(i)], &motions[i], &mut rates[at(i)]));
    let alphas: [f64; W] = atan(each(|i| slips[i].tangent));
    let contacts: [Contact; W] = each(|i| Contact {
        kappa: slips[i].kappa,
        alpha: motions[i].side * alphas[i],
        gamma: motions[i].side * motions[i].gamma,
        load: slips[i].load / axles[i].tyres,
        friction: friction[i],
    });
    let forces = Coefficients::forces_of(axles.map(|axle| &axle.tyre), &contacts);
    each(|i| axles[i].wheel(&states[at(i)], &motions[i], &contacts[i], forces[i], &mut rates[at(i)]))
}

/// One wheel, as outputs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WheelOutput {
    /// Load, N.
    pub load: f64,
    /// Longitudinal slip, positive when driving.
    pub slip: f64,
    /// Slip angle, rad, positive when the contact slips to the left.
    pub slip_angle: f64,
    /// Spin, rad/s.
    pub speed: f64,
    /// Forces in the contact in axes of the wheel, N.
    pub fx: f64,
    /// See `fx`.
    pub fy: f64,
}

impl WheelFlow {
    /// As outputs; the spin in rad/s.
    pub fn output(&self, spin: f64) -> WheelOutput {
        WheelOutput {
            load: self.load,
            slip: self.kappa,
            slip_angle: self.alpha,
            speed: spin,
            fx: self.forces.fx,
            fy: self.forces.fy,
        }
    }
}

impl Axle {
    /// Load of a wheel from its height over rest, N; a tyre does not pull.
    #[inline]
    pub(in crate::vehicle) fn load(&self, wheel: &[f64]) -> f64 {
        let stiffness = self.tyres * self.tyre.vertical_stiffness * wheel[LIFT];
        let damping = self.tyres * self.tyre.vertical_damping * wheel[LIFT_RATE];
        let elastic = self.static_load - stiffness;
        if elastic <= 0.0 { 0.0 } else { (elastic - damping).max(0.0) }
    }

    /// The slip of one wheel, and the rates of its deflections.
    #[inline(always)]
    fn slip(&self, wheel: &[f64], motion: &WheelMotion, rates: &mut [f64]) -> Slip {
        let load = self.load(wheel);
        let spin = wheel[SPIN];
        let slip_x = motion.vx - spin * self.radius;
        let slip_y = motion.vy;
        let speed = motion.vx.abs().max(slip_x.abs() / GREATEST_SLIP).max(slip_y.abs() / GREATEST_TANGENT);
        let each = load / self.tyres;
        let relax_x = self.tyre.longitudinal_relaxation(each).max(SHORTEST_RELAXATION);
        let relax_y = if self.relaxation > 0.0 {
            self.relaxation
        } else {
            self.tyre.lateral_relaxation(each, motion.gamma)
        }
        .max(SHORTEST_RELAXATION);
        let (u, v) = (wheel[DEFLECTION_X], wheel[DEFLECTION_Y]);
        let du = -slip_x - speed * u / relax_x;
        let dv = slip_y - speed * v / relax_y;
        rates[DEFLECTION_X] = du;
        rates[DEFLECTION_Y] = dv;
        // The tyre's own damping matters only near rest, where the deflections are springs.
        let rest = (1.0 - speed / DAMPED_BELOW).max(0.0);
        let damping = DAMPING_AT_REST * rest * rest;
        Slip { load, kappa: u / relax_x + damping * du, tangent: v / relax_y + damping * dv }
    }

    /// What a wheel does with the forces on its contact, and the rates of its spin and brake; contact and forces are
    /// those of each of its tyres.
    #[inline(always)]
    fn wheel(
        &self,
        wheel: &[f64],
        motion: &WheelMotion,
        contact: &Contact,
        mut forces: TyreForces,
        rates: &mut [f64],
    ) -> WheelFlow {
        let spin = wheel[SPIN];
        let rolling = self.tyres
            * self.tyre.rolling_resistance(contact.load, forces.fx, motion.vx)
            * (spin * self.radius / ROLLING_FROM).clamp(-1.0, 1.0);
        forces.fx *= self.tyres;
        forces.fy *= self.tyres * motion.side;
        forces.mx *= self.tyres * motion.side;
        forces.mz *= self.tyres * motion.side;

        let brake = self.brake(spin, wheel[WIND_UP], motion.brake);
        let torque = motion.drive - brake.0;
        rates[SPIN] = (torque - forces.fx * self.radius - rolling) / self.wheel_inertia;
        rates[WIND_UP] = brake.1;
        let load = self.tyres * contact.load;
        WheelFlow { load, forces, kappa: contact.kappa, alpha: motion.side * contact.alpha, torque }
    }

    /// Brake torque against the spin, and the rate of the wind-up.
    #[inline]
    fn brake(&self, spin: f64, wind_up: f64, capacity: f64) -> (f64, f64) {
        DryFriction {
            stiffness: self.wheel_inertia * BRAKE_FREQUENCY * BRAKE_FREQUENCY,
            damping: 2.0 * BRAKE_DAMPING * BRAKE_FREQUENCY * self.wheel_inertia,
            fastest: BRAKE_RELAXATION,
        }
        .torque(spin, wind_up, capacity)
    }
}
