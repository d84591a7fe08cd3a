//! Bad input through the C interface: each cause has its status and a message that names variable, value and
//! remedy; nothing else changes.

use crate::common::*;
use rfl_mpc::fmi::v2::{CallbackFunctions, Status};
use std::ffi::{CStr, CString, c_char};
use std::ptr;

/// Asserts that the last message has all these words.
#[track_caller]
fn says(host: &Host, words: &[&str]) {
    let message = host.last();
    for word in words {
        assert!(message.contains(word), "\"{word}\" is missing in: {message}");
    }
}

#[test]
fn values_that_are_not_finite_are_discarded() {
    let host = Host::ready();
    assert_eq!(host.set_real(vr::STEER_CMD, 0.2), Status::Ok);
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(host.set_real(vr::STEER_CMD, value), Status::Discard);
        says(&host, &["fmi2SetReal", "`steer_cmd`", "finite", "0.2", "stands"]);
        assert_eq!(host.real(vr::STEER_CMD), 0.2);
    }
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
    assert!(host.real(vr::STEER).is_finite());
}

#[test]
fn a_parameter_outside_its_range_is_discarded() {
    let host = Host::new();
    assert_eq!(host.set_real(vr::TAU, -0.5), Status::Discard);
    says(&host, &["`actuator.tau`", "-0.5", "[0.001, 10]", "0.1"]);
    assert_eq!(host.set_integer(vr::SUBSTEPS, 0), Status::Discard);
    says(&host, &["`solver.substeps`", "= 0", "[1, 100]"]);
    assert_eq!(host.set_integer(vr::METHOD, 7), Status::Discard);
    says(&host, &["`solver.method`", "7", "1 (exact), 2 (euler)"]);
    assert_eq!(host.enter(), Status::Ok);
    assert_eq!((host.real(vr::TAU), host.integer(vr::SUBSTEPS), host.integer(vr::METHOD)), (0.1, 1, 1));
}

/// A range of an input says what is certainly wrong; the value is used, and the user told once.
#[test]
fn an_input_outside_its_range_is_told_once() {
    for (asked, status) in [(0, Status::Ok), (1, Status::Warning)] {
        let host = Host::new();
        assert_eq!(host.set_boolean(vr::REPORT_WARNINGS, asked), Status::Ok);
        host.initialize();
        assert_eq!(host.set_real(vr::STEER_CMD, 30.0), status);
        says(&host, &["`steer_cmd`", "30", "[-1.2, 1.2]", "radians"]);
        assert_eq!(host.real(vr::STEER_CMD), 30.0);
        host.take_messages();
        assert_eq!(host.set_real(vr::STEER_CMD, 31.0), status);
        assert_eq!(host.take_messages(), []);
        assert_eq!(host.set_real(vr::STEER_CMD, 0.0), Status::Ok);
        assert_eq!(host.set_real(vr::STEER_CMD, 30.0), status);
        assert_eq!(host.take_messages().len(), 1);
    }
}

#[test]
fn a_fixed_parameter_cannot_be_set_after_initialisation() {
    let host = Host::ready();
    assert_eq!(host.set_real(vr::TAU, 0.2), Status::Error);
    says(&host, &["`actuator.tau`", "fixed", "step complete", "fmi2Reset"]);
    assert_eq!(host.set_integer(vr::SUBSTEPS, 2), Status::Error);
    assert_eq!(host.set_boolean(vr::LIMITED, 1), Status::Error);
    assert_eq!(host.set_string(vr::FILE, c"tau.txt"), Status::Error);
    assert_eq!(host.set_real(vr::GAIN, 0.5), Status::Ok, "a tunable one can");
    assert_eq!(host.real(vr::TAU), 0.1);
}

#[test]
fn outputs_cannot_be_set() {
    for host in [Host::new(), Host::ready()] {
        assert_eq!(host.set_real(vr::STEER, 0.2), Status::Error);
        says(&host, &["`steer`", "output"]);
        assert_eq!(host.set_integer(vr::STEPS, 2), Status::Error);
        assert_eq!(host.set_boolean(vr::MOVING, 1), Status::Error);
        assert_eq!(host.set_string(vr::SOURCE, c"x"), Status::Error);
    }
}

#[test]
fn unknown_references_and_wrong_types_are_errors() {
    let host = Host::ready();
    for reference in [vr::COUNT, 1 << 20, u32::MAX] {
        assert_eq!(host.set_real(reference, 0.0), Status::Error);
        says(&host, &[&reference.to_string(), "0 to 19", "modelDescription.xml"]);
    }
    assert_eq!(host.set_real(vr::STEPS, 0.0), Status::Error);
    says(&host, &["`steps`", "Integer", "fmi2GetInteger"]);
    assert_eq!(host.set_integer(vr::ENABLED, 0), Status::Error);
    says(&host, &["`enabled`", "Boolean"]);
    assert_eq!(host.set_boolean(vr::FILE, 0), Status::Error);
    assert_eq!(host.set_string(vr::STEER_CMD, c""), Status::Error);
}

