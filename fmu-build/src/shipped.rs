//! The FMUs and the system that we ship.

use crate::fmu::Fmu;

/// All FMUs, in the order in which a system steps them: the plant before its controller.
#[must_use]
pub fn fmus() -> Vec<Fmu> {
    Vec::new()
}

/// The system of them all.
pub const SYSTEM: &str = "ClosedLoop";
