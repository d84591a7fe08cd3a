//! Roads from files.
//!
//! | format | how it is recognised |
//! |---|---|
//! | ours | a header with `x` and `y`; optional columns [`OPTIONAL`] |
//! | racetrack-database | `x_m,y_m,w_tr_right_m,w_tr_left_m`; the header stands in a `#` comment |
//! | driven lap | `x_m,y_m,v_driven_mps`, the same way |
//!
//! Other lines that begin with `#`, and blank ones, are skipped.

use super::error::{PathError, Place};
use super::sample::{RoadClass, Sample};

/// The optional columns, as messages list them.
const OPTIONAL: &str = "s, yaw, curvature, speed, bank, grade, friction, class";

/// What a column means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    X,
    Y,
    Station,
    Yaw,
    Curvature,
    Speed,
    Bank,
    Grade,
    Friction,
    Class,
    /// Of racetrack-database; known and not used.
    TrackWidth,
}

impl Column {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "x" | "x_m" => Self::X,
            "y" | "y_m" => Self::Y,
            "s" | "s_m" => Self::Station,
            "yaw" => Self::Yaw,
            "curvature" => Self::Curvature,
            "speed" | "v_driven_mps" => Self::Speed,
            "bank" => Self::Bank,
            "grade" => Self::Grade,
            "friction" => Self::Friction,
            "class" => Self::Class,
            "w_tr_right_m" | "w_tr_left_m" => Self::TrackWidth,
            _ => return None,
        })
    }

    /// The name in messages.
    fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Station => "s",
            Self::Yaw => "yaw",
            Self::Curvature => "curvature",
            Self::Speed => "speed",
            Self::Bank => "bank",
            Self::Grade => "grade",
            Self::Friction => "friction",
            Self::Class => "class",
            Self::TrackWidth => "track width",
        }
    }
}

/// What a file says.
pub(super) struct Table {
    pub samples: Vec<Sample>,
    /// The line of each sample.
    pub lines: Vec<u64>,
    pub accuracy: Accuracy,
}

/// How well a file knows its coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Accuracy {
    /// Exactly, as far as we know.
    Exact,
    /// Rounded to this digit in m.
    Digit(f64),
    /// Measured, to this RMS distance in m.
    Measured(f64),
}

/// RMS distance in m that we leave the centre lines of racetrack-database: its arcs begin and end without a
/// transition, and through every point the curvature would overshoot there by a fifth.
const RACETRACK_DATABASE: f64 = 0.02;

fn at_line(line: u64) -> Place {
    Place { line: Some(line), ..Place::default() }
}

/// The lines that carry values, as one CSV text, with the number of each; and the header, if it stands in a comment
/// before them, as racetrack-database writes it.
struct Lines<'a> {
    text: Vec<u8>,
    numbers: Vec<u64>,
    comment: Option<(&'a [u8], u64)>,
}

fn lines(bytes: &[u8]) -> Lines<'_> {
    // Spreadsheets put a byte order mark before the text.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut lines = Lines { text: Vec::with_capacity(bytes.len()), numbers: Vec::new(), comment: None };
    for (index, raw) in bytes.split(|&byte| byte == b'\n').enumerate() {
        let line = raw.trim_ascii();
        let number = index as u64 + 1;
        if let Some(comment) = line.strip_prefix(b"#") {
            let names_a_column = |name: &[u8]| matches!(name.trim_ascii(), b"x" | b"x_m");
            if lines.numbers.is_empty()
                && lines.comment.is_none()
                && comment.split(|&b| b == b',').any(names_a_column)
            {
                lines.comment = Some((comment, number));
            }
        } else if !line.is_empty() {
            lines.text.extend_from_slice(line);
            lines.text.push(b'\n');
            lines.numbers.push(number);
        }
    }
    lines
}

