//! Exports and needs of a shared library: an FMU library exports the functions of its version of FMI and nothing else, and
//! needs nothing that a host may lack.

pub use crate::standard::FMI2_FUNCTIONS;
use crate::standard::Standard;
use object::Object;
use object::read::NameOrOrdinal;
use object::read::elf::{ElfFile64, FileHeader};
use object::read::macho::{FatArch, MachOFatFile32};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Reason for which a library cannot go into an FMU.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LibraryError {
    #[error("cannot read the library {path}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path} is no shared library that can be read: {source}")]
    Format { path: PathBuf, source: object::Error },
    #[error(
        "{path} does not export {missing}. An FMU library is made by rfl_mpc::export_fmi2! and export_fmi3!."
    )]
    Missing { path: PathBuf, missing: String },
    #[error(
        "{path} is a universal library whose parts for the processors export different functions, or have none. Build it anew."
    )]
    Parts { path: PathBuf },
    #[error(
        "{path} exports more than FMI's functions: {surplus}. Such symbols can clash with those of a host."
    )]
    Surplus { path: PathBuf, surplus: String },
}

/// Findings in a library.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Library {
    /// FMI 2.0's name of the platform, e.g. `linux64`; Linux on ARM has one in 3.0 only.
    pub platform: &'static str,
    /// The operating system that it is for, in FMI's word.
    pub system: &'static str,
    /// The processors that it is for, e.g. `x86_64`; several of a universal library for macOS.
    pub processors: Vec<String>,
    /// Exported symbols, sorted.
    pub exports: BTreeSet<String>,
    /// Libraries that the loader must find.
    pub needs: Vec<String>,
    /// The newest glibc version that a symbol asks for (ELF only).
    pub glibc: Option<(u32, u32)>,
}

impl Library {
    /// As [`check_for`](Self::check_for), for FMI 2.0.
    ///
    /// # Errors
    /// As [`check_for`](Self::check_for).
    pub fn check(path: &Path) -> Result<Self, LibraryError> {
        Self::check_for(path, Standard::Fmi2)
    }

    /// Reads a library and checks that it exports a version's functions and nothing else.
    ///
    /// # Errors
    /// If it cannot be read, or exports less or more.
    pub fn check_for(path: &Path, standard: Standard) -> Result<Self, LibraryError> {
        let bytes =
            std::fs::read(path).map_err(|source| LibraryError::Read { path: path.to_owned(), source })?;
        Self::check_bytes(path, &bytes, standard)
    }

    /// As [`check_for`](Self::check_for), for the content of a file; `path` is for messages.
    ///
    /// # Errors
    /// As [`check_for`](Self::check_for).
    pub fn check_bytes(path: &Path, bytes: &[u8], standard: Standard) -> Result<Self, LibraryError> {
        let library = Self::parse(path, bytes)?;
        let wanted: BTreeSet<String> = standard.functions().iter().map(ToString::to_string).collect();
        let list = |names: Vec<&String>| names.into_iter().cloned().collect::<Vec<_>>().join(", ");
        let missing: Vec<_> = wanted.difference(&library.exports).collect();
        if !missing.is_empty() {
            return Err(LibraryError::Missing { path: path.to_owned(), missing: list(missing) });
        }
        let surplus: Vec<_> = library.exports.difference(&wanted).collect();
        if !surplus.is_empty() {
            return Err(LibraryError::Surplus { path: path.to_owned(), surplus: list(surplus) });
        }
        Ok(library)
    }

    /// Reads a library. Of a universal one for macOS, which holds a library for each processor, all parts must have the
    /// same exports.
    fn parse(path: &Path, bytes: &[u8]) -> Result<Self, LibraryError> {
        let format = |source| LibraryError::Format { path: path.to_owned(), source };
        if object::FileKind::parse(bytes).map_err(format)? != object::FileKind::MachOFat32 {
            return Self::parse_one(path, bytes);
        }
        let mut whole: Option<Self> = None;
        for part in MachOFatFile32::parse(bytes).map_err(format)?.arches() {
            let part = Self::parse_one(path, part.data(bytes).map_err(format)?)?;
            match &mut whole {
                None => whole = Some(part),
                Some(whole) if whole.exports == part.exports => {
                    whole.processors.extend(part.processors);
                    whole.needs.extend(part.needs);
                    whole.needs.sort_unstable();
                    whole.needs.dedup();
                }
                Some(_) => return Err(LibraryError::Parts { path: path.to_owned() }),
            }
        }
        whole.ok_or_else(|| LibraryError::Parts { path: path.to_owned() })
    }

