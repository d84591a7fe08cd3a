//! FMI 2.0, co-simulation: the C interface of `fmi2Functions.h`, `fmi2FunctionTypes.h`, `fmi2TypesPlatform.h`.
//!
//! One generic function per function of the standard; [`export_fmi2!`](crate::export_fmi2) gives a library the
//! C symbols for one model. They only translate: pointers to slices, and calls to an instance. What guards it stands in
//! `handle.rs`. A host's `allocateMemory` and `freeMemory` are never called and may be NULL, as
//! `canNotUseMemoryManagementFunctions` says.
//!
//! # Safety
//!
//! All functions here trust the host as the standard asks it to: pointers to arrays have as many elements as the
//! call says, strings end with NUL, a component comes from `fmi2Instantiate` of the same model.

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments, non_snake_case, missing_docs)]

mod table;

use super::call_error::CallError;
use super::handle;
use super::handle::{Request, array, check, guard, instantiate, put, texts};
use super::instance::Instance;
use super::instance_state::InstanceState;
use super::logger::{Kept, LogListener};
use super::model::Model;
pub use super::types::*;
use super::version::Version;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::Arc;
use table::Function;

/// FMI 2.0.
pub const VERSION: Version = Version {
    number: "2",
    states: "FMI 2.0, section 4.2.4",
    begin: "fmi2SetupExperiment, fmi2EnterInitializationMode",
    times: "fmi2SetupExperiment",
    state: "FMUstate",
    mark: "GUID",
    real: "Real",
    integer: "Integer",
    enumeration: "Integer",
    has_time: false,
    has_arrays: false,
    has_binaries: false,
    speaks_unasked: true,
};

/// `fmi2CallbackLogger`: variadic, as in C.
pub type CallbackLogger = unsafe extern "C" fn(
    environment: *mut c_void,
    instance_name: *const c_char,
    status: Status,
    category: *const c_char,
    message: *const c_char,
    ...
);

/// `fmi2CallbackFunctions`; every member may be NULL.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct CallbackFunctions {
    pub logger: Option<CallbackLogger>,
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, Status)>,
    pub component_environment: *mut c_void,
}

impl CallbackFunctions {
    /// No callback at all.
    pub const NONE: Self = Self {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: std::ptr::null_mut(),
    };
}

// The names of the C types, one word each, for the list of functions in `export_fmi2!`.
pub type Integer = c_int;
pub type Boolean = c_int;
pub type Type = c_int;
pub type StatusKind = c_int;
pub type Callbacks = *const CallbackFunctions;
pub type Integers = *const c_int;
pub type Booleans = *const c_int;
pub type IntegersOut = *mut c_int;
pub type BooleansOut = *mut c_int;
pub type StatusOut = *mut Status;
pub type EventInfoOut = *mut c_void;

/// `fmi2Type`.
const CO_SIMULATION: Type = 1;
/// `fmi2StatusKind`.
const DO_STEP_STATUS: StatusKind = 0;
const LAST_SUCCESSFUL_TIME: StatusKind = 2;
const TERMINATED: StatusKind = 3;

/// The host's logger. The callback is variadic and takes a *format*, so a `%` in a message must not be interpreted: every
/// message goes through the format `%s`.
fn listener(callbacks: &CallbackFunctions) -> Option<LogListener> {
    let (logger, kept) = (callbacks.logger?, Kept::new(callbacks.component_environment));
    Some(Arc::new(move |name: &CStr, status, category: &CStr, message: &CStr| {
        // SAFETY: `logger` is the host's callback of exactly this C type, the host keeps it valid until
        // fmi2FreeInstance (FMI 2.0, section 2.1.5); all strings live over the call; `%s` takes one string.
        unsafe {
            logger(
                kept.environment(),
                name.as_ptr(),
                status,
                category.as_ptr(),
                c"%s".as_ptr(),
                message.as_ptr(),
            );
        }
    }))
}

pub fn fmi2GetTypesPlatform<M: Model>() -> Text {
    c"default".as_ptr()
}

pub fn fmi2GetVersion<M: Model>() -> Text {
    c"2.0".as_ptr()
}

/// The attribute `guid` of a `modelDescription.xml`.
#[must_use]
pub fn guid_of(xml: &str) -> Option<&str> {
    let (_, rest) = xml.split_once(" guid=\"")?;
    rest.split_once('"').map(|(guid, _)| guid)
}

