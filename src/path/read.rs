//! Roads from files.
//!
//! | format | how it is recognised |
//! |---|---|
//! | ours | a header with `x` and `y`; optional columns [`OPTIONAL`] |
//! | racetrack-database | `x_m,y_m,w_tr_right_m,w_tr_left_m`; the header stands in a `#` comment |
//! | driven lap | `x_m,y_m,v_driven_mps`, the same way |
//! | racing line | `s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2`, the same way; or a reference line, its normals and `alpha_m` |
//!
//! However the table is written ([`crate::table`]), its columns are the same. Names have aliases ([`ALIASES`]) and may
//! end in a unit, `speed_kmh` or `bank [deg]`.

use super::accuracy::{Accuracy, Decimals, RACETRACK_DATABASE};
use super::error::{InputPlace, PathError};
use super::geodetic::{DEGREE, TangentPlane};
use super::lap::{Progress, Stations};
use super::note::Note;
use super::sample::{RoadClass, Sample};
use crate::table::{self, Header, Limits, Table as Rows, TableError, split_unit};
use std::io::Read;

/// The optional columns, as messages list them.
const OPTIONAL: &str =
    "s, yaw, curvature, speed, bank, grade, friction, class, and latitude, longitude for x, y";

/// Meaning of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RoadColumn {
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
    /// Geodetic coordinates, WGS 84: laid on a plane if there are no `x` and `y`.
    Latitude,
    Longitude,
    /// Of racetrack-database; known and not used.
    TrackWidth,
    /// Normal of a reference line, and how far along it the road lies from the line.
    NormalX,
    NormalY,
    Offset,
    /// Known and not used.
    Unused,
}

