//! FMI 3.0 over the same instance as 2.0: the same bits, states that restore, threads, memory; and what is otherwise in 3.0.

use crate::common::host3::*;
use crate::common::*;
use crate::counting::allocated;
use rfl_mpc::fmi::Status;
use std::ptr;

const OK: (Status, Status) = (Status::Ok, Status::Ok);

fn input(who: u32, k: u32) -> f64 {
    0.4 * (0.37 * f64::from(k) + f64::from(who)).sin()
}

/// Steps from step `from` to `to` with an input that varies.
fn drive(host: &Host3, who: u32, from: u32, to: u32) {
    for k in from..to {
        assert_eq!(host.set_real(vr::STEER_CMD, input(who, k)), Status::Ok);
        assert_eq!(host.set_boolean(vr::ENABLED, u8::from(k % 7 != 0)), Status::Ok);
        assert_eq!(host.step(f64::from(k) * 0.01, 0.01), Status::Ok, "{}", host.last());
    }
}

fn tau(who: u32) -> f64 {
    0.05 + 0.01 * f64::from(who)
}

fn made(who: u32) -> Host3 {
    let host = Host3::new();
    assert_eq!(host.set_real(vr::TAU, tau(who)), Status::Ok);
    assert_eq!(host.set_integer(vr::SUBSTEPS, 3), Status::Ok);
    assert_eq!(host.set_enumeration(vr::METHOD, 2), Status::Ok);
    host.initialize();
    host
}

#[test]
fn the_bits_are_those_of_2_0() {
    let old = Host::new();
    assert_eq!(old.set_real(vr::TAU, tau(1)), Status::Ok);
    assert_eq!(old.set_integer(vr::SUBSTEPS, 3), Status::Ok);
    assert_eq!(old.set_integer(vr::METHOD, 2), Status::Ok);
    old.initialize();
    let new = made(1);
    for k in 0..200 {
        assert_eq!(old.set_real(vr::STEER_CMD, input(1, k)), Status::Ok);
        assert_eq!(old.set_boolean(vr::ENABLED, i32::from(k % 7 != 0)), Status::Ok);
        assert_eq!(old.step(f64::from(k) * 0.01, 0.01), Status::Ok);
        drive(&new, 1, k, k + 1);
        assert_eq!(old.fingerprint(), new.fingerprint());
    }
}

#[test]
fn states_restore_and_cross_instances() {
    let host = made(1);
    drive(&host, 1, 0, 40);
    let (state, at_state, time) = (host.store(), host.fingerprint(), host.real(TIME));
    let bytes = host.serialize(state);
    drive(&host, 1, 40, 100);
    let end = host.fingerprint();
    assert_eq!(host.restore(state), Status::Ok);
    assert_eq!((host.fingerprint(), host.real(TIME)), (at_state.clone(), time));
    drive(&host, 1, 40, 100);
    assert_eq!(host.fingerprint(), end);

    let other = Host3::new();
    let (status, state) = other.deserialize(&bytes);
    assert_eq!((status, other.restore(state)), (Status::Ok, Status::Ok), "{}", other.last());
    assert_eq!((other.fingerprint(), other.real(TIME)), (at_state, time));
    drive(&other, 1, 40, 100);
    assert_eq!(other.fingerprint(), end);
    assert_eq!(other.free_state(state), Status::Ok);
    assert_eq!(other.restore(state), Status::Error);

    // A state of 2.0 is of another FMU.
    let old = Host::ready();
    let (status, _) = other.deserialize(&old.serialize(old.store()));
    assert_eq!(status, Status::Error);
    assert!(other.last().contains("instantiation token"), "{}", other.last());
}

