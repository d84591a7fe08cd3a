//! `rfl identify`: the steering actuator's constants from a recorded step, for the variant `actuator`.

use super::drive::Setup;
use super::vehicle::{Commanded, by_kind};
use crate::control::VehicleParameters;
use crate::log::DriveLog;
use crate::nominal::{
    ContinuousErrorModel, DelayModel, IdentifiedActuator, IdentifyError, LateralVehicle, SteeringRecord,
};
use crate::signal::{STEER, STEER_CMD, TIME, VX, YAW_RATE};
use crate::vehicle::{BUILTIN, VehicleInput};
use clap::Args;
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Identifies the steering actuator from a recorded step: lag, dead time and lag, Pade approximants
#[derive(Debug, Args)]
#[command(
    after_help = "A log needs the columns time, steer_cmd and steer: the angle asked for and the angle measured, in radians, in even \
                  steps. It begins at rest with half a second of a constant command; then comes a step, and a second or two \
                  until the angle has settled. Other columns are left alone.

Examples:
  rfl identify step.csv
  rfl identify drive.csv --from 12 --until 15                  a step within a longer log
  rfl identify step.csv --by-yaw-rate --vehicle my_car.toml    no angle was measured: yaw_rate and vx instead
  rfl identify --vehicle truck_simulation --set effect.steer_delay=0.3 --set effect.steer_lag=0.2
                                                               a step of our own vehicle, driven here"
)]
pub struct IdentifyArgs {
    /// Log of a step of the steering (CSV) [default: a step of --vehicle is driven]
    log: Option<PathBuf>,
    /// Car or truck: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = BUILTIN[0])]
    vehicle: String,
    /// A parameter, NAME=VALUE, of whoever has it, as for `rfl drive`
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    /// Only the rows of the log from this time on, s
    #[arg(long, value_name = "SECONDS", requires = "log")]
    from: Option<f64>,
    /// Only the rows of the log up to this time, s
    #[arg(long, value_name = "SECONDS", requires = "log")]
    until: Option<f64>,
    /// From the yaw rate, through the controller's linear model of the vehicle: takes up what that gets wrong, too
    #[arg(long)]
    by_yaw_rate: bool,
    /// Height of the step that is driven, rad
    #[arg(long, default_value_t = 0.03)]
    step: f64,
    /// Speed at which it is driven, m/s
    #[arg(long, default_value_t = 8.0)]
    speed: f64,
    /// File for the step that is driven (CSV)
    #[arg(long, value_name = "FILE", conflicts_with = "log")]
    record: Option<PathBuf>,
    /// File for the results (JSON)
    #[arg(long)]
    json: Option<PathBuf>,
}

/// Before the step, and the whole of it, s.
const REST: f64 = 0.5;
const DURATION: f64 = 4.0;
/// Share of its mean that the speed may vary by where a model of one speed is used.
const SPEED_VARIES: f64 = 0.1;
/// Time constants after which an actuator has settled.
const SETTLED: f64 = 3.0;
/// A gain farther from 1 than this is a ratio or a unit.
const GAIN_ODD: f64 = 0.2;

/// The columns of a step.
#[derive(Debug, Default, PartialEq)]
struct Step {
    time: Vec<f64>,
    command: Vec<f64>,
    response: Vec<f64>,
    /// Empty where it is not needed.
    speed: Vec<f64>,
    /// Line of the file in which the first row stands.
    first_line: usize,
}

/// Runs the command.
///
/// # Errors
/// What was wrong, where, and what to do.
pub fn run(args: &IdentifyArgs) -> Result<(), Box<dyn Error>> {
    by_kind!(&args.vehicle, identify(args))
}

