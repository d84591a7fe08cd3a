//! More than 100 000 calls in random order with random arguments, wrong references and broken bytes among them:
//! nothing crashes, every value stays sound, and a reset always gives back a working instance.

mod common;

use common::*;
use proptest::prelude::*;
use rfl_mpc::fmi::abi::Status;
use std::ffi::{CString, c_void};
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
    prop_oneof![8 => 0..vr::COUNT, 1 => any::<u32>()]
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

/// What a host remembers.
struct Run {
    host: Host,
    states: Vec<*mut c_void>,
    time: f64,
}

impl Run {
    fn state(&self, i: usize) -> *mut c_void {
        self.states.get(i).copied().unwrap_or(ptr::null_mut())
    }

    fn make(&mut self, call: &Call) -> Status {
        let host = &self.host;
        let c = host.component;
        let (mut reals, mut integers, mut texts) = ([0.0; 8], [0; 8], [ptr::null(); 8]);
        // SAFETY: a live component; arrays as long as their counts; C strings; states are looked up, not followed.
        unsafe {
            match call {
                Call::Setup(start, stop) => host.setup(*start, *stop),
                Call::Enter => host.enter(),
                Call::Exit => host.exit(),
                Call::Terminate => host.terminate(),
                Call::Reset => host.reset(),
                Call::Step(off, size) => host.step(self.time + off, *size),
                Call::SetReal(all) => {
                    let (references, values): (Vec<u32>, Vec<f64>) = all.iter().copied().unzip();
                    fmi2SetReal(c, references.as_ptr(), references.len(), values.as_ptr())
                }
                Call::SetInteger(vr, value) => host.set_integer(*vr, *value),
                Call::SetBoolean(vr, value) => host.set_boolean(*vr, *value),
                Call::SetString(vr, text) => host.set_string(*vr, &CString::new(text.clone()).unwrap()),
                Call::Get(kind, references) => {
                    let (pointer, count) = (references.as_ptr(), references.len());
                    match kind {
                        0 => fmi2GetReal(c, pointer, count, reals.as_mut_ptr()),
                        1 => fmi2GetInteger(c, pointer, count, integers.as_mut_ptr()),
                        2 => fmi2GetBoolean(c, pointer, count, integers.as_mut_ptr()),
                        _ => fmi2GetString(c, pointer, count, texts.as_mut_ptr()),
                    }
                }
                Call::Store => {
                    let mut state = ptr::null_mut();
                    let status = fmi2GetFMUstate(c, &raw mut state);
                    self.states.push(state);
                    status
                }
                Call::StoreOver(i) => {
                    let mut state = self.state(*i);
                    let status = fmi2GetFMUstate(c, &raw mut state);
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
                    assert_eq!(status == Status::Ok, damage.is_none(), "{}", host.last());
                    if status == Status::Ok {
                        let status = host.restore(other);
                        assert_eq!(host.free_state(other), Status::Ok);
                        return status;
                    }
                    status
                }
                Call::Deserialize(bytes) => host.deserialize(bytes).0,
                Call::Status(which, kind) => match which {
                    0 => fmi2GetStatus(c, *kind, &mut Status::Ok),
                    1 => fmi2GetRealStatus(c, *kind, reals.as_mut_ptr()),
                    2 => fmi2GetIntegerStatus(c, *kind, integers.as_mut_ptr()),
                    3 => fmi2GetBooleanStatus(c, *kind, integers.as_mut_ptr()),
                    _ => fmi2GetStringStatus(c, *kind, texts.as_mut_ptr()),
                },
                Call::Unsupported(which) => match which {
                    0 => fmi2CancelStep(c),
                    1 => fmi2SetTime(c, 1.0),
                    2 => fmi2GetDerivatives(c, reals.as_mut_ptr(), 1),
                    _ => fmi2GetDirectionalDerivative(c, &0, 1, &0, 1, reals.as_ptr(), reals.as_mut_ptr()),
                },
                Call::DebugLogging(on) => fmi2SetDebugLogging(c, i32::from(*on), 0, ptr::null()),
            }
        }
    }

    /// The instance's time, as far as it tells.
    fn read_time(&mut self) {
        // SAFETY: a live component.
        unsafe { fmi2GetRealStatus(self.host.component, 2, &raw mut self.time) };
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
            let mut value = 0.0;
            // SAFETY: a live component, arrays of one.
            let status = unsafe { fmi2GetReal(self.host.component, &raw const reference, 1, &raw mut value) };
            assert!(status >= Status::Discard || value.is_finite(), "{reference} is {value} after {call:?}");
            let range = match reference {
                vr::TAU => 1e-3..=10.0,
                vr::GAIN => 0.0..=2.0,
                vr::START => -1.0..=1.0,
                _ => f64::MIN..=f64::MAX,
            };
            assert!(
                status >= Status::Discard || range.contains(&value),
                "{reference} is {value} after {call:?}"
            );
        }
        self.host.take_messages();
    }
}

/// Calls in one sequence, and sequences: 120 000 calls, each with four more to check.
const LENGTH: usize = 300;
const SEQUENCES: u32 = 400;

#[test]
fn random_calls_never_crash() {
    const { assert!(LENGTH * SEQUENCES as usize >= 100_000) };
    // The model panics when it is told to; its report need not be printed a thousand times.
    std::panic::set_hook(Box::new(|info| {
        if !info.payload().downcast_ref::<&str>().is_some_and(|text| text.contains("told to panic")) {
            eprintln!("{info}");
        }
    }));
    let config = ProptestConfig { cases: SEQUENCES, failure_persistence: None, ..ProptestConfig::default() };
    let mut steps = 0;
    let mut runner = proptest::test_runner::TestRunner::new_with_rng(
        config,
        proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
    );
    let steps_made = std::cell::Cell::new(0);
    let calls = prop::collection::vec(call(), LENGTH);
    runner
        .run(&calls, |calls| {
            let mut run = Run { host: Host::new(), states: Vec::new(), time: 0.0 };
            for call in &calls {
                let status = run.make(call);
                if matches!(call, Call::Step(..)) && status <= Status::Warning {
                    steps_made.set(steps_made.get() + 1);
                }
                run.check(call, status);
                run.read_time();
            }
            let host = &run.host;
            assert_eq!(host.reset(), Status::Ok);
            host.initialize();
            assert_eq!(host.step(0.0, 0.1), Status::Ok);
            assert_eq!(host.fingerprint(), fresh());
            Ok(())
        })
        .unwrap();
    steps += steps_made.get();
    assert!(steps > 1000, "only {steps} steps were made: the sequences test too little");
}

/// An instance after its first step.
fn fresh() -> (Vec<u64>, Vec<i32>, String) {
    let host = Host::ready();
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
    host.fingerprint()
}
