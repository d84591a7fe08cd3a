//! FMI 3.0, co-simulation: the C interface of `fmi3Functions.h`, `fmi3FunctionTypes.h`, `fmi3PlatformTypes.h`.
//!
//! As in [`v2`](super::v2), functions only translate. Differences of 3.0:
//!
//! - the host's logger is called only for what it asked for (`loggingOn`, `fmi3SetDebugLogging`), and is not variadic;
//! - enumerations are got and set as `Int64`, and time is a variable, behind the model's own;
//! - a get or set call counts its values apart from its references: an array has several;
//! - a discarded step leaves the instance as it was: a shorter one may follow;
//! - a step may end early for a host that allows it;
//! - outputs that belong together are arrays;
//! - resources come as a path, with or without a separator at its end. Hosts that pass a URI are understood.
//!
//! Event mode, clocks, intermediate update and structural parameters are declared as absent. A controller samples, and a vehicle
//! integrates, inside of a step, and both show what came of it at its end. A model never asks for the end of the simulation.
//!
//! # Safety
//!
//! As in [`v2`](super::v2).

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments, non_snake_case, missing_docs)]

mod table;

use super::call_error::CallError;
use super::handle::{self, Request, array, check, guard, instantiate, texts};
use super::instance::Instance;
use super::logger::{Kept, LogListener};
use super::model::Model;
pub use super::types::*;
use super::version::Version;
use std::ffi::{CStr, c_uint, c_void};
use std::sync::Arc;
use table::Function;

/// FMI 3.0.
pub const VERSION: Version = Version {
    number: "3",
    states: "FMI 3.0, sections 2.3 and 4.2",
    begin: "fmi3EnterInitializationMode",
    times: "fmi3EnterInitializationMode",
    state: "FMUState",
    mark: "instantiation token",
    real: "Float64",
    integer: "Int32",
    enumeration: "Int64",
    has_time: true,
    has_arrays: true,
    has_binaries: true,
    speaks_unasked: false,
};

/// `fmi3LogMessageCallback`.
pub type LogMessage = Option<
    unsafe extern "C" fn(environment: ComponentEnvironment, status: Status, category: Text, message: Text),
>;

// The names of the C types, one word each, for the list of functions in `export_fmi3!`.
/// `fmi3Boolean`, in C a `bool`: as a byte, any value of which is one in Rust.
pub type Fmi3Boolean = u8;
pub type Fmi3Booleans = *const u8;
pub type Fmi3BooleansOut = *mut u8;
pub type ValueReference = c_uint;
pub type Int32s = *const i32;
pub type Int32sOut = *mut i32;
pub type Int64s = *const i64;
pub type Int64sOut = *mut i64;
/// Sizes of `fmi3Binary`s.
pub type Counts = *const usize;
/// `fmi3Binary`s.
pub type Binaries = *const *const u8;
/// Place for pointers to bytes.
pub type BinariesOut = *mut *const u8;
/// A pointer that is not followed.
pub type Unused = *const c_void;

/// The attribute `instantiationToken` of a `modelDescription.xml`.
#[must_use]
pub fn token_of(xml: &str) -> Option<&str> {
    let (_, rest) = xml.split_once(" instantiationToken=\"")?;
    rest.split_once('"').map(|(token, _)| token)
}

fn listener(log: LogMessage, environment: ComponentEnvironment) -> Option<LogListener> {
    let (log, kept) = (log?, Kept::new(environment));
    Some(Arc::new(move |_: &CStr, status, category: &CStr, message: &CStr| {
        // SAFETY: the host's callback of this C type, which it keeps valid until fmi3FreeInstance; both strings live over
        // the call.
        unsafe { log(kept.environment(), status, category.as_ptr(), message.as_ptr()) }
    }))
}

pub fn fmi3GetVersion<M: Model>() -> Text {
    c"3.0".as_ptr()
}