pub unsafe fn fmi2Instantiate<M: Model>(
    xml: &'static str,
    name: Text,
    kind: Type,
    guid: Text,
    resources: Text,
    callbacks: Callbacks,
    _visible: Boolean,
    logging_on: Boolean,
) -> Component {
    let callbacks = match callbacks.is_null() {
        true => CallbackFunctions::NONE,
        // SAFETY: the standard's struct by contract; read without alignment, for hosts that build it from bytes.
        false => unsafe { callbacks.read_unaligned() },
    };
    let other_kind = "this FMU is for co-simulation only: pass fmi2CoSimulation as its type.";
    let request = Request {
        version: &VERSION,
        function: "fmi2Instantiate",
        own: guid_of(xml).unwrap_or_default(),
        given: [name, guid, resources],
        listener: listener(&callbacks),
        logging_on: logging_on != 0,
        may_end_early: false,
        against: (kind != CO_SIMULATION).then_some(other_kind),
    };
    // SAFETY: by the host's contract.
    unsafe { instantiate::<M>(request) }
}

pub unsafe fn fmi2FreeInstance<M: Model>(component: Component) {
    // SAFETY: by the host's contract.
    unsafe { handle::free::<M>(component, "fmi2FreeInstance") }
}

pub unsafe fn fmi2SetDebugLogging<M: Model>(
    c: Component,
    on: Boolean,
    count: Count,
    categories: Texts,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::set_debug_logging::<M>(c, Function::SetDebugLogging, on != 0, count, categories) }
}

pub unsafe fn fmi2SetupExperiment<M: Model>(
    c: Component,
    _tolerance_defined: Boolean,
    _tolerance: Real,
    start: Real,
    stop_defined: Boolean,
    stop: Real,
) -> Status {
    let stop = (stop_defined != 0).then_some(stop);
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::SetupExperiment, |instance| instance.setup_experiment(start, stop)) }
}

pub unsafe fn fmi2EnterInitializationMode<M: Model>(c: Component) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::EnterInitializationMode, Instance::enter_initialization_mode) }
}

pub unsafe fn fmi2ExitInitializationMode<M: Model>(c: Component) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::ExitInitializationMode, Instance::exit_initialization_mode) }
}

pub unsafe fn fmi2Terminate<M: Model>(c: Component) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::Terminate, Instance::terminate) }
}

pub unsafe fn fmi2Reset<M: Model>(c: Component) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::Reset, Instance::reset) }
}

macro_rules! getters {
    ($($fmi:ident $function:ident $method:ident $out:ty, $convert:expr;)*) => {$(
        pub unsafe fn $fmi<M: Model>(c: Component, references: ValueReferences, count: Count, values: $out) -> Status {
            // SAFETY: by the host's contract; `write` stays below `count`, as it gives positions in `references`.
            unsafe {
                guard::<M>(c, Function::$function, |instance| {
                    let references = array(references, count, "vr")?;
                    check(values, count, "value")?;
                    instance.$method(references, |i, value| values.add(i).write($convert(value)))
                })
            }
        }
    )*};
}

getters! {
    fmi2GetReal GetReal get_real RealsOut, f64::from;
    fmi2GetInteger GetInteger get_integer IntegersOut, c_int::from;
    fmi2GetBoolean GetBoolean get_boolean BooleansOut, c_int::from;
    fmi2GetString GetString get_string TextsOut, Text::cast;
}

pub unsafe fn fmi2SetReal<M: Model>(
    c: Component,
    references: ValueReferences,
    count: Count,
    values: Reals,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::SetReal, |instance| {
            instance.set_real(array(references, count, "vr")?, array(values, count, "value")?)
        })
    }
}

pub unsafe fn fmi2SetInteger<M: Model>(
    c: Component,
    references: ValueReferences,
    count: Count,
    values: Integers,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::SetInteger, |instance| {
            instance.set_integer(array(references, count, "vr")?, array(values, count, "value")?)
        })
    }
}

pub unsafe fn fmi2SetBoolean<M: Model>(
    c: Component,
    references: ValueReferences,
    count: Count,
    values: Booleans,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::SetBoolean, |instance| {
            let values = array(values, count, "value")?.iter().map(|value| *value != 0);
            instance.set_boolean(array(references, count, "vr")?, values)
        })
    }
}

