//! Reading vehicle files: the common part of cars and trucks.

use super::builtin;
use super::effects::EffectOutOfRange;
use super::tolerance::Tolerances;
use super::tyre::{Coefficients, TirError, Tyre};
use crate::input;
use crate::numerics::Readable;
use crate::signal::Unit;
use serde::{Serialize, de::DeserializeOwned};
use std::path::{Path, PathBuf};

/// The declaration of one number among a vehicle's parameters.
#[derive(Debug)]
pub struct ParameterDeclaration<V> {
    /// Section and key in the file, and the FMU parameter's name.
    pub name: &'static str,
    /// Unit of the value.
    pub unit: Unit,
    /// Least and greatest value that a vehicle can have.
    pub range: (f64, f64),
    /// Meaning, in one sentence.
    pub meaning: &'static str,
    pub(super) get: fn(&V) -> f64,
    pub(super) set: fn(&mut V, f64),
}

/// Range of a number of a table by its name, for a second owner of the same quantity: a range is written once.
///
/// # Panics
/// While compiling: there is no number of that name.
pub(crate) const fn range_of<V>(table: &[ParameterDeclaration<V>], name: &str) -> (f64, f64) {
    let wanted = name.as_bytes();
    let mut index = 0;
    while index < table.len() {
        let found = table[index].name.as_bytes();
        let mut same = if found.len() == wanted.len() { 0 } else { usize::MAX };
        while same < wanted.len() && found[same] == wanted[same] {
            same += 1;
        }
        if same == wanted.len() {
            return table[index].range;
        }
        index += 1;
    }
    panic!("no number of that name")
}

impl<V> ParameterDeclaration<V> {
    /// The parameter's value.
    #[must_use]
    pub fn get(&self, vehicle: &V) -> f64 {
        (self.get)(vehicle)
    }

    /// Sets the parameter; the vehicle's `check` tests the range.
    pub fn set(&self, vehicle: &mut V, value: f64) {
        (self.set)(vehicle, value);
    }
}

macro_rules! table {
    ($($first:ident $(. $rest:ident)* : $unit:ident in $min:expr, $max:expr; $meaning:literal)*) => {
        &[$(ParameterDeclaration {
            name: concat!(stringify!($first) $(, ".", stringify!($rest))*),
            unit: crate::signal::Unit::$unit,
            range: ($min, $max),
            meaning: $meaning,
            get: |vehicle| vehicle.$first$(.$rest)*,
            set: |vehicle, value| vehicle.$first$(.$rest)* = value,
        }),*]
    };
}
pub(super) use table;

/// The kinds of vehicles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[allow(missing_docs)]
pub enum VehicleKind {
    Car,
    Truck,
}

impl VehicleKind {
    /// The kind of a built-in vehicle, or of that in a file. A car where neither can be told, so that reading it as a
    /// car gives the error.
    #[must_use]
    pub fn of(vehicle: &str) -> Self {
        Self::of_builtin(vehicle)
            .or_else(|| Self::of_text(&input::read_text(Path::new(vehicle)).ok()?))
            .unwrap_or(Self::Car)
    }

    fn of_builtin(vehicle: &str) -> Option<Self> {
        [(Self::Car, builtin::BUILTIN), (Self::Truck, builtin::BUILTIN_TRUCKS)]
            .into_iter()
            .find_map(|(kind, names)| names.contains(&vehicle).then_some(kind))
    }

    /// The kind in the text of a vehicle file, by the section of its masses.
    fn of_text(text: &str) -> Option<Self> {
        let file = text.parse::<toml::Table>().ok()?;
        [(Self::Truck, "tractor"), (Self::Car, "vehicle")]
            .into_iter()
            .find_map(|(kind, section)| file.contains_key(section).then_some(kind))
    }
}

impl std::fmt::Display for VehicleKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Car => "car",
            Self::Truck => "truck",
        })
    }
}

