//! Does a learned model know the actuator? The vehicle's response to a step of the command, recorded and predicted.
//!
//! On a level plane the vehicle drives straight for longer than a window, then the command steps and is held. From the
//! state before that the model predicts the whole horizon without measurements:
//!
//! ```text
//! x_{j+1} = A(v_j) x_j + B(v_j) u_j + r(window of x, window of u, v_j)
//! ```
//!
//! Drives with their noise-like errors tell the mean prediction error. A step tells the error of the delay at a speed,
//! on which a tight controller depends.

use super::fit::FitMetrics;
use super::plant::TestPlant;
use super::trial::{TrialError, effects_of};
use super::vehicle::NominalOf;
use crate::control::ControlledVehicle;
use crate::nominal::{ErrorState, LateralVehicle};
use crate::residual::ResidualModelFor;
use crate::simulate::{DriveError, SimulatedVehicle};
use crate::vehicle::VehicleInput;
use nalgebra::SVector;

/// The step, rad.
const STEP: f64 = 0.02;

/// A recorded response; rows at the sample time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RecordedResponse<const S: usize> {
    /// Speed at the beginning, m/s.
    pub speed: f64,
    /// Rows before the step.
    before: usize,
    states: Vec<[f64; S]>,
    speeds: Vec<f64>,
    commands: Vec<f64>,
}

impl<const S: usize> RecordedResponse<S> {
    /// Records `window` rows straight on, and the step with `horizon` rows behind it.
    pub fn record<P: SimulatedVehicle<S, C>, const C: usize>(
        vehicle: &P::Parameters,
        plant: &TestPlant,
        sample_time: f64,
        speed: f64,
        (window, horizon): (usize, usize),
    ) -> Result<Self, TrialError> {
        let effects = effects_of::<P, S, C>(plant)?;
        let mut driven =
            P::make(vehicle, &effects, None).map_err(|error| TrialError::Vehicle(Box::new(error)))?;
        driven.place(0.0, 0.0, 0.0, speed);
        let mut response = Self { speed, before: window, states: vec![], speeds: vec![], commands: vec![] };
        for row in 0..=window + horizon {
            let at = driven.measured();
            // Errors to the straight ahead.
            let e1_rate = at.vx * at.yaw.sin() + at.vy * at.yaw.cos();
            let errors = ErrorState::new(at.y, e1_rate, at.yaw, at.yaw_rate);
            response.states.push(NominalOf::<P, S, C>::state(&errors, &at).into());
            response.speeds.push(at.vx);
            let steer_cmd = if row < window { 0.0 } else { STEP };
            response.commands.push(steer_cmd);
            let time = row as f64 * sample_time;
            driven.advance(&VehicleInput { steer_cmd, accel_cmd: 0.0 }, sample_time).map_err(|source| {
                TrialError::Drive(DriveError::Vehicle { time, vehicle: P::KIND, source })
            })?;
        }
        Ok(response)
    }

    /// Prediction of it by a model, and by the nominal one. The model's window is not longer than the record before the
    /// step.
    pub fn predicted_by<V: LateralVehicle<S>>(&self, model: &ResidualModelFor<V, S>) -> FitMetrics {
        let schema = model.schema();
        let window = schema.window;
        let (mut features, mut room) = (vec![0.0; model.features()], model.workspace());
        let mut states = self.states[..=self.before].to_vec();
        let mut nominal = SVector::from(states[self.before]);
        let mut sums = [[0.0_f64; S]; 3];
        let steps = self.states.len() - 1 - self.before;
        for row in self.before..self.before + steps {
            let (speed, command) = (self.speeds[row], self.commands[row]);
            let Ok(discrete) = schema.vehicle.model_at(speed.max(schema.min_model_speed)) else { break };
            let discrete = discrete.discretise(schema.sample_time);
            nominal = discrete.a * nominal + discrete.b * command;
            let window = row + 1 - window..row + 1;
            let (errors, road) = features.split_at_mut(S * schema.window);
            errors.copy_from_slice(states[window.clone()].as_flattened());
            road.copy_from_slice(&[speed, 0.0, 0.0]);
            model.coefficients(&features, &[], &mut room);
            let known = states[row + 1 - schema.regressors.states..=row].as_flattened();
            let residual = SVector::from(room.residual(&self.commands[window], known));
            let next = discrete.a * SVector::from(states[row]) + discrete.b * command + residual;
            states.push(next.into());
            for o in 0..S {
                let truth = self.states[row + 1][o];
                let mine = next[o] - truth;
                sums[0][o] += mine * mine;
                sums[1][o] = sums[1][o].max(mine.abs());
                sums[2][o] += (nominal[o] - truth).powi(2);
            }
        }
        let root = |sum: [f64; S]| sum.map(|sum| (sum / steps.max(1) as f64).sqrt()).to_vec();
        FitMetrics { rmse: root(sums[0]), max: sums[1].to_vec(), nominal_rmse: root(sums[2]) }
    }
}
