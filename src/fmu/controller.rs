//! A controller as an FMU: what those of cars and trucks have in common.
//!
//! It computes at its sample time Ts and holds its commands between. Outputs change in steps only: at a
//! communication point they do not depend on the inputs set there, so there is no algebraic loop with the plant.
//! A host with steps longer than Ts holds the commands for as long: its step becomes the sample time (`resampled.rs`).

mod host_step;
mod resampled;
mod told_status;

use self::host_step::HostSteps;
use self::told_status::ToldStatuses;

use super::{failed, vehicle_file_parameter, vehicle_named};
use crate::control::{
    Choice, ControlStatus, ControlVariant, ControlledParameters, ControllerFile, ControllerFor,
    ControllerParametersFor, ControllerState, Measurement, PredictionModelFor, Propagation, RollOut, Sampler,
};
use crate::finite::check_finite;
use crate::fmi::{
    Context, Declaration, DefaultExperiment, Log, LogCategory, Model, ModelError, Severity, Values, Variable,
    VariableKind, Vr,
};
use crate::input;
use crate::parameter::{Choices, Parameter, ParameterGroup};
use crate::path::Path;
use crate::signal::{self, Signal, Unit};
use crate::vehicle::VehicleParameters;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Path that the FMU follows when none is named: packed into its `resources/`.
pub const DEFAULT_PATH: &str = "path.csv";

/// Folder in the FMU's `resources/` with a learned model for each variant: `VARIANT.rflm`.
pub const MODELS: &str = "residual";

/// Parameter with the bytes of a learned model.
const RESIDUAL_DATA: &str = "residual.data";

/// Log categories of the controller.
const CATEGORIES: &[LogCategory] = &[
    LogCategory { name: "control", description: "Changes of the controller's status, with their cause" },
    LogCategory {
        name: "path",
        description: "The path that was read, and what was noticed or repaired in it",
    },
    LogCategory { name: "variant", description: "What the controller predicts with" },
];

/// Outputs for each step of the prediction.
const PREDICTED: [(&str, &str); 3] =
    [("x", "Predicted x"), ("y", "Predicted y"), ("e1", "Predicted lateral error")];

/// A signal that the controller is told, and where it stands in what it is told.
pub type ControllerInput = (&'static Signal, fn(&mut Measurement) -> &mut f64);

/// Inputs of any controller; a car's has no others.
pub const TOLD_OF_A_BODY: [ControllerInput; 7] = [
    (&signal::X, |measured| &mut measured.x),
    (&signal::Y, |measured| &mut measured.y),
    (&signal::YAW, |measured| &mut measured.yaw),
    (&signal::VX, |measured| &mut measured.vx),
    (&signal::VY, |measured| &mut measured.vy),
    (&signal::YAW_RATE, |measured| &mut measured.yaw_rate),
    (&signal::STEER, |measured| &mut measured.steer),
];

/// A group of parameters, whichever it is.
pub trait ParameterValues {
    /// The declarations, in order.
    fn table(&self) -> &'static [Parameter];
    /// The value at a position of the table.
    fn get(&self, index: usize) -> f64;
    /// Sets the value at a position of the table, unchecked.
    fn set(&mut self, index: usize, value: f64);
}

impl<G: ParameterGroup> ParameterValues for G {
    fn table(&self) -> &'static [Parameter] {
        G::table()
    }

    fn get(&self, index: usize) -> f64 {
        ParameterGroup::get(self, index)
    }

    fn set(&mut self, index: usize, value: f64) {
        ParameterGroup::set(self, index, value);
    }
}

