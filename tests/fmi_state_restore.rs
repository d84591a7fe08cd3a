//! FMU states really restore: the same bits come out after a restore, in the same and in another instance, now and
//! from bytes; bytes that are none are refused.

use crate::common::*;
use rfl_mpc::fmi::v2::Status;
use std::ptr;

/// Steps from step `from` to `to` with an input that varies.
fn drive(host: &Host, from: u32, to: u32) {
    for k in from..to {
        assert_eq!(host.set_real(vr::STEER_CMD, 0.4 * (0.37 * f64::from(k)).sin()), Status::Ok);
        assert_eq!(host.set_boolean(vr::ENABLED, i32::from(k % 7 != 0)), Status::Ok);
        assert_eq!(host.step(f64::from(k) * 0.01, 0.01), Status::Ok, "{}", host.last());
    }
}

fn with_parameters() -> Host {
    let host = Host::new();
    assert_eq!(host.set_real(vr::TAU, 0.07), Status::Ok);
    assert_eq!(host.set_integer(vr::SUBSTEPS, 3), Status::Ok);
    assert_eq!(host.set_integer(vr::METHOD, 2), Status::Ok);
    host
}

#[test]
fn a_run_goes_on_bit_by_bit() {
    let host = with_parameters();
    host.initialize();
    drive(&host, 0, 40);
    assert_eq!(host.set_real(vr::GAIN, 0.9), Status::Ok);
    let (state, at_state) = (host.store(), host.fingerprint());
    drive(&host, 40, 100);
    let end = host.fingerprint();
    assert_eq!(host.set_real(vr::GAIN, 0.1), Status::Ok);
    for _ in 0..3 {
        assert_eq!(host.restore(state), Status::Ok);
        assert_eq!(host.fingerprint(), at_state);
        drive(&host, 40, 100);
        assert_eq!(host.fingerprint(), end);
    }
    assert_eq!(host.free_state(state), Status::Ok);
    assert_eq!(host.restore(state), Status::Error);
}

/// Into instances that are not initialised, have other parameters, are further, have failed or ended.
#[test]
fn bytes_restore_into_any_instance() {
    let host = with_parameters();
    host.initialize();
    drive(&host, 0, 40);
    let (bytes, at_state) = (host.serialize(host.store()), host.fingerprint());
    drive(&host, 40, 100);
    let end = host.fingerprint();

    let fresh = Host::new();
    let other = Host::new();
    assert_eq!(other.set_real(vr::START, 0.5), Status::Ok);
    other.initialize();
    drive(&other, 0, 10);
    let failed = Host::new();
    assert_eq!(failed.set_real(vr::PANIC_AFTER, 0.0), Status::Ok);
    failed.initialize();
    assert_eq!(failed.step(0.0, 0.01), Status::Error);
    let ended = with_parameters();
    ended.initialize();
    assert_eq!(ended.terminate(), Status::Ok);
    let initializing = Host::new();
    assert_eq!(initializing.enter(), Status::Ok);

    for host in [fresh, other, failed, ended, initializing] {
        let (status, state) = host.deserialize(&bytes);
        assert_eq!(status, Status::Ok, "{}", host.last());
        assert_eq!(host.restore(state), Status::Ok, "{}", host.last());
        assert_eq!(host.fingerprint(), at_state);
        assert_eq!(host.serialize(host.store()), bytes);
        drive(&host, 40, 100);
        assert_eq!(host.fingerprint(), end);
    }
}

/// States from before the first step: the host may still set parameters, and they count.
#[test]
fn states_before_initialisation_restore() {
    let host = with_parameters();
    let instantiated = host.store();
    assert_eq!(host.enter(), Status::Ok);
    let initializing = host.store();
    assert_eq!(host.exit(), Status::Ok);
    drive(&host, 0, 20);
    let end = host.fingerprint();

    assert_eq!(host.restore(initializing), Status::Ok);
    assert_eq!(host.exit(), Status::Ok);
    drive(&host, 0, 20);
    assert_eq!(host.fingerprint(), end);

    assert_eq!(host.restore(instantiated), Status::Ok);
    assert_eq!(host.set_real(vr::TAU, 0.2), Status::Ok);
    host.initialize();
    assert_eq!(host.real(vr::TAU), 0.2);
    assert_eq!(host.integer(vr::SUBSTEPS), 3);
}

/// What the host has set itself is part of the state: a file's value does not win after a restore.
#[test]
fn what_the_host_set_is_restored() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tau.txt");
    std::fs::write(&file, "0.5").unwrap();
    let file = std::ffi::CString::new(file.to_str().unwrap()).unwrap();
    let host = Host::new();
    assert_eq!(host.set_string(vr::FILE, &file), Status::Ok);
    let unset = host.store();
    assert_eq!(host.set_real(vr::TAU, 0.3), Status::Ok);
    let set = host.store();
    for (state, tau) in [(unset, 0.5), (set, 0.3)] {
        assert_eq!(host.restore(state), Status::Ok);
        host.initialize();
        assert_eq!(host.real(vr::TAU), tau);
    }
}

