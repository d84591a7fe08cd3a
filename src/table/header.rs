//! Names and units of a table's columns.

use super::unit::split_unit;

/// The names of a table's columns, as far as the file gives them.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Header {
    /// Names without units, trimmed; a trailing nameless column is left out.
    pub names: Vec<String>,
    /// The unit of each column, from `name [unit]` or the row of units below.
    pub units: Vec<Option<String>>,
    /// Names as they stand in the file.
    pub written: Vec<String>,
    /// The line of the names, counted from 1; 0 in a file without any.
    pub line: u64,
}

impl Header {
    /// Of columns that come from no file, each `name` or `name [unit]`.
    #[must_use]
    pub fn of(names: &[String]) -> Self {
        of_names(names, None)
    }
}

/// Names and units of columns: `name [unit]`, or the unit below.
pub(super) fn of_names(names: &[String], units: Option<&[String]>) -> Header {
    let mut header = Header::default();
    for (index, written) in names.iter().enumerate() {
        let (name, unit) = split_unit(written);
        let below =
            units.and_then(|units| units.get(index)).map(|unit| unit.trim_matches(['[', ']', '(', ')', ' ']));
        let unit = unit.or(below).filter(|unit| !matches!(*unit, "" | "-"));
        header.names.push(name.to_owned());
        header.units.push(unit.map(str::to_owned));
        header.written.push(written.clone());
    }
    header
}
