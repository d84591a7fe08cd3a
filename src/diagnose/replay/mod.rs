//! The vehicle model replayed from a log's commands, and what of it is compared.
//!
//! Speed is the log's: what steering, tyres and body make of it is compared. The longitudinal motion, heading and place,
//! which would drift away, are replayed with a leak towards the log, so that an error of the rate is seen for
//! [`LEAK`] seconds:
//!
//! ```text
//!     z' = rate(model) + (z_log - z) / T,      compared: z_log - z
//! ```
//!
//! The model is the reduced vehicle (`vehicle/reduced.rs`), brought to the full plant by what both differ in once, with
//! all effects neutral and the same force at its wheels: `y = reduced(p) + plant(neutral) - reduced(neutral)`.
//!
//! | file | idea |
//! |---|---|
//! | `channel.rs` | what is compared |
//! | `drive.rs` | a log made ready to be replayed: clock, starts, what counts |
//! | `vehicle.rs` | vehicles that can be replayed: cars, trucks; their neutral replay by the full plant |
//! | `run.rs` | one replay |

mod channel;
mod drive;
mod run;
mod vehicle;

pub use channel::{CHANNELS, Channel};
pub use drive::Drive;
pub use drive::LEAST_SPEED;
pub use run::{Correction, LEAK, Trace, replay};
pub use vehicle::ReplayVehicle;
pub use vehicle::neutral;
pub(in crate::diagnose) use vehicle::prepared;
