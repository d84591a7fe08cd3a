//! The steps from a model to an FMU's file.

use crate::cargo::{self, Builder, Target};
use crate::description::{describe_for_in, describe_in};
use crate::documentation;
use crate::fmu::{Base, Fmu, FmuError, RESOURCES};
use crate::library::{self, Library};
use crate::linker;
use crate::package::{Package, PackageError};
use crate::standard::Standard;
use crate::terminals;
use crate::traceability;
use rfl_mpc::fmi::START_FILE;
use std::path::{Path, PathBuf};

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
        package.extend(self.resources_in(&options.project)?)?;
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
        for made_anew in ["modelDescription.xml", documentation::INDEX, terminals::FILE, traceability::FILE] {
            package.remove(made_anew);
        }
        drop(package.split_off(RESOURCES));
        package.extend(self.resources_in(Path::new(""))?)?;
        let libraries = package
            .names("binaries/")
            .filter_map(|name| Library::check_bytes(Path::new(name), package.get(name)?, base.standard).ok());
        let libraries = libraries.collect();
        self.pack(package, libraries, &describe_in(base.standard, &self.declaration), packing)
    }

    /// Adds start values, the descriptions, and libraries that were built elsewhere; writes the FMU.
    fn pack(
        &self,
        mut package: Package,
        libraries: Vec<Library>,
        xml: &str,
        packing: &Packing,
    ) -> Result<Made, FmuError> {
        let mut declaration = self.declaration.clone();
        let start = self.start_values(&package)?;
        if !start.is_empty() {
            declaration.start_from(&start)?;
            package.add(format!("{RESOURCES}{START_FILE}"), start.to_text())?;
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
        traceability::add_to_fmu(&mut package, standard, &declaration, standard.mark_of(xml))?;
        let out = packing.out.join(format!("{}.fmu", self.declaration.name));
        let size = package.write(&out)?;
        Ok(Made { path: out, size, libraries, merged })
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
                check_mark(&path, standard, xml)?;
                package.add_file(entry.clone(), &path)?;
                check_place(package, folder, &entry, standard)?;
                merged.push(entry);
            }
        }
        for fmu in &packing.merge {
            let is_ours = fmu.file_stem().is_some_and(|stem| stem == name);
            // One that says of no version is taken for what is wanted: what is wrong with it is said when it is merged.
            if is_ours && standard_of(fmu)?.is_none_or(|found| found == standard) {
                let places = library_places(standard, name);
                let names = package.merge_binaries(fmu, &places, standard.mark_of(xml).as_bytes())?;
                for entry in &names {
                    check_place(package, fmu, entry, standard)?;
                }
                merged.extend(names);
            }
        }
        Ok(merged)
    }
}

/// The version of FMI that an FMU's file is of, if its description says so.
///
/// # Errors
/// A file that is no archive.
pub fn standard_of(fmu: &Path) -> Result<Option<Standard>, PackageError> {
    let xml = Package::read_entry(fmu, "modelDescription.xml")?.unwrap_or_default();
    Ok(Standard::of(&String::from_utf8_lossy(&xml)))
}

/// Checks that a library exports what it must, and is for the platform in whose folder it lies.
pub(crate) fn check_place(
    package: &Package,
    fmu: &Path,
    entry: &str,
    standard: Standard,
) -> Result<(), FmuError> {
    let path = fmu.join(entry);
    let found = Library::check_bytes(&path, package.get(entry).unwrap_or_default(), standard)?;
    let folder = entry.split('/').nth(1).unwrap_or_default().to_owned();
    if found.folders(standard).contains(&folder) {
        Ok(())
    } else {
        Err(FmuError::Platform { path, found: found.platform, folder })
    }
}

/// Where an FMU's libraries may lie in it.
pub(crate) fn library_places(standard: Standard, name: &str) -> Vec<String> {
    standard.platforms().iter().map(|platform| entry_of(platform, name)).collect()
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
