//! The vehicle model replayed from a log's commands, and the signals that are compared.
//!
//! Speed is the log's; the response of steering, tyres and body to it is compared. The longitudinal motion, heading and
//! place would drift away. They are replayed with a leak towards the log, so that an error of the rate is seen for
//! [`LEAK`] seconds:
//!
//! ```text
//!     z' = rate(model) + (z_log - z) / T,      compared: z_log - z
//! ```
//!
//! The model is the reduced vehicle (`vehicle/reduced.rs`), corrected to the full plant by the difference of both. The
//! difference is taken once, with all effects neutral and the same force at the wheels:
//! `y = reduced(p) + plant(neutral) - reduced(neutral)`.
//!
//! | file | idea |
//! |---|---|
//! | `channel.rs` | compared signals |
//! | `drive.rs` | a log prepared for the replay: clock, starts, scored rows |
//! | `vehicle.rs` | vehicles that can be replayed: cars, trucks; their neutral replay by the full plant |
//! | `sensors.rs` | the log as the replayed vehicle meets it |
//! | `run.rs` | one replay |

mod channel;
mod drive;
mod neutral;
mod run;
mod sensors;
mod vehicle;

pub use channel::{CHANNELS, Channel};
pub use drive::LEAST_SPEED;
pub use drive::ReplayDrive;
pub use neutral::neutral;
pub use run::{Correction, LEAK, Trace, replay, replay_with};
pub use vehicle::ReplayVehicle;
pub(in crate::diagnose) use vehicle::prepared;
