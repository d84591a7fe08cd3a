//! Target of a host's pointer to an instance, and the guards of a host from us and us from a host:
//!
//! - no panic crosses (it becomes an error and state "error");
//! - a component that is NULL, not of ours or freed is refused as far as its memory can be read (a mark is checked);
//! - two calls of one instance at a time (two threads, or a call out of the logger) are refused, not raced, and a refusal's
//!   own message is told once;
//! - memory is our own: a host's functions for it are never called;
//! - there is no global state: instances are independent, in any number, on any threads.
//!
//! # Safety
//!
//! All functions here trust the host as the standard asks it to: pointers to arrays have as many elements as the
//! call says, strings end with NUL, a component comes from this library and is of the same model.

#![allow(clippy::missing_safety_doc)]

use super::call_error::CallError;
use super::instance::Instance;
use super::instance_state::Function;
use super::logger::{LogListener, Logger, status_category};
use super::model::{Context, Model};
use super::resource;
use super::start::StartError;
use super::types::{Bytes, BytesOut, Component, Count, CountOut, FmuState, StateOut, Status, Text, Texts};
use super::version::Version;
use std::cell::UnsafeCell;
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Target of a component.
pub struct Handle<M: Model> {
    mark: AtomicU64,
    busy: AtomicBool,
    /// A refusal is being told. What a logger does with it is refused without a word, or it would go on for ever.
    telling: AtomicBool,
    /// For complaints while the instance is busy.
    logger: Logger,
    version: &'static Version,
    instance: UnsafeCell<Instance<M>>,
}

const ALIVE: u64 = u64::from_le_bytes(*b"RFL-FMUs");

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
        // SAFETY: the mark says that `instantiate` made it and `free` has not freed it.
        alive.then(|| unsafe { &*handle })
    }

    fn refuse(&self, refusal: &CallError, prefix: &str) -> Status {
        let status = refusal.status();
        self.tell(status, &format!("{prefix}{}", refusal.message(self.version)));
        status
    }

    fn tell(&self, status: Status, message: &str) {
        if !self.telling.swap(true, Ordering::Acquire) {
            self.logger.tell(status, status_category(status), message);
            self.telling.store(false, Ordering::Release);
        }
    }
}

/// Makes one call of an instance. See the module's docs for what is guarded.
///
/// # Safety
/// The component is NULL or comes from [`instantiate`] of the same model.
pub unsafe fn guard<M: Model>(
    component: Component,
    function: impl Function,
    body: impl FnOnce(&mut Instance<M>) -> Result<Status, CallError>,
) -> Status {
    // SAFETY: by contract.
    let Some(handle) = (unsafe { Handle::<M>::find(component) }) else { return Status::Error };
    if handle.busy.swap(true, Ordering::Acquire) {
        return handle.refuse(&CallError::Busy, &format!("{}: ", function.name()));
    }
    // SAFETY: `busy` was false and is now true: this is the only reference.
    let instance = unsafe { &mut *handle.instance.get() };
    let status = catch_unwind(AssertUnwindSafe(|| instance.call(function, body))).unwrap_or(Status::Error);
    handle.busy.store(false, Ordering::Release);
    status
}

/// A function that the description declares as absent: an error in every state, and nothing changes.
///
/// # Safety
/// As [`guard`].
pub unsafe fn unsupported<M: Model>(
    component: Component,
    function: &'static str,
    reason: &'static str,
) -> Status {
    // SAFETY: by contract.
    let Some(handle) = (unsafe { Handle::<M>::find(component) }) else { return Status::Error };
    handle.refuse(&CallError::Unsupported { function, reason }, "")
}

/// An array from the host.
///
/// # Safety
/// `pointer` is NULL or has `count` elements that live and stay unchanged over the call.
pub unsafe fn array<'a, T>(
    pointer: *const T,
    count: usize,
    argument: &'static str,
) -> Result<&'a [T], CallError> {
    check(pointer, count, argument)?;
    // SAFETY: not NULL unless empty, of possible size, the rest by contract.
    Ok(if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(pointer, count) } })
}