/// One bad element, and none is set.
#[test]
fn a_call_of_many_sets_all_or_nothing() {
    let host = Host::ready();
    let references = [vr::STEER_CMD, vr::GAIN, vr::GAIN];
    let values = [0.3, 0.5, f64::NAN];
    // SAFETY: a live component, arrays of three.
    let status = unsafe { fmi2SetReal(host.component, references.as_ptr(), 3, values.as_ptr()) };
    assert_eq!(status, Status::Discard);
    assert_eq!((host.real(vr::STEER_CMD), host.real(vr::GAIN)), (0.0, 1.0));
}

#[test]
fn null_pointers_are_errors_and_empty_arrays_are_not() {
    let host = Host::ready();
    let (c, one) = (host.component, 1);
    let mut real = 0.0;
    // SAFETY: a live component; NULL is what is tested.
    unsafe {
        assert_eq!(fmi2GetReal(c, ptr::null(), 1, &raw mut real), Status::Error);
        says(&host, &["`vr`", "null"]);
        assert_eq!(fmi2GetReal(c, &vr::STEER, 1, ptr::null_mut()), Status::Error);
        assert_eq!(fmi2SetReal(c, &vr::STEER_CMD, 1, ptr::null()), Status::Error);
        assert_eq!(fmi2SetString(c, &vr::FILE, 1, &ptr::null()), Status::Error);
        assert_eq!(fmi2GetReal(c, &vr::STEER, usize::MAX, &raw mut real), Status::Error);
        says(&host, &["memory"]);
        assert_eq!(fmi2GetFMUstate(c, ptr::null_mut()), Status::Error);
        assert_eq!(fmi2SetFMUstate(c, ptr::null_mut()), Status::Error);
        assert_eq!(fmi2FreeFMUstate(c, ptr::null_mut()), Status::Ok);
        assert_eq!(fmi2SerializedFMUstateSize(c, ptr::null_mut(), ptr::null_mut()), Status::Error);
        assert_eq!(fmi2DeSerializeFMUstate(c, ptr::null(), 9, ptr::null_mut()), Status::Error);
        assert_eq!(fmi2GetRealStatus(c, 2, ptr::null_mut()), Status::Error);
        assert_eq!(fmi2GetReal(c, ptr::null(), 0, ptr::null_mut()), Status::Ok);
        assert_eq!(fmi2SetReal(c, ptr::null(), 0, ptr::null()), Status::Ok);
        assert_eq!(fmi2SetString(c, ptr::null(), 0, ptr::null()), Status::Ok);
        assert_eq!(fmi2SetDebugLogging(c, one, 3, ptr::null()), Status::Ok);
    }
}

#[test]
fn components_that_are_none_are_errors() {
    let not_a_component = vec![0_u64; 1024];
    let foreign = not_a_component.as_ptr().cast_mut().cast();
    // SAFETY: NULL and readable memory, which is what is tested.
    unsafe {
        for component in [ptr::null_mut(), foreign] {
            assert_eq!(fmi2DoStep(component, 0.0, 0.1, 0), Status::Error);
            assert_eq!(fmi2Reset(component), Status::Error);
            assert_eq!(fmi2SetTime(component, 0.0), Status::Error);
            fmi2FreeInstance(component);
        }
    }
}

#[test]
fn steps_must_be_positive_and_finite() {
    let host = Host::ready();
    for step in [0.0, -0.0, -0.1, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(host.step(0.0, step), Status::Error);
        says(&host, &["fmi2DoStep", "step", "greater than zero"]);
    }
    assert_eq!(host.step(f64::NAN, 0.1), Status::Error);
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
}

#[test]
fn the_host_must_step_from_where_the_instance_is() {
    let host = Host::ready();
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
    assert_eq!(host.step(0.0, 0.1), Status::Error);
    says(&host, &["0 s", "0.1 s", "fmi2SetFMUstate"]);
    assert_eq!(host.step(0.3, 0.1), Status::Error);
    says(&host, &["0.3 s", "0.1 s", "missing"]);
    assert_eq!(host.step(0.1, 0.1), Status::Ok);
}

