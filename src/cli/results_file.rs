//! A file of results of `rfl evaluate`: existing rows, and further rows put beside them.
//!
//! Rows of a comparison may be run apart: the slow ones later, those of a changed model anew after removal of the old
//! ones. Joined results must be comparable: of one vehicle, to its numbers, one plant, one noise and one effort.

use super::output::write_text;
use crate::simulate::StepTimes;
use crate::simulate::experiment::{Condition, CostWeights, Edge, Effort, TableRow};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::error::Error;
use std::path::Path;

/// Contents of a file.
#[derive(Debug, Clone)]
pub(super) struct ResultsFile(Value);

impl ResultsFile {
    /// Reads a file; none if there is none.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read(file: &Path) -> Result<Option<Self>, Box<dyn Error>> {
        if !file.exists() {
            return Ok(None);
        }
        let of = |error: &dyn std::fmt::Display| {
            format!("{}: no file of results ({error}); move it away, or give another --out", file.display())
        };
        let text = std::fs::read_to_string(file).map_err(|error| of(&error))?;
        let there: Value = serde_json::from_str(&text).map_err(|error| of(&error))?;
        if !there["rows"].is_array() {
            return Err(of(&"it has no list of rows").into());
        }
        Ok(Some(Self(there)))
    }

    /// What a run without rows would write: to compare files with it.
    pub fn asked(vehicle: &str, digest: &str, plant: &str, noise: bool, effort: &Effort) -> Self {
        Self(json!({ "vehicle": vehicle, "vehicle_digest": digest, "plant": plant, "noise": noise,
            "effort": effort }))
    }

    /// Results of a condition, so far without its rows.
    fn begun(condition: &Value) -> Self {
        let mut begun = condition.clone();
        (begun["rows"], begun["ablations"]) = (json!([]), json!([]));
        Self(begun)
    }

    /// The first thing in which two results are not comparable, as each has it.
    fn difference(&self, other: &Self) -> Option<[String; 2]> {
        let both = [&self.0, &other.0];
        for (key, what) in
            [("vehicle", "of the vehicle"), ("plant", "of the plant"), ("noise", "with sensor noise =")]
        {
            if both[0][key] != both[1][key] {
                return Some(both.map(|results| format!("{what} {}", results[key])));
            }
        }
        let digests = both.map(|results| results["vehicle_digest"].as_str());
        if let [Some(one), Some(another)] = digests
            && one != another
        {
            let name = &self.0["vehicle"];
            return Some(
                [one, another]
                    .map(|digest| format!("of a vehicle {name} with the numbers of digest {digest}")),
            );
        }
        let efforts = both.map(|results| options(&results["effort"]));
        (efforts[0] != efforts[1]).then_some(efforts)
    }

    /// Refuses rows of what is asked beside those that are there, if they are not comparable.
    ///
    /// # Errors
    /// What differs, and what to do.
    pub fn check(&self, asked: &Self, file: &Path) -> Result<(), Box<dyn Error>> {
        let Some([there, asked]) = self.difference(asked) else { return Ok(()) };
        let advice = "repeat what it was made with, or give another --out";
        Err(format!("{}: holds results {there}; asked for are results {asked}: {advice}", file.display())
            .into())
    }

    /// Refuses further results where it cannot be told whether they are of the same vehicle.
    ///
    /// # Errors
    /// A file that does not tell its vehicle's numbers.
    pub fn check_open(&self, file: &Path) -> Result<(), Box<dyn Error>> {
        if self.0["vehicle_digest"].is_string() {
            return Ok(());
        }
        let what =
            "an earlier rfl made it, which did not write down whether the vehicle has the same numbers";
        Err(format!("{}: {what}: nothing is added; give another --out", file.display()).into())
    }

    /// Names of rows that are there, or that the vehicle does not have.
    pub fn known(&self) -> Vec<&str> {
        let left_out = list(&self.0["left_out"]).iter();
        let rows = list(&self.0["rows"]).iter().map(|row| &row["row"]);
        rows.chain(left_out).filter_map(Value::as_str).collect()
    }

    /// True if a run was stopped after it wrote this: times and edges are missing, perhaps rows.
    pub fn is_unfinished(&self) -> bool {
        self.0["unfinished"] == true
    }

    /// True if there are ablations.
    pub fn has_ablations(&self) -> bool {
        !list(&self.0["ablations"]).is_empty()
    }

    /// The weights that a row found.
    pub fn weights(&self, row: TableRow) -> Option<CostWeights> {
        CostWeights::deserialize(&self.row(row)?["weights"]).ok()
    }

    fn row(&self, row: TableRow) -> Option<&Value> {
        let name = row.name();
        list(&self.0["rows"]).iter().find(|found| found["row"] == *name)
    }

    /// True if a row is there.
    pub fn has(&self, row: TableRow) -> bool {
        self.row(row).is_some()
    }

    /// True for a row that is there, but without the time of a step.
    pub fn lacks_time(&self, row: TableRow) -> bool {
        self.row(row).is_some_and(|row| row["time"].is_null())
    }

    /// Puts in the time of a row's step.
    ///
    /// # Errors
    /// None but a number that JSON cannot hold.
    pub fn set_time(&mut self, row: TableRow, time: &StepTimes) -> Result<(), Box<dyn Error>> {
        let (name, time) = (row.name(), serde_json::to_value(time)?);
        let rows = self.0["rows"].as_array_mut();
        if let Some(row) = rows.and_then(|rows| rows.iter_mut().find(|found| found["row"] == *name)) {
            row["time"] = time;
        }
        Ok(())
    }

    /// Puts in the nominal's edges, of all rows that are there.
    ///
    /// # Errors
    /// None but a number that JSON cannot hold.
    pub fn set_edges(&mut self, edges: &[Edge]) -> Result<(), Box<dyn Error>> {
        self.0["edges"] = serde_json::to_value(edges)?;
        Ok(())
    }

    /// Puts in ablations.
    ///
    /// # Errors
    /// None but a number that JSON cannot hold.
    pub fn set_ablations(&mut self, ablations: &impl Serialize) -> Result<(), Box<dyn Error>> {
        self.0["ablations"] = serde_json::to_value(ablations)?;
        Ok(())
    }

    /// Marks results as those of a run that goes on, or as whole.
    pub fn set_unfinished(&mut self, unfinished: bool) {
        if unfinished {
            self.0["unfinished"] = true.into();
        } else if let Some(results) = self.0.as_object_mut() {
            results.remove("unfinished");
        }
    }

    /// Existing rows, if there are any, with further ones of the same condition, in the order of `all`.
    ///
    /// # Errors
    /// None but a number that JSON cannot hold.
    pub fn with(there: Option<&Self>, further: &Condition, all: &[TableRow]) -> Result<Self, Box<dyn Error>> {
        let further = serde_json::to_value(further)?;
        Ok(there.cloned().unwrap_or_else(|| Self::begun(&further)).joined(&further, all))
    }

    /// Existing rows with the further ones of another file. Rows that both have must have found the same weights; else
    /// they were not made by the same program from the same drives.
    ///
    /// # Errors
    /// A row that is another; another vehicle, plant, noise or effort.
    pub fn join(self, other: &Self, all: &[TableRow]) -> Result<Self, Box<dyn Error>> {
        if let Some([here, there]) = self.difference(other) {
            let advice =
                "make the rows of one of them anew, with the other's options and in a folder of their own";
            return Err(format!("results {here} here, {there} there, are not comparable: {advice}").into());
        }
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
        let (unfinished, told) = (other.is_unfinished(), other.0["vehicle_digest"].is_string());
        let mut joined = self.joined(&other.0, all);
        if unfinished {
            joined.set_unfinished(true);
        }
        if let (false, Some(results)) = (told, joined.0.as_object_mut()) {
            results.remove("vehicle_digest");
        }
        Ok(joined)
    }

    fn joined(mut self, further: &Value, all: &[TableRow]) -> Self {
        let there = &mut self.0;
        let place =
            |name: &Value| all.iter().position(|row| row.name().as_str() == name).unwrap_or(all.len());
        put(&mut there["rows"], &further["rows"], |row| &row["row"], place);
        // Each edge is of all rows that were known then.
        let driven = |results: &Value| list(&results["edges"][0]["rows"]).len();
        if driven(further) > 0 && driven(further) >= driven(there) {
            there["edges"] = further["edges"].clone();
        }
        let rows = there["rows"].clone();
        let mut left_out: Vec<Value> = vec![];
        for name in list(&there["left_out"]).iter().chain(list(&further["left_out"])) {
            if !left_out.contains(name) && !list(&rows).iter().any(|row| row["row"] == *name) {
                left_out.push(name.clone());
            }
        }
        if !left_out.is_empty() {
            there["left_out"] = left_out.into();
        } else if let Some(results) = there.as_object_mut() {
            results.remove("left_out");
        }
        if !list(&further["ablations"]).is_empty() {
            there["ablations"] = further["ablations"].clone();
        }
        self
    }

    /// Writes the file.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), Box<dyn Error>> {
        write(file, &self.0)
    }

    /// For a table.
    pub fn value(&self) -> &Value {
        &self.0
    }
}

