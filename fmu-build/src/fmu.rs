//! The steps from a model to an FMU, and the list of those that we ship.

use crate::added::Added;
use crate::cargo::{self, Builder, CargoError, Target};
use crate::description::{describe_for_in, describe_in};
use crate::documentation;
use crate::library::{self, Library, LibraryError};
use crate::linker;
use crate::package::{Package, PackageError};
use crate::shipped::ClosedLoop;
use crate::standard::Standard;
use crate::terminals;
use rfl_mpc::fmi::ModelError;
use rfl_mpc::fmi::{Declaration, START_FILE, StartError, read_start_file, start_file};
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
    package: Package,
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

fn temporary_folder() -> Result<TempDir, FmuError> {
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

/// Folder for FMUs, and what goes in beside what is built.
#[derive(Debug, Clone, Default)]
pub struct Packing {
    /// Folder for FMUs.
    pub out: PathBuf,
    /// A folder with libraries of other platforms: `PLATFORM/NAME.SUFFIX`.
    pub binaries: Option<PathBuf>,
    /// FMUs whose libraries of other platforms are taken over, where their name is the FMU's.
    pub merge: Vec<PathBuf>,
    /// The version of FMI.
    pub standard: Standard,
}

impl Packing {
    /// The same for another version of FMI, whose FMUs have a folder of their own.
    #[must_use]
    pub fn for_standard(&self, standard: Standard) -> Self {
        Self { out: self.out.join(standard.folder()), standard, ..self.clone() }
    }
}

/// Settings by which FMUs are made from source.
#[derive(Debug, Clone)]
pub struct Options {
    /// The project's folder.
    pub project: PathBuf,
    /// The builder of libraries.
    pub builder: Builder,
    /// Cargo's profile.
    pub profile: String,
    /// The platforms that libraries are built for; none: this machine.
    pub targets: Vec<Target>,
    /// Folder for the FMUs.
    pub packing: Packing,
}

impl Options {
    /// The platforms to build for; None is this machine.
    pub fn platforms(&self) -> impl Iterator<Item = Option<Target>> + use<'_> {
        let here = self.targets.is_empty().then_some(None);
        self.targets.iter().copied().map(Some).chain(here)
    }
}

/// FMUs that were made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// The FMU's file.
    pub path: PathBuf,
    /// Its size in bytes.
    pub size: usize,
    /// The libraries that were built, or came in the FMU that was changed.
    pub libraries: Vec<Library>,
    /// Libraries taken over, by path in the FMU.
    pub merged: Vec<String>,
}

impl Fmu {
    /// The start values that differ from the declaration's: those that it was made with, and over them the user's.
    #[must_use]
    pub fn starts(&self) -> BTreeMap<String, String> {
        let mut start = self.base.as_ref().map(|base| base.start.clone()).unwrap_or_default();
        start.extend(self.added.start.clone());
        start
    }

    /// Makes the FMU from source; `progress` is told each step.
    ///
    /// # Errors
    /// See [`FmuError`].
    pub fn make(&self, options: &Options, mut progress: impl FnMut(&str)) -> Result<Made, FmuError> {
        let (name, standard) = (self.declaration.name, options.packing.standard);
        let xml = describe_in(standard, &self.declaration);
        self.check_description(options, &xml)?;
        let (mut package, mut libraries) = (Package::default(), Vec::new());
        for target in options.platforms().filter(|target| target.is_none_or(|target| target.is_in(standard)))
        {
            let what = target.map(|target| format!(" for {}", target.name())).unwrap_or_default();
            progress(&format!("building the library{what}"));
            let path = options.builder.build(&options.project, &options.profile, &self.selection, target)?;
            let path = linker::linked_for(&path, standard);
            progress("checking symbols and needs");
            let library = Library::check_for(&path, standard)?;
            check_mark(&path, standard, &xml)?;
            for folder in library.folders(standard) {
                package.add_file(entry_of(&folder, name), &path)?;
            }
            libraries.push(library);
        }

        progress("packing");
        for resource in self.resources {
            let (from, to) = (options.project.join(resource.from), format!("resources/{}", resource.to));
            if from.is_dir() {
                package.add_folder(&to, &from)?;
            } else {
                package.add_file(to, &from)?;
            }
        }
        let linked = cargo::dependencies(&options.project, self.package, &options.targets)?;
        documentation::license(&mut package, &options.project.join("LICENSE"), &linked)?;
        self.pack(package, libraries, &xml, &options.packing)
    }

    /// Makes the FMU anew out of the one that it is based on: other resources and start values, the same libraries.
    ///
    /// # Errors
    /// See [`FmuError`].
    pub fn change(&self, base: &Base, packing: &Packing) -> Result<Made, FmuError> {
        let mut package = base.package.clone();
        let start = format!("resources/{START_FILE}");
        for made_anew in ["modelDescription.xml", documentation::INDEX, &start, terminals::FILE] {
            package.remove(made_anew);
        }
        for entry in self.added.files.keys() {
            package.remove(&format!("resources/{entry}"));
        }
        let libraries = package
            .names("binaries/")
            .filter_map(|name| Library::check_bytes(Path::new(name), package.get(name)?, base.standard).ok());
        let libraries = libraries.collect();
        self.pack(package, libraries, &describe_in(base.standard, &self.declaration), packing)
    }

