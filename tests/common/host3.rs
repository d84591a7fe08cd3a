//! The same host for FMI 3.0: its methods have the names of [`Host`](super::Host)'s.

use super::{Message, Messages, SteeringLag, vr};
use rfl_mpc::fmi::Status;
use std::cell::Cell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;

rfl_mpc::export_fmi3!(SteeringLag, include_str!("fmi3/SteeringLag.xml"));

/// Time, behind the model's own variables.
pub const TIME: u32 = vr::COUNT + 1;

/// The test model's instantiation token.
pub fn token() -> CString {
    CString::new(rfl_mpc::fmi::v3::token_of(include_str!("fmi3/SteeringLag.xml")).unwrap()).unwrap()
}

unsafe extern "C" fn take(
    environment: *mut c_void,
    status: Status,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: what our logger passes: C strings, and the environment of `Host3::with`.
    let (messages, [category, message]) =
        unsafe { (&*environment.cast::<Messages>(), [category, message].map(|text| CStr::from_ptr(text))) };
    let text = |text: &CStr| text.to_str().unwrap().to_owned();
    let message = Message { instance: String::new(), status, category: text(category), text: text(message) };
    messages.0.lock().unwrap().push(message);
}

/// An instance, as a host has one.
pub struct Host3 {
    pub instance: *mut c_void,
    pub messages: Box<Messages>,
    times: Cell<(f64, Option<f64>)>,
}

// SAFETY: an instance may be used from any thread, one at a time, as the standard has it.
unsafe impl Send for Host3 {}

impl Drop for Host3 {
    fn drop(&mut self) {
        // SAFETY: made by `fmi3InstantiateCoSimulation`, free once.
        unsafe { fmi3FreeInstance(self.instance) }
    }
}

impl Host3 {
    /// An instance without resources, with logging on.
    pub fn new() -> Self {
        let host = Self::with(c"toy", None, true);
        assert!(!host.instance.is_null(), "{:?}", host.messages);
        host
    }

    pub fn with(name: &CStr, resources: Option<&CStr>, logging_on: bool) -> Self {
        Self::made(name, resources, logging_on, false)
    }

    /// An instance whose steps may end early.
    pub fn ending_early() -> Self {
        Self::made(c"toy", None, true, true)
    }

    fn made(name: &CStr, resources: Option<&CStr>, logging_on: bool, early_return: bool) -> Self {
        let messages = Box::new(Messages::default());
        let resources = resources.map_or(ptr::null(), CStr::as_ptr);
        // SAFETY: C strings and a callback that live.
        let instance = unsafe {
            fmi3InstantiateCoSimulation(
                name.as_ptr(),
                token().as_ptr(),
                resources,
                0,
                u8::from(logging_on),
                0,
                u8::from(early_return),
                ptr::null(),
                0,
                ptr::from_ref(&*messages).cast_mut().cast(),
                Some(take),
                ptr::null(),
            )
        };
        Self { instance, messages, times: Cell::new((0.0, None)) }
    }

    /// An initialised instance.
    pub fn ready() -> Self {
        let host = Self::new();
        host.initialize();
        host
    }

    pub fn initialize(&self) {
        self.times.set((0.0, None));
        assert_eq!((self.enter(), self.exit()), (Status::Ok, Status::Ok), "{}", self.last());
    }

    /// The text of the last message.
    pub fn last(&self) -> String {
        self.messages.0.lock().unwrap().last().map(|message| message.text.clone()).unwrap_or_default()
    }

    /// All messages so far; forgets them.
    pub fn take_messages(&self) -> Vec<Message> {
        std::mem::take(&mut *self.messages.0.lock().unwrap())
    }

    /// What `enter` passes.
    pub fn setup(&self, start: f64, stop: Option<f64>) -> Status {
        self.times.set((start, stop));
        Status::Ok
    }

    pub fn enter(&self) -> Status {
        let (start, stop) = self.times.get();
        let (defined, stop) = (u8::from(stop.is_some()), stop.unwrap_or(0.0));
        // SAFETY: a live instance.
        unsafe { fmi3EnterInitializationMode(self.instance, 0, 0.0, start, defined, stop) }
    }

