//! The plants: nonlinear vehicles, from a steering and an acceleration command to motion.
//!
//! ```text
//!  steer_cmd -> steering chain -> road wheels -+
//!                                              +-> tyres (slip, load, camber) -> body (two tracks, roll, pitch) -> sensors
//!  accel_cmd -> drive and brakes -> wheels ----+                 road: bank, grade, friction; air
//! ```
//!
//! | file | idea |
//! |---|---|
//! | `parameters.rs` | a car's parameters and their file |
//! | `articulated.rs` | the linear model of a tractor with a semi-trailer |
//! | `builtin.rs` | cars and tyres that need no file |
//! | `effects.rs` | what separates a real vehicle from its model, each a switch |
//! | `steering.rs` | from the command to the road wheels, exact in time |
//! | `trigonometry.rs` | arc tangent, sine and cosine of several numbers at once |
//! | `tyre/` | Magic Formula 5.2, `.tir` files |
//! | `car/` | the two-track car |

mod articulated;
mod builtin;
pub mod car;
mod effects;
mod parameters;
mod steering;
pub mod trigonometry;
pub mod tyre;

pub use articulated::Articulated;
pub use builtin::{BUILTIN, builtin};
pub use car::{Car, CarInput, CarOutput, CarStatus, StepError, WheelOutput};
pub use effects::{Effect, EffectOutOfRange, Effects, NO_RATE_LIMIT, Stage};
pub use parameters::{
    Air, Axle, Body, Brake, CarParameters, Drive, GRAVITY, Pair, Parameter, SingleTrack, Steering, Tyre,
    VehicleError,
};
pub use steering::{SteeringChain, SteeringState};
