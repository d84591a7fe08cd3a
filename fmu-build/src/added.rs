//! Files that a user packs in: learned models for the controllers, a vehicle for all FMUs of its kind, what a start value names.
//!
//! The FMU's start values then say that they are used (`resources/start.toml`); its library stays the same.

use crate::fmu::{Added, Fmu, FmuError, VEHICLE_FILE, unpacked, vehicle_of};
use crate::shipped::{self, ClosedLoop};
use crate::system::SettingError;
use rfl_mpc::control::{
    ControlVariant, ControllerFile, ControllerFileError, LearnedModel, LearnedModelFor, MODEL_EXTENSION,
    TRUCK_STATES,
};
use rfl_mpc::fmi::{ModelError, StartError, Values, VariableKind};
use rfl_mpc::fmu::MODELS;
use rfl_mpc::path::{self, PathError};
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
    #[error("`{text}` names no FMU: write {}", with.join(" or "))]
    NoFmu { text: String, with: Vec<String> },
    #[error("`{0}` is no start value: write FMU.PARAMETER=VALUE, e.g. RflMpc.mpc.sample_time=0.01")]
    Form(String),
    #[error(transparent)]
    Controller(#[from] ControllerFileError),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    #[error("{parameter}: {source}")]
    Road { parameter: String, source: Box<PathError> },
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error(transparent)]
    Fmu(#[from] FmuError),
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
    let (files, start) = vehicle_of_kind(kind, vehicle)?;
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

/// Files by their path in `resources/`, and the start value that names them there.
type Named = (BTreeMap<String, PathBuf>, String);

/// The files of a vehicle.
fn vehicle_of_kind(kind: VehicleKind, vehicle: &str) -> Result<Named, AddError> {
    match kind {
        VehicleKind::Car => vehicle_files::<CarParameters>(vehicle, "car"),
        VehicleKind::Truck => vehicle_files::<TruckParameters>(vehicle, "truck"),
    }
}

fn vehicle_files<V: VehicleParameters>(vehicle: &str, below: &str) -> Result<Named, AddError> {
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
    let (file, start) = named_below(below, &file);
    files.extend(file);
    Ok((files, start))
}

/// One file in a folder of the resources.
fn named_below(below: &str, file: &Path) -> Named {
    let name = format!("{below}/{}", file.file_name().unwrap_or_default().to_string_lossy());
    ([(name.clone(), absolute(file))].into(), name)
}

/// The files that a parameter's text names: read as what they are, and packed. A name in the FMU's resources stays one.
fn files_named(fmu: &Fmu, parameter: &str, text: &str) -> Result<Named, AddError> {
    let file = Path::new(text);
    if text.is_empty() || (!file.exists() && fmu.has_resource(text)) {
        return Ok((BTreeMap::new(), text.to_owned()));
    }
    match parameter {
        VEHICLE_FILE => vehicle_of_kind(fmu.vehicle, text),
        "path_file" | "road_file" => {
            let road = |source| AddError::Road { parameter: parameter.to_owned(), source: Box::new(source) };
            path::Path::read(file).map_err(road)?;
            Ok(named_below("roads", file))
        }
        "residual.file" => {
            vehicle_and_variant(file)?;
            Ok(named_below("models", file))
        }
        "controller_file" => {
            ControllerFile::read(file)?;
            Ok(named_below("controllers", file))
        }
        _ => Ok((BTreeMap::new(), text.to_owned())),
    }
}

/// Gives a parameter of an FMU another start value: `FMU.PARAMETER=VALUE`. A file that it names is packed.
///
/// # Errors
/// No such parameter; a text that is no value of it; a file that is none of its kind.
pub fn add_start(fmus: &mut [Fmu], text: &str) -> Result<(), AddError> {
    let form = || AddError::Form(text.to_owned());
    let (name, value) = text.split_once('=').ok_or_else(form)?;
    let (unit, parameter) = name.trim().split_once('.').ok_or_else(form)?;
    let missing = || {
        let owners = fmus.iter().filter(|fmu| fmu.declaration.find(name.trim()).is_some());
        let with: Vec<_> = owners.map(|fmu| format!("{}.{text}", fmu.declaration.name)).collect();
        match with.is_empty() {
            true => AddError::NotGiven { what: text.to_owned(), fmu: unit.to_owned() },
            false => AddError::NoFmu { text: text.to_owned(), with },
        }
    };
    let place = fmus.iter().position(|fmu| fmu.declaration.name == unit).ok_or_else(missing)?;
    let fmu = &mut fmus[place];
    let value = value.trim();
    fmu.declaration.clone().start_with(parameter, value)?;
    let mut start = value.to_owned();
    if is_text(fmu, parameter) {
        let (files, name) = files_named(fmu, parameter, value)?;
        fmu.added.files.extend(files);
        start = name;
    }
    fmu.added.start.insert(parameter.to_owned(), start);
    Ok(())
}

fn is_text(fmu: &Fmu, parameter: &str) -> bool {
    let variable = fmu.declaration.find(parameter).map(|vr| &fmu.declaration.variables[vr]);
    variable.is_some_and(|variable| matches!(variable.kind, VariableKind::String { .. }))
}

/// Takes texts out of the settings of systems (`COMPONENT.PARAMETER=VALUE`): they name files, and become start values of the FMUs,
/// with the files in them. A system then needs no text, which not every host can set. Gives the other settings.
///
/// # Errors
/// A setting that is none, or a file that is none of its kind.
pub fn add_settings(fmus: &mut [Fmu], settings: &[String]) -> Result<Vec<String>, AddError> {
    shipped::check_settings(fmus, settings)?;
    let mut others = Vec::new();
    for setting in settings {
        let name = setting.split('=').next().unwrap_or_default().trim();
        let text = |fmu: &Fmu| {
            let parameter = name.strip_prefix(fmu.declaration.name).and_then(|rest| rest.strip_prefix('.'));
            parameter.is_some_and(|parameter| is_text(fmu, parameter))
        };
        if fmus.iter().any(text) {
            add_start(fmus, setting)?;
        } else {
            others.push(setting.clone());
        }
    }
    Ok(others)
}

/// Tries each FMU that the user gives something: a build takes minutes.
///
/// # Errors
/// What cannot start.
pub fn try_added(fmus: &[Fmu], project: &Path) -> Result<(), FmuError> {
    let given = |fmu: &&Fmu| fmu.added != Added::default();
    fmus.iter().filter(given).try_for_each(|fmu| fmu.start_values(&fmu.resources_in(project)?).map(|_| ()))
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
        start.insert("variant".to_owned(), kind.name().to_owned());
        start.insert("residual.file".to_owned(), file.to_string_lossy().into_owned());
        let declaration = controller.declared_with(&start)?;
        let resources = unpacked(&controller.resources_in(project).map_err(FmuError::from)?)?;
        let mut values = Values::starting_from(&declaration.variables);
        if let Err(source) = controller.initialise(&mut values, resources.path()) {
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
