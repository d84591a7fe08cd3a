//! Drive logs: what a vehicle did, recorded by us, by an FMI host, or on a foreign vehicle.
//!
//! A log is a CSV file with a header and the names of the [vocabulary](crate::signal), in any order; other columns are
//! left alone. What is missing is made from what is there, and said:
//!
//! | missing | made from |
//! |---|---|
//! | `steer_cmd` | `steer`, the measured angle; delays before it can then not be learned |
//! | `curvature_rate` | `curvature` along `station`, or along the way driven with `vx` |
//! | `e1`, `e1_rate`, `e2`, `e2_rate`, `curvature` | pose and velocities, projected onto the road that is given |
//!
//! | file | idea |
//! |---|---|
//! | `read.rs` | a CSV file's columns |
//! | `clean.rs` | a log made ready for comparison: even clock, gaps, units, signs |
//! | `clock.rs` | its clock: unit, order, gaps, jitter |
//! | `resample.rs` | a column on an even clock |
//! | `agreement.rs` | what columns must tell alike, or a unit or a sign is wrong |
//! | `units.rs` | the fewest foreign units that explain what columns tell |
//! | `outliers.rs` | values beyond any vehicle, and rows that their neighbours contradict |
//! | `statistics.rs` | median, slope |
//! | `road.rs` | where on a road it was driven, and what the road is like there |
//! | `join.rs` | several logs of one vehicle as one |
//! | `finding.rs` | what was found in a log, in words |
//! | `steering.rs` | what the steering actuator is identified from |
//! | `learn.rs` | what a residual is learned from, completed |

mod agreement;
mod clean;
mod clock;
mod finding;
mod join;
mod learn;
mod outliers;
mod read;
mod resample;
mod road;
mod statistics;
mod steering;
mod units;

pub use clean::{CleanError, CleanLog, UnusableLog};
pub use finding::{Finding, Gravity};
pub use join::JoinError;
pub use learn::{LearnError, drives_of};
pub use read::{DriveLog, LogError};
pub use road::NotOnRoad;
pub use steering::SteeringLog;
