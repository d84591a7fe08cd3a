//! Reasons for which a car could not be made.

use crate::vehicle::effects::EffectOutOfRange;
use crate::vehicle::file::VehicleError;

/// Reasons for which a car could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum CarError {
    #[error(transparent)]
    Parameters(#[from] VehicleError),
    #[error(transparent)]
    Effects(#[from] EffectOutOfRange),
    /// Payload and shift have put the CG outside the wheelbase.
    #[error(
        "the CG lies {ahead} m ahead of the rear axle, outside the wheelbase of {wheelbase} m; change effect.payload_x, \
         effect.payload or effect.cg_shift"
    )]
    CgOutside { ahead: f64, wheelbase: f64 },
}
