//! A drive log's columns from a CSV file.

use crate::signal;
use std::path::{Path, PathBuf};

/// Why a log cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LogError {
    #[error("{}: {source}; check the name and the permission", file.display())]
    Open { file: PathBuf, source: std::io::Error },
    #[error("{}: {source}; a drive log is a CSV file with a header, commas and the same number of columns in each line", file.display())]
    Csv { file: PathBuf, source: csv::Error },
    #[error("{}: this build reads no compressed files (feature `cli`); unpack it first", file.display())]
    Compressed { file: PathBuf },
    #[error("{}: no column is a signal of a drive log: the header is `{header}`; give columns such as time, steer_cmd, vx", file.display())]
    NoSignal { file: PathBuf, header: String },
    #[error("{}: the column '{column}' stands twice; delete one", file.display())]
    Twice { file: PathBuf, column: &'static str },
    #[error("{}, line {line}, column {column}: '{text}' is not a number", file.display())]
    NotANumber { file: PathBuf, line: u64, column: &'static str, text: String },
    #[error("{}: column '{column}' is missing; a log to learn from needs {needed}", file.display())]
    Missing { file: PathBuf, column: &'static str, needed: &'static str },
    #[error(
        "{}: {} missing; give the road that was driven (--path ROAD.csv), and they are computed from x, y, yaw, vx, vy \
         and yaw_rate{}",
        file.display(), listed(columns), lacking(pose)
    )]
    NoErrors { file: PathBuf, columns: Vec<&'static str>, pose: Vec<&'static str> },
    #[error(
        "{}: the vehicle is more than {limit} m from the road in {share:.0} % of the rows: is {} the road that was \
         driven, and are x and y in metres?",
        file.display(), road.display()
    )]
    FarFromRoad { file: PathBuf, road: PathBuf, limit: f64, share: f64 },
    #[error(
        "{}: the heading is more than {limit} rad off the road's in {share:.0} % of the rows: yaw may be from north; \
         give it from the x axis, counter-clockwise, in radians. Or was the road driven the other way?",
        file.display()
    )]
    Heading { file: PathBuf, limit: f64, share: f64 },
    #[error("{}: yaw changes {factor:.3} times as fast as yaw_rate says; {hint}", file.display())]
    Turn { file: PathBuf, factor: f64, hint: &'static str },
}

fn listed(columns: &[&str]) -> String {
    match columns {
        [one] => format!("column '{one}' is"),
        many => format!("columns {} are", many.join(", ")),
    }
}

fn lacking(pose: &[&str]) -> String {
    if pose.is_empty() { String::new() } else { format!("; of these, {} also missing", listed(pose)) }
}

/// A recorded drive: columns by the names of the vocabulary.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveLog {
    /// Where it was read from.
    pub file: PathBuf,
    columns: Vec<(&'static str, Vec<f64>)>,
}

impl DriveLog {
    /// Reads a log, compressed if its name ends in `.gz`. An empty field is not a number: a gap, which whoever uses the log leaves out.
    ///
    /// # Errors
    /// What is wrong, with file, line and column.
    pub fn read(file: &Path) -> Result<Self, LogError> {
        let opened = std::fs::File::open(file);
        let opened = opened.map_err(|source| LogError::Open { file: file.to_owned(), source })?;
        let compressed = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
        if compressed { Self::from_compressed(opened, file) } else { Self::from_reader(opened, file) }
    }

    #[cfg(feature = "cli")]
    fn from_compressed(reader: impl std::io::Read, file: &Path) -> Result<Self, LogError> {
        Self::from_reader(flate2::read::MultiGzDecoder::new(reader), file)
    }

    #[cfg(not(feature = "cli"))]
    fn from_compressed(_: impl std::io::Read, file: &Path) -> Result<Self, LogError> {
        Err(LogError::Compressed { file: file.to_owned() })
    }

    /// As [`read`](Self::read); `file` is what messages call it.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_reader(reader: impl std::io::Read, file: &Path) -> Result<Self, LogError> {
        let csv_error = |source| LogError::Csv { file: file.to_owned(), source };
        let mut reader = csv::Reader::from_reader(reader);
        let header = reader.headers().map_err(csv_error)?.clone();
        let mut places: Vec<usize> = Vec::new();
        let mut columns: Vec<(&'static str, Vec<f64>)> = Vec::new();
        for (place, name) in header.iter().enumerate() {
            // Spreadsheets put a byte order mark before the first name.
            let Some(signal) = signal::find(name.trim_start_matches('\u{feff}').trim()) else { continue };
            if columns.iter().any(|(name, _)| *name == signal.name) {
                return Err(LogError::Twice { file: file.to_owned(), column: signal.name });
            }
            places.push(place);
            columns.push((signal.name, Vec::new()));
        }
        if columns.is_empty() {
            let header = header.iter().take(8).collect::<Vec<_>>().join(",").escape_default().to_string();
            return Err(LogError::NoSignal { file: file.to_owned(), header });
        }
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record).map_err(csv_error)? {
            for (place, (column, values)) in places.iter().zip(&mut columns) {
                let text = record.get(*place).unwrap_or_default().trim();
                let value = if text.is_empty() { Ok(f64::NAN) } else { text.parse() };
                values.push(value.map_err(|_| LogError::NotANumber {
                    file: file.to_owned(),
                    line: record.position().map_or(0, csv::Position::line),
                    column,
                    text: text.chars().take(40).collect(),
                })?);
            }
        }
        Ok(Self { file: file.to_owned(), columns })
    }

    /// A column, if the log has it; all are of one length.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(column, _)| *column == name).map(|(_, values)| values.as_slice())
    }

    /// All columns with their names.
    pub fn columns(&self) -> impl Iterator<Item = (&'static str, &[f64])> {
        self.columns.iter().map(|(name, values)| (*name, values.as_slice()))
    }

    /// Those of `names` that the log has not.
    #[must_use]
    pub fn without(&self, names: &[&'static str]) -> Vec<&'static str> {
        names.iter().copied().filter(|name| self.column(name).is_none()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(text: &str) -> Result<DriveLog, LogError> {
        DriveLog::from_reader(text.as_bytes(), Path::new("a.csv"))
    }

    #[test]
    fn known_columns_are_read_in_any_order_and_others_left_alone() {
        let log = log("\u{feff}vx, remark ,time\n1.5,slow,0\n,,0.02\n").unwrap();
        assert_eq!(log.column("time"), Some(&[0.0, 0.02][..]));
        assert!(log.column("vx").unwrap()[1].is_nan());
        assert_eq!(log.column("remark"), None);
        assert_eq!(log.without(&["vx", "vy"]), ["vy"]);
    }

    #[test]
    fn what_is_no_log_is_refused_with_its_place() {
        for (text, words) in [
            ("", "no column is a signal"),
            ("a,b\n1,2\n", "`a,b`"),
            ("time,vx,vx\n", "'vx' stands twice"),
            ("time,vx\n0,1\n0.02,fast\n", "a.csv, line 3, column vx: 'fast'"),
            ("time,vx\n0,1\n0.02\n", "same number of columns"),
            ("time,vx\n0,\u{1}\u{2}\n", "is not a number"),
        ] {
            let error = log(text).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