/// A doubtful number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Doubt {
    /// Section and key in the file.
    pub name: &'static str,
    /// Its contradiction to other numbers, and what it may have been meant to be.
    pub words: String,
}

/// Parameters of a kind of vehicle, as a file gives them.
pub trait VehicleParameters: DeserializeOwned + Serialize + Clone + std::fmt::Debug + 'static {
    /// Every number with name, unit, range and meaning.
    const TABLE: &'static [ParameterDeclaration<Self>];
    /// What they are of.
    const KIND: VehicleKind;
    /// Names of the built-in vehicles of this kind; the first is the default.
    const BUILTIN: &'static [&'static str];

    /// Differences of a real vehicle of this kind from its parameters.
    type Effects: Default + Clone;

    /// Name of the vehicle for people.
    fn name(&self) -> &str;

    /// The effects of its file.
    fn effects(&self) -> &Self::Effects;

    /// Uncertainty of its numbers, where its file states it.
    fn tolerances(&self) -> &Tolerances;

    /// Value of the effect with this id.
    fn effect_mut(&mut self, id: &str) -> Option<&mut f64>;

    /// A built-in vehicle by name.
    ///
    /// # Errors
    /// [`VehicleError::UnknownBuiltin`].
    fn builtin(name: &str) -> Result<Self, VehicleError>;

    /// Reads a vehicle file and the tyre files that it names.
    ///
    /// # Errors
    /// See [`VehicleError`]: file, line, key and remedy.
    fn of_file(file: &Path) -> Result<Self, VehicleError> {
        read(file)
    }

    /// A built-in vehicle by name, else that of a file, which lies where `locate` says.
    ///
    /// # Errors
    /// See [`VehicleError`].
    fn named(name: &str, locate: impl FnOnce(&str) -> PathBuf) -> Result<Self, VehicleError> {
        match VehicleKind::of_builtin(name) {
            Some(kind) if kind == Self::KIND => Self::builtin(name),
            Some(found) => Err(VehicleError::OtherKind {
                name: name.to_owned(),
                found,
                wanted: Self::KIND,
                builtin: Self::BUILTIN,
            }),
            None => Self::of_file(&locate(name)),
        }
    }

    /// The tyres with the key of their file.
    fn tyres(&mut self) -> Vec<(&'static str, &mut Tyre)>;

    /// Checks relations between several numbers.
    ///
    /// # Errors
    /// See [`VehicleError`].
    fn check_parts(&self, place: &VehiclePlace) -> Result<(), VehicleError>;

    /// Numbers that contradict others, though each is in its range.
    fn doubts(&self) -> Vec<Doubt>;
}

/// Where a vehicle's number comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum VehiclePlace {
    /// A file, and its line, counted from 1; 0 where none is known.
    File(PathBuf, usize),
    /// The vehicle of this name, with numbers that were set by a host or a program.
    Set(String),
}

impl VehiclePlace {
    /// Place of a number in a file.
    #[must_use]
    pub fn of(file: &Path, name: &str) -> Self {
        let line = input::read_text(file).map_or(0, |text| line_of(&text, name));
        Self::File(file.to_path_buf(), line)
    }
}

impl std::fmt::Display for VehiclePlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(file, 0) => write!(f, "vehicle file {}", file.display()),
            Self::File(file, line) => write!(f, "vehicle file {}, line {line}", file.display()),
            Self::Set(name) => write!(f, "vehicle '{name}' with the values set"),
        }
    }
}

