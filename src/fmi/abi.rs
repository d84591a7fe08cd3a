//! The C interface of FMI 2.0 (`fmi2Functions.h`, `fmi2FunctionTypes.h`, `fmi2TypesPlatform.h`), co-simulation.
//!
//! One generic function per function of the standard; [`export_fmi2!`](crate::export_fmi2) gives a library the
//! C symbols for one model. They only translate: pointers to slices, and calls to [`Instance`].
//!
//! What guards a host from us and us from a host:
//!
//! - no panic crosses (it becomes `fmi2Error` and state "error");
//! - a component that is NULL, not of ours or freed is refused as far as its memory can be read (a mark is checked);
//! - two calls of one instance at a time (two threads, or a call out of the logger) are refused, not raced;
//! - memory is our own: the host's `allocateMemory` and `freeMemory` are never called and may be NULL, as
//!   `canNotUseMemoryManagementFunctions` says;
//! - there is no global state: instances are independent, in any number, on any threads.
//!
//! # Safety
//!
//! All functions here trust the host as the standard asks it to: pointers to arrays have as many elements as the
//! call says, strings end with NUL, a component comes from `fmi2Instantiate` of the same model.

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments, non_snake_case, missing_docs)]

use super::instance::Instance;
use super::life::{Function, Life};
use super::logger::{Logger, status_category};
use super::model::{Context, Model};
use super::refusal::Refusal;
use super::resource;
use super::start::StartError;
use std::cell::UnsafeCell;
use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// `fmi2Status`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    Ok,
    Warning,
    Discard,
    Error,
    Fatal,
    Pending,
}

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
pub type Component = *mut c_void;
pub type Real = f64;
pub type Integer = c_int;
pub type Boolean = c_int;
pub type Count = usize;
pub type Text = *const c_char;
pub type Type = c_int;
pub type StatusKind = c_int;
pub type Callbacks = *const CallbackFunctions;
pub type References = *const c_uint;
pub type Reals = *const f64;
pub type Integers = *const c_int;
pub type Booleans = *const c_int;
pub type Texts = *const *const c_char;
pub type Bytes = *const c_char;
pub type RealsOut = *mut f64;
pub type IntegersOut = *mut c_int;
pub type BooleansOut = *mut c_int;
pub type TextsOut = *mut *const c_char;
pub type BytesOut = *mut c_char;
pub type CountOut = *mut usize;
pub type StatusOut = *mut Status;
pub type State = *mut c_void;
pub type StateOut = *mut *mut c_void;
pub type EventInfoOut = *mut c_void;

/// `fmi2Type`.
const CO_SIMULATION: Type = 1;
/// `fmi2StatusKind`.
const DO_STEP_STATUS: StatusKind = 0;
const LAST_SUCCESSFUL_TIME: StatusKind = 2;
const TERMINATED: StatusKind = 3;

/// What a component points to.
struct Handle<M: Model> {
    mark: AtomicU64,
    busy: AtomicBool,
    /// For complaints while the instance is busy.
    logger: Logger,
    instance: UnsafeCell<Instance<M>>,
}

const ALIVE: u64 = u64::from_le_bytes(*b"RFL-FMI2");

impl<M: Model> Handle<M> {
    /// The handle behind a component, if it looks like one of ours.
    ///
    /// # Safety
    /// The component is NULL, or memory that can be read.
    unsafe fn find<'a>(component: Component) -> Option<&'a Self> {
        let handle: *const Self = component.cast_const().cast();
        if handle.is_null() || !handle.is_aligned() {
            return None;
        }
        // SAFETY: readable by this function's contract; the mark is first read alone, as an atomic that any bits
        // make valid.
        let alive = unsafe { (*handle).mark.load(Ordering::Acquire) } == ALIVE;
        // SAFETY: the mark says that `fmi2Instantiate` made it and `fmi2FreeInstance` has not freed it.
        alive.then(|| unsafe { &*handle })
    }
}