#[test]
fn a_state_is_written_over() {
    let host = Host::ready();
    let mut state = host.store();
    let first = state;
    drive(&host, 0, 5);
    // SAFETY: a live component and a state of it.
    assert_eq!(unsafe { fmi2GetFMUstate(host.component, &raw mut state) }, Status::Ok);
    assert_eq!(state, first);
    let before = host.fingerprint();
    drive(&host, 5, 9);
    assert_eq!(host.restore(state), Status::Ok);
    assert_eq!(host.fingerprint(), before);
}

#[test]
fn states_of_others_are_refused() {
    let (host, other) = (Host::ready(), Host::ready());
    let foreign = other.store();
    let garbage = ptr::without_provenance_mut(0xdead_beef);
    for mut state in [foreign, garbage] {
        assert_eq!(host.restore(state), Status::Error);
        assert!(host.last().contains("not one of this instance"), "{}", host.last());
        assert_eq!(host.free_state(state), Status::Error);
        // SAFETY: a live component; a foreign handle is what is tested.
        assert_eq!(unsafe { fmi2GetFMUstate(host.component, &raw mut state) }, Status::Error);
    }
    assert_eq!(other.restore(foreign), Status::Ok);
}

#[test]
fn bytes_that_are_no_state_are_refused() {
    let host = Host::ready();
    drive(&host, 0, 5);
    let bytes = host.serialize(host.store());
    let before = host.fingerprint();
    let refused = |bytes: &[u8], word: &str| {
        let (status, state) = host.deserialize(bytes);
        assert_eq!((status, state), (Status::Error, ptr::null_mut()), "{word}");
        assert!(host.last().contains(word), "\"{word}\" is missing in: {}", host.last());
    };
    refused(b"", "no serialised FMU state");
    refused(b"something else entirely", "no serialised FMU state");
    for length in 8..bytes.len() {
        refused(&bytes[..length], "truncated");
    }
    // Every bit of every byte: either something is wrong with it, and said, or it is the same state.
    let mut damaged = bytes.clone();
    for i in 0..bytes.len() {
        for bit in 0..8 {
            damaged[i] ^= 1 << bit;
            assert_eq!(host.deserialize(&damaged).0, Status::Error, "byte {i}, bit {bit}");
            damaged[i] ^= 1 << bit;
        }
    }
    let mut other_version = bytes.clone();
    other_version[8] = 9;
    refused(&other_version, "version 9");
    let mut other_guid = bytes.clone();
    other_guid[17] ^= 1;
    refused(&other_guid, "GUID");
    let mut last = bytes.clone();
    *last.last_mut().unwrap() ^= 0x80;
    refused(&last, "damaged");
    assert_eq!(host.fingerprint(), before);

    let mut padded = bytes.clone();
    padded.resize(bytes.len() + 100, 0);
    let (status, state) = host.deserialize(&padded);
    assert_eq!((status, host.restore(state)), (Status::Ok, Status::Ok));
}

#[test]
fn a_buffer_that_is_too_small_is_refused() {
    let host = Host::ready();
    let state = host.store();
    let mut bytes = vec![0_u8; host.serialize(state).len()];
    let size = bytes.len() - 1;
    // SAFETY: a live component, a buffer larger than is said.
    let status = unsafe { fmi2SerializeFMUstate(host.component, state, bytes.as_mut_ptr().cast(), size) };
    assert_eq!(status, Status::Error);
    assert!(host.last().contains(&format!("{size} bytes")), "{}", host.last());
    assert!(bytes.iter().all(|byte| *byte == 0));
}

/// A state whose parameters no longer make a model (its file has gone): the instance is as it was.
#[test]
fn a_state_that_cannot_be_restored_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tau.txt");
    std::fs::write(&file, "0.5").unwrap();
    let host = Host::new();
    let name = std::ffi::CString::new(file.to_str().unwrap()).unwrap();
    assert_eq!(host.set_string(vr::FILE, &name), Status::Ok);
    host.initialize();
    let bytes = host.serialize(host.store());
    std::fs::remove_file(&file).unwrap();

    let other = Host::ready();
    drive(&other, 0, 5);
    let before = other.fingerprint();
    let (status, state) = other.deserialize(&bytes);
    assert_eq!(status, Status::Ok);
    assert_eq!(other.restore(state), Status::Error);
    assert!(other.last().contains("tau.txt"), "{}", other.last());
    assert_eq!(other.fingerprint(), before);
    drive(&other, 5, 9);
}
