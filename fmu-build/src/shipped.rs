//! The FMUs and the system that we ship. An FMU is added here, in `src/fmu/` and as a crate beside this one.

use crate::fmu::{Fmu, Resource};
use rfl_mpc::fmi::{Declaration, Model};
use rfl_mpc::fmu::{DEFAULT_PATH, PassengerCar, RflMpc};

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

/// Vehicle files with their tyres.
const VEHICLES: &[Resource] = &[Resource { from: "vehicles", to: "vehicles" }];
const VEHICLES_AND_PATH: &[Resource] =
    &[VEHICLES[0], Resource { from: "paths/sudoku_test.csv", to: DEFAULT_PATH }];

fn fmu(declaration: Declaration, package: &'static str, resources: &'static [Resource]) -> Fmu {
    let description = format!("modelDescription/{}.xml", declaration.name);
    Fmu { declaration, description, package, selection: vec!["-p", package], resources }
}
