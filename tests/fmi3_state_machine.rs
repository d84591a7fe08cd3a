//! Every function in every state, against the tables of FMI 3.0, sections 2.3 and 4.2.

use crate::common::host3::*;
use crate::common::*;
use rfl_mpc::fmi::Status;
use rfl_mpc::fmi::v3::{Count, Fmi3Boolean, Unused};
use std::ptr;

/// In which states a call is allowed. Columns: Instantiated, initialization Mode, step mode (Complete, or after a discarded step:
/// Failed), Terminated, Error.
const TABLE: &str = "
                              I M C F T E
    fmi3SetDebugLogging       x x x x x x
    fmi3EnterInitializationMode x . . . . .
    fmi3ExitInitializationMode . x . . . .
    fmi3Terminate             . . x x . .
    fmi3Reset                 x x x x x x
    fmi3GetFloat64            x x x x x x
    fmi3GetInt32              x x x x x x
    fmi3GetInt64              x x x x x x
    fmi3GetBoolean            x x x x x x
    fmi3GetString             x x x x x x
    fmi3GetBinary             x x x x x x
    fmi3SetFloat64            x x x x . .
    fmi3SetBoolean            x x x x . .
    fmi3SetInt32              x x . . . .
    fmi3SetInt64              x x . . . .
    fmi3SetString             x x . . . .
    fmi3SetBinary             x x . . . .
    fmi3GetFMUState           x x x x x x
    fmi3SetFMUState           x x x x x x
    fmi3FreeFMUState          x x x x x x
    fmi3SerializedFMUStateSize x x x x x x
    fmi3SerializeFMUState     x x x x x x
    fmi3DeserializeFMUState   x x x x x x
    fmi3DoStep                . . x x . .
";

/// An instance in the state of a column.
fn instance_in(state: &str) -> Host3 {
    let host = Host3::new();
    assert_eq!(host.set_real(vr::MAX_STEP, 0.5), Status::Ok);
    assert_eq!(host.set_real(vr::FAIL_AFTER, 1.0), Status::Ok);
    if state == "I" {
        return host;
    }
    host.setup(if state == "E" { 1.0 } else { 0.0 }, None);
    assert_eq!(host.enter(), Status::Ok);
    if state == "M" {
        return host;
    }
    assert_eq!(host.exit(), Status::Ok);
    match state {
        "F" => assert_eq!(host.step_telling(0.0, 0.6), (Status::Discard, 0.0)),
        "T" => assert_eq!(host.terminate(), Status::Ok),
        "E" => assert_eq!(host.step(1.0, 0.1), Status::Error),
        _ => {}
    }
    host
}

/// Calls a function with arguments that are right in themselves.
fn call(host: &Host3, function: &str) -> Status {
    let c = host.instance;
    let state = host.store();
    let mut bytes = host.serialize(state);
    let mut other = ptr::null_mut();
    let (mut real, mut whole, mut long, mut flag, mut size) = (0.0, 0, 0, 0_u8, 0);
    let (mut text, mut bytes_out) = (ptr::null(), ptr::null());
    let (r, i, e, b, s) = (vr::STEER, vr::STEPS, vr::METHOD_USED, vr::MOVING, vr::SOURCE);
    // SAFETY: a live instance, arrays at least as long as their counts.
    unsafe {
        match function {
            "fmi3SetDebugLogging" => fmi3SetDebugLogging(c, 1, 0, ptr::null()),
            "fmi3EnterInitializationMode" => fmi3EnterInitializationMode(c, 1, 1e-6, 0.0, 1, 10.0),
            "fmi3ExitInitializationMode" => fmi3ExitInitializationMode(c),
            "fmi3Terminate" => fmi3Terminate(c),
            "fmi3Reset" => fmi3Reset(c),
            "fmi3GetFloat64" => fmi3GetFloat64(c, &raw const r, 1, &raw mut real, 1),
            "fmi3GetInt32" => fmi3GetInt32(c, &raw const i, 1, &raw mut whole, 1),
            "fmi3GetInt64" => fmi3GetInt64(c, &raw const e, 1, &raw mut long, 1),
            "fmi3GetBoolean" => fmi3GetBoolean(c, &raw const b, 1, &raw mut flag, 1),
            "fmi3GetString" => fmi3GetString(c, &raw const s, 1, &raw mut text, 1),
            "fmi3GetBinary" => fmi3GetBinary(c, &vr::DATA, 1, &raw mut size, &raw mut bytes_out, 1),
            "fmi3SetBinary" => fmi3SetBinary(c, &vr::DATA, 1, &3, &b"0.2".as_ptr(), 1),
            "fmi3SetFloat64" => fmi3SetFloat64(c, &vr::STEER_CMD, 1, &0.1, 1),
            "fmi3SetBoolean" => fmi3SetBoolean(c, &vr::ENABLED, 1, &1, 1),
            "fmi3SetInt32" => fmi3SetInt32(c, &vr::SUBSTEPS, 1, &3, 1),
            "fmi3SetInt64" => fmi3SetInt64(c, &vr::METHOD, 1, &2, 1),
            "fmi3SetString" => fmi3SetString(c, &vr::FILE, 1, &c"".as_ptr(), 1),
            "fmi3GetFMUState" => fmi3GetFMUState(c, &raw mut other),
            "fmi3SetFMUState" => fmi3SetFMUState(c, state),
            "fmi3FreeFMUState" => {
                other = state;
                fmi3FreeFMUState(c, &raw mut other)
            }
            "fmi3SerializedFMUStateSize" => fmi3SerializedFMUStateSize(c, state, &raw mut size),
            "fmi3SerializeFMUState" => {
                fmi3SerializeFMUState(c, state, bytes.as_mut_ptr().cast(), bytes.len())
            }
            "fmi3DeserializeFMUState" => {
                fmi3DeserializeFMUState(c, bytes.as_ptr().cast(), bytes.len(), &raw mut other)
            }
            "fmi3DoStep" => host.step(0.0, 0.1),
            _ => panic!("{function} is not called"),
        }
    }
}