/// A column, its unit (empty: a pure number or text), its names without unit in small letters. The first is ours.
type Alias = (RoadColumn, &'static str, &'static [&'static str]);

const ALIASES: [Alias; 16] = [
    (
        RoadColumn::X,
        "m",
        &[
            "x",
            "east",
            "easting",
            "x_east",
            "pos_x",
            "position_x",
            "x_pos",
            "utm_x",
            "utm_east",
            "utm_easting",
            "x_ref",
        ],
    ),
    (
        RoadColumn::Y,
        "m",
        &[
            "y",
            "north",
            "northing",
            "y_north",
            "pos_y",
            "position_y",
            "y_pos",
            "utm_y",
            "utm_north",
            "utm_northing",
            "y_ref",
        ],
    ),
    (RoadColumn::Station, "m", &["s", "station", "chainage", "s_racetraj"]),
    (RoadColumn::Yaw, "rad", &["yaw", "yaw_angle"]),
    (RoadColumn::Curvature, "1/m", &["curvature"]),
    (
        RoadColumn::Speed,
        "m/s",
        &["speed", "v_driven", "v", "vx", "speed_limit", "v_max", "v_ref", "vx_racetraj"],
    ),
    (RoadColumn::Bank, "rad", &["bank", "bank_angle", "banking"]),
    (RoadColumn::Grade, "rad", &["grade", "grade_angle", "slope"]),
    (RoadColumn::Friction, "", &["friction", "mu"]),
    (RoadColumn::Class, "", &["class"]),
    (RoadColumn::Latitude, "rad", &["latitude", "lat", "gps_latitude", "gps_lat"]),
    (RoadColumn::Longitude, "rad", &["longitude", "lon", "lng", "long", "gps_longitude", "gps_lon"]),
    (RoadColumn::NormalX, "m", &["x_normvec"]),
    (RoadColumn::NormalY, "m", &["y_normvec"]),
    (RoadColumn::Offset, "m", &["alpha"]),
    // Headings of racing lines count from north, and their curvature is that of the line before it was rounded.
    (
        RoadColumn::Unused,
        "",
        &[
            "psi",
            "psi_rad",
            "kappa",
            "kappa_radpm",
            "ax",
            "ax_mps2",
            "psi_racetraj_rad",
            "kappa_racetraj_radpm",
            "ax_racetraj_mps2",
            "width_right_m",
            "width_left_m",
            "z",
            "z_m",
            "time",
            "t",
            "t_s",
            "time_s",
            "index",
            "id",
        ],
    ),
];

/// Names that need no mention: ours, and those of racetrack-database.
const PLAIN: [&str; 14] = [
    "x",
    "x_m",
    "y",
    "y_m",
    "s",
    "s_m",
    "yaw",
    "curvature",
    "speed",
    "v_driven_mps",
    "bank",
    "grade",
    "friction",
    "class",
];

/// A column's meaning, and the factor of its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Meaning {
    column: RoadColumn,
    factor: f64,
}

impl Meaning {
    /// Meaning of a name with the unit beside it; `Err` is our unit, if the file's is of another quantity.
    fn of(name: &str, unit: Option<&str>) -> Option<Result<Self, &'static str>> {
        let lower = name.to_lowercase();
        if matches!(lower.as_str(), "w_tr_right_m" | "w_tr_left_m") {
            return Some(Ok(Self { column: RoadColumn::TrackWidth, factor: 1.0 }));
        }
        let alias = |name: &str| ALIASES.iter().find(|(.., names)| names.contains(&name));
        let meaning = |&(column, ours, _): &Alias, unit: Option<&str>| match unit {
            // Nobody gives these in radians without a word.
            None if column.is_geodetic() => Ok(Self { column, factor: 1f64.to_radians() }),
            None => Ok(Self { column, factor: 1.0 }),
            Some(_) if column == RoadColumn::Unused => Ok(Self { column, factor: 1.0 }),
            Some("1") if ours.is_empty() => Ok(Self { column, factor: 1.0 }),
            Some(unit) => {
                // A slope is the tangent of a small angle.
                let slope = || table::factor(unit, "1").filter(|_| column.is_slope());
                table::factor(unit, ours).or_else(slope).map(|factor| Self { column, factor }).ok_or(ours)
            }
        };
        if let Some(alias) = alias(&lower) {
            return Some(meaning(alias, unit));
        }
        // `speed_kmh`; what is no unit of that quantity is another name.
        let (base, suffix) = lower.rsplit_once('_')?;
        let alias = alias(base).filter(|alias| alias.0 != RoadColumn::Unused)?;
        meaning(alias, Some(suffix)).ok().map(Ok)
    }
}

impl RoadColumn {
    fn is_slope(self) -> bool {
        matches!(self, Self::Bank | Self::Grade)
    }

    fn is_geodetic(self) -> bool {
        matches!(self, Self::Latitude | Self::Longitude)
    }

    /// The name in messages.
    fn name(self) -> &'static str {
        match self {
            Self::TrackWidth => "track width",
            Self::Unused => "a column not used",
            _ => ALIASES.iter().find(|alias| alias.0 == self).map_or("", |alias| alias.2[0]),
        }
    }
}

