//! A controller's file: numbers chosen by a search or a person, by name, and the vehicle that they are for.
//!
//! ```toml
//! kind = "car"
//! vehicle = "BMW 320i"          # what the file is for; a word only
//! variant = "actuator"          # optional: what the controller predicts with
//!
//! [controller]                  # any of the controller's parameters; the others stay as they are
//! mpc.horizon = 30
//! mpc.q_e1 = 0.118
//! ```
//!
//! `rfl tune` and `rfl learn` write it, `rfl drive --controller` and the FMU's parameter `controller_file` take it.

use super::choice::ControlVariant;
use super::parameters::ControllerParametersFor;
use super::vehicle::ControlledParameters;
use crate::input;
use crate::nominal::LateralVehicle;
use crate::parameter::OutOfRange;
use std::path::{Path, PathBuf};

/// The content of a controller's file.
#[derive(Debug, Clone, PartialEq)]
pub struct ControllerFile {
    /// The kind of vehicle that it is for, `car` or `truck`.
    pub kind: String,
    /// Name of the vehicle that it is for.
    pub vehicle: String,
    /// Prediction model of the controller, if the file names one.
    pub variant: Option<ControlVariant>,
    /// Names and values of parameters, in the order of the file.
    pub values: Vec<(String, f64)>,
}

/// Reasons for which a controller's file cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ControllerFileError {
    #[error(
        "controller file {}: cannot be read ({source}); check the name, or make one with `rfl tune`",
        file.display()
    )]
    Unreadable { file: PathBuf, source: std::io::Error },
    #[error("controller file {}, line {line}: {message}; it is a TOML file, as `rfl tune` writes it", file.display())]
    Syntax { file: PathBuf, line: usize, message: String },
    #[error("controller file {}: {message}", file.display())]
    Content { file: PathBuf, message: String },
    #[error(
        "controller file {}: it is for a {found}, and this is a {expected}; tune this vehicle with `rfl tune`",
        file.display()
    )]
    OtherKind { file: PathBuf, found: String, expected: &'static str },
    #[error("controller file {}: {error}", file.display())]
    OutOfRange { file: PathBuf, error: OutOfRange },
    #[error(
        "controller file {}: the controller has no number '{name}'; 'rfl parameters' lists all",
        file.display()
    )]
    Unknown { file: PathBuf, name: String },
}

impl ControllerFile {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, or is none of a controller.
    pub fn read(file: &Path) -> Result<Self, ControllerFileError> {
        let text = input::read_text(file)
            .map_err(|source| ControllerFileError::Unreadable { file: file.into(), source })?;
        let table = text.parse().map_err(|error| {
            let (line, message) = input::toml_error(&text, &error);
            ControllerFileError::Syntax { file: file.into(), line, message }
        })?;
        Self::parse(&table).map_err(|message| ControllerFileError::Content { file: file.into(), message })
    }

    fn parse(table: &toml::Table) -> Result<Self, String> {
        let word = |key: &str| match table.get(key) {
            None => Ok(None),
            Some(toml::Value::String(word)) => Ok(Some(word.clone())),
            Some(_) => Err(format!("'{key}' must be a text in quotes")),
        };
        if let Some(key) =
            table.keys().find(|key| !["kind", "vehicle", "variant", "controller"].contains(&key.as_str()))
        {
            return Err(format!("there is no key '{key}'; numbers stand in the section [controller]"));
        }
        let variant = word("variant")?
            .map(|name| {
                let known = ControlVariant::ALL.iter().copied().find(|variant| variant.name() == name);
                known.ok_or(format!("there is no variant '{name}'"))
            })
            .transpose()?;
        let numbers = match table.get("controller") {
            Some(toml::Value::Table(numbers)) => numbers,
            _ => return Err("it needs a section [controller] with numbers, NAME = VALUE each".into()),
        };
        let mut values = vec![];
        flatten("", numbers, &mut values)?;
        Ok(Self {
            kind: word("kind")?.unwrap_or_default(),
            vehicle: word("vehicle")?.unwrap_or_default(),
            variant,
            values,
        })
    }

