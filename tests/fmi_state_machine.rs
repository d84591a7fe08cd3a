//! Every function in every state, against the table of FMI 2.0, section 4.2.4.

use crate::common::*;
use rfl_mpc::fmi::v2::Status;
use std::ffi::c_void;
use std::ptr;

/// The standard's table: in which states a call is allowed. Columns: Instantiated, initialization Mode, step
/// Complete, step Failed, Terminated, Error.
const TABLE: &str = "
                              I M C F T E
    fmi2SetDebugLogging       x x x x x x
    fmi2SetupExperiment       x . . . . .
    fmi2EnterInitializationMode x . . . . .
    fmi2ExitInitializationMode . x . . . .
    fmi2Terminate             . . x x . .
    fmi2Reset                 x x x x x x
    fmi2GetReal               . x x x x x
    fmi2GetInteger            . x x x x x
    fmi2GetBoolean            . x x x x x
    fmi2GetString             . x x x x x
    fmi2SetReal               x x x . . .
    fmi2SetBoolean            x x x . . .
    fmi2SetInteger            x x . . . .
    fmi2SetString             x x . . . .
    fmi2GetFMUstate           x x x x x x
    fmi2SetFMUstate           x x x x x x
    fmi2FreeFMUstate          x x x x x x
    fmi2SerializedFMUstateSize x x x x x x
    fmi2SerializeFMUstate     x x x x x x
    fmi2DeSerializeFMUstate   x x x x x x
    fmi2DoStep                . . x . . .
    fmi2CancelStep            . . . . . .
    fmi2GetStatus             . . x x x .
    fmi2GetRealStatus         . . x x x .
    fmi2GetIntegerStatus      . . x x x .
    fmi2GetBooleanStatus      . . x x x .
    fmi2GetStringStatus       . . x x x .
    fmi2GetDirectionalDerivative . . . . . .
    fmi2SetRealInputDerivatives . . . . . .
    fmi2GetRealOutputDerivatives . . . . . .
    fmi2EnterEventMode        . . . . . .
    fmi2NewDiscreteStates     . . . . . .
    fmi2EnterContinuousTimeMode . . . . . .
    fmi2CompletedIntegratorStep . . . . . .
    fmi2SetTime               . . . . . .
    fmi2SetContinuousStates   . . . . . .
    fmi2GetDerivatives        . . . . . .
    fmi2GetEventIndicators    . . . . . .
    fmi2GetContinuousStates   . . . . . .
    fmi2GetNominalsOfContinuousStates . . . . . .
";

/// An instance in the state of a column.
fn instance_in(state: &str) -> Host {
    let host = Host::new();
    assert_eq!(host.set_real(vr::MAX_STEP, 0.5), Status::Ok);
    assert_eq!(host.set_real(vr::FAIL_AFTER, 1.0), Status::Ok);
    if state == "I" {
        return host;
    }
    if state == "M" {
        assert_eq!(host.enter(), Status::Ok);
        return host;
    }
    assert_eq!(host.setup(if state == "E" { 1.0 } else { 0.0 }, None), Status::Ok);
    assert_eq!((host.enter(), host.exit()), (Status::Ok, Status::Ok));
    match state {
        "F" => assert_eq!(host.step(0.0, 0.6), Status::Discard),
        "T" => assert_eq!(host.terminate(), Status::Ok),
        "E" => assert_eq!(host.step(1.0, 0.1), Status::Error),
        _ => {}
    }
    host
}

