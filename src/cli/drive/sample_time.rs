//! The controller's sample time against the communication step: it must not be the shorter one.

use crate::control::{
    ControlVariant, ControlledParameters, ControllerParametersFor, PredictionModelFor, Sampler,
};
use std::error::Error;

/// A variant and its prediction model.
type Chosen<'a, G, const S: usize> =
    (&'a mut ControlVariant, &'a mut PredictionModelFor<<G as ControlledParameters<S>>::Vehicle, S>);

/// A controller is called once a communication step at most: one that computes more often predicts steps that do not come.
/// Its sample time becomes the step, unless it was set (`own` is the one before). A learned model is of one sample time and is
/// left out then, as in the FMU.
pub(super) fn keep_up_with<G: ControlledParameters<S>, const S: usize>(
    step: f64,
    own: f64,
    (variant, model): Chosen<G, S>,
    controller: &mut ControllerParametersFor<G>,
) -> Result<(), Box<dyn Error>> {
    let sample_time = controller.mpc.sample_time;
    if !Sampler::is_outpaced(step, sample_time) || sample_time != own {
        return Ok(());
    }
    let mut longer = *controller;
    longer.mpc.sample_time = step;
    longer.check::<S>().map_err(|error| format!("--step {step}, the controller's sample time: {error}"))?;
    *controller = longer;
    warn!(
        "note: mpc.sample_time = {step} s, the communication step: the controller is not called more often"
    );
    if variant.is_learned() {
        warn!(
            "warning: the learned model of the variant {} is of {own} s and is left out: --step {own} drives with it",
            variant.name()
        );
        (*variant, *model) =
            (ControlVariant::Adaptive, PredictionModelFor::Adaptive(longer.actuator.actuator()));
    }
    Ok(())
}

/// Warns of a sample time that is shorter than the communication step, of a controller that has been made.
pub(super) fn warn_of_long_steps(step: f64, sample_time: f64) {
    if Sampler::is_outpaced(step, sample_time) {
        warn!(
            "warning: the controller predicts steps of {sample_time} s (mpc.sample_time, as set), and is called every \
             {step} s (--step): what it predicts does not come, and the vehicle may leave the road"
        );
    }
}
