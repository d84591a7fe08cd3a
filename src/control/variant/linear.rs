//! The nominal linear model, with or without a learned residual.
//!
//! Roll the nominal model out with the curvature ahead, ask the learned residual (if there is one) at each step of the
//! roll-out, condense, solve.
//!
//! Source: Zhao et al., ITSC 2024, Algorithm 1.

use super::{Expected, Nominal, Qp, Variant};
use crate::control::condense::{Affine, Linear, Propagation, condense};
use crate::control::lateral::LateralInput;
use crate::control::parameters::MpcParameters;
use crate::control::preview::Preview;
use crate::control::solve::solve;
use crate::control::tracking_qp::{QpError, QpReport};
use crate::enumeration;
use crate::nominal::{DiscreteErrorModel, ERRORS, LateralVehicle};
use crate::residual::{self, Coefficients, Misfit, ResidualModelFor};
use crate::vehicle::SingleTrack;
use nalgebra::{SMatrix, SVector};
use std::sync::Arc;
use std::time::Instant;

enumeration! {
    /// With which model the states are predicted at which the residual is asked.
    pub enum RollOut {
        Nominal = 0 "nominal", "The nominal model, as in Zhao et al.";
        Corrected = 1 "corrected", "The nominal model with the residual";
    }
}

/// A learned residual and how it is used.
#[derive(Debug, Clone)]
#[allow(missing_docs)]
pub struct Residual<V = SingleTrack, const S: usize = ERRORS> {
    pub model: Arc<ResidualModelFor<V, S>>,
    pub propagation: Propagation,
    pub roll_out: RollOut,
}

/// The learned residual with room for its use.
struct Learned<V, const S: usize> {
    residual: Residual<V, S>,
    room: Coefficients<S>,
    features: Vec<f64>,
    /// Measured states and then predicted ones, oldest first.
    states: Vec<SVector<f64, S>>,
    /// Issued commands and then planned ones, oldest first.
    commands: Vec<f64>,
}

/// The variant.
pub struct NominalWithResidual<V, const S: usize> {
    nominal: Nominal<V>,
    learned: Option<Learned<V, S>>,
    affine: Affine<SVector<f64, S>>,
    /// What the newest prediction was made with.
    model: Option<DiscreteErrorModel<S>>,
    outside: f64,
}

impl<V: LateralVehicle<S>, const S: usize> NominalWithResidual<V, S> {
    /// # Errors
    /// A residual that was learned for another controller.
    pub fn new(vehicle: V, p: &MpcParameters, residual: Option<Residual<V, S>>) -> Result<Self, Misfit> {
        let learned = residual.map(|residual| Learned::new(residual, &vehicle, p)).transpose()?;
        let window = learned.as_ref().map_or(0, Learned::window);
        Ok(Self {
            nominal: Nominal::new(vehicle, p),
            learned,
            affine: Affine::new(p.horizon, window),
            model: None,
            outside: 0.0,
        })
    }

    /// Fills the affine part of the prediction: the road, the disturbance, the residual at each step of a roll-out.
    fn predict(
        &mut self,
        model: &DiscreteErrorModel<S>,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        previous: f64,
    ) {
        for (j, known) in self.affine.known.iter_mut().enumerate() {
            *known =
                model.d * preview.heading_rate[j] + model.e * preview.heading_accel[j] + input.disturbance;
        }
        self.outside = 0.0;
        let Some(learned) = &mut self.learned else { return };
        if !input.use_residual {
            self.affine.constant.fill(SVector::zeros());
            self.affine.command.fill(SVector::zeros());
            return;
        }
        self.outside = learned.roll_out(model, input, previous, preview, &mut self.affine);
    }

    /// The state to be reached: that of steady cornering, by the corrected model where there is a correction.
    fn write_references(
        &self,
        model: &DiscreteErrorModel<S>,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        qp: &mut Qp,
    ) {
        let steady = self.nominal.vehicle.steady_state(input.ahead.speed);
        let corrected = self.affine.window > 0 || *input.disturbance != SVector::<f64, S>::zeros();
        qp.refer(|j| {
            let target = if corrected { self.steady_target(model, j) } else { None };
            target.unwrap_or(steady * preview.curvature[j])
        });
    }

    /// State at which the corrected model of step `j` stays on the path with a constant command:
    /// `x = A x + B u + w + c + sum beta u` with `e1 = 0`, an equation for each other state and for `u`.
    fn steady_target(&self, model: &DiscreteErrorModel<S>, j: usize) -> Option<SVector<f64, S>> {
        let input: SVector<f64, S> = model.b + self.affine.commands_of(j).iter().sum::<SVector<f64, S>>();
        let mut matrix = SMatrix::identity() - model.a;
        // In the place of e1 stands u.
        matrix.set_column(0, &-input);
        let known = self.affine.known[j] + self.affine.constant[j];
        solve(matrix, known)
    }
}