/// Reasons for which a vehicle file could not be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum VehicleError {
    /// The file cannot be opened.
    #[error("vehicle file {file}: cannot be read ({source}); check the name, or use a built-in one: {}", builtin.join(", "))]
    Unreadable { file: PathBuf, source: std::io::Error, builtin: Vec<&'static str> },
    /// No built-in vehicle has this name.
    #[error("there is no built-in vehicle '{name}'; there are: {}", builtin.join(", "))]
    UnknownBuiltin { name: String, builtin: &'static [&'static str] },
    /// The vehicle is of the other kind.
    #[error("vehicle '{name}' is a {found}, and a {wanted} is wanted here: give a file of one, or a built-in one: {}", builtin.join(", "))]
    OtherKind { name: String, found: VehicleKind, wanted: VehicleKind, builtin: &'static [&'static str] },
    /// Not TOML, or a key that is missing, unknown or of the wrong type.
    #[error("{place}: {message}; compare with the files in vehicles/")]
    Syntax { place: VehiclePlace, message: String },
    /// A value that is impossible for a vehicle.
    #[error("{place}: {name} = {} {unit} is outside {} ... {} ({meaning})", Readable(*value), range.0, range.1)]
    Range {
        place: VehiclePlace,
        name: &'static str,
        value: f64,
        unit: &'static str,
        range: (f64, f64),
        meaning: &'static str,
    },
    /// The unsprung masses leave nothing, or too little, for the body.
    #[error(
        "{place}: the unsprung masses ({unsprung} kg) must leave at least a tenth of {name} ({mass} kg) to the body; \
         correct {name} or the axles' unsprung_mass"
    )]
    NoBody { place: VehiclePlace, name: &'static str, mass: f64, unsprung: f64 },
    /// Shares of the brake force that leave less than nothing to the last axle.
    #[error(
        "{place}: brake.front_share {front} and brake.trailer_share {trailer} are together more than 1; the rear axle \
         has the rest"
    )]
    BrakeShares { place: VehiclePlace, front: f64, trailer: f64 },
    /// An effect out of range.
    #[error("{place}: {source}")]
    Effect { place: VehiclePlace, source: EffectOutOfRange },
    /// The parameters were not read by `read` or `parse`, which read the tyres too.
    #[error("{place}: its tyres have not been read; use `read` of the vehicle's parameters")]
    NoTyres { place: VehiclePlace },
    /// The tyre file that the vehicle names cannot be used.
    #[error("{place}, {key}: {source}")]
    Tyre { place: VehiclePlace, key: &'static str, source: Box<TirError> },
}

/// Reads a vehicle file and the tyre files that it names.
pub(super) fn read<V: VehicleParameters>(file: &Path) -> Result<V, VehicleError> {
    let text = input::read_text(file).map_err(|source| VehicleError::Unreadable {
        file: file.to_path_buf(),
        source,
        builtin: V::BUILTIN.to_vec(),
    })?;
    let folder = file.parent().unwrap_or(Path::new("")).to_path_buf();
    parse(&text, file, |name| {
        let beside = folder.join(name);
        // A copied vehicle file still finds the tyres that come with the program.
        match builtin::tyre(name) {
            Some(text) if !beside.exists() => Coefficients::parse(text, Path::new(name)),
            _ => Coefficients::read(&beside),
        }
    })
}

/// Reads the text of a vehicle file; `tyre` gives the tyre of a name, `file` is for messages.
pub(super) fn parse<V: VehicleParameters>(
    text: &str,
    file: &Path,
    tyre: impl Fn(&str) -> Result<Coefficients, TirError>,
) -> Result<V, VehicleError> {
    let whole = || VehiclePlace::File(file.to_path_buf(), 0);
    let mut vehicle: V = toml::from_str(text).map_err(|error| match VehicleKind::of_text(text) {
        Some(found) if found != V::KIND => {
            let (name, wanted) = (file.display().to_string(), V::KIND);
            VehicleError::OtherKind { name, found, wanted, builtin: V::BUILTIN }
        }
        _ => {
            let (line, message) = input::toml_error(text, &error);
            VehicleError::Syntax { place: VehiclePlace::File(file.to_path_buf(), line), message }
        }
    })?;
    for (key, axle) in vehicle.tyres() {
        let coefficients = tyre(&axle.file).map_err(|source| VehicleError::Tyre {
            place: whole(),
            key,
            source: Box::new(source),
        })?;
        if axle.vertical_stiffness == 0.0 {
            axle.vertical_stiffness = coefficients.vertical_stiffness;
        }
        axle.coefficients = Some(coefficients);
    }
    check(&vehicle, |name| {
        VehiclePlace::File(file.to_path_buf(), name.map_or(0, |name| line_of(text, name)))
    })?;
    Ok(vehicle)
}

