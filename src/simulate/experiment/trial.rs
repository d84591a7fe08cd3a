//! One drive of the comparison: a plant, a way to predict, weights, noise and a seed.

use super::plant::Plant;
use super::weights::Weights;
use crate::control::{Controller, ControllerError, ControllerParameters, PredictionModel};
use crate::path::Path;
use crate::simulate::{ClosedLoop, Drive, DriveError, SensorNoise};
use crate::vehicle::CarParameters;
use crate::vehicle::car::CarError;
use std::sync::Arc;

/// Why a drive could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum TrialError {
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error(transparent)]
    Car(#[from] CarError),
    #[error(transparent)]
    Drive(#[from] DriveError),
}

/// A drive to be made.
#[derive(Clone)]
#[allow(missing_docs)]
pub struct Trial<'a> {
    pub car: &'a CarParameters,
    pub plant: Plant,
    pub path: Arc<Path>,
    pub model: PredictionModel,
    pub weights: Weights,
    /// Noise of the sensors and its seed.
    pub noise: Option<(SensorNoise, u64)>,
    /// Steering dither, rad, and its seed: for collecting.
    pub dither: Option<(f64, usize)>,
}

/// Lateral error at which a drive is given up, m: the controller gives up tracking at 3.5 m.
const LOST: f64 = 3.5;

impl Trial<'_> {
    /// Drives until the road's end, or until the car is lost.
    ///
    /// # Errors
    /// Parameters out of range, a model that does not fit.
    pub fn drive(&self) -> Result<Drive, TrialError> {
        let mut parameters = ControllerParameters::for_car(self.car);
        self.weights.apply(&mut parameters);
        if let Some((amplitude, seed)) = self.dither {
            (parameters.mpc.dither, parameters.mpc.dither_seed) = (amplitude, seed);
        }
        let step = parameters.mpc.sample_time;
        let controller = Controller::predicting_with(parameters, self.path.clone(), self.model.clone())?;
        let mut closed = ClosedLoop::at_start(controller, self.car, &self.plant.effects(), step)?;
        if let Some((noise, seed)) = self.noise {
            closed = closed.with_noise(noise, seed);
        }
        // Twice the time that the plan takes.
        let duration = 60.0 + 0.5 * self.path.length();
        Ok(closed.drive_while(duration, |_, error| error.abs() < LOST)?)
    }
}