/// Contents of a file.
pub(super) struct RoadTable {
    pub samples: Vec<Sample>,
    /// The line of each sample.
    pub lines: Vec<u64>,
    pub accuracy: Accuracy,
    /// Our names of the columns used, and the file's.
    pub columns: Vec<(&'static str, String)>,
    /// Columns as they were interpreted.
    pub notes: Vec<Note>,
}

fn at_line(line: u64) -> InputPlace {
    InputPlace { line: Some(line), ..InputPlace::default() }
}

fn broken(source: TableError) -> PathError {
    PathError::Table { place: InputPlace::default(), source }
}

/// Reads the rows of a path file.
pub(super) fn parse(reader: impl Read, limits: Limits) -> Result<RoadTable, PathError> {
    let known = |name: &str| Meaning::of(name, None).is_some();
    let mut rows = Rows::new(reader, limits, &known).map_err(broken)?;
    let mut table = RoadTable {
        samples: Vec::new(),
        lines: Vec::new(),
        accuracy: Accuracy::Exact,
        columns: Vec::new(),
        notes: Vec::new(),
    };
    let columns = if rows.header().line == 0 { Vec::new() } else { header(rows.header(), &mut table.notes)? };
    let written = rows.header().written.iter().map(|written| written.chars().take(40).collect());
    table.columns = columns.iter().map(|meaning| meaning.column.name()).zip(written).collect();
    let geodetic = columns.iter().any(|meaning| meaning.column.is_geodetic());
    let mut decimals = Decimals::default();
    read_rows(&mut rows, &columns, &mut decimals, &mut table)
        .map_err(|error| error.with_columns(&table.columns))?;
    if table.samples.is_empty() {
        return Err(PathError::Empty { place: InputPlace::default() });
    }
    let steep: Vec<Note> = ["bank", "grade"].iter().filter_map(|column| too_steep(&table, column)).collect();
    table.notes.extend(steep);
    if geodetic {
        lay_on_plane(&mut table);
    }
    let widths = columns.iter().any(|meaning| meaning.column == RoadColumn::TrackWidth);
    table.accuracy = match widths {
        true => Accuracy::Measured(RACETRACK_DATABASE),
        false => decimals.accuracy(if geodetic { DEGREE } else { 1.0 }),
    };
    Ok(table)
}

/// Steepest bank of a public track, rad: 33 degrees. No public road is as steep.
const STEEPEST: f64 = 0.58;

/// A warning of a bank or a grade that no road has in radians.
fn too_steep(table: &RoadTable, column: &str) -> Option<Note> {
    let of = |sample: &Sample| if column == "bank" { sample.bank } else { sample.grade };
    let rows = table.samples.iter().zip(&table.lines).filter_map(|(sample, line)| Some((of(sample)?, line)));
    let mut steep = rows.filter(|(value, _)| value.abs() > STEEPEST);
    let (value, line) = steep.next()?;
    let more = match steep.count() {
        0 => String::new(),
        count => format!(", and as steep in {count} more rows"),
    };
    Some(Note::warning(format!(
        "line {line}: {column} is {value:.3} rad, {:.0} degrees{more}; no public road or track is steeper than {:.0} degrees. Is it in \
         degrees or per cent? Name the column {column} [deg] or {column} [%]",
        value.to_degrees(),
        STEEPEST.to_degrees()
    )))
}

/// Reads the rows below the header, of a lap at most.
fn read_rows(
    rows: &mut Rows<impl Read>,
    columns: &[Meaning],
    decimals: &mut Decimals,
    table: &mut RoadTable,
) -> Result<(), PathError> {
    let mut stations = Stations::default();
    let (mut anew, mut beyond) = (None, 0usize);
    loop {
        let latin1 = rows.is_latin1();
        let Some(next) = rows.next_row().map_err(broken)? else { break };
        let line = next.line;
        let (sample, station) = match row(&next, columns, decimals) {
            // Letters of an unknown encoding where a number should be.
            Err(PathError::NotANumber { text, .. }) if !text.is_ascii() && (latin1 || rows.is_latin1()) => {
                return Err(PathError::NotText { place: at_line(line) });
            }
            other => other?,
        };
        let before = stations.newest();
        match station.map(|station| (station, stations.take(station, [sample.x, sample.y]))) {
            Some((value, Progress::Falls)) => {
                return Err(PathError::Unordered { place: at_line(line), value, before });
            }
            Some((_, Progress::BeyondLap)) => {
                anew = anew.or(Some(line));
                beyond += 1;
                continue;
            }
            Some((_, Progress::StartsAnew)) => anew = Some(line),
            _ => {}
        }
        table.samples.push(sample);
        table.lines.push(line);
    }
    if let Some(line) = anew {
        let cut =
            if beyond > 0 { format!("; {beyond} point(s) beyond it are left out") } else { String::new() };
        table
            .notes
            .push(Note::info(format!("the station starts anew at line {line}: one lap is the road{cut}")));
    }
    Ok(())
}

/// Makes `x` and `y` of the longitudes and latitudes that stand in their places.
fn lay_on_plane(table: &mut RoadTable) {
    let first = &table.samples[0];
    let (latitude, longitude) = (first.y, first.x);
    let plane = TangentPlane::at(latitude, longitude);
    for sample in &mut table.samples {
        [sample.x, sample.y] = plane.local(sample.y, sample.x);
    }
    table.notes.push(Note::info(format!(
        "latitude and longitude (WGS 84) are laid on the plane that touches the earth at the first point, {:.7}, {:.7} degrees: x is \
         east of it, y north",
        latitude.to_degrees(),
        longitude.to_degrees()
    )));
}

/// The columns that a header names.
fn header(header: &Header, notes: &mut Vec<Note>) -> Result<Vec<Meaning>, PathError> {
    let line = header.line;
    let mut columns: Vec<Meaning> = Vec::new();
    let mut found = String::new();
    let (mut taken, mut unused, mut unknown) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (written, (name, unit))) in
        header.written.iter().zip(header.names.iter().zip(&header.units)).enumerate()
    {
        if found.len() < 60 {
            found.push_str(if index > 0 { ", " } else { "" });
            found.extend(written.chars().take(40));
        }
        let short: String = written.chars().take(40).collect();
        // What stands in brackets may be no unit, but part of the name.
        let meaning = Meaning::of(name, unit.as_deref());
        let Some(meaning) = meaning else {
            // A first row of numbers means that the header is missing, not that a column is strange.
            if index == 0 && name.parse::<f64>().is_ok() {
                found = "a row of numbers, and no names above it".into();
                break;
            }
            unknown.push(short);
            columns.push(Meaning { column: RoadColumn::Unused, factor: 1.0 });
            continue;
        };
        let meaning = meaning.map_err(|ours| PathError::UnknownUnit {
            place: at_line(line),
            column: split_unit(&short).0.into(),
            unit: unit.iter().flat_map(|unit| unit.chars()).take(20).collect(),
            ours: if ours.is_empty() { "1, a pure number" } else { ours },
        })?;
        let column = meaning.column;
        let repeats = columns.iter().any(|other| other.column == column);
        if repeats && !matches!(column, RoadColumn::TrackWidth | RoadColumn::Unused) {
            return Err(PathError::RepeatedColumn { place: at_line(line), column: short, number: index + 1 });
        }
        match column {
            RoadColumn::TrackWidth => {}
            RoadColumn::Unused => unused.push(short),
            _ if meaning.factor != 1.0 => {
                taken.push((column, format!("`{short}` for {} (times {})", column.name(), meaning.factor)));
            }
            _ if !PLAIN.contains(&name.as_str()) => {
                taken.push((column, format!("`{short}` for {}", column.name())));
            }
            _ => {}
        }
        columns.push(meaning);
    }
    let has = |column: RoadColumn| columns.iter().any(|meaning| meaning.column == column);
    let geodetic = has(RoadColumn::Latitude)
        && has(RoadColumn::Longitude)
        && !(has(RoadColumn::X) && has(RoadColumn::Y));
    for meaning in columns.iter_mut().filter(|_| !geodetic).filter(|meaning| meaning.column.is_geodetic()) {
        taken.retain(|(column, _)| *column != meaning.column);
        unused.push(meaning.column.name().to_owned());
        meaning.column = RoadColumn::Unused;
    }
    for needed in [RoadColumn::X, RoadColumn::Y].into_iter().filter(|_| !geodetic) {
        if !columns.iter().any(|meaning| meaning.column == needed) {
            return Err(PathError::MissingColumn {
                place: at_line(line),
                column: needed.name(),
                found,
                known: OPTIONAL,
            });
        }
    }
    if !taken.is_empty() {
        let taken: Vec<String> = taken.into_iter().map(|(_, words)| words).collect();
        notes.push(Note::info(format!("columns taken: {}", taken.join(", "))));
    }
    if !unknown.is_empty() {
        let unknown = unknown.join(", ");
        notes.push(Note::warning(format!(
            "columns unknown and not used: {unknown}; known are x, y, {OPTIONAL}"
        )));
    }
    if !unused.is_empty() {
        notes.push(Note::info(format!("columns not used: {}", unused.join(", "))));
    }
    Ok(columns)
}

