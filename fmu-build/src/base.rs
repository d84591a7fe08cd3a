//! Reading an FMU that was made before: whose it is, of which version, and whether a host can load it.

use crate::description::describe_in;
use crate::fmu::{Base, Fmu, FmuError, RESOURCES};
use crate::package::Package;
use crate::packing::{check_place, library_places};
use crate::standard::Standard;
use rfl_mpc::fmi::{START_FILE, StartValues};
use std::path::Path;

impl Base {
    /// Reads an FMU's file, which must be one of `all`, and of this version; gives which one, based on the file.
    ///
    /// # Errors
    /// A file that is none of them; one without libraries, or with those of another FMU.
    pub fn read(file: &Path, all: &[Fmu]) -> Result<Fmu, FmuError> {
        // An archive of others is not unpacked.
        let xml = Package::read_entry(file, "modelDescription.xml")?.unwrap_or_default();
        let xml = String::from_utf8_lossy(&xml).into_owned();
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
        let package = Package::read(file)?;
        let start = package.get(&format!("{RESOURCES}{START_FILE}")).unwrap_or_default();
        let start = StartValues::read(&String::from_utf8_lossy(start))
            .map_err(|error| FmuError::PackedStart { path: file.to_owned(), message: error.to_string() })?;
        let places = library_places(standard, fmu.declaration.name);
        let libraries = Package::libraries(file, &places, own.as_bytes())?;
        libraries.names("").try_for_each(|place| check_place(&libraries, file, place, standard))?;
        let base = Base { standard, package, start: start.chosen };
        Ok(Fmu { base: Some(base), ..fmu.clone() })
    }
}
