//! The controller's knowledge of a kind of vehicle: a car has its errors to the path alone, a truck its trailer too.
//!
//! Everything in this module is written for `S` states. Differences between vehicles stand here: the measurement of the
//! state, the cost of the further states, and the nonlinear model, if any.

use super::lateral::LateralError;
use super::parameters::{MpcParameters, NmpcParameters, NominalVehicle};
use super::step::Measurement;
use super::variant::{BicycleModel, Variant};
use crate::nominal::{ERRORS, ErrorState, LateralVehicle};
use crate::parameter::{OutOfRange, ParameterGroup};
use crate::path::Path;
use crate::residual::{FileError, FileKind};
use crate::vehicle::SingleTrack;
use nalgebra::SVector;
use std::convert::Infallible;
use std::sync::Arc;

/// A vehicle that the controller can drive.
pub trait ControlledVehicle<const S: usize>: LateralVehicle<S> {
    /// Model of the nonlinear variants; [`Infallible`], which has no values, for a vehicle without them.
    type Nonlinear: Nonlinear<Self, S>;

    /// The model's state from the errors to the path and the measurement that they are of.
    fn state(errors: &ErrorState, measurement: &Measurement) -> SVector<f64, S>;
}

/// Learned error of a vehicle's nonlinear model.
pub type GpOf<V, const S: usize> = <<V as ControlledVehicle<S>>::Nonlinear as Nonlinear<V, S>>::Gp;

/// A nonlinear model of a variant.
pub trait Nonlinear<V, const S: usize>: std::fmt::Debug + Clone + Send + Sync {
    /// The Gaussian process that corrects it; [`Infallible`] where there is none.
    type Gp: std::fmt::Debug + Clone + Send + Sync;

    /// The model by its parameters, with a learned process or without; none for a vehicle without nonlinear models.
    #[must_use]
    fn of(parameters: &NmpcParameters, gp: Option<Arc<Self::Gp>>) -> Option<Self>;

    /// A process from the bytes of its file.
    ///
    /// # Errors
    /// Bytes that are no process of such a vehicle.
    fn gp_from_bytes(bytes: &[u8]) -> Result<Self::Gp, FileError>;

    /// The variant for a vehicle.
    ///
    /// # Errors
    /// A parameter that is not positive; something learned that does not fit.
    fn variant(self, vehicle: V, parameters: &MpcParameters) -> Result<Box<dyn Variant<S>>, LateralError>;
}

impl<V: LateralVehicle<S>, const S: usize> Nonlinear<V, S> for Infallible {
    type Gp = Infallible;

    fn of(_: &NmpcParameters, _: Option<Arc<Infallible>>) -> Option<Self> {
        None
    }

    fn gp_from_bytes(_: &[u8]) -> Result<Infallible, FileError> {
        Err(FileError::NoneOfVehicle { found: FileKind::Gp, vehicle: V::KIND })
    }

    fn variant(self, _: V, _: &MpcParameters) -> Result<Box<dyn Variant<S>>, LateralError> {
        match self {}
    }
}

/// The user's parameters of a kind of vehicle: those of its model, and the cost of its further states.
pub trait ControlledParameters<const S: usize>: std::fmt::Debug + Copy + PartialEq {
    /// The vehicle that they are of.
    type Vehicle: ControlledVehicle<S>;

    /// The nominal model's vehicle.
    fn nominal(&self) -> Self::Vehicle;

    /// The states behind the four errors to the path, `S - 4` of them.
    fn further_states(&self) -> Vec<FurtherState>;

    /// A warning, if what the vehicle draws cannot follow it along a road; none for a vehicle that draws nothing.
    fn too_tight_behind(&self, _road: &Path) -> Option<String> {
        None
    }

    /// The least radius, m, from this one on, of a corner round which what the vehicle draws can follow it.
    fn least_radius_behind(&self, radius: f64) -> f64 {
        radius
    }

    /// Sets the parameter of a name; says whether there is one.
    ///
    /// # Errors
    /// A value out of its range; nothing has changed then.
    fn set_by_name(&mut self, name: &str, value: f64) -> Result<bool, OutOfRange>;

    /// Checks all values against their ranges.
    ///
    /// # Errors
    /// The first value out of range.
    fn check_all(&self) -> Result<(), OutOfRange>;
}

/// Cost, bound and noise of a state behind the errors to the path. Units are those of the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FurtherState {
    /// Weight of its squared deviation from that of steady cornering.
    pub weight: f64,
    /// Soft bound of its magnitude, if it has one.
    pub bound: Option<Bound>,
    /// Largest magnitude of the reference that steady cornering gives; 0 for a reference of zero.
    pub largest_reference: f64,
    /// Noise of its measurement (standard deviation).
    pub noise: f64,
    /// Unmodelled change of it in a step for each m/s of unmodelled lateral velocity.
    pub process_noise_gain: f64,
    /// Largest plausible disturbing acceleration, if it is a rate.
    pub largest_disturbance: f64,
}

/// A soft bound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Largest magnitude.
    pub max: f64,
    /// Weight of the squared excess.
    pub quadratic: f64,
    /// Weight of the excess.
    pub linear: f64,
}

impl ControlledVehicle<ERRORS> for SingleTrack {
    type Nonlinear = BicycleModel;

    fn state(errors: &ErrorState, _: &Measurement) -> ErrorState {
        *errors
    }
}

impl ControlledParameters<ERRORS> for NominalVehicle {
    type Vehicle = SingleTrack;

    fn nominal(&self) -> SingleTrack {
        self.single_track()
    }

    fn further_states(&self) -> Vec<FurtherState> {
        Vec::new()
    }

    fn set_by_name(&mut self, name: &str, value: f64) -> Result<bool, OutOfRange> {
        super::parameters::set(self, name, value)
    }

    fn check_all(&self) -> Result<(), OutOfRange> {
        ParameterGroup::check(self)
    }
}
