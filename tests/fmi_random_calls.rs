//! More than 100 000 calls of each version of FMI in random order with random arguments, wrong references and broken bytes
//! among them: nothing crashes, every value stays sound, and a reset always gives back a working instance. `RANDOM_CALLS=1000000`
//! makes as many calls of each.

mod common;

use common::host3::*;
use common::*;
use proptest::prelude::*;
use rfl_mpc::fmi::Status;
use std::ffi::{CStr, CString, c_void};
use std::ptr;

/// One call of a host that knows no order.
#[derive(Debug, Clone)]
enum Call {
    Setup(f64, Option<f64>),
    Enter,
    Exit,
    Terminate,
    Reset,
    /// A step from the instance's time, off by the first number.
    Step(f64, f64),
    SetReal(Vec<(u32, f64)>),
    SetInteger(u32, i32),
    SetBoolean(u32, i32),
    SetString(u32, Vec<u8>),
    Get(u8, Vec<u32>),
    Store,
    StoreOver(usize),
    Restore(usize),
    FreeState(usize),
    ForeignState(usize),
    SerializeAndRestore(usize, Option<(usize, u8)>),
    Deserialize(Vec<u8>),
    Status(u8, i32),
    Unsupported(u8),
    DebugLogging(bool),
}

fn reference() -> impl Strategy<Value = u32> {
    prop_oneof![8 => 0..=vr::DATA, 1 => any::<u32>()]
}

fn real() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -1.5..1.5, 2 => any::<f64>(), 1 => Just(f64::NAN), 1 => Just(0.0), 1 => 0.0..1e3]
}

fn call() -> impl Strategy<Value = Call> {
    let step = prop_oneof![6 => Just(0.0), 1 => -1.0..1.0, 1 => real()];
    let size = prop_oneof![6 => 1e-3..0.2, 1 => real()];
    let text = prop::collection::vec(1_u8.., 0..12);
    prop_oneof![
        1 => (real(), prop::option::of(real())).prop_map(|(start, stop)| Call::Setup(start, stop)),
        3 => Just(Call::Enter),
        3 => Just(Call::Exit),
        1 => Just(Call::Terminate),
        2 => Just(Call::Reset),
        12 => (step, size).prop_map(|(off, size)| Call::Step(off, size)),
        6 => prop::collection::vec((reference(), real()), 0..4).prop_map(Call::SetReal),
        2 => (reference(), prop_oneof![-3..5, any::<i32>()]).prop_map(|(vr, value)| Call::SetInteger(vr, value)),
        2 => (reference(), any::<i32>()).prop_map(|(vr, value)| Call::SetBoolean(vr, value)),
        1 => (reference(), text).prop_map(|(vr, text)| Call::SetString(vr, text)),
        6 => (0..4_u8, prop::collection::vec(reference(), 0..6)).prop_map(|(kind, vrs)| Call::Get(kind, vrs)),
        3 => Just(Call::Store),
        1 => (0..8_usize).prop_map(Call::StoreOver),
        3 => (0..8_usize).prop_map(Call::Restore),
        1 => (0..8_usize).prop_map(Call::FreeState),
        1 => any::<usize>().prop_map(Call::ForeignState),
        2 => (0..8_usize, prop::option::of((any::<usize>(), 1..=255_u8)))
            .prop_map(|(state, damage)| Call::SerializeAndRestore(state, damage)),
        1 => prop::collection::vec(any::<u8>(), 0..200).prop_map(Call::Deserialize),
        1 => (0..5_u8, -1..6_i32).prop_map(|(which, kind)| Call::Status(which, kind)),
        1 => (0..4_u8).prop_map(Call::Unsupported),
        1 => any::<bool>().prop_map(Call::DebugLogging),
    ]
}

