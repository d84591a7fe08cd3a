//! Rows of one vehicle, or of one of something else, in a file with the rows of several.

use super::error::LogError;
use crate::signal::as_written;
use crate::table::{Header, Row};
use std::collections::BTreeSet;
use std::path::Path;
use std::str::FromStr;

/// Columns that say of which vehicle a row is.
const VEHICLES: [&str; 10] = [
    "vehicle_id",
    "vehicle",
    "vehicle_name",
    "car_id",
    "car_name",
    "vin",
    "actor_id",
    "agent_id",
    "track_id",
    "trackid",
];
/// Most vehicles of a file: a column with more of them is another quantity.
const MOST: usize = 1000;
/// Vehicles that are named in a message.
const NAMED: usize = 5;

/// Choice of rows: those with a value in a column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Only {
    /// The column, by its name in the file.
    pub column: String,
    /// The value, as it is written there.
    pub value: String,
}

impl FromStr for Only {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((column, value)) if !column.trim().is_empty() && !value.trim().is_empty() => {
                Ok(Self { column: column.trim().to_owned(), value: value.trim().to_owned() })
            }
            _ => Err("write it as COLUMN=VALUE, as in vehicle_id=7".to_owned()),
        }
    }
}

/// Rows that are taken.
pub(super) struct Selection<'a> {
    only: Option<&'a Only>,
    /// The column that tells, and its name.
    told: Option<(usize, String)>,
    seen: BTreeSet<String>,
}

impl<'a> Selection<'a> {
    /// # Errors
    /// No column of that name.
    pub fn of(header: &Header, only: Option<&'a Only>, file: &Path) -> Result<Self, LogError> {
        let named = |wanted: &dyn Fn(&str) -> bool| {
            let place = header.names.iter().position(|name| wanted(name))?;
            Some((place, header.names[place].clone()))
        };
        let told = match only {
            Some(only) => Some(
                named(&|name| name == only.column)
                    .or_else(|| named(&|name| as_written(name) == as_written(&only.column)))
                    .ok_or_else(|| LogError::NoSuchColumn {
                        file: file.to_owned(),
                        column: only.column.clone(),
                        header: header.written.iter().take(12).cloned().collect::<Vec<_>>().join(", "),
                    })?,
            ),
            None => named(&|name| VEHICLES.contains(&as_written(name).as_str())),
        };
        Ok(Self { only, told, seen: BTreeSet::new() })
    }

    /// True if a row is one of those.
    pub fn takes(&mut self, row: &Row<'_>) -> bool {
        let Some((place, _)) = &self.told else { return true };
        let value = row.field(*place);
        if !row.is_missing(*place) && self.seen.len() <= MOST && !self.seen.contains(value) {
            self.seen.insert(value.chars().take(40).collect());
        }
        self.only.is_none_or(|only| only.value == value)
    }

    /// # Errors
    /// Rows of several vehicles and no choice, or a choice without a row.
    pub fn check(self, rows: usize, file: &Path) -> Result<(), LogError> {
        let Some((_, column)) = self.told else { return Ok(()) };
        let values = || {
            let mut named: Vec<String> = self.seen.iter().take(NAMED).cloned().collect();
            if self.seen.len() > NAMED {
                named.push("...".to_owned());
            }
            named.join(", ")
        };
        let file = file.to_owned();
        match self.only {
            Some(only) if rows == 0 => {
                let value = only.value.clone();
                Err(LogError::NoSuchValue { file, column, value, values: values() })
            }
            None if (2..=MOST).contains(&self.seen.len()) => {
                let (count, values) = (self.seen.len(), values());
                let first = self.seen.into_iter().next().unwrap_or_default();
                Err(LogError::SeveralVehicles { file, column, count, values, first })
            }
            _ => Ok(()),
        }
    }
}
