//! Our models as FMI units: their variables, and how a step of theirs becomes a step of the FMU.
//!
//! | file | FMU |
//! |---|---|
//! | `passenger_car.rs` | `PassengerCar`: the nonlinear car |
//! | `rfl_mpc.rs` | `RflMpc`: the car's controller |

mod passenger_car;
mod rfl_mpc;

pub use passenger_car::PassengerCar;
pub use rfl_mpc::{DEFAULT_PATH, MODELS, RflMpc};

use crate::fmi::{Context, Kind, ModelError, Variable};
use crate::vehicle::{BUILTIN, CarParameters, builtin};

/// The parameter by which both FMUs are told the car.
fn vehicle_file_parameter() -> Variable {
    Variable::parameter_of(
        Kind::String { start: BUILTIN[0].into() },
        "vehicle_file",
        format!(
            "The car: a vehicle file (TOML), absolute or in the FMU's resources, or a built-in car ({}). Parameters \
             that the host sets itself win over the file",
            BUILTIN.join(", ")
        ),
    )
}

/// The car that `vehicle_file` names.
fn vehicle_named(name: &str, context: &Context) -> Result<CarParameters, ModelError> {
    if BUILTIN.contains(&name) { builtin(name) } else { CarParameters::read(&context.locate(name)) }
        .map_err(failed)
}

fn failed(error: impl std::fmt::Display) -> ModelError {
    ModelError::Failed(error.to_string())
}
