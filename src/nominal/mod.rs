//! Prediction models: the controller's models of the vehicle.
//!
//! | file | problem |
//! |---|---|
//! | `error_model.rs` | error dynamics `x' = A x + B u + D psi_des' + E psi_des''` with any number of states |
//! | `single_track.rs` | those of the car (method 1) |
//! | `articulated.rs` | those of a tractor with a semi-trailer (method 3) |
//! | `actuator.rs` | any of these behind a steering actuator: lag, dead time, Pade approximants |
//! | `identify/` | the actuator's constants from a recorded step, or from any drive |
//! | `bicycle.rs` | the nonlinear single track with saturating tyres, for nonlinear MPC |
//! | `articulated_single_track.rs` | that of a tractor with a semi-trailer |
//! | `path_model.rs` | a nonlinear model in errors to a path, whatever the vehicle |
//! | `path_bicycle.rs`, `path_articulated.rs` | the two nonlinear models in that form |
//! | `discretise.rs` | exact zero-order hold by the matrix exponential |

mod actuator;
mod articulated;
mod articulated_single_track;
mod bicycle;
mod discretise;
mod error_model;
mod identify;
mod path_articulated;
mod path_bicycle;
mod path_model;
mod single_track;

pub use actuator::{
    ACTUATOR_STATES, ActuatedModel, ActuatedState, ActuatedTransition, Actuator, DeadTimeModel,
    SampledActuator,
};
pub use articulated::{ArticulatedState, SteadyCornering, steady_cornering};
pub use articulated_single_track::{ArticulatedRates, ArticulatedSingleTrack, SteadyTurn};
pub use bicycle::{Bicycle, LateralMotion};
pub use discretise::{Chain, zero_order_hold};
pub use error_model::{
    ContinuousErrorModel, DiscreteErrorModel, ERRORS, ErrorState, LateralVehicle, SingleTrackError,
};
pub use identify::{
    Between, DelayModel, DrivesError, Estimate, IdentifiedActuator, IdentifiedSteering, IdentifyError,
    LeftOut, SteeringDrive, SteeringRecord, identify_by_yaw_rate_from_drives, identify_from_drives,
    identify_with_limit_from_drives,
};
pub use path_articulated::{ARTICULATED_PATH_STATES, ArticulatedPathState};
pub use path_bicycle::{BICYCLE_STATES, BicycleState, body_change, errors_of};
pub use path_model::{Curvature, HeldSpeed, PathErrors, PathModel, PathStep};
pub use single_track::steady_yaw_error;
