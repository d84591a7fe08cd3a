//! Dry friction with a stiff spring before it slips (Dahl), so that what is held stands and is not pushed back.
//!
//! ```text
//!     T = clamp(k z + d w, +-capacity),    z' = w - min(|w| k / capacity, fastest) z
//! ```

/// Spring and damping of a friction contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::vehicle) struct DryFriction {
    /// N m/rad and N m s/rad.
    pub stiffness: f64,
    pub damping: f64,
    /// Fastest relaxation of the wind-up, 1/s: faster would be needlessly stiff.
    pub fastest: f64,
}

impl DryFriction {
    /// Torque against a rotation (rad/s), and the rate of the wind-up; the capacity in N m.
    #[inline]
    pub fn torque(&self, rotation: f64, wind_up: f64, capacity: f64) -> (f64, f64) {
        let yielding = rotation.abs() * self.stiffness;
        // Slow slip relaxes the wind-up at rotation * stiffness / capacity.
        let rate = if yielding >= self.fastest * capacity { self.fastest } else { yielding / capacity };
        let torque = (self.stiffness * wind_up + self.damping * rotation).clamp(-capacity, capacity);
        (torque, rotation - rate * wind_up)
    }
}