    fn parse_one(path: &Path, bytes: &[u8]) -> Result<Self, LibraryError> {
        let format = |source| LibraryError::Format { path: path.to_owned(), source };
        let file = object::File::parse(bytes).map_err(format)?;
        let mach_o = file.format() == object::BinaryFormat::MachO;
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        // C's names have an underscore before them in this format.
        let symbol = |bytes: &[u8]| text(bytes.strip_prefix(b"_").filter(|_| mach_o).unwrap_or(bytes));
        let mut exports = BTreeSet::new();
        for export in file.exports().map_err(format)? {
            match export.map_err(format)?.name() {
                NameOrOrdinal::Name(name) => exports.insert(symbol(name)),
                NameOrOrdinal::Ordinal(ordinal) => exports.insert(format!("ordinal {ordinal}")),
            };
        }
        let mut needs = Vec::new();
        for library in file.import_libraries().map_err(format)? {
            needs.push(text(library.map_err(format)?.name()));
        }
        let glibc = match &file {
            object::File::Elf64(elf) => newest_glibc(elf).map_err(format)?,
            _ => None,
        };
        let system = match file.format() {
            object::BinaryFormat::Elf => "linux",
            object::BinaryFormat::Pe => "windows",
            _ => "darwin",
        };
        let platform = match (system, file.is_64()) {
            ("linux", true) if file.architecture() == object::Architecture::Aarch64 => "aarch64-linux",
            ("linux", true) => "linux64",
            ("linux", false) => "linux32",
            ("windows", true) => "win64",
            ("windows", false) => "win32",
            _ => "darwin64",
        };
        let processors = vec![format!("{:?}", file.architecture()).to_lowercase()];
        Ok(Self { platform, system, processors, exports, needs, glibc })
    }

    /// A version's folders for it in `binaries/`: 3.0 has one for each processor.
    #[must_use]
    pub fn folders(&self, standard: Standard) -> Vec<String> {
        match standard {
            Standard::Fmi2 => vec![self.platform.to_owned()],
            Standard::Fmi3 => {
                let name = |processor: &String| match processor.as_str() {
                    "i386" => format!("x86-{}", self.system),
                    processor => format!("{processor}-{}", self.system),
                };
                self.processors.iter().map(name).collect()
            }
        }
    }

    /// One line for people: what a host must have.
    #[must_use]
    pub fn requirements(&self) -> String {
        let needs = self.needs.join(", ");
        match self.glibc {
            Some((major, minor)) => format!("needs glibc {major}.{minor} or newer ({needs})"),
            None if needs.is_empty() => "needs no library that is told here".to_owned(),
            None => format!("needs {needs}"),
        }
    }
}

/// The newest version `GLIBC_x.y` that a symbol of the file asks for.
fn newest_glibc<'data>(elf: &ElfFile64<'data>) -> object::Result<Option<(u32, u32)>> {
    let (endian, data) = (elf.endian(), elf.data());
    let sections = elf.elf_header().sections(endian, data)?;
    let Some((mut needs, link)) = sections.gnu_verneed(endian, data)? else { return Ok(None) };
    let strings = sections.strings(endian, data, link)?;
    let mut newest = None;
    while let Some((_, mut versions)) = needs.next()? {
        while let Some(version) = versions.next()? {
            let name = String::from_utf8_lossy(version.name(endian, strings)?).into_owned();
            let numbers = name.strip_prefix("GLIBC_").and_then(|numbers| numbers.split_once('.'));
            let numbers = numbers.and_then(|(major, minor)| {
                let minor = minor.split('.').next()?;
                Some((major.parse().ok()?, minor.parse().ok()?))
            });
            newest = newest.max(numbers);
        }
    }
    Ok(newest)
}

/// The suffix of shared libraries on a platform, named as in any version.
#[must_use]
pub fn suffix(platform: &str) -> &'static str {
    match platform {
        "win64" | "win32" | "x86_64-windows" => "dll",
        "darwin64" | "x86_64-darwin" | "aarch64-darwin" => "dylib",
        _ => "so",
    }
}
