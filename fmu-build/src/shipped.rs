//! The FMUs and the system that we ship. An FMU is added here, in `src/fmu/` and as a crate beside this one.

use crate::fmu::{Fmu, Resource};
use rfl_mpc::control::{Controller, ControllerParameters};
use rfl_mpc::fmi::{Declaration, Model};
use rfl_mpc::fmu::{DEFAULT_PATH, PassengerCar, RflMpc};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// All FMUs, in the order in which a system steps them: the plant before its controller.
#[must_use]
pub fn fmus() -> Vec<Fmu> {
    vec![
        fmu(PassengerCar::declaration(), "fmu-passenger-car", VEHICLES),
        fmu(RflMpc::declaration(), "fmu-rfl-mpc", VEHICLES_AND_PATH),
    ]
}

/// The system of them all.
pub const SYSTEM: &str = "ClosedLoop";

/// Settings of [`SYSTEM`] that put its car where the controller's road begins, at the speed planned there.
///
/// A host that connects the FMUs itself reads this from the controller's outputs `start.*`; an SSP has no such step.
/// `road` is the file of a road other than the packed one.
///
/// # Errors
/// If the road cannot be read.
pub fn start(project: &Path, road: Option<&str>) -> Result<Vec<String>, StartError> {
    let file = road.map_or_else(|| project.join(ROAD), PathBuf::from);
    let path = Arc::new(rfl_mpc::path::Path::read(&file)?);
    let controller = Controller::new(ControllerParameters::default(), path)?;
    let (at, speed) = (controller.path().at(0.0), controller.speed_plan().speed(0.0));
    let start = [("x", at.x), ("y", at.y), ("yaw", at.yaw), ("vx", speed)];
    Ok(start.map(|(name, value)| format!("PassengerCar.initial.{name}={value}")).to_vec())
}

/// Why a road's start is not known.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum StartError {
    #[error(transparent)]
    Path(#[from] rfl_mpc::path::PathError),
    #[error(transparent)]
    Controller(#[from] rfl_mpc::control::ControllerError),
}

/// The road that the controller carries.
const ROAD: &str = "paths/sudoku_test.csv";
/// Vehicle files with their tyres.
const VEHICLES: &[Resource] = &[Resource { from: "vehicles", to: "vehicles" }];
const VEHICLES_AND_PATH: &[Resource] = &[VEHICLES[0], Resource { from: ROAD, to: DEFAULT_PATH }];

fn fmu(declaration: Declaration, package: &'static str, resources: &'static [Resource]) -> Fmu {
    let description = format!("modelDescription/{}.xml", declaration.name);
    Fmu { declaration, description, package, selection: vec!["-p", package], resources }
}
