//! One drive of the ensemble: a vehicle with its differences from its model, a road, a speed, noise; and the drive's
//! cost.
//!
//! ```text
//! J = max |e1| + rms e1 + 0.05 s * rms of the command's rate           of a drive to the road's end, m
//! J = 10 m * (2 - share of the time that was driven)                   of a lost one
//! ```
//!
//! A drive is lost if the vehicle is 2 m off the road, rolls over, jack-knifes or makes no progress. A later loss costs
//! less: a search needs such differences.

use super::axis::{ControllerNumbers, NotSet};
use crate::control::{
    ControlStatus, ControllerError, ControllerFor, ControllerParametersFor, PredictionModelFor,
};
use crate::nominal::Actuator;
use crate::path::Path;
use crate::simulate::experiment::{Compared, NominalOf};
use crate::simulate::{ClosedLoopFor, DriveError, SensorNoise};
use serde::Serialize;
use std::sync::Arc;

/// Lateral error from which on a drive is lost, m.
pub const LOST_AT: f64 = 2.0;
/// Cost of a drive that is lost at its end, m.
pub const LOST_COST: f64 = 10.0;
/// Cost of roughness, m for each rad/s.
const ROUGHNESS: f64 = 0.05;
/// Time without progress beyond which a drive is lost, in times of the plan's; and in s.
const PATIENCE: (f64, f64) = (2.0, 30.0);

/// A drive to be made.
pub struct Scenario<P: Compared<S, C>, const S: usize, const C: usize> {
    /// Description, in a few words.
    pub name: String,
    /// The vehicle as in its file: the controller's knowledge.
    pub vehicle: P::Parameters,
    /// Differences of the vehicle from its file.
    pub effects: P::Effects,
    /// All of the vehicle's steering: its file's and the effects'.
    pub actuator: Actuator,
    /// The road.
    pub path: Arc<Path>,
    /// The controller, except for the searched numbers.
    pub controller: ControllerParametersFor<P::Nominal>,
    /// Prediction model.
    pub model: PredictionModelFor<NominalOf<P, S, C>, S>,
    /// Noise of the sensors and its seed.
    pub noise: Option<(SensorNoise, u64)>,
}

/// Result of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScenarioResult {
    /// Objective of the search, m.
    pub cost: f64,
    /// Largest lateral error, m.
    pub max: f64,
    /// Mean of its magnitude, m.
    pub mean: f64,
    /// Its root mean square, m.
    pub rms: f64,
    /// Root mean square of the command's rate, rad/s.
    pub roughness: f64,
    /// True if the vehicle was lost.
    pub lost: bool,
    /// Share of the planned time that was driven.
    pub driven: f64,
    /// Given up because it could no longer win: the figures are those until then.
    pub given_up: bool,
    /// Share of the time in which the learned model was faded out.
    pub faded: f64,
}

/// Reasons for which a drive cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ScenarioError {
    #[error(transparent)]
    Value(#[from] NotSet),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error("{0}")]
    Vehicle(Box<dyn std::error::Error + Send + Sync>),
    #[error(transparent)]
    Margins(#[from] crate::control::MarginError),
}

impl<P: Compared<S, C>, const S: usize, const C: usize> Scenario<P, S, C> {
    /// The controller with these numbers.
    ///
    /// # Errors
    /// A value out of its range.
    pub fn controller_with(
        &self,
        values: &ControllerNumbers,
    ) -> Result<ControllerParametersFor<P::Nominal>, NotSet> {
        let mut parameters = self.controller;
        values.apply::<P::Nominal, S>(&mut parameters)?;
        Ok(parameters)
    }

    /// Drives with these numbers of the controller; gives up as soon as the cost exceeds `bound`.
    ///
    /// # Errors
    /// Parameters out of range, a model that does not fit.
    pub fn drive(&self, values: &ControllerNumbers, bound: f64) -> Result<ScenarioResult, ScenarioError> {
        let parameters = self.controller_with(values)?;
        let step = parameters.mpc.sample_time;
        let controller = ControllerFor::predicting_with(parameters, self.path.clone(), self.model.clone())?;
        let planned = controller.speed_plan().duration().max(step);
        let mut closed = ClosedLoopFor::<P, S, C>::at_start(controller, &self.vehicle, &self.effects, step)
            .map_err(|error| ScenarioError::Vehicle(Box::new(error)))?;
        if let Some((noise, seed)) = self.noise {
            closed = closed.with_noise(noise, seed);
        }
        let steps = ((PATIENCE.0 * planned + PATIENCE.1) / step) as usize;
        let mut sums = DriveSums::default();
        let mut before = None;
        let (mut finished, mut given_up) = (false, false);
        for _ in 0..steps {
            match closed.advance() {
                Ok(_) => (),
                // Rolled over, jack-knifed: lost, as whoever leaves the road.
                Err(DriveError::Vehicle { .. } | DriveError::Controller { .. }) => break,
            }
            let report = closed.controller().report();
            let rate = before.map_or(0.0, |before| (report.steer_cmd - before) / step);
            before = Some(report.steer_cmd);
            sums.add(closed.lateral_error(), rate, report.status == ControlStatus::ResidualFaded);
            finished = report.finished;
            given_up = sums.max > bound;
            if finished || given_up || sums.max > LOST_AT {
                break;
            }
        }
        let driven = (sums.count as f64 * step / planned).min(1.0);
        Ok(sums.outcome(driven, !finished && !given_up, given_up))
    }
}

/// Sums over a drive.
#[derive(Debug, Default)]
struct DriveSums {
    count: u32,
    max: f64,
    errors: f64,
    squares: f64,
    rates: f64,
    faded: u32,
}

impl DriveSums {
    fn add(&mut self, error: f64, rate: f64, faded: bool) {
        self.count += 1;
        self.faded += u32::from(faded);
        self.max = self.max.max(error.abs());
        self.errors += error.abs();
        self.squares += error * error;
        self.rates += rate * rate;
    }

    fn outcome(&self, driven: f64, lost: bool, given_up: bool) -> ScenarioResult {
        let count = f64::from(self.count.max(1));
        let (rms, roughness) = ((self.squares / count).sqrt(), (self.rates / count).sqrt());
        let cost = if lost { LOST_COST * (2.0 - driven) } else { self.max + rms + ROUGHNESS * roughness };
        let (mean, faded) = (self.errors / count, f64::from(self.faded) / count);
        ScenarioResult { cost, max: self.max, mean, rms, roughness, lost, driven, given_up, faded }
    }
}
