//! In which states FMI 3.0 allows which call (sections 2.3 and 4.2). Its step mode is both "step complete" and "step
//! failed": a discarded step has changed nothing.

use crate::fmi::instance_state::functions;

functions! {
    SetDebugLogging "fmi3SetDebugLogging" in [Always];
    EnterInitializationMode "fmi3EnterInitializationMode" in [Instantiated];
    ExitInitializationMode "fmi3ExitInitializationMode" in [InitializationMode];
    Terminate "fmi3Terminate" in [StepComplete StepFailed];
    Reset "fmi3Reset" in [Always];
    GetFloat64 "fmi3GetFloat64" in [Always];
    GetInt32 "fmi3GetInt32" in [Always];
    GetInt64 "fmi3GetInt64" in [Always];
    GetBoolean "fmi3GetBoolean" in [Always];
    GetString "fmi3GetString" in [Always];
    GetBinary "fmi3GetBinary" in [Always];
    SetFloat64 "fmi3SetFloat64" in [Instantiated InitializationMode StepComplete StepFailed];
    SetInt32 "fmi3SetInt32" in [Instantiated InitializationMode StepComplete StepFailed];
    SetInt64 "fmi3SetInt64" in [Instantiated InitializationMode StepComplete StepFailed];
    SetBoolean "fmi3SetBoolean" in [Instantiated InitializationMode StepComplete StepFailed];
    SetString "fmi3SetString" in [Instantiated InitializationMode StepComplete StepFailed];
    SetBinary "fmi3SetBinary" in [Instantiated InitializationMode StepComplete StepFailed];
    GetFmuState "fmi3GetFMUState" in [Always];
    SetFmuState "fmi3SetFMUState" in [Always];
    FreeFmuState "fmi3FreeFMUState" in [Always];
    SerializedFmuStateSize "fmi3SerializedFMUStateSize" in [Always];
    SerializeFmuState "fmi3SerializeFMUState" in [Always];
    DeserializeFmuState "fmi3DeserializeFMUState" in [Always];
    DoStep "fmi3DoStep" in [StepComplete StepFailed];
}
