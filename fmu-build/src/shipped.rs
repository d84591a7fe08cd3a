//! The FMUs and systems that we ship. An FMU is added here, in `src/fmu/` and as a crate beside this one.

use crate::fmu::{Added, Fmu, Resource, Surroundings, VEHICLE_FILE, vehicle_of};
use crate::system::{SettingError, System};
use rfl_mpc::fmi::{Context, Declaration, Log, Model, ModelError, Severity, Value, Values};
use rfl_mpc::fmu::{DEFAULT_PATH, PassengerCar, RflMpc, SemiTrailerTruck, TruckRflMpc};
use rfl_mpc::vehicle::VehicleKind;
use std::collections::BTreeMap;
use std::path::Path;

/// All FMUs, in the order in which systems step them: the plant before its controller.
#[must_use]
pub fn fmus() -> Vec<Fmu> {
    use VehicleKind::{Car, Truck};
    vec![
        fmu(PassengerCar::declaration(), Car, "fmu-passenger-car", VEHICLES),
        fmu(RflMpc::declaration(), Car, "fmu-rfl-mpc", CAR_CONTROLLER),
        fmu(SemiTrailerTruck::declaration(), Truck, "fmu-semi-trailer-truck", VEHICLES),
        fmu(TruckRflMpc::declaration(), Truck, "fmu-truck-rfl-mpc", TRUCK_CONTROLLER),
    ]
}

/// A vehicle and its controller, connected: a system that we ship.
#[derive(Debug, Clone, Copy)]
pub struct ClosedLoop {
    /// Its name, and that of its file.
    pub name: &'static str,
    /// The kind of vehicle: all FMUs of this kind belong to the system.
    pub vehicle: VehicleKind,
    /// The vehicle's FMU.
    pub plant: &'static str,
    /// The controller's.
    pub controller: &'static str,
    declare: fn() -> Declaration,
    initialize: fn(&mut Values, &Context) -> Result<(), ModelError>,
    /// The path that the controller carries.
    path: Resource,
}

/// The systems.
pub const SYSTEMS: [ClosedLoop; 2] = [
    ClosedLoop {
        name: "ClosedLoop",
        vehicle: VehicleKind::Car,
        plant: "PassengerCar",
        controller: "RflMpc",
        declare: RflMpc::declaration,
        initialize: initialize::<RflMpc>,
        path: CAR_CONTROLLER[1],
    },
    ClosedLoop {
        name: "TruckLoop",
        vehicle: VehicleKind::Truck,
        plant: "SemiTrailerTruck",
        controller: "TruckRflMpc",
        declare: TruckRflMpc::declaration,
        initialize: initialize::<TruckRflMpc>,
        path: TRUCK_CONTROLLER[1],
    },
];

fn initialize<M: Model>(values: &mut Values, context: &Context) -> Result<(), ModelError> {
    M::new().initialize(values, 0.0, context, &mut Unheard)
}

/// Reasons for which the system cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum SystemError {
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("the controller cannot start with these settings: {0}")]
    Controller(#[from] ModelError),
}

/// The systems whose FMUs are all among these, with the user's settings (`COMPONENT.PARAMETER=VALUE`). A vehicle starts
/// where its controller's path does and as fast as it is planned there, unless the user says otherwise.
///
/// # Errors
/// A setting that is none, or one with which a controller cannot be initialised.
pub fn systems(fmus: &[Fmu], project: &Path, settings: &[String]) -> Result<Vec<System>, SystemError> {
    let given = |name: &str| fmus.iter().find(|fmu| fmu.declaration.name == name);
    let both = |system: &'static ClosedLoop| Some((system, given(system.plant)?, given(system.controller)?));
    let systems: Vec<(&ClosedLoop, &Fmu, &Fmu)> = SYSTEMS.iter().filter_map(both).collect();
    let component = |setting: &str| setting.trim().split('.').next().unwrap_or_default().to_owned();
    for setting in settings {
        let (name, _) = setting.split_once('=').ok_or_else(|| SettingError::Form(setting.clone()))?;
        if systems.iter().all(|(system, ..)| !system.has(&component(name))) {
            let components: Vec<_> =
                systems.iter().flat_map(|(system, ..)| [system.plant, system.controller]).collect();
            let (name, components) = (name.trim().to_owned(), components.join(", "));
            return Err(SettingError::Unknown { name, components }.into());
        }
    }
    let of = |system: &ClosedLoop| -> Vec<String> {
        settings.iter().filter(|setting| system.has(&component(setting))).cloned().collect()
    };
    systems
        .into_iter()
        .map(|(system, plant, controller)| system.with(plant, controller, project, &of(system)))
        .collect()
}

