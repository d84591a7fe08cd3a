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
use super::sample::{Closure, RoadClass, Sample};
use super::{Path, check};
use std::path::Path as FilePath;

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
    /// Known and not used: track widths.
    Unused,
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
            "w_tr_right_m" | "w_tr_left_m" => Self::Unused,
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
            Self::Unused => "track width",
        }
    }
}

/// Reads a file.
pub(super) fn read(file: &FilePath, closure: Closure) -> Result<Path, PathError> {
    let bytes = std::fs::read(file).map_err(|source| PathError::Io { file: file.to_path_buf(), source })?;
    let (samples, lines) = parse(&bytes).map_err(|error| error.in_file(file, &[]))?;
    let road = check::check(samples, closure).map_err(|error| error.in_file(file, &lines))?;
    Ok(Path::from_road(road))
}

fn at_line(line: u64) -> Place {
    Place { line: Some(line), ..Place::default() }
}

/// Points and the line of each.
pub(super) fn parse(bytes: &[u8]) -> Result<(Vec<Sample>, Vec<u64>), PathError> {
    let mut columns: Option<Vec<Column>> = None;
    let mut samples = Vec::new();
    let mut lines = Vec::new();
    let mut last_station = f64::NEG_INFINITY;
    for (index, raw) in bytes.split(|&byte| byte == b'\n').enumerate() {
        let line = index as u64 + 1;
        let text = std::str::from_utf8(raw).map_err(|_| PathError::NotText { place: at_line(line) })?;
        let text = if line == 1 { text.trim_start_matches('\u{feff}') } else { text }.trim();
        if text.is_empty() {
            continue;
        }
        if let Some(comment) = text.strip_prefix('#') {
            if columns.is_none() && comment.split(',').any(|name| matches!(name.trim(), "x_m" | "x")) {
                columns = Some(header(comment, line)?);
            }
            continue;
        }
        let Some(columns) = &columns else {
            columns = Some(header(text, line)?);
            continue;
        };
        let (sample, station) = row(text, columns, line)?;
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
        samples.push(sample);
        lines.push(line);
    }
    if samples.is_empty() {
        return Err(PathError::Empty { place: Place::default() });
    }
    Ok((samples, lines))
}

fn header(text: &str, line: u64) -> Result<Vec<Column>, PathError> {
    let mut columns = Vec::new();
    for (index, name) in text.split(',').map(str::trim).enumerate() {
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
        if column != Column::Unused && columns.contains(&column) {
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
                found: text.chars().take(60).collect(),
                known: OPTIONAL,
            });
        }
    }
    Ok(columns)
}

fn row(text: &str, columns: &[Column], line: u64) -> Result<(Sample, Option<f64>), PathError> {
    let fields: Vec<&str> = text.split(',').map(str::trim).collect();
    if fields.len() != columns.len() {
        return Err(PathError::RowLength {
            place: at_line(line),
            found: fields.len(),
            expected: columns.len(),
        });
    }
    let mut sample = Sample::default();
    let mut station = None;
    for (&column, &field) in columns.iter().zip(&fields) {
        if column == Column::Unused {
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
            Column::Class | Column::Unused => {}
        }
    }
    Ok((sample, station))
}
