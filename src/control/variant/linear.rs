//! The nominal linear model, with or without a learned residual.
//!
//! Roll the nominal model out with the curvature ahead, ask the learned residual (if there is one) at each step of the
//! roll-out, condense, solve. Outside its training the residual fades into that of the steering actuator, as far as the
//! drive has shown one.
//!
//! Source: Zhao et al., ITSC 2024, Algorithm 1.

use super::{ExpectedState, Nominal, Qp, Variant, effect_of_bank};
use crate::control::condense::{Affine, ErrorTransition, HorizonModel, Propagation, condense_settled};
use crate::control::lateral::LateralInput;
use crate::control::parameters::MpcParameters;
use crate::control::preview::Preview;
use crate::control::solve::Equations;
use crate::control::tracking_qp::{QpError, QpReport};
use crate::enumeration;
use crate::nominal::{ActuatedModel, DiscreteErrorModel, ERRORS, LateralVehicle};
use crate::residual::{self, LinearResidual, ModelMismatch, ResidualRows, write_residual_of_actuator};
use crate::vehicle::SingleTrack;
use nalgebra::{SMatrix, SVector};
use std::sync::Arc;
use std::time::Instant;

enumeration! {
    /// Model of the predicted states at which the residual is asked.
    pub enum RollOut {
        Nominal = 0 "nominal", "The nominal model, as in Zhao et al.";
        Corrected = 1 "corrected", "The nominal model with the residual";
    }
}

/// A learned residual and its propagation.
#[derive(Debug, Clone)]
#[allow(missing_docs)]
pub struct Residual<V = SingleTrack, const S: usize = ERRORS> {
    pub model: Arc<dyn LinearResidual<V, S>>,
    pub propagation: Propagation,
    pub roll_out: RollOut,
}

/// The learned residual with workspace.
struct LearnedResidual<V, const S: usize> {
    residual: Residual<V, S>,
    window: usize,
    rows: Box<dyn ResidualRows<S>>,
    /// The trust with which the effects of each row's commands were written; not a number if they were not.
    written: Vec<f64>,
    /// Issued commands and then planned ones, oldest first.
    commands: Vec<f64>,
    /// Effect of the issued commands in each row.
    issued: Vec<[f64; S]>,
    /// Effects of a window of commands outside the training: those of the actuator.
    fallback: Vec<[f64; S]>,
}

/// The variant.
pub struct NominalWithResidual<V, const S: usize> {
    nominal: Nominal<V>,
    learned: Option<LearnedResidual<V, S>>,
    affine: Affine<SVector<f64, S>>,
    /// Model of the newest prediction.
    model: Option<DiscreteErrorModel<S>>,
    outside: f64,
    /// Share of the residual in it.
    share: f64,
    /// True if its first step was mostly the model's: predictions far outside the training are evidence neither for nor
    /// against it.
    within: bool,
}

impl<V: LateralVehicle<S>, const S: usize> NominalWithResidual<V, S> {
    /// # Errors
    /// A residual that was learned for another controller.
    pub fn new(
        vehicle: V,
        p: &MpcParameters,
        residual: Option<Residual<V, S>>,
    ) -> Result<Self, ModelMismatch> {
        let learned = residual.map(|residual| LearnedResidual::new(residual, &vehicle, p)).transpose()?;
        let window = learned.as_ref().map_or(0, |learned| learned.window);
        Ok(Self {
            nominal: Nominal::new(vehicle, p),
            learned,
            affine: Affine::new(p.horizon, window),
            model: None,
            outside: 0.0,
            share: 0.0,
            within: false,
        })
    }

    /// Fills the affine part of the prediction: the road, the disturbance, the residual at each step of a roll-out.
    fn predict(
        &mut self,
        model: &DiscreteErrorModel<S>,
        banked: &SVector<f64, S>,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        previous: f64,
    ) {
        for (j, known) in self.affine.known.iter_mut().enumerate() {
            *known =
                model.d * preview.heading_rate[j] + model.e * preview.heading_accel[j] + input.disturbance;
            if preview.bank_accel[j] != 0.0 {
                *known += banked * preview.bank_accel[j];
            }
        }
        self.outside = 0.0;
        self.share = input.residual_share;
        let Some(learned) = &mut self.learned else { return };
        if input.residual_share <= 0.0 {
            self.affine.constant.fill(SVector::zeros());
            self.affine.settled.fill(SVector::zeros());
            self.affine.command.fill(SVector::zeros());
            self.affine.held.fill(SVector::zeros());
            learned.written.fill(f64::NAN);
            return;
        }
        let actuated = || {
            let vehicle = self.nominal.at(input.ahead.speed).ok()?;
            Some(input.actuator?.discretise(&vehicle, self.nominal.sample_time))
        };
        (self.outside, self.within) =
            learned.roll_out(model, actuated, input, previous, preview, &mut self.affine);
    }

