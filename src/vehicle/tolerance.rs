//! Uncertainty of the numbers of a vehicle file: standard deviations that its user knows better than the diagnosis
//! does.
//!
//! ```toml
//! [tolerance]
//! vehicle.mass = 20.0          # weighed, kg
//! effect.steer_gain = 0.003    # ratio from the drawing
//! ```
//!
//! Names and units are those of `inputs.tolerances` in `report.json`.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Standard deviations by name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, Entry>", into = "BTreeMap<String, f64>")]
pub struct Tolerances(BTreeMap<String, f64>);

/// A number, or names below a name: TOML takes `vehicle.mass` for the latter.
#[derive(Deserialize)]
#[serde(untagged)]
enum Entry {
    Number(f64),
    Below(BTreeMap<String, Entry>),
}

impl Tolerances {
    /// True if there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Of a name, if it stands in the file.
    #[must_use]
    pub fn of(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// All names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    fn add(&mut self, name: &str, entry: Entry) -> Result<(), String> {
        match entry {
            Entry::Number(value) if value.is_finite() && value >= 0.0 => {
                self.0.insert(name.to_owned(), value);
                Ok(())
            }
            Entry::Number(value) => {
                Err(format!("tolerance.{name} = {value}: a standard deviation is a number of 0 or more"))
            }
            Entry::Below(all) => {
                all.into_iter().try_for_each(|(below, entry)| self.add(&format!("{name}.{below}"), entry))
            }
        }
    }
}

impl TryFrom<BTreeMap<String, Entry>> for Tolerances {
    type Error = String;

    fn try_from(all: BTreeMap<String, Entry>) -> Result<Self, String> {
        let mut found = Self::default();
        all.into_iter().try_for_each(|(name, entry)| found.add(&name, entry))?;
        Ok(found)
    }
}

impl From<Tolerances> for BTreeMap<String, f64> {
    fn from(all: Tolerances) -> Self {
        all.0
    }
}