pub unsafe fn fmi3InstantiateCoSimulation<M: Model>(
    xml: &'static str,
    name: Text,
    token: Text,
    resources: Text,
    _visible: Fmi3Boolean,
    logging_on: Fmi3Boolean,
    event_mode_used: Fmi3Boolean,
    early_return_allowed: Fmi3Boolean,
    _required: ValueReferences,
    required_count: Count,
    environment: ComponentEnvironment,
    log: LogMessage,
    _intermediate_update: Unused,
) -> Component {
    let against = if event_mode_used != 0 {
        Some("hasEventMode is false: pass fmi3False as eventModeUsed.")
    } else if required_count > 0 {
        Some("providesIntermediateUpdate is false: pass no requiredIntermediateVariables.")
    } else {
        None
    };
    let request = Request {
        version: &VERSION,
        function: "fmi3InstantiateCoSimulation",
        own: token_of(xml).unwrap_or_default(),
        given: [name, token, resources],
        listener: listener(log, environment),
        logging_on: logging_on != 0,
        may_end_early: early_return_allowed != 0,
        against,
    };
    // SAFETY: by the host's contract.
    unsafe { instantiate::<M>(request) }
}

/// Instances of other kinds are refused, with the reason.
unsafe fn other_kind<M: Model>(
    function: &'static str,
    given: [Text; 3],
    environment: ComponentEnvironment,
    log: LogMessage,
) -> Component {
    let against = Some("this FMU is for co-simulation only: call fmi3InstantiateCoSimulation.");
    let listener = listener(log, environment);
    let (logging_on, may_end_early) = (false, false);
    let request =
        Request { version: &VERSION, function, own: "", given, listener, logging_on, may_end_early, against };
    // SAFETY: by the host's contract.
    unsafe { instantiate::<M>(request) }
}

pub unsafe fn fmi3InstantiateModelExchange<M: Model>(
    name: Text,
    token: Text,
    resources: Text,
    _visible: Fmi3Boolean,
    _logging_on: Fmi3Boolean,
    environment: ComponentEnvironment,
    log: LogMessage,
) -> Component {
    // SAFETY: by the host's contract.
    unsafe { other_kind::<M>("fmi3InstantiateModelExchange", [name, token, resources], environment, log) }
}

pub unsafe fn fmi3InstantiateScheduledExecution<M: Model>(
    name: Text,
    token: Text,
    resources: Text,
    _visible: Fmi3Boolean,
    _logging_on: Fmi3Boolean,
    environment: ComponentEnvironment,
    log: LogMessage,
    _clock_update: Unused,
    _lock: Unused,
    _unlock: Unused,
) -> Component {
    // SAFETY: by the host's contract.
    unsafe {
        other_kind::<M>("fmi3InstantiateScheduledExecution", [name, token, resources], environment, log)
    }
}

pub unsafe fn fmi3FreeInstance<M: Model>(c: Component) {
    // SAFETY: by the host's contract.
    unsafe { handle::free::<M>(c, "fmi3FreeInstance") }
}

pub unsafe fn fmi3SetDebugLogging<M: Model>(
    c: Component,
    on: Fmi3Boolean,
    count: Count,
    categories: Texts,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::set_debug_logging::<M>(c, Function::SetDebugLogging, on != 0, count, categories) }
}

pub unsafe fn fmi3EnterInitializationMode<M: Model>(
    c: Component,
    _tolerance_defined: Fmi3Boolean,
    _tolerance: Real,
    start: Real,
    stop_defined: Fmi3Boolean,
    stop: Real,
) -> Status {
    let stop = (stop_defined != 0).then_some(stop);
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::EnterInitializationMode, |instance| {
            instance.setup_experiment(start, stop)?;
            instance.enter_initialization_mode()
        })
    }
}

pub unsafe fn fmi3ExitInitializationMode<M: Model>(c: Component) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::ExitInitializationMode, Instance::exit_initialization_mode) }
}

pub unsafe fn fmi3Terminate<M: Model>(c: Component) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::Terminate, Instance::terminate) }
}

pub unsafe fn fmi3Reset<M: Model>(c: Component) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::Reset, Instance::reset) }
}

/// Refuses a count of values that is not the variables': one for a scalar, one for each element of an array.
fn counted<M: Model>(instance: &Instance<M>, references: &[u32], given: Count) -> Result<(), CallError> {
    let needed = instance.count_values(references)?;
    let references = references.len();
    if needed == given { Ok(()) } else { Err(CallError::ValueCount { references, needed, given }) }
}

