//! FMI co-simulation, 2.0 and 3.0: any simulation tool loads our models.
//!
//! The layer knows a small trait, [`Model`], and no model. It owns the C ABI, the state machine of an instance,
//! the variables' values, FMU states and logging; a model says what its variables are and what a step does. An instance
//! knows no version but a table of words; [`v2`] and [`v3`] are thin adapters over it. An FMU's library is then one line
//! for each: [`export_fmi2!`](crate::export_fmi2), [`export_fmi3!`](crate::export_fmi3).
//!
//! | file | idea |
//! |---|---|
//! | `variable.rs` | what a variable is: causality, variability, unit, range, start |
//! | `value.rs` | a value of any FMI type |
//! | `values.rs` | the values of one instance's variables |
//! | `model.rs` | the trait that a model fulfils |
//! | `instance_state.rs` | the states of an instance, and what a table of calls is |
//! | `instance.rs` | one instance, and what each call does to it |
//! | `call_error.rs` | why a call was refused |
//! | `snapshot.rs` | FMU states, and their form as bytes |
//! | `logger.rs` | messages to the host |
//! | `resource.rs` | the `resources/` folder from what hosts pass |
//! | `seconds.rs` | a time in a message |
//! | `start.rs` | start values that an FMU was packed with |
//! | `types.rs` | the C types that all versions share |
//! | `version.rs` | the words in which versions differ |
//! | `handle.rs` | what a host's pointer points to, and what guards it |
//! | `windows.rs` | what takes the place of a function that older systems lack |
//! | `v2/`, `v3/` | the C functions of a version, its table of calls, and the macro that exports them |

pub mod call_error;
mod handle;
pub mod instance;
pub mod instance_state;
pub mod logger;
mod model;
pub mod resource;
mod seconds;
mod snapshot;
mod start;
pub mod types;
pub mod v2;
pub mod v3;
mod value;
mod values;
mod variable;
mod version;
#[cfg(windows)]
mod windows;

pub use model::{
    Array, Context, Declaration, DefaultExperiment, Log, LogCategory, Model, ModelError, Severity,
    VersionedVariable,
};
pub use seconds::Seconds;
pub use start::{START_FILE, StartError, StartValues};
pub use types::Status;
pub use value::{BinaryValue, Value};
pub use values::Values;
pub use variable::{Causality, Initial, Variability, Variable, VariableKind, Vr};
pub use version::Version;
#[cfg(windows)]
pub use windows::no_random_seed;
