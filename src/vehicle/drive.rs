//! Drive and brakes at the road: an asked acceleration becomes a force, after a lag and within limits.
//!
//! The engine turns the driven wheels through open differentials, which share its force `F` in a fixed proportion `s`
//! whatever the wheels' speeds `w`. Its power is that at the wheels, not that of the vehicle's motion:
//!
//! ```text
//!     P = sum T w = F v,     T = s F R,     v = sum s R w,     F <= Pmax / |v|
//! ```
//!
//! So a wheel that spins takes power, and leaves little force to itself and to the other wheels.

/// Speed of the rims below which the power no longer bounds the force, m/s: no engine turns so slowly.
const SLOWEST: f64 = 0.1;

/// Constants of drive and brakes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DriveLine {
    /// First-order time constant, s.
    pub lag: f64,
    /// Factor from asked to given acceleration.
    pub gain: f64,
    /// Design mass of drive and brakes, kg.
    pub nominal_mass: f64,
    /// N, W, N.
    pub max_force: f64,
    pub max_power: f64,
    pub max_brake_force: f64,
}

impl DriveLine {
    /// Drive force and greatest brake force at all wheels together, N, both positive. `rim` is the mean speed of the
    /// driven wheels' rims, weighted by their shares in the force, m/s.
    #[inline]
    pub fn forces(&self, accel: f64, rim: f64) -> (f64, f64) {
        let force = self.nominal_mass * accel;
        if force >= 0.0 {
            let by_power = self.max_power / rim.abs().max(SLOWEST);
            (force.min(self.max_force).min(by_power), 0.0)
        } else {
            (0.0, (-force).min(self.max_brake_force))
        }
    }

    /// Given acceleration after a time (s) of following the asked one, exactly.
    pub fn follow(&self, given: f64, asked: f64, h: f64) -> f64 {
        if self.lag > 0.0 { given + (asked - given) * -(-h / self.lag).exp_m1() } else { asked }
    }
}