    /// Adds what the user gives, the descriptions, and libraries that were built elsewhere; writes the FMU.
    fn pack(
        &self,
        mut package: Package,
        libraries: Vec<Library>,
        xml: &str,
        packing: &Packing,
    ) -> Result<Made, FmuError> {
        for (entry, file) in &self.added.files {
            package.add_file(format!("resources/{entry}"), file)?;
        }
        let mut declaration = self.declaration.clone();
        let start = self.starts();
        if !start.is_empty() {
            start.iter().try_for_each(|(name, value)| declaration.start_with(name, value))?;
            package.add(format!("resources/{START_FILE}"), start_file(&start))?;
        }
        let standard = packing.standard;
        package.add("modelDescription.xml", describe_for_in(standard, &self.declaration, &declaration))?;
        package.add(terminals::FILE, terminals::terminals(&declaration))?;
        for (name, content) in terminals::icons(standard) {
            package.remove(name);
            package.add(*name, *content)?;
        }
        let merged = self.merge(packing, &mut package, xml)?;
        let page = documentation::index(standard, &declaration, &libraries_of(&package, standard));
        package.add(documentation::INDEX, page)?;
        if self.base.is_some() {
            self.try_resources(&package, &start)?;
        }
        let out = packing.out.join(format!("{}.fmu", self.declaration.name));
        let size = package.write(&out)?;
        Ok(Made { path: out, size, libraries, merged })
    }

    /// Starts the controller with all that is in a changed FMU: a model packed earlier may be of another vehicle than
    /// the one that is packed now.
    fn try_resources(&self, package: &Package, start: &BTreeMap<String, String>) -> Result<(), FmuError> {
        let system = ClosedLoop::of(self.vehicle);
        if self.declaration.name != system.controller {
            return Ok(());
        }
        let folder = temporary_folder()?;
        package.unpack("resources/", folder.path())?;
        let surroundings = Surroundings { folder: folder.path(), path: DEFAULT_PATH };
        system
            .try_controller(surroundings, start)
            .map_err(|source| FmuError::Controller { name: self.declaration.name, source })
    }

    /// The committed `modelDescription.xml` of a version, in the project.
    #[must_use]
    pub fn description_in(&self, standard: Standard) -> PathBuf {
        let file = Path::new(&self.description);
        let folder = file.parent().unwrap_or(Path::new("")).join(standard.folder());
        folder.join(file.file_name().unwrap_or_default())
    }

    /// The library has the committed description inside: it must be today's.
    fn check_description(&self, options: &Options, xml: &str) -> Result<(), FmuError> {
        let path = options.project.join(self.description_in(options.packing.standard));
        let committed = std::fs::read_to_string(&path);
        let committed = committed.map_err(|source| FmuError::Read { path: path.clone(), source })?;
        if committed == xml {
            Ok(())
        } else {
            Err(FmuError::Description { name: self.declaration.name, path })
        }
    }

    /// Takes over libraries of other platforms.
    fn merge(&self, packing: &Packing, package: &mut Package, xml: &str) -> Result<Vec<String>, FmuError> {
        let (name, standard) = (self.declaration.name, packing.standard);
        let mut merged = Vec::new();
        if let Some(folder) = &packing.binaries {
            for platform in standard.platforms() {
                let entry = entry_of(platform, name);
                let path = folder.join(platform).join(format!("{name}.{}", library::suffix(platform)));
                if !path.is_file() || package.contains(&entry) {
                    continue;
                }
                let found = Library::check_for(&path, standard)?;
                if !found.folders(standard).iter().any(|folder| folder == platform) {
                    return Err(FmuError::Platform {
                        path,
                        found: found.platform,
                        folder: (*platform).to_owned(),
                    });
                }
                check_mark(&path, standard, xml)?;
                package.add_file(entry.clone(), &path)?;
                merged.push(entry);
            }
        }
        for fmu in &packing.merge {
            if fmu.file_stem().is_some_and(|stem| stem == name) && is_of(fmu, standard)? {
                merged.extend(package.merge_binaries(fmu, standard.mark_of(xml).as_bytes())?);
            }
        }
        Ok(merged)
    }
}

/// True if an FMU is of this version of FMI. One that says of none is taken for what is wanted: what is wrong with it is said
/// when it is merged.
fn is_of(fmu: &Path, standard: Standard) -> Result<bool, PackageError> {
    let xml = Package::read_entry(fmu, "modelDescription.xml")?.unwrap_or_default();
    let xml = String::from_utf8_lossy(&xml).into_owned();
    Ok(Standard::of(&xml).is_none_or(|found| found == standard))
}

fn entry_of(platform: &str, name: &str) -> String {
    format!("binaries/{platform}/{name}.{}", library::suffix(platform))
}

/// The platforms of a package with what their libraries need, for its page.
fn libraries_of(package: &Package, standard: Standard) -> Vec<(&str, String)> {
    let libraries = package.names("binaries/").filter_map(|name| {
        let platform = name.split('/').nth(1)?;
        let library = Library::check_bytes(Path::new(name), package.get(name)?, standard);
        let needs = library.map_or("cannot be told here".to_owned(), |library| library.requirements());
        Some((platform, needs))
    });
    libraries.collect()
}

/// A library must know the description's GUID or token: it refuses a host that gives another.
fn check_mark(path: &Path, standard: Standard, xml: &str) -> Result<(), FmuError> {
    let bytes = std::fs::read(path).map_err(|source| FmuError::Read { path: path.to_owned(), source })?;
    let mark = standard.mark_of(xml);
    if crate::package::contains(&bytes, mark.as_bytes()) {
        return Ok(());
    }
    Err(FmuError::Guid { path: path.to_owned(), guid: mark.to_owned() })
}