/// Refuses a NULL array that should have elements, and counts that no array has.
pub fn check<T>(pointer: *const T, count: usize, argument: &'static str) -> Result<(), CallError> {
    if count > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(CallError::ImpossibleCount { argument, count });
    }
    if count > 0 && pointer.is_null() { Err(CallError::NullPointer { argument }) } else { Ok(()) }
}

/// Strings from the host.
///
/// # Safety
/// As [`array`], and each element is NULL or a C string.
pub unsafe fn texts<'a>(
    pointer: Texts,
    count: usize,
    argument: &'static str,
) -> Result<Vec<&'a CStr>, CallError> {
    // SAFETY: by contract.
    let pointers = unsafe { array(pointer, count, argument)? };
    let text = |pointer: &*const c_char| match pointer.is_null() {
        true => Err(CallError::NullPointer { argument }),
        // SAFETY: a C string by contract.
        false => Ok(unsafe { CStr::from_ptr(*pointer) }),
    };
    pointers.iter().map(text).collect()
}

/// Place for a result.
///
/// # Safety
/// `pointer` is NULL or may be written.
pub unsafe fn put<T>(pointer: *mut T, value: T, argument: &'static str) -> Result<Status, CallError> {
    check(pointer, 1, argument)?;
    // SAFETY: not NULL, writable by contract. `write_unaligned`, as hosts' byte buffers are what they are.
    unsafe { pointer.write_unaligned(value) };
    Ok(Status::Ok)
}

/// Request of a host for an instance.
pub struct Request<'a> {
    /// The version of the host.
    pub version: &'static Version,
    /// The function that the host called.
    pub function: &'static str,
    /// The library's own mark.
    pub own: &'static str,
    /// The instance's name, and the mark and resources that the host gives.
    pub given: [Text; 3],
    /// Receiver of messages.
    pub listener: Option<LogListener>,
    /// True if debug logging is on.
    pub logging_on: bool,
    /// True if the host lets a step end early.
    pub may_end_early: bool,
    /// Objection of the version to the other arguments.
    pub against: Option<&'a str>,
}

/// Makes an instance, or says why not and gives NULL.
///
/// # Safety
/// The texts are NULL or C strings.
pub unsafe fn instantiate<M: Model>(request: Request<'_>) -> Component {
    let Request { version, function, own, given, listener, logging_on, may_end_early, against } = request;
    // SAFETY: NULL or a C string by contract.
    let [name, given, resources] =
        given.map(|text| unsafe { (!text.is_null()).then(|| CStr::from_ptr(text)) }.unwrap_or_default());
    let logger = Logger::new(listener, name);
    let refuse = |message: &str| {
        logger.tell(Status::Error, status_category(Status::Error), &format!("{function}: {message}"));
        std::ptr::null_mut()
    };
    if name.is_empty() {
        return refuse("the instance has no name. Pass one that tells it from the others.");
    }
    if let Some(reason) = against {
        return refuse(reason);
    }
    if given.to_bytes() != own.as_bytes() {
        return refuse(&format!(
            "the {} is {}, but this library is built for {own}. Library and modelDescription.xml are of \
             different versions: unpack the FMU anew.",
            version.mark,
            given.to_string_lossy()
        ));
    }
    let mut logger = logger.clone().unasked(version.speaks_unasked);
    if logging_on {
        logger.enable(vec!["logAll"]);
    }
    // Without the folder nobody knows whether anything was packed.
    let resources = resource::folder(&resources.to_string_lossy(), Path::exists);
    let fault = match &resources {
        Ok(Some(folder)) if folder.is_dir() => None,
        Ok(Some(folder)) => Some(format!("the resources folder {} is not there", folder.display())),
        Ok(None) => Some("the host gives no resource location".to_owned()),
        Err(error) => Some(error.to_string()),
    };
    if let Some(fault) = fault {
        let message = format!(
            "{function}: {fault}. Files and start values that were packed into the FMU are not known; the start values \
             are those of the FMU as it is shipped."
        );
        logger.tell(Status::Warning, status_category(Status::Warning), &message);
    }
    let resources = resources.unwrap_or_default();
    let context = Context { resources, instance_name: name.to_string_lossy().into_owned() };
    let made = catch_unwind(AssertUnwindSafe(|| {
        let mut instance = Instance::<M>::new(version, own, logger.clone(), context)?;
        instance.may_end_early = may_end_early;
        Ok(Handle {
            mark: AtomicU64::new(ALIVE),
            busy: AtomicBool::new(false),
            telling: AtomicBool::new(false),
            logger: logger.clone(),
            version,
            instance: UnsafeCell::new(instance),
        })
    }));
    match made {
        Ok(Ok(handle)) => Box::into_raw(Box::new(handle)).cast(),
        Ok(Err::<_, StartError>(error)) => refuse(&error.to_string()),
        Err(_) => refuse("internal error while the model was made. Please report it."),
    }
}