macro_rules! getters {
    ($($fmi:ident $function:ident $method:ident $out:ty, $convert:expr;)*) => {$(
        pub unsafe fn $fmi<M: Model>(
            c: Component,
            references: ValueReferences,
            count: Count,
            values: $out,
            value_count: Count,
        ) -> Status {
            // SAFETY: by the host's contract; `write` stays below `value_count`, which is checked to be the references'.
            unsafe {
                guard::<M>(c, Function::$function, |instance| {
                    let references = array(references, count, "valueReferences")?;
                    counted(instance, references, value_count)?;
                    check(values, value_count, "values")?;
                    instance.$method(references, |i, value| values.add(i).write($convert(value)))
                })
            }
        }
    )*};
}

getters! {
    fmi3GetFloat64 GetFloat64 get_real RealsOut, f64::from;
    fmi3GetInt32 GetInt32 get_integer Int32sOut, i32::from;
    fmi3GetInt64 GetInt64 get_enumeration Int64sOut, i64::from;
    fmi3GetBoolean GetBoolean get_boolean Fmi3BooleansOut, u8::from;
    fmi3GetString GetString get_string TextsOut, Text::cast;
}

macro_rules! setters {
    ($($fmi:ident $function:ident $values:ty, |$instance:ident, $references:ident, $given:ident| $set:expr;)*) => {$(
        pub unsafe fn $fmi<M: Model>(
            c: Component,
            references: ValueReferences,
            count: Count,
            values: $values,
            value_count: Count,
        ) -> Status {
            // SAFETY: by the host's contract.
            unsafe {
                guard::<M>(c, Function::$function, |$instance| {
                    let $references = array(references, count, "valueReferences")?;
                    counted($instance, $references, value_count)?;
                    let $given = array(values, value_count, "values")?;
                    $set
                })
            }
        }
    )*};
}

setters! {
    fmi3SetFloat64 SetFloat64 Reals, |instance, references, values| instance.set_real(references, values);
    fmi3SetInt32 SetInt32 Int32s, |instance, references, values| instance.set_integer(references, values);
    fmi3SetInt64 SetInt64 Int64s, |instance, references, values| instance.set_enumeration(references, values);
    fmi3SetBoolean SetBoolean Fmi3Booleans, |instance, references, values| {
        instance.set_boolean(references, values.iter().map(|value| *value != 0))
    };
    fmi3SetString SetString Texts, |instance, references, values| {
        instance.set_string(references, &texts(values.as_ptr(), values.len(), "values")?)
    };
}

pub unsafe fn fmi3GetBinary<M: Model>(
    c: Component,
    references: ValueReferences,
    count: Count,
    sizes: CountOut,
    values: BinariesOut,
    value_count: Count,
) -> Status {
    // SAFETY: by the host's contract, as of the other types.
    unsafe {
        guard::<M>(c, Function::GetBinary, |instance| {
            let references = array(references, count, "valueReferences")?;
            counted(instance, references, value_count)?;
            check(sizes, value_count, "valueSizes")?;
            check(values, value_count, "values")?;
            instance.get_binary(references, |i, value| {
                sizes.add(i).write(value.len());
                values.add(i).write(value.as_ptr());
            })
        })
    }
}

pub unsafe fn fmi3SetBinary<M: Model>(
    c: Component,
    references: ValueReferences,
    count: Count,
    sizes: Counts,
    values: Binaries,
    value_count: Count,
) -> Status {
    // SAFETY: by the host's contract; each value has as many bytes as its size says.
    unsafe {
        guard::<M>(c, Function::SetBinary, |instance| {
            let references = array(references, count, "valueReferences")?;
            counted(instance, references, value_count)?;
            let sizes = array(sizes, value_count, "valueSizes")?;
            let values = array(values, value_count, "values")?.iter().zip(sizes);
            let bytes: Result<Vec<_>, _> =
                values.map(|(value, size)| array(*value, *size, "values")).collect();
            instance.set_binary(references, &bytes?)
        })
    }
}

pub unsafe fn fmi3GetFMUState<M: Model>(c: Component, state: StateOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::get_state::<M>(c, Function::GetFmuState, state) }
}

pub unsafe fn fmi3SetFMUState<M: Model>(c: Component, state: FmuState) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::SetFmuState, |instance| instance.restore(state)) }
}

