//! Errors of a road: one variant per cause, each with place and advice.

use std::fmt;
use std::path::PathBuf;

/// Place of an error in the input.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct InputPlace {
    /// The file, if the road came from one.
    pub file: Option<PathBuf>,
    /// The line of the file, counted from 1.
    pub line: Option<u64>,
    /// The point, counted from 0.
    pub point: Option<u32>,
    /// The column's name in the file, where it is another than ours.
    pub column: Option<Box<WrittenName>>,
}

/// Name of a column in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrittenName(pub String);

impl InputPlace {
    /// A point of a road that came from no file.
    #[must_use]
    pub fn point(point: usize) -> Self {
        Self { point: u32::try_from(point).ok(), ..Self::default() }
    }

    /// The name in the file of a column that we call `ours`.
    fn named<'a>(&'a self, ours: &'a str) -> &'a str {
        self.column.as_ref().map_or(ours, |written| &written.0)
    }
}

impl fmt::Display for InputPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.file, self.line, self.point) {
            (Some(file), Some(line), _) => write!(f, "{}, line {line}", file.display()),
            (Some(file), None, _) => write!(f, "{}", file.display()),
            (None, Some(line), _) => write!(f, "line {line}"),
            (None, None, Some(point)) => write!(f, "point {point}"),
            (None, None, None) => write!(f, "the road"),
        }
    }
}

/// Reasons for which a road cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PathError {
    /// The file cannot be opened or read.
    #[error("{}: cannot be read: {source}; check the name and the permission", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// Neither a file nor a built-in road.
    #[error(
        "{}: cannot be read: {source}; check the name, or use a built-in road: {}",
        file.display(),
        builtin.join(", ")
    )]
    Unknown {
        /// The name.
        file: PathBuf,
        /// The operating system's reason.
        source: std::io::Error,
        /// Names of the built-in roads.
        builtin: Vec<&'static str>,
    },
    /// No table: a folder or a device, too large, cut off.
    #[error("{place}: {source}")]
    Table {
        /// The file.
        place: InputPlace,
        /// The error itself.
        source: crate::table::TableError,
    },
    /// A unit of another quantity.
    #[error("{place}: column `{column}` is in `{unit}`, an unknown unit for it; give it in {ours}")]
    UnknownUnit {
        /// The header.
        place: InputPlace,
        /// The column.
        column: String,
        /// The file's words.
        unit: String,
        /// The unit wanted.
        ours: &'static str,
    },
    /// Noise so large that it hides the road.
    #[error(
        "{place}: the points have {rms:.2} m of noise (RMS), and smoothed by it the road still {shape}; record it \
         anew, average several laps, or give another smoothing tolerance"
    )]
    Noise {
        /// The road.
        place: InputPlace,
        /// RMS distance of the points from a smooth road in m.
        rms: f64,
        /// Its shape.
        shape: String,
    },
    /// Nothing but comments and blank lines.
    #[error("{place}: has no points; a path is a CSV with a header `x,y` and a row for each point")]
    Empty {
        /// The file.
        place: InputPlace,
    },
    /// The file is no UTF-8 text, or a row has more or fewer values than the header.
    #[error(
        "{place}: {found} values where the header names {expected} columns; complete the row, or delete it"
    )]
    RowLength {
        /// The row.
        place: InputPlace,
        /// Values in the row.
        found: usize,
        /// Columns in the header.
        expected: usize,
    },
    /// Not text.
    #[error("{place}: is not UTF-8 text; save the path as a plain CSV file")]
    NotText {
        /// The row.
        place: InputPlace,
    },
    /// A necessary column is missing.
    #[error(
        "{place}: has no column `{column}` (found: {found}); a path's header is `x,y` and, optional, {known}"
    )]
    MissingColumn {
        /// The header.
        place: InputPlace,
        /// The column that is missing.
        column: &'static str,
        /// The columns found.
        found: String,
        /// The optional columns.
        known: &'static str,
    },
    /// A column stands twice.
    #[error("{place}: column `{column}` stands twice (again as number {number}); remove one")]
    RepeatedColumn {
        /// The header.
        place: InputPlace,
        /// The column's name.
        column: String,
        /// Number of its second appearance, counted from 1.
        number: usize,
    },
    /// Text where a number should be.
    #[error("{place}, column `{}`: `{text}` is not a number; write it as e.g. 12.5, with a point", place.named(column))]
    NotANumber {
        /// The row.
        place: InputPlace,
        /// The column.
        column: &'static str,
        /// The field's text.
        text: String,
    },
    /// NaN or infinity.
    #[error(
        "{place}, column `{}`: {value} is not finite; delete the row, or leave an optional value empty",
        place.named(column)
    )]
    NotFinite {
        /// The row.
        place: InputPlace,
        /// The column.
        column: &'static str,
        /// The field's value.
        value: f64,
    },
    /// A value that no road has: most likely a wrong unit.
    #[error("{place}, column `{}`: {value} lies outside {low} to {high}; is it in {unit}?", place.named(column))]
    OutOfRange {
        /// The row.
        place: InputPlace,
        /// The column.
        column: &'static str,
        /// The field's value.
        value: f64,
        /// Least value.
        low: f64,
        /// Greatest value.
        high: f64,
        /// The unit wanted.
        unit: &'static str,
    },
    /// An unknown name in column `class`.
    #[error(
        "{place}, column `class`: `{text}` is no road class; known are straight, right_turn, left_turn, u_turn, \
         sweeper, cross_country"
    )]
    UnknownClass {
        /// The row.
        place: InputPlace,
        /// The field's text.
        text: String,
    },
    /// Too few points for a road.
    #[error("{place}: {count} distinct point(s); a road needs at least {needed}")]
    TooFewPoints {
        /// The road.
        place: InputPlace,
        /// Points left after consecutive duplicates were dropped.
        count: usize,
        /// Points needed.
        needed: usize,
    },
    /// Two neighbouring points lie much farther apart than the others.
    #[error(
        "{place}: lies {distance:.1} m from the point before, where {median:.2} m are usual; fill the gap, \
         cut the road there, or delete the point if it is a wrong one"
    )]
    Gap {
        /// The point after the gap.
        place: InputPlace,
        /// Width of the gap in m.
        distance: f64,
        /// Median spacing in m.
        median: f64,
    },
    /// The road turns back on itself: points out of order, or drawn twice.
    #[error(
        "{place}: the road turns back by {degrees:.0} degrees here; put the points into driving order, or delete the \
         point if it is a wrong one"
    )]
    TurnsBack {
        /// The point at which it turns.
        place: InputPlace,
        /// Change of direction in degrees.
        degrees: f64,
    },
    /// Column `s` does not rise.
    #[error(
        "{place}, column `{0}`: {value} after {before}; stations must rise, but for one that starts anew at a lap's end: \
         sort the rows by `{0}`, or delete the column",
        place.named("s")
    )]
    Unordered {
        /// The row.
        place: InputPlace,
        /// The station.
        value: f64,
        /// The station before.
        before: f64,
    },
    /// The spacing is that of another unit.
    #[error(
        "{place}: points are {median:.3e} m apart (median) on {long:.3e} m of road; `x`, `y` are hardly in {unit}: convert them"
    )]
    SuspiciousUnit {
        /// The road.
        place: InputPlace,
        /// Median spacing in m.
        median: f64,
        /// Length from point to point in m.
        long: f64,
        /// The unit wanted.
        unit: &'static str,
    },
    /// No vehicle moves on a road whose speed limit is 0 throughout.
    #[error(
        "{place}, column `{}`: 0 in every row: no vehicle moves; give the speeds, or delete the column to drive as bends allow",
        place.named("speed")
    )]
    Standing {
        /// The road.
        place: InputPlace,
    },
    /// A smoothing tolerance that is none.
    #[error("smoothing tolerance {value} m; give a length between 0 and 5 m, about the noise of the points")]
    Tolerance {
        /// The tolerance in m.
        value: f64,
    },
    /// The file cannot be written.
    #[error("{}: cannot be written: {source}; check that the folder exists and may be written to", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// The operating system's reason.
        source: std::io::Error,
    },
}

