//! Files that a user packs in: learned models for the controllers, a vehicle for all FMUs of its kind.
//!
//! The FMU's start values then say that they are used (`resources/start.toml`); its library stays the same.

use crate::fmu::{Fmu, VEHICLE_FILE, vehicle_of};
use crate::shipped::ClosedLoop;
use rfl_mpc::control::{
    ControlVariant, ControllerFile, ControllerFileError, LearnedModel, LearnedModelFor, MODEL_EXTENSION,
    TRUCK_STATES,
};
use rfl_mpc::fmi::{ModelError, StartError};
use rfl_mpc::fmu::MODELS;
use rfl_mpc::residual::FileError;
use rfl_mpc::vehicle::{
    Articulated, CarParameters, TruckParameters, VehicleError, VehicleKind, VehicleParameters,
};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Reasons for which something cannot be packed in.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum AddError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{} and {} are both of kind {kind}: give one of them", first.display(), second.display())]
    Twice { kind: &'static str, first: PathBuf, second: PathBuf },
    #[error("{} holds no residual (kind none): there is nothing to pack", file.display())]
    Nothing { file: PathBuf },
    #[error(
        "{} cannot drive the controller that is packed: {source}. Its vehicle is {vehicle}; --vehicle names another, \
         and --start gives other parameters a value",
        file.display()
    )]
    Misfit { file: PathBuf, vehicle: String, source: ModelError },
    #[error("{what} is for {fmu}, which is not among the FMUs that are made")]
    NotGiven { what: String, fmu: String },
    #[error("`{0}` is no start value: write FMU.PARAMETER=VALUE, e.g. RflMpc.mpc.sample_time=0.01")]
    Form(String),
    #[error(transparent)]
    Controller(#[from] ControllerFileError),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    #[error(
        "the vehicle file {} names the tyre file `{tyre}`, which does not lie beside or below it: copy it there",
        file.display()
    )]
    Tyre { file: PathBuf, tyre: String },
}

/// Makes a vehicle, by built-in name or file, the one that all FMUs of its kind start with.
///
/// # Errors
/// A file that is no vehicle, or whose tyres lie elsewhere.
pub fn add_vehicle(fmus: &mut [Fmu], vehicle: &str) -> Result<(), AddError> {
    let kind = VehicleKind::of(vehicle);
    let (files, start) = match kind {
        VehicleKind::Car => vehicle_files::<CarParameters>(vehicle, "car")?,
        VehicleKind::Truck => vehicle_files::<TruckParameters>(vehicle, "truck")?,
    };
    let takes = |fmu: &&mut Fmu| fmu.vehicle == kind && fmu.declaration.find(VEHICLE_FILE).is_some();
    let mut taken = false;
    for fmu in fmus.iter_mut().filter(takes) {
        fmu.added.files.extend(files.clone());
        fmu.added.start.insert(VEHICLE_FILE.to_owned(), start.clone());
        taken = true;
    }
    let system = ClosedLoop::of(kind);
    let fmu = format!("{} and {}", system.plant, system.controller);
    if taken { Ok(()) } else { Err(AddError::NotGiven { what: vehicle.to_owned(), fmu }) }
}

/// The files of a vehicle by their path in `resources/`, below a folder, and what `vehicle_file` is then.
fn vehicle_files<V: VehicleParameters>(
    vehicle: &str,
    below: &str,
) -> Result<(BTreeMap<String, PathBuf>, String), AddError> {
    let mut files = BTreeMap::new();
    if V::BUILTIN.contains(&vehicle) {
        return Ok((files, vehicle.to_owned()));
    }
    let file = absolute(Path::new(vehicle));
    let folder = file.parent().unwrap_or(Path::new("")).to_path_buf();
    for (_, tyre) in V::of_file(&file)?.tyres() {
        let tyre = &tyre.file;
        // A tyre that is not there is a built-in one: the file was read.
        if !folder.join(tyre).exists() {
            continue;
        }
        if !Path::new(tyre).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
        {
            return Err(AddError::Tyre { file, tyre: tyre.clone() });
        }
        files.insert(format!("{below}/{tyre}"), folder.join(tyre));
    }
    let start = format!("{below}/{}", file.file_name().unwrap_or_default().to_string_lossy());
    files.insert(start.clone(), file);
    Ok((files, start))
}

