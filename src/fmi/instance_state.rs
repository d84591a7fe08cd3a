//! States of an instance, and the calls that a host may make in each. Each version of FMI has a table over them (`v2/table.rs`,
//! `v3/table.rs`).
//!
//! ```text
//! instantiated -> initialization mode -> step complete <-> step failed -> terminated
//!       ^------------------ reset -------------------------------------------+
//! ```
//!
//! The states "step in progress" and "step canceled" of FMI 2.0 never occur: steps are synchronous. FMI 3.0 calls "step
//! complete" step mode. There a discarded step changes nothing, so that another may follow: out of "step failed", too.

use super::version::Version;
use serde::{Deserialize, Serialize};
use std::fmt;

/// State of an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum InstanceState {
    /// After an instance is made or reset.
    Instantiated,
    /// Between the calls that enter and exit it.
    InitializationMode,
    /// At a communication point.
    StepComplete,
    /// A step was discarded.
    StepFailed,
    /// The simulation has ended.
    Terminated,
    /// The model failed. Only a reset or a stored FMU state leads out.
    Error,
}

impl InstanceState {
    /// All states.
    pub const ALL: [InstanceState; 6] = [
        InstanceState::Instantiated,
        InstanceState::InitializationMode,
        InstanceState::StepComplete,
        InstanceState::StepFailed,
        InstanceState::Terminated,
        InstanceState::Error,
    ];

    /// True if the model is initialised and well: then it has an internal state.
    #[must_use]
    pub fn has_working_model(self) -> bool {
        matches!(self, InstanceState::StepComplete | InstanceState::StepFailed | InstanceState::Terminated)
    }

    /// Calls that a host can make from here, for error messages.
    #[must_use]
    pub fn way_out(self, v: &Version) -> String {
        match self {
            InstanceState::Instantiated => {
                format!("Next: set parameters, {}, fmi{v}ExitInitializationMode.", v.begin)
            }
            InstanceState::InitializationMode => format!("Next: fmi{v}ExitInitializationMode."),
            InstanceState::StepComplete => {
                format!("Next: fmi{v}DoStep or fmi{v}Terminate; to start again, fmi{v}Reset.")
            }
            InstanceState::StepFailed => format!(
                "A step was discarded: restore an FMU state and step differently, or call fmi{v}Terminate or fmi{v}Reset."
            ),
            InstanceState::Terminated => {
                format!("The simulation has ended: call fmi{v}Reset to start again, or fmi{v}FreeInstance.")
            }
            InstanceState::Error => format!(
                "The model failed earlier (see the log): call fmi{v}Reset, restore an FMU state, or fmi{v}FreeInstance."
            ),
        }
    }
}

impl fmt::Display for InstanceState {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            InstanceState::Instantiated => "instantiated",
            InstanceState::InitializationMode => "initialization mode",
            InstanceState::StepComplete => "step complete",
            InstanceState::StepFailed => "step failed",
            InstanceState::Terminated => "terminated",
            InstanceState::Error => "error",
        })
    }
}

/// The functions of an instance in one version of the standard, and the states in which it allows them.
pub trait Function: Copy {
    /// The function's name in the standard.
    fn name(self) -> &'static str;

    /// True if the standard allows the call in a state.
    fn allowed_in(self, life: InstanceState) -> bool;
}

/// Declares a version's table: name here, name in the standard, states.
macro_rules! functions {
    ($($name:ident $fmi:literal in [$($life:ident)*];)*) => {
        /// The functions of an instance.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs)]
        pub enum Function { $($name,)* }

        impl $crate::fmi::instance_state::Function for Function {
            fn name(self) -> &'static str {
                match self { $(Function::$name => $fmi,)* }
            }

            fn allowed_in(self, life: $crate::fmi::instance_state::InstanceState) -> bool {
                match self { $(Function::$name => $crate::fmi::instance_state::functions!(@any life [$($life)*]),)* }
            }
        }
    };
    (@any $value:ident [Always]) => { { let _ = $value; true } };
    (@any $value:ident []) => { { let _ = $value; false } };
    (@any $value:ident [$($life:ident)+]) => { matches!($value, $($crate::fmi::instance_state::InstanceState::$life)|+) };
}
pub(crate) use functions;