/// Makes one call of an instance. See the module's docs for what is guarded.
///
/// # Safety
/// The component is NULL or comes from `fmi2Instantiate` of the same model.
unsafe fn guard<M: Model>(
    component: Component,
    function: Function,
    body: impl FnOnce(&mut Instance<M>) -> Result<Status, Refusal>,
) -> Status {
    // SAFETY: by contract.
    let Some(handle) = (unsafe { Handle::<M>::find(component) }) else { return Status::Error };
    if handle.busy.swap(true, Ordering::Acquire) {
        let message = format!(
            "{}: another call of this instance is still running (on another thread, or this call came out of the \
             logger). Make one call of an instance at a time.",
            function.name()
        );
        handle.logger.tell(Status::Error, status_category(Status::Error), &message);
        return Status::Error;
    }
    // SAFETY: `busy` was false and is now true: this is the only reference.
    let instance = unsafe { &mut *handle.instance.get() };
    let status = catch_unwind(AssertUnwindSafe(|| instance.call(function, body))).unwrap_or(Status::Error);
    handle.busy.store(false, Ordering::Release);
    status
}

/// An array from the host.
///
/// # Safety
/// `pointer` is NULL or has `count` elements that live and stay unchanged over the call.
unsafe fn array<'a, T>(pointer: *const T, count: usize, argument: &'static str) -> Result<&'a [T], Refusal> {
    check(pointer, count, argument)?;
    // SAFETY: not NULL unless empty, of possible size, the rest by contract.
    Ok(if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(pointer, count) } })
}

/// Refuses a NULL array that should have elements, and counts that no array has.
fn check<T>(pointer: *const T, count: usize, argument: &'static str) -> Result<(), Refusal> {
    if count > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(Refusal::ImpossibleCount { argument, count });
    }
    if count > 0 && pointer.is_null() { Err(Refusal::NullPointer { argument }) } else { Ok(()) }
}

/// Strings from the host.
///
/// # Safety
/// As [`array`], and each element is NULL or a C string.
unsafe fn texts<'a>(pointer: Texts, count: usize, argument: &'static str) -> Result<Vec<&'a CStr>, Refusal> {
    // SAFETY: by contract.
    let pointers = unsafe { array(pointer, count, argument)? };
    let text = |pointer: &*const c_char| match pointer.is_null() {
        true => Err(Refusal::NullPointer { argument }),
        // SAFETY: a C string by contract.
        false => Ok(unsafe { CStr::from_ptr(*pointer) }),
    };
    pointers.iter().map(text).collect()
}

