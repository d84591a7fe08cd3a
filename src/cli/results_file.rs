//! A file of results of `rfl evaluate`: existing rows, and further rows put beside them.
//!
//! Rows of a comparison may be run apart: the slow ones later, those of a changed model anew after removal of the old
//! ones. Joined results must be comparable: of one vehicle and one effort.

use super::output::write_text;
use crate::simulate::experiment::{CostWeights, Effort, TableRow};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::error::Error;
use std::path::Path;

/// Contents of a file.
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

    /// The existing rows, by name.
    pub fn rows(&self) -> Vec<&str> {
        list(&self.0["rows"]).iter().filter_map(|row| row["row"].as_str()).collect()
    }

    /// The weights that a row found.
    pub fn weights(&self, row: TableRow) -> Option<CostWeights> {
        let name = row.name();
        let found = list(&self.0["rows"]).iter().find(|found| found["row"] == *name)?;
        CostWeights::deserialize(&found["weights"]).ok()
    }

    /// Existing rows with further ones of the same condition, in the order of `all`.
    ///
    /// # Errors
    /// None but a number that JSON cannot hold.
    pub fn with(self, further: &impl Serialize, all: &[TableRow]) -> Result<Value, Box<dyn Error>> {
        Ok(self.joined(&serde_json::to_value(further)?, all))
    }

    /// Existing rows with the further ones of another file. Rows that both have must have found the same weights; else
    /// they were not made by the same program from the same drives.
    ///
    /// # Errors
    /// A row that is another.
    pub fn join(self, other: &Self, all: &[TableRow]) -> Result<Value, Box<dyn Error>> {
        for row in list(&other.0["rows"]) {
            let known = list(&self.0["rows"]).iter().find(|known| known["row"] == row["row"]);
            if known.is_some_and(|known| known["weights"] != row["weights"]) {
                let name = &row["row"];
                return Err(format!(
                    "the row {name} found other weights there: these are not the same comparison"
                )
                .into());
            }
        }
        Ok(self.joined(&other.0, all))
    }

    fn joined(mut self, further: &Value, all: &[TableRow]) -> Value {
        let there = &mut self.0;
        let place =
            |name: &Value| all.iter().position(|row| row.name().as_str() == name).unwrap_or(all.len());
        put(&mut there["rows"], &further["rows"], |row| &row["row"], place);
        // Each edge is of all rows that were known then.
        let driven = |results: &Value| list(&results["edges"][0]["rows"]).len();
        if driven(further) >= driven(there) {
            there["edges"] = further["edges"].clone();
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
        self.0
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
    write_text(file, &text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::experiment::{Predictor, TRUCK_ROWS};
    use serde_json::json;

    fn effort(budget: usize) -> Effort {
        Effort { seeds: 3, drives: 1, budget, threads: 0 }
    }

    fn row(name: &str, weight: f64) -> Value {
        let weights = json!({ "q_e1_rate": weight, "q_e2": 1.0, "q_e2_rate": 0.0, "r_rate": 0.1,
            "disturbance_noise": 0.0, "prediction_noise": 0.0 });
        json!({ "row": name, "weights": weights })
    }

    fn file(rows: &[Value]) -> Value {
        json!({ "vehicle": "truck", "effort": effort(24), "rows": rows, "left_out": ["GP-NMPC"],
            "edges": [{ "rows": [["MPC", 1]] }] })
    }

    fn names(value: &Value) -> Vec<&str> {
        list(&value["rows"]).iter().filter_map(|row| row["row"].as_str()).collect()
    }

    #[test]
    fn further_rows_stand_in_the_order_of_the_tables_and_none_twice() {
        let there = ResultsFile(file(&[row("MPC", 0.3), row("NMPC", 2.0)]));
        assert_eq!(there.rows(), ["MPC", "NMPC"]);
        assert_eq!(there.weights(TableRow::NOMINAL).unwrap().q_e1_rate, 0.3);
        assert!(there.weights(TableRow::plain(Predictor::Rfl)).is_none());
        let mut further = file(&[row("GP-NMPC", 1.0), row("RFL", 1.0), row("MPC", 0.3)]);
        further["left_out"] = json!([]);
        further["edges"][0]["rows"] = json!([["MPC", 7], ["RFL", 2]]);
        let all = there.with(&further, TRUCK_ROWS).unwrap();
        assert_eq!(names(&all), ["MPC", "RFL", "NMPC", "GP-NMPC"]);
        assert_eq!(all["edges"][0]["rows"], json!([["MPC", 7], ["RFL", 2]]));
        assert_eq!(all["left_out"], json!([]));
    }

    #[test]
    fn rows_of_another_comparison_are_not_joined() {
        let there = || ResultsFile(file(&[row("MPC", 0.3), row("NMPC", 2.0)]));
        let joined = there().join(&ResultsFile(file(&[row("MPC", 0.3), row("RF", 1.0)])), TRUCK_ROWS);
        assert_eq!(names(&joined.unwrap()), ["MPC", "RF", "NMPC"]);
        let error = there().join(&ResultsFile(file(&[row("MPC", 0.4), row("RF", 1.0)])), TRUCK_ROWS);
        assert!(error.unwrap_err().to_string().contains("MPC"));
    }

    #[test]
    fn results_of_another_effort_or_vehicle_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("low_delay.json");
        assert!(ResultsFile::read(&path, "truck", &effort(24)).unwrap().is_none());
        write(&path, &file(&[])).unwrap();
        assert!(ResultsFile::read(&path, "truck", &effort(24)).unwrap().is_some());
        let refused = |vehicle: &str, budget: usize| {
            let read = ResultsFile::read(&path, vehicle, &effort(budget));
            read.err().unwrap().to_string()
        };
        assert!(refused("truck", 12).contains("budget = 24, and 12"), "{}", refused("truck", 12));
        assert!(refused("car", 24).contains("vehicle"));
        std::fs::write(&path, "{").unwrap();
        assert!(refused("truck", 24).contains("delete it"));
    }
}