/// Calls a function with arguments that are right in themselves.
fn call(host: &Host, function: &str) -> Status {
    let c = host.component;
    let state = host.store();
    let mut bytes = host.serialize(state);
    let mut other: *mut c_void = ptr::null_mut();
    let (mut real, mut integer, mut size, mut status) = ([0.0_f64; 4], [0_i32; 4], 0_usize, Status::Ok);
    let mut text = ptr::null();
    let (r, i, b, s) = (vr::STEER, vr::STEPS, vr::MOVING, vr::SOURCE);
    let (reals, integers) = (real.as_mut_ptr(), integer.as_mut_ptr());
    // SAFETY: a live component, arrays at least as long as their counts.
    unsafe {
        match function {
            "fmi2SetDebugLogging" => fmi2SetDebugLogging(c, 1, 0, ptr::null()),
            "fmi2SetupExperiment" => fmi2SetupExperiment(c, 1, 1e-6, 0.0, 1, 10.0),
            "fmi2EnterInitializationMode" => fmi2EnterInitializationMode(c),
            "fmi2ExitInitializationMode" => fmi2ExitInitializationMode(c),
            "fmi2Terminate" => fmi2Terminate(c),
            "fmi2Reset" => fmi2Reset(c),
            "fmi2GetReal" => fmi2GetReal(c, &raw const r, 1, reals),
            "fmi2GetInteger" => fmi2GetInteger(c, &raw const i, 1, integers),
            "fmi2GetBoolean" => fmi2GetBoolean(c, &raw const b, 1, integers),
            "fmi2GetString" => fmi2GetString(c, &raw const s, 1, &raw mut text),
            "fmi2SetReal" => fmi2SetReal(c, &vr::STEER_CMD, 1, reals),
            "fmi2SetBoolean" => fmi2SetBoolean(c, &vr::ENABLED, 1, integers),
            "fmi2SetInteger" => fmi2SetInteger(c, &vr::SUBSTEPS, 1, &3),
            "fmi2SetString" => fmi2SetString(c, &vr::FILE, 1, &c"".as_ptr()),
            "fmi2GetFMUstate" => fmi2GetFMUstate(c, &raw mut other),
            "fmi2SetFMUstate" => fmi2SetFMUstate(c, state),
            "fmi2FreeFMUstate" => {
                other = state;
                fmi2FreeFMUstate(c, &raw mut other)
            }
            "fmi2SerializedFMUstateSize" => fmi2SerializedFMUstateSize(c, state, &raw mut size),
            "fmi2SerializeFMUstate" => {
                fmi2SerializeFMUstate(c, state, bytes.as_mut_ptr().cast(), bytes.len())
            }
            "fmi2DeSerializeFMUstate" => {
                fmi2DeSerializeFMUstate(c, bytes.as_ptr().cast(), bytes.len(), &raw mut other)
            }
            "fmi2DoStep" => fmi2DoStep(c, 0.0, 0.1, 1),
            "fmi2CancelStep" => fmi2CancelStep(c),
            "fmi2GetStatus" => fmi2GetStatus(c, 0, &raw mut status),
            "fmi2GetRealStatus" => fmi2GetRealStatus(c, 2, reals),
            "fmi2GetIntegerStatus" => fmi2GetIntegerStatus(c, 0, integers),
            "fmi2GetBooleanStatus" => fmi2GetBooleanStatus(c, 3, integers),
            "fmi2GetStringStatus" => fmi2GetStringStatus(c, 1, &raw mut text),
            "fmi2GetDirectionalDerivative" => {
                fmi2GetDirectionalDerivative(c, &raw const r, 1, &vr::STEER_CMD, 1, reals, reals)
            }
            "fmi2SetRealInputDerivatives" => fmi2SetRealInputDerivatives(c, &vr::STEER_CMD, 1, &1, reals),
            "fmi2GetRealOutputDerivatives" => fmi2GetRealOutputDerivatives(c, &raw const r, 1, &1, reals),
            "fmi2EnterEventMode" => fmi2EnterEventMode(c),
            "fmi2NewDiscreteStates" => fmi2NewDiscreteStates(c, reals.cast()),
            "fmi2EnterContinuousTimeMode" => fmi2EnterContinuousTimeMode(c),
            "fmi2CompletedIntegratorStep" => fmi2CompletedIntegratorStep(c, 1, integers, integers),
            "fmi2SetTime" => fmi2SetTime(c, 0.0),
            "fmi2SetContinuousStates" => fmi2SetContinuousStates(c, reals, 1),
            "fmi2GetDerivatives" => fmi2GetDerivatives(c, reals, 1),
            "fmi2GetEventIndicators" => fmi2GetEventIndicators(c, reals, 1),
            "fmi2GetContinuousStates" => fmi2GetContinuousStates(c, reals, 1),
            "fmi2GetNominalsOfContinuousStates" => fmi2GetNominalsOfContinuousStates(c, reals, 1),
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
            host.take_messages();
            let status = call(&host, function);
            let message = host.last();
            if allowed == "x" {
                assert!(status < Status::Error, "{function} in {state}: {status:?}, {message}");
            } else {
                assert_eq!(status, Status::Error, "{function} in {state}");
                assert!(
                    message.contains(function) || message.contains("fixed"),
                    "{function} in {state}: {message}"
                );
            }
            calls += 1;
        }
    }
    assert_eq!(calls, 40 * 6);
}