impl PathError {
    /// The same error, with the file and the lines of its points known.
    #[must_use]
    pub(super) fn in_file(mut self, file: &std::path::Path, lines: &[u64]) -> Self {
        if let Some(place) = self.place_mut() {
            place.file = Some(file.to_path_buf());
            if place.line.is_none() {
                place.line = place.point.and_then(|point| lines.get(point as usize).copied());
            }
        }
        self
    }

    /// The same error, with the column as its file names it: of `columns`, our names and the file's.
    #[must_use]
    pub(super) fn with_columns(mut self, columns: &[(&'static str, String)]) -> Self {
        let ours = match &self {
            Self::NotANumber { column, .. }
            | Self::NotFinite { column, .. }
            | Self::OutOfRange { column, .. } => *column,
            Self::Unordered { .. } => "s",
            Self::Standing { .. } => "speed",
            _ => return self,
        };
        let written = columns.iter().find(|(known, _)| *known == ours);
        if let (Some(place), Some((_, written))) = (self.place_mut(), written) {
            place.column = Some(Box::new(WrittenName(written.clone())));
        }
        self
    }

    fn place_mut(&mut self) -> Option<&mut InputPlace> {
        match self {
            Self::Io { .. } | Self::Unknown { .. } | Self::Write { .. } | Self::Tolerance { .. } => None,
            Self::Empty { place }
            | Self::Table { place, .. }
            | Self::UnknownUnit { place, .. }
            | Self::Noise { place, .. }
            | Self::RowLength { place, .. }
            | Self::NotText { place }
            | Self::MissingColumn { place, .. }
            | Self::RepeatedColumn { place, .. }
            | Self::NotANumber { place, .. }
            | Self::NotFinite { place, .. }
            | Self::OutOfRange { place, .. }
            | Self::UnknownClass { place, .. }
            | Self::TooFewPoints { place, .. }
            | Self::Standing { place }
            | Self::Gap { place, .. }
            | Self::TurnsBack { place, .. }
            | Self::Unordered { place, .. }
            | Self::SuspiciousUnit { place, .. } => Some(place),
        }
    }
}
