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
//! | `life.rs` | when a host may call what |
//! | `instance.rs` | one instance, and what each call does to it |
//! | `refusal.rs` | why a call was refused |
//! | `snapshot.rs` | FMU states, and their form as bytes |
//! | `logger.rs` | messages to the host |
//! | `resource.rs` | the `resources/` folder from what hosts pass |
//! | `start.rs` | start values that an FMU was packed with |
//! | `abi.rs` | the C functions, and the macro that exports them |

pub mod abi;
pub mod instance;
pub mod life;
pub mod logger;
mod model;
pub mod refusal;
pub mod resource;
mod snapshot;
mod start;
mod value;
mod variable;

pub use model::{Context, Declaration, DefaultExperiment, Log, LogCategory, Model, ModelError, Severity};
pub use start::{START_FILE, StartError, read_start_file, start_file};
pub use value::{Value, Values};
pub use variable::{Causality, Initial, Kind, Variability, Variable, Vr};