/// A refused call changes nothing: the simulation goes on.
#[test]
fn a_call_out_of_order_changes_nothing() {
    let host = Host::ready();
    assert_eq!(host.set_real(vr::STEER_CMD, 0.3), Status::Ok);
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
    let before = host.fingerprint();
    assert_eq!(host.enter(), Status::Error);
    assert_eq!(host.exit(), Status::Error);
    assert_eq!(host.setup(5.0, None), Status::Error);
    assert_eq!(host.fingerprint(), before);
    assert_eq!(host.step(0.1, 0.1), Status::Ok);
}

/// What the host reads in initialisation mode is calculated from what it has set, as often as it asks.
#[test]
fn outputs_in_initialization_mode_follow_parameters() {
    let host = Host::new();
    assert_eq!(host.enter(), Status::Ok);
    assert_eq!(host.real(vr::STEER), 0.0);
    assert_eq!(host.set_real(vr::START, 0.25), Status::Ok);
    assert_eq!(host.real(vr::STEER), 0.25);
    assert_eq!(host.exit(), Status::Ok);
    assert_eq!(host.real(vr::STEER), 0.25);
}

/// Reset gives back the start values, and the second run is the first, bit by bit.
#[test]
fn reset_starts_afresh() {
    let host = Host::new();
    let run = || {
        assert_eq!(host.set_real(vr::TAU, 0.2), Status::Ok);
        host.initialize();
        for k in 0..50 {
            assert_eq!(host.set_real(vr::STEER_CMD, 0.01 * f64::from(k)), Status::Ok);
            assert_eq!(host.step(f64::from(k) * 0.01, 0.01), Status::Ok);
        }
        host.fingerprint()
    };
    let first = run();
    assert_eq!(host.reset(), Status::Ok);
    assert_eq!(host.enter(), Status::Ok);
    assert_eq!((host.real(vr::TAU), host.real(vr::STEER_CMD)), (0.1, 0.0));
    assert_eq!(host.reset(), Status::Ok);
    assert_eq!(run(), first);
}

/// After a model's failure, a reset or a stored state leads on; nothing else does.
#[test]
fn out_of_the_error_state() {
    let host = Host::new();
    assert_eq!(host.set_real(vr::FAIL_AFTER, 0.1), Status::Ok);
    host.initialize();
    assert_eq!(host.set_real(vr::STEER_CMD, 0.3), Status::Ok);
    assert_eq!(host.step(0.0, 0.05), Status::Ok);
    let (state, before) = (host.store(), host.fingerprint());
    assert_eq!(host.step(0.05, 0.05), Status::Ok);
    assert_eq!(host.step(0.1, 0.05), Status::Error);
    assert!(host.last().contains("told to fail"), "{}", host.last());
    assert_eq!(host.step(0.1, 0.05), Status::Error);
    assert!(host.last().contains("fmi2Reset"), "{}", host.last());
    assert_eq!(host.restore(state), Status::Ok);
    assert_eq!(host.fingerprint(), before);
    assert_eq!(host.step(0.05, 0.05), Status::Ok);
    assert_eq!(host.step(0.1, 0.05), Status::Error);
    assert_eq!(host.reset(), Status::Ok);
    host.initialize();
}

/// A panic of the model stays inside, and the instance is as good as new after a reset.
#[test]
fn a_panic_becomes_an_error() {
    let host = Host::new();
    assert_eq!(host.set_real(vr::PANIC_AFTER, 0.0), Status::Ok);
    host.initialize();
    assert_eq!(host.step(0.0, 0.1), Status::Error);
    assert!(host.last().contains("told to panic"), "{}", host.last());
    assert_eq!(host.step(0.0, 0.1), Status::Error);
    assert_eq!(host.reset(), Status::Ok);
    host.initialize();
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
}

/// After a discarded step the standard wants a stored state; then another step may do.
#[test]
fn a_discarded_step_is_made_again() {
    let host = Host::new();
    assert_eq!(host.set_real(vr::MAX_STEP, 0.1), Status::Ok);
    host.initialize();
    assert_eq!(host.set_real(vr::STEER_CMD, 0.3), Status::Ok);
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
    let (state, before) = (host.store(), host.fingerprint());
    assert_eq!(host.step(0.1, 0.2), Status::Discard);
    let (mut time, mut status) = (f64::NAN, Status::Ok);
    // SAFETY: a live component.
    unsafe {
        assert_eq!(fmi2GetRealStatus(host.component, 2, &raw mut time), Status::Ok);
        assert_eq!(fmi2GetStatus(host.component, 0, &raw mut status), Status::Ok);
    }
    assert_eq!((time, status), (0.1, Status::Discard));
    assert_eq!(host.fingerprint(), before);
    assert_eq!(host.restore(state), Status::Ok);
    assert_eq!(host.step(0.1, 0.05), Status::Ok);
}
