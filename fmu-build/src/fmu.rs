//! An FMU to be made: from source, or from one that was made before.

use crate::cargo::CargoError;
use crate::description::describe_in;
use crate::library::LibraryError;
use crate::package::{Package, PackageError};
use crate::standard::Standard;
use rfl_mpc::fmi::{Declaration, ModelError, START_FILE, StartError, VariableKind, read_start_file};
use rfl_mpc::fmu::DEFAULT_PATH;
use rfl_mpc::vehicle::VehicleKind;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// Reason for which an FMU could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum FmuError {
    #[error(transparent)]
    Cargo(#[from] CargoError),
    #[error(transparent)]
    Library(#[from] LibraryError),
    #[error(transparent)]
    Package(#[from] PackageError),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error("cannot read {path}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error(
        "{path} is not what the declaration of {name} says. Run `cargo run -p fmu-build -- --describe`, look at the \
         difference, commit it, and build again."
    )]
    Description { name: &'static str, path: PathBuf },
    #[error(
        "the library {path} was not built for this description: it does not know the GUID {guid}. Build it anew."
    )]
    Guid { path: PathBuf, guid: String },
    #[error(
        "{path} is of FMI {found}, and the FMUs before it of another version: change those of one version at a time"
    )]
    Mixed { path: PathBuf, found: &'static str },
    #[error(
        "{path} is no FMU of this program: its name must be one of {names}, and its modelDescription.xml must have that name"
    )]
    Foreign { path: PathBuf, names: String },
    #[error(
        "{path} was made by another version of fmu-build: its GUID is {found}, this version's is {own}. Take an FMU of \
         this version, or the fmu-build that made it"
    )]
    Version { path: PathBuf, found: String, own: String },
    #[error("the start values in {path} cannot be read: {message}. Take the FMU as it was shipped")]
    PackedStart { path: PathBuf, message: String },
    #[error("{name} cannot start with what is packed into it: {source}")]
    Controller { name: &'static str, source: ModelError },
    #[error("cannot unpack into the system's temporary folder: {0}")]
    Temporary(std::io::Error),
    #[error("the library {path} is for {found}, but lies in a folder for {folder}")]
    Platform { path: PathBuf, found: &'static str, folder: String },
}

/// A file or folder of the project that goes into an FMU's `resources/`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resource {
    /// Path in the project.
    pub from: &'static str,
    /// Path below `resources/`.
    pub to: &'static str,
}

/// An FMU to be made.
#[derive(Debug, Clone)]
pub struct Fmu {
    /// The unit; its name is the FMU's.
    pub declaration: Declaration,
    /// The vehicles that it is for.
    pub vehicle: VehicleKind,
    /// The committed `modelDescription.xml` of FMI 2.0, in the project; that of 3.0 lies in `fmi3/` beside it.
    pub description: String,
    /// The package whose dependencies are linked in.
    pub package: &'static str,
    /// Arguments of `cargo build` that choose its library.
    pub selection: Vec<&'static str>,
    /// Contents of `resources/`.
    pub resources: &'static [Resource],
    /// Additions of a user.
    pub added: Added,
    /// The FMU that is changed, if it is not made from source.
    pub base: Option<Base>,
}

/// An FMU that was made before. Its libraries, licences and resources are taken over, so that a change of resources
/// and start values needs no compiler.
#[derive(Debug, Clone)]
pub struct Base {
    /// The version of FMI that it is of.
    pub standard: Standard,
    pub(crate) package: Package,
    start: BTreeMap<String, String>,
    /// Its unpacked resources.
    folder: Arc<TempDir>,
}

impl Base {
    /// Reads an FMU's file, which must be one of `all`, and of this version; gives which one, based on the file.
    ///
    /// # Errors
    /// A file that is none of them.
    pub fn read(file: &Path, all: &[Fmu]) -> Result<Fmu, FmuError> {
        let package = Package::read(file)?;
        let text = |entry: &str| String::from_utf8_lossy(package.get(entry).unwrap_or_default()).into_owned();
        let xml = text("modelDescription.xml");
        let of_name = |fmu: &&Fmu| xml.contains(&format!(" modelName=\"{}\"", fmu.declaration.name));
        let fmu = all.iter().find(of_name).ok_or_else(|| {
            let names: Vec<_> = all.iter().map(|fmu| fmu.declaration.name).collect();
            FmuError::Foreign { path: file.to_owned(), names: names.join(", ") }
        })?;
        let standard = Standard::of(&xml).unwrap_or_default();
        let mark = |xml: &str| standard.mark_of(xml).to_owned();
        let (found, own) = (mark(&xml), mark(&describe_in(standard, &fmu.declaration)));
        if found != own {
            return Err(FmuError::Version { path: file.to_owned(), found, own });
        }
        let start = text(&format!("resources/{START_FILE}"));
        let start = read_start_file(&start)
            .map_err(|error| FmuError::PackedStart { path: file.to_owned(), message: error.to_string() })?;
        let folder = temporary_folder()?;
        package.unpack("resources/", folder.path())?;
        let base = Base { standard, package, start, folder: Arc::new(folder) };
        Ok(Fmu { base: Some(base), ..fmu.clone() })
    }

    /// Folder of its resources, unpacked.
    #[must_use]
    pub fn surroundings(&self) -> Surroundings<'_> {
        Surroundings { folder: self.folder.path(), path: DEFAULT_PATH }
    }
}

pub(crate) fn temporary_folder() -> Result<TempDir, FmuError> {
    tempfile::tempdir().map_err(FmuError::Temporary)
}

/// Folder of the files that start values name, before an FMU is packed.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// The folder that stands for `resources/`.
    pub folder: &'a Path,
    /// Name of the controller's path there.
    pub path: &'a str,
}

/// Files and values that a user gives an FMU beyond the shipped ones.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Added {
    /// Files by their path below `resources/`.
    pub files: BTreeMap<String, PathBuf>,
    /// Start values other than the declaration's, by parameter.
    pub start: BTreeMap<String, String>,
}

impl Fmu {
    /// The start values that differ from the declaration's: those that it was made with, and over them the user's.
    #[must_use]
    pub fn starts(&self) -> BTreeMap<String, String> {
        let mut start = self.base.as_ref().map(|base| base.start.clone()).unwrap_or_default();
        start.extend(self.added.start.clone());
        start
    }

    /// The committed `modelDescription.xml` of a version, in the project.
    #[must_use]
    pub fn description_in(&self, standard: Standard) -> PathBuf {
        let file = Path::new(&self.description);
        let folder = file.parent().unwrap_or(Path::new("")).join(standard.folder());
        folder.join(file.file_name().unwrap_or_default())
    }
}

pub(crate) const VEHICLE_FILE: &str = "vehicle_file";

/// The vehicle that a controller starts with: a built-in name or a file.
pub(crate) fn vehicle_of(controller: &Fmu) -> String {
    let Fmu { declaration, added, .. } = controller;
    let default = declaration.find(VEHICLE_FILE).map(|vr| &declaration.variables[vr].kind);
    let name = match (controller.starts().remove(VEHICLE_FILE), default) {
        (Some(name), _) => name,
        (None, Some(VariableKind::String { start })) => start.to_string(),
        (None, _) => String::new(),
    };
    added.files.get(&name).map_or(name, |file| file.to_string_lossy().into_owned())
}
