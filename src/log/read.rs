//! A drive log's columns from a table.
//!
//! | input | output |
//! |---|---|
//! | names of the vocabulary, `name [unit]`, a row of units | signals, in our units |
//! | dates or times of day in column `time` | seconds since the whole second of the first one |
//! | an empty field, or a word for none | NaN: a gap |

use super::error::LogError;
use super::finding::{Finding, FindingSeverity};
use super::only::{Only, Selection};
use crate::signal::{self, ARTICULATION};
use crate::table::{self, Limits, Table, TableError, time};
use std::path::{Path, PathBuf};

/// The damage of a packed file, where a faulty row comes of that.
fn of_damage(fault: LogError, file: &Path, limits: Limits) -> LogError {
    let (LogError::RowLength { line, .. } | LogError::NotANumber { line, .. }) = fault else { return fault };
    match table::open(file, limits).map(|mut reader| std::io::copy(&mut reader, &mut std::io::sink())) {
        Ok(Err(source)) => {
            LogError::Table { file: file.to_owned(), source: TableError::Broken { line, source } }
        }
        _ => fault,
    }
}

/// Seconds in a day.
const DAY: i64 = 86_400;

/// A time of day on the day on which it is nearest to the time before it: drives may pass midnight. Dates have their day.
fn on_its_day(time: i64, before: i64) -> i64 {
    if !(0..=DAY).contains(&time) {
        return time;
    }
    time + DAY * (before - time + DAY / 2).div_euclid(DAY)
}

/// The signal that a column is: by its name, or, where no other column has it, by its name in other letters (`Time`).
fn named(name: &str, header: &table::Header) -> Option<&'static signal::Signal> {
    let is_taken = |signal: &&signal::Signal| header.names.iter().any(|other| other == signal.name);
    let otherwise = || signal::find(&signal::as_written(name)).filter(|signal| !is_taken(signal));
    signal::find(name).or_else(otherwise)
}

/// Parts of the names that other tools give to a signal.
fn other_names(column: &str) -> &'static [&'static str] {
    match column {
        "time" => &["time", "stamp", "sec", "ticks"],
        "vx" => &["vx", "speed", "velocity"],
        "yaw_rate" => &["yaw", "gyro", "psi"],
        "steer_cmd" | "steer" => &["steer", "swa", "wheel_angle", "wheelangle"],
        _ => &[],
    }
}

/// A recorded drive: columns by the names of the vocabulary.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveLog {
    /// File from which it was read.
    pub file: PathBuf,
    /// Conversions: units that the file gives, dates. They belong to the findings.
    pub notes: Vec<String>,
    /// Signals that were not read, for their units are unknown. They belong to the findings, too.
    pub warnings: Vec<String>,
    columns: Vec<(&'static str, Vec<f64>)>,
    /// Columns of the file that are no signals, as they are written there.
    unread: Vec<String>,
}

/// A column that is read: its place in the file, and the factor of its unit.
struct LogColumn {
    place: usize,
    factor: f64,
}

/// Signals without which a log is another one: their units must be known.
const NEEDED: [&str; 5] = ["time", "steer_cmd", "steer", "vx", "yaw_rate"];

/// Lines at a log's end that are no rows, a cut-off one or a tool's summary: so many are left out ...
const CLOSING: u64 = 3;
/// ... behind so many rows for each.
const LEAST_BEFORE: u64 = 10;

/// The values of a row after another.
struct RowReader<'a> {
    file: &'a Path,
    places: Vec<LogColumn>,
    /// Number of columns of the file.
    expected: usize,
    /// Seconds of the first date: the log's zero.
    zero: Option<i64>,
    /// Those of the latest one.
    last: i64,
}

