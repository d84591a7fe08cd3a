//! The same controller at another sample time, in the middle of a drive.

use super::{ControllerError, ControllerFor, ControllerState};
use crate::control::variant::PredictionModelFor;
use crate::control::vehicle::ControlledParameters;

impl<G: ControlledParameters<S>, const S: usize> ControllerFor<G, S> {
    /// The controller with another sample time, s, and a prediction model for it. Place, commands, speed control and
    /// guard go on; what counts in samples begins anew: plan, history, observer and the search for the actuator. Terms
    /// that were added to the cost are not taken over.
    ///
    /// # Errors
    /// A sample time out of range; a learned model of another one.
    pub fn resampled(
        &self,
        sample_time: f64,
        model: PredictionModelFor<G::Vehicle, S>,
    ) -> Result<Self, ControllerError> {
        let mut parameters = self.parameters;
        parameters.mpc.sample_time = sample_time;
        let mut other = Self::predicting_with(parameters, self.path.clone(), model)?;
        let ControllerState { plan, plan_age, history, observer, bank, fading, longitudinal, .. } =
            other.state;
        other.state = ControllerState {
            plan,
            plan_age,
            history,
            observer,
            bank,
            fading,
            longitudinal,
            ..self.state.clone()
        };
        Ok(other)
    }
}