    pub fn exit(&self) -> Status {
        // SAFETY: a live instance.
        unsafe { fmi3ExitInitializationMode(self.instance) }
    }

    pub fn step(&self, point: f64, step: f64) -> Status {
        self.step_telling(point, step).0
    }

    /// A step with the last successful time.
    pub fn step_telling(&self, point: f64, step: f64) -> (Status, f64) {
        let (status, time, early) = self.step_that_may_end(point, step);
        assert!(status == Status::Error || !early);
        (status, time)
    }

    /// A step with the last successful time, which may be earlier than the step's end: then it is true.
    pub fn step_that_may_end(&self, point: f64, step: f64) -> (Status, f64, bool) {
        let (mut flags, mut time) = ([1_u8; 3], f64::NAN);
        let [events, end, early] = &mut flags;
        // SAFETY: a live instance, places of one.
        let status = unsafe { fmi3DoStep(self.instance, point, step, 0, events, end, early, &raw mut time) };
        assert!(status == Status::Error || flags[..2] == [0; 2]);
        (status, time, flags[2] != 0)
    }

    pub fn reset(&self) -> Status {
        // SAFETY: a live instance.
        unsafe { fmi3Reset(self.instance) }
    }

    pub fn terminate(&self) -> Status {
        // SAFETY: a live instance.
        unsafe { fmi3Terminate(self.instance) }
    }

    pub fn set_real(&self, vr: u32, value: f64) -> Status {
        // SAFETY: a live instance, arrays of one.
        unsafe { fmi3SetFloat64(self.instance, &raw const vr, 1, &raw const value, 1) }
    }

