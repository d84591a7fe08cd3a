//! The controller: from a measurement to steering and acceleration commands.
//!
//! | file | problem |
//! |---|---|
//! | `parameters.rs` | every weight, bound and gain, declared once |
//! | `tracking_qp.rs` | the quadratic program of one step, and what a solver is |
//! | `condense.rs` | from an affine model over the horizon to that program |
//! | `history.rs` | the window of states and commands that a learned residual looks at |
//! | `observer.rs` | state and disturbance from noisy measurements: offset-free tracking |
//! | `clarabel_solver.rs` | its solution by an interior-point method, updated in place |
//! | `preview.rs` | the road over the horizon |
//! | `lateral.rs` | the MPC: road ahead, cost, bounds |
//! | `variant/` | what it predicts with: nominal, learned residual, known actuator, nonlinear |
//! | `speed.rs` | speed tracking |
//! | `controller.rs` | one step from measurement to commands; fallback |
//! | `sampler.rs` | when a step is due |
//! | `status.rs` | what a step did, in words |

mod clarabel_solver;
mod condense;
mod controller;
mod history;
mod lateral;
mod observer;
mod parameters;
mod preview;
mod sampler;
mod speed;
mod status;
mod tracking_qp;
mod variant;

pub use clarabel_solver::{BuildError, ClarabelSolver};
pub use condense::{Affine, Linear, Propagation, condense};
pub use controller::{Controller, ControllerError, ControllerState, Measurement, StepError, StepReport};
pub use history::History;
pub use lateral::{LateralError, LateralInput, LateralMpc};
pub use observer::{Observer, ObserverParameters};
pub use parameters::{ControllerParameters, MpcParameters, NominalVehicle, SHOWN_HORIZON, SpeedParameters};
pub use preview::SpeedAhead;
pub use sampler::Sampler;
pub use speed::{SpeedCommand, track_speed};
pub use status::ControlStatus;
pub use tracking_qp::{QpEnd, QpError, QpReport, QpShape, QpSolver, SoftBound, TrackingQp};
pub use variant::{
    BicycleModel, BicycleRollOut, Expected, PredictionModel, Residual, RollOut, StepSpeed, Timing,
};
