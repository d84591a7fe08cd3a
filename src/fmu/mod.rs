//! Our models as FMI units: their variables, and how a step of theirs becomes a step of the FMU.
//!
//! | file | FMU |
//! |---|---|
//! | `plant.rs` | what the vehicles' FMUs have in common |
//! | `passenger_car.rs` | `PassengerCar`: the nonlinear car |
//! | `semi_trailer_truck.rs` | `SemiTrailerTruck`: the nonlinear tractor and semi-trailer |
//! | `controller.rs` | what the vehicles' controllers have in common |
//! | `rfl_mpc.rs` | `RflMpc`: the car's controller |
//! | `truck_rfl_mpc.rs` | `TruckRflMpc`: the truck's controller |

mod controller;
mod passenger_car;
mod plant;
mod rfl_mpc;
mod semi_trailer_truck;
mod truck_rfl_mpc;

pub use controller::{ControllerFmu, ControllerInput, ControllerUnit, DEFAULT_PATH, MODELS, ParameterValues};
pub use passenger_car::PassengerCar;
pub use plant::{ExtraOutput, INITIAL, PlantFmu, PlantUnit, SignalOutput};
pub use rfl_mpc::RflMpc;
pub use semi_trailer_truck::SemiTrailerTruck;
pub use truck_rfl_mpc::TruckRflMpc;

use crate::fmi::{Context, ModelError, Variable, VariableKind};
use crate::vehicle::VehicleParameters;

/// Where a file that a parameter names is looked for, as descriptions say it: see [`Context::locate`].
const PLACES: &str = "absolute, or in the FMU's resources, else in the host's working folder";

/// The parameter by which plant and controller are told the vehicle; `what` people call it.
fn vehicle_file_parameter<V: VehicleParameters>(what: &str) -> Variable {
    Variable::parameter_of(
        VariableKind::String { start: V::BUILTIN[0].into() },
        "vehicle_file",
        format!(
            "The {what}: a vehicle file (TOML), {PLACES}; or a built-in {what} ({}). \
             Parameters that the host sets itself win over the file",
            V::BUILTIN.join(", ")
        ),
    )
}

/// The vehicle that `vehicle_file` names.
fn vehicle_named<V: VehicleParameters>(name: &str, context: &Context) -> Result<V, ModelError> {
    if name.is_empty() {
        let (kind, builtin) = (V::KIND, V::BUILTIN.join(", "));
        return Err(failed(format!(
            "vehicle_file is empty; name a vehicle file, or a built-in {kind}: {builtin}"
        )));
    }
    V::named(name, |name| context.locate(name)).map_err(failed)
}

fn failed(error: impl std::fmt::Display) -> ModelError {
    ModelError::Failed(error.to_string())
}
