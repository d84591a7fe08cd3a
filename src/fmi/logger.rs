//! Messages to the host, through its C callback.
//!
//! The pitfalls: the callback may be NULL; it is variadic and takes a *format*, so a `%` in a message must not be
//! interpreted (every message goes through the format `%s`); hosts differ in whether they take a NULL category
//! (we never pass one).
//!
//! Messages with a status of warning or worse are always told: a refused call must say why. Informative ones are
//! FMI's debug logging, which `loggingOn` and `fmi2SetDebugLogging` switch by category.

use super::abi::{CallbackFunctions, Status};
use super::model::{Log, LogCategory, Severity};
use std::ffi::{CStr, CString};

/// Categories that every FMU of ours has (names of FMI 2.0, section 2.2.4).
pub const STANDARD_CATEGORIES: [LogCategory; 6] = [
    LogCategory { name: "logEvents", description: "What happens in an instance's life" },
    LogCategory {
        name: "logStatusWarning",
        description: "Calls that did their work, with something to look at",
    },
    LogCategory { name: "logStatusDiscard", description: "Calls that returned fmi2Discard" },
    LogCategory { name: "logStatusError", description: "Calls that returned fmi2Error" },
    LogCategory { name: "logStatusFatal", description: "Calls that returned fmi2Fatal" },
    LogCategory { name: "logAll", description: "All messages" },
];

/// The host's callback, the instance's name and what is switched on.
#[derive(Debug, Clone)]
pub struct Logger {
    callbacks: CallbackFunctions,
    name: CString,
    /// Categories whose informative messages are told.
    enabled: Vec<&'static str>,
}

impl Logger {
    /// A logger with debug logging off.
    #[must_use]
    pub fn new(callbacks: CallbackFunctions, name: &CStr) -> Self {
        Self { callbacks, name: name.to_owned(), enabled: Vec::new() }
    }

    /// Switches debug logging for a set of categories; `logAll` stands for all.
    pub fn enable(&mut self, categories: Vec<&'static str>) {
        self.enabled = categories;
    }

    /// Whether an informative message of this category is wanted.
    #[must_use]
    pub fn wants(&self, category: &str) -> bool {
        self.enabled.iter().any(|enabled| *enabled == category || *enabled == "logAll")
    }

    /// Tells the host something, if it can be told.
    pub fn tell(&self, status: Status, category: &str, message: &str) {
        let Some(logger) = self.callbacks.logger else { return };
        // C strings end at the first NUL; a NUL inside must not swallow the rest.
        let text = |text: &str| CString::new(text.replace('\0', "\u{fffd}")).unwrap_or_default();
        let (category, message) = (text(category), text(message));
        // SAFETY: `logger` is the host's callback of exactly this C type, the host keeps it valid until
        // fmi2FreeInstance (FMI 2.0, section 2.1.5); all strings live over the call; `%s` takes one string.
        unsafe {
            logger(
                self.callbacks.component_environment,
                self.name.as_ptr(),
                status,
                category.as_ptr(),
                c"%s".as_ptr(),
                message.as_ptr(),
            );
        }
    }

    /// Tells an event of debug logging.
    pub fn event(&self, message: std::fmt::Arguments<'_>) {
        if self.wants("logEvents") {
            self.tell(Status::Ok, "logEvents", &message.to_string());
        }
    }
}

/// The category of messages that explain a status.
#[must_use]
pub fn status_category(status: Status) -> &'static str {
    match status {
        Status::Ok | Status::Pending => "logEvents",
        Status::Warning => "logStatusWarning",
        Status::Discard => "logStatusDiscard",
        Status::Error => "logStatusError",
        Status::Fatal => "logStatusFatal",
    }
}

/// A model's way to the logger over one call; notes whether there was a warning, which may be the call's status.
pub struct Messages<'a> {
    logger: &'a Logger,
    /// Whether the model has warned.
    pub warned: bool,
}

impl<'a> Messages<'a> {
    /// A fresh note of one call.
    pub fn to(logger: &'a Logger) -> Self {
        Self { logger, warned: false }
    }
}

impl Log for Messages<'_> {
    fn log(&mut self, severity: Severity, category: &'static str, message: &str) {
        match severity {
            Severity::Info => {
                if self.logger.wants(category) {
                    self.logger.tell(Status::Ok, category, message);
                }
            }
            Severity::Warning => {
                self.warned = true;
                self.logger.tell(Status::Warning, category, message);
            }
            Severity::Error => self.logger.tell(Status::Error, category, message),
        }
    }
}
