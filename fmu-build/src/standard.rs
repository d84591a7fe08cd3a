//! The versions of FMI that FMUs are made for, and what differs between them outside of descriptions: folders, names of
//! platforms, functions.

use rfl_mpc::fmi::v2::guid_of;
use rfl_mpc::fmi::v3::token_of;
use rfl_mpc::fmi::{Version, v2, v3};

/// A version of FMI.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Standard {
    /// FMI 2.0.
    #[default]
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

impl Standard {
    /// All versions.
    pub const ALL: [Standard; 2] = [Standard::Fmi2, Standard::Fmi3];

    /// Its words.
    #[must_use]
    pub fn version(self) -> &'static Version {
        match self {
            Standard::Fmi2 => &v2::VERSION,
            Standard::Fmi3 => &v3::VERSION,
        }
    }

    /// The attribute `fmiVersion`.
    #[must_use]
    pub fn number(self) -> &'static str {
        match self {
            Standard::Fmi2 => "2.0",
            Standard::Fmi3 => "3.0",
        }
    }

    /// The version of SSP that its systems are of.
    #[must_use]
    pub fn of_systems(self) -> &'static str {
        match self {
            Standard::Fmi2 => "1.0",
            Standard::Fmi3 => "2.0",
        }
    }

    /// What FMUs and descriptions of 3.0 lie in, beside those of 2.0, whose place was first.
    #[must_use]
    pub fn folder(self) -> &'static str {
        match self {
            Standard::Fmi2 => "",
            Standard::Fmi3 => "fmi3",
        }
    }

    /// The version that a description is of.
    #[must_use]
    pub fn of(xml: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|standard| xml.contains(&format!(" fmiVersion=\"{}\"", standard.number())))
    }

    /// What a description and its library have in common: GUID or instantiation token.
    #[must_use]
    pub fn mark_of(self, xml: &str) -> &str {
        match self {
            Standard::Fmi2 => guid_of(xml),
            Standard::Fmi3 => token_of(xml),
        }
        .unwrap_or_default()
    }

    /// The functions of a library, sorted.
    #[must_use]
    pub fn functions(self) -> &'static [&'static str] {
        match self {
            Standard::Fmi2 => &FMI2_FUNCTIONS,
            Standard::Fmi3 => &FMI3_FUNCTIONS,
        }
    }

    /// Its names of the platforms that libraries are known for.
    #[must_use]
    pub fn platforms(self) -> &'static [&'static str] {
        match self {
            Standard::Fmi2 => &["darwin64", "linux32", "linux64", "win32", "win64"],
            Standard::Fmi3 => {
                &["aarch64-darwin", "aarch64-linux", "x86_64-darwin", "x86_64-linux", "x86_64-windows"]
            }
        }
    }
}

/// The functions of `fmi2Functions.h`.
pub const FMI2_FUNCTIONS: [&str; 44] = [
    "fmi2CancelStep",
    "fmi2CompletedIntegratorStep",
    "fmi2DeSerializeFMUstate",
    "fmi2DoStep",
    "fmi2EnterContinuousTimeMode",
    "fmi2EnterEventMode",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2FreeFMUstate",
    "fmi2FreeInstance",
    "fmi2GetBoolean",
    "fmi2GetBooleanStatus",
    "fmi2GetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetDirectionalDerivative",
    "fmi2GetEventIndicators",
    "fmi2GetFMUstate",
    "fmi2GetInteger",
    "fmi2GetIntegerStatus",
    "fmi2GetNominalsOfContinuousStates",
    "fmi2GetReal",
    "fmi2GetRealOutputDerivatives",
    "fmi2GetRealStatus",
    "fmi2GetStatus",
    "fmi2GetString",
    "fmi2GetStringStatus",
    "fmi2GetTypesPlatform",
    "fmi2GetVersion",
    "fmi2Instantiate",
    "fmi2NewDiscreteStates",
    "fmi2Reset",
    "fmi2SerializeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SetBoolean",
    "fmi2SetContinuousStates",
    "fmi2SetDebugLogging",
    "fmi2SetFMUstate",
    "fmi2SetInteger",
    "fmi2SetReal",
    "fmi2SetRealInputDerivatives",
    "fmi2SetString",
    "fmi2SetTime",
    "fmi2SetupExperiment",
    "fmi2Terminate",
];

/// The functions of `fmi3Functions.h`.
pub const FMI3_FUNCTIONS: [&str; 75] = [
    "fmi3ActivateModelPartition",
    "fmi3CompletedIntegratorStep",
    "fmi3DeserializeFMUState",
    "fmi3DoStep",
    "fmi3EnterConfigurationMode",
    "fmi3EnterContinuousTimeMode",
    "fmi3EnterEventMode",
    "fmi3EnterInitializationMode",
    "fmi3EnterStepMode",
    "fmi3EvaluateDiscreteStates",
    "fmi3ExitConfigurationMode",
    "fmi3ExitInitializationMode",
    "fmi3FreeFMUState",
    "fmi3FreeInstance",
    "fmi3GetAdjointDerivative",
    "fmi3GetBinary",
    "fmi3GetBoolean",
    "fmi3GetClock",
    "fmi3GetContinuousStateDerivatives",
    "fmi3GetContinuousStates",
    "fmi3GetDirectionalDerivative",
    "fmi3GetEventIndicators",
    "fmi3GetFMUState",
    "fmi3GetFloat32",
    "fmi3GetFloat64",
    "fmi3GetInt16",
    "fmi3GetInt32",
    "fmi3GetInt64",
    "fmi3GetInt8",
    "fmi3GetIntervalDecimal",
    "fmi3GetIntervalFraction",
    "fmi3GetNominalsOfContinuousStates",
    "fmi3GetNumberOfContinuousStates",
    "fmi3GetNumberOfEventIndicators",
    "fmi3GetNumberOfVariableDependencies",
    "fmi3GetOutputDerivatives",
    "fmi3GetShiftDecimal",
    "fmi3GetShiftFraction",
    "fmi3GetString",
    "fmi3GetUInt16",
    "fmi3GetUInt32",
    "fmi3GetUInt64",
    "fmi3GetUInt8",
    "fmi3GetVariableDependencies",
    "fmi3GetVersion",
    "fmi3InstantiateCoSimulation",
    "fmi3InstantiateModelExchange",
    "fmi3InstantiateScheduledExecution",
    "fmi3Reset",
    "fmi3SerializeFMUState",
    "fmi3SerializedFMUStateSize",
    "fmi3SetBinary",
    "fmi3SetBoolean",
    "fmi3SetClock",
    "fmi3SetContinuousStates",
    "fmi3SetDebugLogging",
    "fmi3SetFMUState",
    "fmi3SetFloat32",
    "fmi3SetFloat64",
    "fmi3SetInt16",
    "fmi3SetInt32",
    "fmi3SetInt64",
    "fmi3SetInt8",
    "fmi3SetIntervalDecimal",
    "fmi3SetIntervalFraction",
    "fmi3SetShiftDecimal",
    "fmi3SetShiftFraction",
    "fmi3SetString",
    "fmi3SetTime",
    "fmi3SetUInt16",
    "fmi3SetUInt32",
    "fmi3SetUInt64",
    "fmi3SetUInt8",
    "fmi3Terminate",
    "fmi3UpdateDiscreteStates",
];
