//! A controller as an FMU: what those of cars and trucks have in common.
//!
//! It computes at its sample time Ts and holds its commands between. Outputs change in steps only: at a
//! communication point they do not depend on the inputs set there, so there is no algebraic loop with the plant.
//! A host with steps longer than Ts holds the commands for as long: its step becomes the sample time (`resampled.rs`).

mod declared;
mod host_step;
mod resampled;
mod told_status;
mod unit;

pub use self::declared::DEFAULT_PATH;
pub use self::unit::{ControllerInput, ControllerUnit, ParameterValues, TOLD_OF_A_BODY};

use self::declared::{Outputs, RESIDUAL_DATA, Variables, declare, read_groups, write_groups};
use self::host_step::HostSteps;
use self::told_status::ToldStatuses;
use super::{failed, vehicle_named};
use crate::control::{
    Choice, ControlStatus, ControlVariant, ControllerFile, ControllerFor, ControllerState, KnownActuator,
    Measurement, PredictionModelFor, Propagation, RollOut, Sampler,
};
use crate::finite::check_finite;
use crate::fmi::{Context, Declaration, Log, Model, ModelError, Severity, Values};
use crate::path::{Path, PathOptions};
use crate::vehicle::VehicleParameters as _;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Folder in the FMU's `resources/` with a learned model for each variant: `VARIANT.rflm`.
pub const MODELS: &str = "residual";

/// Prediction model of the host's choice, or else of the controller's file.
fn chosen(
    v: &Variables,
    values: &Values,
    context: &Context,
    of_file: Option<ControlVariant>,
    has_data: bool,
) -> Choice {
    let file = match values.string(v.residual_file) {
        "" => None,
        file => Some(context.locate(file)),
    };
    // A host that names a file and no variant means the file, not the variant that is packed.
    let named_by_host = has_data || values.is_set_by_host(v.residual_file);
    let variant_counts =
        if named_by_host { values.is_set_by_host(v.variant) } else { values.is_chosen(v.variant) };
    let by_file = (file.is_some() || has_data) && !variant_counts;
    // The FMI layer admits no other numbers than the declared ones.
    let chosen = values.is_chosen(v.variant).then(|| ControlVariant::from_number(values.integer(v.variant)));
    let variant = chosen.flatten().or(of_file).unwrap_or(ControlVariant::Adaptive);
    Choice {
        variant: if by_file { ControlVariant::Adaptive } else { variant },
        file,
        folder: context.resources.as_ref().map_or_else(|| MODELS.into(), |folder| folder.join(MODELS)),
        propagation: Propagation::from_number(values.integer(v.propagation)).unwrap_or_default(),
        roll_out: RollOut::from_number(values.integer(v.roll_out)).unwrap_or_default(),
    }
}

/// The FMU's model.
pub struct ControllerFmu<U: ControllerUnit<S>, const S: usize> {
    variables: Variables,
    running: Option<Running<U, S>>,
}

struct Running<U: ControllerUnit<S>, const S: usize> {
    controller: ControllerFor<U, S>,
    sampler: Sampler,
    variant: ControlVariant,
    /// The prediction model, and the sample time of the parameters, s. That of the controller is the host's step, where
    /// this is longer.
    model: PredictionModelFor<U::Vehicle, S>,
    sample_time: f64,
    /// The host's last steps.
    steps: HostSteps,
    /// True once the host has been told that its step is too long.
    told: bool,
    /// Changes of the status that the host was told of.
    statuses: ToldStatuses,
}

/// State that [`Model::save`] writes.
#[derive(Serialize, Deserialize)]
struct Saved<const S: usize> {
    controller: ControllerState<S>,
    sampler: Sampler,
    /// Sample time of the controller, s.
    sample_time: f64,
    steps: HostSteps,
    /// Hash of the road, whose shape the state does not hold.
    road: u64,
}

impl<const S: usize> Saved<S> {
    fn read(bytes: &[u8]) -> Result<Self, ModelError> {
        let (saved, rest): (Self, _) = postcard::take_from_bytes(bytes)
            .map_err(|error| failed(format!("the saved controller state cannot be read: {error}")))?;
        if !rest.is_empty() {
            return Err(failed(format!("the saved controller state has {} bytes too many", rest.len())));
        }
        check_finite(&saved).map_err(|error| failed(format!("the saved controller state has {error}")))?;
        Ok(saved)
    }
}