pub unsafe fn fmi3FreeFMUState<M: Model>(c: Component, state: StateOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::free_state::<M>(c, Function::FreeFmuState, state) }
}

pub unsafe fn fmi3SerializedFMUStateSize<M: Model>(c: Component, state: FmuState, size: CountOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::serialized_size::<M>(c, Function::SerializedFmuStateSize, state, size) }
}

pub unsafe fn fmi3SerializeFMUState<M: Model>(
    c: Component,
    state: FmuState,
    bytes: BytesOut,
    size: Count,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::serialize::<M>(c, Function::SerializeFmuState, state, bytes, size) }
}

pub unsafe fn fmi3DeserializeFMUState<M: Model>(
    c: Component,
    bytes: Bytes,
    size: Count,
    state: StateOut,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::deserialize::<M>(c, Function::DeserializeFmuState, bytes, size, state) }
}

pub unsafe fn fmi3DoStep<M: Model>(
    c: Component,
    point: Real,
    step: Real,
    _no_set_state_prior: Fmi3Boolean,
    event_handling_needed: Fmi3BooleansOut,
    terminate_simulation: Fmi3BooleansOut,
    early_return: Fmi3BooleansOut,
    last_successful_time: RealsOut,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::DoStep, |instance| {
            let outcome = instance.do_step(point, step);
            // Told of a discarded step, too: some hosts read them. One that wants none of them may pass NULL.
            let ended_early = u8::from(instance.ended_early());
            for (flag, value) in
                [(event_handling_needed, 0), (terminate_simulation, 0), (early_return, ended_early)]
            {
                if !flag.is_null() {
                    flag.write(value);
                }
            }
            if !last_successful_time.is_null() {
                last_successful_time.write_unaligned(instance.time());
            }
            outcome
        })
    }
}

const NO_SUCH_TYPE: &str = "this FMU has no variable of this type; modelDescription.xml says which it has";
const NO_CLOCKS: &str = "this FMU has no clocks";
const NO_STRUCTURE: &str = "this FMU has no structural parameters";
const NO_EVENT_MODE: &str = "hasEventMode is false: call fmi3DoStep";
const MODEL_EXCHANGE: &str =
    "it belongs to model exchange, and this FMU is for co-simulation: call fmi3DoStep";

/// Functions that the description declares as absent: `fmi3Error` in every state, and nothing changes.
macro_rules! unsupported {
    ($($fmi:ident($($type:ty),*): $reason:expr;)*) => {$(
        pub unsafe fn $fmi<M: Model>(c: Component, $(_: $type),*) -> Status {
            // SAFETY: by the host's contract.
            unsafe { handle::unsupported::<M>(c, stringify!($fmi), $reason) }
        }
    )*};
}