/// What the calls need of a host, of either version.
trait Calls {
    fn new() -> Self;
    fn take_messages(&self) -> Vec<Message>;
    fn setup(&self, start: f64, stop: Option<f64>) -> Status;
    fn enter(&self) -> Status;
    fn exit(&self) -> Status;
    fn terminate(&self) -> Status;
    fn reset(&self) -> Status;
    fn step(&self, point: f64, step: f64) -> Status;
    fn set_reals(&self, references: &[u32], values: &[f64]) -> Status;
    fn set_integer(&self, vr: u32, value: i32) -> Status;
    fn set_boolean(&self, vr: u32, value: i32) -> Status;
    fn set_string(&self, vr: u32, value: &CStr) -> Status;
    fn get(&self, kind: u8, references: &[u32]) -> Status;
    /// The value, if it could be read.
    fn get_real(&self, vr: u32) -> Option<f64>;
    /// `fmi2GetFMUstate` with what is in `state`.
    fn store_over(&self, state: &mut *mut c_void) -> Status;
    fn restore(&self, state: *mut c_void) -> Status;
    fn free_state(&self, state: *mut c_void) -> Status;
    fn serialize(&self, state: *mut c_void) -> Vec<u8>;
    fn deserialize(&self, bytes: &[u8]) -> (Status, *mut c_void);
    fn status(&self, which: u8, kind: i32) -> Status;
    fn unsupported(&self, which: u8) -> Status;
    fn log(&self, on: bool) -> Status;
    /// The instance's time, as far as it tells.
    fn time(&self) -> Option<f64>;
    fn fingerprint(&self) -> (Vec<u64>, Vec<i32>, String);
}

/// The methods that hosts of both versions have by the same name.
macro_rules! same_calls {
    ($host:ident) => {
        fn take_messages(&self) -> Vec<Message> {
            self.take_messages()
        }
        fn setup(&self, start: f64, stop: Option<f64>) -> Status {
            self.setup(start, stop)
        }
        fn enter(&self) -> Status {
            self.enter()
        }
        fn exit(&self) -> Status {
            self.exit()
        }
        fn terminate(&self) -> Status {
            self.terminate()
        }
        fn reset(&self) -> Status {
            self.reset()
        }
        fn restore(&self, state: *mut c_void) -> Status {
            self.restore(state)
        }
        fn free_state(&self, state: *mut c_void) -> Status {
            self.free_state(state)
        }
        fn serialize(&self, state: *mut c_void) -> Vec<u8> {
            self.serialize(state)
        }
        fn deserialize(&self, bytes: &[u8]) -> (Status, *mut c_void) {
            self.deserialize(bytes)
        }
        fn fingerprint(&self) -> (Vec<u64>, Vec<i32>, String) {
            self.fingerprint()
        }
    };
}

// SAFETY, of all blocks in both: a live instance; arrays as long as their counts; C strings; states are looked up, not
// followed.
#[allow(clippy::undocumented_unsafe_blocks)]
impl Calls for Host {
    same_calls!(Host);

    fn new() -> Self {
        Self::new()
    }

    fn step(&self, point: f64, step: f64) -> Status {
        self.step(point, step)
    }

    fn set_string(&self, vr: u32, value: &CStr) -> Status {
        self.set_string(vr, value)
    }

    fn set_reals(&self, references: &[u32], values: &[f64]) -> Status {
        unsafe { fmi2SetReal(self.component, references.as_ptr(), references.len(), values.as_ptr()) }
    }

    fn set_integer(&self, vr: u32, value: i32) -> Status {
        self.set_integer(vr, value)
    }

    fn set_boolean(&self, vr: u32, value: i32) -> Status {
        self.set_boolean(vr, value)
    }

    fn get(&self, kind: u8, references: &[u32]) -> Status {
        let (c, pointer, count) = (self.component, references.as_ptr(), references.len());
        let (mut reals, mut integers, mut texts) = ([0.0; 8], [0; 8], [ptr::null(); 8]);
        unsafe {
            match kind {
                0 => fmi2GetReal(c, pointer, count, reals.as_mut_ptr()),
                1 => fmi2GetInteger(c, pointer, count, integers.as_mut_ptr()),
                2 => fmi2GetBoolean(c, pointer, count, integers.as_mut_ptr()),
                _ => fmi2GetString(c, pointer, count, texts.as_mut_ptr()),
            }
        }
    }

