//! The model's file: a head for people, then numbers.
//!
//! ```text
//! rfl-residual 1 1873 612345 0123456789abcdef     magic, format, bytes of head, bytes of numbers, FNV-1a of both
//! vehicle_hash = "..."                            head, TOML: kind, sample time, window, vehicle, ranges, ...
//! [schema]
//! ...
//! <bytes>                                         trees and leaves, postcard
//! ```
//!
//! The head is TOML because the FMUs read TOML anyway, and because `head -40 model.rfl` then tells what a model is.
//! Trees and leaves are some 100 000 numbers that nobody reads. postcard stores them bit for bit, ten times smaller and
//! faster than text. Gaussian processes have files made alike, with a magic word of their own.

use super::forest::Forest;
use super::leaf::LeafModels;
use super::model::ResidualModelFor;
use super::schema::{Kind, Schema};
use super::tree::MAX_DEPTH;
use super::{MAX_WINDOW, ROAD};
use crate::input;
use crate::nominal::LateralVehicle;
use crate::numerics::fnv;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The format that this library writes, and the only one it reads.
pub const FORMAT: u32 = 1;

/// Kind of contents of a model's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A [`ResidualModel`](super::ResidualModel).
    Residual,
    /// A [`GpModel`](super::gp::GpModel).
    Gp,
}

impl FileKind {
    const ALL: [Self; 2] = [Self::Residual, Self::Gp];

    /// The word that the file begins with.
    const fn magic(self) -> &'static str {
        match self {
            Self::Residual => "rfl-residual",
            Self::Gp => "rfl-gp",
        }
    }

    /// Kind of a file's contents, by their first word.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| {
            let rest = bytes.strip_prefix(kind.magic().as_bytes());
            rest.is_some_and(|rest| rest.first().is_none_or(|&byte| byte == b' '))
        })
    }
}

impl std::fmt::Display for FileKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Residual => "a residual of the linear model (trees, leaves)",
            Self::Gp => "a Gaussian process on a nonlinear model",
        })
    }
}

/// Longest first line.
const FIRST_LINE: usize = 120;

/// Reasons for which a model's file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// An error with the file in which it lies.
    #[error("{}: {cause}", file.display())]
    In {
        /// The file.
        file: PathBuf,
        /// The error itself.
        cause: Box<FileError>,
    },
    /// It cannot be read.
    #[error("cannot be read: {0}; check the name and the permission")]
    Read(std::io::Error),
    /// It cannot be written.
    #[error("cannot be written: {0}; check the name and the permission")]
    Write(std::io::Error),
    /// It is something else.
    #[error(
        "is no residual model: it begins neither with `{}` nor with `{}`; give a file that `rfl train` wrote",
        FileKind::Residual.magic(), FileKind::Gp.magic()
    )]
    NotAModel,
    /// A model, but of the other kind.
    #[error(
        "holds {found}, and {wanted} is needed; train that kind, or choose the controller that takes this one"
    )]
    OtherKind {
        /// Kind of the file's contents.
        found: FileKind,
        /// Kind asked for.
        wanted: FileKind,
    },
    /// A model, but for another kind of vehicle.
    #[error("holds a model for a {found}, and one for a {wanted} is needed; train a model for this vehicle")]
    OtherVehicle {
        /// Whose model the file holds.
        found: String,
        /// Whose was asked for.
        wanted: &'static str,
    },
    /// A model of a kind that this vehicle has none of.
    #[error("holds {found}, and a {vehicle} has none: train a residual of its linear model")]
    NoneOfVehicle {
        /// Kind of the file's contents.
        found: FileKind,
        /// The vehicle.
        vehicle: &'static str,
    },
    /// The first line is damaged.
    #[error("its first line is damaged: `{line}`; copy the file again, or train anew")]
    FirstLine {
        /// As found.
        line: String,
    },
    /// Another version of the format.
    #[error("has format {found}, this program reads format {FORMAT}; train the model anew with this version")]
    Format {
        /// As found.
        found: u32,
    },
    /// Bytes are missing, or there are too many.
    #[error("has {found} bytes where its first line says {expected}; it was cut or added to: copy it again")]
    Length {
        /// As found.
        found: u64,
        /// As the first line says.
        expected: u64,
    },
    /// Some bytes are not what was written.
    #[error(
        "is damaged: checksum {found:016x} instead of {expected:016x}; copy it again (a head edited by hand does this, too: train anew instead)"
    )]
    Checksum {
        /// Of the bytes found.
        found: u64,
        /// As the first line says.
        expected: u64,
    },
    /// The head is no TOML, or lacks entries.
    #[error("its head cannot be understood: {0}")]
    Head(String),
    /// The numbers cannot be decoded.
    #[error("its numbers cannot be decoded: {0}")]
    Numbers(#[from] postcard::Error),
    /// Decoded, but not a model.
    #[error("contradicts itself: {what}; train the model anew")]
    Invalid {
        /// The contradiction.
        what: &'static str,
    },
}

