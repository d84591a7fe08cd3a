//! When a host may call what: the states of an instance and the table of FMI 2.0, section 4.2.4.
//!
//! ```text
//! instantiated -> initialization mode -> step complete <-> step failed -> terminated
//!       ^------------------ fmi2Reset ---------------------------------------+
//! ```
//!
//! The standard's states "step in progress" and "step canceled" never occur: steps are synchronous.

use serde::{Deserialize, Serialize};
use std::fmt;

/// State of an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Life {
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated,
    /// Between `fmi2EnterInitializationMode` and `fmi2ExitInitializationMode`.
    InitializationMode,
    /// At a communication point.
    StepComplete,
    /// A step was discarded.
    StepFailed,
    /// After `fmi2Terminate`.
    Terminated,
    /// The model failed. Only a reset or a stored FMU state leads out.
    Error,
}

impl Life {
    /// All states.
    pub const ALL: [Life; 6] = [
        Life::Instantiated,
        Life::InitializationMode,
        Life::StepComplete,
        Life::StepFailed,
        Life::Terminated,
        Life::Error,
    ];

    /// Whether the model is initialised and well: then it has an internal state.
    #[must_use]
    pub fn has_working_model(self) -> bool {
        matches!(self, Life::StepComplete | Life::StepFailed | Life::Terminated)
    }

    /// What a host can do from here, for error messages.
    #[must_use]
    pub fn way_out(self) -> &'static str {
        match self {
            Life::Instantiated => {
                "Next: set parameters, fmi2SetupExperiment, fmi2EnterInitializationMode, fmi2ExitInitializationMode."
            }
            Life::InitializationMode => "Next: fmi2ExitInitializationMode.",
            Life::StepComplete => "Next: fmi2DoStep or fmi2Terminate; to start again, fmi2Reset.",
            Life::StepFailed => {
                "A step was discarded: restore an FMU state and step differently, or call fmi2Terminate or fmi2Reset."
            }
            Life::Terminated => {
                "The simulation has ended: call fmi2Reset to start again, or fmi2FreeInstance."
            }
            Life::Error => {
                "The model failed earlier (see the log): call fmi2Reset, restore an FMU state, or fmi2FreeInstance."
            }
        }
    }
}

impl fmt::Display for Life {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Life::Instantiated => "instantiated",
            Life::InitializationMode => "initialization mode",
            Life::StepComplete => "step complete",
            Life::StepFailed => "step failed",
            Life::Terminated => "terminated",
            Life::Error => "error",
        })
    }
}

macro_rules! functions {
    ($($name:ident $fmi:literal in [$($life:ident)*];)*) => {
        /// The functions of an instance.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs)]
        pub enum Function { $($name,)* }

        impl Function {
            /// All functions of an instance.
            pub const ALL: &'static [Function] = &[$(Function::$name,)*];

            /// The function's name in the standard.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Function::$name => $fmi,)* }
            }

            /// Whether the standard allows the call in a state.
            #[must_use]
            pub fn allowed_in(self, life: Life) -> bool {
                match self { $(Function::$name => functions!(@any life [$($life)*]),)* }
            }
        }
    };
    (@any $value:ident [Always]) => { true };
    (@any $value:ident []) => { { let _ = $value; false } };
    (@any $value:ident [$($life:ident)+]) => { matches!($value, $(Life::$life)|+) };
}

functions! {
    SetDebugLogging "fmi2SetDebugLogging" in [Always];
    SetupExperiment "fmi2SetupExperiment" in [Instantiated];
    EnterInitializationMode "fmi2EnterInitializationMode" in [Instantiated];
    ExitInitializationMode "fmi2ExitInitializationMode" in [InitializationMode];
    Terminate "fmi2Terminate" in [StepComplete StepFailed];
    Reset "fmi2Reset" in [Always];
    GetReal "fmi2GetReal" in [InitializationMode StepComplete StepFailed Terminated Error];
    GetInteger "fmi2GetInteger" in [InitializationMode StepComplete StepFailed Terminated Error];
    GetBoolean "fmi2GetBoolean" in [InitializationMode StepComplete StepFailed Terminated Error];
    GetString "fmi2GetString" in [InitializationMode StepComplete StepFailed Terminated Error];
    SetReal "fmi2SetReal" in [Instantiated InitializationMode StepComplete];
    SetInteger "fmi2SetInteger" in [Instantiated InitializationMode StepComplete];
    SetBoolean "fmi2SetBoolean" in [Instantiated InitializationMode StepComplete];
    SetString "fmi2SetString" in [Instantiated InitializationMode StepComplete];
    GetFmuState "fmi2GetFMUstate" in [Always];
    SetFmuState "fmi2SetFMUstate" in [Always];
    FreeFmuState "fmi2FreeFMUstate" in [Always];
    SerializedFmuStateSize "fmi2SerializedFMUstateSize" in [Always];
    SerializeFmuState "fmi2SerializeFMUstate" in [Always];
    DeSerializeFmuState "fmi2DeSerializeFMUstate" in [Always];
    DoStep "fmi2DoStep" in [StepComplete];
    CancelStep "fmi2CancelStep" in [];
    GetStatus "fmi2GetStatus" in [StepComplete StepFailed Terminated];
    GetRealStatus "fmi2GetRealStatus" in [StepComplete StepFailed Terminated];
    GetIntegerStatus "fmi2GetIntegerStatus" in [StepComplete StepFailed Terminated];
    GetBooleanStatus "fmi2GetBooleanStatus" in [StepComplete StepFailed Terminated];
    GetStringStatus "fmi2GetStringStatus" in [StepComplete StepFailed Terminated];
}
