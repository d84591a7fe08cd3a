//! Reasons for which a truck could not be made.

use crate::vehicle::effects::EffectOutOfRange;
use crate::vehicle::file::VehicleError;

/// Reasons for which a truck could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum TruckError {
    #[error(transparent)]
    Parameters(#[from] VehicleError),
    #[error(transparent)]
    Effects(#[from] EffectOutOfRange),
    /// Places of CG, load and hitch that leave an axle group without load.
    #[error(
        "the {axle} axle would carry {load} N at rest; change hitch.cg_to_hitch, effect.hitch_offset, effect.payload_x, \
         effect.payload or effect.cg_shift"
    )]
    AxleLifted { axle: &'static str, load: f64 },
}
