//! An FMU is a zip archive: description, libraries, resources, documentation (FMI 2.0, section 2.3).
//!
//! The same content gives the same bytes: entries are sorted and carry the earliest date that a zip can.

use rfl_mpc::input;
use rfl_mpc::output::write_bytes;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

/// Reason for which an archive could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum PackageError {
    #[error("cannot read {path}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("cannot write {path}: {source}")]
    Write { path: PathBuf, source: std::io::Error },
    #[error("cannot pack {entry}: {source}")]
    Zip { entry: String, source: zip::result::ZipError },
    #[error("cannot read the FMU {path}: {source}. Is it a zip archive?")]
    Archive { path: PathBuf, source: zip::result::ZipError },
    #[error("{name} in {path} was built for another description: its GUID is not this FMU's. Build it anew.")]
    OtherDescription { path: PathBuf, name: String },
    #[error("{path} {found}, as no FMU of this program. Do not use this FMU")]
    NoFmu { path: PathBuf, found: NoFmu },
    #[error(
        "{name} in {path} is no library of this FMU: a file of at most {} MB is, with the FMU's own name in a platform's folder, \
         such as binaries/win64/RflMpc.dll. Do not use this FMU",
        ENTRY >> 20
    )]
    NoLibrary { path: PathBuf, name: String },
    #[error("{path} holds no library, which a host needs: give an FMU with one in binaries/, as it was made")]
    NoLibraries { path: PathBuf },
    #[error("{0} stands in the package twice: take it out of one of the places it comes from")]
    Twice(String),
}

/// What an archive has that no FMU of ours has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum NoFmu {
    #[error("holds {0} files, more than {ENTRIES}")]
    Files(usize),
    #[error("holds `{name}`, which is larger than {} MB unpacked", ENTRY >> 20)]
    Large { name: String },
    #[error("is larger than {} MB unpacked", UNPACKED >> 20)]
    Unpacked,
    #[error("holds the file name `{0}`, which leads out of a folder or is none on some system")]
    Name(String),
    #[error("holds `{0}`, which is a link or a device, and no file")]
    Kind(String),
}

/// The content of an archive, by path inside it. Copies share the contents.
#[derive(Debug, Default, Clone)]
pub struct Package {
    entries: BTreeMap<String, Arc<Vec<u8>>>,
}

impl Package {
    /// Adds an entry.
    ///
    /// # Errors
    /// If there is one of this name.
    pub fn add(&mut self, name: impl Into<String>, content: impl Into<Vec<u8>>) -> Result<(), PackageError> {
        self.insert(name.into(), Arc::new(content.into()))
    }

    fn insert(&mut self, name: String, content: Arc<Vec<u8>>) -> Result<(), PackageError> {
        if self.entries.contains_key(&name) {
            return Err(PackageError::Twice(name));
        }
        self.entries.insert(name, content);
        Ok(())
    }

    /// Adds a file.
    ///
    /// # Errors
    /// If it cannot be read, or there is an entry of this name.
    pub fn add_file(&mut self, name: impl Into<String>, path: &Path) -> Result<(), PackageError> {
        let content =
            std::fs::read(path).map_err(|source| PackageError::Read { path: path.to_owned(), source })?;
        self.add(name, content)
    }

    /// Adds a folder with all it holds.
    ///
    /// # Errors
    /// As [`add_file`](Self::add_file).
    pub fn add_folder(&mut self, name: &str, folder: &Path) -> Result<(), PackageError> {
        let read = |source| PackageError::Read { path: folder.to_owned(), source };
        for entry in std::fs::read_dir(folder).map_err(read)? {
            let path = entry.map_err(read)?.path();
            let Some(file) = path.file_name().and_then(|file| file.to_str()) else { continue };
            let name = format!("{name}/{file}");
            if path.is_dir() {
                self.add_folder(&name, &path)?;
            } else {
                self.add_file(name, &path)?;
            }
        }
        Ok(())
    }

    /// Names of the entries below a folder.
    pub fn names<'a>(&'a self, folder: &'a str) -> impl Iterator<Item = &'a str> {
        self.entries.keys().map(String::as_str).filter(move |name| name.starts_with(folder))
    }

    /// True if there is an entry of this name.
    #[must_use]
    pub fn contains(&self, name: &str) -> bool {
        self.entries.contains_key(name)
    }

