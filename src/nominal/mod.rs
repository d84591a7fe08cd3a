//! Prediction models: what the controller believes the vehicle does.
//!
//! | file | problem |
//! |---|---|
//! | `single_track.rs` | the car's error dynamics `x' = A x + B u + D psi_des' + E psi_des''` (method 1) |
//! | `actuator.rs` | the same behind a steering actuator with dead time and lag |
//! | `bicycle.rs` | the nonlinear single track with saturating tyres, for nonlinear MPC |
//! | `discretise.rs` | exact zero-order hold by the matrix exponential |

mod actuator;
mod bicycle;
mod discretise;
mod single_track;

pub use actuator::{ActuatedModel, ActuatedState, Actuator};
pub use bicycle::{Bicycle, Lateral};
pub use discretise::zero_order_hold;
pub use single_track::{
    ContinuousErrorModel, DiscreteErrorModel, ErrorState, SingleTrackError, steady_yaw_error,
};
