//! A file of results of `rfl evaluate`: what is there already, and further rows put beside it.
//!
//! Rows of a comparison may be run apart: the slow ones later, those of a changed model anew after the old ones were taken
//! out. What is put together must be comparable: of one vehicle and one effort.

use crate::simulate::experiment::{Effort, Row, Weights};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::error::Error;
use std::path::Path;

/// What a file holds.
pub(super) struct ResultsFile(Value);

impl ResultsFile {
    /// Reads a file; none if there is none.
    ///
    /// # Errors
    /// A file that cannot be read, or of another vehicle or effort.
    pub fn read(file: &Path, vehicle: &str, effort: &Effort) -> Result<Option<Self>, Box<dyn Error>> {
        if !file.exists() {
            return Ok(None);
        }
        let of =
            |error: &dyn std::fmt::Display| format!("{}: {error}; delete it to begin anew", file.display());
        let text = std::fs::read_to_string(file).map_err(|error| of(&error))?;
        let there: Value = serde_json::from_str(&text).map_err(|error| of(&error))?;
        if there["vehicle"] != vehicle {
            return Err(
                of(&format!("holds results of the vehicle {}, not {vehicle}", there["vehicle"])).into()
            );
        }
        for (name, asked) in [("seeds", effort.seeds), ("drives", effort.drives), ("budget", effort.budget)] {
            if there["effort"][name] != asked {
                let found = &there["effort"][name];
                return Err(of(&format!("was made with {name} = {found}, and {asked} is asked for")).into());
            }
        }
        Ok(Some(Self(there)))
    }

    /// The rows that are there, by name.
    pub fn rows(&self) -> Vec<&str> {
        list(&self.0["rows"]).iter().filter_map(|row| row["row"].as_str()).collect()
    }

    /// The weights that a row found.
    pub fn weights(&self, row: Row) -> Option<Weights> {
        let name = row.name();
        let found = list(&self.0["rows"]).iter().find(|found| found["row"] == *name)?;
        Weights::deserialize(&found["weights"]).ok()
    }

    /// What is there with further rows of the same condition, in the order of `all`.
    ///
    /// # Errors
    /// None but a number that JSON cannot hold.
    pub fn with(mut self, further: &impl Serialize, all: &[Row]) -> Result<Value, Box<dyn Error>> {
        let further = serde_json::to_value(further)?;
        let there = &mut self.0;
        let place =
            |name: &Value| all.iter().position(|row| row.name().as_str() == name).unwrap_or(all.len());
        put(&mut there["rows"], &further["rows"], |row| &row["row"], place);
        if further["edge"].is_object() {
            if there["edge"].is_object() {
                put(&mut there["edge"]["rows"], &further["edge"]["rows"], |row| &row[0], place);
            } else {
                there["edge"] = further["edge"].clone();
            }
        }
        let known = there["rows"].clone();
        let left_out: Vec<Value> = list(&there["left_out"])
            .iter()
            .chain(list(&further["left_out"]))
            .filter(|name| !list(&known).iter().any(|row| row["row"] == **name))
            .cloned()
            .collect();
        there["left_out"] = left_out.into();
        if !list(&further["ablations"]).is_empty() {
            there["ablations"] = further["ablations"].clone();
        }
        Ok(self.0)
    }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// Puts rows into a list where it has none of their names, and sorts it.
fn put(there: &mut Value, further: &Value, name: impl Fn(&Value) -> &Value, place: impl Fn(&Value) -> usize) {
    let mut rows = list(there).to_vec();
    for row in list(further) {
        if !rows.iter().any(|known| name(known) == name(row)) {
            rows.push(row.clone());
        }
    }
    rows.sort_by_key(|row| place(name(row)));
    *there = rows.into();
}

/// Writes results.
///
/// # Errors
/// A file that cannot be written.
pub(super) fn write(file: &Path, results: &impl Serialize) -> Result<(), Box<dyn Error>> {
    let text = serde_json::to_string(results)?;
    Ok(std::fs::write(file, text).map_err(|error| format!("{}: {error}", file.display()))?)
}
