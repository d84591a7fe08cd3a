//! The steps from a model to an FMU, and the list of those that we ship.

use crate::added::Added;
use crate::cargo::{self, Builder, CargoError};
use crate::description::{describe, describe_for};
use crate::documentation;
use crate::library::{self, Library, LibraryError};
use crate::package::{Package, PackageError};
use rfl_mpc::fmi::abi::guid_of;
use rfl_mpc::fmi::{Declaration, START_FILE, StartError, start_file};
use rfl_mpc::vehicle::VehicleKind;
use std::path::{Path, PathBuf};

/// Why an FMU could not be made.
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
    /// What it is; its name is the FMU's.
    pub declaration: Declaration,
    /// The vehicles that it is for.
    pub vehicle: VehicleKind,
    /// The committed `modelDescription.xml`, in the project.
    pub description: String,
    /// The package whose dependencies are linked in.
    pub package: &'static str,
    /// Arguments of `cargo build` that choose its library.
    pub selection: Vec<&'static str>,
    /// What goes into `resources/`.
    pub resources: &'static [Resource],
    /// What a user adds.
    pub added: Added,
}

/// How FMUs are made.
#[derive(Debug, Clone)]
pub struct Options {
    /// The project's folder.
    pub project: PathBuf,
    /// Where FMUs are written.
    pub out: PathBuf,
    /// The builder of this machine's library.
    pub builder: Builder,
    /// Cargo's profile.
    pub profile: String,
    /// A folder with libraries of other platforms: `PLATFORM/NAME.SUFFIX`.
    pub binaries: Option<PathBuf>,
    /// FMUs whose libraries of other platforms are taken over, where their name is the FMU's.
    pub merge: Vec<PathBuf>,
}

/// What was made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// The FMU's file.
    pub path: PathBuf,
    /// Its size in bytes.
    pub size: usize,
    /// The library built here.
    pub library: Library,
    /// Libraries taken over, by path in the FMU.
    pub merged: Vec<String>,
}

impl Fmu {
    /// Makes the FMU; `progress` is told each step.
    ///
    /// # Errors
    /// See [`FmuError`].
    pub fn make(&self, options: &Options, mut progress: impl FnMut(&str)) -> Result<Made, FmuError> {
        let name = self.declaration.name;
        let xml = describe(&self.declaration);
        self.check_description(options, &xml)?;
        progress("building the library");
        let path = options.builder.build(&options.project, &options.profile, &self.selection)?;
        progress("checking symbols and needs");
        let library = Library::check(&path)?;
        check_guid(&path, &xml)?;

        progress("packing");
        let mut package = Package::default();
        let entry = |platform: &str| format!("binaries/{platform}/{name}.{}", library::suffix(platform));
        package.add_file(entry(library.platform), &path)?;
        for resource in self.resources {
            let (from, to) = (options.project.join(resource.from), format!("resources/{}", resource.to));
            if from.is_dir() {
                package.add_folder(&to, &from)?;
            } else {
                package.add_file(to, &from)?;
            }
        }
        let linked = cargo::dependencies(&options.project, self.package)?;
        let license = options.project.join("LICENSE");
        let mut declaration = self.declaration.clone();
        for (entry, file) in &self.added.files {
            package.add_file(format!("resources/{entry}"), file)?;
        }
        if !self.added.start.is_empty() {
            self.added.start.iter().try_for_each(|(name, value)| declaration.start_with(name, value))?;
            package.add(format!("resources/{START_FILE}"), start_file(&self.added.start))?;
        }
        documentation::document(&mut package, &declaration, &library.requirements(), &license, &linked)?;
        package.add("modelDescription.xml", describe_for(&self.declaration, &declaration))?;
        let merged = self.merge(options, &mut package, &xml)?;

        let out = options.out.join(format!("{name}.fmu"));
        let size = package.write(&out)?;
        Ok(Made { path: out, size, library, merged })
    }

    /// The library has the committed description inside: it must be today's.
    fn check_description(&self, options: &Options, xml: &str) -> Result<(), FmuError> {
        let path = options.project.join(&self.description);
        let committed = std::fs::read_to_string(&path);
        let committed = committed.map_err(|source| FmuError::Read { path: path.clone(), source })?;
        if committed == xml {
            Ok(())
        } else {
            Err(FmuError::Description { name: self.declaration.name, path })
        }
    }

    /// Takes over libraries of other platforms.
    fn merge(&self, options: &Options, package: &mut Package, xml: &str) -> Result<Vec<String>, FmuError> {
        let name = self.declaration.name;
        let mut merged = Vec::new();
        if let Some(folder) = &options.binaries {
            for platform in ["darwin64", "linux32", "linux64", "win32", "win64"] {
                let file = format!("{name}.{}", library::suffix(platform));
                let (path, entry) =
                    (folder.join(platform).join(&file), format!("binaries/{platform}/{file}"));
                if !path.is_file() || package.contains(&entry) {
                    continue;
                }
                let found = Library::check(&path)?.platform;
                if found != platform {
                    return Err(FmuError::Platform { path, found, folder: platform.to_owned() });
                }
                check_guid(&path, xml)?;
                package.add_file(entry.clone(), &path)?;
                merged.push(entry);
            }
        }
        for fmu in &options.merge {
            if fmu.file_stem().is_some_and(|stem| stem == name) {
                merged.extend(package.merge_binaries(fmu, guid(xml).as_bytes())?);
            }
        }
        Ok(merged)
    }
}

fn guid(xml: &str) -> &str {
    guid_of(xml).unwrap_or_default()
}

/// A library must know the description's GUID: it refuses a host that gives another.
fn check_guid(path: &Path, xml: &str) -> Result<(), FmuError> {
    let bytes = std::fs::read(path).map_err(|source| FmuError::Read { path: path.to_owned(), source })?;
    let guid = guid(xml);
    if crate::package::contains(&bytes, guid.as_bytes()) {
        return Ok(());
    }
    Err(FmuError::Guid { path: path.to_owned(), guid: guid.to_owned() })
}