impl FileError {
    /// True if the file is a sound model of another kind of vehicle.
    #[must_use]
    pub fn is_of_another_vehicle(&self) -> bool {
        match self {
            Self::In { cause, .. } => cause.is_of_another_vehicle(),
            Self::OtherVehicle { .. } => true,
            _ => false,
        }
    }
}

#[derive(Serialize, Deserialize)]
struct ModelHead<S> {
    vehicle_hash: String,
    /// None stands for a car: files were the car's alone at first.
    #[serde(skip_serializing_if = "Option::is_none")]
    vehicle_kind: Option<String>,
    schema: S,
}

/// The head without the differences between kinds.
#[derive(Deserialize)]
struct HeadKind {
    vehicle_kind: Option<String>,
}

/// The kind of vehicle that a head without one is for.
const FIRST_KIND: &str = "car";

impl<V: LateralVehicle<S>, const S: usize> ResidualModelFor<V, S> {
    /// The model as the bytes of its file.
    ///
    /// # Errors
    /// A model that cannot be written; none that training makes.
    pub fn to_bytes(&self) -> Result<Vec<u8>, FileError> {
        let vehicle = &self.schema.vehicle;
        seal(FileKind::Residual, vehicle, &self.schema, &(&self.forest, &self.leaves))
    }

    /// A model from the bytes of its file.
    ///
    /// # Errors
    /// Bytes that are no model, whole and consistent; never a panic.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FileError> {
        let (schema, (forest, leaves)) =
            open(FileKind::Residual, bytes, |schema: &Schema<V>| &schema.vehicle)?;
        Self::check(&schema, &forest, &leaves).map_err(|what| FileError::Invalid { what })?;
        Ok(Self::new(schema, forest, leaves))
    }

    /// Reads a model's file.
    ///
    /// # Errors
    /// A file that cannot be read or is no model.
    pub fn read(file: &Path) -> Result<Self, FileError> {
        in_file(file, || Self::from_bytes(&input::read(file, input::MODEL).map_err(FileError::Read)?))
    }

    /// Writes the model's file.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), FileError> {
        in_file(file, || crate::output::write_bytes(file, self.to_bytes()?).map_err(FileError::Write))
    }

    /// Checks that look-ups can rely on the model, whoever wrote it.
    fn check(schema: &Schema<V>, forest: &Forest, leaves: &LeafModels<S>) -> Result<(), &'static str> {
        let ensure = |holds: bool, what: &'static str| if holds { Ok(()) } else { Err(what) };
        ensure((1..=MAX_WINDOW).contains(&schema.window), "its window is out of range")?;
        ensure(schema.regressors.states <= schema.window, "its leaves have more states than its window")?;
        let positive = |x: f64| x > 0.0 && x.is_finite();
        ensure(positive(schema.sample_time), "its sample time is no positive number")?;
        ensure(
            schema.vehicle.model_at(schema.min_model_speed).is_ok(),
            "a parameter of its vehicle, or its minimum model speed, is no positive number",
        )?;
        let ranges = if schema.kind == Kind::None { 0 } else { S + ROAD + 1 };
        ensure(schema.ranges.len() == ranges, "its ranges are not those of its features and the command")?;
        let ordered = schema.ranges.iter().all(|r| r.min <= r.max && r.min.is_finite() && r.max.is_finite());
        ensure(ordered, "a range is none")?;

        let depth = usize::from(forest.depth);
        ensure(depth <= MAX_DEPTH, "its trees are too deep")?;
        let (trees, ends) = (forest.trees(), 1_usize << depth);
        ensure((1..=1000).contains(&trees), "its number of trees is out of range")?;
        ensure(schema.kind.has_trees() || (trees == 1 && depth == 0), "a kind without trees has trees")?;
        let nodes = trees * (ends - 1);
        ensure(
            forest.feature.len() == nodes && forest.threshold.len() == nodes,
            "its trees are not complete",
        )?;
        ensure(forest.leaf.len() == trees * ends, "its trees do not end in leaves")?;
        let features = S * schema.window + ROAD;
        ensure(
            forest.feature.iter().all(|&f| usize::from(f) < features),
            "a tree asks for an unknown feature",
        )?;
        ensure(!forest.threshold.iter().any(|t| t.is_nan()), "a threshold is not a number")?;
        ensure(forest.leaf.iter().all(|&leaf| leaf < forest.leaves), "a tree ends in an unknown leaf")?;

        let count = forest.leaves();
        let p = if schema.kind.is_linear() { schema.regressors.count(S, schema.window) } else { 1 };
        ensure(leaves.regressors() == p, "its leaves have other regressors than its head says")?;
        ensure(
            Some(leaves.theta.len()) == count.checked_mul(p),
            "coefficients of leaves are missing or too many",
        )?;
        ensure(leaves.command_range.len() == count, "command ranges of leaves are missing or too many")?;
        let finite = leaves.theta.as_flattened().iter().chain(leaves.command_range.as_flattened());
        // Far from the largest number: sums over trees and windows are finite, too.
        ensure(finite.into_iter().all(|x| x.abs() < 1e300), "a coefficient is not a finite number")
    }
}