#[test]
fn every_function_in_every_state() {
    let mut lines = TABLE.trim().lines();
    let states: Vec<&str> = lines.next().unwrap().split_whitespace().collect();
    let mut calls = 0;
    for line in lines {
        let (function, allowed) = line.trim().split_once(' ').unwrap();
        for (state, allowed) in states.iter().zip(allowed.split_whitespace()) {
            let host = instance_in(state);
            let before = host.serialize(host.store());
            host.take_messages();
            let status = call(&host, function);
            if allowed == "x" {
                assert_eq!(status, Status::Ok, "{function} in {state}: {}", host.last());
            } else {
                assert_eq!(status, Status::Error, "{function} in {state}");
                assert!(host.last().starts_with(function), "{}", host.last());
                assert!(!host.last().contains("fmi2") && !host.last().contains("FMI 2"), "{}", host.last());
                assert_eq!(host.serialize(host.store()), before, "{function} in {state} changed something");
            }
            calls += 1;
        }
    }
    assert_eq!(calls, 24 * 6);
}

/// What is declared as absent says so, in any state, and changes nothing.
#[test]
fn absent_functions_are_refused_with_the_reason() {
    let none: Unused = ptr::null();
    let (count, flag): (Count, Fmi3Boolean) = (0, 0);
    let (out, places): (*mut f64, *mut usize) = (ptr::null_mut(), ptr::null_mut());
    for state in ["I", "M", "C", "F", "T", "E"] {
        let host = instance_in(state);
        let c = host.instance;
        let before = host.serialize(host.store());
        // SAFETY: a live instance; these functions follow no pointer.
        let calls: Vec<(&str, Status)> = unsafe {
            vec![
                ("hasEventMode", fmi3EnterEventMode(c)),
                ("hasEventMode", fmi3EnterStepMode(c)),
                ("hasEventMode", fmi3EvaluateDiscreteStates(c)),
                ("hasEventMode", fmi3UpdateDiscreteStates(c, none, none, none, none, none, none)),
                ("this type", fmi3GetFloat32(c, &0, 1, none, 1)),
                ("this type", fmi3SetInt8(c, &0, 1, none, 1)),
                ("clocks", fmi3GetClock(c, &0, 1, none)),
                ("clocks", fmi3SetIntervalDecimal(c, &0, 1, none)),
                ("structural", fmi3EnterConfigurationMode(c)),
                ("providesPerElementDependencies", fmi3GetNumberOfVariableDependencies(c, 0, places)),
                (
                    "providesDirectionalDerivatives",
                    fmi3GetDirectionalDerivative(c, &0, 1, &0, 1, out, count, out, count),
                ),
                ("model exchange", fmi3SetTime(c, 0.0)),
                ("model exchange", fmi3GetNumberOfContinuousStates(c, places)),
                ("model exchange", fmi3CompletedIntegratorStep(c, flag, ptr::null_mut(), ptr::null_mut())),
                ("maxOutputDerivativeOrder", fmi3GetOutputDerivatives(c, &0, 1, &1, out, 1)),
                ("scheduled execution", fmi3ActivateModelPartition(c, 0, 0.0)),
            ]
        };
        let messages = host.take_messages();
        let told: Vec<_> = messages.iter().filter(|message| message.status == Status::Error).collect();
        for ((reason, status), message) in calls.iter().zip(&told[told.len() - calls.len()..]) {
            assert_eq!(*status, Status::Error);
            assert!(message.text.contains(reason), "{reason}: {}", message.text);
        }
        assert_eq!(host.serialize(host.store()), before);
    }
}

/// Instances of other kinds, and with what is not there.
#[test]
fn other_kinds_of_instances_are_refused() {
    let token = token();
    let (name, token, none) = (c"toy".as_ptr(), token.as_ptr(), ptr::null());
    let nowhere = ptr::null_mut();
    // SAFETY: C strings, no callbacks.
    unsafe {
        assert!(fmi3InstantiateModelExchange(name, token, none, 0, 1, nowhere, None).is_null());
        let scheduled = fmi3InstantiateScheduledExecution(
            name,
            token,
            none,
            0,
            1,
            nowhere,
            None,
            ptr::null(),
            ptr::null(),
            ptr::null(),
        );
        assert!(scheduled.is_null());
        for (event_mode, intermediate) in [(1, 0), (0, 1)] {
            let instance = fmi3InstantiateCoSimulation(
                name,
                token,
                none,
                0,
                1,
                event_mode,
                0,
                &0,
                intermediate,
                nowhere,
                None,
                ptr::null(),
            );
            assert!(instance.is_null());
        }
        fmi3FreeInstance(nowhere);
        assert_eq!(fmi3Reset(nowhere), Status::Error);
    }
}