/// Checks every value against the ranges of vehicles; `place` tells where a number stands, or all of them.
pub(super) fn check<V: VehicleParameters>(
    vehicle: &V,
    place: impl Fn(Option<&str>) -> VehiclePlace,
) -> Result<(), VehicleError> {
    for parameter in V::TABLE {
        let value = parameter.get(vehicle);
        let &ParameterDeclaration { name, unit, range, meaning, .. } = parameter;
        if !(value >= range.0 && value <= range.1) {
            let (place, unit) = (place(Some(name)), unit.symbol);
            return Err(VehicleError::Range { place, name, value, unit, range, meaning });
        }
    }
    vehicle.check_parts(&place(None))
}

/// Checks that the unsprung masses (kg) leave a body.
pub(super) fn check_body(
    place: &VehiclePlace,
    name: &'static str,
    mass: f64,
    unsprung: f64,
) -> Result<(), VehicleError> {
    if unsprung > 0.9 * mass {
        return Err(VehicleError::NoBody { place: place.clone(), name, mass, unsprung });
    }
    Ok(())
}

/// Gives a kind of parameters its `read`, `parse` and `check`.
macro_rules! reading {
    ($parameters:ty) => {
        impl $parameters {
            /// Reads a vehicle file and the tyre files that it names.
            ///
            /// # Errors
            /// See [`VehicleError`]: file, line, key and remedy.
            pub fn read(file: &std::path::Path) -> Result<Self, VehicleError> {
                super::file::read(file)
            }

            /// Reads the text of a vehicle file; `tyre` gives the tyre of a name, `file` is for messages.
            ///
            /// # Errors
            /// See [`VehicleError`].
            pub fn parse(
                text: &str,
                file: &std::path::Path,
                tyre: impl Fn(&str) -> Result<super::tyre::Coefficients, super::tyre::TirError>,
            ) -> Result<Self, VehicleError> {
                super::file::parse(text, file, tyre)
            }

            /// Checks every value against what a vehicle can have.
            ///
            /// # Errors
            /// See [`VehicleError`]: a value out of range, or parts that do not fit together.
            pub fn check(&self) -> Result<(), VehicleError> {
                super::file::check(self, |_| super::file::VehiclePlace::Set(self.name.clone()))
            }
        }
    };
}
pub(super) use reading;

/// Line (from 1) of the key `section.key` in a TOML text as ours are written; 0 if it does not stand there.
fn line_of(text: &str, name: &str) -> usize {
    let Some((section, key)) = name.rsplit_once('.') else { return 0 };
    let mut current = "";
    for (index, raw) in text.lines().enumerate() {
        let line = raw.split('#').next().unwrap_or_default().trim();
        if let Some(header) = line.strip_prefix('[') {
            current = header.trim_end_matches(']').trim();
        } else if current == section && line.split('=').next().is_some_and(|found| found.trim() == key) {
            return index + 1;
        }
    }
    0
}

/// A built-in vehicle by name, among the texts of its kind.
pub(super) fn builtin_of<V: VehicleParameters>(
    texts: &[(&str, &str)],
    name: &str,
) -> Result<V, VehicleError> {
    let Some((_, text)) = texts.iter().find(|(vehicle, _)| *vehicle == name) else {
        return Err(VehicleError::UnknownBuiltin { name: name.to_string(), builtin: V::BUILTIN });
    };
    parse(text, Path::new(&format!("{name}.toml")), |file| match builtin::tyre(file) {
        Some(text) => Coefficients::parse(text, Path::new(file)),
        None => Err(TirError::Unreadable {
            file: PathBuf::from(file),
            source: std::io::Error::from(std::io::ErrorKind::NotFound),
        }),
    })
}
