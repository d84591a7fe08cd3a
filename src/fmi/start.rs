//! Start values that an FMU was packed with, instead of the declaration's: `resources/start.toml`.
//!
//! ```text
//! variant = "rfl_s"
//! "vehicle.mass" = "1500"
//! vehicle_file = "car/my_car.toml"
//!
//! [from_files]
//! "vehicle.yaw_inertia" = "2100"
//! ```
//!
//! The first are choices of the user, and count whatever they are. Those of the table are what the packed files give: they
//! are declared, so that a host that writes all start values has chosen nothing, and give way to those of another file.
//!
//! The `modelDescription.xml` beside it shows the same values, so that what a host sees, gets before an
//! initialisation, and drives with is one. The library, and with it the GUID, stays what it was: an FMU can be given a
//! learned model without a compiler.

use super::model::Declaration;
use super::value::Value;
use super::variable::{Causality, Variable, VariableKind};
use crate::input;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file in `resources/`.
pub const START_FILE: &str = "start.toml";

/// Reasons for which start values cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum StartError {
    #[error("{}: {message}", file.display())]
    File { file: PathBuf, message: String },
    #[error("there is no parameter `{name}`{}", if near.is_empty() { String::new() } else { format!("; there are {}", near.join(", ")) })]
    Unknown { name: String, near: Vec<String> },
    #[error("`{name}` is {wanted}, which `{value}` is not")]
    Value { name: String, value: String, wanted: String },
}

impl Variable {
    /// The value that a text is for this variable.
    ///
    /// # Errors
    /// A text of another type: the type that was expected.
    pub fn value_of(&self, text: &str) -> Result<Value, String> {
        match &self.kind {
            VariableKind::Real { min, max, .. } => {
                let (low, high) = (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
                let value = text.parse::<f64>().ok();
                let value = value.filter(|value| value.is_finite() && (low..=high).contains(value));
                value.map(Value::Real).ok_or(format!("a number in [{low}, {high}]"))
            }
            VariableKind::Integer { min, max, .. } => {
                let (low, high) = (min.unwrap_or(i32::MIN), max.unwrap_or(i32::MAX));
                let value = text.parse::<i32>().ok().filter(|value| (low..=high).contains(value));
                value.map(Value::Integer).ok_or(format!("an integer in [{low}, {high}]"))
            }
            VariableKind::Boolean { .. } => {
                text.parse().map(Value::Boolean).map_err(|_| "true or false".to_owned())
            }
            VariableKind::String { .. } => Ok(Value::String(text.to_owned())),
            VariableKind::Binary { .. } => Err("bytes, which only a host sets".to_owned()),
            VariableKind::Enumeration { items, .. } => {
                let found = items.iter().find(|(value, name, _)| *name == text || value.to_string() == text);
                let names: Vec<_> = items.iter().map(|item| item.1).collect();
                found.map(|item| Value::Integer(item.0)).ok_or(format!("one of {}", names.join(", ")))
            }
        }
    }

    fn start_with(&mut self, value: Value) {
        match (&mut self.kind, value) {
            (VariableKind::Real { start, .. }, Value::Real(value)) => *start = value,
            (
                VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. },
                Value::Integer(value),
            ) => *start = value,
            (VariableKind::Boolean { start }, Value::Boolean(value)) => *start = value,
            (VariableKind::String { start }, Value::String(value)) => *start = value.into(),
            _ => {
                crate::invariant!(false, "a value of another type than {}", self.name);
            }
        }
    }
}

impl Declaration {
    /// Gives a parameter another start value of the user's choice, written as text (an enumeration's by name).
    ///
    /// # Errors
    /// No such parameter; a text that is no value of it.
    pub fn start_with(&mut self, name: &str, text: &str) -> Result<(), StartError> {
        self.start(name, text)?.chosen = true;
        Ok(())
    }

    /// Takes over start values.
    ///
    /// # Errors
    /// As [`start_with`](Self::start_with).
    pub fn start_from(&mut self, values: &StartValues) -> Result<(), StartError> {
        values.from_files.iter().try_for_each(|(name, text)| self.start(name, text).map(|_| ()))?;
        values.chosen.iter().try_for_each(|(name, text)| self.start_with(name, text))
    }

    /// The parameters whose names begin like this one for longest.
    fn parameters_near(&self, name: &str) -> Vec<String> {
        let common = |other: &str| other.chars().zip(name.chars()).take_while(|(a, b)| a == b).count();
        let names =
            self.variables.iter().filter(|of| of.causality == Causality::Parameter).map(|of| &of.name);
        let longest = names.clone().map(|other| common(other)).max().unwrap_or(0);
        // A first letter alone is no likeness.
        names
            .filter(|other| longest > 2 && common(other) == longest)
            .take(8)
            .map(ToString::to_string)
            .collect()
    }

