//! The vehicles and tyres that come with the program, embedded so that an FMU needs no files.

use std::path::Path;

macro_rules! embedded {
    ($folder:literal $extension:literal: $($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../vehicles/", $folder, $name, $extension)))),*]
    };
}

pub(super) const CARS: &[(&str, &str)] =
    embedded!("" ".toml": "c_class" "bmw_320i" "ford_escort" "vw_vanagon" "genesis");

pub(super) const TRUCKS: &[(&str, &str)] = embedded!("" ".toml": "truck_simulation" "truck_real");

const TYRES: &[(&str, &str)] = embedded!("tyres/" ".tir": "c_class" "commonroad" "genesis" "truck");

/// Names of the built-in cars; the first is the default.
pub const BUILTIN: &[&str] = &["c_class", "bmw_320i", "ford_escort", "vw_vanagon", "genesis"];

/// Names of the built-in trucks; the first is the default.
pub const BUILTIN_TRUCKS: &[&str] = &["truck_simulation", "truck_real"];

/// The text of a built-in vehicle's file, a car's or a truck's.
#[must_use]
pub fn builtin_text(name: &str) -> Option<&'static str> {
    CARS.iter().chain(TRUCKS).find(|(vehicle, _)| *vehicle == name).map(|(_, text)| *text)
}

/// The text of the built-in tyre that a vehicle file names, with or without folder and ending.
pub(super) fn tyre(file: &str) -> Option<&'static str> {
    let stem = Path::new(file).file_stem()?.to_str()?;
    TYRES.iter().find(|(name, _)| *name == stem).map(|(_, text)| *text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_its_vehicle() {
        assert_eq!(CARS.iter().map(|car| car.0).collect::<Vec<_>>(), BUILTIN);
        assert_eq!(TRUCKS.iter().map(|truck| truck.0).collect::<Vec<_>>(), BUILTIN_TRUCKS);
    }
}
