//! Length of the integration's steps, which is also the time between samples of late signals.

/// The longest step of the integration, s.
pub const LONGEST_SUBSTEP: f64 = 1e-3;