/// The point in a row, and its station if there is one.
fn row(
    row: &table::Row<'_>,
    columns: &[Meaning],
    decimals: &mut Decimals,
) -> Result<(Sample, Option<f64>), PathError> {
    let line = row.line;
    let found = row.filled(columns.len());
    if found != columns.len() {
        return Err(PathError::RowLength { place: at_line(line), found, expected: columns.len() });
    }
    let mut sample = Sample::default();
    let mut station = None;
    let (mut normal, mut offset) = ([0.0; 2], 0.0);
    for (index, &Meaning { column, factor }) in columns.iter().enumerate() {
        if matches!(column, RoadColumn::TrackWidth | RoadColumn::Unused) {
            continue;
        }
        let field = row.field(index);
        let needed =
            matches!(column, RoadColumn::X | RoadColumn::Y | RoadColumn::Latitude | RoadColumn::Longitude);
        if field.is_empty() && !needed {
            continue;
        }
        if column == RoadColumn::Class {
            let class = RoadClass::from_name(field);
            sample.class = Some(class.ok_or_else(|| PathError::UnknownClass {
                place: at_line(line),
                text: field.chars().take(40).collect(),
            })?);
            continue;
        }
        let plain = row.plain(index);
        let value: f64 = plain.parse().map_err(|_| PathError::NotANumber {
            place: at_line(line),
            column: column.name(),
            text: plain.chars().take(60).collect(),
        })?;
        let value = if factor == 1.0 { value } else { factor * value };
        if !value.is_finite() {
            return Err(PathError::NotFinite { place: at_line(line), column: column.name(), value });
        }
        if needed && (factor == 1.0 || column.is_geodetic()) {
            decimals.look(&plain, usize::from(matches!(column, RoadColumn::Y | RoadColumn::Latitude)));
        }
        let largest = if column == RoadColumn::Latitude { 90f64 } else { 360.0 };
        if column.is_geodetic() && value.abs() > largest.to_radians() {
            let (value, low, high, unit) = (value.to_degrees(), -largest, largest, "degrees");
            return Err(PathError::OutOfRange {
                place: at_line(line),
                column: column.name(),
                value,
                low,
                high,
                unit,
            });
        }
        match column {
            RoadColumn::X | RoadColumn::Longitude => sample.x = value,
            RoadColumn::Y | RoadColumn::Latitude => sample.y = value,
            RoadColumn::Station => station = Some(value),
            RoadColumn::Yaw => sample.yaw = Some(value),
            RoadColumn::Curvature => sample.curvature = Some(value),
            RoadColumn::Speed => sample.speed = Some(value),
            RoadColumn::Bank => sample.bank = Some(value),
            RoadColumn::Grade => sample.grade = Some(value),
            RoadColumn::Friction => sample.friction = Some(value),
            RoadColumn::NormalX => normal[0] = value,
            RoadColumn::NormalY => normal[1] = value,
            RoadColumn::Offset => offset = value,
            RoadColumn::Class | RoadColumn::TrackWidth | RoadColumn::Unused => {}
        }
    }
    if offset != 0.0 {
        sample.x += offset * normal[0];
        sample.y += offset * normal[1];
    }
    Ok((sample, station))
}
