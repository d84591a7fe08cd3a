//! The FMUs and systems that we ship. An FMU is added here, in `src/fmu/` and as a crate beside this one.

use crate::fmu::{Added, Fmu, FmuError, Resource, initialize, unpacked};
use crate::system::{SettingError, System};
use rfl_mpc::fmi::{Declaration, Model, ModelError, StartError, Values};
use rfl_mpc::fmu::{DEFAULT_PATH, PassengerCar, RflMpc, SemiTrailerTruck, TruckRflMpc};
use rfl_mpc::vehicle::VehicleKind;
use std::path::Path;

/// All FMUs, in the order in which systems step them: the plant before its controller.
#[must_use]
pub fn fmus() -> Vec<Fmu> {
    use VehicleKind::{Car, Truck};
    vec![
        fmu::<PassengerCar>(Car, "fmu-passenger-car", VEHICLES),
        fmu::<RflMpc>(Car, "fmu-rfl-mpc", CAR_CONTROLLER),
        fmu::<SemiTrailerTruck>(Truck, "fmu-semi-trailer-truck", VEHICLES),
        fmu::<TruckRflMpc>(Truck, "fmu-truck-rfl-mpc", TRUCK_CONTROLLER),
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
}

/// The systems.
pub const SYSTEMS: [ClosedLoop; 2] = [
    ClosedLoop { name: "ClosedLoop", vehicle: VehicleKind::Car, plant: "PassengerCar", controller: "RflMpc" },
    ClosedLoop {
        name: "TruckLoop",
        vehicle: VehicleKind::Truck,
        plant: "SemiTrailerTruck",
        controller: "TruckRflMpc",
    },
];

/// Reasons for which the system cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum SystemError {
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("the controller cannot start with these settings: {0}")]
    Controller(#[from] ModelError),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error(transparent)]
    Fmu(#[from] FmuError),
}

/// Systems whose FMUs are all among these, with vehicle and controller.
fn given(fmus: &[Fmu]) -> Vec<(&'static ClosedLoop, &Fmu, &Fmu)> {
    let given = |name: &str| fmus.iter().find(|fmu| fmu.declaration.name == name);
    let both = |system: &'static ClosedLoop| Some((system, given(system.plant)?, given(system.controller)?));
    SYSTEMS.iter().filter_map(both).collect()
}

/// The component of a setting, `COMPONENT.PARAMETER=VALUE`.
fn component(setting: &str) -> &str {
    setting.trim().split('.').next().unwrap_or_default()
}

/// Checks that each setting (`COMPONENT.PARAMETER=VALUE`) is for a component of a system that is made of these FMUs.
///
/// # Errors
/// One that is for none.
pub fn check_settings(fmus: &[Fmu], settings: &[String]) -> Result<(), SettingError> {
    let systems = given(fmus);
    for setting in settings {
        let (name, _) = setting.split_once('=').ok_or_else(|| SettingError::Form(setting.clone()))?;
        let name = name.trim().to_owned();
        if systems.is_empty() {
            let of = SYSTEMS.iter().find(|system| system.has(component(&name))).unwrap_or(&SYSTEMS[0]);
            return Err(SettingError::NoSystem {
                name,
                needed: format!("{} and {}", of.plant, of.controller),
            });
        }
        if systems.iter().all(|(system, ..)| !system.has(component(&name))) {
            let components: Vec<_> =
                systems.iter().flat_map(|(system, ..)| [system.plant, system.controller]).collect();
            return Err(SettingError::Unknown { name, components: components.join(", ") });
        }
    }
    Ok(())
}

/// The systems whose FMUs are all among these, with the user's settings (`COMPONENT.PARAMETER=VALUE`). A vehicle starts
/// where its controller's path does and as fast as it is planned there, unless the user says otherwise.
///
/// # Errors
/// A setting that is none, or one with which a controller cannot be initialised.
pub fn systems(fmus: &[Fmu], project: &Path, settings: &[String]) -> Result<Vec<System>, SystemError> {
    check_settings(fmus, settings)?;
    let of = |system: &ClosedLoop| -> Vec<String> {
        settings.iter().filter(|setting| system.has(component(setting))).cloned().collect()
    };
    given(fmus)
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

    /// Start of the path, from the controller itself as the system sets it: x, y, yaw, speed.
    fn start_of_path(
        &self,
        controller: &Fmu,
        project: &Path,
        system: &System,
    ) -> Result<[f64; 4], SystemError> {
        let declaration = controller.declared_with(&controller.starts())?;
        let mut values = Values::starting_from(&declaration.variables);
        for (name, value) in system.settings_of(self.controller) {
            if let Some(vr) = declaration.find(name) {
                values.set_by_host(vr, &declaration.variables[vr], value.clone());
            }
        }
        let resources = unpacked(&controller.resources_in(project).map_err(FmuError::from)?)?;
        controller.initialise(&mut values, resources.path())?;
        let of = |name: &str| declaration.find(name).map_or(0.0, |vr| values.real(vr));
        Ok(["start.x", "start.y", "start.yaw", "start.speed"].map(of))
    }
}

/// Vehicle files with their tyres.
const VEHICLES: &[Resource] = &[Resource { from: "vehicles", to: "vehicles" }];
/// A controller carries a path, too.
const CAR_CONTROLLER: &[Resource] =
    &[VEHICLES[0], Resource { from: "paths/sudoku_test.csv", to: DEFAULT_PATH }];
const TRUCK_CONTROLLER: &[Resource] =
    &[VEHICLES[0], Resource { from: "paths/truck_off_road.csv", to: DEFAULT_PATH }];

fn fmu<M: Model>(vehicle: VehicleKind, package: &'static str, resources: &'static [Resource]) -> Fmu {
    let declaration = M::declaration();
    let description = format!("modelDescription/{}.xml", declaration.name);
    let (added, initialize) = (Added::default(), initialize::<M>);
    let selection = vec!["-p", package];
    Fmu { declaration, vehicle, description, package, selection, resources, initialize, added, base: None }
}