/// 16 instances on 8 threads give the bits of lone ones.
#[test]
fn sixteen_instances_on_eight_threads() {
    let hosts: Vec<Host3> = std::thread::scope(|scope| {
        let pair = |first: u32| {
            let hosts = [made(first), made(first + 1)];
            for k in 0..300 {
                for (i, host) in hosts.iter().enumerate() {
                    drive(host, first + i as u32, k, k + 1);
                }
            }
            hosts
        };
        let threads: Vec<_> = (0..8).map(|thread| scope.spawn(move || pair(2 * thread))).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    for (who, host) in hosts.iter().enumerate() {
        let alone = made(who as u32);
        drive(&alone, who as u32, 0, 300);
        assert_eq!(host.fingerprint(), alone.fingerprint(), "instance {who}");
    }
}

#[test]
fn instances_leave_nothing_behind_and_steps_allocate_nothing() {
    let live = || {
        let host = made(1);
        drive(&host, 1, 0, 1);
        let (status, state) = host.deserialize(&host.serialize(host.store()));
        assert_eq!((status, host.restore(state)), (Status::Ok, Status::Ok));
        assert_eq!(host.set_real(TIME + 1, 0.0), Status::Error);
    };
    live();
    assert_eq!(allocated(|| (0..500).for_each(|_| live())).1, 0);

    let host = made(1);
    drive(&host, 1, 0, 1);
    let (count, _) = allocated(|| {
        drive(&host, 1, 1, 1000);
        assert!(host.real(vr::STEER).is_finite() && host.integer(vr::STEPS) > 0 && host.real(TIME) > 1.0);
    });
    assert_eq!(count, 0);
}

/// A discarded step leaves the instance as it was: a shorter one may follow at once.
#[test]
fn a_shorter_step_may_follow_a_discarded_one() {
    let (host, other) = (Host3::ready(), Host3::ready());
    for host in [&host, &other] {
        assert_eq!(host.set_real(vr::STEER_CMD, 0.3), Status::Ok);
    }
    assert_eq!(host.step_telling(0.0, 1.5), (Status::Discard, 0.0));
    assert!(host.last().starts_with("fmi3DoStep: the step from 0 s was discarded"), "{}", host.last());
    for host in [&host, &other] {
        assert_eq!(host.step_telling(0.0, 0.5), (Status::Ok, 0.5));
    }
    assert_eq!(host.fingerprint(), other.fingerprint());
}

/// An actuator that comes to its limit in the middle of a long step.
fn to_its_limit(host: &Host3) -> (Status, f64, bool) {
    assert_eq!(host.set_integer(vr::SUBSTEPS, 100), Status::Ok);
    assert_eq!(host.set_boolean(vr::LIMITED, 1), Status::Ok);
    host.initialize();
    assert_eq!(host.set_real(vr::STEER_CMD, 1.0), Status::Ok);
    host.step_that_may_end(0.0, 0.5)
}

/// A host that allows it is told where the step ended, and goes on from there; time is a variable, too.
#[test]
fn a_step_ends_early_where_the_host_allows_it() {
    let host = Host3::ending_early();
    let (status, time, early) = to_its_limit(&host);
    assert_eq!((status, early), (Status::Ok, true));
    // 1 - exp(-t / 0.1 s) comes to .5 after 69.3 ms; integration steps are of 5 ms.
    assert!((time - 0.07).abs() < 1e-12, "{time}");
    assert_eq!((host.real(TIME), host.real(vr::STEER)), (time, 0.5));
    assert_eq!(host.step(0.5, 0.1), Status::Error);
    assert!(host.last().contains("still at 0.07 s"), "{}", host.last());
    assert_eq!(host.set_real(vr::STEER_CMD, 0.1), Status::Ok);
    assert_eq!(host.step_that_may_end(time, 0.1), (Status::Ok, time + 0.1, false));
}

#[test]
fn a_step_goes_to_its_end_where_the_host_does_not_allow_less() {
    let host = Host3::new();
    assert_eq!(to_its_limit(&host), (Status::Ok, 0.5, false));
}

#[test]
fn a_reset_instance_may_still_end_early() {
    let host = Host3::ending_early();
    let first = to_its_limit(&host);
    assert_eq!(host.reset(), Status::Ok);
    assert_eq!(to_its_limit(&host), first);
}

#[test]
fn time_is_a_variable_that_nobody_sets() {
    let host = Host3::new();
    host.setup(2.0, Some(3.0));
    assert_eq!((host.enter(), host.real(TIME)), (Status::Ok, 2.0));
    // Asked in initialisation mode, an output is calculated; time stays what it is.
    assert_eq!((host.real(vr::STEER), host.real(TIME)), (0.0, 2.0));
    assert_eq!((host.exit(), host.step(2.0, 0.25), host.real(TIME)), (Status::Ok, Status::Ok, 2.25));
    assert_eq!(host.set_real(TIME, 0.0), Status::Error);
    assert_eq!(host.step(2.25, 1.0), Status::Error);
    assert!(host.last().contains("that fmi3EnterInitializationMode gave"), "{}", host.last());
    assert_eq!((host.reset(), host.real(TIME)), (Status::Ok, 0.0));
}

/// In 3.0 a host that has not asked hears nothing, and hears what it has asked for.
#[test]
fn a_host_hears_what_it_asked_for() {
    let quiet = Host3::with(c"toy", None, false);
    assert_eq!(quiet.set_real(TIME + 1, 0.0), Status::Error);
    assert_eq!(quiet.take_messages(), []);
    let category = c"logStatusError".as_ptr();
    // SAFETY: a live instance, an array of one.
    unsafe { assert_eq!(fmi3SetDebugLogging(quiet.instance, 1, 1, &raw const category), Status::Ok) };
    assert_eq!(quiet.set_real(vr::STEER_CMD, f64::NAN), Status::Discard);
    assert_eq!(quiet.take_messages(), [], "a category that was not asked for");
    assert_eq!(quiet.set_real(TIME + 1, 0.0), Status::Error);
    assert!(quiet.last().contains("the references 0 to 21"), "{}", quiet.last());
    // Why there is no instance is always told.
    let none = Host3::with(c"", None, false);
    assert!(none.instance.is_null() && none.last().contains("has no name"), "{}", none.last());
}

/// Outputs that 2.0 has as scalars are one variable here, among others in a call.
#[test]
fn an_array_is_got_as_a_whole() {
    let (old, new) = (Host::ready(), Host3::ready());
    for k in 0..3 {
        assert_eq!((old.set_real(vr::STEER_CMD, input(1, k)), new.set_real(vr::STEER_CMD, input(1, k))), OK);
        assert_eq!((old.step(f64::from(k) * 0.01, 0.01), new.step(f64::from(k) * 0.01, 0.01)), OK);
    }
    let (references, mut values) = ([vr::STEER, vr::HISTORY, TIME], [f64::NAN; 4]);
    // SAFETY: a live instance, arrays as long as their counts.
    let status =
        unsafe { fmi3GetFloat64(new.instance, references.as_ptr(), 3, values.as_mut_ptr(), values.len()) };
    assert_eq!(status, Status::Ok, "{}", new.last());
    assert_eq!(values, [old.real(vr::STEER), old.real(vr::HISTORY), old.real(vr::HISTORY + 1), 0.03]);
    assert_ne!(values[1], values[2]);
}

/// A wrong size, an element alone, and an array that is set: refused in words that lead on; nothing is written.
#[test]
fn an_array_is_got_only_as_a_whole() {
    let host = Host3::ready();
    let mut values = [7.0; 3];
    // SAFETY: a live instance, arrays at least as long as their counts.
    unsafe {
        for given in [0, 1, 3] {
            let status = fmi3GetFloat64(host.instance, &vr::HISTORY, 1, values.as_mut_ptr(), given);
            assert_eq!(status, Status::Error);
            assert!(
                host.last().contains("which have 2") && host.last().contains("Dimension"),
                "{}",
                host.last()
            );
        }
        let element = vr::HISTORY + 1;
        assert_eq!(fmi3GetFloat64(host.instance, &element, 1, values.as_mut_ptr(), 1), Status::Error);
        assert!(host.last().contains("`history[2]` is an element of the array `history`"), "{}", host.last());
        assert!(host.last().contains(&format!("reference {}", vr::HISTORY)), "{}", host.last());
        assert_eq!(fmi3SetFloat64(host.instance, &vr::HISTORY, 1, values.as_ptr(), 2), Status::Error);
        assert!(host.last().contains("cannot be set"), "{}", host.last());
    }
    assert_eq!((values, host.reals(vr::HISTORY)), ([7.0; 3], [0.0; 2]));
}

/// A parameter file handed over as bytes: it counts, is kept over a state in another instance, and a reset forgets it.
#[test]
fn bytes_are_a_parameter() {
    let host = Host3::new();
    assert_eq!(host.binary(vr::DATA), b"");
    assert_eq!(host.set_binary(vr::DATA, b"0.25"), Status::Ok);
    host.initialize();
    assert_eq!((host.binary(vr::DATA), host.real(vr::TAU)), (b"0.25".to_vec(), 0.25));
    let bytes = host.serialize(host.store());
    let other = Host3::new();
    let (status, state) = other.deserialize(&bytes);
    assert_eq!((status, other.restore(state)), OK, "{}", other.last());
    assert_eq!((other.binary(vr::DATA), other.real(vr::TAU)), (b"0.25".to_vec(), 0.25));
    assert_eq!((host.reset(), host.binary(vr::DATA)), (Status::Ok, Vec::new()));
}

#[test]
fn bytes_that_cannot_be_are_refused() {
    let host = Host3::new();
    assert_eq!(host.set_binary(vr::DATA, b"0.5"), Status::Ok);
    assert_eq!(host.set_binary(vr::DATA, &[b'1'; 65]), Status::Discard);
    assert!(host.last().contains("has 65 bytes, and takes 64 at most"), "{}", host.last());
    assert_eq!(host.set_binary(vr::FILE, b"0.5"), Status::Error);
    assert!(host.last().contains("is of type String"), "{}", host.last());
    assert_eq!(host.set_string(vr::DATA, c"0.5"), Status::Error);
    let (size, nowhere, no_size) = (4, ptr::null(), ptr::null());
    // SAFETY: a live instance, arrays of one; NULL is what is tested.
    unsafe {
        assert_eq!(fmi3SetBinary(host.instance, &vr::DATA, 1, &size, &nowhere, 1), Status::Error);
        assert_eq!(fmi3SetBinary(host.instance, &vr::DATA, 1, no_size, &nowhere, 1), Status::Error);
        assert_eq!(fmi3SetBinary(host.instance, &vr::DATA, 1, &usize::MAX, &b"".as_ptr(), 1), Status::Error);
    }
    assert!(host.last().contains("more than memory can hold"), "{}", host.last());
    assert_eq!(host.binary(vr::DATA), b"0.5");
    assert_eq!(host.set_binary(vr::DATA, b"half"), Status::Ok);
    host.setup(0.0, None);
    assert_eq!((host.enter(), host.exit()), (Status::Ok, Status::Error));
    assert!(host.last().contains("actuator_data"), "{}", host.last());
}

#[test]
fn wrong_arguments_are_refused() {
    let host = Host3::ready();
    let (references, mut values) = ([vr::STEER, vr::TAU], [7.0; 3]);
    // SAFETY: a live instance, arrays as long as their counts; NULL is what is tested.
    unsafe {
        let c = host.instance;
        for (count, given) in [(2, 3), (2, 1), (0, 1)] {
            let status = fmi3GetFloat64(c, references.as_ptr(), count, values.as_mut_ptr(), given);
            assert_eq!(status, Status::Error);
            assert!(host.last().contains("one value for each reference"), "{}", host.last());
        }
        assert_eq!(values, [7.0; 3]);
        assert_eq!(fmi3GetFloat64(c, ptr::null(), 1, values.as_mut_ptr(), 1), Status::Error);
        assert_eq!(fmi3SetFloat64(c, references.as_ptr(), 2, ptr::null(), 2), Status::Error);
        assert_eq!(fmi3GetFloat64(c, ptr::null(), 0, ptr::null_mut(), 0), Status::Ok);
        assert_eq!(
            fmi3DoStep(c, 0.0, 0.1, 1, ptr::null_mut(), ptr::null_mut(), ptr::null_mut(), ptr::null_mut()),
            Status::Ok
        );
    }
    let (mut whole, mut long) = (0, 0);
    // SAFETY: as above. An enumeration is no Int32, an integer no Int64.
    unsafe {
        assert_eq!(fmi3GetInt32(host.instance, &vr::METHOD, 1, &raw mut whole, 1), Status::Error);
        assert!(host.last().contains("is of type Int64: use fmi3GetInt64"), "{}", host.last());
        assert_eq!(fmi3GetInt64(host.instance, &vr::STEPS, 1, &raw mut long, 1), Status::Error);
    }
    let host = Host3::new();
    for value in [0, 3, i64::MAX, i64::from(i32::MAX) + 2] {
        assert_eq!(host.set_enumeration(vr::METHOD, value), Status::Discard, "{value}");
    }
    assert_eq!(host.enumeration(vr::METHOD), 1);
    assert_eq!(host.set_boolean(vr::ENABLED, 255), Status::Ok);
    assert_eq!(host.boolean(vr::ENABLED), 1);
}