/// An effort as it is asked for.
fn options(effort: &Value) -> String {
    let option = |name: &str| format!("--{name} {}", effort[name]);
    format!("made with {}", ["seeds", "drives", "budget"].map(option).join(" "))
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

/// True if a file has the sweep of this vehicle.
///
/// # Errors
/// A file that is none of a sweep, or is of another vehicle.
pub(super) fn has_sweep(file: &Path, vehicle: &str, digest: &str) -> Result<bool, Box<dyn Error>> {
    if !file.exists() {
        return Ok(false);
    }
    let there: Value = serde_json::from_str(&std::fs::read_to_string(file)?)
        .map_err(|error| format!("{}: no sweep ({error}); move it away", file.display()))?;
    if there["vehicle"] == *vehicle && there["vehicle_digest"] == *digest {
        return Ok(true);
    }
    let whose = match there["vehicle"].as_str() {
        Some(other) if other != vehicle => format!("it is of the vehicle {other:?}"),
        Some(_) => "its vehicle has this name and other numbers".to_owned(),
        None => "it does not say of which vehicle it is".to_owned(),
    };
    Err(format!("{}: {whose}; asked for is {vehicle:?}: move it away, or give another --out", file.display())
        .into())
}

/// Writes a sweep with its vehicle.
///
/// # Errors
/// A file that cannot be written.
pub(super) fn write_sweep(
    file: &Path,
    vehicle: &str,
    digest: &str,
    points: &impl Serialize,
) -> Result<(), Box<dyn Error>> {
    write(file, &json!({ "vehicle": vehicle, "vehicle_digest": digest, "points": points }))
}

/// Writes results.
///
/// # Errors
/// A file that cannot be written.
fn write(file: &Path, results: &impl Serialize) -> Result<(), Box<dyn Error>> {
    let text = serde_json::to_string(results)?;
    write_text(file, &text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::experiment::{Predictor, TRUCK_ROWS};

    fn effort(budget: usize) -> Effort {
        Effort { seeds: 3, drives: 1, budget, threads: 0 }
    }

    fn row(name: &str, weight: f64) -> Value {
        let weights = json!({ "q_e1_rate": weight, "q_e2": 1.0, "q_e2_rate": 0.0, "r_rate": 0.1,
            "disturbance_noise": 0.0, "prediction_noise": 0.0 });
        json!({ "row": name, "weights": weights, "time": null })
    }

    fn file(rows: &[Value]) -> Value {
        json!({ "vehicle": "truck", "vehicle_digest": "1a", "plant": "low_delay", "noise": false,
            "effort": effort(24), "rows": rows, "left_out": ["GP-NMPC"], "edges": [{ "rows": [["MPC", 1]] }] })
    }

    fn asked(vehicle: &str, digest: &str, plant: &str, noise: bool, budget: usize) -> ResultsFile {
        ResultsFile::asked(vehicle, digest, plant, noise, &effort(budget))
    }

    fn names(results: &ResultsFile) -> Vec<&str> {
        list(&results.0["rows"]).iter().filter_map(|row| row["row"].as_str()).collect()
    }

    #[test]
    fn a_sweep_is_of_one_vehicle() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("sweep.json");
        assert!(!has_sweep(&file, "truck", "1a").unwrap());
        write_sweep(&file, "truck", "1a", &[1, 2]).unwrap();
        assert!(has_sweep(&file, "truck", "1a").unwrap());
        for (name, digest, words) in [("truck", "2b", "other numbers"), ("bus", "1a", "\"truck\"")] {
            let said = has_sweep(&file, name, digest).unwrap_err().to_string();
            assert!(said.contains(words) && said.contains("sweep.json"), "{said}");
        }
        std::fs::write(&file, "[]").unwrap();
        assert!(has_sweep(&file, "truck", "1a").is_err());
    }

    #[test]
    fn further_rows_stand_in_the_order_of_the_tables_and_none_twice() {
        let there = ResultsFile(file(&[row("MPC", 0.3), row("NMPC", 2.0)]));
        assert_eq!(there.known(), ["MPC", "NMPC", "GP-NMPC"]);
        assert_eq!(there.weights(TableRow::NOMINAL).unwrap().q_e1_rate, 0.3);
        assert!(there.weights(TableRow::plain(Predictor::Rfl)).is_none());
        let mut further = file(&[row("GP-NMPC", 1.0), row("RFL", 1.0), row("MPC", 0.3)]);
        further["left_out"] = json!([]);
        further["edges"][0]["rows"] = json!([["MPC", 7], ["RFL", 2]]);
        let all = there.joined(&further, TRUCK_ROWS);
        assert_eq!(names(&all), ["MPC", "RFL", "NMPC", "GP-NMPC"]);
        assert_eq!(all.0["edges"][0]["rows"], json!([["MPC", 7], ["RFL", 2]]));
        assert!(all.0["left_out"].is_null());
    }

    #[test]
    fn rows_that_come_one_by_one_give_the_same_bytes_as_rows_that_come_together() {
        let mut whole = file(&[row("MPC", 0.1 + 0.2), row("RFL", 1e-7 / 3.0), row("NMPC", 2.0)]);
        let together = ResultsFile::begun(&whole).joined(&whole, TRUCK_ROWS);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("low_delay.json");
        let rows = whole["rows"].take();
        whole["rows"] = json!([rows[0], rows[2]]);
        let mut part = ResultsFile::begun(&whole).joined(&whole, TRUCK_ROWS);
        part.set_unfinished(true);
        part.write(&path).unwrap();
        let part = ResultsFile::read(&path).unwrap().unwrap();
        assert!(part.is_unfinished() && !together.is_unfinished());
        whole["rows"] = json!([rows[1]]);
        let mut joined = part.joined(&whole, TRUCK_ROWS);
        joined.set_unfinished(false);
        assert_eq!(joined.0.to_string(), together.0.to_string());
    }

    #[test]
    fn rows_of_another_comparison_are_not_joined() {
        let there = || ResultsFile(file(&[row("MPC", 0.3), row("NMPC", 2.0)]));
        let joined = there().join(&ResultsFile(file(&[row("MPC", 0.3), row("RF", 1.0)])), TRUCK_ROWS);
        assert_eq!(names(&joined.unwrap()), ["MPC", "RF", "NMPC"]);
        let refused = |other: Value| there().join(&ResultsFile(other), TRUCK_ROWS).unwrap_err().to_string();
        assert!(refused(file(&[row("MPC", 0.4), row("RF", 1.0)])).contains("MPC"));
        let mut other = file(&[row("MPC", 0.3)]);
        other["effort"] = json!(effort(12));
        let error = refused(other);
        assert!(error.contains("--budget 24 here") && error.contains("--budget 12 there"), "{error}");
        let mut other = file(&[row("MPC", 0.3)]);
        other["vehicle_digest"] = json!("2b");
        let error = refused(other);
        assert!(error.contains("1a here") && error.contains("2b there"), "{error}");
    }

    #[test]
    fn results_of_earlier_programs_are_joined_and_get_no_further_rows() {
        let mut old = file(&[row("MPC", 0.3), row("RF", 1.0)]);
        old.as_object_mut().unwrap().remove("vehicle_digest");
        let old = ResultsFile(old);
        assert!(old.check(&asked("truck", "1a", "low_delay", false, 24), Path::new("x.json")).is_ok());
        let error = old.check_open(Path::new("x.json")).unwrap_err().to_string();
        assert!(error.contains("x.json") && error.contains("--out"), "{error}");
        let new = ResultsFile(file(&[row("MPC", 0.3)]));
        assert!(new.check_open(Path::new("x.json")).is_ok());
        // What holds rows of unknown numbers does not claim known ones.
        let joined = new.join(&old, TRUCK_ROWS).unwrap();
        assert_eq!(names(&joined), ["MPC", "RF"]);
        assert!(joined.check_open(Path::new("x.json")).is_err());
    }

    #[test]
    fn results_of_another_effort_vehicle_plant_or_noise_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("low_delay.json");
        assert!(ResultsFile::read(&path).unwrap().is_none());
        write(&path, &file(&[])).unwrap();
        let there = ResultsFile::read(&path).unwrap().unwrap();
        assert!(there.check(&asked("truck", "1a", "low_delay", false, 24), &path).is_ok());
        for (other, words) in [
            (asked("truck", "1a", "low_delay", false, 12), "--budget 12"),
            (asked("car", "1a", "low_delay", false, 24), "vehicle \"car\""),
            (asked("truck", "2b", "low_delay", false, 24), "numbers of digest 2b"),
            (asked("truck", "1a", "high_delay", false, 24), "plant \"high_delay\""),
            (asked("truck", "1a", "low_delay", true, 24), "noise = true"),
        ] {
            let error = there.check(&other, &path).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains("--out"), "{error}");
        }
        for broken in ["{", "[]", "{}"] {
            std::fs::write(&path, broken).unwrap();
            assert!(ResultsFile::read(&path).unwrap_err().to_string().contains("move it away"), "{broken}");
        }
    }
}
