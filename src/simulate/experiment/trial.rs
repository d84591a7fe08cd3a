//! One drive of the comparison: a plant, a way to predict, weights, noise and a seed.

use super::plant::TestPlant;
use super::vehicle::NominalOf;
use super::weights::CostWeights;
use crate::control::{ControllerError, ControllerFor, PredictionModelFor};
use crate::nominal::ERRORS;
use crate::path::Path;
use crate::simulate::{
    CAR_COLUMNS, ClosedLoopFor, DriveError, DriveFor, LaneLimits, SensorNoise, SimulatedVehicle,
};
use crate::vehicle::Car;
use std::sync::Arc;

/// Reasons for which a drive could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum TrialError {
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error("{0}")]
    Vehicle(Box<dyn std::error::Error + Send + Sync>),
    #[error("the plant has the effect {id}, and a {vehicle} has none of that name")]
    NoEffect { id: &'static str, vehicle: &'static str },
    #[error(transparent)]
    Drive(#[from] DriveError),
}

/// A drive of a car to be made.
pub type Trial<'a> = TrialFor<'a, Car, ERRORS, CAR_COLUMNS>;

/// A drive to be made.
#[allow(missing_docs)]
pub struct TrialFor<'a, P: SimulatedVehicle<S, C>, const S: usize, const C: usize> {
    pub vehicle: &'a P::Parameters,
    pub plant: &'a TestPlant,
    pub path: Arc<Path>,
    pub model: PredictionModelFor<NominalOf<P, S, C>, S>,
    pub weights: CostWeights,
    /// Noise of the sensors and its seed.
    pub noise: Option<(SensorNoise, u64)>,
    /// Lateral error at which the drive is given up, m.
    pub give_up: f64,
    /// Steering dither, rad, and its seed: for collecting.
    pub dither: Option<(f64, usize)>,
}

/// Lateral error at which a drive is given up, m: the controller gives up tracking there.
pub const LOST: f64 = 3.5;

/// The effects that make a plant.
pub(super) fn effects_of<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>(
    plant: &TestPlant,
) -> Result<P::Effects, TrialError> {
    let mut effects = P::Effects::default();
    for &(id, value) in plant.effects.iter() {
        *P::effect(&mut effects, id).ok_or(TrialError::NoEffect { id, vehicle: P::KIND })? = value;
    }
    Ok(effects)
}

impl<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> TrialFor<'_, P, S, C> {
    /// Drives until the road's end, or until the vehicle is lost: given up, rolled over or jack-knifed.
    ///
    /// # Errors
    /// Parameters out of range, a model that does not fit.
    pub fn drive(&self) -> Result<DriveFor<C>, TrialError> {
        let mut parameters = P::controller_of_the_papers(self.vehicle);
        self.weights.apply(&mut parameters);
        if let Some((amplitude, seed)) = self.dither {
            (parameters.mpc.dither, parameters.mpc.dither_seed) = (amplitude, seed);
        }
        let step = parameters.mpc.sample_time;
        let controller = ControllerFor::predicting_with(parameters, self.path.clone(), self.model.clone())?;
        let effects = effects_of::<P, S, C>(self.plant)?;
        let mut closed = ClosedLoopFor::<P, S, C>::at_start(controller, self.vehicle, &effects, step)
            .map_err(|error| TrialError::Vehicle(Box::new(error)))?;
        // The comparison's own bound: far beyond the lane, what a row does on its way back still counts.
        closed = closed.with_limits(LaneLimits { lateral_error: LOST, ..LaneLimits::default() });
        if let Some((noise, seed)) = self.noise {
            closed = closed.with_noise(noise, seed);
        }
        // Twice the time that the plan takes.
        let duration = 60.0 + 0.5 * self.path.length();
        Ok(closed.drive_until_lost(duration, |_, error| error.abs() < self.give_up)?)
    }
}
