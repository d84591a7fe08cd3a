//! A step of the steering, recorded or driven here: lag, dead time and lag, Pade approximants, for the variant `actuator`.

use super::super::drive::Setup;
use super::super::vehicle::Commanded;
use super::IdentifyArgs;
use crate::log::Finding;
use crate::nominal::{
    ContinuousErrorModel, DelayModel, IdentifiedActuator, IdentifyError, LateralVehicle, SteeringRecord,
};
use crate::signal::{STEER, STEER_CMD, TIME, VX, YAW_RATE};
use crate::vehicle::VehicleInput;
use serde_json::{Value, json};
use std::error::Error;
use std::path::Path;

/// Before the step, and the whole of it, s.
const REST: f64 = 0.5;
const DURATION: f64 = 4.0;
/// Share of its mean that the speed may vary by where a model of one speed is used.
const SPEED_VARIES: f64 = 0.1;
/// Time constants after which an actuator has settled.
const SETTLED: f64 = 3.0;
/// A log with so few values of the command is a record of a step, if it is shorter, s, or begins at rest.
const RECORD: f64 = 10.0;
const FEW_COMMANDS: usize = 4;
/// Deviation of a gain from 1 from which on it is a ratio or a unit.
const GAIN_ODD: f64 = 0.2;

/// The columns of a step.
#[derive(Debug, Default, PartialEq)]
pub(super) struct StepColumns {
    pub time: Vec<f64>,
    pub command: Vec<f64>,
    pub response: Vec<f64>,
    /// Empty where it is not needed.
    pub speed: Vec<f64>,
    /// Line of the file in which the first row stands.
    pub first_line: usize,
    /// What was found when the file was read.
    pub findings: Vec<Finding>,
    /// What was lost then, to go on an error's words with.
    pub losses: String,
}

/// True for a record of a step: of a few commands only, and short or steady from the beginning.
pub(super) fn is_record(step: &StepColumns) -> bool {
    let length = step.time.last().unwrap_or(&0.0) - step.time.first().unwrap_or(&0.0);
    // Several short drives, or a clock that stands, are no record of a step.
    let goes_back = step.time.windows(2).any(|pair| pair[1] < pair[0]);
    if goes_back || step.time.len() > 1 && length == 0.0 {
        return false;
    }
    let mut commands = step.command.clone();
    commands.sort_by(f64::total_cmp);
    commands.dedup();
    let is_step = commands.len() <= FEW_COMMANDS;
    if length.is_nan() || length < RECORD {
        // A part of a drive is as short.
        return is_step;
    }
    is_step && SteeringRecord::new(&step.time, &step.command, &step.response).is_ok()
}

/// The models of the variant `actuator` that fit a record. `of` is the name in messages; `vehicle` is between the
/// actuator and a yaw rate.
pub(super) fn models<V: LateralVehicle<S>, const S: usize>(
    step: &StepColumns,
    of: &str,
    file: Option<&Path>,
    through: Option<(&V, f64)>,
) -> Result<Vec<(DelayModel, IdentifiedActuator)>, Box<dyn Error>> {
    let wrong = |error: IdentifyError| -> Box<dyn Error> {
        match (file, row_of(&error)) {
            (Some(_), Some(row)) => format!("{of}, line {}: {error}{}", step.first_line + row, step.losses),
            (Some(_), None) => format!("{of}: {error}{}", step.losses),
            (None, _) => format!("the step of {of}: {error}"),
        }
        .into()
    };
    let record = SteeringRecord::new(&step.time, &step.command, &step.response).map_err(&wrong)?;
    let through = match through {
        Some((vehicle, slowest)) => {
            let speed = constant_speed(&step.speed, slowest).map_err(|error| format!("{of}: {error}"))?;
            Some(vehicle.model_at(speed)?)
        }
        None => None,
    };
    let mut found = Vec::new();
    for &model in DelayModel::ALL {
        let fit = match &through {
            None => record.identify(model),
            Some(linear) => by_yaw_rate(&record, model, linear),
        };
        match fit {
            Ok(fit) => found.push((model, fit)),
            // The first has the most freedom: where it finds nothing, there is nothing.
            Err(error) if found.is_empty() => return Err(wrong(error)),
            Err(error) => warn!("note: {}: {error}", model.name()),
        }
    }
    Ok(found)
}