impl<V: LateralVehicle<S>, const S: usize> Variant<S> for NominalWithResidual<V, S> {
    fn plan(
        &mut self,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        previous: f64,
        qp: &mut Qp,
    ) -> Result<QpReport, QpError> {
        let begin = Instant::now();
        let model = self.nominal.at(input.ahead.speed)?;
        let model = model.discretise(self.nominal.sample_time);
        self.predict(&model, input, preview, previous);
        qp.timing.look_up = begin.elapsed().as_secs_f64();

        let past = if self.affine.window == 0 { &[] } else { input.history.commands() };
        let propagation =
            self.learned.as_ref().map_or(Propagation::default(), |learned| learned.residual.propagation);
        let linear = Linear { a: &model.a, b: &model.b };
        condense(linear, input.state, &mut self.affine, past, propagation, &qp.tracked, &mut qp.problem);
        self.write_references(&model, input, preview, qp);
        qp.timing.condense = begin.elapsed().as_secs_f64() - qp.timing.look_up;
        self.model = Some(model);
        qp.solve(input.time_limit)
    }

    fn next_state(&self, state: &SVector<f64, S>, past: &[f64], steer: f64) -> Option<Expected<S>> {
        let model = self.model.as_ref()?;
        let mut next = model.a * state + model.b * steer + self.affine.known[0];
        if self.affine.window > 0 {
            next += self.affine.constant[0];
            for (effect, command) in self.affine.commands_of(0).iter().zip(past.iter().chain([&steer])) {
                next += effect * *command;
            }
        }
        Some(Expected { state: next, transition: model.a })
    }

    fn window(&self) -> usize {
        self.affine.window
    }

    fn outside_training(&self) -> f64 {
        self.outside
    }
}

impl<V: LateralVehicle<S>, const S: usize> Learned<V, S> {
    fn new(residual: Residual<V, S>, vehicle: &V, p: &MpcParameters) -> Result<Self, Misfit> {
        let model = &residual.model;
        model.check_fits(&residual::Expected {
            vehicle: *vehicle,
            sample_time: p.sample_time,
            min_model_speed: p.min_model_speed,
            window: None,
        })?;
        let window = model.schema().window;
        Ok(Self {
            room: model.room(),
            features: vec![0.0; model.features()],
            states: vec![SVector::zeros(); window + p.horizon],
            commands: vec![0.0; window - 1 + p.horizon],
            residual,
        })
    }

    fn window(&self) -> usize {
        self.residual.model.schema().window
    }

    /// Predicts the states of the horizon under the last plan and asks the residual at each of them. Gives the share
    /// of steps at which it was asked outside its training.
    fn roll_out(
        &mut self,
        model: &DiscreteErrorModel<S>,
        input: &LateralInput<'_, S>,
        previous: f64,
        preview: &Preview,
        affine: &mut Affine<SVector<f64, S>>,
    ) -> f64 {
        let window = self.window();
        let horizon = affine.known.len();
        self.states[..window].copy_from_slice(input.history.states());
        self.commands[..window - 1].copy_from_slice(input.history.commands());
        // The last plan, its end held.
        let end = input.last_plan.last().copied().unwrap_or(previous);
        let planned = input.last_plan.iter().copied().chain(std::iter::repeat(end));
        for (command, planned) in self.commands[window - 1..].iter_mut().zip(planned) {
            *command = planned;
        }
        let mut outside = 0.0;
        for j in 0..horizon {
            let states = &self.states[j..j + window];
            let commands = &self.commands[j..j + window];
            let (errors, road) = self.features.split_at_mut(S * window);
            for (feature, state) in errors.chunks_exact_mut(S).zip(states) {
                feature.copy_from_slice(state.as_slice());
            }
            road.copy_from_slice(&preview.road[j]);
            self.residual.model.coefficients(&self.features, commands, &mut self.room);
            // Outside its training the residual fades: half a range's width further there is the nominal model.
            let trust = (1.0 - 2.0 * self.room.excess).clamp(0.0, 1.0);
            if trust < 1.0 {
                self.room.scale(trust);
                outside += 1.0;
            }
            let newest = &states[window - self.room.state().len() / S..];
            let known = newest.iter().flat_map(|state| state.iter()).zip(self.room.state());
            let mut constant = SVector::from(self.room.constant());
            for (value, effect) in known {
                constant += SVector::from(*effect) * *value;
            }
            affine.constant[j] = constant;
            let effects = &mut affine.command[j * window..(j + 1) * window];
            for (effect, command) in effects.iter_mut().zip(self.room.command()) {
                *effect = SVector::from(*command);
            }
            let mut next = model.a * states[window - 1] + model.b * commands[window - 1] + affine.known[j];
            if self.residual.roll_out == RollOut::Corrected {
                next += constant;
                for (effect, command) in effects.iter().zip(commands) {
                    next += *effect * *command;
                }
            }
            self.states[j + window] = next;
        }
        outside / horizon as f64
    }
}