/// Where a result goes.
///
/// # Safety
/// `pointer` is NULL or may be written.
unsafe fn put<T>(pointer: *mut T, value: T, argument: &'static str) -> Result<Status, Refusal> {
    check(pointer, 1, argument)?;
    // SAFETY: not NULL, writable by contract. `write_unaligned`, as hosts' byte buffers are what they are.
    unsafe { pointer.write_unaligned(value) };
    Ok(Status::Ok)
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
    // SAFETY: NULL or a C string by the host's contract.
    let text = |pointer: Text| unsafe { (!pointer.is_null()).then(|| CStr::from_ptr(pointer)) };
    let (name, given, resources) = (text(name).unwrap_or_default(), text(guid), text(resources));
    let callbacks = match callbacks.is_null() {
        true => CallbackFunctions::NONE,
        // SAFETY: the standard's struct by contract; read without alignment, for hosts that build it from bytes.
        false => unsafe { callbacks.read_unaligned() },
    };
    let logger = Logger::new(callbacks, name);
    let refuse = |message: &str| {
        logger.tell(Status::Error, status_category(Status::Error), &format!("fmi2Instantiate: {message}"));
        std::ptr::null_mut()
    };
    if name.is_empty() {
        return refuse("the instance has no name. Pass one that tells it from the others.");
    }
    if kind != CO_SIMULATION {
        return refuse("this FMU is for co-simulation only: pass fmi2CoSimulation as its type.");
    }
    let own = guid_of(xml).unwrap_or_default();
    let given = given.unwrap_or_default();
    if given.to_bytes() != own.as_bytes() {
        return refuse(&format!(
            "the GUID is {}, but this library is built for {own}. Library and modelDescription.xml are of \
             different versions: unpack the FMU anew.",
            given.to_string_lossy()
        ));
    }
    let resources = match resource::folder(&resources.unwrap_or_default().to_string_lossy(), Path::exists) {
        Ok(folder) => folder,
        Err(error) => {
            let message = format!("fmi2Instantiate: {error}. Files in resources/ will not be found.");
            logger.tell(Status::Warning, status_category(Status::Warning), &message);
            None
        }
    };
    let context = Context { resources, instance_name: name.to_string_lossy().into_owned() };
    let made = catch_unwind(AssertUnwindSafe(|| {
        let mut instance = Instance::<M>::new(own, name, callbacks, context)?;
        if logging_on != 0 {
            instance.logger.enable(vec!["logAll"]);
        }
        Ok(Handle {
            mark: AtomicU64::new(ALIVE),
            busy: AtomicBool::new(false),
            logger: logger.clone(),
            instance: UnsafeCell::new(instance),
        })
    }));
    match made {
        Ok(Ok(handle)) => Box::into_raw(Box::new(handle)).cast(),
        Ok(Err::<_, StartError>(error)) => refuse(&error.to_string()),
        Err(_) => refuse("internal error while the model was made. Please report it."),
    }
}

pub unsafe fn fmi2FreeInstance<M: Model>(component: Component) {
    // SAFETY: by the host's contract.
    let Some(handle) = (unsafe { Handle::<M>::find(component) }) else { return };
    if handle.busy.swap(true, Ordering::Acquire) {
        let message = "fmi2FreeInstance: a call of this instance is still running; it is not freed.";
        handle.logger.tell(Status::Error, status_category(Status::Error), message);
        return;
    }
    handle.mark.store(0, Ordering::Release);
    // SAFETY: made by `Box::into_raw` in `fmi2Instantiate`, freed once since the mark is gone, used by no one else
    // since it was not busy.
    let handle = unsafe { Box::from_raw(component.cast::<Handle<M>>()) };
    let _ = catch_unwind(AssertUnwindSafe(|| drop(handle)));
}

pub unsafe fn fmi2SetDebugLogging<M: Model>(
    c: Component,
    on: Boolean,
    count: Count,
    categories: Texts,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::SetDebugLogging, |instance| {
            let categories =
                if categories.is_null() { Vec::new() } else { texts(categories, count, "categories")? };
            instance.set_debug_logging(on != 0, &categories)
        })
    }
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
        pub unsafe fn $fmi<M: Model>(c: Component, references: References, count: Count, values: $out) -> Status {
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
    references: References,
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
    references: References,
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
    references: References,
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
    references: References,
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
    unsafe {
        guard::<M>(c, Function::GetFmuState, |instance| {
            check(state, 1, "FMUstate")?;
            let stored = instance.store(state.read())?;
            put(state, stored, "FMUstate")
        })
    }
}

pub unsafe fn fmi2SetFMUstate<M: Model>(c: Component, state: State) -> Status {
    // SAFETY: by the host's contract.
    unsafe { guard::<M>(c, Function::SetFmuState, |instance| instance.restore(state)) }
}

pub unsafe fn fmi2FreeFMUstate<M: Model>(c: Component, state: StateOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::FreeFmuState, |instance| {
            if state.is_null() {
                return Ok(Status::Ok);
            }
            instance.free_state(state.read())?;
            put(state, std::ptr::null_mut(), "FMUstate")
        })
    }
}