/// The bytes of a file: first line, head, numbers.
pub(super) fn seal<V: LateralVehicle<S>, const S: usize>(
    kind: FileKind,
    vehicle: &V,
    schema: &impl Serialize,
    numbers: &impl Serialize,
) -> Result<Vec<u8>, FileError> {
    let vehicle_kind = (V::KIND != FIRST_KIND).then(|| V::KIND.to_owned());
    let head = ModelHead { vehicle_hash: vehicle_hash(vehicle), vehicle_kind, schema };
    let mut body = toml::to_string(&head).map_err(|error| FileError::Head(error.to_string()))?.into_bytes();
    let head_length = body.len();
    body.extend(postcard::to_allocvec(numbers)?);
    let numbers = body.len() - head_length;
    let line = format!("{} {FORMAT} {head_length} {numbers} {:016x}\n", kind.magic(), fnv(&body));
    Ok([line.as_bytes(), &body].concat())
}

/// Schema and numbers of a file that is whole, undamaged, of the kind `wanted` and for such a vehicle.
pub(super) fn open<H: DeserializeOwned, N: DeserializeOwned, V: LateralVehicle<S>, const S: usize>(
    wanted: FileKind,
    bytes: &[u8],
    vehicle: impl Fn(&H) -> &V,
) -> Result<(H, N), FileError> {
    let found = FileKind::of(bytes).ok_or(FileError::NotAModel)?;
    if found != wanted {
        return Err(FileError::OtherKind { found, wanted });
    }
    let start = &bytes[..bytes.len().min(FIRST_LINE)];
    let line = start.split(|&b| b == b'\n').next().unwrap_or_default();
    let text = String::from_utf8_lossy(line);
    let damaged = || FileError::FirstLine { line: text.escape_default().to_string() };
    let words: Vec<&str> = text.split(' ').collect();
    let format: u32 = words.get(1).and_then(|word| word.parse().ok()).ok_or_else(damaged)?;
    if format != FORMAT {
        return Err(FileError::Format { found: format });
    }
    let [_, _, head, numbers, checksum] = words[..] else { return Err(damaged()) };
    let (Ok(head), Ok(numbers)) = (head.parse::<u32>(), numbers.parse::<u32>()) else {
        return Err(damaged());
    };
    let expected = u64::from_str_radix(checksum, 16).map_err(|_| damaged())?;
    let body = bytes.get(line.len() + 1..).unwrap_or_default();
    let (found, length) = (body.len() as u64, u64::from(head) + u64::from(numbers));
    if found != length {
        return Err(FileError::Length { found, expected: length });
    }
    let found = fnv(body);
    if found != expected {
        return Err(FileError::Checksum { found, expected });
    }
    let (head, numbers) = body.split_at(head as usize);
    let head = std::str::from_utf8(head).map_err(|error| FileError::Head(error.to_string()))?;
    let understood = |error: toml::de::Error| FileError::Head(error.to_string());
    let HeadKind { vehicle_kind } = toml::from_str(head).map_err(understood)?;
    let found = vehicle_kind.unwrap_or_else(|| FIRST_KIND.to_owned());
    if found != V::KIND {
        return Err(FileError::OtherVehicle { found, wanted: V::KIND });
    }
    let head: ModelHead<H> = toml::from_str(head).map_err(understood)?;
    let (numbers, rest) = postcard::take_from_bytes(numbers)?;
    if !rest.is_empty() {
        return Err(FileError::Invalid { what: "there are more numbers than the model has" });
    }
    if head.vehicle_hash != vehicle_hash(vehicle(&head.schema)) {
        return Err(FileError::Invalid { what: "the vehicle's parameters do not have the vehicle's hash" });
    }
    Ok((head.schema, numbers))
}

/// Names the file in an error of it.
pub(crate) fn in_file<T>(file: &Path, work: impl FnOnce() -> Result<T, FileError>) -> Result<T, FileError> {
    work().map_err(|cause| FileError::In { file: file.to_owned(), cause: Box::new(cause) })
}

/// Identifies a nominal vehicle: FNV-1a of its parameters' bits.
fn vehicle_hash<V: LateralVehicle<S>, const S: usize>(vehicle: &V) -> String {
    let parameters = vehicle.parameters();
    let bytes: Vec<u8> = parameters.iter().flat_map(|(_, x)| x.to_bits().to_le_bytes()).collect();
    format!("{:016x}", fnv(&bytes))
}
