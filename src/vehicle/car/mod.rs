//! The two-track car: 14 degrees of freedom, transient tyres, drive, brakes and air.
//!
//! State (36 numbers): pose and velocities in the plane of the road (6), and roll, pitch and heave of the body (6).
//! Each wheel has its spin, two deflections of the tyre, its vertical motion (2), and the wind-up of its brake.
//!
//! | file | idea |
//! |---|---|
//! | `plant.rs` | the constants of one car with its effects |
//! | `dynamics.rs` | the equations of motion: one unit (`unit/`) in the air |
//! | `output.rs` | measured signals |
//! | `reduced.rs` | fast motions |

mod dynamics;
mod error;
mod output;
mod plant;
mod reduced;

use super::effects::Effects;
use super::parameters::CarParameters;
use super::reduced::{Reduced, ReducedVehicle};
use super::stepper::{PlantStepError, RestoreError, Stepper, VehicleInput, vehicle};
use super::tyre::{Coefficients, TyreModel};
use crate::path::Path;
pub use error::CarError;
use output::SIGNALS;
pub use output::{CarOutput, CarStatus};
use plant::{CarPlant, STATES};
use std::sync::Arc;

/// Inputs of the car, from a driver or a controller.
pub type CarInput = VehicleInput;

/// The car on the tyres of its files.
pub type Car = CarFor<Coefficients>;

/// The car on tyres of a formula.
pub struct CarFor<T: TyreModel> {
    stepper: Stepper<CarPlant<T>, STATES, SIGNALS>,
}

impl Car {
    /// A car at rest at the origin, heading east.
    ///
    /// # Errors
    /// Parameters or effects out of range, a CG outside the wheelbase.
    pub fn new(
        parameters: &CarParameters,
        effects: &Effects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, CarError> {
        // Only what was read has tyres.
        parameters.check()?;
        Self::of_checked(parameters, parameters.tyres(), effects, road)
    }
}

impl<T: TyreModel> CarFor<T> {
    /// The same on tyres of one's own, on the front and rear axle. Of the file's tyres the compliance alone counts.
    ///
    /// # Errors
    /// As [`new`](Car::new).
    pub fn with_tyres(
        parameters: &CarParameters,
        tyres: [T; 2],
        effects: &Effects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, CarError> {
        parameters.check()?;
        Self::of_checked(parameters, tyres, effects, road)
    }

    fn of_checked(
        parameters: &CarParameters,
        tyres: [T; 2],
        effects: &Effects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, CarError> {
        effects.check()?;
        Ok(Self { stepper: Stepper::new(CarPlant::new(parameters, tyres, effects)?, road) })
    }
}

vehicle!(CarFor<T>, CarOutput, Stepper<CarPlant<T>, STATES, SIGNALS>);

/// The car without its fast motions. Effects need not be in range (a delay may be negative where the car has one of its
/// own). The sensors' latency is left to the caller.
///
/// # Errors
/// A CG outside the wheelbase.
pub fn reduced(parameters: &CarParameters, effects: &Effects) -> Result<Box<dyn ReducedVehicle>, CarError> {
    Ok(Box::new(Reduced::new(CarPlant::new(parameters, parameters.tyres(), effects)?)))
}