pub unsafe fn fmi2SerializedFMUstateSize<M: Model>(c: Component, state: State, size: CountOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::SerializedFmuStateSize, |instance| {
            let bytes = instance.serialize(state)?;
            put(size, bytes.len(), "size")
        })
    }
}

pub unsafe fn fmi2SerializeFMUstate<M: Model>(
    c: Component,
    state: State,
    bytes: BytesOut,
    size: Count,
) -> Status {
    // SAFETY: by the host's contract; no more than `size` bytes are written.
    unsafe {
        guard::<M>(c, Function::SerializeFmuState, |instance| {
            let serialized = instance.serialize(state)?;
            check(bytes, serialized.len(), "serializedState")?;
            if size < serialized.len() {
                return Err(Refusal::SmallBuffer { given: size, needed: serialized.len() });
            }
            bytes.cast::<u8>().copy_from_nonoverlapping(serialized.as_ptr(), serialized.len());
            Ok(Status::Ok)
        })
    }
}

pub unsafe fn fmi2DeSerializeFMUstate<M: Model>(
    c: Component,
    bytes: Bytes,
    size: Count,
    state: StateOut,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::DeSerializeFmuState, |instance| {
            check(state, 1, "FMUstate")?;
            let restored = instance.deserialize(array(bytes.cast(), size, "serializedState")?)?;
            put(state, restored, "FMUstate")
        })
    }
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
                let status = if instance.life() == Life::StepFailed { Status::Discard } else { Status::Ok };
                put(value, status, "value")
            }
            _ => Err(Refusal::NoSuchStatus { kind, reason: "fmi2GetStatus knows fmi2DoStepStatus" }),
        })
    }
}

pub unsafe fn fmi2GetRealStatus<M: Model>(c: Component, kind: StatusKind, value: RealsOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetRealStatus, |instance| match kind {
            LAST_SUCCESSFUL_TIME => put(value, instance.time(), "value"),
            _ => {
                Err(Refusal::NoSuchStatus { kind, reason: "fmi2GetRealStatus knows fmi2LastSuccessfulTime" })
            }
        })
    }
}

pub unsafe fn fmi2GetIntegerStatus<M: Model>(c: Component, kind: StatusKind, _value: IntegersOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetIntegerStatus, |_| {
            Err(Refusal::NoSuchStatus { kind, reason: "the standard defines no integer status" })
        })
    }
}

pub unsafe fn fmi2GetBooleanStatus<M: Model>(c: Component, kind: StatusKind, value: BooleansOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetBooleanStatus, |_| match kind {
            // A model never asks for the end of the simulation.
            TERMINATED => put(value, 0, "value"),
            _ => Err(Refusal::NoSuchStatus { kind, reason: "fmi2GetBooleanStatus knows fmi2Terminated" }),
        })
    }
}

pub unsafe fn fmi2GetStringStatus<M: Model>(c: Component, kind: StatusKind, _value: TextsOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, Function::GetStringStatus, |_| {
            Err(Refusal::NoSuchStatus { kind, reason: NEVER_PENDING })
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
            let Some(handle) = (unsafe { Handle::<M>::find(c) }) else { return Status::Error };
            let refusal = Refusal::Unsupported { function: stringify!($fmi), reason: $reason };
            handle.logger.tell(refusal.status(), status_category(refusal.status()), &refusal.to_string());
            refusal.status()
        }
    )*};
}

