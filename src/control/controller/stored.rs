//! The state that a controller keeps between steps, given out and taken back.

use super::{ControllerFor, ControllerState};
use crate::control::step::{Measurement, StepError, StepReport};
use crate::control::vehicle::ControlledParameters;

impl<G: ControlledParameters<S>, const S: usize> ControllerFor<G, S> {
    /// Everything that steps have changed.
    #[must_use]
    pub fn state(&self) -> &ControllerState<S> {
        &self.state
    }

    /// One control step of another vehicle, whose state is kept outside. `state` is a copy of [`state`](Self::state)
    /// from before the first step, as its own steps have changed it. So one controller serves any number of vehicles on
    /// its path, with one working memory, which stays in the processor's caches. A state takes a few kilobytes.
    ///
    /// # Errors
    /// As [`step`](Self::step); a state that [`restore`](Self::restore) would give back. Nothing has changed then.
    pub fn step_for(
        &mut self,
        state: &mut ControllerState<S>,
        measurement: &Measurement,
    ) -> Result<StepReport, StepError> {
        if !self.exchange(state) {
            return Err(StepError::ForeignState);
        }
        let report = self.step(measurement).copied();
        self.exchange(state);
        report
    }

    /// Continues from a state of a controller with the same parameters and path. Gives the state back if its plan
    /// has another horizon, its history another window, or its speed was tracked in another way.
    pub fn restore(&mut self, mut state: ControllerState<S>) -> Option<ControllerState<S>> {
        (!self.exchange(&mut state)).then_some(state)
    }

    /// Puts a state in the place of its own, which comes out, if it fits.
    fn exchange(&mut self, state: &mut ControllerState<S>) -> bool {
        let window = |state: &ControllerState<S>| state.history.states().len();
        let of_bank = match (&self.bank, &state.bank) {
            (Some(bank), Some(state)) => bank.fits(state),
            (None, None) => true,
            _ => false,
        };
        let other_speed = state.longitudinal.is_some() != self.longitudinal.is_some();
        if state.plan.len() != self.state.plan.len()
            || window(state) != window(&self.state)
            || other_speed
            || !of_bank
        {
            return false;
        }
        std::mem::swap(&mut self.state, state);
        if let (Some(longitudinal), Some(of_speed)) = (&mut self.longitudinal, self.state.longitudinal) {
            longitudinal.restore(of_speed);
        }
        true
    }
}
