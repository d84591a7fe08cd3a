//! The comparison of all variants: plants, rows, weights, noise, seeds.
//!
//! | file | problem |
//! |---|---|
//! | `plant.rs` | the cars that are really driven |
//! | `row.rs` | the ways to predict |
//! | `weights.rs` | what each row may tune, with one budget |
//! | `trial.rs` | one drive |

mod plant;
mod row;
mod trial;
mod weights;

pub use plant::Plant;
pub use row::{Row, WINDOW};
pub use trial::{Trial, TrialError};
pub use weights::{Found, Weights, search};