/// Hosts count time in their own ways; their rounding must neither stop a run nor add up.
#[test]
fn rounding_of_communication_points_is_tolerated() {
    let step = 0.01;
    type Clock = fn(u32) -> f64;
    let multiplied: Clock = |k| f64::from(k) * 0.01;
    let divided: Clock = |k| f64::from(k) / 100.0;
    let single: Clock = |k| f64::from(k as f32 * 0.01_f32);
    let nanoseconds: Clock = |k| (f64::from(k) * 0.01 * 1e9).round() * 1e-9;
    for clock in [multiplied, divided, single, nanoseconds] {
        let host = Host::ready();
        for k in 0..1000 {
            assert_eq!(host.step(clock(k), step), Status::Ok, "{k}: {}", host.last());
        }
        assert_eq!(host.integer(vr::STEPS), 1000);
    }
    let host = Host::new();
    assert_eq!(host.setup(1e6, None), Status::Ok);
    assert_eq!((host.enter(), host.exit()), (Status::Ok, Status::Ok));
    let mut time = 1e6;
    for k in 0..1000 {
        assert_eq!(host.step(time, 1e-3), Status::Ok, "{k}: {}", host.last());
        time += 1e-3;
    }
}

#[test]
fn the_stop_time_is_not_passed() {
    let host = Host::new();
    assert_eq!(host.setup(f64::NAN, None), Status::Error);
    assert_eq!(host.setup(1.0, Some(0.0)), Status::Error);
    assert_eq!(host.setup(0.0, Some(f64::INFINITY)), Status::Error);
    assert_eq!(host.setup(0.0, Some(0.25)), Status::Ok);
    assert_eq!((host.enter(), host.exit()), (Status::Ok, Status::Ok));
    assert_eq!(host.step(0.0, 0.1), Status::Ok);
    assert_eq!(host.step(0.1, 0.1), Status::Ok);
    assert_eq!(host.step(0.2, 0.1), Status::Error);
    says(&host, &["stop time", "0.25"]);
    assert_eq!(host.step(0.2, 0.05), Status::Ok);
}

/// Instantiates with these arguments; gives whether it worked and what was said.
fn instantiate(
    name: *const c_char,
    kind: i32,
    guid: *const c_char,
    resources: *const c_char,
) -> (bool, String) {
    let messages = Messages::default();
    let callbacks = callbacks(&messages);
    // SAFETY: NULL or C strings.
    let component = unsafe { fmi2Instantiate(name, kind, guid, resources, &raw const callbacks, 0, 0) };
    // SAFETY: NULL or a fresh component.
    unsafe { fmi2FreeInstance(component) };
    let text = messages.0.lock().unwrap().last().map(|message| message.text.clone());
    (!component.is_null(), text.unwrap_or_default())
}

#[test]
fn instantiation_refuses_what_is_not_for_this_fmu() {
    let guid = guid();
    let wrong = c"{00000000-0000-0000-0000-000000000000}";
    let (made, said) = instantiate(c"a".as_ptr(), 1, wrong.as_ptr(), ptr::null());
    assert!(
        !made && said.contains(wrong.to_str().unwrap()) && said.contains(guid.to_str().unwrap()),
        "{said}"
    );
    let (made, said) = instantiate(c"a".as_ptr(), 1, ptr::null(), ptr::null());
    assert!(!made && said.contains(guid.to_str().unwrap()), "{said}");
    let (made, said) = instantiate(c"a".as_ptr(), 0, guid.as_ptr(), ptr::null());
    assert!(!made && said.contains("co-simulation"), "{said}");
    for name in [ptr::null(), c"".as_ptr()] {
        let (made, said) = instantiate(name, 1, guid.as_ptr(), ptr::null());
        assert!(!made && said.contains("name"), "{said}");
    }
    let (made, said) = instantiate(c"a".as_ptr(), 1, guid.as_ptr(), c"http://example.org/r".as_ptr());
    assert!(made && said.contains("http://example.org/r"), "{said}");
    assert!(instantiate(c"a".as_ptr(), 1, guid.as_ptr(), ptr::null()).0);
}

/// What was packed stands in the resources: without them a host must not believe that it counts.
#[test]
fn an_instance_without_its_resources_says_that_nothing_packed_counts() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("start.toml"), "\"actuator.tau\" = \"0.5\"\n").unwrap();
    let there = CString::new(format!("file://{}", folder.path().display())).unwrap();
    let away = CString::new(format!("file://{}/resources", folder.path().display())).unwrap();
    let packed = Host::with(c"toy", Some(&there));
    assert_eq!(packed.take_messages(), []);
    packed.initialize();
    assert_eq!(packed.real(vr::TAU), 0.5);
    for (location, words) in [
        (None, "no resource location"),
        (Some(c""), "no resource location"),
        (Some(&*away), "is not there"),
        (Some(c"ftp://somewhere"), "ftp://somewhere"),
    ] {
        let host = Host::with(c"toy", location);
        says(&host, &["fmi2Instantiate", words, "start values", "not known"]);
        host.initialize();
        assert_eq!(host.real(vr::TAU), 0.1);
    }
}

