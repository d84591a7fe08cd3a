//! The tractor with its semi-trailer: 16 degrees of freedom beside the wheels' spins, transient tyres on three axle
//! groups, fifth wheel, drive, brakes and air.
//!
//! State (57 numbers): pose and velocities of the tractor in the plane of the road (6), and roll, pitch and heave of
//! its body (6). Yaw, roll, pitch and heave of the semi-trailer (8), whose place and velocities follow from the hitch;
//! the wind-up of the fifth wheel's friction. For each side of an axle group the six states of a wheel.
//!
//! | file | idea |
//! |---|---|
//! | `plant.rs` | the constants of one truck with its effects |
//! | `hitch.rs` | the fifth wheel: the force that keeps both units together |
//! | `dynamics.rs` | the equations of motion: two units (`unit/`), the hitch, the air |
//! | `output.rs` | measured signals |
//! | `reduced.rs` | fast motions |
//! | `conservation.rs` | tests: conservation by hitch and equations |

#[cfg(test)]
mod conservation;
mod dynamics;
mod error;
mod hitch;
mod output;
mod plant;
mod reduced;

use super::effects::TruckEffects;
use super::reduced::{Reduced, ReducedVehicle};
use super::stepper::{PlantStepError, RestoreError, Stepper, VehicleInput, vehicle};
use super::truck_parameters::TruckParameters;
use super::tyre::{Coefficients, TyreModel};
use crate::path::Path;
pub use error::TruckError;
use output::SIGNALS;
pub use output::{TrailerOutput, TruckOutput, TruckStatus};
use plant::{STATES, TruckPlant};
use std::sync::Arc;

/// Inputs of the truck, from a driver or a controller.
pub type TruckInput = VehicleInput;

/// The truck on the tyres of its files.
pub type Truck = TruckFor<Coefficients>;

/// The truck on tyres of a formula.
pub struct TruckFor<T: TyreModel> {
    stepper: Stepper<TruckPlant<T>, STATES, SIGNALS>,
}

impl Truck {
    /// A truck at rest at the origin, heading east, the semi-trailer straight behind.
    ///
    /// # Errors
    /// Parameters or effects out of range, an axle without load.
    pub fn new(
        parameters: &TruckParameters,
        effects: &TruckEffects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, TruckError> {
        // Only what was read has tyres.
        parameters.check()?;
        Self::of_checked(parameters, parameters.tyres(), effects, road)
    }
}

impl<T: TyreModel> TruckFor<T> {
    /// The same on tyres of one's own, on the front, rear and trailer axle. Of the file's tyres the compliance alone counts.
    ///
    /// # Errors
    /// As [`new`](Truck::new).
    pub fn with_tyres(
        parameters: &TruckParameters,
        tyres: [T; 3],
        effects: &TruckEffects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, TruckError> {
        parameters.check()?;
        Self::of_checked(parameters, tyres, effects, road)
    }

    fn of_checked(
        parameters: &TruckParameters,
        tyres: [T; 3],
        effects: &TruckEffects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, TruckError> {
        effects.check()?;
        Ok(Self { stepper: Stepper::new(TruckPlant::new(parameters, tyres, effects)?, road) })
    }
}

vehicle!(TruckFor<T>, TruckOutput, Stepper<TruckPlant<T>, STATES, SIGNALS>);

/// The truck without its fast motions; effects need not be in range, and the sensors' latency is left to the caller.
///
/// # Errors
/// An axle without load.
pub fn reduced(
    parameters: &TruckParameters,
    effects: &TruckEffects,
) -> Result<Box<dyn ReducedVehicle>, TruckError> {
    Ok(Box::new(Reduced::new(TruckPlant::new(parameters, parameters.tyres(), effects)?)))
}