    /// An archive as it lies on disk.
    ///
    /// # Errors
    /// A file that is no archive, or one that no FMU is: too large, or with names that climb out of its folder.
    pub fn read(file: &Path) -> Result<Self, PackageError> {
        let mut zip = open(file)?;
        let no_fmu = |found| PackageError::NoFmu { path: file.to_owned(), found };
        if zip.len() > ENTRIES {
            return Err(no_fmu(NoFmu::Files(zip.len())));
        }
        let (mut package, mut left) = (Self::default(), UNPACKED);
        for i in 0..zip.len() {
            let mut entry = zip.by_index(i).map_err(|source| archive(file, source))?;
            let name = entry.name().map_err(|source| archive(file, source))?.into_owned();
            if entry.is_dir() {
                continue;
            }
            if !stays_below(&name) {
                return Err(no_fmu(NoFmu::Name(name)));
            }
            if !entry.is_file() {
                return Err(no_fmu(NoFmu::Kind(name)));
            }
            let Some(content) = content(file, &mut entry, left.min(ENTRY))? else {
                return Err(no_fmu(if left < ENTRY { NoFmu::Unpacked } else { NoFmu::Large { name } }));
            };
            left -= content.len() as u64;
            package.add(name, content)?;
        }
        Ok(package)
    }

    /// One entry of an archive on disk, of which nothing else is looked at.
    ///
    /// # Errors
    /// A file that is no archive, an entry that is too large.
    pub fn read_entry(file: &Path, name: &str) -> Result<Option<Vec<u8>>, PackageError> {
        let mut zip = open(file)?;
        let Ok(mut entry) = zip.by_name(name) else { return Ok(None) };
        let large =
            || PackageError::NoFmu { path: file.to_owned(), found: NoFmu::Large { name: name.to_owned() } };
        content(file, &mut entry, ENTRY)?.ok_or_else(large).map(Some)
    }