/// Gives a parameter of an FMU another start value: `FMU.PARAMETER=VALUE`.
///
/// # Errors
/// No such parameter; a text that is no value of it.
pub fn add_start(fmus: &mut [Fmu], text: &str) -> Result<(), AddError> {
    let form = || AddError::Form(text.to_owned());
    let (name, value) = text.split_once('=').ok_or_else(form)?;
    let (unit, parameter) = name.trim().split_once('.').ok_or_else(form)?;
    let missing = || AddError::NotGiven { what: text.to_owned(), fmu: unit.to_owned() };
    let fmu = fmus.iter_mut().find(|fmu| fmu.declaration.name == unit).ok_or_else(missing)?;
    fmu.declaration.clone().start_with(parameter, value.trim())?;
    fmu.added.start.insert(parameter.to_owned(), value.trim().to_owned());
    Ok(())
}

/// Gives the controller that a controller's file is for its numbers as start values, and its variant.
///
/// # Errors
/// A file that cannot be read; a number that the controller does not have or that is out of its range.
pub fn add_controller(fmus: &mut [Fmu], file: &Path) -> Result<(), AddError> {
    let read = ControllerFile::read(file)?;
    let vehicle = if read.kind == "truck" { VehicleKind::Truck } else { VehicleKind::Car };
    let controller = ClosedLoop::of(vehicle).controller;
    for (name, value) in &read.values {
        add_start(fmus, &format!("{controller}.{name}={value}"))?;
    }
    match read.variant {
        Some(variant) => add_start(fmus, &format!("{controller}.variant={}", variant as i32)),
        None => Ok(()),
    }
}

/// Packs learned models into the FMUs of the controllers that they are for; a controller then drives with its first
/// unless its host chooses otherwise. Each is tried in the controller with its vehicle. Gives controllers and variants.
///
/// # Errors
/// A file that is no model, does not fit, or is of the same kind as another.
pub fn add_models(
    fmus: &mut [Fmu],
    project: &Path,
    files: &[PathBuf],
) -> Result<Vec<(&'static str, ControlVariant)>, AddError> {
    let mut packed = Vec::new();
    for file in files {
        let (vehicle, kind) = vehicle_and_variant(file)?;
        let system = ClosedLoop::of(vehicle);
        let missing =
            || AddError::NotGiven { what: file.display().to_string(), fmu: system.controller.to_owned() };
        let controller = fmus.iter_mut().find(|fmu| fmu.declaration.name == system.controller);
        let controller = controller.ok_or_else(missing)?;
        if kind == ControlVariant::None {
            return Err(AddError::Nothing { file: file.clone() });
        }
        let entry = format!("{MODELS}/{}.{MODEL_EXTENSION}", kind.name());
        if let Some(first) = controller.added.files.get(&entry) {
            let (first, second) = (first.clone(), file.clone());
            return Err(AddError::Twice { kind: kind.name(), first, second });
        }
        let vehicle = vehicle_of(controller);
        let file = absolute(file);
        let mut start = controller.starts();
        start.insert(VEHICLE_FILE.to_owned(), vehicle.clone());
        start.insert("variant".to_owned(), kind.name().to_owned());
        start.insert("residual.file".to_owned(), file.to_string_lossy().into_owned());
        if let Err(source) = system.try_controller(system.surroundings(controller, project), &start) {
            return Err(AddError::Misfit { file, vehicle, source });
        }
        let added = &mut controller.added;
        added.files.insert(entry, file);
        added.start.entry("variant".to_owned()).or_insert_with(|| kind.name().to_owned());
        packed.push((system.controller, kind));
    }
    Ok(packed)
}

/// For which vehicles a model is, and for which variant.
fn vehicle_and_variant(file: &Path) -> Result<(VehicleKind, ControlVariant), FileError> {
    match LearnedModel::read(file) {
        Ok(model) => Ok((VehicleKind::Car, model.variant())),
        Err(error) if error.is_of_another_vehicle() => {
            let model = LearnedModelFor::<Articulated, TRUCK_STATES>::read(file)?;
            Ok((VehicleKind::Truck, model.variant()))
        }
        Err(error) => Err(error),
    }
}

fn absolute(file: &Path) -> PathBuf {
    std::path::absolute(file).unwrap_or_else(|_| file.to_owned())
}
