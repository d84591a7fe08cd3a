//! placeholder until the vehicle branch lands
/// Single track.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct SingleTrack { pub mass: f64, pub yaw_inertia: f64, pub lf: f64, pub lr: f64, pub cf: f64, pub cr: f64 }