    /// The target state: that of steady cornering, by the corrected model if there is a correction.
    fn write_references(
        &self,
        model: &DiscreteErrorModel<S>,
        input: &LateralInput<'_, S>,
        preview: &Preview,
        qp: &mut Qp,
    ) {
        let steady = self.nominal.vehicle.steady_state(input.ahead.speed);
        let corrected = self.affine.window > 0 || *input.disturbance != SVector::<f64, S>::zeros();
        // Where a step's model `x = A x + B u + w + c + sum beta u` stays on the path with a constant command: `e1 = 0`
        // leaves an equation for each other state and for u, which stands in the place of e1.
        let equations = if corrected { Equations::new(&(SMatrix::identity() - model.a)) } else { None };
        let target = |j: usize| {
            let steer = model.b + self.affine.held_at(j);
            equations.as_ref()?.solve(&-steer, &(self.affine.known[j] + self.affine.constant[j]))
        };
        qp.refer(|j| target(j).unwrap_or_else(|| steady * preview.curvature[j]));
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
        self.look(input, preview, previous)?;
        let Some(model) = self.model.clone() else { return Err(QpError::Numerical { iterations: 0 }) };
        qp.timing.look_up = begin.elapsed().as_secs_f64();

        let propagation =
            self.learned.as_ref().map_or(Propagation::default(), |learned| learned.residual.propagation);
        let linear = HorizonModel { a: &ErrorTransition(&model.a), b: &model.b };
        condense_settled(linear, input.state, &mut self.affine, propagation, &qp.tracked, &mut qp.problem);
        self.write_references(&model, input, preview, qp);
        qp.timing.condense = begin.elapsed().as_secs_f64() - qp.timing.look_up;
        qp.solve(input.time_limit)
    }

    fn look(&mut self, input: &LateralInput<'_, S>, preview: &Preview, previous: f64) -> Result<(), QpError> {
        let nominal = self.nominal.at(input.ahead.speed)?;
        let model = nominal.discretise(self.nominal.sample_time);
        let banked = effect_of_bank(&nominal.a, &model.a, self.nominal.sample_time);
        self.predict(&model, &banked, input, preview, previous);
        self.model = Some(model);
        Ok(())
    }

    fn next_state(&self, state: &SVector<f64, S>, past: &[f64], steer: f64) -> Option<ExpectedState<S>> {
        let model = self.model.as_ref()?;
        let mut next = model.a * state + model.b * steer + self.affine.known[0];
        if self.affine.window > 0 {
            next += self.affine.constant[0];
            let past = &past[past.len() + 1 - self.affine.window..];
            for (effect, command) in self.affine.commands_of(0).iter().zip(past.iter().chain([&steer])) {
                next += effect * *command;
            }
        }
        Some(ExpectedState { state: next, transition: model.a })
    }

    fn without_and_with_learned(
        &self,
        state: &SVector<f64, S>,
        past: &[f64],
        steer: f64,
    ) -> Option<[SVector<f64, S>; 2]> {
        self.learned.as_ref().filter(|_| self.share > 0.0 && self.within)?;
        let model = self.model.as_ref()?;
        let nominal = model.a * state + model.b * steer + self.affine.known[0];
        let used = self.next_state(state, past, steer)?.state;
        Some([nominal, nominal + (used - nominal) / self.share])
    }

    fn is_learned(&self) -> bool {
        self.learned.is_some()
    }

    fn window(&self) -> usize {
        self.affine.window
    }

    fn is_within_training(&self) -> bool {
        self.within
    }

    fn outside_training(&self) -> f64 {
        self.outside
    }
}

impl<V: LateralVehicle<S>, const S: usize> LearnedResidual<V, S> {
    fn new(residual: Residual<V, S>, vehicle: &V, p: &MpcParameters) -> Result<Self, ModelMismatch> {
        let model = &residual.model;
        model.check_fits(&residual::Expected {
            vehicle: *vehicle,
            sample_time: p.sample_time,
            min_model_speed: p.min_model_speed,
            window: None,
        })?;
        let window = model.window();
        Ok(Self {
            rows: Arc::clone(model).rows(p.horizon),
            window,
            written: vec![f64::NAN; p.horizon],
            commands: vec![0.0; window - 1 + p.horizon],
            issued: vec![[0.0; S]; p.horizon],
            fallback: vec![[0.0; S]; window],
            residual,
        })
    }