fn by_yaw_rate<const S: usize>(
    record: &SteeringRecord,
    model: DelayModel,
    linear: &ContinuousErrorModel<S>,
) -> Result<IdentifiedActuator, IdentifyError> {
    record.identify_by_yaw_rate(model, linear)
}

/// The row that an error is about.
fn row_of(error: &IdentifyError) -> Option<usize> {
    match error {
        IdentifyError::NotFinite { row, .. }
        | IdentifyError::Uneven { row, .. }
        | IdentifyError::NoRest { row } => Some(*row),
        _ => None,
    }
}

/// The log's rows between the two times.
pub(super) fn read(file: &Path, args: &IdentifyArgs) -> Result<StepColumns, Box<dyn Error>> {
    let log = args.reading.read(file)?;
    let response = if args.by_yaw_rate { YAW_RATE.name } else { STEER.name };
    let column = |name: &'static str| {
        log.column(name).ok_or_else(|| {
            let instead = match name {
                "steer" => ", or give --by-yaw-rate, if yaw_rate and vx were measured",
                _ => "",
            };
            format!(
                "{}: the column '{name}' is missing; a step needs time, {} and {response}: record it{instead}",
                file.display(),
                STEER_CMD.name
            )
        })
    };
    let (time, command, response) = (column(TIME.name)?, column(STEER_CMD.name)?, column(response)?);
    let speed = if args.by_yaw_rate { column(VX.name)? } else { &[] };
    if time.is_empty() {
        return Err(format!("{}: no row follows the header; record the drive again", file.display()).into());
    }
    // A time that is no number stays in, to be refused with its line.
    let begin = time
        .iter()
        .position(|time| args.from.is_none_or(|from| time.is_nan() || *time >= from))
        .unwrap_or(time.len());
    let end = time.iter().rposition(|time| args.until.is_none_or(|until| time.is_nan() || *time <= until));
    let end = end.map_or(begin, |last| (last + 1).max(begin));
    if time.is_empty() {
        return Err(format!("{}: the log has no rows{}", file.display(), log.losses()).into());
    }
    if begin == end {
        return Err(
            format!("{}: no row between the times that --from and --until give", file.display()).into()
        );
    }
    let part = |column: &[f64]| column.get(begin..end).unwrap_or_default().to_vec();
    Ok(StepColumns {
        time: part(time),
        command: part(command),
        response: part(response),
        speed: part(speed),
        // After the header; a field with a line break in it, which no log has, would shift it.
        first_line: begin + 2,
        findings: log.findings().collect(),
        losses: log.losses(),
    })
}

/// Drives a step on flat ground, the speed held.
pub(super) fn drive<P: Commanded<S, C>, const S: usize, const C: usize>(
    setup: &Setup<P, S, C>,
    name: &str,
    args: &IdentifyArgs,
) -> Result<StepColumns, Box<dyn Error>> {
    if !(args.speed > 0.0 && args.speed.is_finite() && args.step != 0.0 && args.step.is_finite()) {
        return Err("--speed must be a positive number, --step a number other than 0".into());
    }
    let sample_time = setup.controller.mpc.sample_time;
    let mut vehicle = P::make(&setup.vehicle, &setup.effects, None)?;
    vehicle.place(0.0, 0.0, 0.0, args.speed);
    let mut step = StepColumns::default();
    let mut writer = match &args.record {
        Some(file) => {
            let mut writer =
                csv::Writer::from_path(file).map_err(|error| format!("{}: {error}", file.display()))?;
            writer.write_record([TIME.name, STEER_CMD.name, STEER.name, VX.name, YAW_RATE.name])?;
            Some(writer)
        }
        None => None,
    };
    for k in 0..=(DURATION / sample_time).round() as u32 {
        let time = sample_time * f64::from(k);
        let steer_cmd = if time < REST { 0.0 } else { args.step };
        let measured = vehicle.measured();
        if let Some(writer) = &mut writer {
            let row = [time, steer_cmd, measured.steer, measured.vx, measured.yaw_rate];
            writer.write_record(row.map(|value| value.to_string()))?;
        }
        step.time.push(time);
        step.command.push(steer_cmd);
        step.response.push(if args.by_yaw_rate { measured.yaw_rate } else { measured.steer });
        step.speed.push(measured.vx);
        let accel_cmd = 2.0 * (args.speed - measured.vx);
        vehicle.advance(&VehicleInput { steer_cmd, accel_cmd }, sample_time).map_err(|error| {
            format!("the step of {} at t = {time:.2} s: {error}; give a smaller --step or --speed", name)
        })?;
    }
    if let Some(mut writer) = writer {
        writer.flush()?;
    }
    Ok(step)
}