unsupported! {
    fmi2GetDirectionalDerivative(References, Count, References, Count, Reals, RealsOut):
        "providesDirectionalDerivative is false. Use finite differences over fmi2DoStep with stored FMU states";
    fmi2SetRealInputDerivatives(References, Count, Integers, Reals):
        "canInterpolateInputs is false; inputs hold over a step. Take smaller steps";
    fmi2GetRealOutputDerivatives(References, Count, Integers, RealsOut): "maxOutputDerivativeOrder is 0";
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
        /// Creates an instance; see FMI 2.0, section 2.1.5.
        ///
        /// # Safety
        /// As the standard asks of a host: strings are C strings or NULL, callbacks stay valid.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi2Instantiate(
            name: $crate::fmi::abi::Text,
            kind: $crate::fmi::abi::Type,
            guid: $crate::fmi::abi::Text,
            resources: $crate::fmi::abi::Text,
            callbacks: $crate::fmi::abi::Callbacks,
            visible: $crate::fmi::abi::Boolean,
            logging_on: $crate::fmi::abi::Boolean,
        ) -> $crate::fmi::abi::Component {
            // SAFETY: the host's contract is the callee's.
            unsafe {
                $crate::fmi::abi::fmi2Instantiate::<$model>(
                    $xml, name, kind, guid, resources, callbacks, visible, logging_on,
                )
            }
        }

        /// Frees an instance; see FMI 2.0, section 2.1.5.
        ///
        /// # Safety
        /// The component is NULL or comes from [`fmi2Instantiate`].
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi2FreeInstance(component: $crate::fmi::abi::Component) {
            // SAFETY: the host's contract is the callee's.
            unsafe { $crate::fmi::abi::fmi2FreeInstance::<$model>(component) }
        }

        /// `"default"`; see FMI 2.0, section 2.1.4.
        #[unsafe(no_mangle)]
        pub extern "C" fn fmi2GetTypesPlatform() -> $crate::fmi::abi::Text {
            $crate::fmi::abi::fmi2GetTypesPlatform::<$model>()
        }

        /// `"2.0"`; see FMI 2.0, section 2.1.4.
        #[unsafe(no_mangle)]
        pub extern "C" fn fmi2GetVersion() -> $crate::fmi::abi::Text {
            $crate::fmi::abi::fmi2GetVersion::<$model>()
        }

        $crate::export_fmi2! { @functions $model;
            fmi2SetDebugLogging(on: Boolean, count: Count, categories: Texts);
            fmi2SetupExperiment(tolerance_defined: Boolean, tolerance: Real, start: Real, stop_defined: Boolean, stop: Real);
            fmi2EnterInitializationMode();
            fmi2ExitInitializationMode();
            fmi2Terminate();
            fmi2Reset();
            fmi2GetReal(references: References, count: Count, values: RealsOut);
            fmi2GetInteger(references: References, count: Count, values: IntegersOut);
            fmi2GetBoolean(references: References, count: Count, values: BooleansOut);
            fmi2GetString(references: References, count: Count, values: TextsOut);
            fmi2SetReal(references: References, count: Count, values: Reals);
            fmi2SetInteger(references: References, count: Count, values: Integers);
            fmi2SetBoolean(references: References, count: Count, values: Booleans);
            fmi2SetString(references: References, count: Count, values: Texts);
            fmi2GetFMUstate(state: StateOut);
            fmi2SetFMUstate(state: State);
            fmi2FreeFMUstate(state: StateOut);
            fmi2SerializedFMUstateSize(state: State, size: CountOut);
            fmi2SerializeFMUstate(state: State, bytes: BytesOut, size: Count);
            fmi2DeSerializeFMUstate(bytes: Bytes, size: Count, state: StateOut);
            fmi2GetDirectionalDerivative(unknowns: References, unknown_count: Count, knowns: References, known_count: Count, seed: Reals, sensitivity: RealsOut);
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
            fmi2SetRealInputDerivatives(references: References, count: Count, orders: Integers, values: Reals);
            fmi2GetRealOutputDerivatives(references: References, count: Count, orders: Integers, values: RealsOut);
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
            component: $crate::fmi::abi::Component,
            $($argument: $crate::fmi::abi::$type),*
        ) -> $crate::fmi::abi::Status {
            // SAFETY: the host's contract is the callee's.
            unsafe { $crate::fmi::abi::$name::<$model>(component, $($argument),*) }
        }
    )*};
}
