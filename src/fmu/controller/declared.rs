//! The variables of a controller's FMU.

use super::super::{PLACES, vehicle_file_parameter};
use super::unit::{ControllerUnit, ParameterValues};
use crate::control::{ControlStatus, ControlVariant, Propagation, RollOut};
use crate::fmi::{Declaration, DefaultExperiment, LogCategory, Values, Variable, VariableKind, Vr};
use crate::input;
use crate::parameter::{Choices, Parameter};
use crate::signal::{self, Signal, Unit};

/// Path that the FMU follows when none is named: packed into its `resources/`.
pub const DEFAULT_PATH: &str = "path.csv";

/// Parameter with the bytes of a learned model.
pub(super) const RESIDUAL_DATA: &str = "residual.data";

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

/// References of the declared variables.
pub(super) struct Variables {
    /// The first of the inputs, which are contiguous.
    pub(super) inputs: Vr,
    pub(super) outputs: Outputs,
    pub(super) path_file: Vr,
    pub(super) vehicle_file: Vr,
    pub(super) variant: Vr,
    pub(super) residual_file: Vr,
    /// Not there in every version of the interface.
    pub(super) residual_data: Vr,
    pub(super) propagation: Vr,
    pub(super) roll_out: Vr,
    /// The first of the numeric parameters, which are contiguous.
    pub(super) parameters: Vr,
    pub(super) controller_file: Vr,
    pub(super) report_warnings: Vr,
}

/// References of the outputs.
pub(super) struct Outputs {
    pub(super) steer_cmd: Vr,
    pub(super) accel_cmd: Vr,
    pub(super) e1: Vr,
    pub(super) e1_rate: Vr,
    pub(super) e2: Vr,
    pub(super) e2_rate: Vr,
    pub(super) station: Vr,
    pub(super) curvature: Vr,
    pub(super) curvature_rate: Vr,
    pub(super) residual_outside: Vr,
    pub(super) speed_ref: Vr,
    pub(super) lag_error: Vr,
    pub(super) status: Vr,
    pub(super) iterations: Vr,
    pub(super) compute_time: Vr,
    pub(super) found: [Vr; 4],
    pub(super) finished: Vr,
    pub(super) path_length: Vr,
    pub(super) start: [Vr; 4],
    pub(super) predicted: Vec<[Vr; 3]>,
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
pub(super) fn read_groups(groups: &mut [&mut dyn ParameterValues], first: Vr, values: &Values) {
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
pub(super) fn write_groups(groups: &[&mut dyn ParameterValues], first: Vr, values: &mut Values) {
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

/// The FMU, and the references of its variables.
pub(super) fn declare<U: ControllerUnit<S>, const S: usize>() -> (Declaration, Variables) {
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
    let outputs = add_outputs(d, U::SHOWN);
    let variables = add_parameters::<U, S>(d, inputs, outputs);
    (declaration, variables)
}

/// Declares the outputs; `shown` steps of the prediction are some.
fn add_outputs(d: &mut Declaration, shown: usize) -> Outputs {
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
            Unit::SECOND,
            "Dead time of the steering actuator as the drive has shown it; that of actuator.* before",
        ),
        (
            "time_constant",
            Unit::SECOND,
            "Time constant of the steering actuator's lag as the drive has shown it",
        ),
        ("spread", Unit::SECOND, "Standard deviation of the sum of both: how sure the controller is"),
        (
            "backlash",
            Unit::RADIAN,
            "Width of the steering's gap that is taken up: that of actuator.*, or which the drive has shown",
        ),
    ]
    .map(|(name, unit, meaning)| real(format!("actuator.found.{name}"), unit, meaning.into()));
    let path_length = real("path.length".into(), Unit::METRE, "Length of the path".into());
    let start =
        [("x", Unit::METRE), ("y", Unit::METRE), ("yaw", Unit::RADIAN), ("speed", Unit::METRE_PER_SECOND)]
            .map(|(name, unit)| {
                real(format!("start.{name}"), unit, format!("Start of the path: {name} to begin with"))
            });
    let predicted: Vec<[Vr; 3]> = (1..=shown)
        .map(|j| {
            PREDICTED.map(|(name, meaning)| {
                let meaning = format!("{meaning} {j} samples ahead (0 beyond the horizon)");
                real(format!("predicted.{name}[{j}]"), Unit::METRE, meaning)
            })
        })
        .collect();
    for (place, (name, meaning)) in PREDICTED.into_iter().enumerate() {
        let meaning = format!("{meaning} 1 to {} samples ahead (0 beyond the horizon)", shown);
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
    Outputs {
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
    }
}

/// Declares the parameters, and gathers all references.
fn add_parameters<U: ControllerUnit<S>, const S: usize>(
    d: &mut Declaration,
    inputs: Vr,
    outputs: Outputs,
) -> Variables {
    let path_file = d.add(Variable::parameter_of(
        VariableKind::String { start: DEFAULT_PATH.into() },
        "path_file",
        format!("Path to follow: a CSV file, {PLACES}"),
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
        format!(
            "Learned model (from rfl train), {PLACES}. With variant none, or not set, the kind of model in the file \
             decides; else it must be the variant's. Empty: the model packed for the variant"
        ),
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
        format!(
            "Controller file (TOML, from rfl tune or rfl learn), {PLACES}. Its numbers count more than the vehicle \
             file's; parameters that the host sets itself win over both. Empty: none"
        ),
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
    Variables {
        inputs,
        outputs,
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
    }
}