impl RowReader<'_> {
    /// Reads a row's values; `before` holds the columns of the rows before.
    ///
    /// # Errors
    /// The row is too short or too long, or has a word in place of a number.
    fn read(
        &mut self,
        row: &table::Row<'_>,
        before: &[(&'static str, Vec<f64>)],
        values: &mut [f64],
    ) -> Result<(), LogError> {
        let found = row.filled(self.expected);
        if found != self.expected {
            let file = self.file.to_owned();
            return Err(LogError::RowLength { file, line: row.line, found, expected: self.expected });
        }
        for ((column, (name, earlier)), value) in self.places.iter().zip(before).zip(values) {
            let text = row.field(column.place);
            let read = if row.is_missing(column.place) {
                Some(f64::NAN)
            } else if let Some((whole, part)) = time::seconds(text).filter(|_| *name == "time") {
                // Dates and numbers in one column are no clock.
                let is_date = earlier.is_empty() || self.zero.is_some();
                self.last = self.zero.map_or(whole, |_| on_its_day(whole, self.last));
                let last = self.last;
                is_date.then(|| (last - *self.zero.get_or_insert(last)) as f64 + part)
            } else {
                row.number(column.place).filter(|_| self.zero.is_none() || *name != "time").map(|value| {
                    // Not a product with 1: a NaN's sign, say, stays as it is.
                    if column.factor == 1.0 { value } else { column.factor * value }
                })
            };
            *value = read.ok_or_else(|| LogError::NotANumber {
                file: self.file.to_owned(),
                line: row.line,
                column: name,
                text: row.field(column.place).chars().take(60).collect(),
            })?;
        }
        Ok(())
    }
}

impl DriveLog {
    /// Reads a log, packed or not, however its table is written ([`crate::table`]). An empty field is not a number: a
    /// gap, which users of the log leave out.
    ///
    /// # Errors
    /// The fault, with file, line and column.
    pub fn read(file: &Path) -> Result<Self, LogError> {
        Self::read_within(file, Limits::default(), None)
    }

    /// As [`read`](Self::read), with limits of its size, and with a choice of its rows where it holds those of several vehicles.
    ///
    /// # Errors
    /// As [`read`](Self::read); rows of several vehicles without a choice.
    pub fn read_within(file: &Path, limits: Limits, only: Option<&Only>) -> Result<Self, LogError> {
        let opened = table::open(file, limits).map_err(|source| match source {
            TableError::Io(source) => LogError::Open { file: file.to_owned(), source },
            TableError::Compressed => LogError::Compressed { file: file.to_owned() },
            source => LogError::Table { file: file.to_owned(), source },
        })?;
        Self::from_reader_within(opened, file, limits, only).map_err(|fault| of_damage(fault, file, limits))
    }

    /// Gives a log without time stamps those of a constant rate, in Hz.
    ///
    /// # Errors
    /// The log has time stamps.
    pub fn at_rate(mut self, rate: f64) -> Result<Self, LogError> {
        if self.column("time").is_some() {
            return Err(LogError::TimeAndRate { file: self.file });
        }
        let rows = self.columns.first().map_or(0, |(_, values)| values.len());
        self.columns.insert(0, ("time", (0..rows).map(|row| row as f64 / rate).collect()));
        self.notes.push(format!("time: made from the rate of {rate} Hz"));
        Ok(self)
    }

    /// As [`read`](Self::read); `file` is the name in messages.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_reader(reader: impl std::io::Read, file: &Path) -> Result<Self, LogError> {
        Self::from_reader_within(reader, file, Limits::default(), None)
    }

    /// As [`from_reader`](Self::from_reader), with limits of its size, and a choice of its rows.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_reader_within(
        reader: impl std::io::Read,
        file: &Path,
        limits: Limits,
        only: Option<&Only>,
    ) -> Result<Self, LogError> {
        let broken = |source| LogError::Table { file: file.to_owned(), source };
        let known = |name: &str| signal::find(&signal::as_written(name)).is_some();
        let mut table = Table::new(reader, limits, &known).map_err(broken)?;
        let mut log = Self::empty(file);
        let places = log.places(table.header())?;
        let mut selection = Selection::of(table.header(), only, file)?;
        let mut rows = RowReader { file, places, expected: table.header().names.len(), zero: None, last: 0 };
        let (mut values, mut count) = (vec![0.0; rows.places.len()], 0);
        // The first fault of the lines at the end, and their number.
        let mut closing: Option<(LogError, u64)> = None;
        loop {
            let row = match table.next_row() {
                Ok(Some(row)) => row,
                Ok(None) => break,
                Err(TableError::CutOff { line }) if count > 0 => {
                    log.warnings.push(format!(
                        "line {line}: the packed file is cut off here; the {count} rows before are read"
                    ));
                    break;
                }
                Err(source) => return Err(broken(source)),
            };
            if !selection.takes(&row) {
                continue;
            }
            match (rows.read(&row, &log.columns, &mut values), closing.take()) {
                (Ok(()), None) => {
                    log.columns.iter_mut().zip(&values).for_each(|((_, column), value)| column.push(*value));
                    count += 1;
                }
                (Err(fault), None) => closing = Some((fault, 1)),
                (Err(_), Some((fault, lines))) if lines < CLOSING => closing = Some((fault, lines + 1)),
                (_, Some((fault, _))) => return Err(fault),
            }
        }
        if let Some((fault, lines)) = closing {
            if count < LEAST_BEFORE * lines {
                return Err(fault);
            }
            log.notes.push(format!("{lines} line(s) at the end left out, cut off or no row: {fault}"));
        }
        selection.check(count as usize, file)?;
        if rows.zero.is_some() {
            log.notes.push("time: dates are read as seconds since the first one's whole second".into());
        }
        log.read_times_of_day();
        Ok(log)
    }

    /// A log from a program's columns, each `name` or `name [unit]`; `file` is the name in messages. Columns that are
    /// no signals are left alone.
    ///
    /// # Errors
    /// Columns of several lengths, two of one signal, none that is a signal, an unknown unit.
    pub fn from_columns(file: &Path, columns: Vec<(String, Vec<f64>)>) -> Result<Self, LogError> {
        let expected = columns.first().map_or(0, |(_, values)| values.len());
        if let Some((column, values)) = columns.iter().find(|(_, values)| values.len() != expected) {
            let (file, column) = (file.to_owned(), column.clone());
            return Err(LogError::ColumnLength { file, column, found: values.len(), expected });
        }
        let (names, mut values): (Vec<String>, Vec<Vec<f64>>) = columns.into_iter().unzip();
        let mut log = Self::empty(file);
        let places = log.places(&table::Header::of(&names))?;
        for (column, (_, taken)) in places.iter().zip(&mut log.columns) {
            *taken = std::mem::take(&mut values[column.place]);
            if column.factor != 1.0 {
                taken.iter_mut().for_each(|value| *value *= column.factor);
            }
        }
        log.read_times_of_day();
        Ok(log)
    }

    /// A clock that writes the time of day as a number counts seconds.
    fn read_times_of_day(&mut self) {
        if let Some((_, column)) = self.columns.iter_mut().find(|(name, _)| *name == "time")
            && let Some(seconds) = time::of_digits(column)
        {
            *column = seconds;
            self.notes.push("time: times of day, HHMMSS, are read as seconds since midnight".into());
        }
    }

    /// The signals that a table's columns are, by their names.
    #[must_use]
    pub fn signals(names: &[String]) -> Vec<Option<&'static str>> {
        let header = table::Header::of(names);
        header.names.iter().map(|name| named(name, &header).map(|signal| signal.name)).collect()
    }

    fn empty(file: &Path) -> Self {
        Self {
            file: file.to_owned(),
            notes: Vec::new(),
            warnings: Vec::new(),
            columns: Vec::new(),
            unread: Vec::new(),
        }
    }

    /// Names of up to three columns that are no signals and may be the one that is missing.
    pub(super) fn like(&self, column: &str) -> Vec<String> {
        let parts = other_names(column);
        let is_like = |name: &&String| {
            let name = signal::as_written(name);
            parts.iter().any(|part| name.contains(part))
        };
        self.unread.iter().filter(is_like).take(3).map(|name| name.chars().take(40).collect()).collect()
    }

    /// Losses in reading the file, to go on an error's words with; empty where nothing was lost.
    #[must_use]
    pub fn losses(&self) -> String {
        self.warnings.iter().map(|warning| format!(". When it was read: {warning}")).collect()
    }

    /// Conversions and losses, as findings.
    pub fn findings(&self) -> impl Iterator<Item = Finding> {
        let finding = |gravity| move |words: &String| Finding::new(gravity, None, words.clone());
        let notes = self.notes.iter().map(finding(FindingSeverity::Note));
        notes.chain(self.warnings.iter().map(finding(FindingSeverity::Warning)))
    }

    /// The signal columns, and their places.
    fn places(&mut self, header: &table::Header) -> Result<Vec<LogColumn>, LogError> {
        let mut places: Vec<LogColumn> = Vec::new();
        let mut in_other_units: Vec<(&'static signal::Signal, String)> = Vec::new();
        for (place, (name, unit)) in header.names.iter().zip(&header.units).enumerate() {
            let Some(signal) = named(name, header) else {
                self.unread.push(header.written[place].clone());
                continue;
            };
            if self.column(signal.name).is_some() {
                return Err(LogError::Twice { file: self.file.clone(), column: signal.name });
            }
            let ours = signal.unit.symbol;
            let factor = unit.as_ref().map_or(Some(1.0), |unit| table::factor(unit, ours));
            // `steer (raw)` is another column than `steer`; brackets hold a unit.
            let written = &header.written[place];
            let is_unit = NEEDED.contains(&signal.name) && written.contains('[');
            if factor.is_none() && written != name && !is_unit {
                let written: String = header.written[place].chars().take(60).collect();
                self.unread.push(written.clone());
                in_other_units.push((signal, written));
                continue;
            }
            let factor = factor.ok_or_else(|| LogError::Unit {
                file: self.file.clone(),
                line: header.line,
                column: signal.name,
                unit: unit.iter().flat_map(|unit| unit.chars()).take(20).collect(),
                ours,
            })?;
            if let Some(unit) = unit.as_ref().filter(|_| factor != 1.0) {
                self.notes.push(format!("{}: read from {unit} as {ours}", signal.name));
            }
            places.push(LogColumn { place, factor });
            self.columns.push((signal.name, Vec::new()));
        }
        in_other_units.retain(|(signal, _)| self.column(signal.name).is_none());
        for (signal, written) in in_other_units {
            let ours = signal.unit.symbol;
            self.warnings.push(format!("{written}: not read, for its unit is unknown; give it in {ours}"));
        }
        // A clock alone is no drive.
        if self.columns.iter().all(|(name, _)| *name == "time") {
            let header = header.written.iter().take(8).cloned().collect::<Vec<_>>().join(",");
            let header = header.escape_default().take(400).collect();
            return Err(LogError::NoSignal { file: self.file.clone(), header });
        }
        Ok(places)
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

    /// True if a vehicle with a trailer drove: an articulation angle that is not zero throughout, as a recorder's template has it for
    /// a car.
    #[must_use]
    pub fn is_articulated(&self) -> bool {
        self.column(ARTICULATION.name).is_some_and(|angles| angles.iter().any(|angle| angle.abs() > 0.0))
    }

    /// True if another log holds the same drive: the columns that both have are equal.
    #[must_use]
    pub fn is_same_drive(&self, other: &Self) -> bool {
        let is_same = |(a, b): (&f64, &f64)| a == b || (a.is_nan() && b.is_nan());
        let mut both =
            self.columns().filter_map(|(name, values)| Some((values, other.column(name)?))).peekable();
        both.peek().is_some()
            && both.all(|(ours, theirs)| ours.len() == theirs.len() && ours.iter().zip(theirs).all(is_same))
    }

    /// Those of `names` that the log lacks.
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
    fn names_in_other_letters_are_read_where_no_column_has_the_name() {
        let read = log("Time,VX,Yaw_Rate [deg/s]\n0,1,180\n").unwrap();
        assert_eq!(read.column("yaw_rate"), Some(&[std::f64::consts::PI][..]));
        assert_eq!(read.without(&["time", "vx"]), [""; 0]);
        for names in [" TIME , VX ,YAW RATE", "time,vx,yaw-rate", "Time,Vx,Yaw.Rate"] {
            assert_eq!(
                log(&format!("{names}\n0,1,2\n")).unwrap().column("yaw_rate"),
                Some(&[2.0][..]),
                "{names}"
            );
        }
        assert_eq!(log("Time,time,vx\n7,0,1\n").unwrap().column("time"), Some(&[0.0][..]));
        assert!(log("Time,TIME,vx\n7,0,1\n").unwrap_err().to_string().contains("'time' stands twice"));
    }

    #[test]
    fn times_of_day_that_are_written_as_numbers_count_seconds() {
        let read = |times: &[f64]| {
            let rows: String = times.iter().map(|time| format!("{time:.2},1\n")).collect();
            log(&format!("time,vx\n{rows}")).unwrap().column("time").unwrap().to_vec()
        };
        let clock = |seconds: f64| {
            let whole = (seconds / 60.0).floor();
            ((whole / 60.0).floor() % 24.0) * 1e4 + (whole % 60.0) * 100.0 + seconds - 60.0 * whole
        };
        // Over a full hour, and over midnight.
        for start in [46_795.0, 86_395.0] {
            let stamps: Vec<f64> = (0..200).map(|i| clock(start + 0.05 * f64::from(i))).collect();
            let times = read(&stamps);
            assert!(times.iter().zip(0..).all(|(time, i)| (time - start - 0.05 * f64::from(i)).abs() < 1e-6));
        }
        // Seconds, within a minute of the day, and steps of 50 ms.
        for step in [0.05, 50.0] {
            let stamps: Vec<f64> = (0..119).map(|i| step * f64::from(i)).collect();
            assert!(read(&stamps).iter().zip(&stamps).all(|(time, stamp)| (time - stamp).abs() < 1e-9));
        }
    }

    #[test]
    fn a_trailer_is_one_that_bends() {
        for (angles, bends) in [("0,0", false), ("0,", false), ("0,-0.01", true)] {
            let [first, second] = angles.split_once(',').map(<[&str; 2]>::from).unwrap();
            let text = format!("time,vx,articulation\n0,1,{first}\n0.02,1,{second}\n");
            assert_eq!(log(&text).unwrap().is_articulated(), bends, "{angles}");
        }
        assert!(!log("time,vx\n0,1\n").unwrap().is_articulated());
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