/// The parameters of a kind of vehicle with `S` states, as its controller's FMU needs them.
pub trait ControllerUnit<const S: usize>: ControlledParameters<S> + Send + 'static {
    /// FMI `modelName`.
    const NAME: &'static str;
    /// One sentence.
    const DESCRIPTION: &'static str;
    /// Word for such a vehicle.
    const WHAT: &'static str;
    /// Inputs of the controller.
    const INPUTS: &'static [ControllerInput];
    /// Steps of the prediction that are outputs; longer horizons are allowed.
    const SHOWN: usize;

    /// Contents of a vehicle's file.
    type File: VehicleParameters;

    /// Start values of the parameters: those for the vehicle that `vehicle_file` starts with.
    fn defaults() -> ControllerParametersFor<Self> {
        let names = <Self::File as VehicleParameters>::BUILTIN;
        let vehicle = <Self::File as VehicleParameters>::builtin(names[0]);
        Self::of_file(&vehicle.expect("the built-in vehicles are read in a test"))
    }

    /// The parameters for a vehicle.
    fn of_file(file: &Self::File) -> ControllerParametersFor<Self>;
    /// The groups that a user sets, in the order of the FMU's variables.
    fn groups(parameters: &mut ControllerParametersFor<Self>) -> Vec<&mut dyn ParameterValues>;
}

/// References of the declared variables.
struct Variables {
    /// The first of the inputs, which are contiguous.
    inputs: Vr,
    steer_cmd: Vr,
    accel_cmd: Vr,
    e1: Vr,
    e1_rate: Vr,
    e2: Vr,
    e2_rate: Vr,
    station: Vr,
    curvature: Vr,
    curvature_rate: Vr,
    residual_outside: Vr,
    speed_ref: Vr,
    lag_error: Vr,
    status: Vr,
    iterations: Vr,
    compute_time: Vr,
    found: [Vr; 3],
    finished: Vr,
    path_length: Vr,
    start: [Vr; 4],
    predicted: Vec<[Vr; 3]>,
    path_file: Vr,
    vehicle_file: Vr,
    variant: Vr,
    residual_file: Vr,
    /// Not there in every version of the interface.
    residual_data: Vr,
    propagation: Vr,
    roll_out: Vr,
    /// The first of the numeric parameters, which are contiguous.
    parameters: Vr,
    controller_file: Vr,
    report_warnings: Vr,
}

/// Declares the numeric parameters of all groups; gives the first.
fn add_groups(declaration: &mut Declaration, groups: &[&mut dyn ParameterValues]) -> Vr {
    let first = declaration.variables.len();
    for group in groups {
        for (index, parameter) in group.table().iter().enumerate() {
            let Parameter { name, unit, min, max, integer, choices, meaning, .. } = *parameter;
            let start = group.get(index);
            declaration.add(if let Some(Choices { type_name, items }) = choices {
                let start = start as i32;
                Variable::parameter_of(VariableKind::Enumeration { type_name, items, start }, name, meaning)
            } else if integer {
                let (start, min, max) = (start as i32, Some(min as i32), Some(max as i32));
                Variable::parameter_of(VariableKind::Integer { start, min, max }, name, meaning)
            } else {
                Variable::parameter(name, unit, start, meaning).range(min, max)
            });
        }
    }
    first
}

/// Takes over the values that the host has set, or that the FMU was packed with; the others stay as the vehicle file
/// has them.
fn read_groups(groups: &mut [&mut dyn ParameterValues], first: Vr, values: &Values) {
    let mut vr = first;
    for group in groups {
        for (index, parameter) in group.table().iter().enumerate() {
            if values.is_chosen(vr) {
                let value = if parameter.integer { f64::from(values.integer(vr)) } else { values.real(vr) };
                group.set(index, value);
            }
            vr += 1;
        }
    }
}

/// Shows the values in force.
fn write_groups(groups: &[&mut dyn ParameterValues], first: Vr, values: &mut Values) {
    let mut vr = first;
    for group in groups {
        for (index, parameter) in group.table().iter().enumerate() {
            let value = group.get(index);
            if parameter.integer {
                values.set_integer(vr, value as i32);
            } else {
                values.set_real(vr, value);
            }
            vr += 1;
        }
    }
}

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

