//! The closed loop in native code, and how well it went.
//!
//! | file | problem |
//! |---|---|
//! | `metrics.rs` | tracking error and step time in a few numbers |

mod metrics;

pub use metrics::{TimeMetrics, TrackingMetrics};