impl<U: ControllerUnit<S>, const S: usize> Model for ControllerFmu<U, S> {
    fn declaration() -> Declaration {
        declare::<U, S>().0
    }

    fn new() -> Self {
        Self { variables: declare::<U, S>().1, running: None }
    }

    fn initialize(
        &mut self,
        values: &mut Values,
        start_time: f64,
        context: &Context,
        log: &mut dyn Log,
    ) -> Result<(), ModelError> {
        let v = &self.variables;
        let vehicle: U::File = vehicle_named(values.string(v.vehicle_file), context)?;
        let mut parameters = U::of_file(&vehicle);
        let mut variant_of_file = None;
        let name = values.string(v.controller_file);
        if !name.is_empty() {
            let file = context.locate(name);
            let content = ControllerFile::read(&file).map_err(failed)?;
            content.apply(&mut parameters, &file).map_err(failed)?;
            if let Some(note) = content.for_another(vehicle.name()) {
                log.log(Severity::Info, "control", &format!("controller file {}: {note}", file.display()));
            }
            variant_of_file = content.variant;
        }
        let mut groups = U::groups(&mut parameters);
        read_groups(&mut groups, v.parameters, values);
        write_groups(&groups, v.parameters, values);

        let name = values.string(v.path_file);
        if name.is_empty() {
            return Err(failed(format!(
                "path_file is empty; it names the path to follow, a CSV file with columns x, y. The FMU's own is {DEFAULT_PATH}"
            )));
        }
        let file = context.locate(name);
        let path = Path::read_with(&file, &parameters.reading::<S>(&PathOptions::default())).map_err(|error| {
            let place = if file.is_relative() {
                ". A relative name is one in the FMU's folder resources/, else in the host's working folder"
            } else {
                ""
            };
            failed(format!(
                "{error}. The parameter path_file names the path to follow: a CSV file with columns x, y{place}"
            ))
        })?;
        let own =
            if values.is_set_by_host(v.path_file) { "" } else { "; the FMU's own, for path_file is not set" };
        log.log(Severity::Info, "path", &format!("{}: {:.0} m{own}", file.display(), path.length()));
        for note in path.notes() {
            // Hosts stop at a warning: what was repaired is none.
            let severity = if note.warning { Severity::Warning } else { Severity::Info };
            log.log(severity, "path", &format!("{}: {note}", file.display()));
        }
        if let Some(warning) = parameters.too_tight::<S>(&path) {
            log.log(Severity::Warning, "path", &format!("{}: {warning}", file.display()));
        }
        let data = values.binary(v.residual_data);
        if !data.is_empty() && values.is_set_by_host(v.residual_file) {
            return Err(failed(
                "residual.file and residual.data are both given, and a model is one: give one of them",
            ));
        }
        let choice = chosen(v, values, context, variant_of_file, !data.is_empty());
        let (variant, model) = match &data[..] {
            [] => choice.prediction_model(&parameters),
            bytes => choice.prediction_model_of(RESIDUAL_DATA, bytes, &parameters),
        }
        .map_err(failed)?;
        let controller =
            ControllerFor::predicting_with(parameters, Arc::new(path), model.clone()).map_err(failed)?;
        if !values.is_set_by_host(v.variant) {
            values.set_integer(v.variant, variant as i32);
        }
        log.log(Severity::Info, "variant", &format!("variant {}: {}", variant.name(), variant.meaning()));

        let sample_time = controller.parameters().mpc.sample_time;
        let path = controller.path();
        values.set_real(v.outputs.path_length, path.length());
        let begin = path.at(0.0);
        for (vr, value) in v.outputs.start.iter().zip([begin.x, begin.y, begin.yaw, controller.start_speed()])
        {
            values.set_real(*vr, value);
        }
        write_outputs(&v.outputs, values, &controller);
        let sampler = Sampler::new(start_time);
        let (steps, statuses) = (HostSteps::default(), ToldStatuses::default());
        self.running =
            Some(Running { controller, sampler, variant, model, sample_time, steps, told: false, statuses });
        Ok(())
    }

