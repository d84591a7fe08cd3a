//! The closed loop in native code, and its metrics.
//!
//! | file | problem |
//! |---|---|
//! | `outcome.rs` | completed, stopped, lost or timed out: a drive's outcome from the vehicle's true place |
//! | `columns.rs` | columns of a drive log that every vehicle has |
//! | `closed_loop.rs` | controller and vehicle, step by step; the drive log |
//! | `vehicle.rs` | kinds of vehicle in the closed loop: car, truck |
//! | `experiment/` | the comparison of all variants on several plants |
//! | `prove/` | proof that a learned model is better in closed loop, on plants that explain its logs |
//! | `tune/` | controllers that are robust over an ensemble of vehicles |
//! | `noise.rs` | noise on the controller's measurements |
//! | `metrics.rs` | tracking error, roughness of the steering and step time in a few numbers |

mod closed_loop;
mod columns;
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

pub use closed_loop::{CarDrive, CarRow, ClosedLoop, ClosedLoopFor, DriveFor, TruckClosedLoop, TruckDrive};
pub use columns::{COLUMNS, Common, STATION, STATUS, TIME};
pub use metrics::{InputMetrics, StepTimes, TimeMetrics, TrackingMetrics};
pub use noise::SensorNoise;
pub use outcome::{DriveError, End, Ending, LaneLimits, Outcome, Place};
pub use vehicle::{CAR_COLUMNS, SimulatedVehicle, TRUCK_COLUMNS};