/// Frees an instance.
///
/// # Safety
/// As [`guard`].
pub unsafe fn free<M: Model>(component: Component, function: &str) {
    // SAFETY: by contract.
    let Some(handle) = (unsafe { Handle::<M>::find(component) }) else { return };
    if handle.busy.swap(true, Ordering::Acquire) {
        let message = format!("{function}: a call of this instance is still running; it is not freed.");
        handle.tell(Status::Error, &message);
        return;
    }
    handle.mark.store(0, Ordering::Release);
    // SAFETY: made by `Box::into_raw` in `instantiate`, freed once since the mark is gone, used by no one else since it
    // was not busy.
    let handle = unsafe { Box::from_raw(component.cast::<Handle<M>>()) };
    let _ = catch_unwind(AssertUnwindSafe(|| drop(handle)));
}

// The calls that are the same in all versions but for their names.

pub unsafe fn set_debug_logging<M: Model>(
    c: Component,
    function: impl Function,
    on: bool,
    count: Count,
    categories: Texts,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, function, |instance| {
            let categories =
                if categories.is_null() { Vec::new() } else { texts(categories, count, "categories")? };
            instance.set_debug_logging(on, &categories)
        })
    }
}

pub unsafe fn get_state<M: Model>(c: Component, function: impl Function, state: StateOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, function, |instance| {
            check(state, 1, "FMUstate")?;
            let stored = instance.store(state.read())?;
            put(state, stored, "FMUstate")
        })
    }
}

pub unsafe fn free_state<M: Model>(c: Component, function: impl Function, state: StateOut) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, function, |instance| {
            if state.is_null() {
                return Ok(Status::Ok);
            }
            instance.free_state(state.read())?;
            put(state, std::ptr::null_mut(), "FMUstate")
        })
    }
}

pub unsafe fn serialized_size<M: Model>(
    c: Component,
    function: impl Function,
    state: FmuState,
    size: CountOut,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, function, |instance| {
            let bytes = instance.serialize(state)?;
            put(size, bytes.len(), "size")
        })
    }
}

pub unsafe fn serialize<M: Model>(
    c: Component,
    function: impl Function,
    state: FmuState,
    bytes: BytesOut,
    size: Count,
) -> Status {
    // SAFETY: by the host's contract; no more than `size` bytes are written.
    unsafe {
        guard::<M>(c, function, |instance| {
            let serialized = instance.serialize(state)?;
            check(bytes, serialized.len(), "serializedState")?;
            if size < serialized.len() {
                return Err(CallError::SmallBuffer { given: size, needed: serialized.len() });
            }
            bytes.cast::<u8>().copy_from_nonoverlapping(serialized.as_ptr(), serialized.len());
            Ok(Status::Ok)
        })
    }
}

pub unsafe fn deserialize<M: Model>(
    c: Component,
    function: impl Function,
    bytes: Bytes,
    size: Count,
    state: StateOut,
) -> Status {
    // SAFETY: by the host's contract.
    unsafe {
        guard::<M>(c, function, |instance| {
            check(state, 1, "FMUstate")?;
            let restored = instance.deserialize(array(bytes.cast(), size, "serializedState")?)?;
            put(state, restored, "FMUstate")
        })
    }
}