pub unsafe fn fmi2SetString<M: Model>(
    c: Component,
    references: ValueReferences,
    count: Count,
    values: Texts,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::SetString, |instance| {
            instance.set_string(array(references, count, "vr")?, &texts(values, count, "value")?)
        })
    }
}

pub unsafe fn fmi2GetFMUstate<M: Model>(c: Component, state: StateOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::get_state::<M>(c, Function::GetFmuState, state) }
}

pub unsafe fn fmi2SetFMUstate<M: Model>(c: Component, state: FmuState) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::SetFmuState, |instance| instance.restore(state)) }
}

pub unsafe fn fmi2FreeFMUstate<M: Model>(c: Component, state: StateOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::free_state::<M>(c, Function::FreeFmuState, state) }
}

pub unsafe fn fmi2SerializedFMUstateSize<M: Model>(c: Component, state: FmuState, size: CountOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::serialized_size::<M>(c, Function::SerializedFmuStateSize, state, size) }
}

pub unsafe fn fmi2SerializeFMUstate<M: Model>(
    c: Component,
    state: FmuState,
    bytes: BytesOut,
    size: Count,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::serialize::<M>(c, Function::SerializeFmuState, state, bytes, size) }
}

pub unsafe fn fmi2DeSerializeFMUstate<M: Model>(
    c: Component,
    bytes: Bytes,
    size: Count,
    state: StateOut,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe { handle::deserialize::<M>(c, Function::DeSerializeFmuState, bytes, size, state) }
}

pub unsafe fn fmi2DoStep<M: Model>(
    c: Component,
    point: Real,
    step: Real,
    _no_set_state_prior: Boolean,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::DoStep, |instance| instance.do_step(point, step)) }
}

pub unsafe fn fmi2CancelStep<M: Model>(c: Component) -> Status {
    // SAFETY: by the host's contract. Never allowed: no step is ever in progress when a host can call.
    unsafe { guard::<M>(c, Function::CancelStep, |_| Ok(Status::Error)) }
}

/// Steps are synchronous, so that nothing is ever pending.
const NEVER_PENDING: &str = "steps are synchronous, none is pending";

pub unsafe fn fmi2GetStatus<M: Model>(c: Component, kind: StatusKind, value: StatusOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetStatus, |instance| match kind {
            DO_STEP_STATUS => {
                let status =
                    if instance.life() == InstanceState::StepFailed { Status::Discard } else { Status::Ok };
                put(value, status, "value")
            }
            _ => Err(CallError::NoSuchStatus { kind, reason: "fmi2GetStatus knows fmi2DoStepStatus" }),
        })
    }
}

pub unsafe fn fmi2GetRealStatus<M: Model>(c: Component, kind: StatusKind, value: RealsOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetRealStatus, |instance| match kind {
            LAST_SUCCESSFUL_TIME => put(value, instance.time(), "value"),
            _ => Err(CallError::NoSuchStatus {
                kind,
                reason: "fmi2GetRealStatus knows fmi2LastSuccessfulTime",
            }),
        })
    }
}

pub unsafe fn fmi2GetIntegerStatus<M: Model>(c: Component, kind: StatusKind, _value: IntegersOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetIntegerStatus, |_| {
            Err(CallError::NoSuchStatus { kind, reason: "the standard defines no integer status" })
        })
    }
}

pub unsafe fn fmi2GetBooleanStatus<M: Model>(c: Component, kind: StatusKind, value: BooleansOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetBooleanStatus, |_| match kind {
            // A model never asks for the end of the simulation.
            TERMINATED => put(value, 0, "value"),
            _ => Err(CallError::NoSuchStatus { kind, reason: "fmi2GetBooleanStatus knows fmi2Terminated" }),
        })
    }
}

pub unsafe fn fmi2GetStringStatus<M: Model>(c: Component, kind: StatusKind, _value: TextsOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetStringStatus, |_| {
            Err(CallError::NoSuchStatus { kind, reason: NEVER_PENDING })
        })
    }
}

const MODEL_EXCHANGE: &str =
    "it belongs to model exchange, and this FMU is for co-simulation: call fmi2DoStep";

