//! Notes for the user of a road that was read.

use std::fmt;

/// A word about a road.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// True if something should be done about it; otherwise it was repaired or assumed, and is only reported.
    pub warning: bool,
    /// The words.
    pub text: String,
}

impl Note {
    /// Something repaired or assumed.
    pub(super) fn info(text: impl Into<String>) -> Self {
        Self { warning: false, text: text.into() }
    }

    /// Something to act on.
    pub(super) fn warning(text: impl Into<String>) -> Self {
        Self { warning: true, text: text.into() }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
