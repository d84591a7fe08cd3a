//! Prediction models: what the controller believes the vehicle does.
//!
//! | file | problem |
//! |---|---|
//! | `single_track.rs` | the car's error dynamics `x' = A x + B u + D psi_des' + E psi_des''` (method 1) |
//! | `bicycle.rs` | the nonlinear single track with saturating tyres, for nonlinear MPC |
//! | `discretise.rs` | exact zero-order hold by the matrix exponential |

mod bicycle;
mod discretise;
mod single_track;

pub use bicycle::{Bicycle, Lateral};
pub use discretise::zero_order_hold;
pub use single_track::{
    ContinuousErrorModel, DiscreteErrorModel, ErrorState, SingleTrackError, steady_yaw_error,
};
