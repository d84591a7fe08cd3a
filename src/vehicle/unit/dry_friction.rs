//! Dry friction with a stiff spring before it slips (Dahl), so that a held body stands and is not pushed back.
//!
//! ```text
//!     T = clamp(k z + d w, +-capacity),    z' = w - min(|w| k / capacity, fastest) z
//! ```

use crate::numerics::lanes::Lanes;

/// Spring and damping of a friction contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::vehicle) struct DryFriction<L = f64> {
    /// N m/rad and N m s/rad.
    pub stiffness: L,
    pub damping: L,
    /// Fastest relaxation of the wind-up, 1/s: faster would be needlessly stiff.
    pub fastest: L,
}

impl<L: Lanes> DryFriction<L> {
    /// Torque against a rotation (rad/s), and the rate of the wind-up; the capacity in N m.
    #[inline(always)]
    pub fn torque(&self, rotation: L, wind_up: L, capacity: L) -> (L, L) {
        let yielding = rotation.abs() * self.stiffness;
        // Slow slip relaxes the wind-up at rotation * stiffness / capacity.
        let slips = (self.fastest * capacity).up_to(yielding);
        let rate = L::choose(slips, self.fastest, yielding / capacity);
        let torque = (self.stiffness * wind_up + self.damping * rotation).clamp(-capacity, capacity);
        (torque, rotation - rate * wind_up)
    }
}
