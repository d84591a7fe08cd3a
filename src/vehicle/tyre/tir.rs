//! Reading `.tir` files: `[SECTION]`, `KEY = value`, comments from `$` or `!`; tables (`[SHAPE]`) are passed over.
//!
//! The coefficients are those of a left tyre; one that was measured as a right one (`TYRESIDE = 'RIGHT'`) is mirrored.

use super::coefficients::Coefficients;
use crate::encoding::decode;
use crate::input;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Reasons for which a tyre file could not be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum TirError {
    /// The file cannot be opened or is not text.
    #[error("tyre file {file}: cannot be read ({source}); check the name, and that it is a text file")]
    Unreadable { file: PathBuf, source: std::io::Error },
    /// A coefficient's value is not a finite number.
    #[error("tyre file {file}, line {line}: {key} = {text} is not a finite number")]
    NotANumber { file: PathBuf, line: usize, key: String, text: String },
    /// A coefficient stands twice.
    #[error("tyre file {file}: {key} stands in line {first} and again in line {second}; delete one of them")]
    Twice { file: PathBuf, key: String, first: usize, second: usize },
    /// The file is in units that we do not convert.
    #[error(
        "tyre file {file}, line {line}: [UNITS] {key} = '{found}' is not read; convert the file to '{expected}'"
    )]
    Units { file: PathBuf, line: usize, key: String, found: String, expected: &'static str },
    /// Another tyre model than the Magic Formula 5.x.
    #[error("tyre file {file}, line {line}: {key} = '{found}' is {what}")]
    Format { file: PathBuf, line: usize, key: &'static str, found: String, what: &'static str },
    /// Coefficients without a default are missing, e.g. because the file is cut off.
    #[error("tyre file {file}: missing {}; is the file complete?", keys.join(", "))]
    Missing { file: PathBuf, keys: Vec<&'static str> },
    /// A coefficient that must be positive (or not zero) is not.
    #[error("tyre file {file}, line {line}: {key} = {value} must be {expected}")]
    Range { file: PathBuf, line: usize, key: &'static str, value: f64, expected: &'static str },
}

impl Coefficients {
    /// Reads a `.tir` file.
    ///
    /// # Errors
    /// See [`TirError`]: file, line, key and remedy.
    pub fn read(file: &Path) -> Result<Self, TirError> {
        let bytes = input::read(file, input::TEXT)
            .map_err(|source| TirError::Unreadable { file: file.to_path_buf(), source })?;
        // Old files carry Latin-1 in comments; everything that we read is ASCII.
        Self::parse(&decode(bytes).unwrap_or_else(|latin1| latin1), file)
    }

    /// Reads the text of a `.tir` file; `file` is for messages.
    ///
    /// # Errors
    /// See [`TirError`].
    pub fn parse(text: &str, file: &Path) -> Result<Self, TirError> {
        let known = Self::keys();
        let mut found: BTreeMap<&'static str, (f64, usize)> = BTreeMap::new();
        let mut section = String::new();
        let mut model = BTreeMap::new();
        for (index, raw) in text.lines().enumerate() {
            let line = index + 1;
            let content = raw.split(['$', '!']).next().unwrap_or_default().trim();
            if let Some(name) = content.strip_prefix('[') {
                section = name.trim_end_matches(']').trim().to_ascii_uppercase();
                continue;
            }
            let Some((key, value)) = content.split_once('=') else { continue };
            let key = key.trim().to_ascii_uppercase();
            let value = value.trim().trim_matches(['\'', '"']).trim();
            if section == "UNITS" {
                check_unit(file, line, &key, value)?;
            } else if section == "MODEL" {
                model.insert(key.clone(), (value.to_owned(), line));
            }
            let Some(&name) = known.iter().find(|name| **name == key) else { continue };
            // Fortran programs write exponents with D.
            let number =
                value.replace(['d', 'D'], "e").parse::<f64>().ok().filter(|number| number.is_finite());
            let Some(number) = number else {
                return Err(TirError::NotANumber {
                    file: file.to_path_buf(),
                    line,
                    key,
                    text: value.to_string(),
                });
            };
            if let Some((_, first)) = found.insert(name, (number, line)) {
                return Err(TirError::Twice { file: file.to_path_buf(), key, first, second: line });
            }
        }
        check_model(file, &model)?;
        let coefficients = Self::from_lookup(|key| found.get(key).map(|entry| entry.0))
            .map_err(|keys| TirError::Missing { file: file.to_path_buf(), keys })?;
        coefficients.check(file, |key| found.get(key).map_or(0, |entry| entry.1))?;
        // Vehicles mirror a left tyre for their right wheels.
        let right = model.get("TYRESIDE").is_some_and(|(side, _)| side.eq_ignore_ascii_case("RIGHT"));
        Ok(if right { coefficients.mirrored() } else { coefficients })
    }

    fn check(&self, file: &Path, line_of: impl Fn(&str) -> usize) -> Result<(), TirError> {
        let positive = [
            ("UNLOADED_RADIUS", self.r0),
            ("FNOMIN", self.fz0),
            ("VERTICAL_STIFFNESS", self.vertical_stiffness),
            ("LFZO", self.lfzo),
            ("LMUX", self.lmux),
            ("LMUY", self.lmuy),
            ("LKX", self.lkx),
            ("LKY", self.lky),
            ("PKX1", self.pkx1),
            ("PKY2", self.pky2),
            ("PCX1", self.pcx1),
            ("PCY1", self.pcy1),
            ("FZMAX", self.fzmax),
            ("LONGVL", self.longvl),
        ];
        let nonzero = [("PDX1", self.pdx1), ("PDY1", self.pdy1), ("PKY1", self.pky1)];
        let refuse = |key, value, expected| {
            Err(TirError::Range { file: file.to_path_buf(), line: line_of(key), key, value, expected })
        };
        if let Some(&(key, value)) = positive.iter().find(|(_, value)| *value <= 0.0) {
            return refuse(key, value, "greater than zero");
        }
        if let Some(&(key, value)) = nonzero.iter().find(|(_, value)| *value == 0.0) {
            return refuse(key, value, "different from zero");
        }
        if !(0.05..=2.0).contains(&self.r0) {
            return refuse("UNLOADED_RADIUS", self.r0, "a radius in metres, 0.05 to 2");
        }
        if let Some(&(key, value)) = nonzero[..2].iter().find(|(_, value)| value.abs() > 5.0) {
            return refuse(key, value, "a coefficient of friction, at most 5");
        }
        if self.pky1 > 0.0 {
            return refuse(
                "PKY1",
                self.pky1,
                "negative (ISO signs: a slip to the left gives a force to the right)",
            );
        }
        if self.fzmin < 0.0 || self.fzmin >= self.fzmax {
            return refuse("FZMIN", self.fzmin, "at least zero and less than FZMAX");
        }
        Ok(())
    }
}

fn check_unit(file: &Path, line: usize, key: &str, found: &str) -> Result<(), TirError> {
    let (expected, accepted): (&'static str, &[&str]) = match key {
        "LENGTH" => ("meter", &["meter", "metre", "m"]),
        "FORCE" => ("newton", &["newton", "n"]),
        "ANGLE" => ("radian", &["radian", "radians", "rad"]),
        "MASS" => ("kg", &["kg", "kilogram"]),
        "TIME" => ("second", &["second", "seconds", "sec", "s"]),
        _ => return Ok(()),
    };
    if accepted.contains(&found.to_ascii_lowercase().as_str()) {
        return Ok(());
    }
    Err(TirError::Units {
        file: file.to_path_buf(),
        line,
        key: key.to_string(),
        found: found.to_string(),
        expected,
    })
}

/// Advice for a file of the Magic Formula 6.
const NEWER: &str = "the Magic Formula 6: its coefficients of inflation pressure and turn slip mean another model; let the fitting \
     tool write the tyre as MF-Tyre 5.2 (FITTYP 6 or 52)";
const OTHER: &str = "another tyre model; give a file of the Magic Formula 5.2 (PROPERTY_FILE_FORMAT 'PAC2002', 'MF_05' or 'MF-TYRE', \
     or FITTYP 6 or 52)";
const USER: &str = "any model of a user's subroutine, and no FITTYP says which; if it is the Magic Formula 5.2, add FITTYP = 6 to \
     [MODEL]";

/// Tyre model of the `[MODEL]` section: by `FITTYP` where that is given, else by `PROPERTY_FILE_FORMAT`.
fn check_model(file: &Path, model: &BTreeMap<String, (String, usize)>) -> Result<(), TirError> {
    let refuse = |key, found: &str, line, what| {
        Err(TirError::Format { file: file.to_path_buf(), line, key, found: found.to_owned(), what })
    };
    let fit = model.get("FITTYP");
    if let Some((text, line)) = fit {
        // A number may be written as 6 or 6.0.
        let number = text.parse::<f64>().unwrap_or(0.0);
        match if number.fract() == 0.0 { number as u32 } else { 0 } {
            // 5: MF-Tyre 5.0, 51 and 52: 5.1 and 5.2, 6 and 21: older numbers of the same.
            5 | 6 | 21 | 51 | 52 => (),
            60..=79 => return refuse("FITTYP", text, *line, NEWER),
            _ if (6.0..7.0).contains(&number) => return refuse("FITTYP", text, *line, NEWER),
            _ => return refuse("FITTYP", text, *line, OTHER),
        }
    }
    let Some((text, line)) = model.get("PROPERTY_FILE_FORMAT") else { return Ok(()) };
    match text.to_ascii_uppercase().as_str() {
        "PAC2002" | "MF_05" | "MF-TYRE" | "MF_TYRE" => Ok(()),
        "USER" if fit.is_some() => Ok(()),
        "USER" => refuse("PROPERTY_FILE_FORMAT", text, *line, USER),
        "MF_61" | "MF_62" | "MF61" | "MF62" | "MF-SWIFT" | "SWIFT" => {
            refuse("PROPERTY_FILE_FORMAT", text, *line, NEWER)
        }
        _ => refuse("PROPERTY_FILE_FORMAT", text, *line, OTHER),
    }
}