impl ClosedLoop {
    /// The system for a kind of vehicle.
    #[must_use]
    pub fn of(vehicle: VehicleKind) -> &'static Self {
        match vehicle {
            VehicleKind::Car => &SYSTEMS[0],
            VehicleKind::Truck => &SYSTEMS[1],
        }
    }

    fn has(&self, component: &str) -> bool {
        [self.plant, self.controller].contains(&component)
    }

    /// Its FMUs, in the order in which they step.
    #[must_use]
    pub fn components(&self) -> Vec<Declaration> {
        fmus().into_iter().filter(|fmu| fmu.vehicle == self.vehicle).map(|fmu| fmu.declaration).collect()
    }

    /// Places of the files that its controller's start values name: in the FMU that is changed, or in the project.
    pub(crate) fn surroundings<'a>(&self, controller: &'a Fmu, project: &'a Path) -> Surroundings<'a> {
        let of_project = Surroundings { folder: project, path: self.path.from };
        controller.base.as_ref().map_or(of_project, |base| base.surroundings())
    }

    /// The system with settings of its components.
    fn with(
        &self,
        plant: &Fmu,
        controller: &Fmu,
        project: &Path,
        settings: &[String],
    ) -> Result<System, SystemError> {
        let mut system = System::new(self.name, self.components());
        for setting in settings {
            system.set(setting)?;
        }
        let begin = self.start_of_path(controller, project, &system)?;
        let mut set: Vec<String> = system.settings_of(self.plant).map(|(name, _)| name.to_owned()).collect();
        set.extend(plant.starts().into_keys());
        for (name, value) in ["initial.x", "initial.y", "initial.yaw", "initial.vx"].iter().zip(begin) {
            if !set.iter().any(|set| set == name) {
                system.set(&format!("{}.{name}={value}", self.plant))?;
            }
        }
        Ok(system)
    }

    /// Start of the path, from the controller itself: x, y, yaw, speed.
    fn start_of_path(
        &self,
        controller: &Fmu,
        project: &Path,
        system: &System,
    ) -> Result<[f64; 4], ModelError> {
        let declaration = (self.declare)();
        let mut values = Values::starting_from(&declaration.variables);
        // A learned model is not packed yet, and the path begins at the same place with any variant.
        let counts = |name: &str| !["variant", "residual.file"].contains(&name);
        for (name, text) in controller.starts().iter().filter(|(name, _)| counts(name)) {
            let text = if name == VEHICLE_FILE { &vehicle_of(controller) } else { text };
            set_text(&declaration, &mut values, name, text);
        }
        for (name, value) in system.settings_of(self.controller).filter(|(name, _)| counts(name)) {
            set(&declaration, &mut values, name, value.clone());
        }
        self.initialise(self.surroundings(controller, project), &declaration, &mut values)?;
        let of = |name: &str| declaration.find(name).map_or(0.0, |vr| values.real(vr));
        Ok(["start.x", "start.y", "start.yaw", "start.speed"].map(of))
    }

    /// Initialises the controller as its FMU would be, with these values of parameters, as text.
    pub(crate) fn try_controller(
        &self,
        surroundings: Surroundings<'_>,
        start: &BTreeMap<String, String>,
    ) -> Result<(), ModelError> {
        let declaration = (self.declare)();
        let mut values = Values::starting_from(&declaration.variables);
        for (name, text) in start {
            set_text(&declaration, &mut values, name, text);
        }
        self.initialise(surroundings, &declaration, &mut values)
    }

    fn initialise(
        &self,
        surroundings: Surroundings<'_>,
        declaration: &Declaration,
        values: &mut Values,
    ) -> Result<(), ModelError> {
        let Surroundings { folder, path: named } = surroundings;
        let path = declaration.find("path_file").filter(|vr| !values.is_set_by_host(*vr));
        if let Some(vr) = path {
            values.set_by_host(vr, &declaration.variables[vr], Value::String(named.to_owned()));
        }
        let context = Context { resources: Some(folder.to_owned()), instance_name: self.name.to_owned() };
        (self.initialize)(values, &context)
    }
}

fn set(declaration: &Declaration, values: &mut Values, name: &str, value: Value) {
    if let Some(vr) = declaration.find(name) {
        values.set_by_host(vr, &declaration.variables[vr], value);
    }
}

/// Sets a parameter from a text that was checked before.
fn set_text(declaration: &Declaration, values: &mut Values, name: &str, text: &str) {
    let value = declaration.find(name).map(|vr| declaration.variables[vr].value_of(text));
    if let Some(Ok(value)) = value {
        set(declaration, values, name, value);
    }
}

/// Discards the controller's messages: it gives them again to the host.
struct Unheard;

impl Log for Unheard {
    fn log(&mut self, _severity: Severity, _category: &'static str, _message: &str) {}
}

/// Vehicle files with their tyres.
const VEHICLES: &[Resource] = &[Resource { from: "vehicles", to: "vehicles" }];
/// A controller carries a path, too.
const CAR_CONTROLLER: &[Resource] =
    &[VEHICLES[0], Resource { from: "paths/sudoku_test.csv", to: DEFAULT_PATH }];
const TRUCK_CONTROLLER: &[Resource] =
    &[VEHICLES[0], Resource { from: "paths/truck_off_road.csv", to: DEFAULT_PATH }];

fn fmu(
    declaration: Declaration,
    vehicle: VehicleKind,
    package: &'static str,
    resources: &'static [Resource],
) -> Fmu {
    let description = format!("modelDescription/{}.xml", declaration.name);
    let added = Added::default();
    let selection = vec!["-p", package];
    Fmu { declaration, vehicle, description, package, selection, resources, added, base: None }
}