#[test]
fn callbacks_may_be_null() {
    let (name, guid) = (c"a".as_ptr(), guid());
    let none = CallbackFunctions::NONE;
    for callbacks in [ptr::null(), &raw const none] {
        // SAFETY: NULL callbacks are what is tested.
        unsafe {
            let c = fmi2Instantiate(name, 1, guid.as_ptr(), ptr::null(), callbacks, 1, 1);
            assert!(!c.is_null());
            assert_eq!(fmi2DoStep(c, 0.0, 0.1, 0), Status::Error);
            assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
            assert_eq!(fmi2ExitInitializationMode(c), Status::Ok);
            assert_eq!(fmi2DoStep(c, 0.0, 0.1, 0), Status::Ok);
            fmi2FreeInstance(c);
        }
    }
}

#[test]
fn strings_that_are_not_utf8_are_discarded() {
    let host = Host::new();
    let bytes = CString::new(vec![0x66, 0xff, 0xfe]).unwrap();
    assert_eq!(host.set_string(vr::FILE, &bytes), Status::Discard);
    says(&host, &["`actuator_file`", "UTF-8"]);
    assert_eq!(host.enter(), Status::Ok);
    assert_eq!(host.string(vr::FILE), "");
    assert_eq!(host.set_string(vr::FILE, c"\xc3\xa4 %s"), Status::Ok);
    assert_eq!(host.string(vr::FILE), "\u{e4} %s");
}

/// A missing and a damaged file: the message names file, line and remedy; after a better one it works.
#[test]
fn bad_resources_are_told() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("foreign.txt"), "\u{7f}ELF\n").unwrap();
    std::fs::write(folder.path().join("empty.txt"), "").unwrap();
    std::fs::write(folder.path().join("good.txt"), "0.5\n").unwrap();
    let uri = CString::new(format!("file://{}", folder.path().display())).unwrap();
    let host = Host::with(c"toy", Some(&uri));
    for file in [c"missing.txt", c"foreign.txt", c"empty.txt"] {
        assert_eq!(host.set_string(vr::FILE, file), Status::Ok);
        assert_eq!((host.enter(), host.exit()), (Status::Ok, Status::Error));
        says(&host, &[CStr::to_str(file).unwrap(), "line 1", "Write one number"]);
        assert_eq!(host.step(0.0, 0.1), Status::Error);
        assert_eq!(host.reset(), Status::Ok);
    }
    assert_eq!(host.set_string(vr::FILE, c"good.txt"), Status::Ok);
    host.initialize();
    assert_eq!((host.real(vr::TAU), host.string(vr::SOURCE)), (0.5, "good.txt".to_owned()));
}

/// A value that the host set wins over the file's, and a file's value goes when the file goes.
#[test]
fn the_hosts_value_wins_over_a_files() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tau.txt");
    std::fs::write(&file, "0.5").unwrap();
    let file = CString::new(file.to_str().unwrap()).unwrap();
    let host = Host::new();
    assert_eq!(host.set_string(vr::FILE, &file), Status::Ok);
    assert_eq!(host.enter(), Status::Ok);
    assert_eq!(host.string(vr::SOURCE), file.to_str().unwrap());
    assert_eq!(host.real(vr::TAU), 0.5);
    assert_eq!(host.set_string(vr::FILE, c""), Status::Ok);
    assert_eq!(host.string(vr::SOURCE), "parameter");
    assert_eq!(host.real(vr::TAU), 0.1);
    assert_eq!(host.set_string(vr::FILE, &file), Status::Ok);
    assert_eq!(host.set_real(vr::TAU, 0.3), Status::Ok);
    assert_eq!(host.exit(), Status::Ok);
    assert_eq!(host.real(vr::TAU), 0.3);
}

/// Strings live until the host asks for strings again.
#[test]
fn strings_live_over_other_calls() {
    let host = Host::ready();
    let mut text = ptr::null();
    // SAFETY: a live component; the string lives until the next fmi2GetString.
    unsafe {
        assert_eq!(fmi2GetString(host.component, &vr::SOURCE, 1, &raw mut text), Status::Ok);
        assert_eq!(host.step(0.0, 0.1), Status::Ok);
        assert_eq!(host.reset(), Status::Ok);
        assert_eq!(CStr::from_ptr(text), c"parameter");
    }
}