/// The speed of a record that a model of one speed is used for.
fn constant_speed(speed: &[f64], slowest: f64) -> Result<f64, Box<dyn Error>> {
    let mean = speed.iter().sum::<f64>() / speed.len().max(1) as f64;
    if !mean.is_finite() {
        return Err("vx has gaps: --by-yaw-rate needs the speed in each row".into());
    }
    if mean < slowest {
        return Err(format!(
            "the vehicle drives {mean:.1} m/s: below {slowest} m/s (mpc.min_model_speed) steering shows too little in the \
             yaw rate. Record a faster step, or the measured angle (steer)"
        )
        .into());
    }
    let varies = speed.iter().map(|speed| (speed - mean).abs()).fold(0.0, f64::max);
    if varies > SPEED_VARIES * mean {
        return Err(format!(
            "the speed varies by {varies:.1} m/s about {mean:.1} m/s: the linear model is of one speed. Hold the speed \
             within {:.0} %, or use --from and --until",
            100.0 * SPEED_VARIES
        )
        .into());
    }
    Ok(mean)
}

/// The settings with which the variant `actuator` predicts by the result.
fn settings(found: &IdentifiedActuator) -> [(&'static str, String); 3] {
    let actuator = &found.actuator;
    [
        ("actuator.dead_time_model", actuator.dead_time_model.name().to_owned()),
        ("actuator.dead_time", format!("{:.5}", actuator.dead_time)),
        ("actuator.time_constant", format!("{:.5}", actuator.time_constant)),
    ]
}

/// Prints the models.
pub(super) fn report(step: &StepColumns, found: &[(DelayModel, IdentifiedActuator)], args: &IdentifyArgs) {
    let (what, unit) = if args.by_yaw_rate { ("yaw rate", "rad/s") } else { ("angle", "rad") };
    say!(
        "{:<15} {:>11} {:>8} {:>8} {:>16} {:>12}",
        "model",
        "dead time s",
        "lag s",
        "gain",
        format!("RMS error {unit}"),
        "explained %"
    );
    for (model, fit) in found {
        say!(
            "{:<15} {:>11.4} {:>8.4} {:>8.4} {:>16.2e} {:>12.3}",
            model.name(),
            fit.actuator.dead_time,
            fit.actuator.time_constant,
            fit.gain,
            fit.rmse,
            100.0 * fit.explained
        );
    }
    say!("to predict with it: rfl drive --variant actuator and");
    for (model, fit) in found {
        let line = settings(fit).map(|(name, value)| format!("--set {name}={value}")).join(" ");
        say!("  {:<15} {line}", model.name());
    }
    if let Some((_, best)) = found.first() {
        if !args.by_yaw_rate && (best.gain - 1.0).abs() > GAIN_ODD {
            warn!(
                "note: the {what} settles at {:.3} of the command: is one of them in degrees, or at the steering wheel?",
                best.gain
            );
        }
        let last = (1..step.command.len()).rev().find(|&k| step.command[k] != step.command[k - 1]);
        let left = last.map_or(0.0, |k| step.time[step.time.len() - 1] - step.time[k]);
        let needed = best.actuator.dead_time + SETTLED * best.actuator.time_constant;
        if left < needed {
            warn!(
                "note: the record ends {left:.2} s after the command's last change, before the {what} has settled ({needed:.2} \
                 s): record longer, what was found is uncertain"
            );
        }
    }
}

/// A model for the results.
pub(super) fn as_json(model: DelayModel, fit: &IdentifiedActuator) -> Value {
    let set: Vec<String> = settings(fit).iter().map(|(name, value)| format!("{name}={value}")).collect();
    json!({
        "model": model.name(), "dead_time_model": fit.actuator.dead_time_model.name(),
        "dead_time": fit.actuator.dead_time, "time_constant": fit.actuator.time_constant,
        "gain": fit.gain, "offset": fit.offset, "rmse": fit.rmse, "explained": fit.explained, "set": set,
    })
}
