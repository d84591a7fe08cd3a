//! A kind of vehicle, as its controller's FMU needs it: names, inputs, and the groups of parameters that a user sets.

use crate::control::{ControlledParameters, ControllerParametersFor, Measurement};
use crate::parameter::{Parameter, ParameterGroup};
use crate::signal::{self, Signal};
use crate::vehicle::VehicleParameters;

/// A signal that the controller is told, and where it stands in what it is told.
pub type ControllerInput = (&'static Signal, fn(&mut Measurement) -> &mut f64);

/// Inputs of any controller; a car's has no others.
pub const TOLD_OF_A_BODY: [ControllerInput; 7] = [
    (&signal::X, |measured| &mut measured.x),
    (&signal::Y, |measured| &mut measured.y),
    (&signal::YAW, |measured| &mut measured.yaw),
    (&signal::VX, |measured| &mut measured.vx),
    (&signal::VY, |measured| &mut measured.vy),
    (&signal::YAW_RATE, |measured| &mut measured.yaw_rate),
    (&signal::STEER, |measured| &mut measured.steer),
];

/// A group of parameters, whichever it is.
pub trait ParameterValues {
    /// The declarations, in order.
    fn table(&self) -> &'static [Parameter];
    /// The value at a position of the table.
    fn get(&self, index: usize) -> f64;
    /// Sets the value at a position of the table, unchecked.
    fn set(&mut self, index: usize, value: f64);
}

impl<G: ParameterGroup> ParameterValues for G {
    fn table(&self) -> &'static [Parameter] {
        G::table()
    }

    fn get(&self, index: usize) -> f64 {
        ParameterGroup::get(self, index)
    }

    fn set(&mut self, index: usize, value: f64) {
        ParameterGroup::set(self, index, value);
    }
}

/// The parameters of a kind of vehicle with `S` states, as its controller's FMU needs them.
pub trait ControllerUnit<const S: usize>: ControlledParameters<S> + ParameterGroup + Send + 'static {
    /// FMI `modelName`.
    const NAME: &'static str;
    /// One sentence.
    const DESCRIPTION: &'static str;
    /// Word for such a vehicle.
    const WHAT: &'static str;
    /// Inputs of the controller.
    const INPUTS: &'static [ControllerInput];
    /// Steps of the prediction that are outputs; longer horizons are allowed.
    const SHOWN: usize;

    /// Contents of a vehicle's file.
    type File: VehicleParameters;

    /// Start values of the parameters: those for the vehicle that `vehicle_file` starts with.
    fn defaults() -> ControllerParametersFor<Self> {
        let names = <Self::File as VehicleParameters>::BUILTIN;
        let vehicle = <Self::File as VehicleParameters>::builtin(names[0]);
        Self::of_file(&vehicle.expect("the built-in vehicles are read in a test"))
    }

    /// The parameters for a vehicle.
    fn of_file(file: &Self::File) -> ControllerParametersFor<Self>;
    /// The groups that a user sets, in the order of the FMU's variables.
    fn groups(parameters: &mut ControllerParametersFor<Self>) -> Vec<&mut dyn ParameterValues> {
        let ControllerParametersFor {
            vehicle,
            mpc,
            speed,
            longitudinal,
            observer,
            actuator,
            nmpc,
            guard,
            axles: _,
        } = parameters;
        vec![vehicle, mpc, speed, longitudinal, observer, actuator, nmpc, guard]
    }
}
