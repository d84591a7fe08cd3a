//! Messages to the host, through its C callback.
//!
//! The pitfalls: the callback may be NULL, and hosts differ in whether they take a NULL category (we never pass one). Each
//! version of FMI has a callback of its own, which its adapter wraps.
//!
//! In FMI 2.0, messages with a status of warning or worse are always told: a refused call must say why. Informative ones are
//! FMI's debug logging, which a host switches by category. In 3.0 a host hears what it has asked for, and nothing else; only
//! why there is no instance is told in any case.

use super::model::{Log, LogCategory, Severity};
use super::types::{ComponentEnvironment, Status};
use std::ffi::{CStr, CString};
use std::sync::Arc;

/// Tells the host something: the instance's name, status, category, message.
pub type LogListener = Arc<dyn Fn(&CStr, Status, &CStr, &CStr) + Send + Sync>;

/// Pointer that a host wants back with each message.
#[derive(Clone, Copy)]
pub struct Kept(ComponentEnvironment);

// SAFETY: it is never followed here, only handed back. A host that calls an instance from several threads takes messages
// on them.
unsafe impl Send for Kept {}
// SAFETY: as above.
unsafe impl Sync for Kept {}

impl Kept {
    /// Keeps it.
    #[must_use]
    pub fn new(environment: ComponentEnvironment) -> Self {
        Self(environment)
    }

    /// For the host's callback.
    #[must_use]
    pub fn environment(self) -> ComponentEnvironment {
        self.0
    }
}

/// Categories that every FMU of ours has (names of FMI 2.0, section 2.2.4; 3.0 has the same). In a description a status
/// has the number of its version.
pub const STANDARD_CATEGORIES: [LogCategory; 6] = [
    LogCategory { name: "logEvents", description: "What happens in an instance's life" },
    LogCategory {
        name: "logStatusWarning",
        description: "Calls that did their work, with something to look at",
    },
    LogCategory { name: "logStatusDiscard", description: "Calls that returned fmiDiscard" },
    LogCategory { name: "logStatusError", description: "Calls that returned fmiError" },
    LogCategory { name: "logStatusFatal", description: "Calls that returned fmiFatal" },
    LogCategory { name: "logAll", description: "All messages" },
];

/// The host's callback, the instance's name and what is switched on.
#[derive(Clone)]
pub struct Logger {
    listener: Option<LogListener>,
    name: CString,
    /// Categories whose informative messages are told.
    enabled: Vec<&'static str>,
    /// True if warnings and errors are told even so.
    unasked: bool,
}

impl Logger {
    /// A logger with debug logging off, which tells warnings and errors.
    #[must_use]
    pub fn new(listener: Option<LogListener>, name: &CStr) -> Self {
        Self { listener, name: name.to_owned(), enabled: Vec::new(), unasked: true }
    }

    /// True if warnings and errors are told to a host that has not asked for them.
    #[must_use]
    pub fn unasked(self, unasked: bool) -> Self {
        Self { unasked, ..self }
    }

    /// Switches debug logging for a set of categories; `logAll` stands for all.
    pub fn enable(&mut self, categories: Vec<&'static str>) {
        self.enabled = categories;
    }

    /// True if an informative message of this category is wanted.
    #[must_use]
    pub fn wants(&self, category: &str) -> bool {
        self.enabled.iter().any(|enabled| *enabled == category || *enabled == "logAll")
    }

    /// Tells the host something, if it can be told.
    pub fn tell(&self, status: Status, category: &str, message: &str) {
        let Some(listener) = &self.listener else { return };
        if !self.unasked && !self.wants(category) {
            return;
        }
        // C strings end at the first NUL; a NUL inside must not swallow the rest.
        let text = |text: &str| CString::new(text.replace('\0', "\u{fffd}")).unwrap_or_default();
        let (category, message) = (text(category), text(message));
        listener(&self.name, status, &category, &message);
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
    /// True if the model has warned.
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