    /// An entry's content.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&[u8]> {
        self.entries.get(name).map(|content| content.as_slice())
    }

    /// Takes an entry out.
    pub fn remove(&mut self, name: &str) {
        self.entries.remove(name);
    }

    /// Takes out what is below a folder (which ends in `/`), as a package of its own.
    #[must_use]
    pub fn split_off(&mut self, folder: &str) -> Self {
        let all = std::mem::take(&mut self.entries).into_iter();
        let (below, others) = all.partition(|(name, _)| name.starts_with(folder));
        self.entries = others;
        Self { entries: below }
    }

    /// Adds all entries of another one.
    ///
    /// # Errors
    /// If there is one of the same name.
    pub fn extend(&mut self, other: Self) -> Result<(), PackageError> {
        other.entries.into_iter().try_for_each(|(name, content)| self.insert(name, content))
    }

    /// Writes the entries below `folder` (which ends in `/`) as files into another folder.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn unpack(&self, folder: &str, into: &Path) -> Result<(), PackageError> {
        for (name, content) in &self.entries {
            let Some(rest) = name.strip_prefix(folder) else { continue };
            let path = into.join(rest);
            let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
            made.and_then(|()| std::fs::write(&path, content.as_slice()))
                .map_err(|source| PackageError::Write { path, source })?;
        }
        Ok(())
    }

    /// The libraries of an FMU on disk, by their places, which must be among `places`. Each must hold `guid`, or it was built for
    /// another description.
    ///
    /// # Errors
    /// If the FMU cannot be read, or holds none, another file in their place, or a library of another description.
    pub fn libraries(fmu: &Path, places: &[String], guid: &[u8]) -> Result<Self, PackageError> {
        let (mut zip, mut libraries) = (open(fmu)?, Self::default());
        for i in 0..zip.len() {
            let mut entry = zip.by_index(i).map_err(|source| archive(fmu, source))?;
            let name = entry.name().map_err(|source| archive(fmu, source))?.into_owned();
            // However it is written.
            let is_binary = name.trim_start_matches(['/', '\\']).to_lowercase().starts_with("binaries");
            if entry.is_dir() || !is_binary {
                continue;
            }
            let no_library = || PackageError::NoLibrary { path: fmu.to_owned(), name: name.clone() };
            // A link, say, or a library that ours needs: none does.
            if !entry.is_file() || !places.contains(&name) {
                return Err(no_library());
            }
            let content = content(fmu, &mut entry, ENTRY)?.ok_or_else(no_library)?;
            if !contains(&content, guid) {
                return Err(PackageError::OtherDescription { path: fmu.to_owned(), name });
            }
            libraries.add(name, content)?;
        }
        if libraries.entries.is_empty() {
            return Err(PackageError::NoLibraries { path: fmu.to_owned() });
        }
        Ok(libraries)
    }

    /// Takes over, from another FMU, [`libraries`](Self::libraries) of platforms that this one lacks. Gives their places.
    ///
    /// # Errors
    /// As [`libraries`](Self::libraries).
    pub fn merge_binaries(
        &mut self,
        fmu: &Path,
        places: &[String],
        guid: &[u8],
    ) -> Result<Vec<String>, PackageError> {
        let mut merged = Vec::new();
        for (name, content) in Self::libraries(fmu, places, guid)?.entries {
            if !self.contains(&name) {
                merged.push(name.clone());
                self.insert(name, content)?;
            }
        }
        Ok(merged)
    }

    /// The archive's bytes.
    ///
    /// # Errors
    /// If an entry's name or size is more than a zip can hold.
    pub fn to_bytes(&self) -> Result<Vec<u8>, PackageError> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .unix_permissions(0o644);
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, content) in &self.entries {
            let zip = |source| PackageError::Zip { entry: name.clone(), source };
            // Hosts load libraries from the unpacked archive: they stay executable.
            let mode = if name.starts_with("binaries/") { 0o755 } else { 0o644 };
            writer.start_file(name.as_str(), options.unix_permissions(mode)).map_err(zip)?;
            writer.write_all(content).map_err(|source| zip(source.into()))?;
        }
        let finished = writer.finish();
        let finished =
            finished.map_err(|source| PackageError::Zip { entry: "the directory".to_owned(), source })?;
        Ok(finished.into_inner())
    }

    /// Writes the archive; gives its size in bytes. A host never sees half a file: it is moved into place.
    ///
    /// # Errors
    /// As [`to_bytes`](Self::to_bytes), or if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<usize, PackageError> {
        let bytes = self.to_bytes()?;
        write_bytes(path, &bytes).map_err(|source| PackageError::Write { path: path.to_owned(), source })?;
        Ok(bytes.len())
    }
}

/// Opens an archive. Its entries are read one by one: what they unpack to is bounded, and held once.
fn open(file: &Path) -> Result<ZipArchive<BufReader<File>>, PackageError> {
    let read = |source| PackageError::Read { path: file.to_owned(), source };
    let opened = BufReader::new(input::open(file, FMU).map_err(read)?);
    ZipArchive::new(opened).map_err(|source| archive(file, source))
}

fn archive(file: &Path, source: zip::result::ZipError) -> PackageError {
    PackageError::Archive { path: file.to_owned(), source }
}

/// Content of an entry; none if it is larger than `limit`, whatever it says of its size.
fn content(file: &Path, entry: &mut impl Read, limit: u64) -> Result<Option<Vec<u8>>, PackageError> {
    let mut content = Vec::new();
    let read = |source| PackageError::Read { path: file.to_owned(), source };
    entry.take(limit + 1).read_to_end(&mut content).map_err(read)?;
    Ok(Some(content).filter(|content| content.len() as u64 <= limit))
}

/// Largest FMU that is read, largest file in it (a library, a learned model), and all that it unpacks to, in bytes.
const FMU: u64 = 256 << 20;
const ENTRY: u64 = input::MODEL;
const UNPACKED: u64 = 256 << 20;
/// Most files in an FMU.
const ENTRIES: usize = 10_000;

/// True if a name in an archive names a file below the folder where it is unpacked, on any system.
fn stays_below(name: &str) -> bool {
    let plain = |part: &str| !part.is_empty() && part != "." && part != "..";
    !name.contains(['\\', ':', '\0']) && name.split('/').all(plain)
}

/// True if bytes hold others.
#[must_use]
pub fn contains(bytes: &[u8], wanted: &[u8]) -> bool {
    wanted.is_empty() || bytes.windows(wanted.len()).any(|window| window == wanted)
}
