//! Differences between the versions of FMI in words: one table, so that each message names functions that its host has.

use super::variable::VariableKind;
use std::fmt;

/// A version of FMI. Shown, it is the number in its functions' names: `format!("fmi{version}DoStep")`.
#[derive(Debug, PartialEq, Eq)]
pub struct Version {
    /// The number in the functions' names.
    pub number: &'static str,
    /// Place in the standard that allows a call.
    pub states: &'static str,
    /// The calls that begin an initialisation.
    pub begin: &'static str,
    /// The call that gives start and stop time.
    pub times: &'static str,
    /// A stored state, in functions' names.
    pub state: &'static str,
    /// Token that a description and its library have in common, in the standard's word.
    pub mark: &'static str,
    /// Names of the types, in the names of get and set calls.
    pub real: &'static str,
    /// As `real`.
    pub integer: &'static str,
    /// As `real`; the type in which enumerations are set and got.
    pub enumeration: &'static str,
    /// True if time is a variable, behind the model's own.
    pub has_time: bool,
    /// True if outputs that belong together are an array.
    pub has_arrays: bool,
    /// True if variables may be bytes.
    pub has_binaries: bool,
    /// True if warnings and errors are told to a host that has not switched logging on.
    pub speaks_unasked: bool,
}

impl Version {
    /// The type of a variable, in the names of get and set calls.
    #[must_use]
    pub fn type_of(&self, kind: &VariableKind) -> &'static str {
        match kind {
            VariableKind::Real { .. } => self.real,
            VariableKind::Integer { .. } => self.integer,
            VariableKind::Enumeration { .. } => self.enumeration,
            VariableKind::Boolean { .. } => "Boolean",
            VariableKind::String { .. } => "String",
            VariableKind::Binary { .. } => "Binary",
        }
    }

    /// A text of a declaration, which knows no version: `fmiOK` in it becomes `fmi2OK`, say.
    #[must_use]
    pub fn words(&self, text: &str) -> String {
        let mut parts = text.split("fmi");
        let mut words = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            words.push_str("fmi");
            if part.starts_with(|next: char| next.is_ascii_uppercase()) {
                words.push_str(self.number);
            }
            words.push_str(part);
        }
        words
    }
}

impl fmt::Display for Version {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.number)
    }
}

#[cfg(test)]
mod tests {
    use crate::fmi::{v2, v3};

    #[test]
    fn only_names_of_the_standard_get_a_number() {
        let text = "fmiOK, fmi, fmiles and fmiWarning";
        assert_eq!(v2::VERSION.words(text), "fmi2OK, fmi, fmiles and fmi2Warning");
        assert_eq!(v3::VERSION.words("no name"), "no name");
    }
}
