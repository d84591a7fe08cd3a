//! FMI 2.0 co-simulation: any simulation tool loads our models.
//!
//! The layer knows a small trait, [`Model`], and no model. It owns the C ABI, the state machine of an instance,
//! the variables' values, FMU states, logging and the description (XML); a model says what its variables are and
//! what a step does. An FMU's library is then one line: [`export_fmi2!`](crate::export_fmi2).
//!
//! | file | idea |
//! |---|---|
//! | `variable.rs` | what a variable is: causality, variability, unit, range, start |
//! | `value.rs` | the values of one instance's variables |
//! | `model.rs` | the trait that a model fulfils |

mod model;
mod value;
mod variable;

pub use model::{Context, Declaration, DefaultExperiment, Log, LogCategory, Model, ModelError, Severity};
pub use value::{Value, Values};
pub use variable::{Causality, Initial, Kind, Variability, Variable, Vr};
