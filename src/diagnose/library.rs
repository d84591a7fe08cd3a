//! The library of a diagnosis: the effects that it may name.
//!
//! They are those of `vehicle::effects`, less those that the user leaves out, and effects of the user's own. An own effect
//! acts on the replayed vehicle: on its steering, its surface, or the signals that it gives.

use crate::vehicle::{Effect, ReducedVehicle};
use std::fmt::Debug;
use std::sync::Arc;

/// An effect of one's own.
pub trait OwnEffect: Debug + Send + Sync {
    /// Its declaration: an id of its own, unit, neutral value, range, stage and meaning.
    fn declaration(&self) -> &'static Effect;

    /// Difference from the neutral value that is clearly an effect, in its unit. Fits count in it.
    fn clear(&self) -> f64;

    /// Standard deviation of its value in vehicles that are as modelled, in its unit; 0 if none has it.
    fn tolerance(&self) -> f64 {
        0.0
    }

    /// Differences at which a fit starts, in units of [`clear`](Self::clear). 0 for an effect that has a slope at its neutral
    /// value.
    fn starts(&self) -> &'static [f64] {
        &[0.0]
    }

    /// The replayed vehicle with the effect at a value.
    fn act(&self, vehicle: Box<dyn ReducedVehicle>, value: f64) -> Box<dyn ReducedVehicle>;
}

/// Effects that a diagnosis may name.
#[derive(Debug, Clone, Copy, Default)]
pub struct Library<'a> {
    /// Effects that are left out; within their tolerances they stay.
    pub without: &'a [String],
    /// Effects of one's own.
    pub own: &'a [Arc<dyn OwnEffect>],
}

impl Library<'_> {
    /// True if an effect may not be named.
    #[must_use]
    pub fn leaves_out(&self, id: &str) -> bool {
        self.without.iter().any(|left_out| left_out == id)
    }

    /// Declarations of all effects.
    pub fn effects(&self) -> impl Iterator<Item = &'static Effect> {
        crate::vehicle::TruckEffects::all().chain(self.own.iter().map(|own| own.declaration()))
    }
}
