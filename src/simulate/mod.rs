//! The closed loop in native code, and how well it went.
//!
//! | file | problem |
//! |---|---|
//! | `outcome.rs` | completed, stopped, lost or timed out: a drive's outcome from the vehicle's true place |
//! | `closed_loop.rs` | controller and vehicle, step by step; the drive log |
//! | `vehicle.rs` | what must be known of a kind of vehicle: car, truck |
//! | `experiment/` | the comparison of all variants on several plants |
//! | `prove/` | whether a learned model is better in closed loop, on plants that explain its logs |
//! | `tune/` | controllers that stand what vehicles are, searched over an ensemble |
//! | `noise.rs` | noise on what the controller is told |
//! | `metrics.rs` | tracking error, roughness of the steering and step time in a few numbers |

mod closed_loop;
#[cfg(feature = "cli")]
pub mod experiment;
mod metrics;
mod noise;
mod outcome;
#[cfg(feature = "cli")]
pub mod prove;
#[cfg(feature = "cli")]
pub mod tune;
mod vehicle;

pub use closed_loop::{
    COLUMNS, ClosedLoop, ClosedLoopFor, Common, Drive, DriveError, DriveFor, Row, STATION, STATUS, TIME,
    TruckClosedLoop, TruckDrive,
};
pub use metrics::{InputMetrics, StepTimes, TimeMetrics, TrackingMetrics};
pub use noise::SensorNoise;
pub use outcome::{End, Ending, LaneLimits, Outcome, Place};
pub use vehicle::{CAR_COLUMNS, SimulatedVehicle, TRUCK_COLUMNS};
