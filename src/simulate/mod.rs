//! The closed loop in native code, and how well it went.
//!
//! | file | problem |
//! |---|---|
//! | `closed_loop.rs` | controller and car, step by step; the drive log |
//! | `metrics.rs` | tracking error and step time in a few numbers |

mod closed_loop;
mod metrics;

pub use closed_loop::{COLUMNS, ClosedLoop, Drive, DriveError, Row, STATION};
pub use metrics::{TimeMetrics, TrackingMetrics};
