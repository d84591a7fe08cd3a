//! An FMU to be made: from source, or from one that was made before.

use crate::cargo::CargoError;
use crate::library::LibraryError;
use crate::package::{Package, PackageError};
use crate::standard::Standard;
use rfl_mpc::fmi::{
    Causality, Context, Declaration, Log, Model, ModelError, START_FILE, Severity, StartError, StartValues,
    Value, Values, Variable, VariableKind,
};
use rfl_mpc::vehicle::VehicleKind;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
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
    Unstartable { name: &'static str, source: ModelError },
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
    /// Initialises its model with these values; see [`initialize`].
    pub initialize: fn(&mut Values, &Context) -> Result<(), ModelError>,
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
    pub(crate) start: BTreeMap<String, String>,
}

/// Initialises a model, for [`Fmu::initialize`].
///
/// # Errors
/// The model's.
pub fn initialize<M: Model>(values: &mut Values, context: &Context) -> Result<(), ModelError> {
    M::new().initialize(values, 0.0, context, &mut Unheard)
}

/// Discards a model's messages: it gives them again to the host.
struct Unheard;

impl Log for Unheard {
    fn log(&mut self, _severity: Severity, _category: &'static str, _message: &str) {}
}

/// Folder of an FMU's resources in a package.
pub(crate) const RESOURCES: &str = "resources/";

/// Files and values that a user gives an FMU beyond the shipped ones.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Added {
    /// Files by their path below `resources/`.
    pub files: BTreeMap<String, PathBuf>,
    /// Start values of the user's choice, by parameter.
    pub start: BTreeMap<String, String>,
}

impl Fmu {
    /// The start values of a user's choice: those that it was made with, and over them the new ones.
    #[must_use]
    pub fn starts(&self) -> BTreeMap<String, String> {
        let mut start = self.base.as_ref().map(|base| base.start.clone()).unwrap_or_default();
        start.extend(self.added.start.clone());
        start
    }

    /// Its `resources/` but for the start values: those of the project, or of the FMU that is changed, and the user's over them.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn resources_in(&self, project: &Path) -> Result<Package, PackageError> {
        let mut package = Package::default();
        match &self.base {
            Some(base) => package = base.package.clone().split_off(RESOURCES),
            None => {
                for resource in self.resources {
                    let (from, to) = (project.join(resource.from), format!("{RESOURCES}{}", resource.to));
                    if from.is_dir() {
                        package.add_folder(&to, &from)?;
                    } else {
                        package.add_file(to, &from)?;
                    }
                }
            }
        }
        package.remove(&format!("{RESOURCES}{START_FILE}"));
        for (entry, file) in &self.added.files {
            let entry = format!("{RESOURCES}{entry}");
            package.remove(&entry);
            package.add_file(entry, file)?;
        }
        Ok(package)
    }

    /// True if its resources have this file, or it is one of a folder in them.
    pub(crate) fn has_resource(&self, name: &str) -> bool {
        match &self.base {
            Some(base) => base.package.contains(&format!("{RESOURCES}{name}")),
            None => self.resources.iter().any(|Resource { to, .. }| {
                name.strip_prefix(to).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
            }),
        }
    }

    /// The declaration with start values of a user's choice.
    ///
    /// # Errors
    /// No such parameter; a text that is no value of it.
    pub fn declared_with(&self, chosen: &BTreeMap<String, String>) -> Result<Declaration, StartError> {
        let mut declaration = self.declaration.clone();
        chosen.iter().try_for_each(|(name, text)| declaration.start_with(name, text))?;
        Ok(declaration)
    }

    /// Initialises the model in a folder that stands for its resources.
    ///
    /// # Errors
    /// The model's.
    pub fn initialise(&self, values: &mut Values, resources: &Path) -> Result<(), ModelError> {
        let name = self.declaration.name.to_owned();
        let context = Context { resources: Some(resources.to_owned()), instance_name: name };
        (self.initialize)(values, &context)
    }

    /// The start values of the FMU with these resources: those of a user's choice, and what the packed files give others. So what
    /// is declared is what the FMU drives with.
    ///
    /// # Errors
    /// A value that is none; resources with which the model cannot be initialised.
    pub fn start_values(&self, resources: &Package) -> Result<StartValues, FmuError> {
        let chosen = self.starts();
        let declaration = self.declared_with(&chosen)?;
        let mut values = Values::starting_from(&declaration.variables);
        let folder = unpacked(resources)?;
        self.initialise(&mut values, folder.path())
            .map_err(|source| FmuError::Unstartable { name: self.declaration.name, source })?;
        let variables = declaration.variables.iter().enumerate();
        let of_file = variables.filter_map(|(vr, variable)| {
            let value = values.get(vr).filter(|value| **value != variable.kind.start())?;
            let is_parameter = variable.causality == Causality::Parameter;
            is_parameter.then(|| (variable.name.to_string(), text_of(variable, value)))
        });
        Ok(StartValues { from_files: of_file.collect(), chosen })
    }

    /// The committed `modelDescription.xml` of a version, in the project.
    #[must_use]
    pub fn description_in(&self, standard: Standard) -> PathBuf {
        let file = Path::new(&self.description);
        let folder = file.parent().unwrap_or(Path::new("")).join(standard.folder());
        folder.join(file.file_name().unwrap_or_default())
    }
}

/// A package's resources as files.
pub(crate) fn unpacked(package: &Package) -> Result<TempDir, FmuError> {
    let folder = tempfile::tempdir().map_err(FmuError::Temporary)?;
    package.unpack(RESOURCES, folder.path())?;
    Ok(folder)
}

/// A value as a start file has it.
fn text_of(variable: &Variable, value: &Value) -> String {
    let item = match (&variable.kind, value) {
        (VariableKind::Enumeration { items, .. }, Value::Integer(value)) => {
            items.iter().find(|item| item.0 == *value)
        }
        _ => None,
    };
    item.map_or_else(|| value.to_string(), |item| item.1.to_owned())
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
