//! Findings in a log, in words.

use serde::{Deserialize, Serialize};

/// Gravity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingSeverity {
    /// Worth knowing.
    Note,
    /// Mended or left out, and the answer may be weaker for it.
    Warning,
    /// Probably wrong in the log: the answer is not to be trusted before that is cleared up.
    Suspicion,
}

/// A finding in a log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Its gravity.
    pub gravity: FindingSeverity,
    /// The column, if it is about one.
    pub signal: Option<String>,
    /// Fault and advice, in words.
    #[serde(flatten, with = "crate::former::summary")]
    pub summary: String,
}

impl Finding {
    /// A finding about the log, or about one column.
    pub(crate) fn new(gravity: FindingSeverity, signal: Option<&str>, summary: impl Into<String>) -> Self {
        Self { gravity, signal: signal.map(str::to_owned), summary: summary.into() }
    }
}
