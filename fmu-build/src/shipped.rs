//! The FMUs and the car's system that we ship. An FMU is added here, in `src/fmu/` and as a crate beside this one.

use crate::added::Added;
use crate::fmu::{Fmu, Resource};
use crate::system::{SettingError, System};
use rfl_mpc::fmi::{Context, Declaration, Log, Model, ModelError, Severity, Value, Values};
use rfl_mpc::fmu::{DEFAULT_PATH, PassengerCar, RflMpc, SemiTrailerTruck};
use rfl_mpc::vehicle::VehicleKind;
use std::collections::BTreeMap;
use std::path::Path;

/// All FMUs, in the order in which a system steps them: the plant before its controller.
#[must_use]
pub fn fmus() -> Vec<Fmu> {
    use VehicleKind::{Car, Truck};
    vec![
        fmu(PassengerCar::declaration(), Car, "fmu-passenger-car", VEHICLES),
        fmu(RflMpc::declaration(), Car, "fmu-rfl-mpc", VEHICLES_AND_PATH),
        fmu(SemiTrailerTruck::declaration(), Truck, "fmu-semi-trailer-truck", VEHICLES),
    ]
}

/// The car's system.
pub const SYSTEM: &str = "ClosedLoop";

/// The FMUs of the system.
#[must_use]
pub fn components() -> Vec<Declaration> {
    fmus().into_iter().filter(in_system).map(|fmu| fmu.declaration).collect()
}

/// Whether an FMU is one of the system.
#[must_use]
pub fn in_system(fmu: &Fmu) -> bool {
    fmu.vehicle == VehicleKind::Car
}

/// Why the system cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum SystemError {
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("the controller cannot start with these settings: {0}")]
    Controller(#[from] ModelError),
}

/// Car and controller, connected, with the user's settings (`COMPONENT.PARAMETER=VALUE`). The car starts where the
/// controller's path does and as fast as it is planned there, unless the user says otherwise.
///
/// # Errors
/// A setting that is none, or one with which the controller cannot be initialised.
pub fn closed_loop(project: &Path, settings: &[String]) -> Result<System, SystemError> {
    let mut system = System::new(SYSTEM, components());
    for setting in settings {
        system.set(setting)?;
    }
    let begin = start_of_path(project, &system)?;
    let set: Vec<String> = system.settings_of("PassengerCar").map(|(name, _)| name.to_owned()).collect();
    for (name, value) in ["initial.x", "initial.y", "initial.yaw", "initial.vx"].iter().zip(begin) {
        if !set.iter().any(|set| set == name) {
            system.set(&format!("PassengerCar.{name}={value}"))?;
        }
    }
    Ok(system)
}

/// Where the path begins, as the controller itself says: x, y, yaw, speed.
fn start_of_path(project: &Path, system: &System) -> Result<[f64; 4], ModelError> {
    let declaration = RflMpc::declaration();
    let settings = system.settings_of(declaration.name);
    // What is packed is not there yet, and the path begins at the same place with any variant.
    let settings = settings.filter(|(name, _)| !["variant", "residual.file"].contains(name));
    let mut values = Values::starting_from(&declaration.variables);
    for (name, value) in settings {
        set(&declaration, &mut values, name, value.clone());
    }
    initialise(project, &declaration, &mut values)?;
    let of = |name: &str| declaration.find(name).map_or(0.0, |vr| values.real(vr));
    Ok(["start.x", "start.y", "start.yaw", "start.speed"].map(of))
}

/// Initialises the controller as its FMU would be, with these values of parameters, as text.
pub(crate) fn try_controller(project: &Path, start: &BTreeMap<String, String>) -> Result<(), ModelError> {
    let declaration = RflMpc::declaration();
    let mut values = Values::starting_from(&declaration.variables);
    for (name, text) in start {
        let value = declaration.find(name).map(|vr| declaration.variables[vr].value_of(text));
        if let Some(Ok(value)) = value {
            set(&declaration, &mut values, name, value);
        }
    }
    initialise(project, &declaration, &mut values)
}

fn set(declaration: &Declaration, values: &mut Values, name: &str, value: Value) {
    if let Some(vr) = declaration.find(name) {
        values.set_by_host(vr, value);
    }
}

fn initialise(project: &Path, declaration: &Declaration, values: &mut Values) -> Result<(), ModelError> {
    // The project stands for the FMU's resources, in which the path has another name.
    let path = declaration.find("path_file").filter(|vr| !values.is_set_by_host(*vr));
    if let Some(vr) = path {
        values.set_by_host(vr, Value::String(PATH.from.to_owned()));
    }
    let context = Context { resources: Some(project.to_owned()), instance_name: SYSTEM.to_owned() };
    RflMpc::new().initialize(values, 0.0, &context, &mut Unheard)
}

/// What the controller says here, it says again to the host.
struct Unheard;

impl Log for Unheard {
    fn log(&mut self, _severity: Severity, _category: &'static str, _message: &str) {}
}

/// The path that the controller carries.
const PATH: Resource = Resource { from: "paths/sudoku_test.csv", to: DEFAULT_PATH };
/// Vehicle files with their tyres.
const VEHICLES: &[Resource] = &[Resource { from: "vehicles", to: "vehicles" }];
const VEHICLES_AND_PATH: &[Resource] = &[VEHICLES[0], PATH];

fn fmu(
    declaration: Declaration,
    vehicle: VehicleKind,
    package: &'static str,
    resources: &'static [Resource],
) -> Fmu {
    let description = format!("modelDescription/{}.xml", declaration.name);
    let added = Added::default();
    Fmu { declaration, vehicle, description, package, selection: vec!["-p", package], resources, added }
}