    /// As the text of a file, with words above it; each of their lines becomes a comment.
    #[must_use]
    pub fn to_text(&self, words: &str) -> String {
        use std::fmt::Write;
        let mut text: String = words.lines().map(|line| format!("# {line}\n")).collect();
        let quoted = |word: &str| toml::Value::String(word.to_owned()).to_string();
        // Writing to memory does not fail.
        let _ = writeln!(text, "kind = {}\nvehicle = {}", quoted(&self.kind), quoted(&self.vehicle));
        if let Some(variant) = self.variant {
            let _ = writeln!(text, "variant = {}", quoted(variant.name()));
        }
        text.push_str("\n[controller]\n");
        for (name, value) in &self.values {
            let _ = writeln!(text, "{name} = {value}");
        }
        text
    }

    /// What is to be said where the file is for a vehicle of another name than `vehicle`.
    #[must_use]
    pub fn for_another(&self, vehicle: &str) -> Option<String> {
        let own = self.vehicle.trim();
        (!own.is_empty() && own != vehicle.trim()).then(|| {
            format!("it is for '{own}', and this vehicle is '{vehicle}': its numbers may not suit; `rfl tune` makes one for this vehicle")
        })
    }

    /// Applies the numbers to a controller; `file` is their source.
    ///
    /// # Errors
    /// Another kind of vehicle; a value out of its range; a name that no parameter has. Some numbers may have changed then.
    pub fn apply<G: ControlledParameters<S>, const S: usize>(
        &self,
        parameters: &mut ControllerParametersFor<G>,
        file: &Path,
    ) -> Result<(), ControllerFileError> {
        let expected = <G::Vehicle as LateralVehicle<S>>::KIND;
        if !self.kind.is_empty() && self.kind != expected {
            return Err(ControllerFileError::OtherKind {
                file: file.into(),
                found: self.kind.clone(),
                expected,
            });
        }
        for (name, value) in &self.values {
            let set = parameters.set::<S>(name, *value);
            if !set.map_err(|error| ControllerFileError::OutOfRange { file: file.into(), error })? {
                return Err(ControllerFileError::Unknown { file: file.into(), name: name.clone() });
            }
        }
        Ok(())
    }
}

/// Names with dots from tables in tables.
fn flatten(prefix: &str, table: &toml::Table, values: &mut Vec<(String, f64)>) -> Result<(), String> {
    for (key, value) in table {
        let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            toml::Value::Table(inner) => flatten(&name, inner, values)?,
            toml::Value::Float(number) => values.push((name, *number)),
            toml::Value::Integer(number) => values.push((name, *number as f64)),
            _ => return Err(format!("'{name}' must be a number")),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::ControllerParameters;

    fn file() -> ControllerFile {
        let values = [("mpc.horizon", 30.0), ("mpc.q_e1", 0.118), ("observer.noise_yaw", 1e-7)];
        ControllerFile {
            kind: "car".into(),
            vehicle: "A \"quoted\" car".into(),
            variant: Some(ControlVariant::Actuator),
            values: values.map(|(name, value)| (name.to_owned(), value)).into(),
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let text = file().to_text("Made by a test.\nTwo lines.");
        assert!(text.starts_with("# Made by a test.\n# Two lines.\n"));
        assert_eq!(ControllerFile::parse(&text.parse().unwrap()).unwrap(), file());
        let mut parameters = ControllerParameters::default();
        file().apply(&mut parameters, Path::new("x.toml")).unwrap();
        assert_eq!((parameters.mpc.horizon, parameters.mpc.q_e1), (30, 0.118));
        assert_eq!(parameters.observer.noise_yaw, 1e-7);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |text: &str| ControllerFile::parse(&text.parse().unwrap()).unwrap_err();
        assert!(message("kind = 3\n[controller]").contains("kind"));
        assert!(message("mpc.q_e1 = 3").contains("mpc"));
        assert!(message("kind = 'car'").contains("[controller]"));
        assert!(message("[controller]\nmpc.q_e1 = 'a'").contains("mpc.q_e1"));
        assert!(message("variant = 'magic'\n[controller]").contains("magic"));
        let apply = |change: fn(&mut ControllerFile)| {
            let mut file = file();
            change(&mut file);
            file.apply(&mut ControllerParameters::default(), Path::new("my.toml")).unwrap_err().to_string()
        };
        for (change, word) in [
            ((|file| file.kind = "truck".into()) as fn(&mut ControllerFile), "truck"),
            (|file| file.values[1].1 = -3.0, "mpc.q_e1"),
            (|file| file.values[1].0 = "mpc.q_e9".into(), "mpc.q_e9"),
        ] {
            let said = apply(change);
            assert!(said.contains(word) && said.contains("my.toml"), "{said}");
        }
    }
}
