//! `RflMpc`: the car's controller as an FMU.

use super::controller::{ControllerFmu, ControllerInput, ControllerUnit, TOLD_OF_A_BODY};
use crate::control::{ControllerParameters, NominalVehicle, SHOWN_HORIZON};
use crate::nominal::ERRORS;
use crate::vehicle::CarParameters;

/// The FMU's model.
pub type RflMpc = ControllerFmu<NominalVehicle, ERRORS>;

impl ControllerUnit<ERRORS> for NominalVehicle {
    const NAME: &'static str = "RflMpc";
    const DESCRIPTION: &'static str = "Path-tracking model predictive controller of a passenger car: steering by an \
                                       error-state MPC with curvature preview, speed by a plan within acceleration \
                                       limits";
    const WHAT: &'static str = "car";
    const INPUTS: &'static [ControllerInput] = &TOLD_OF_A_BODY;
    const SHOWN: usize = SHOWN_HORIZON;

    type File = CarParameters;

    fn of_file(car: &CarParameters) -> ControllerParameters {
        ControllerParameters::for_car(car)
    }
}