fn identify<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &IdentifyArgs,
) -> Result<(), Box<dyn Error>> {
    let setup = Setup::<P, S, C>::new(None, P::TEST, &args.vehicle, &args.settings)?;
    let vehicle = setup.controller.vehicle.nominal();
    let (slowest, place) = (setup.controller.mpc.min_model_speed, args.log.as_deref());
    let step = match &args.log {
        Some(file) => read(file, args)?,
        None => drive(setup, args)?,
    };
    let wrong = |error: IdentifyError| -> Box<dyn Error> {
        match (place, row_of(&error)) {
            (Some(file), Some(row)) => format!("{}, line {}: {error}", file.display(), step.first_line + row),
            (Some(file), None) => format!("{}: {error}", file.display()),
            (None, _) => format!("the step of {}: {error}", args.vehicle),
        }
        .into()
    };
    let record = SteeringRecord::new(&step.time, &step.command, &step.response).map_err(&wrong)?;
    let through = if args.by_yaw_rate {
        let of = place.map_or(args.vehicle.clone(), |file| file.display().to_string());
        let speed = constant_speed(&step.speed, slowest).map_err(|error| format!("{of}: {error}"))?;
        Some(vehicle.model_at(speed)?)
    } else {
        None
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
            Err(error) => eprintln!("note: {}: {error}", model.name()),
        }
    }
    report(&step, &found, args)
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
fn read(file: &Path, args: &IdentifyArgs) -> Result<Step, Box<dyn Error>> {
    let log = DriveLog::read(file)?;
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
    // A time that is no number stays in, to be refused with its line.
    let begin = time
        .iter()
        .position(|time| args.from.is_none_or(|from| time.is_nan() || *time >= from))
        .unwrap_or(time.len());
    let end = time.iter().rposition(|time| args.until.is_none_or(|until| time.is_nan() || *time <= until));
    let end = end.map_or(begin, |last| (last + 1).max(begin));
    if begin == end {
        return Err(
            format!("{}: no row between the times that --from and --until give", file.display()).into()
        );
    }
    let part = |column: &[f64]| column.get(begin..end).unwrap_or_default().to_vec();
    Ok(Step {
        time: part(time),
        command: part(command),
        response: part(response),
        speed: part(speed),
        // After the header; a field with a line break in it, which no log has, would shift it.
        first_line: begin + 2,
    })
}

/// Drives a step on flat ground, the speed held.
fn drive<P: Commanded<S, C>, const S: usize, const C: usize>(
    setup: Setup<P, S, C>,
    args: &IdentifyArgs,
) -> Result<Step, Box<dyn Error>> {
    if !(args.speed > 0.0 && args.speed.is_finite() && args.step != 0.0 && args.step.is_finite()) {
        return Err("--speed must be a positive number, --step a number other than 0".into());
    }
    let sample_time = setup.controller.mpc.sample_time;
    let mut vehicle = P::make(&setup.vehicle, &setup.effects, None)?;
    vehicle.place(0.0, 0.0, 0.0, args.speed);
    let mut step = Step::default();
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
            format!(
                "the step of {} at t = {time:.2} s: {error}; give a smaller --step or --speed",
                args.vehicle
            )
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

/// The settings that make the variant `actuator` predict with what was found.
fn settings(found: &IdentifiedActuator) -> [(&'static str, String); 3] {
    let actuator = &found.actuator;
    [
        ("actuator.dead_time_model", actuator.dead_time_model.name().to_owned()),
        ("actuator.dead_time", format!("{:.5}", actuator.dead_time)),
        ("actuator.time_constant", format!("{:.5}", actuator.time_constant)),
    ]
}

fn report(
    step: &Step,
    found: &[(DelayModel, IdentifiedActuator)],
    args: &IdentifyArgs,
) -> Result<(), Box<dyn Error>> {
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
            eprintln!(
                "note: the {what} settles at {:.3} of the command: is one of them in degrees, or at the steering wheel?",
                best.gain
            );
        }
        let last = (1..step.command.len()).rev().find(|&k| step.command[k] != step.command[k - 1]);
        let left = last.map_or(0.0, |k| step.time[step.time.len() - 1] - step.time[k]);
        let needed = best.actuator.dead_time + SETTLED * best.actuator.time_constant;
        if left < needed {
            eprintln!(
                "note: the record ends {left:.2} s after the command's last change, before the {what} has settled ({needed:.2} \
                 s): record longer, what was found is uncertain"
            );
        }
    }
    if let Some(file) = &args.json {
        let models: Vec<Value> = found.iter().map(|(model, fit)| as_json(*model, fit)).collect();
        let value = json!({
            "log": args.log.as_ref().map(|file| file.display().to_string()),
            "response": if args.by_yaw_rate { YAW_RATE.name } else { STEER.name },
            "rows": step.time.len(),
            "models": models,
        });
        std::fs::write(file, serde_json::to_string_pretty(&value)?)
            .map_err(|error| format!("{}: {error}", file.display()))?;
    }
    Ok(())
}

fn as_json(model: DelayModel, fit: &IdentifiedActuator) -> Value {
    let set: Vec<String> = settings(fit).iter().map(|(name, value)| format!("{name}={value}")).collect();
    json!({
        "model": model.name(), "dead_time_model": fit.actuator.dead_time_model.name(),
        "dead_time": fit.actuator.dead_time, "time_constant": fit.actuator.time_constant,
        "gain": fit.gain, "offset": fit.offset, "rmse": fit.rmse, "explained": fit.explained, "set": set,
    })
}
