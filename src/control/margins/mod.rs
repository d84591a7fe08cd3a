//! Stability margins of the steering loop, from the linear loop: tolerable additional gain, phase lag and dead time.
//!
//! On a straight road, with no bound active, the MPC is a linear feedback with a memory of its own commands,
//!
//! ```text
//! u_k = sum_i K_i x_{k-i} + sum_{i>=1} h_i u_{k-i}
//! ```
//!
//! because the rate of the command has a cost, and because a known actuator is run over the issued commands. `K` and
//! `h` are identified from the MPC itself, by unit states and unit commands. Behind it the vehicle and its actuator are
//! sampled exactly, `X_{k+1} = A X_k + G_1 u_{k-m} + G_2 u_{k-m-1}`. Broken at the command, the loop is
//!
//! ```text
//! L(z) = - K(z) P(z) / (1 - h(z)),      1 + L = 0 where a pole is,      z = e^{j w Ts},  w up to Nyquist's
//! ```
//!
//! and the margins of a stable loop lie where `L` passes -1. The gain margin is the factor `1/|L|` at a real, negative
//! `L`. The phase margin is the angle `arg L + pi` at `|L| = 1`, and the delay margin is that angle over `w`. The poles
//! decide on stability: the spectral radius of the closed loop, by Gelfand's formula `|A^n|^(1/n)`.
//!
//! An observer stands before the gains, with the steady gains `M` of its filter. It predicts with the MPC's own model and takes
//! part in the memory, `p` being the predicted state and `d` the disturbance:
//!
//! ```text
//! xhat_k = p_k + M_x (x_k - p_k),    d_k = d_{k-1} + M_d (x_k - p_k),    p_{k+1} = N xhat_k + G d_k + sum_{i>=0} n_i u_{k-i}
//! u_k = K_0 xhat_k + K_d d_k + ..
//! ```
//!
//! A learned forest is taken as its leaves at straight driving.
//!
//! | file | idea |
//! |---|---|
//! | `linear_controller.rs` | the MPC at one speed as a linear feedback |
//! | `linear_observer.rs` | the observer before it, once it is steady |
//! | `steering_loop.rs` | the loop with a vehicle: its response, its poles, its margins |
//! | `complex.rs` | linear equations and the spectral radius |
//!
//! Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, ch. 7 (sampled loops); Skogestad and
//! Postlethwaite, Multivariable Feedback Control, ch. 2.4 (margins).

mod complex;
mod linear_controller;
mod linear_observer;
mod steering_loop;

pub use linear_controller::{LinearController, Tail};
pub use linear_observer::LinearObserver;
pub use steering_loop::{Margins, SteeringLoop};

use super::lateral::LateralError;
use super::tracking_qp::QpError;
use crate::nominal::SingleTrackError;
use crate::path::PathError;

/// Size of the states and commands that identify the MPC; it is linear, so the size does not matter.
const UNIT: f64 = 1e-2;

/// Reasons for which there are no margins.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum MarginError {
    #[error(transparent)]
    Lateral(#[from] LateralError),
    #[error(transparent)]
    Vehicle(#[from] SingleTrackError),
    #[error("the MPC at {speed} m/s on a straight road: {error}")]
    NoPlan { speed: f64, error: QpError },
    #[error("a straight road: {0}")]
    Road(#[from] PathError),
}