    fn start(&mut self, name: &str, text: &str) -> Result<&mut Variable, StartError> {
        let parameter =
            |variable: &Variable| variable.causality == Causality::Parameter && variable.name == name;
        let Some(place) = self.variables.iter().position(parameter) else {
            return Err(StartError::Unknown { name: name.to_owned(), near: self.parameters_near(name) });
        };
        let variable = &mut self.variables[place];
        let wrong = |wanted| StartError::Value { name: name.to_owned(), value: text.to_owned(), wanted };
        variable.start_with(variable.value_of(text).map_err(wrong)?);
        Ok(variable)
    }

    /// Takes over the start values of a `resources/` folder, if it has any.
    ///
    /// # Errors
    /// A file that is damaged, or of another FMU.
    pub(super) fn start_as_packed(&mut self, resources: &Path) -> Result<(), StartError> {
        let file = resources.join(START_FILE);
        if !file.exists() {
            return Ok(());
        }
        let failed = |message: String| StartError::File {
            file: file.clone(),
            message: format!("{message}; unpack the FMU anew, or make it again with fmu-build"),
        };
        let text = input::read_text(&file).map_err(|error| failed(error.to_string()))?;
        let values = StartValues::read(&text).map_err(|error| failed(error.to_string()))?;
        self.start_from(&values).map_err(|error| failed(error.to_string()))
    }
}

/// The content of a [`START_FILE`]: texts by parameter.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StartValues {
    /// Choices of the user.
    #[serde(flatten)]
    pub chosen: BTreeMap<String, String>,
    /// Values that the packed files give.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub from_files: BTreeMap<String, String>,
}

impl StartValues {
    /// True if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.chosen.is_empty() && self.from_files.is_empty()
    }

    /// The file's text.
    #[must_use]
    pub fn to_text(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    /// Reads the file's text.
    ///
    /// # Errors
    /// A text that is no TOML of texts.
    pub fn read(text: &str) -> Result<Self, toml::de::Error> {
        toml::from_str(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fmi::Model;
    use crate::fmu::RflMpc;

    fn declared_in(text: &str) -> Result<Declaration, StartError> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(START_FILE), text).unwrap();
        let mut declaration = RflMpc::declaration();
        declaration.start_as_packed(folder.path()).map(|()| declaration)
    }

    #[test]
    fn packed_start_values_are_taken_over() {
        let values =
            [("variant", "rfl_s"), ("mpc.horizon", "20"), ("path_file", "a \"b\".csv"), ("mpc.q_e1", "2.5")];
        let values = values.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let from_files = [("vehicle.mass".to_owned(), "1800".to_owned())].into();
        let file = StartValues { chosen: values.into(), from_files };
        let declaration = declared_in(&file.to_text()).unwrap();
        assert_eq!(StartValues::read(&file.to_text()).unwrap(), file);
        let kind = |name: &str| declaration.variables[declaration.find(name).unwrap()].kind.clone();
        assert!(matches!(kind("variant"), VariableKind::Enumeration { start: 6, .. }));
        assert!(matches!(kind("mpc.horizon"), VariableKind::Integer { start: 20, .. }));
        assert!(matches!(kind("path_file"), VariableKind::String { start } if start == "a \"b\".csv"));
        assert!(matches!(kind("mpc.q_e1"), VariableKind::Real { start, .. } if start == 2.5));
        assert!(matches!(kind("vehicle.mass"), VariableKind::Real { start, .. } if start == 1800.0));
        let chosen = |name: &str| declaration.variables[declaration.find(name).unwrap()].chosen;
        assert!(
            chosen("mpc.q_e1") && chosen("path_file") && !chosen("vehicle.mass") && !chosen("mpc.r_rate")
        );
        assert_eq!(declared_in("").unwrap(), RflMpc::declaration());
    }

    #[test]
    fn damaged_start_values_are_refused_with_the_reason() {
        for (text, words) in [
            ("variant = ", "start.toml"),
            ("variant = \"rfl_x\"", "one of none, linear"),
            ("e1 = \"0\"", "no parameter `e1`"),
            ("nothing = \"0\"", "no parameter `nothing`"),
            ("\"mpc.q_e1\" = \"nan\"", "a number in"),
            ("\"mpc.q_e1\" = 2", "start.toml"),
            ("[from_files]\nnothing = \"0\"", "no parameter `nothing`"),
        ] {
            let error = declared_in(text).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains("fmu-build"), "{error}");
        }
    }
}