/// Functions that the description declares as absent: `fmi2Error` in every state, and nothing changes.
macro_rules! unsupported {
    ($($fmi:ident($($type:ty),*): $reason:expr;)*) => {$(
        pub unsafe fn $fmi<M: Model>(c: Component, $(_: $type),*) -> Status {
            // SAFETY: by the host's contract.
            unsafe { handle::unsupported::<M>(c, stringify!($fmi), $reason) }
        }
    )*};
}

unsupported! {
    fmi2GetDirectionalDerivative(ValueReferences, Count, ValueReferences, Count, Reals, RealsOut):
        "providesDirectionalDerivative is false. Use finite differences over fmi2DoStep with stored FMU states";
    fmi2SetRealInputDerivatives(ValueReferences, Count, Integers, Reals):
        "canInterpolateInputs is false; inputs hold over a step. Take smaller steps";
    fmi2GetRealOutputDerivatives(ValueReferences, Count, Integers, RealsOut): "maxOutputDerivativeOrder is 0";
    fmi2EnterEventMode(): MODEL_EXCHANGE;
    fmi2NewDiscreteStates(EventInfoOut): MODEL_EXCHANGE;
    fmi2EnterContinuousTimeMode(): MODEL_EXCHANGE;
    fmi2CompletedIntegratorStep(Boolean, BooleansOut, BooleansOut): MODEL_EXCHANGE;
    fmi2SetTime(Real): MODEL_EXCHANGE;
    fmi2SetContinuousStates(Reals, Count): MODEL_EXCHANGE;
    fmi2GetDerivatives(RealsOut, Count): MODEL_EXCHANGE;
    fmi2GetEventIndicators(RealsOut, Count): MODEL_EXCHANGE;
    fmi2GetContinuousStates(RealsOut, Count): MODEL_EXCHANGE;
    fmi2GetNominalsOfContinuousStates(RealsOut, Count): MODEL_EXCHANGE;
}