    fn get_real(&self, vr: u32) -> Option<f64> {
        let mut value = 0.0;
        let status = unsafe { fmi2GetReal(self.component, &raw const vr, 1, &raw mut value) };
        (status < Status::Discard).then_some(value)
    }

    fn store_over(&self, state: &mut *mut c_void) -> Status {
        unsafe { fmi2GetFMUstate(self.component, state) }
    }

    fn status(&self, which: u8, kind: i32) -> Status {
        let c = self.component;
        let (mut real, mut integer, mut text) = (0.0, 0, ptr::null());
        unsafe {
            match which {
                0 => fmi2GetStatus(c, kind, &mut Status::Ok),
                1 => fmi2GetRealStatus(c, kind, &raw mut real),
                2 => fmi2GetIntegerStatus(c, kind, &raw mut integer),
                3 => fmi2GetBooleanStatus(c, kind, &raw mut integer),
                _ => fmi2GetStringStatus(c, kind, &raw mut text),
            }
        }
    }

    fn unsupported(&self, which: u8) -> Status {
        let (c, mut real) = (self.component, 0.0);
        unsafe {
            match which {
                0 => fmi2CancelStep(c),
                1 => fmi2SetTime(c, 1.0),
                2 => fmi2GetDerivatives(c, &raw mut real, 1),
                _ => fmi2GetDirectionalDerivative(c, &0, 1, &0, 1, &1.0, &raw mut real),
            }
        }
    }

    fn log(&self, on: bool) -> Status {
        unsafe { fmi2SetDebugLogging(self.component, i32::from(on), 0, ptr::null()) }
    }

    fn time(&self) -> Option<f64> {
        let mut time = 0.0;
        let status = unsafe { fmi2GetRealStatus(self.component, 2, &raw mut time) };
        (status == Status::Ok).then_some(time)
    }
}

#[allow(clippy::undocumented_unsafe_blocks)]
impl Calls for Host3 {
    same_calls!(Host3);

    fn new() -> Self {
        Self::ending_early()
    }

    fn step(&self, point: f64, step: f64) -> Status {
        self.step_that_may_end(point, step).0
    }

    fn set_string(&self, vr: u32, value: &CStr) -> Status {
        match vr {
            vr::DATA => self.set_binary(vr, value.to_bytes()),
            _ => self.set_string(vr, value),
        }
    }

    fn set_reals(&self, references: &[u32], values: &[f64]) -> Status {
        let count = references.len();
        unsafe { fmi3SetFloat64(self.instance, references.as_ptr(), count, values.as_ptr(), count) }
    }

    fn set_integer(&self, vr: u32, value: i32) -> Status {
        if value % 2 == 0 { self.set_integer(vr, value) } else { self.set_enumeration(vr, value.into()) }
    }

    fn set_boolean(&self, vr: u32, value: i32) -> Status {
        self.set_boolean(vr, value as u8)
    }

    fn get(&self, kind: u8, references: &[u32]) -> Status {
        let (c, pointer, count) = (self.instance, references.as_ptr(), references.len());
        let (mut reals, mut integers, mut texts) = ([0.0; 16], [0; 8], [ptr::null(); 8]);
        let (mut longs, mut flags) = ([0; 8], [0; 8]);
        // One more for each array, which has two.
        let values = count + references.iter().filter(|vr| **vr == vr::HISTORY).count();
        unsafe {
            match (kind, count % 2) {
                (0, _) => fmi3GetFloat64(c, pointer, count, reals.as_mut_ptr(), values),
                (1, 0) => fmi3GetInt32(c, pointer, count, integers.as_mut_ptr(), count),
                (1, _) => fmi3GetInt64(c, pointer, count, longs.as_mut_ptr(), count),
                (2, _) => fmi3GetBoolean(c, pointer, count, flags.as_mut_ptr(), count),
                _ => fmi3GetString(c, pointer, count, texts.as_mut_ptr(), count),
            }
        }
    }

