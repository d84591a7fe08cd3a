//! A host in Rust for the test model: the functions that a library exports, called as a host calls them.

#![allow(dead_code, unused_imports)]

pub mod host3;
pub mod toy;

use rfl_mpc::fmi::v2::{CallbackFunctions, CallbackLogger, Status};
use std::ffi::{CStr, CString, c_char, c_void};
use std::path::Path;
use std::ptr;
use std::sync::Mutex;
pub use toy::{SteeringLag, vr};

rfl_mpc::export_fmi2!(SteeringLag, include_str!("SteeringLag.xml"));

/// The test model's GUID.
pub fn guid() -> CString {
    CString::new(rfl_mpc::fmi::v2::guid_of(include_str!("SteeringLag.xml")).unwrap()).unwrap()
}

/// A resource location with nothing of an FMU.
pub fn nothing_packed() -> CString {
    CString::new(format!("file://{}/tests/common", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

/// A message that came through the logger.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    pub instance: String,
    pub status: Status,
    pub category: String,
    pub text: String,
}

/// Where an instance's messages go: its component environment.
#[derive(Debug, Default)]
pub struct Messages(pub Mutex<Vec<Message>>);

/// Takes what our logger passes. The standard's logger is variadic, which stable Rust cannot define; a function
/// with the arguments that are passed has the same calling convention on the platforms that we test on (x86-64 and
/// Arm Linux, Windows). `fmi_logger.rs` has a logger in C.
extern "C" fn take(
    environment: *mut c_void,
    name: *const c_char,
    status: Status,
    category: *const c_char,
    format: *const c_char,
    argument: *const c_char,
) {
    // SAFETY: what our logger passes: C strings, and the environment of `Host::with`.
    let (messages, [name, category, format, argument]) = unsafe {
        (
            &*environment.cast::<Messages>(),
            [name, category, format, argument].map(|text| CStr::from_ptr(text)),
        )
    };
    assert_eq!(format, c"%s");
    let text = |text: &CStr| text.to_str().unwrap().to_owned();
    messages.0.lock().unwrap().push(Message {
        instance: text(name),
        status,
        category: text(category),
        text: text(argument),
    });
}

/// Callbacks that write to `messages`.
pub fn callbacks(messages: &Messages) -> CallbackFunctions {
    // SAFETY: see `take`.
    let logger = unsafe {
        std::mem::transmute::<
            extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, *const c_char),
            CallbackLogger,
        >(take)
    };
    let environment = ptr::from_ref(messages).cast_mut().cast();
    CallbackFunctions { logger: Some(logger), component_environment: environment, ..CallbackFunctions::NONE }
}

/// An instance, as a host has one.
pub struct Host {
    pub component: *mut c_void,
    pub messages: Box<Messages>,
}

// SAFETY: an instance may be used from any thread, one at a time, as the standard has it.
unsafe impl Send for Host {}

impl Drop for Host {
    fn drop(&mut self) {
        // SAFETY: made by `fmi2Instantiate`, free once.
        unsafe { fmi2FreeInstance(self.component) }
    }
}

impl Host {
    /// An instance with nothing in its resources.
    pub fn new() -> Self {
        Self::with(c"toy", Some(&nothing_packed()))
    }

    /// An instance with a name and a resource location.
    pub fn with(name: &CStr, resources: Option<&CStr>) -> Self {
        let messages = Box::new(Messages::default());
        let callbacks = callbacks(&messages);
        let resources = resources.map_or(ptr::null(), CStr::as_ptr);
        // SAFETY: C strings and callbacks that live.
        let component = unsafe {
            fmi2Instantiate(name.as_ptr(), 1, guid().as_ptr(), resources, &raw const callbacks, 0, 0)
        };
        assert!(!component.is_null(), "{messages:?}");
        Self { component, messages }
    }

    /// An initialised instance.
    pub fn ready() -> Self {
        let host = Self::new();
        host.initialize();
        host
    }

    pub fn initialize(&self) {
        assert_eq!(self.setup(0.0, None), Status::Ok);
        assert_eq!(self.enter(), Status::Ok);
        assert_eq!(self.exit(), Status::Ok, "{}", self.last());
    }

    /// The text of the last message.
    pub fn last(&self) -> String {
        self.messages.0.lock().unwrap().last().map(|message| message.text.clone()).unwrap_or_default()
    }

    /// All messages so far; forgets them.
    pub fn take_messages(&self) -> Vec<Message> {
        std::mem::take(&mut *self.messages.0.lock().unwrap())
    }

    pub fn setup(&self, start: f64, stop: Option<f64>) -> Status {
        // SAFETY: a live component.
        unsafe {
            let defined = i32::from(stop.is_some());
            fmi2SetupExperiment(self.component, 0, 0.0, start, defined, stop.unwrap_or(0.0))
        }
    }

    pub fn enter(&self) -> Status {
        // SAFETY: a live component.
        unsafe { fmi2EnterInitializationMode(self.component) }
    }

    pub fn exit(&self) -> Status {
        // SAFETY: a live component.
        unsafe { fmi2ExitInitializationMode(self.component) }
    }

    pub fn step(&self, point: f64, step: f64) -> Status {
        // SAFETY: a live component.
        unsafe { fmi2DoStep(self.component, point, step, 0) }
    }

    pub fn reset(&self) -> Status {
        // SAFETY: a live component.
        unsafe { fmi2Reset(self.component) }
    }

    pub fn terminate(&self) -> Status {
        // SAFETY: a live component.
        unsafe { fmi2Terminate(self.component) }
    }

    pub fn set_real(&self, vr: u32, value: f64) -> Status {
        // SAFETY: a live component, arrays of one.
        unsafe { fmi2SetReal(self.component, &raw const vr, 1, &raw const value) }
    }

    pub fn real(&self, vr: u32) -> f64 {
        let mut value = f64::NAN;
        // SAFETY: a live component, arrays of one.
        let status = unsafe { fmi2GetReal(self.component, &raw const vr, 1, &raw mut value) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        value
    }

    pub fn set_integer(&self, vr: u32, value: i32) -> Status {
        // SAFETY: a live component, arrays of one.
        unsafe { fmi2SetInteger(self.component, &raw const vr, 1, &raw const value) }
    }

    pub fn integer(&self, vr: u32) -> i32 {
        let mut value = i32::MIN;
        // SAFETY: a live component, arrays of one.
        let status = unsafe { fmi2GetInteger(self.component, &raw const vr, 1, &raw mut value) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        value
    }

    pub fn set_boolean(&self, vr: u32, value: i32) -> Status {
        // SAFETY: a live component, arrays of one.
        unsafe { fmi2SetBoolean(self.component, &raw const vr, 1, &raw const value) }
    }

    pub fn boolean(&self, vr: u32) -> i32 {
        let mut value = i32::MIN;
        // SAFETY: a live component, arrays of one.
        let status = unsafe { fmi2GetBoolean(self.component, &raw const vr, 1, &raw mut value) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        value
    }

    pub fn set_string(&self, vr: u32, value: &CStr) -> Status {
        let value = value.as_ptr();
        // SAFETY: a live component, arrays of one, a C string.
        unsafe { fmi2SetString(self.component, &raw const vr, 1, &raw const value) }
    }

    pub fn string(&self, vr: u32) -> String {
        let mut value = ptr::null();
        // SAFETY: a live component, arrays of one; the string lives until the next call.
        unsafe {
            let status = fmi2GetString(self.component, &raw const vr, 1, &raw mut value);
            assert_eq!(status, Status::Ok, "{}", self.last());
            CStr::from_ptr(value).to_str().unwrap().to_owned()
        }
    }

    /// Stores a new FMU state.
    pub fn store(&self) -> *mut c_void {
        let mut state = ptr::null_mut();
        // SAFETY: a live component.
        assert_eq!(unsafe { fmi2GetFMUstate(self.component, &raw mut state) }, Status::Ok, "{}", self.last());
        state
    }

    pub fn restore(&self, state: *mut c_void) -> Status {
        // SAFETY: a live component.
        unsafe { fmi2SetFMUstate(self.component, state) }
    }

    pub fn free_state(&self, mut state: *mut c_void) -> Status {
        // SAFETY: a live component.
        unsafe { fmi2FreeFMUstate(self.component, &raw mut state) }
    }

    pub fn serialize(&self, state: *mut c_void) -> Vec<u8> {
        let mut size = 0;
        // SAFETY: a live component, a buffer of the size that was asked for.
        unsafe {
            assert_eq!(fmi2SerializedFMUstateSize(self.component, state, &raw mut size), Status::Ok);
            let mut bytes = vec![0_u8; size];
            let status = fmi2SerializeFMUstate(self.component, state, bytes.as_mut_ptr().cast(), size);
            assert_eq!(status, Status::Ok, "{}", self.last());
            bytes
        }
    }

    pub fn deserialize(&self, bytes: &[u8]) -> (Status, *mut c_void) {
        let mut state = ptr::null_mut();
        // SAFETY: a live component, a buffer of the size that is given.
        let status = unsafe {
            fmi2DeSerializeFMUstate(self.component, bytes.as_ptr().cast(), bytes.len(), &raw mut state)
        };
        (status, state)
    }

    /// Everything that can be seen of an initialised instance, bit by bit.
    pub fn fingerprint(&self) -> (Vec<u64>, Vec<i32>, String) {
        let reals = [
            vr::STEER_CMD,
            vr::STEER,
            vr::TAU,
            vr::GAIN,
            vr::MAX_STEP,
            vr::START,
            vr::HISTORY,
            vr::HISTORY + 1,
        ];
        let integers = [vr::STEPS, vr::METHOD_USED, vr::SUBSTEPS, vr::METHOD];
        let booleans = [vr::ENABLED, vr::MOVING, vr::LIMITED];
        let integers = integers.map(|vr| self.integer(vr)).into_iter();
        let all = integers.chain(booleans.map(|vr| self.boolean(vr))).collect();
        (reals.map(|vr| self.real(vr).to_bits()).to_vec(), all, self.string(vr::SOURCE))
    }
}