    /// Predicts the states of the horizon under the last plan and asks the residual at each of them. Gives the share
    /// of steps at which it was asked outside its training, and whether the first was mostly inside. `actuated` is the model behind the actuator, if there is one.
    fn roll_out(
        &mut self,
        model: &DiscreteErrorModel<S>,
        actuated: impl Fn() -> Option<ActuatedModel<S>>,
        input: &LateralInput<'_, S>,
        previous: f64,
        preview: &Preview,
        affine: &mut Affine<SVector<f64, S>>,
    ) -> (f64, bool) {
        let window = self.window;
        let horizon = affine.known.len();
        // A step later a row has the commands that it had, and the newest behind them.
        // A history may be longer: that of an actuator's memory.
        let past = input.history.commands();
        let past = &past[past.len() + 1 - window..];
        let (newest, before) = past.split_last().map_or((0.0, past), |(&newest, before)| (newest, before));
        let goes_on = self.commands.get(1..window - 1).is_some_and(|last| last == before);
        self.commands[..window - 1].copy_from_slice(past);
        // The last plan, its end held.
        let end = input.last_plan.last().copied().unwrap_or(previous);
        let (given, held) = self.commands[window - 1..].split_at_mut(input.last_plan.len().min(horizon));
        given.copy_from_slice(&input.last_plan[..given.len()]);
        held.fill(end);

        self.rows.advance();
        affine.first = self.rows.first();
        let measured = input.history.states();
        let measured = &measured[measured.len() - window..];
        let mut state = measured.last().copied().unwrap_or_else(SVector::zeros);
        for (at, state) in measured.iter().enumerate() {
            self.rows.set_state(at, &state.data.0[0]);
        }
        let (mut outside, mut within) = (0.0, true);
        for j in 0..horizon {
            let row = self.rows.row(j, &preview.road[j]);
            // Outside its training the residual fades: half a range's width further there is the actuator alone.
            let trust = (1.0 - 2.0 * row.excess).clamp(0.0, 1.0);
            if trust < 1.0 {
                if outside == 0.0 {
                    match actuated() {
                        Some(actuated) => {
                            write_residual_of_actuator(&model.b, &actuated, &mut self.fallback);
                        }
                        None => self.fallback.fill([0.0; S]),
                    }
                }
                outside += 1.0;
                within &= j > 0 || trust >= 0.5;
            }
            let fades = trust < 1.0;
            let trust = trust * input.residual_share;
            let scaled = |effect: &[f64; S]| if trust < 1.0 { effect.map(|x| x * trust) } else { *effect };
            let mut constant = scaled(&row.constant);
            for (value, effect) in row.newest.iter().zip(row.state) {
                add(&mut constant, &scaled(effect), *value);
            }
            let effects = &mut affine.command[row.slot * window..][..window];
            let issued = &mut self.issued[row.slot];
            let commands = &self.commands[j..][..window];
            let past = (window - 1).saturating_sub(j);
            // The actuator is another one at each step.
            let same = !row.renewed && !fades && self.written[row.slot] == trust;
            if !same {
                self.written[row.slot] = trust;
                // Constant leaves have none.
                effects[row.command.len()..].fill(SVector::zeros());
                for (effect, command) in effects.iter_mut().zip(row.command) {
                    effect.data.0[0] = *command;
                }
                if trust < 1.0 {
                    effects.iter_mut().for_each(|effect| *effect *= trust);
                }
                if fades {
                    let rest = input.residual_share - trust;
                    effects.iter_mut().zip(&self.fallback).for_each(|(effect, of_actuator)| {
                        add(&mut effect.data.0[0], of_actuator, rest);
                    });
                }
                // Of a command that is held the actuator makes what it is.
                affine.held[row.slot] = SVector::from(scaled(&row.held));
            }
            // Issued commands, which are known, apart from planned ones. Oldest first: as a sum that goes on.
            if !(same && goes_on) {
                *issued = [0.0; S];
                for (effect, command) in effects.iter().zip(&commands[..past]) {
                    add(issued, &effect.data.0[0], *command);
                }
            } else if past > 0 {
                add(issued, &effects[past - 1].data.0[0], newest);
            }
            let mut residual = constant;
            add(&mut residual, issued, 1.0);
            affine.constant[j] = SVector::from(constant);
            affine.settled[j] = SVector::from(residual);
            if j + 1 == horizon {
                break;
            }
            state = model.a * state + model.b * commands[window - 1] + affine.known[j];
            if self.residual.roll_out == RollOut::Corrected {
                add_all(&mut residual, &effects[past..], &commands[past..]);
                state += SVector::from(residual);
            }
            self.rows.set_state(j + window, &state.data.0[0]);
        }
        (outside / horizon as f64, within)
    }
}

/// Adds the effects of commands. In two sums, each of which need not wait for the other.
fn add_all<const S: usize>(sum: &mut [f64; S], effects: &[SVector<f64, S>], commands: &[f64]) {
    let (pairs, last) = effects.as_chunks::<2>();
    let (commands, last_command) = commands.as_chunks::<2>();
    let mut other = [0.0; S];
    for (pair, commands) in pairs.iter().zip(commands) {
        add(sum, &pair[0].data.0[0], commands[0]);
        add(&mut other, &pair[1].data.0[0], commands[1]);
    }
    for (effect, command) in last.iter().zip(last_command) {
        add(sum, &effect.data.0[0], *command);
    }
    add(sum, &other, 1.0);
}

/// `sum += effect value`.
fn add<const S: usize>(sum: &mut [f64; S], effect: &[f64; S], value: f64) {
    for o in 0..S {
        sum[o] += effect[o] * value;
    }
}
