//! A Gaussian process on the errors of a nonlinear model: the learned model of GP-NMPC.
//!
//! Over one control step of a car, with the process's inputs `z = [vx, vy, r, steer_cmd, accel]`,
//!
//! ```text
//! [vy, r]_{k+1} = bicycle([vy, r]_k, vx_k, steer_k, Ts) + d(z_k),    d_o ~ GP(0, k_o)
//! k_o(a, b)     = sf^2 exp(-1/2 sum_d ((a_d - b_d) / l_d)^2),         labels with noise sn^2
//! ```
//!
//! and of a truck, with the articulation `phi` between tractor and semi-trailer, `z = [vx, vy, r, phi, phi', steer_cmd, accel]`,
//!
//! ```text
//! [vy, r, phi']_{k+1} = articulated([vy, r, phi, phi']_k, vx_k, steer_k, Ts) + d(z_k)
//! ```
//!
//! One process serves each output, with length scales, signal and noise of its own. The sources also learn the residual
//! of vx. It is not needed here: the speed is planned and held by the speed controller, and the MPC takes it as given.
//!
//! (Kabzan, Hewing, Liniger, Zeilinger, Learning-Based Model Predictive Control for Autonomous Racing, RA-L 2019, sec. IV.)
//!
//! ```text
//! drives -> DataSet -> Samples -> fit (hyperparameters) -> choose (dictionary) -> Sparse (weights from all samples)
//!                                                                                   |
//!                                        controller <- residual(): mean, gradient - GpModel <-> file
//! ```
//!
//! | file | idea |
//! |---|---|
//! | `kernel.rs`, `exp.rs` | the covariance |
//! | `exact.rs` | the process without approximation, its likelihood and the gradient of that |
//! | `fit.rs` | hyperparameters by maximum likelihood (program only: it links an optimiser) |
//! | `dictionary.rs` | choice of the points to keep |
//! | `sparse.rs` | the process through a dictionary, from all samples |
//! | `dot.rs` | mean and gradient, fast |
//! | `vehicle.rs` | the vehicles, and the learned states of each |
//! | `samples.rs` | inputs and labels from drives |
//! | `smoothing.rs` | smoothing of recorded states (program only) |
//! | `train.rs` | from drives to a model and a report of its fit (program only) |
//! | `model.rs`, `file.rs` | the model that the controller calls, and its file |

mod dictionary;
mod dot;
mod exact;
mod exp;
mod file;
#[cfg(feature = "cli")]
mod fit;
mod kernel;
mod model;
mod samples;
#[cfg(feature = "cli")]
mod smoothing;
mod sparse;
#[cfg(feature = "cli")]
mod train;
mod vehicle;

/// Inputs of a car's process: vx, vy, yaw rate, steering command, longitudinal acceleration.
pub const INPUTS: usize = 5;
/// Its outputs: the bicycle's errors of vy and of the yaw rate over one control step.
pub const GP_OUTPUTS: usize = 2;
/// Inputs of a truck's: those of a car, with the articulation and its rate behind the yaw rate.
pub const TRUCK_INPUTS: usize = 7;
/// Its outputs: those of a car, and the rate of the articulation.
pub const TRUCK_GP_OUTPUTS: usize = 3;

pub use dictionary::choose;
pub use exact::{Exact, LikelihoodGradient};
#[cfg(feature = "cli")]
pub use fit::{FitConfig, Fitted, fit};
pub use kernel::Kernel;
pub use model::{GpModel, GpModelFor, GpOutput, GpResidual, GpSchema, GpTraining, TruckGpModel};
pub use samples::Samples;
#[cfg(feature = "cli")]
pub use smoothing::{STEPS, StateSmoothing};
pub use sparse::{MAX_POINTS, Sparse};
#[cfg(feature = "cli")]
pub use train::{GpConfig, GpFit, GpReport, GpTrainError, GpTrained, train};
pub use vehicle::GpVehicle;
