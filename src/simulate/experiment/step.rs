//! Identification by a step, an engineer's remedy for a known delay: the steering steps, the road-wheel angle is
//! recorded. Dead time and lag, an inertia or a Pade approximant are fitted to the record (`nominal/identify.rs`).
//!
//! All delay models are identified from the same record; none knows the true plant.

use super::plant::TestPlant;
use super::trial::{TrialError, effects_of};
use crate::nominal::{DelayModel, IdentifiedActuator, IdentifyError, SteeringRecord};
use crate::simulate::{DriveError, SimulatedVehicle};
use crate::vehicle::VehicleInput;
use serde::Serialize;

/// A recorded step of the steering; each row is measured before its command acts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SteeringStep {
    /// Time, s.
    pub time: Vec<f64>,
    /// Command, rad.
    pub command: Vec<f64>,
    /// Road-wheel angle, rad.
    pub angle: Vec<f64>,
}

/// Identification of the actuator from a record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identified {
    /// The row that is told.
    pub row: &'static str,
    /// Dead time, s.
    pub dead_time: f64,
    /// Time constant of the lag, s.
    pub time_constant: f64,
    /// Root of the mean squared error of the angle, rad.
    pub rmse: f64,
}

/// Speed of the vehicle, m/s: that of a bend.
const SPEED: f64 = 8.0;
/// The step, rad, when it comes and when the record ends, s.
const STEP: f64 = 0.05;
/// See [`STEP`].
const BEGINS: f64 = 0.5;
/// See [`STEP`].
const ENDS: f64 = 4.0;

impl SteeringStep {
    /// Records one of a plant on a level plane.
    ///
    /// # Errors
    /// A vehicle that cannot be made, or cannot go on.
    pub fn record<P: SimulatedVehicle<S, C>, const S: usize, const C: usize>(
        vehicle: &P::Parameters,
        plant: &TestPlant,
        sample_time: f64,
    ) -> Result<Self, TrialError> {
        let effects = effects_of::<P, S, C>(plant)?;
        let mut driven =
            P::make(vehicle, &effects, None).map_err(|error| TrialError::Vehicle(Box::new(error)))?;
        driven.place(0.0, 0.0, 0.0, SPEED);
        let mut step = Self { time: vec![], command: vec![], angle: vec![] };
        for k in 0..(ENDS / sample_time).round() as u32 {
            let time = f64::from(k) * sample_time;
            let steer_cmd = if time < BEGINS { 0.0 } else { STEP };
            step.time.push(time);
            step.command.push(steer_cmd);
            step.angle.push(driven.measured().steer);
            driven.advance(&VehicleInput { steer_cmd, accel_cmd: 0.0 }, sample_time).map_err(|source| {
                TrialError::Drive(DriveError::Vehicle { time, vehicle: P::KIND, source })
            })?;
        }
        Ok(step)
    }

    /// Fits an actuator.
    ///
    /// # Errors
    /// A record that shows none.
    pub fn identify(&self, model: DelayModel) -> Result<IdentifiedActuator, IdentifyError> {
        SteeringRecord::new(&self.time, &self.command, &self.angle)?.identify(model)
    }
}
