//! The steering actuator's constants from records: of a step, or of any drive.
//!
//! | file | problem |
//! |---|---|
//! | `record.rs` | a step that begins at rest; Pade and first-order models, too |
//! | `steering_drive.rs` | a drive as recorded, the course of its command between rows, its wrong values |
//! | `drives.rs` | any drives: constants with intervals, and a test that the drives determine them |
//! | `rows.rs` | their rows: gaps, wrong values, rows that count |
//! | `response.rs` | the response of a dead time and a lag to the commands, as angle or as yaw rate |
//! | `fit.rs` | least squares over dead time and lag, all else linear |
//! | `best_point.rs` | the best pair without rows that stand out |
//! | `rate_limit.rs`, `backlash.rs` | what may lie beside the lag |
//! | `model_error.rs` | what a linear vehicle between actuator and response gets wrong, as a spread of the constants |
//! | `estimate.rs` | a number with its interval |
//! | `interval.rs` | confidence intervals from the profile of the squares |

mod backlash;
mod best_point;
mod drives;
mod estimate;
mod fit;
mod interval;
mod model_error;
mod rate_limit;
mod record;
mod response;
mod rows;
mod steering_drive;

pub use drives::{
    DrivesError, IdentifiedSteering, identify_by_yaw_rate_from_drives, identify_from_drives,
    identify_with_limit_from_drives,
};
pub use estimate::Estimate;
pub use record::{DelayModel, IdentifiedActuator, IdentifyError, SteeringRecord};
pub use steering_drive::{Between, LeftOut, SteeringDrive};
