//! Linear prediction models: what the controller believes the vehicle does.
//!
//! | file | problem |
//! |---|---|
//! | `single_track.rs` | the car's error dynamics `x' = A x + B u + D psi_des' + E psi_des''` (method 1) |
//! | `discretise.rs` | exact zero-order hold by the matrix exponential |

mod discretise;
mod single_track;

pub use discretise::zero_order_hold;
pub use single_track::{
    ContinuousErrorModel, DiscreteErrorModel, ErrorState, SingleTrackError, steady_yaw_error,
};
