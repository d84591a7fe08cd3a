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
//! (Gauss-Newton; `U` linearised anew at the best). The costs of all candidates, and what speaks for a cause that the library
//! does not have, make one posterior; the verdict reads it, and nothing else, but that a name must predict what its fit has
//! not seen.
//!
//! | file | problem |
//! |---|---|
//! | `report.rs` | the answer: what `report.json` holds |
//! | `replay/` | the vehicle replayed from a log's commands |
//! | `conventions.rs` | how the log's columns are meant |
//! | `knob.rs` | what a simulator can be wrong in, and its tolerances |
//! | `filter.rs` | low pass and clock |
//! | `problem.rs` | the gap as a function of all knobs |
//! | `fit.rs` | fits with the tolerances marginalised |
//! | `form.rs` | what another formulation does otherwise |
//! | `noise.rs` | what a gap is measured against |
//! | `profile.rs` | the road that nobody told of |
//! | `rank.rs` | candidates and their evidence |
//! | `beliefs.rs` | what is believed before a log is seen |
//! | `calibration.rs` | numbers of the statistical model, from `calibration.toml` |
//! | `constancy.rs` | whether an effect acts with one value throughout |
//! | `resonance.rs` | whether the steering swings |
//! | `posterior.rs` | how probable each hypothesis is |
//! | `decision.rs` | from the posterior to what is the matter |
//! | `dominance.rs` | the size of an effect beside the background |
//! | `estimate.rs` | the value of an effect, and how sure it is |
//! | `information.rs` | what one log says of all parameters at once |
//! | `naming.rs` | the decision in the user's terms |
//! | `engine.rs` | from a log and a vehicle to the answer |
//! | `observability.rs` | what a log can show and what it cannot |
//! | `localise.rs` | where the gap lies |
//! | `shrink.rs` | how far it shrinks on held-out parts |
//! | `manoeuvre.rs` | what to drive next |
//! | `select.rs` | the stretches of long logs that tell most |
//! | `words.rs` | the answer in words |
//! | `simulated.rs` | logs of our own plants with an effect put in |
//! | `headline.rs` | the verdict in one line |
//! | `page/` | the answer as one HTML page |
//! | `closed_loop.rs` | what the gap does to tracking |
//! | `simulator.rs` | the calibrated simulator, as files |
//!
//! Source: the recipe is that of the specification; marginalising over a linear Gaussian background as in Rasmussen and
//! Williams, Gaussian Processes for Machine Learning, 2006, sec. 2.7.

pub mod beliefs;
pub mod calibration;
#[cfg(feature = "cli")]
pub mod closed_loop;
mod constancy;
mod conventions;
mod decision;
mod dominance;
mod engine;
mod estimate;
pub mod filter;
pub mod fit;
pub mod form;
mod headline;
mod information;
pub mod knob;
mod localise;
mod manoeuvre;
mod naming;
pub mod noise;
mod observability;
#[cfg(feature = "cli")]
pub mod page;
mod posterior;
pub mod problem;
pub mod profile;
pub mod rank;
pub mod replay;
mod report;
mod resonance;
mod select;
mod shrink;
pub mod simulated;
#[cfg(feature = "cli")]
pub mod simulator;
mod words;

pub use engine::{DiagnoseError, Options, diagnose};
pub use report::*;