    pub fn real(&self, vr: u32) -> f64 {
        let mut value = f64::NAN;
        // SAFETY: a live instance, arrays of one.
        let status = unsafe { fmi3GetFloat64(self.instance, &raw const vr, 1, &raw mut value, 1) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        value
    }

    /// The values of an array of this size.
    pub fn reals<const N: usize>(&self, vr: u32) -> [f64; N] {
        let mut values = [f64::NAN; N];
        // SAFETY: a live instance, arrays of one and of the count that is given.
        let status = unsafe { fmi3GetFloat64(self.instance, &raw const vr, 1, values.as_mut_ptr(), N) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        values
    }

    pub fn set_integer(&self, vr: u32, value: i32) -> Status {
        // SAFETY: a live instance, arrays of one.
        unsafe { fmi3SetInt32(self.instance, &raw const vr, 1, &raw const value, 1) }
    }

    pub fn set_enumeration(&self, vr: u32, value: i64) -> Status {
        // SAFETY: a live instance, arrays of one.
        unsafe { fmi3SetInt64(self.instance, &raw const vr, 1, &raw const value, 1) }
    }

    pub fn integer(&self, vr: u32) -> i32 {
        let mut value = i32::MIN;
        // SAFETY: a live instance, arrays of one.
        let status = unsafe { fmi3GetInt32(self.instance, &raw const vr, 1, &raw mut value, 1) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        value
    }

    pub fn enumeration(&self, vr: u32) -> i64 {
        let mut value = i64::MIN;
        // SAFETY: a live instance, arrays of one.
        let status = unsafe { fmi3GetInt64(self.instance, &raw const vr, 1, &raw mut value, 1) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        value
    }

    pub fn set_boolean(&self, vr: u32, value: u8) -> Status {
        // SAFETY: a live instance, arrays of one.
        unsafe { fmi3SetBoolean(self.instance, &raw const vr, 1, &raw const value, 1) }
    }

    pub fn boolean(&self, vr: u32) -> i32 {
        let mut value = 77;
        // SAFETY: a live instance, arrays of one.
        let status = unsafe { fmi3GetBoolean(self.instance, &raw const vr, 1, &raw mut value, 1) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        i32::from(value)
    }

    pub fn set_string(&self, vr: u32, value: &CStr) -> Status {
        let value = value.as_ptr();
        // SAFETY: a live instance, arrays of one, a C string.
        unsafe { fmi3SetString(self.instance, &raw const vr, 1, &raw const value, 1) }
    }

    pub fn set_binary(&self, vr: u32, value: &[u8]) -> Status {
        let (size, value) = (value.len(), value.as_ptr());
        // SAFETY: a live instance, arrays of one, as many bytes as the size says.
        unsafe { fmi3SetBinary(self.instance, &raw const vr, 1, &raw const size, &raw const value, 1) }
    }

    pub fn binary(&self, vr: u32) -> Vec<u8> {
        let (mut size, mut value) = (usize::MAX, ptr::null());
        // SAFETY: a live instance, arrays of one; the bytes live until the variable is set.
        unsafe {
            let status = fmi3GetBinary(self.instance, &raw const vr, 1, &raw mut size, &raw mut value, 1);
            assert_eq!(status, Status::Ok, "{}", self.last());
            std::slice::from_raw_parts(value, size).to_vec()
        }
    }

    pub fn string(&self, vr: u32) -> String {
        let mut value = ptr::null();
        // SAFETY: a live instance, arrays of one; the string lives until the next call.
        unsafe {
            let status = fmi3GetString(self.instance, &raw const vr, 1, &raw mut value, 1);
            assert_eq!(status, Status::Ok, "{}", self.last());
            CStr::from_ptr(value).to_str().unwrap().to_owned()
        }
    }

    /// Stores a new FMU state.
    pub fn store(&self) -> *mut c_void {
        let mut state = ptr::null_mut();
        // SAFETY: a live instance.
        let status = unsafe { fmi3GetFMUState(self.instance, &raw mut state) };
        assert_eq!(status, Status::Ok, "{}", self.last());
        state
    }

    pub fn restore(&self, state: *mut c_void) -> Status {
        // SAFETY: a live instance.
        unsafe { fmi3SetFMUState(self.instance, state) }
    }

    pub fn free_state(&self, mut state: *mut c_void) -> Status {
        // SAFETY: a live instance.
        unsafe { fmi3FreeFMUState(self.instance, &raw mut state) }
    }

    pub fn serialize(&self, state: *mut c_void) -> Vec<u8> {
        let mut size = 0;
        // SAFETY: a live instance, a buffer of the size that was asked for.
        unsafe {
            let status = fmi3SerializedFMUStateSize(self.instance, state, &raw mut size);
            assert_eq!(status, Status::Ok, "{}", self.last());
            let mut bytes = vec![0_u8; size];
            let status = fmi3SerializeFMUState(self.instance, state, bytes.as_mut_ptr().cast(), size);
            assert_eq!(status, Status::Ok, "{}", self.last());
            bytes
        }
    }

    pub fn deserialize(&self, bytes: &[u8]) -> (Status, *mut c_void) {
        let mut state = ptr::null_mut();
        // SAFETY: a live instance, a buffer of the size that is given.
        let status = unsafe {
            fmi3DeserializeFMUState(self.instance, bytes.as_ptr().cast(), bytes.len(), &raw mut state)
        };
        (status, state)
    }

    /// Everything that can be seen of an initialised instance, bit by bit, in the order of 2.0's.
    pub fn fingerprint(&self) -> (Vec<u64>, Vec<i32>, String) {
        let reals = [vr::STEER_CMD, vr::STEER, vr::TAU, vr::GAIN, vr::MAX_STEP, vr::START];
        let mut reals = reals.map(|vr| self.real(vr)).to_vec();
        reals.extend(self.reals::<2>(vr::HISTORY));
        let mut whole = vec![
            self.integer(vr::STEPS),
            self.enumeration(vr::METHOD_USED) as i32,
            self.integer(vr::SUBSTEPS),
            self.enumeration(vr::METHOD) as i32,
        ];
        whole.extend([vr::ENABLED, vr::MOVING, vr::LIMITED].map(|vr| self.boolean(vr)));
        (reals.into_iter().map(f64::to_bits).collect(), whole, self.string(vr::SOURCE))
    }
}
