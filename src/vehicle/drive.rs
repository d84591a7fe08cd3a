//! Drive and brakes, as the road sees them: an asked acceleration becomes a force, after a lag and within limits.

/// Constants of drive and brakes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DriveLine {
    /// First-order time constant, s.
    pub lag: f64,
    /// Factor from asked to given acceleration.
    pub gain: f64,
    /// The mass that drive and brakes are laid out for, kg.
    pub nominal_mass: f64,
    /// N, W, N.
    pub max_force: f64,
    pub max_power: f64,
    pub max_brake_force: f64,
}

impl DriveLine {
    /// Drive force and greatest brake force at all wheels together, N, both positive.
    #[inline]
    pub fn forces(&self, accel: f64, vx: f64) -> (f64, f64) {
        let force = self.nominal_mass * accel;
        if force >= 0.0 {
            let by_power = self.max_power / vx.abs().max(0.1);
            (force.min(self.max_force).min(by_power), 0.0)
        } else {
            (0.0, (-force).min(self.max_brake_force))
        }
    }

    /// Where a given acceleration stands after a while (s) of following the asked one, exactly.
    pub fn follow(&self, given: f64, asked: f64, h: f64) -> f64 {
        if self.lag > 0.0 { given + (asked - given) * -(-h / self.lag).exp_m1() } else { asked }
    }
}