    fn get_real(&self, vr: u32) -> Option<f64> {
        let mut value = 0.0;
        let status = unsafe { fmi3GetFloat64(self.instance, &raw const vr, 1, &raw mut value, 1) };
        (status < Status::Discard).then_some(value)
    }

    fn store_over(&self, state: &mut *mut c_void) -> Status {
        unsafe { fmi3GetFMUState(self.instance, state) }
    }

    fn status(&self, which: u8, kind: i32) -> Status {
        // Counts that do not fit.
        let mut reals = [0.0; 8];
        let (count, values) = (usize::from(which), (kind + 1) as usize);
        unsafe { fmi3GetFloat64(self.instance, [0; 8].as_ptr(), count, reals.as_mut_ptr(), values) }
    }

    fn unsupported(&self, which: u8) -> Status {
        let (c, mut real) = (self.instance, 0.0);
        unsafe {
            match which {
                0 => fmi3EnterEventMode(c),
                1 => fmi3SetTime(c, 1.0),
                2 => fmi3GetInt8(c, &0, 1, ptr::null(), 1),
                _ => fmi3GetDirectionalDerivative(c, &0, 1, &0, 1, &1.0, 1, &raw mut real, 1),
            }
        }
    }

    fn log(&self, _on: bool) -> Status {
        // Stays on: off, nothing would say why a call is refused.
        unsafe { fmi3SetDebugLogging(self.instance, 1, 0, ptr::null()) }
    }

    fn time(&self) -> Option<f64> {
        self.get_real(TIME)
    }
}

/// What a host remembers.
struct Run<H> {
    host: H,
    states: Vec<*mut c_void>,
    time: f64,
}

impl<H: Calls> Run<H> {
    fn state(&self, i: usize) -> *mut c_void {
        self.states.get(i).copied().unwrap_or(ptr::null_mut())
    }

    fn make(&mut self, call: &Call) -> Status {
        let host = &self.host;
        match call {
            Call::Setup(start, stop) => host.setup(*start, *stop),
            Call::Enter => host.enter(),
            Call::Exit => host.exit(),
            Call::Terminate => host.terminate(),
            Call::Reset => host.reset(),
            Call::Step(off, size) => host.step(self.time + off, *size),
            Call::SetReal(all) => {
                let (references, values): (Vec<u32>, Vec<f64>) = all.iter().copied().unzip();
                host.set_reals(&references, &values)
            }
            Call::SetInteger(vr, value) => host.set_integer(*vr, *value),
            Call::SetBoolean(vr, value) => host.set_boolean(*vr, *value),
            Call::SetString(vr, text) => host.set_string(*vr, &CString::new(text.clone()).unwrap()),
            Call::Get(kind, references) => host.get(*kind, references),
            Call::Store => {
                let mut state = ptr::null_mut();
                let status = host.store_over(&mut state);
                self.states.push(state);
                status
            }
            Call::StoreOver(i) => {
                let mut state = self.state(*i);
                let status = host.store_over(&mut state);
                if *i >= self.states.len() {
                    self.states.push(state);
                }
                status
            }
            Call::Restore(i) => host.restore(self.state(*i)),
            Call::FreeState(i) => {
                let status = host.free_state(self.state(*i));
                if *i < self.states.len() {
                    self.states.remove(*i);
                }
                status
            }
            Call::ForeignState(address) => {
                let foreign = ptr::without_provenance_mut(*address);
                assert!(self.states.contains(&foreign) || host.restore(foreign) == Status::Error);
                Status::Error
            }
            Call::SerializeAndRestore(i, damage) => {
                let state = self.state(*i);
                if state.is_null() {
                    return Status::Error;
                }
                let mut bytes = host.serialize(state);
                let length = bytes.len();
                if let Some((place, change)) = damage {
                    bytes[place % length] ^= change;
                }
                let (status, other) = host.deserialize(&bytes);
                assert_eq!(status == Status::Ok, damage.is_none(), "{:?}", host.take_messages().pop());
                if status == Status::Ok {
                    let status = host.restore(other);
                    assert_eq!(host.free_state(other), Status::Ok);
                    return status;
                }
                status
            }
            Call::Deserialize(bytes) => host.deserialize(bytes).0,
            Call::Status(which, kind) => host.status(*which, *kind),
            Call::Unsupported(which) => host.unsupported(*which),
            Call::DebugLogging(on) => host.log(*on),
        }
    }

