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
//! One step is no habit: a host that is late once, or whose clock trembles, changes nothing. Longer steps are those whose median over the
//! last [`WINDOW`] is longer than the sample time by more than a [`TREMBLE`]. When all of the last [`WINDOW`] are shorter again, so is the
//! sample time, and a learned model comes back.
//!
//! Beyond the range of `mpc.sample_time` its largest value holds, and a warning says so.

use super::{ControllerUnit, Running, failed};
use crate::control::{ControllerFor, MpcParameters, PredictionModelFor, Sampler};
use crate::fmi::{Log, ModelError, Seconds, Severity};
use crate::parameter::ParameterGroup as _;
use serde::{Deserialize, Serialize};

/// Steps that tell what a host's are.
const WINDOW: usize = 6;
/// Share of the sample time by which a step may be longer for a clock that trembles: the prediction is wrong by no more.
const TREMBLE: f64 = 0.1;

/// The last steps of a host, s, in a ring; as many as there were, up to [`WINDOW`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct HostSteps {
    ring: [f64; WINDOW],
    seen: u64,
}

impl HostSteps {
    /// Takes a step; gives the sample time that the host's steps ask of a controller with this one, whose own is `own`, s.
    fn observe(&mut self, step: f64, own: f64, present: f64) -> f64 {
        self.ring[(self.seen % WINDOW as u64) as usize] = step;
        self.seen = self.seen.saturating_add(1);
        let count = self.seen.min(WINDOW as u64) as usize;
        let mut sorted = self.ring;
        let sorted = &mut sorted[..count];
        sorted.sort_by(f64::total_cmp);
        let (median, longest) = (sorted[count / 2], sorted[count - 1]);
        let back = longest.max(own);
        if median > present * (1.0 + TREMBLE) {
            median
        } else if count == WINDOW && back * (1.0 + TREMBLE) < present {
            back
        } else {
            present
        }
    }
}

impl<U: ControllerUnit<S>, const S: usize> Running<U, S> {
    /// Takes the host's steps as the sample time, where they are longer.
    pub(super) fn keep_up_with(&mut self, time: f64, step: f64, log: &mut dyn Log) -> Result<(), ModelError> {
        let (largest, own) = (largest_sample_time(), self.sample_time);
        let present = self.controller.parameters().mpc.sample_time;
        let sample_time = self.steps.observe(step, own, present).min(largest);
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
        let [at, step, own, predicted, largest] = [time, step, own, sample_time, largest].map(Seconds);
        let mut text = if is_own && !too_long {
            format!(
                "t = {at}: the host's steps are as short as mpc.sample_time, {own}, again: the controller predicts with it"
            )
        } else {
            format!(
                "t = {at}: the host's step, {step}, is longer than mpc.sample_time, {own}: the controller computes once a \
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
