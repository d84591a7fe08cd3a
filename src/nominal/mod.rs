//! Prediction models: what the controller believes the vehicle does.
//!
//! | file | problem |
//! |---|---|
//! | `error_model.rs` | error dynamics `x' = A x + B u + D psi_des' + E psi_des''` with any number of states |
//! | `single_track.rs` | those of the car (method 1) |
//! | `actuator.rs` | the same behind a steering actuator with dead time and lag |
//! | `bicycle.rs` | the nonlinear single track with saturating tyres, for nonlinear MPC |
//! | `path_bicycle.rs` | the same in errors to a path |
//! | `discretise.rs` | exact zero-order hold by the matrix exponential |

mod actuator;
mod bicycle;
mod discretise;
mod error_model;
mod path_bicycle;
mod single_track;

pub use actuator::{ActuatedModel, ActuatedState, Actuator};
pub use bicycle::{Bicycle, Lateral};
pub use discretise::{Chain, zero_order_hold};
pub use error_model::{
    ContinuousErrorModel, DiscreteErrorModel, ERRORS, ErrorState, LateralVehicle, SingleTrackError,
};
pub use path_bicycle::{
    BicycleErrors, BicycleState, BicycleStep, Curvature, HeldSpeed, body_change, errors_of,
};
pub use single_track::steady_yaw_error;