/// Reads the rows of a path file.
pub(super) fn parse(bytes: &[u8]) -> Result<Table, PathError> {
    let Lines { text, numbers, comment } = lines(bytes);
    let not_text = |line| PathError::NotText { place: at_line(line) };
    let mut columns = None;
    if let Some((comment, line)) = comment {
        let names = std::str::from_utf8(comment).map_err(|_| not_text(line))?;
        columns = Some(header(names.split(',').map(str::trim), line)?);
    }
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_slice());
    let mut table = Table { samples: Vec::new(), lines: Vec::new(), accuracy: Accuracy::Exact };
    let mut decimals = Decimals::default();
    let mut last_station = f64::NEG_INFINITY;
    let mut record = csv::ByteRecord::new();
    loop {
        // A quote that is not closed makes a record of several lines; its first one is named.
        let line = numbers.get(reader.position().line() as usize - 1).copied().unwrap_or(1);
        match reader.read_byte_record(&mut record) {
            Ok(true) => {}
            Ok(false) => break,
            // Rows of any length, read from memory: only the text itself can be wrong.
            Err(_) => return Err(not_text(line)),
        }
        let fields: Vec<&str> = record
            .iter()
            .map(|field| std::str::from_utf8(field).map_err(|_| not_text(line)))
            .collect::<Result<_, _>>()?;
        let Some(columns) = &columns else {
            columns = Some(header(fields.into_iter(), line)?);
            continue;
        };
        let (sample, station) = row(&fields, columns, line, &mut decimals)?;
        if let Some(station) = station {
            if station <= last_station {
                return Err(PathError::Unordered {
                    place: at_line(line),
                    value: station,
                    before: last_station,
                });
            }
            last_station = station;
        }
        table.samples.push(sample);
        table.lines.push(line);
    }
    if table.samples.is_empty() {
        return Err(PathError::Empty { place: Place::default() });
    }
    table.accuracy = match decimals.resolution() {
        _ if columns.is_some_and(|columns| columns.contains(&Column::TrackWidth)) => {
            Accuracy::Measured(RACETRACK_DATABASE)
        }
        Some(digit) => Accuracy::Digit(digit),
        None => Accuracy::Exact,
    };
    Ok(table)
}

/// Counts the decimals that coordinates are written with.
#[derive(Default)]
struct Decimals {
    most: u32,
    exponents: bool,
}

impl Decimals {
    fn look(&mut self, text: &str) {
        self.exponents |= text.contains(['e', 'E']);
        if let Some((_, fraction)) = text.split_once('.') {
            self.most = self.most.max(fraction.len() as u32);
        }
    }

    /// The last digit in m. Whole metres and decimetres are taken as exact: someone drew them.
    fn resolution(&self) -> Option<f64> {
        (!self.exponents && (2..15).contains(&self.most)).then(|| 0.1f64.powi(self.most as i32))
    }
}

/// The columns that a header names.
fn header<'a>(names: impl Iterator<Item = &'a str>, line: u64) -> Result<Vec<Column>, PathError> {
    let mut columns = Vec::new();
    let mut found = String::new();
    for (index, name) in names.enumerate() {
        if found.len() < 60 {
            found.push_str(if index > 0 { ", " } else { "" });
            found.extend(name.chars().take(40));
        }
        let Some(column) = Column::from_name(name) else {
            // A first row of numbers means that the header is missing, not that a column is strange.
            if index == 0 && name.parse::<f64>().is_ok() {
                break;
            }
            let column = name.chars().take(40).collect();
            return Err(PathError::UnknownColumn {
                place: at_line(line),
                column,
                number: index + 1,
                known: OPTIONAL,
            });
        };
        if column != Column::TrackWidth && columns.contains(&column) {
            return Err(PathError::RepeatedColumn {
                place: at_line(line),
                column: name.into(),
                number: index + 1,
            });
        }
        columns.push(column);
    }
    for needed in [Column::X, Column::Y] {
        if !columns.contains(&needed) {
            return Err(PathError::MissingColumn {
                place: at_line(line),
                column: needed.name(),
                found,
                known: OPTIONAL,
            });
        }
    }
    Ok(columns)
}

/// The point in a row, and its station if there is one.
fn row(
    fields: &[&str],
    columns: &[Column],
    line: u64,
    decimals: &mut Decimals,
) -> Result<(Sample, Option<f64>), PathError> {
    if fields.len() != columns.len() {
        return Err(PathError::RowLength {
            place: at_line(line),
            found: fields.len(),
            expected: columns.len(),
        });
    }
    let mut sample = Sample::default();
    let mut station = None;
    for (&column, &field) in columns.iter().zip(fields) {
        if column == Column::TrackWidth {
            continue;
        }
        let needed = matches!(column, Column::X | Column::Y);
        if field.is_empty() && !needed {
            continue;
        }
        if column == Column::Class {
            let class = RoadClass::from_name(field);
            sample.class = Some(class.ok_or_else(|| PathError::UnknownClass {
                place: at_line(line),
                text: field.chars().take(40).collect(),
            })?);
            continue;
        }
        let value: f64 = field.parse().map_err(|_| PathError::NotANumber {
            place: at_line(line),
            column: column.name(),
            text: field.chars().take(40).collect(),
        })?;
        if !value.is_finite() {
            return Err(PathError::NotFinite { place: at_line(line), column: column.name(), value });
        }
        if needed {
            decimals.look(field);
        }
        match column {
            Column::X => sample.x = value,
            Column::Y => sample.y = value,
            Column::Station => station = Some(value),
            Column::Yaw => sample.yaw = Some(value),
            Column::Curvature => sample.curvature = Some(value),
            Column::Speed => sample.speed = Some(value),
            Column::Bank => sample.bank = Some(value),
            Column::Grade => sample.grade = Some(value),
            Column::Friction => sample.friction = Some(value),
            Column::Class | Column::TrackWidth => {}
        }
    }
    Ok((sample, station))
}