unsupported! {
    fmi3EnterEventMode(): NO_EVENT_MODE;
    fmi3GetFloat32(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3GetInt8(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3GetUInt8(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3GetInt16(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3GetUInt16(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3GetUInt32(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3GetUInt64(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3GetClock(ValueReferences, Count, Unused): NO_CLOCKS;
    fmi3SetFloat32(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3SetInt8(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3SetUInt8(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3SetInt16(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3SetUInt16(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3SetUInt32(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3SetUInt64(ValueReferences, Count, Unused, Count): NO_SUCH_TYPE;
    fmi3SetClock(ValueReferences, Count, Unused): NO_CLOCKS;
    fmi3GetNumberOfVariableDependencies(ValueReference, CountOut):
        "providesPerElementDependencies is false; modelDescription.xml has the dependencies";
    fmi3GetVariableDependencies(ValueReference, Unused, Unused, Unused, Unused, Count):
        "providesPerElementDependencies is false; modelDescription.xml has the dependencies";
    fmi3GetDirectionalDerivative(ValueReferences, Count, ValueReferences, Count, Reals, Count, RealsOut, Count):
        "providesDirectionalDerivatives is false. Use finite differences over fmi3DoStep with stored FMU states";
    fmi3GetAdjointDerivative(ValueReferences, Count, ValueReferences, Count, Reals, Count, RealsOut, Count):
        "providesAdjointDerivatives is false";
    fmi3EnterConfigurationMode(): NO_STRUCTURE;
    fmi3ExitConfigurationMode(): NO_STRUCTURE;
    fmi3GetIntervalDecimal(ValueReferences, Count, Unused, Unused): NO_CLOCKS;
    fmi3GetIntervalFraction(ValueReferences, Count, Unused, Unused, Unused): NO_CLOCKS;
    fmi3GetShiftDecimal(ValueReferences, Count, Unused): NO_CLOCKS;
    fmi3GetShiftFraction(ValueReferences, Count, Unused, Unused): NO_CLOCKS;
    fmi3SetIntervalDecimal(ValueReferences, Count, Unused): NO_CLOCKS;
    fmi3SetIntervalFraction(ValueReferences, Count, Unused, Unused): NO_CLOCKS;
    fmi3SetShiftDecimal(ValueReferences, Count, Unused): NO_CLOCKS;
    fmi3SetShiftFraction(ValueReferences, Count, Unused, Unused): NO_CLOCKS;
    fmi3EvaluateDiscreteStates(): NO_EVENT_MODE;
    fmi3UpdateDiscreteStates(Unused, Unused, Unused, Unused, Unused, Unused): NO_EVENT_MODE;
    fmi3EnterContinuousTimeMode(): MODEL_EXCHANGE;
    fmi3CompletedIntegratorStep(Fmi3Boolean, Fmi3BooleansOut, Fmi3BooleansOut): MODEL_EXCHANGE;
    fmi3SetTime(Real): MODEL_EXCHANGE;
    fmi3SetContinuousStates(Reals, Count): MODEL_EXCHANGE;
    fmi3GetContinuousStateDerivatives(RealsOut, Count): MODEL_EXCHANGE;
    fmi3GetEventIndicators(RealsOut, Count): MODEL_EXCHANGE;
    fmi3GetContinuousStates(RealsOut, Count): MODEL_EXCHANGE;
    fmi3GetNominalsOfContinuousStates(RealsOut, Count): MODEL_EXCHANGE;
    fmi3GetNumberOfEventIndicators(CountOut): MODEL_EXCHANGE;
    fmi3GetNumberOfContinuousStates(CountOut): MODEL_EXCHANGE;
    fmi3EnterStepMode(): NO_EVENT_MODE;
    fmi3GetOutputDerivatives(ValueReferences, Count, Int32s, RealsOut, Count): "maxOutputDerivativeOrder is 0";
    fmi3ActivateModelPartition(ValueReference, Real):
        "it belongs to scheduled execution, and this FMU is for co-simulation: call fmi3DoStep";
}

/// Exports a [`Model`] as the C functions of FMI 3.0: the whole content of an FMU's library.
///
/// ```text
/// rfl_mpc::export_fmi3!(rfl_mpc::fmu::PassengerCar, include_str!("../../../modelDescription/fmi3/PassengerCar.xml"));
/// ```
///
/// The text is the model's `modelDescription.xml`, whose instantiation token the library checks.
#[macro_export]
macro_rules! export_fmi3 {
    ($model:ty, $xml:expr $(,)?) => {
        /// `"3.0"`; see FMI 3.0, section 2.2.5.
        #[unsafe(no_mangle)]
        pub extern "C" fn fmi3GetVersion() -> $crate::fmi::v3::Text {
            $crate::fmi::v3::fmi3GetVersion::<$model>()
        }

        /// Creates an instance; see FMI 3.0, section 2.3.1.
        ///
        /// # Safety
        /// As the standard asks of a host: strings are C strings or NULL, callbacks stay valid.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
            name: $crate::fmi::v3::Text,
            token: $crate::fmi::v3::Text,
            resources: $crate::fmi::v3::Text,
            visible: $crate::fmi::v3::Fmi3Boolean,
            logging_on: $crate::fmi::v3::Fmi3Boolean,
            event_mode_used: $crate::fmi::v3::Fmi3Boolean,
            early_return_allowed: $crate::fmi::v3::Fmi3Boolean,
            required: $crate::fmi::v3::ValueReferences,
            required_count: $crate::fmi::v3::Count,
            environment: $crate::fmi::v3::ComponentEnvironment,
            log: $crate::fmi::v3::LogMessage,
            intermediate_update: $crate::fmi::v3::Unused,
        ) -> $crate::fmi::v3::Component {
            // SAFETY: the host's contract is the callee's.
            unsafe {
                $crate::fmi::v3::fmi3InstantiateCoSimulation::<$model>(
                    $xml, name, token, resources, visible, logging_on, event_mode_used, early_return_allowed, required,
                    required_count, environment, log, intermediate_update,
                )
            }
        }

        /// Frees an instance; see FMI 3.0, section 2.3.1.
        ///
        /// # Safety
        /// The instance is NULL or comes from [`fmi3InstantiateCoSimulation`].
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi3FreeInstance(instance: $crate::fmi::v3::Component) {
            // SAFETY: the host's contract is the callee's.
            unsafe { $crate::fmi::v3::fmi3FreeInstance::<$model>(instance) }
        }

        $crate::export_fmi3! { @functions $model, Component;
            fmi3InstantiateModelExchange(name: Text, token: Text, resources: Text, visible: Fmi3Boolean, logging_on: Fmi3Boolean, environment: ComponentEnvironment, log: LogMessage);
            fmi3InstantiateScheduledExecution(name: Text, token: Text, resources: Text, visible: Fmi3Boolean, logging_on: Fmi3Boolean, environment: ComponentEnvironment, log: LogMessage, clock_update: Unused, lock: Unused, unlock: Unused);
        }
        $crate::export_fmi3! { @functions $model, Status;
            fmi3SetDebugLogging(c: Component, on: Fmi3Boolean, count: Count, categories: Texts);
            fmi3EnterInitializationMode(c: Component, tolerance_defined: Fmi3Boolean, tolerance: Real, start: Real, stop_defined: Fmi3Boolean, stop: Real);
            fmi3ExitInitializationMode(c: Component);
            fmi3EnterEventMode(c: Component);
            fmi3Terminate(c: Component);
            fmi3Reset(c: Component);
            fmi3GetFloat32(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3GetFloat64(c: Component, references: ValueReferences, count: Count, values: RealsOut, value_count: Count);
            fmi3GetInt8(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3GetUInt8(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3GetInt16(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3GetUInt16(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3GetInt32(c: Component, references: ValueReferences, count: Count, values: Int32sOut, value_count: Count);
            fmi3GetUInt32(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3GetInt64(c: Component, references: ValueReferences, count: Count, values: Int64sOut, value_count: Count);
            fmi3GetUInt64(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3GetBoolean(c: Component, references: ValueReferences, count: Count, values: Fmi3BooleansOut, value_count: Count);
            fmi3GetString(c: Component, references: ValueReferences, count: Count, values: TextsOut, value_count: Count);
            fmi3GetBinary(c: Component, references: ValueReferences, count: Count, sizes: CountOut, values: BinariesOut, value_count: Count);
            fmi3GetClock(c: Component, references: ValueReferences, count: Count, values: Unused);
            fmi3SetFloat32(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3SetFloat64(c: Component, references: ValueReferences, count: Count, values: Reals, value_count: Count);
            fmi3SetInt8(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3SetUInt8(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3SetInt16(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3SetUInt16(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3SetInt32(c: Component, references: ValueReferences, count: Count, values: Int32s, value_count: Count);
            fmi3SetUInt32(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3SetInt64(c: Component, references: ValueReferences, count: Count, values: Int64s, value_count: Count);
            fmi3SetUInt64(c: Component, references: ValueReferences, count: Count, values: Unused, value_count: Count);
            fmi3SetBoolean(c: Component, references: ValueReferences, count: Count, values: Fmi3Booleans, value_count: Count);
            fmi3SetString(c: Component, references: ValueReferences, count: Count, values: Texts, value_count: Count);
            fmi3SetBinary(c: Component, references: ValueReferences, count: Count, sizes: Counts, values: Binaries, value_count: Count);
            fmi3SetClock(c: Component, references: ValueReferences, count: Count, values: Unused);
            fmi3GetNumberOfVariableDependencies(c: Component, reference: ValueReference, dependencies: CountOut);
            fmi3GetVariableDependencies(c: Component, dependent: ValueReference, elements: Unused, independents: Unused, of_independents: Unused, kinds: Unused, count: Count);
            fmi3GetFMUState(c: Component, state: StateOut);
            fmi3SetFMUState(c: Component, state: FmuState);
            fmi3FreeFMUState(c: Component, state: StateOut);
            fmi3SerializedFMUStateSize(c: Component, state: FmuState, size: CountOut);
            fmi3SerializeFMUState(c: Component, state: FmuState, bytes: BytesOut, size: Count);
            fmi3DeserializeFMUState(c: Component, bytes: Bytes, size: Count, state: StateOut);
            fmi3GetDirectionalDerivative(c: Component, unknowns: ValueReferences, unknown_count: Count, knowns: ValueReferences, known_count: Count, seed: Reals, seed_count: Count, sensitivity: RealsOut, sensitivity_count: Count);
            fmi3GetAdjointDerivative(c: Component, unknowns: ValueReferences, unknown_count: Count, knowns: ValueReferences, known_count: Count, seed: Reals, seed_count: Count, sensitivity: RealsOut, sensitivity_count: Count);
            fmi3EnterConfigurationMode(c: Component);
            fmi3ExitConfigurationMode(c: Component);
            fmi3GetIntervalDecimal(c: Component, references: ValueReferences, count: Count, intervals: Unused, qualifiers: Unused);
            fmi3GetIntervalFraction(c: Component, references: ValueReferences, count: Count, counters: Unused, resolutions: Unused, qualifiers: Unused);
            fmi3GetShiftDecimal(c: Component, references: ValueReferences, count: Count, shifts: Unused);
            fmi3GetShiftFraction(c: Component, references: ValueReferences, count: Count, counters: Unused, resolutions: Unused);
            fmi3SetIntervalDecimal(c: Component, references: ValueReferences, count: Count, intervals: Unused);
            fmi3SetIntervalFraction(c: Component, references: ValueReferences, count: Count, counters: Unused, resolutions: Unused);
            fmi3SetShiftDecimal(c: Component, references: ValueReferences, count: Count, shifts: Unused);
            fmi3SetShiftFraction(c: Component, references: ValueReferences, count: Count, counters: Unused, resolutions: Unused);
            fmi3EvaluateDiscreteStates(c: Component);
            fmi3UpdateDiscreteStates(c: Component, update: Unused, terminate: Unused, nominals: Unused, values: Unused, time_defined: Unused, time: Unused);
            fmi3EnterContinuousTimeMode(c: Component);
            fmi3CompletedIntegratorStep(c: Component, no_set_state_prior: Fmi3Boolean, enter_event_mode: Fmi3BooleansOut, terminate: Fmi3BooleansOut);
            fmi3SetTime(c: Component, time: Real);
            fmi3SetContinuousStates(c: Component, states: Reals, count: Count);
            fmi3GetContinuousStateDerivatives(c: Component, derivatives: RealsOut, count: Count);
            fmi3GetEventIndicators(c: Component, indicators: RealsOut, count: Count);
            fmi3GetContinuousStates(c: Component, states: RealsOut, count: Count);
            fmi3GetNominalsOfContinuousStates(c: Component, nominals: RealsOut, count: Count);
            fmi3GetNumberOfEventIndicators(c: Component, count: CountOut);
            fmi3GetNumberOfContinuousStates(c: Component, count: CountOut);
            fmi3EnterStepMode(c: Component);
            fmi3GetOutputDerivatives(c: Component, references: ValueReferences, count: Count, orders: Int32s, values: RealsOut, value_count: Count);
            fmi3DoStep(c: Component, point: Real, step: Real, no_set_state_prior: Fmi3Boolean, event_handling_needed: Fmi3BooleansOut, terminate_simulation: Fmi3BooleansOut, early_return: Fmi3BooleansOut, last_successful_time: RealsOut);
            fmi3ActivateModelPartition(c: Component, clock: ValueReference, time: Real);
        }
    };
    (@functions $model:ty, $result:ident; $($name:ident($($argument:ident: $type:ident),*);)*) => {$(
        /// The function of this name of FMI 3.0.
        ///
        /// # Safety
        /// As the standard asks of a host: an instance of this library, arrays as long as their counts say.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($($argument: $crate::fmi::v3::$type),*) -> $crate::fmi::v3::$result {
            // SAFETY: the host's contract is the callee's.
            unsafe { $crate::fmi::v3::$name::<$model>($($argument),*) }
        }
    )*};
}
