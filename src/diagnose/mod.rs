//! Diagnosis of a gap between simulator and vehicle: its location, the unmodelled effect that causes it, its reduction.
//!
//! The simulator is replayed from a log's commands. Its gap to the log is `e`, in units of noise, filtered and
//! decimated. Every effect is a number `p` with a neutral value and a tolerance. The background of every simulator is
//! `S`, the change of `e` with each in units of its tolerance. A candidate is one effect (or two) that is free from
//! its tolerance. The best candidate explains the log while all others stay likely; it has the least
//!
//! ```text
//!     J_c = min over p_c of  e(p_c)' (I + U U')^-1 e(p_c),      U = S without the columns of c
//! ```
//!
//! (Gauss-Newton; `U` linearised anew at the best). The costs of all candidates, and the evidence for a cause outside
//! the library, make one posterior. The verdict reads only the posterior, with one exception: a name must predict data
//! unseen by its fit.
//!
//! | file | problem |
//! |---|---|
//! | `report.rs` | the answer: contents of `report.json` |
//! | `replay/` | the vehicle replayed from a log's commands |
//! | `conventions.rs` | conventions of the log's columns |
//! | `library.rs` | the effects that may be named, and those of one's own |
//! | `uncertain.rs` | uncertain parameters of a simulator, and their tolerances |
//! | `filter.rs` | low pass and clock |
//! | `problem.rs` | the gap as a function of all uncertain parameters |
//! | `memo.rs` | gaps that are known already |
//! | `fit/` | fits with the tolerances marginalised |
//! | `form.rs` | errors of the model's form |
//! | `noise.rs` | noise and remainders that a gap is measured against |
//! | `profile.rs` | unknown bank and grade of the road |
//! | `rank/` | candidates and their evidence |
//! | `beliefs.rs` | prior beliefs before a log is seen |
//! | `calibration.rs` | numbers of the statistical model, from `calibration.toml` |
//! | `constancy.rs` | constancy of an effect's value |
//! | `resonance.rs` | resonance of the steering |
//! | `posterior.rs` | probability of each hypothesis |
//! | `decision.rs` | from the posterior to the cause |
//! | `dominance.rs` | the size of an effect beside the background |
//! | `estimate.rs` | value of an effect, and its uncertainty |
//! | `information.rs` | likelihood of all parameters at once, for several drives |
//! | `naming.rs` | the decision in the user's terms |
//! | `engine.rs` | from a log and a vehicle to the answer |
//! | `judged.rs` | the decision, tested on unseen parts, in numbers and words |
//! | `observability.rs` | effects that a log can and cannot show |
//! | `localise.rs` | location of the gap |
//! | `gap_reduction.rs` | reduction of the gap on held-out parts |
//! | `manoeuvre.rs` | the next manoeuvre to drive |
//! | `select.rs` | the most informative stretches of long logs |
//! | `words.rs` | the answer in words |
//! | `simulated.rs` | logs of our own plants with an effect put in |
//! | `headline.rs` | the verdict in one line |
//! | `page/` | the answer as one HTML page |
//! | `closed_loop.rs` | effect of the gap on tracking |
//! | `simulator.rs` | the calibrated simulator, as files |
//!
//! Sources: the recipe is that of the specification. Marginalising over a linear Gaussian background: Rasmussen and
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
mod gap_reduction;
mod headline;
mod information;
mod judged;
mod library;
mod localise;
mod manoeuvre;
mod memo;
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
pub mod simulated;
#[cfg(feature = "cli")]
pub mod simulator;
pub mod uncertain;
mod words;

pub use engine::{DiagnoseError, Options, diagnose};
pub use library::{Library, OwnEffect};
pub use report::*;
