//! An FMU is a zip archive: description, libraries, resources, documentation (FMI 2.0, section 2.3).
//!
//! The same content gives the same bytes: entries are sorted and carry the earliest date that a zip can.

use rfl_mpc::input;
use rfl_mpc::output::write_bytes;
use std::collections::BTreeMap;
use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

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
    #[error(
        "{path} holds more than {ENTRIES} files or {} MB unpacked, or the file name `{name}`, which no FMU has. Do not \
         use this FMU",
        UNPACKED >> 20
    )]
    NoFmu { path: PathBuf, name: String },
    #[error(
        "{name} in {path} is no library of this FMU: a file of at most {} MB is, with the FMU's own name in a platform's folder, \
         such as binaries/win64/RflMpc.dll. Do not use this FMU",
        LIBRARY >> 20
    )]
    NoLibrary { path: PathBuf, name: String },
    #[error("{path} holds no library to merge: give an FMU that was built on another platform")]
    NothingToMerge { path: PathBuf },
    #[error("{0} stands in the package twice: take it out of one of the places it comes from")]
    Twice(String),
}

/// The content of an archive, by path inside it.
#[derive(Debug, Default, Clone)]
pub struct Package {
    entries: BTreeMap<String, Vec<u8>>,
}

impl Package {
    /// Adds an entry.
    ///
    /// # Errors
    /// If there is one of this name.
    pub fn add(&mut self, name: impl Into<String>, content: impl Into<Vec<u8>>) -> Result<(), PackageError> {
        let name = name.into();
        if self.entries.contains_key(&name) {
            return Err(PackageError::Twice(name));
        }
        self.entries.insert(name, content.into());
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
        let read = |source| PackageError::Read { path: file.to_owned(), source };
        let archive = |source| PackageError::Archive { path: file.to_owned(), source };
        let bytes = input::read(file, FMU).map_err(read)?;
        let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).map_err(archive)?;
        let no_fmu = |name: &str| PackageError::NoFmu { path: file.to_owned(), name: name.to_owned() };
        if zip.len() > ENTRIES {
            return Err(no_fmu(""));
        }
        let (mut package, mut left) = (Self::default(), UNPACKED);
        for i in 0..zip.len() {
            let mut entry = zip.by_index(i).map_err(archive)?;
            let name = entry.name().map_err(archive)?.into_owned();
            if entry.is_dir() {
                continue;
            }
            let mut content = Vec::new();
            // What it says of its size need not be true.
            (&mut entry).take(left + 1).read_to_end(&mut content).map_err(read)?;
            let size = content.len() as u64;
            if !entry.is_file() || !stays_below(&name) || size > left {
                return Err(no_fmu(&name));
            }
            left -= size;
            package.add(name, content)?;
        }
        Ok(package)
    }

    /// One entry of an archive on disk, of which nothing else is looked at.
    ///
    /// # Errors
    /// A file that is no archive.
    pub fn read_entry(file: &Path, name: &str) -> Result<Option<Vec<u8>>, PackageError> {
        let read = |source| PackageError::Read { path: file.to_owned(), source };
        let archive = |source| PackageError::Archive { path: file.to_owned(), source };
        let bytes = input::read(file, FMU).map_err(read)?;
        let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).map_err(archive)?;
        let Ok(entry) = zip.by_name(name) else { return Ok(None) };
        let mut content = Vec::new();
        entry.take(LIBRARY).read_to_end(&mut content).map_err(read)?;
        Ok(Some(content))
    }

    /// An entry's content.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&[u8]> {
        self.entries.get(name).map(Vec::as_slice)
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
        other.entries.into_iter().try_for_each(|(name, content)| self.add(name, content))
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
            made.and_then(|()| std::fs::write(&path, content))
                .map_err(|source| PackageError::Write { path, source })?;
        }
        Ok(())
    }

    /// Takes over, from another FMU, libraries of platforms that this one lacks: those of `wanted`, by their places. Each
    /// must hold `guid`, or it was built for another description. Gives the places of what was taken.
    ///
    /// # Errors
    /// If the FMU cannot be read, or holds none of `wanted`, another file in their place, or a library of another description.
    pub fn merge_binaries(
        &mut self,
        fmu: &Path,
        wanted: &[String],
        guid: &[u8],
    ) -> Result<Vec<String>, PackageError> {
        let read = |source| PackageError::Read { path: fmu.to_owned(), source };
        let archive = |source| PackageError::Archive { path: fmu.to_owned(), source };
        let bytes = input::read(fmu, FMU).map_err(read)?;
        let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).map_err(archive)?;
        let (mut merged, mut known) = (Vec::new(), false);
        for i in 0..zip.len() {
            let mut file = zip.by_index(i).map_err(archive)?;
            let name = file.name().map_err(archive)?.into_owned();
            // However it is written.
            let is_binary = name.trim_start_matches(['/', '\\']).to_lowercase().starts_with("binaries");
            if file.is_dir() || !is_binary {
                continue;
            }
            let no_library = || PackageError::NoLibrary { path: fmu.to_owned(), name: name.clone() };
            // A link, say, or a library that ours needs: none does.
            if !file.is_file() || !wanted.contains(&name) {
                return Err(no_library());
            }
            known = true;
            if self.contains(&name) {
                continue;
            }
            let mut content = Vec::new();
            // What it says of its size need not be true.
            (&mut file).take(LIBRARY + 1).read_to_end(&mut content).map_err(read)?;
            if content.len() as u64 > LIBRARY {
                return Err(no_library());
            }
            if !contains(&content, guid) {
                return Err(PackageError::OtherDescription { path: fmu.to_owned(), name });
            }
            self.add(name.clone(), content)?;
            merged.push(name);
        }
        if known { Ok(merged) } else { Err(PackageError::NothingToMerge { path: fmu.to_owned() }) }
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

/// Largest FMU that is read, largest library in it, and all that it unpacks to, in bytes.
const FMU: u64 = 256 << 20;
const LIBRARY: u64 = 64 << 20;
const UNPACKED: u64 = 1 << 30;
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
