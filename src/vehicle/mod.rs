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
//! | `parameters.rs`, `truck_parameters.rs` | parameters of a car, of a truck |
//! | `file.rs` | their files |
//! | `articulated.rs` | the linear model of a tractor with a semi-trailer |
//! | `plausible.rs` | numbers of a file that contradict each other |
//! | `builtin.rs` | vehicles and tyres that need no file |
//! | `effects.rs` | differences of a real vehicle from its model, each a switch |
//! | `explain.rs`, `effects.toml` | each effect in words |
//! | `steering.rs` | from the command to the road wheels, exact in time |
//! | `drive.rs` | from the command to the force of drive and brakes |
//! | `air.rs` | air and a dragging brake |
//! | `sensors.rs`, `status.rs` | measured signals, and status from the wheels |
//! | `stepper.rs` | steps of a vehicle: integration, errors, saved states |
//! | `reduced.rs` | the same vehicles without their fast motions: ten thousand times real time |
//! | `array.rs` | arrays of any length in saved states |
//! | `trigonometry.rs` | arc tangent, sine and cosine of several numbers at once |
//! | `tyre/` | Magic Formula 5.2, `.tir` files |
//! | `unit/` | a body on axles with wheels: the part of all vehicles |
//! | `car/` | the two-track car |
//! | `truck/` | the tractor with its semi-trailer |

mod air;
mod array;
mod articulated;
mod builtin;
pub mod car;
mod drive;
mod effects;
mod explain;
mod file;
mod parameters;
mod plausible;
mod reduced;
mod sensors;
mod status;
mod steering;
mod stepper;
mod substep;
mod surface;
mod tolerance;
pub mod trigonometry;
pub mod truck;
mod truck_parameters;
pub mod tyre;
mod unit;

pub use articulated::Articulated;
pub use builtin::{BUILTIN, BUILTIN_TRUCKS, builtin_text};
pub use car::{Car, CarError, CarInput, CarOutput, CarStatus};
pub use effects::{
    Effect, EffectOutOfRange, Effects, NO_RATE_LIMIT, Stage, TrailerEffects, TruckEffects, UnknownEffect,
};
pub use explain::{Explanation, effect_like};
pub(crate) use file::range_of;
pub use file::{Doubt, ParameterDeclaration, VehicleError, VehicleKind, VehicleParameters, VehiclePlace};
pub use parameters::{
    Air, Axle, Body, Brake, CarParameters, GRAVITY, Pair, Powertrain, SingleTrack, Steering, builtin,
};
pub use reduced::{ReducedInput, ReducedOutput, ReducedStart, ReducedSteer, ReducedVehicle};
pub use steering::{SteeringChain, SteeringState};
pub use stepper::{LONGEST_STEP, PlantStepError, ROLLED_OVER, RestoreError, VehicleInput};
pub use substep::LONGEST_SUBSTEP;
pub use surface::Surface;
pub use tolerance::Tolerances;
pub use truck::{TrailerOutput, Truck, TruckError, TruckInput, TruckOutput, TruckStatus};
pub use truck_parameters::{
    Hitch, Trailer, Triple, TruckAir, TruckBrake, TruckParameters, TruckPowertrain, builtin_truck,
};
pub use tyre::Tyre;
pub use unit::WheelOutput;