fn declare<U: ControllerUnit<S>, const S: usize>() -> (Declaration, Variables) {
    let mut declaration = Declaration {
        name: U::NAME,
        description: U::DESCRIPTION,
        variables: Vec::new(),
        binaries: Vec::new(),
        arrays: Vec::new(),
        ends_early: true,
        experiment: DefaultExperiment { start_time: 0.0, stop_time: 60.0, tolerance: 1e-6, step_size: 0.02 },
        log_categories: CATEGORIES,
    };
    let d = &mut declaration;
    let inputs = d.variables.len();
    for (signal, _) in U::INPUTS {
        // The guard bridges it.
        d.add(Variable::input_or_missing(signal));
    }
    let mut output = |signal: &Signal| d.add(Variable::output(signal));
    let (steer_cmd, accel_cmd) = (output(&signal::STEER_CMD), output(&signal::ACCEL_CMD));
    let (e1, e1_rate) = (output(&signal::E1), output(&signal::E1_RATE));
    let (e2, e2_rate) = (output(&signal::E2), output(&signal::E2_RATE));
    let (station, curvature) = (output(&signal::STATION), output(&signal::CURVATURE));
    let curvature_rate = output(&signal::CURVATURE_RATE);
    let mut real = |name: String, unit, meaning: String| d.add(Variable::real_output(name, unit, meaning));
    let speed_ref = real(
        "speed_ref".into(),
        Unit::METRE_PER_SECOND,
        "Speed that the plan asks for at the station".into(),
    );
    let lag_error = real(
        "lag_error".into(),
        Unit::METRE,
        "Distance along the path from the vehicle to the point that the speed's MPC follows; 0 without one"
            .into(),
    );
    let compute_time = real(
        "compute_time".into(),
        Unit::SECOND,
        "Wall-clock time of the newest control step; the only output that is not reproducible".into(),
    );
    let residual_outside = real(
        "residual.outside".into(),
        Unit::ONE,
        "Share of the horizon where the learned residual was asked outside its training and faded out".into(),
    );
    let found = [
        (
            "dead_time",
            "Dead time of the steering actuator as the drive has shown it; that of actuator.* before",
        ),
        ("time_constant", "Time constant of the steering actuator's lag as the drive has shown it"),
        ("spread", "Standard deviation of the sum of both: how sure the controller is"),
    ]
    .map(|(name, meaning)| real(format!("actuator.found.{name}"), Unit::SECOND, meaning.into()));
    let path_length = real("path.length".into(), Unit::METRE, "Length of the path".into());
    let start =
        [("x", Unit::METRE), ("y", Unit::METRE), ("yaw", Unit::RADIAN), ("speed", Unit::METRE_PER_SECOND)]
            .map(|(name, unit)| {
                real(format!("start.{name}"), unit, format!("Start of the path: {name} to begin with"))
            });
    let predicted: Vec<[Vr; 3]> = (1..=U::SHOWN)
        .map(|j| {
            PREDICTED.map(|(name, meaning)| {
                let meaning = format!("{meaning} {j} samples ahead (0 beyond the horizon)");
                real(format!("predicted.{name}[{j}]"), Unit::METRE, meaning)
            })
        })
        .collect();
    for (place, (name, meaning)) in PREDICTED.into_iter().enumerate() {
        let meaning = format!("{meaning} 1 to {} samples ahead (0 beyond the horizon)", U::SHOWN);
        d.add_array(format!("predicted.{name}"), meaning, predicted.iter().map(|at| at[place]).collect());
    }
    let status = d.add(Variable::output_of(
        VariableKind::Enumeration { type_name: "ControlStatus", items: ControlStatus::ITEMS, start: 0 },
        "status",
        "What the newest control step did",
    ));
    let iterations = d.add(Variable::output_of(
        VariableKind::Integer { start: 0, min: Some(0), max: None },
        "qp.iterations",
        "Iterations of the QP solver in the newest control step; 0 if it found no plan",
    ));
    let finished = d.add(Variable::output_of(
        VariableKind::Boolean { start: false },
        "finished",
        "The end of an open path is reached, or a full lap of a closed one is driven",
    ));
    let path_file = d.add(Variable::parameter_of(
        VariableKind::String { start: DEFAULT_PATH.into() },
        "path_file",
        "Path to follow: a CSV file, absolute or in the FMU's resources",
    ));
    let vehicle_file = d.add(vehicle_file_parameter::<U::File>(U::WHAT));
    let variant = VariableKind::Enumeration {
        type_name: "Variant",
        items: ControlVariant::ITEMS,
        start: ControlVariant::Adaptive as i32,
    };
    let variant = d.add(Variable::parameter_of(
        variant,
        "variant",
        "What the controller predicts with. Its learned model is resources/residual/VARIANT.rflm, or residual.file",
    ));
    let residual_file = d.add(Variable::parameter_of(
        VariableKind::String { start: "".into() },
        "residual.file",
        "Learned model (from rfl train), absolute or in the FMU's resources. With variant none, or not set, the kind of \
         model in the file decides; else it must be the variant's. Empty: the model packed for the variant",
    ));
    let propagation =
        VariableKind::Enumeration { type_name: "Propagation", items: Propagation::ITEMS, start: 0 };
    let propagation = d.add(Variable::parameter_of(
        propagation,
        "residual.propagation",
        "How the learned residual enters the prediction",
    ));
    let roll_out = VariableKind::Enumeration { type_name: "RollOut", items: RollOut::ITEMS, start: 1 };
    let roll_out = d.add(Variable::parameter_of(
        roll_out,
        "residual.roll_out",
        "With which model the states are predicted at which the residual is asked",
    ));
    let parameters = add_groups(d, &U::groups(&mut U::defaults()));
    let controller_file = d.add(Variable::parameter_of(
        VariableKind::String { start: "".into() },
        "controller_file",
        "Controller file (TOML, from rfl tune or rfl learn), absolute or in the FMU's resources. Its numbers count more \
         than the vehicle file's; parameters that the host sets itself win over both",
    ));
    let report_warnings = d.add(Variable::parameter_of(
        VariableKind::Boolean { start: false },
        "mpc.report_warnings",
        "Whether a call that did its work returns fmiWarning where the log has a warning, and not fmiOK; many hosts \
         end a run at it",
    ));
    let residual_data = d.add_binary(Variable::parameter_of(
        VariableKind::Binary { max_size: input::MODEL as usize },
        RESIDUAL_DATA,
        "Learned model as the bytes of its file, instead of residual.file. Empty: that file",
    ));
    let variables = Variables {
        inputs,
        steer_cmd,
        accel_cmd,
        e1,
        e1_rate,
        e2,
        e2_rate,
        station,
        curvature,
        curvature_rate,
        residual_outside,
        speed_ref,
        lag_error,
        status,
        iterations,
        compute_time,
        found,
        finished,
        path_length,
        start,
        predicted,
        path_file,
        vehicle_file,
        variant,
        residual_file,
        residual_data,
        propagation,
        roll_out,
        parameters,
        controller_file,
        report_warnings,
    };
    (declaration, variables)
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
        let file: U::File = vehicle_named(values.string(v.vehicle_file), context)?;
        let mut parameters = U::of_file(&file);
        let mut variant_of_file = None;
        let name = values.string(v.controller_file);
        if !name.is_empty() {
            let file = context.locate(name);
            let content = ControllerFile::read(&file).map_err(failed)?;
            content.apply(&mut parameters, &file).map_err(failed)?;
            variant_of_file = content.variant;
        }
        let mut groups = U::groups(&mut parameters);
        read_groups(&mut groups, v.parameters, values);
        write_groups(&groups, v.parameters, values);

        let file = context.locate(values.string(v.path_file));
        let path = Path::read(&file).map_err(|error| {
            failed(format!(
                "{error}. The parameter path_file names the path to follow: a CSV file with columns x, y"
            ))
        })?;
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
        values.set_real(v.path_length, path.length());
        let begin = path.at(0.0);
        for (vr, value) in v.start.iter().zip([begin.x, begin.y, begin.yaw, controller.start_speed()]) {
            values.set_real(*vr, value);
        }
        write_outputs(v, values, &controller);
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
        if !sampler.due(time, controller.parameters().mpc.sample_time) {
            return Ok(());
        }
        let mut measurement = Measurement::default();
        for (index, (_, place)) in U::INPUTS.iter().enumerate() {
            *place(&mut measurement) = values.real(v.inputs + index);
        }
        let before = controller.report().status;
        let report =
            controller.step_at(time, &measurement).map_err(|error| ModelError::Discard(error.to_string()))?;
        let status = report.status;
        if status != before {
            statuses.tell(time, status, controller.bridged_signals(), log);
        }
        write_outputs(v, values, controller);
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
    v: &Variables,
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
        let found = [known.actuator.dead_time, known.actuator.time_constant, known.spread];
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
