//! The logger callback: a real variadic one in C gets whole messages, whatever stands in them; categories switch
//! what they should; its environment and the instance's name come through.

use crate::common;

use common::*;
use rfl_mpc::fmi::v2::{CallbackFunctions, CallbackLogger, Status};
use std::ffi::{CStr, CString, c_char, c_void};
use std::path::Path;
use std::process::Command;
use std::ptr;

/// A host's logger as hosts write it: it formats the message with its arguments.
const LOGGER_IN_C: &str = r#"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
void logger(void *environment, const char *name, int status, const char *category, const char *format, ...) {
    char message[4096];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    char *log = environment;
    size_t used = strlen(log);
    snprintf(log + used, 65536 - used, "%s|%d|%s|%s\n", name, status, category, message);
}
"#;

#[cfg(unix)]
unsafe extern "C" {
    fn dlopen(path: *const c_char, flags: i32) -> *mut c_void;
    fn dlsym(library: *mut c_void, name: *const c_char) -> *mut c_void;
}

/// Compiles the logger (Rust itself needs a C compiler as its linker on Unix) and loads it.
#[cfg(unix)]
fn logger_in_c(folder: &Path) -> CallbackLogger {
    let (source, library) = (folder.join("logger.c"), folder.join("liblogger.so"));
    std::fs::write(&source, LOGGER_IN_C).unwrap();
    let mut compiler = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()));
    let status = compiler.args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).status().unwrap();
    assert!(status.success());
    let path = CString::new(library.to_str().unwrap()).unwrap();
    // SAFETY: a library that was just made; the function has the type of the standard's logger. It stays loaded.
    unsafe {
        let library = dlopen(path.as_ptr(), 2);
        assert!(!library.is_null());
        let logger = dlsym(library, c"logger".as_ptr());
        assert!(!logger.is_null());
        std::mem::transmute::<*mut c_void, CallbackLogger>(logger)
    }
}

#[cfg(unix)]
#[test]
fn a_logger_in_c_gets_whole_messages() {
    let folder = tempfile::tempdir().unwrap();
    let mut log = vec![0_u8; 65536];
    let environment = log.as_mut_ptr().cast();
    let callbacks = CallbackFunctions {
        logger: Some(logger_in_c(folder.path())),
        component_environment: environment,
        ..CallbackFunctions::NONE
    };
    let (name, guid) = (c"100% %s %n", guid());
    // SAFETY: C strings, a buffer as long as the logger takes it to be, live components.
    let text = unsafe {
        let c = fmi2Instantiate(name.as_ptr(), 1, guid.as_ptr(), ptr::null(), &raw const callbacks, 0, 1);
        assert_eq!(fmi2SetString(c, &vr::FILE, 1, &c"%s%n%d.txt".as_ptr()), Status::Ok);
        assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
        assert_eq!(fmi2ExitInitializationMode(c), Status::Error);
        assert_eq!(fmi2Reset(c), Status::Ok);
        assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
        assert_eq!(fmi2ExitInitializationMode(c), Status::Ok);
        assert_eq!(fmi2DoStep(c, 0.0, 2.0, 0), Status::Discard);
        fmi2FreeInstance(c);
        CStr::from_ptr(log.as_ptr().cast()).to_str().unwrap()
    };
    for line in [
        "100% %s %n|3|logStatusError|fmi2ExitInitializationMode: the model cannot be initialised: %s%n%d.txt, line 1:",
        "100% %s %n|0|logEvents|reset",
        "100% %s %n|0|logActuator|100 % ready: %s %n",
        "100% %s %n|0|logEvents|initialised at 0 s",
        "100% %s %n|2|logStatusDiscard|fmi2DoStep: the step from 0 s was discarded: 2 s is too long: 50 % of it may do",
    ] {
        assert!(text.lines().any(|found| found.starts_with(line)), "{line}\nis missing in\n{text}");
    }
}

/// The events and the model's messages of one initialisation.
fn categories_of_a_start(host: &Host) -> Vec<String> {
    host.take_messages();
    assert_eq!(host.reset(), Status::Ok);
    host.initialize();
    host.take_messages().into_iter().map(|message| message.category).collect()
}

/// Switches debug logging.
fn switch(host: &Host, on: bool, categories: &[&CStr]) -> Status {
    let pointers: Vec<_> = categories.iter().map(|category| category.as_ptr()).collect();
    // SAFETY: a live component, C strings.
    unsafe { fmi2SetDebugLogging(host.component, i32::from(on), pointers.len(), pointers.as_ptr()) }
}

