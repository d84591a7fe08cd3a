//! Motion of a wheel and the forces on it.

use crate::vehicle::tyre::TyreForces;

/// Motion of the wheel's contact in axes of the wheel, and the torques on the wheel.
#[derive(Clone, Copy)]
pub(in crate::vehicle) struct WheelMotion {
    /// Velocity of the contact point, m/s.
    pub vx: f64,
    pub vy: f64,
    /// Inclination, rad.
    pub gamma: f64,
    /// Drive torque and greatest brake torque, N m.
    pub drive: f64,
    pub brake: f64,
}

/// Motion and forces of a wheel at an instant.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::vehicle) struct WheelFlow {
    pub load: f64,
    pub forces: TyreForces,
    pub kappa: f64,
    pub alpha: f64,
    /// Torque of drive and brake on the wheel, N m.
    pub torque: f64,
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
