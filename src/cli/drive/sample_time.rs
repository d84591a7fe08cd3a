//! The controller's sample time against the communication step: it must not be the shorter one.

use super::model::ModelArgs;
use crate::control::{ControlledParameters, ControllerParametersFor, Sampler};
use std::error::Error;

/// A controller is called once a communication step at most: one that computes more often predicts steps that do not come.
/// Its sample time becomes the step, unless it was set (`own` is the one before) or a learned model has it.
pub(super) fn keep_up_with<G: ControlledParameters<S>, const S: usize>(
    step: f64,
    own: f64,
    model: &ModelArgs,
    controller: &mut ControllerParametersFor<G>,
) -> Result<(), Box<dyn Error>> {
    let sample_time = controller.mpc.sample_time;
    if !Sampler::is_outpaced(step, sample_time) || sample_time != own || model.is_learned() {
        return Ok(());
    }
    let mut longer = *controller;
    longer.mpc.sample_time = step;
    longer.check::<S>().map_err(|error| format!("--step {step}, the controller's sample time: {error}"))?;
    *controller = longer;
    warn!(
        "note: mpc.sample_time = {step} s, the communication step: the controller is not called more often"
    );
    Ok(())
}

/// Warns of a sample time that is shorter than the communication step, of a controller that has been made.
pub(super) fn warn_of_long_steps(step: f64, sample_time: f64, model: &ModelArgs) {
    if Sampler::is_outpaced(step, sample_time) {
        let why = if model.is_learned() { "the learned model's" } else { "as set" };
        warn!(
            "warning: the controller predicts steps of {sample_time} s (mpc.sample_time, {why}), and is called every \
             {step} s (--step): what it predicts does not come, and the vehicle may leave the road"
        );
    }
}
