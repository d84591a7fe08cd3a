//! Why a simulator and a vehicle disagree: where the gap lies, which unmodelled effect causes it, how far it shrinks.
//!
//! The simulator is replayed from a log's commands. What it misses is `e`, in units of noise, filtered and decimated.
//! Every effect is a number `p` with a neutral value and a tolerance; `S` holds how `e` changes with each, in
//! units of its tolerance: the background that every simulator has. A candidate is one effect (or two) that is freed
//! from its tolerance; what explains the log best while all others stay likely has the least
//!
//! ```text
//!     J_c = min over p_c of  e(p_c)' (I + U U')^-1 e(p_c),      U = S without the columns of c
//! ```
//!
//! (Gauss-Newton; `U` linearised anew at the best). Nothing is named where `J_none - J_best` is no more than sound logs
//! give, and `not in library` where the best pair leaves more than they leave.
//!
//! | file | problem |
//! |---|---|
//! | `report.rs` | the answer: what `report.json` holds |
//! | `headline.rs` | the verdict in one line |
//! | `page/` | the answer as one HTML page |
//! | `closed_loop.rs` | what the gap does to tracking |
//! | `simulator.rs` | the calibrated simulator, as files |
//!
//! Source: the recipe is that of the specification; marginalising over a linear Gaussian background as in Rasmussen and
//! Williams, Gaussian Processes for Machine Learning, 2006, sec. 2.7.

#[cfg(feature = "cli")]
pub mod closed_loop;
mod headline;
#[cfg(feature = "cli")]
pub mod page;
mod report;
#[cfg(feature = "cli")]
pub mod simulator;

pub use report::*;