    fn read_time(&mut self) {
        self.time = self.host.time().unwrap_or(self.time);
    }

    /// Whatever happened: what can be read is sound, refused calls were explained.
    fn check(&mut self, call: &Call, status: Status) {
        let messages = self.host.take_messages();
        if status != Status::Ok && !matches!(call, Call::ForeignState(_) | Call::SerializeAndRestore(..)) {
            let told = messages.iter().any(|message| message.status != Status::Ok);
            // A warning of an input that stays outside is told once.
            assert!(told || status == Status::Warning, "{call:?} gave {status:?} without a word");
        }
        assert!((Status::Ok..=Status::Error).contains(&status));
        for reference in [vr::STEER_CMD, vr::TAU, vr::GAIN, vr::START] {
            let Some(value) = self.host.get_real(reference) else { continue };
            assert!(value.is_finite(), "{reference} is {value} after {call:?}");
            let range = match reference {
                vr::TAU => 1e-3..=10.0,
                vr::GAIN => 0.0..=2.0,
                vr::START => -1.0..=1.0,
                _ => f64::MIN..=f64::MAX,
            };
            assert!(range.contains(&value), "{reference} is {value} after {call:?}");
        }
        self.host.take_messages();
    }
}

/// Calls in one sequence, and sequences: 120 000 calls, each with four more to check.
const LENGTH: usize = 300;
const SEQUENCES: u32 = 400;

/// The sequences that are asked for.
fn sequences() -> u32 {
    const { assert!(LENGTH * SEQUENCES as usize >= 100_000) };
    let calls = std::env::var("RANDOM_CALLS").map(|calls| calls.parse::<u32>().expect("a number of calls"));
    calls.map_or(SEQUENCES, |calls| calls.div_ceil(LENGTH as u32))
}

/// Makes the calls; every instance must work again after a reset.
fn random_calls<H: Calls>() {
    // The model panics when it is told to; its report need not be printed a thousand times.
    std::panic::set_hook(Box::new(|info| {
        if !info.payload().downcast_ref::<&str>().is_some_and(|text| text.contains("told to panic")) {
            eprintln!("{info}");
        }
    }));
    let config =
        ProptestConfig { cases: sequences(), failure_persistence: None, ..ProptestConfig::default() };
    let mut runner = proptest::test_runner::TestRunner::new_with_rng(
        config,
        proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
    );
    let steps = std::cell::Cell::new(0_u32);
    let calls = prop::collection::vec(call(), LENGTH);
    runner
        .run(&calls, |calls| {
            let mut run = Run { host: H::new(), states: Vec::new(), time: 0.0 };
            for call in &calls {
                let status = run.make(call);
                if matches!(call, Call::Step(..)) && status <= Status::Warning {
                    steps.set(steps.get() + 1);
                }
                run.check(call, status);
                run.read_time();
            }
            assert_eq!(run.host.reset(), Status::Ok);
            assert_eq!(after_a_step(&run.host), after_a_step(&H::new()));
            Ok(())
        })
        .unwrap();
    let steps = steps.get();
    let calls = sequences() * LENGTH as u32;
    assert!(
        steps > calls / 120,
        "only {steps} steps in {calls} calls were made: the sequences test too little"
    );
}

/// What an instance is after its first step.
fn after_a_step<H: Calls>(host: &H) -> (Vec<u64>, Vec<i32>, String) {
    host.setup(0.0, None);
    assert_eq!((host.enter(), host.exit(), host.step(0.0, 0.1)), (Status::Ok, Status::Ok, Status::Ok));
    host.fingerprint()
}

#[test]
fn random_calls_never_crash() {
    random_calls::<Host>();
}

#[test]
fn random_calls_of_3_0_never_crash() {
    random_calls::<Host3>();
}