#[test]
fn categories_switch_informative_messages() {
    let host = Host::new();
    assert_eq!(categories_of_a_start(&host), [""; 0]);
    assert_eq!(switch(&host, true, &[]), Status::Ok);
    assert_eq!(categories_of_a_start(&host), ["logEvents", "logActuator", "logEvents"]);
    assert_eq!(switch(&host, true, &[c"logActuator"]), Status::Ok);
    assert_eq!(categories_of_a_start(&host), ["logActuator"]);
    assert_eq!(switch(&host, true, &[c"logAll"]), Status::Ok);
    assert_eq!(categories_of_a_start(&host).len(), 3);
    assert_eq!(switch(&host, false, &[c"logAll"]), Status::Ok);
    assert_eq!(categories_of_a_start(&host), [""; 0]);
    assert_eq!(switch(&host, true, &[c"logNonsense", c"logEvents"]), Status::Ok);
    assert!(host.last().contains("logNonsense") && host.last().contains("logActuator"), "{}", host.last());
    assert_eq!(categories_of_a_start(&host), ["logEvents", "logEvents"]);
}

/// Whoever switched debugging off is still told why a call was refused.
#[test]
fn refusals_are_told_without_debug_logging() {
    let host = Host::with(c"the name", Some(&nothing_packed()));
    assert_eq!(host.step(0.0, 0.1), Status::Error);
    let [message] = host.take_messages().try_into().unwrap();
    assert_eq!((message.status, message.category.as_str()), (Status::Error, "logStatusError"));
    assert_eq!(message.instance, "the name");
}

/// A step in which the model warns is done: most hosts would stop at another status. Who asks for it gets the warning.
#[test]
fn a_models_warning_is_told_and_is_the_status_if_asked_for() {
    for (asked, status) in [(0, Status::Ok), (1, Status::Warning)] {
        let host = Host::new();
        assert_eq!(host.set_boolean(vr::LIMITED, 1), Status::Ok);
        assert_eq!(host.set_boolean(vr::REPORT_WARNINGS, asked), Status::Ok);
        host.initialize();
        assert_eq!(host.set_real(vr::STEER_CMD, 0.4), Status::Ok);
        assert_eq!(host.step(0.0, 0.1), Status::Ok);
        assert_eq!(host.set_real(vr::STEER_CMD, 1.0), Status::Ok);
        assert_eq!(host.step(0.1, 0.9), status);
        let message = host.take_messages().pop().unwrap();
        assert_eq!((message.status, message.category.as_str()), (Status::Warning, "logActuator"));
    }
}

/// A logger that calls back into the instance: refused, with the instance unharmed.
#[test]
fn a_call_out_of_the_logger_is_refused() {
    extern "C" fn reenter(
        environment: *mut c_void,
        _name: *const c_char,
        _status: Status,
        _category: *const c_char,
        _format: *const c_char,
        message: *const c_char,
    ) {
        // SAFETY: the environment of this test; the message is a C string.
        let (seen, message) = unsafe { (&mut *environment.cast::<Seen>(), CStr::from_ptr(message)) };
        seen.messages.push(message.to_str().unwrap().to_owned());
        // Each time, as a host does that ends its run upon an error.
        // SAFETY: a live component, or NULL while it is made.
        seen.statuses.push(unsafe { fmi2Reset(seen.component) });
    }
    struct Seen {
        component: *mut c_void,
        messages: Vec<String>,
        statuses: Vec<Status>,
    }
    let seen =
        Box::into_raw(Box::new(Seen { component: ptr::null_mut(), messages: vec![], statuses: vec![] }));
    // SAFETY: as `common::callbacks`.
    let logger = unsafe {
        std::mem::transmute::<
            extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, *const c_char),
            CallbackLogger,
        >(reenter)
    };
    let callbacks = CallbackFunctions {
        logger: Some(logger),
        component_environment: seen.cast(),
        ..CallbackFunctions::NONE
    };
    // SAFETY: C strings, a live component; `seen` is used by no one else while calls run.
    unsafe {
        let (guid, resources) = (guid(), nothing_packed());
        let resources = resources.as_ptr();
        let c = fmi2Instantiate(c"a".as_ptr(), 1, guid.as_ptr(), resources, &raw const callbacks, 0, 0);
        (*seen).component = c;
        assert_eq!(fmi2DoStep(c, 0.0, 0.1, 0), Status::Error);
        let Seen { messages, statuses, .. } = &*seen;
        assert_eq!(statuses, &[Status::Error, Status::Error]);
        assert_eq!(messages.len(), 2, "{messages:?}");
        assert!(messages[1].contains("fmi2Reset: another call of this instance"), "{messages:?}");
        assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
        fmi2FreeInstance(c);
        drop(Box::from_raw(seen));
    }
}
