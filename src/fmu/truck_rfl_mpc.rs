//! `TruckRflMpc`: the truck's controller as an FMU.

use super::controller::{ControllerFmu, ControllerInput, ControllerUnit, TOLD_OF_A_BODY};
use crate::control::{NominalTruck, TRUCK_STATES, TruckControllerParameters};
use crate::signal;
use crate::vehicle::TruckParameters;

/// The FMU's model.
pub type TruckRflMpc = ControllerFmu<NominalTruck, TRUCK_STATES>;

/// Inputs of the controller from the body, and the articulation.
const TOLD: [ControllerInput; TOLD_OF_A_BODY.len() + 2] = {
    let [x, y, yaw, vx, vy, yaw_rate, steer] = TOLD_OF_A_BODY;
    [
        x,
        y,
        yaw,
        vx,
        vy,
        yaw_rate,
        steer,
        (&signal::ARTICULATION, |measured| &mut measured.articulation),
        (&signal::ARTICULATION_RATE, |measured| &mut measured.articulation_rate),
    ]
};

impl ControllerUnit<TRUCK_STATES> for NominalTruck {
    const NAME: &'static str = "TruckRflMpc";
    const DESCRIPTION: &'static str = "Path-tracking model predictive controller of a tractor with a semi-trailer: \
                                       steering by an error-state MPC with curvature preview and a bound on the \
                                       articulation, speed and lag error by an MPC of their own";
    const WHAT: &'static str = "truck";
    const INPUTS: &'static [ControllerInput] = &TOLD;
    const SHOWN: usize = 60;

    type File = TruckParameters;

    fn of_file(truck: &TruckParameters) -> TruckControllerParameters {
        TruckControllerParameters::for_truck(truck)
    }
}