    fn step(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<(), ModelError> {
        let v = &self.variables;
        let Some(running) = &mut self.running else {
            return Err(failed("the controller is not initialised"));
        };
        running.keep_up_with(time, step, log)?;
        let Running { controller, sampler, statuses, .. } = running;
        if !sampler.due(time, step, controller.parameters().mpc.sample_time) {
            return Ok(());
        }
        let mut measurement = Measurement::default();
        for (index, (_, place)) in U::INPUTS.iter().enumerate() {
            *place(&mut measurement) = values.real(v.inputs + index);
        }
        let before = controller.report().status;
        let report = controller
            .step_within(time, step, &measurement)
            .map_err(|error| ModelError::Discard(error.to_string()))?;
        let status = report.status;
        if status != before {
            statuses.tell(time, status, controller.bridged_signals(), log);
        }
        write_outputs(&v.outputs, values, controller);
        Ok(())
    }

    /// The command holds for a sample time. Of a longer step a host is told a change of the status after that.
    fn step_to_event(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<f64, ModelError> {
        let status = |model: &Self| model.running.as_ref().map(|running| running.controller.report().status);
        let before = status(self);
        self.step(values, time, step, log)?;
        let Some(Running { controller, .. }) = &self.running else { return Ok(step) };
        let is_event = before != status(self) && before != Some(ControlStatus::Waiting);
        Ok(if is_event { step.min(controller.parameters().mpc.sample_time) } else { step })
    }

    fn reports_warnings(&self, values: &Values) -> bool {
        values.boolean(self.variables.report_warnings)
    }

    fn save(&self, bytes: &mut Vec<u8>) {
        if let Some(Running { controller, sampler, steps, .. }) = &self.running {
            let saved = Saved {
                controller: controller.state().clone(),
                sampler: *sampler,
                sample_time: controller.parameters().mpc.sample_time,
                steps: *steps,
                road: controller.path().hash(),
            };
            if let Ok(encoded) = postcard::to_allocvec(&saved) {
                bytes.extend_from_slice(&encoded);
            }
        }
    }

    fn check(bytes: &[u8]) -> Result<(), ModelError> {
        Saved::<S>::read(bytes).map(|_| ())
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), ModelError> {
        let Some(running) = &mut self.running else {
            return Err(failed("the controller is not initialised"));
        };
        let saved: Saved<S> = Saved::read(bytes)?;
        if saved.road != running.controller.path().hash() {
            return Err(failed(
                "the saved controller state was made on another road: the file that path_file names has changed since, or \
                 is another one; restore it with the file of then",
            ));
        }
        let mut resampled = None;
        if saved.sample_time != running.controller.parameters().mpc.sample_time {
            resampled = Some(running.resampled(saved.sample_time)?);
        }
        let controller = resampled.as_mut().unwrap_or(&mut running.controller);
        if controller.restore(saved.controller).is_some() {
            return Err(failed(
                "the saved controller state is of a controller with another mpc.horizon, variant or speed.controller",
            ));
        }
        if let Some(controller) = resampled {
            running.controller = controller;
        }
        (running.sampler, running.steps) = (saved.sampler, saved.steps);
        Ok(())
    }
}

fn write_outputs<U: ControllerUnit<S>, const S: usize>(
    v: &Outputs,
    values: &mut Values,
    controller: &ControllerFor<U, S>,
) {
    let report = controller.report();
    for (vr, value) in [
        (v.steer_cmd, report.steer_cmd),
        (v.accel_cmd, report.accel_cmd),
        (v.e1, report.e1),
        (v.e1_rate, report.e1_rate),
        (v.e2, report.e2),
        (v.e2_rate, report.e2_rate),
        (v.station, report.station),
        (v.curvature, report.curvature),
        (v.curvature_rate, report.curvature_rate),
        (v.residual_outside, report.residual_outside),
        (v.speed_ref, report.speed_ref),
        (v.lag_error, report.lag_error),
        (v.compute_time, report.compute_time),
    ] {
        values.set_real(vr, value);
    }
    if let Some(known) = controller.known_actuator() {
        let KnownActuator { actuator, spread, backlash, .. } = known;
        let found = [actuator.dead_time, actuator.time_constant, spread, backlash];
        for (vr, value) in v.found.iter().zip(found) {
            values.set_real(*vr, value);
        }
    }
    values.set_integer(v.status, report.status as i32);
    values.set_integer(v.iterations, i32::try_from(report.iterations).unwrap_or(i32::MAX));
    values.set_boolean(v.finished, report.finished);
    let lateral = controller.lateral();
    for (j, [x, y, e1]) in v.predicted.iter().enumerate().take(lateral.plan().len()) {
        let error = lateral.predicted_e1(j);
        let at = controller.path().at(lateral.predicted_station(j));
        values.set_real(*x, at.x - error * at.yaw.sin());
        values.set_real(*y, at.y + error * at.yaw.cos());
        values.set_real(*e1, error);
    }
}
