//! Drive logs: motion of a vehicle, recorded by us, by an FMI host, or on a foreign vehicle.
//!
//! A log is a CSV file with a header and the names of the [vocabulary](crate::signal), in any order; other columns are
//! left alone. Missing columns are computed from others, and reported:
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
//! | `clean_log.rs` | a log on an even clock, mended, and the reasons for which there is none |
//! | `clean.rs` | a log prepared for comparison: even clock, gaps, units, signs |
//! | `even.rs` | columns on an even clock |
//! | `description.rs` | excitation and noise of a log, in words |
//! | `clock.rs` | its clock: unit, order, gaps, jitter |
//! | `resample.rs` | a column on an even clock |
//! | `agreement.rs` | relations between columns that reveal a wrong unit or sign |
//! | `turning.rs` | yaw and yaw rate in radians, yaw without steps |
//! | `units.rs` | the fewest foreign units that explain these relations |
//! | `outliers.rs` | values beyond any vehicle, and rows that their neighbours contradict |
//! | `dropouts.rs` | one number in the place of none, for single rows or a few |
//! | `answered.rs` | answers of the wheels to short commands |
//! | `frozen.rs` | stretches in which a sensor repeats its last value |
//! | `partners.rs` | what other columns tell about the changes of a sensor |
//! | `saturated.rs` | sensors at the end of their range |
//! | `held.rs` | values that a recorder has filled in between samples |
//! | `coarse.rs` | numbers that are written more coarsely than the quantity moves |
//! | `error.rs` | reasons for which a log cannot be used |
//! | `only.rs` | rows of one vehicle among those of several |
//! | `mixed.rs` | rows of two recordings in turn |
//! | `differences.rs` | noise by third differences |
//! | `averaged.rs` | steering that a logging tool has smoothed |
//! | `copied.rs` | an angle that is the command, written a second time; an acceleration that was computed |
//! | `reversing.rs` | driving backwards with a speed without a sign |
//! | `spinning.rs` | sliding far sideways |
//! | `jumps.rs` | places where rows are missing, or another drive begins, without a word from the clock |
//! | `kinematics.rs` | velocity across and acceleration along the body, told by other columns |
//! | `late.rs` | columns that come later than others |
//! | `point.rs` | points of the car at which velocity and place are given |
//! | `rows.rs` | rows on their way to a clean log |
//! | `road.rs` | place of the log on a road, and the road's properties there |
//! | `join.rs` | several logs of one vehicle as one |
//! | `finding.rs` | findings in a log, in words |
//! | `steering.rs` | command and response for the identification of the steering actuator |
//! | `learn.rs` | training data of a residual, completed |

mod agreement;
mod answered;
mod averaged;
mod clean;
mod clean_log;
mod clock;
mod clock_steps;
mod coarse;
mod copied;
mod description;
mod differences;
mod dropouts;
mod error;
mod even;
mod finding;
mod frozen;
mod held;
mod join;
mod jumps;
mod kinematics;
mod late;
mod learn;
mod mixed;
mod only;
mod outliers;
mod partners;
mod point;
mod read;
mod resample;
mod reversing;
mod road;
mod rows;
mod saturated;
mod spinning;
mod steering;
mod turning;
mod units;

pub use clean_log::{CleanError, CleanLog, Coarseness, UnusableLog};
pub use error::LogError;
pub use finding::{Finding, FindingSeverity};
pub use join::JoinError;
pub use learn::{LearnError, drives_of};
pub use only::Only;
pub use read::DriveLog;
pub use road::NotOnRoad;
pub use steering::SteeringLog;
