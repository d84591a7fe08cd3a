//! In which states FMI 2.0 allows which call (section 4.2.4).

use crate::fmi::instance_state::functions;

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
