//! # RFL-MPC
//!
//! A learning path-tracking controller for cars and trucks that any simulation tool can load. And an instrument that
//! tells why a simulator and a vehicle disagree.
//!
//! ## The problem
//!
//! Model predictive control follows a path by minimising, at each sample `k`, over the steering `u`
//!
//! ```text
//!     min  sum_j  (y_j - y_ref)' Q (y_j - y_ref) + R (u_j - u_{j-1})^2
//!     s.t. x_{j+1} = A x_j + B u_j + D kappa_j v + r(z_j),    |u| <= u_max,  |u_j - u_{j-1}| <= Ts * rate_max
//! ```
//!
//! where `A, B, D` is a linear single-track model in path errors and `r` is what that model misses. A random
//! forest chooses a *linear* `r` in each regime, so the problem stays one quadratic program (Zhao et al., ITSC
//! 2024). Without a learned `r` it is the nominal controller.
//!
//! ## Map
//!
//! Data flows down this list, never up.
//!
//! | module | problem |
//! |---|---|
//! | [`signal`] | the vocabulary: names, units, meanings |
//! | [`parameter`] | numeric parameters: declared once, with unit and range |
//! | [`mod@enumeration`] | named values: declared once |
//! | [`input`] | files of others, read with bounds |
//! | [`output`] | files that are written whole or not at all |
//! | [`table`] | tables from text files in their many formats |
//! | [`path`] | reference paths: splines, projection, readers, speed plan, the Sudoku course |
//! | [`vehicle`] | the plants: parameters, tyres, steering chain, effects, the two-track car |
//! | [`nominal`] | prediction models: linear and nonlinear single track, discretisation |
//! | [`residual`] | learned errors of the nominal model: trees, linear leaves, model files |
//! | [`log`] | drive logs: reading, checking, mending, computing missing columns |
//! | [`control`] | condensing, the QP, the MPC, speed control, status and fallback |
//! | [`simulate`] | the closed loop in native code, and its metrics |
//! | [`diagnose`] | causes of a gap between a simulator and a vehicle |
//! | [`fmi`] | FMI 2.0 and 3.0: the C ABI, instances, descriptions; knows no model |
//! | [`fmu`] | our models as FMI units: their variables and steps |

/// Invariant of our own code: asserted in debug builds and in all tests (feature `strict`), and not in a vehicle.
macro_rules! invariant {
    ($($arguments:tt)*) => {
        if cfg!(any(debug_assertions, feature = "strict")) {
            assert!($($arguments)*);
        }
    };
}
pub(crate) use invariant;

#[cfg(feature = "cli")]
pub mod cli;
pub mod control;
pub mod diagnose;
mod encoding;
pub mod enumeration;
mod finite;
pub mod fmi;
pub mod fmu;
mod former;
pub mod input;
pub mod log;
pub mod nominal;
pub mod numerics;
pub mod output;
pub mod parameter;
pub mod path;
pub mod residual;
pub mod signal;
pub mod simulate;
pub mod table;
pub mod vehicle;
