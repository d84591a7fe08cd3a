//! What a shared library exports and needs: an FMU library exports FMI 2.0's functions and nothing else, and needs
//! nothing that a host may lack.

use object::read::elf::{ElfFile64, FileHeader};
use object::{Endianness, Object, ObjectSymbol};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The functions of `fmi2Functions.h`.
pub const FMI2_FUNCTIONS: [&str; 44] = [
    "fmi2CancelStep",
    "fmi2CompletedIntegratorStep",
    "fmi2DeSerializeFMUstate",
    "fmi2DoStep",
    "fmi2EnterContinuousTimeMode",
    "fmi2EnterEventMode",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2FreeFMUstate",
    "fmi2FreeInstance",
    "fmi2GetBoolean",
    "fmi2GetBooleanStatus",
    "fmi2GetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetDirectionalDerivative",
    "fmi2GetEventIndicators",
    "fmi2GetFMUstate",
    "fmi2GetInteger",
    "fmi2GetIntegerStatus",
    "fmi2GetNominalsOfContinuousStates",
    "fmi2GetReal",
    "fmi2GetRealOutputDerivatives",
    "fmi2GetRealStatus",
    "fmi2GetStatus",
    "fmi2GetString",
    "fmi2GetStringStatus",
    "fmi2GetTypesPlatform",
    "fmi2GetVersion",
    "fmi2Instantiate",
    "fmi2NewDiscreteStates",
    "fmi2Reset",
    "fmi2SerializeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SetBoolean",
    "fmi2SetContinuousStates",
    "fmi2SetDebugLogging",
    "fmi2SetFMUstate",
    "fmi2SetInteger",
    "fmi2SetReal",
    "fmi2SetRealInputDerivatives",
    "fmi2SetString",
    "fmi2SetTime",
    "fmi2SetupExperiment",
    "fmi2Terminate",
];

/// Why a library cannot go into an FMU.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LibraryError {
    #[error("cannot read the library {path}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path} is no shared library that can be read: {source}")]
    Format { path: PathBuf, source: object::Error },
    #[error("{path} does not export {missing}. An FMU library is made by rfl_mpc::export_fmi2!.")]
    Missing { path: PathBuf, missing: String },
    #[error("{path} exports more than FMI's functions: {surplus}. Such symbols can clash with those of a host.")]
    Surplus { path: PathBuf, surplus: String },
}

/// What was found in a library.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Library {
    /// FMI 2.0's name of the platform, e.g. `linux64`.
    pub platform: &'static str,
    /// Exported symbols, sorted.
    pub exports: BTreeSet<String>,
    /// Libraries that the loader must find.
    pub needs: Vec<String>,
    /// The newest glibc version that a symbol asks for (ELF only).
    pub glibc: Option<(u32, u32)>,
}

impl Library {
    /// Reads a library and checks that it exports FMI 2.0 and nothing else.
    ///
    /// # Errors
    /// If it cannot be read, or exports less or more.
    pub fn check(path: &Path) -> Result<Self, LibraryError> {
        let library = Self::read(path)?;
        let wanted: BTreeSet<String> = FMI2_FUNCTIONS.iter().map(ToString::to_string).collect();
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

    /// Reads a library.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path) -> Result<Self, LibraryError> {
        let bytes = std::fs::read(path).map_err(|source| LibraryError::Read { path: path.to_owned(), source })?;
        let format = |source| LibraryError::Format { path: path.to_owned(), source };
        let file = object::File::parse(&*bytes).map_err(format)?;
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let elf = match &file {
            object::File::Elf64(elf) => Some(elf_needs(elf).map_err(format)?),
            _ => None,
        };
        let exports = match file.format() {
            // A dynamic symbol that is defined is exported.
            object::BinaryFormat::Elf => file
                .dynamic_symbols()
                .filter(|symbol| symbol.is_definition())
                .map(|symbol| symbol.name_bytes().map(text))
                .collect::<Result<_, _>>()
                .map_err(format)?,
            _ => {
                let exports = file.exports().map_err(format)?;
                exports.iter().filter_map(|export| exported(export, file.format())).collect()
            }
        };
        let platform = match (file.format(), file.is_64()) {
            (object::BinaryFormat::Elf, true) => "linux64",
            (object::BinaryFormat::Elf, false) => "linux32",
            (object::BinaryFormat::Pe, true) => "win64",
            (object::BinaryFormat::Pe, false) => "win32",
            _ => "darwin64",
        };
        let (needs, glibc) = elf.unwrap_or_default();
        Ok(Self { platform, exports, needs, glibc })
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

/// The suffix of shared libraries on a platform.
#[must_use]
pub fn suffix(platform: &str) -> &'static str {
    match platform {
        "win64" | "win32" => "dll",
        "darwin64" => "dylib",
        _ => "so",
    }
}
