//! A host whose steps are longer than the controller's sample time: the step becomes the sample time.
//!
//! Each command is held for a whole step of the host. A controller that predicts shorter ones steers against what does
//! not come, and leaves its road. So it is made anew for the host's step, in the middle of the drive if need be:
//!
//! | prediction | on longer steps |
//! |---|---|
//! | nominal, actuator, adaptive, nonlinear | the same, sampled at the step |
//! | learned: of one sample time | the adaptive one without the learned model, and a warning |
//!
//! `host_step.rs` says which steps are longer. Where they are short again, a learned model comes back.
//!
//! Beyond the range of `mpc.sample_time` its largest value holds, and a warning says so.

use super::{ControllerUnit, Running, failed};
use crate::control::{ControllerFor, MpcParameters, PredictionModelFor, Sampler};
use crate::fmi::{Log, ModelError, Seconds, Severity};
use crate::parameter::ParameterGroup as _;

impl<U: ControllerUnit<S>, const S: usize> Running<U, S> {
    /// Takes the host's steps as the sample time, where they are longer.
    pub(super) fn keep_up_with(&mut self, time: f64, step: f64, log: &mut dyn Log) -> Result<(), ModelError> {
        let (largest, own) = (largest_sample_time(), self.sample_time);
        let present = self.controller.parameters().mpc.sample_time;
        let typical = self.steps.observe(step, own, present);
        let sample_time = typical.min(largest);
        let too_long = Sampler::is_outpaced(step, largest) && !std::mem::replace(&mut self.told, true);
        let changes = sample_time != present;
        if changes {
            self.controller = self.resampled(sample_time)?;
            // Instants are counted in sample times.
            self.sampler = Sampler::new(time);
        }
        if !changes && !too_long {
            return Ok(());
        }
        let is_own = sample_time == own;
        let mut severity = Severity::Info;
        // One step beyond every sample time is said as it is, a habit of the host by its median.
        let longer = if too_long { step } else { typical };
        let [at, longer, own, predicted, largest] = [time, longer, own, sample_time, largest].map(Seconds);
        let mut text = if is_own && !too_long {
            format!(
                "t = {at}: the host's steps are as short as mpc.sample_time, {own}, again: the controller predicts with it"
            )
        } else {
            format!(
                "t = {at}: the host's steps, {longer}, are longer than mpc.sample_time, {own}: the controller computes once a \
                 step, and predicts with a sample time of {predicted}"
            )
        };
        if self.variant.is_learned() && !is_own {
            severity = Severity::Warning;
            let variant = self.variant.name();
            text += &format!(
                "; the learned model of the variant {variant} is of {own} and is left out: make the host's step {own} to \
                 drive with it"
            );
        }
        if too_long {
            severity = Severity::Warning;
            text += &format!(
                "; no sample time is longer, what it predicts does not come, and the vehicle may leave the road: make the \
                 host's step {largest} or shorter"
            );
        }
        log.log(severity, "control", &text);
        Ok(())
    }

    /// The controller at another sample time, s.
    pub(super) fn resampled(&self, sample_time: f64) -> Result<ControllerFor<U, S>, ModelError> {
        let model = if self.variant.is_learned() && sample_time != self.sample_time {
            PredictionModelFor::Adaptive(self.controller.parameters().actuator.actuator())
        } else {
            self.model.clone()
        };
        self.controller.resampled(sample_time, model).map_err(failed)
    }
}

/// The largest value of `mpc.sample_time`, s.
fn largest_sample_time() -> f64 {
    let of_table = MpcParameters::table().iter().find(|parameter| parameter.name == "mpc.sample_time");
    of_table.map_or(f64::INFINITY, |parameter| parameter.max)
}