/// Exports a [`Model`] as the C functions of FMI 2.0: the whole content of an FMU's library.
///
/// ```text
/// rfl_mpc::export_fmi2!(rfl_mpc::fmu::PassengerCar, include_str!("../../../modelDescription/PassengerCar.xml"));
/// ```
///
/// The text is the model's `modelDescription.xml`, whose GUID the library checks.
#[macro_export]
macro_rules! export_fmi2 {
    ($model:ty, $xml:expr $(,)?) => {
        /// In the place of Windows' own: see `rfl_mpc::fmi::no_random_seed`.
        ///
        /// # Safety
        /// `place` is valid for writes of `count` bytes.
        #[cfg(windows)]
        #[unsafe(no_mangle)]
        pub unsafe extern "system" fn ProcessPrng(place: *mut u8, count: usize) -> i32 {
            // SAFETY: by the caller's contract.
            unsafe { $crate::fmi::no_random_seed(place, count) }
        }

        /// The pointer by which an imported function is called.
        #[cfg(windows)]
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)]
        pub static __imp_ProcessPrng: unsafe extern "system" fn(*mut u8, usize) -> i32 = ProcessPrng;

        /// Creates an instance; see FMI 2.0, section 2.1.5.
        ///
        /// # Safety
        /// As the standard asks of a host: strings are C strings or NULL, callbacks stay valid.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi2Instantiate(
            name: $crate::fmi::v2::Text,
            kind: $crate::fmi::v2::Type,
            guid: $crate::fmi::v2::Text,
            resources: $crate::fmi::v2::Text,
            callbacks: $crate::fmi::v2::Callbacks,
            visible: $crate::fmi::v2::Boolean,
            logging_on: $crate::fmi::v2::Boolean,
        ) -> $crate::fmi::v2::Component {
            // SAFETY: the host's contract is the callee's.
            unsafe {
                $crate::fmi::v2::fmi2Instantiate::<$model>(
                    $xml, name, kind, guid, resources, callbacks, visible, logging_on,
                )
            }
        }

        /// Frees an instance; see FMI 2.0, section 2.1.5.
        ///
        /// # Safety
        /// The component is NULL or comes from [`fmi2Instantiate`].
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi2FreeInstance(component: $crate::fmi::v2::Component) {
            // SAFETY: the host's contract is the callee's.
            unsafe { $crate::fmi::v2::fmi2FreeInstance::<$model>(component) }
        }

        /// `"default"`; see FMI 2.0, section 2.1.4.
        #[unsafe(no_mangle)]
        pub extern "C" fn fmi2GetTypesPlatform() -> $crate::fmi::v2::Text {
            $crate::fmi::v2::fmi2GetTypesPlatform::<$model>()
        }

        /// `"2.0"`; see FMI 2.0, section 2.1.4.
        #[unsafe(no_mangle)]
        pub extern "C" fn fmi2GetVersion() -> $crate::fmi::v2::Text {
            $crate::fmi::v2::fmi2GetVersion::<$model>()
        }

        $crate::export_fmi2! { @functions $model;
            fmi2SetDebugLogging(on: Boolean, count: Count, categories: Texts);
            fmi2SetupExperiment(tolerance_defined: Boolean, tolerance: Real, start: Real, stop_defined: Boolean, stop: Real);
            fmi2EnterInitializationMode();
            fmi2ExitInitializationMode();
            fmi2Terminate();
            fmi2Reset();
            fmi2GetReal(references: ValueReferences, count: Count, values: RealsOut);
            fmi2GetInteger(references: ValueReferences, count: Count, values: IntegersOut);
            fmi2GetBoolean(references: ValueReferences, count: Count, values: BooleansOut);
            fmi2GetString(references: ValueReferences, count: Count, values: TextsOut);
            fmi2SetReal(references: ValueReferences, count: Count, values: Reals);
            fmi2SetInteger(references: ValueReferences, count: Count, values: Integers);
            fmi2SetBoolean(references: ValueReferences, count: Count, values: Booleans);
            fmi2SetString(references: ValueReferences, count: Count, values: Texts);
            fmi2GetFMUstate(state: StateOut);
            fmi2SetFMUstate(state: FmuState);
            fmi2FreeFMUstate(state: StateOut);
            fmi2SerializedFMUstateSize(state: FmuState, size: CountOut);
            fmi2SerializeFMUstate(state: FmuState, bytes: BytesOut, size: Count);
            fmi2DeSerializeFMUstate(bytes: Bytes, size: Count, state: StateOut);
            fmi2GetDirectionalDerivative(unknowns: ValueReferences, unknown_count: Count, knowns: ValueReferences, known_count: Count, seed: Reals, sensitivity: RealsOut);
            fmi2EnterEventMode();
            fmi2NewDiscreteStates(info: EventInfoOut);
            fmi2EnterContinuousTimeMode();
            fmi2CompletedIntegratorStep(no_set_state_prior: Boolean, enter_event_mode: BooleansOut, terminate: BooleansOut);
            fmi2SetTime(time: Real);
            fmi2SetContinuousStates(states: Reals, count: Count);
            fmi2GetDerivatives(derivatives: RealsOut, count: Count);
            fmi2GetEventIndicators(indicators: RealsOut, count: Count);
            fmi2GetContinuousStates(states: RealsOut, count: Count);
            fmi2GetNominalsOfContinuousStates(nominals: RealsOut, count: Count);
            fmi2SetRealInputDerivatives(references: ValueReferences, count: Count, orders: Integers, values: Reals);
            fmi2GetRealOutputDerivatives(references: ValueReferences, count: Count, orders: Integers, values: RealsOut);
            fmi2DoStep(point: Real, step: Real, no_set_state_prior: Boolean);
            fmi2CancelStep();
            fmi2GetStatus(kind: StatusKind, value: StatusOut);
            fmi2GetRealStatus(kind: StatusKind, value: RealsOut);
            fmi2GetIntegerStatus(kind: StatusKind, value: IntegersOut);
            fmi2GetBooleanStatus(kind: StatusKind, value: BooleansOut);
            fmi2GetStringStatus(kind: StatusKind, value: TextsOut);
        }
    };
    (@functions $model:ty; $($name:ident($($argument:ident: $type:ident),*);)*) => {$(
        /// The function of this name of FMI 2.0.
        ///
        /// # Safety
        /// As the standard asks of a host: a component from `fmi2Instantiate`, arrays as long as their counts say.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            component: $crate::fmi::v2::Component,
            $($argument: $crate::fmi::v2::$type),*
        ) -> $crate::fmi::v2::Status {
            // SAFETY: the host's contract is the callee's.
            unsafe { $crate::fmi::v2::$name::<$model>(component, $($argument),*) }
        }
    )*};
}
