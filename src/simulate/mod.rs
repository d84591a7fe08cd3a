//! The closed loop in native code, and how well it went.
//!
//! | file | problem |
//! |---|---|
//! | `closed_loop.rs` | controller and car, step by step; the drive log |
//! | `experiment/` | the comparison of all variants on several plants |
//! | `noise.rs` | noise on what the controller is told |
//! | `metrics.rs` | tracking error, roughness of the steering and step time in a few numbers |

mod closed_loop;
#[cfg(feature = "cli")]
pub mod experiment;
mod metrics;
mod noise;

pub use closed_loop::{COLUMNS, ClosedLoop, Drive, DriveError, Row, STATION};
pub use metrics::{InputMetrics, StepTimes, TimeMetrics, TrackingMetrics};
pub use noise::SensorNoise;
