//! The comparison of all variants: plants, rows, weights, noise, seeds.
//!
//! | file | problem |
//! |---|---|
//! | `plant.rs` | the cars that are really driven |
//! | `row.rs` | the ways to predict |
//! | `weights.rs` | what each row may tune, with one budget |
//! | `trial.rs` | one drive |
//! | `fit.rs` | errors of predictions, one step and a horizon ahead |
//! | `compare.rs` | all of it on one plant: collect, learn, tune, drive |

mod compare;
mod fit;
mod plant;
mod row;
mod trial;
mod weights;

pub use compare::{
    CALM, CompareError, Comparison, Condition, DITHER, Effort, Outcome, Roads, RowFit, RowResult,
};
pub use fit::{FitMetrics, steps_ahead};
pub use plant::Plant;
pub use row::{Row, WINDOW};
pub use trial::{Trial, TrialError};
pub use weights::{Found, Weights, search};
