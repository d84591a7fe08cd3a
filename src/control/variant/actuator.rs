//! The nominal linear model behind a steering actuator. The actuator is known (with its true constants, the oracle), or
//! a bank of hypotheses finds it while driving.
//!
//! Lag, dead time and their approximants are one form (`nominal/actuator.rs`). The actuator's states are not measured:
//! the actuator is run over the issued commands.

use super::{ExpectedState, Nominal, Qp, Variant, effect_of_bank};
use crate::control::condense::CommandResponse;
use crate::control::lateral::LateralInput;
use crate::control::parameters::MpcParameters;
use crate::control::preview::Preview;
use crate::control::tracking_qp::{QpError, QpReport};
use crate::nominal::{ActuatedModel, ActuatedState, Actuator, LateralVehicle};
use nalgebra::SVector;
use std::time::Instant;

/// The variant.
pub struct Actuated<V, const S: usize> {
    nominal: Nominal<V>,
    actuator: Actuator,
    response: CommandResponse<ActuatedState<S>>,
    known: Vec<ActuatedState<S>>,
    window: usize,
    model: Option<ActuatedModel<S>>,
}

impl<V: LateralVehicle<S>, const S: usize> Actuated<V, S> {
    /// The actuator, if a step brings no other; `slowest` is the one that looks back farthest.
    pub fn new(vehicle: V, p: &MpcParameters, actuator: Actuator, slowest: Actuator) -> Self {
        let window = [actuator, slowest].map(|actuator| {
            // The newest command, those of the dead time, and one more for a dead time that is no whole number of steps.
            actuator.delay(p.sample_time).0 + 2 + (actuator.memory() / p.sample_time).ceil() as usize
        });
        Self {
            nominal: Nominal::new(vehicle, p),
            actuator,
            response: CommandResponse::new(p.horizon),
            known: vec![ActuatedState::zeros(); p.horizon],
            window: window[0].max(window[1]),
            model: None,
        }
    }
}

impl<V: LateralVehicle<S>, const S: usize> Variant<S> for Actuated<V, S> {
    fn plan(
        &mut self,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        previous: f64,
        qp: &mut Qp,
    ) -> Result<QpReport, QpError> {
        let begin = Instant::now();
        self.look(input, preview, previous)?;
        let Some(model) = &self.model else { return Err(QpError::Numerical { iterations: 0 }) };
        let all = input.history.commands();
        let start = model.state(input.state, all);
        self.response.condense(
            &model.a,
            [&model.newer, &model.older],
            model.delay,
            &start,
            &self.known,
            |back| all[all.len() - back],
            &qp.tracked,
            &mut qp.problem,
        );
        let steady = self.nominal.vehicle.steady_state(input.ahead.speed);
        qp.refer(|j| steady * preview.curvature[j]);
        qp.timing.condense = begin.elapsed().as_secs_f64();
        qp.solve(input.time_limit)
    }

    fn look(&mut self, input: &LateralInput<'_, S>, preview: &Preview, _: f64) -> Result<(), QpError> {
        let nominal = self.nominal.at(input.ahead.speed)?;
        let actuator = input.actuator.unwrap_or(self.actuator);
        let model = actuator.discretise(&nominal, self.nominal.sample_time);
        let disturbance = ActuatedState::from(*input.disturbance);
        let banked = effect_of_bank(&nominal.a, &model.a.vehicle, self.nominal.sample_time);
        for (j, known) in self.known.iter_mut().enumerate() {
            *known = model.d * preview.heading_rate[j] + model.e * preview.heading_accel[j] + disturbance;
            if preview.bank_accel[j] != 0.0 {
                *known += ActuatedState::from(banked * preview.bank_accel[j]);
            }
        }
        self.model = Some(model);
        Ok(())
    }

    fn next_state(&self, state: &SVector<f64, S>, past: &[f64], steer: f64) -> Option<ExpectedState<S>> {
        let model = self.model.as_ref()?;
        let back = |steps: usize| if steps == 0 { steer } else { past[past.len() - steps] };
        let next = &model.a * &model.state(state, past)
            + model.newer * back(model.delay)
            + model.older * back(model.delay + 1)
            + self.known[0];
        Some(ExpectedState { state: next.vehicle, transition: model.a.vehicle })
    }

    fn window(&self) -> usize {
        self.window
    }
}
