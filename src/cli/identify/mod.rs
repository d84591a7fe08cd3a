//! `rfl identify`: the steering actuator's dead time, lag, gain and offset from drives, and into a vehicle file.
//!
//! | file | problem |
//! |---|---|
//! | `step.rs` | a step, recorded or driven here, for the variant `actuator` |
//! | `report.rs` | the result in words |
//! | `check.rs` | closed-loop check of the result |
//! | `into.rs` | a vehicle file with the result |

mod check;
mod into;
mod report;
mod step;

use super::diagnose::steady_steering;
use super::drive::Setup;
use super::files::{check_files, files_behind, given};
use super::logs::{LogArgs, ReadsLogs};
use super::output::write_json;
use super::vehicle::{Commanded, by_kind};
use crate::control::ControlledParameters;
use crate::log::{Finding, FindingSeverity, SteeringLog};
use crate::nominal::{
    DelayModel, IdentifiedActuator, IdentifiedSteering, LateralVehicle, SteeringDrive,
    identify_by_yaw_rate_from_drives, identify_with_limit_from_drives,
};
use crate::path::PathOptions;
use crate::signal::{STEER, YAW_RATE};
use crate::vehicle::{BUILTIN, VehicleParameters as _};
use clap::Args;
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;

/// Identifies the steering actuator from drives: dead time, lag, gain and offset, with intervals, into a vehicle file
#[derive(Debug, Args)]
#[command(
    after_help = "Any drives that steer: bends, a slalom, an ordinary lap. A log needs the columns time, steer_cmd and steer: the angle asked
for and the angle measured, in radians. Jitter, repeats and gaps are mended as by rfl diagnose; wrong rows are left out;
several logs of one vehicle count together. Other columns are left alone.

Each number comes with an interval that holds the truth in nine of ten cases. What the logs do not determine is called
'not excited', with a drive that would; it is written into no file.

Examples:
  rfl identify drive.csv
  rfl identify monday.csv tuesday.csv.gz --into my_car.toml    writes [steering] of the vehicle file; comments stay
  rfl identify drive.csv --by-yaw-rate --vehicle my_car.toml   no angle was measured: yaw_rate and vx instead
  rfl identify drive.csv --from 12 --until 60                  a part of a log
  rfl identify --vehicle truck_simulation --set effect.steer_delay=0.3 --set effect.steer_lag=0.2
                                                               a step of our own vehicle, driven here

A log of a step (shorter than 10 s: half a second of a constant command, a step, a second or two until the angle has
settled) gives the models of the variant actuator, too: first-order lag, Pade approximants."
)]
pub struct IdentifyArgs {
    /// Drive logs of one vehicle (CSV, .csv.gz) [default: a step of --vehicle is driven]
    #[arg(value_name = "LOG")]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    reading: LogArgs,
    /// Car or truck: a vehicle file (TOML) or a built-in name [default: the file of --into, else c_class]
    #[arg(long)]
    vehicle: Option<String>,
    /// Vehicle file to write [steering] into; one that does not exist is made from --vehicle
    #[arg(long, value_name = "FILE", requires = "logs")]
    into: Option<PathBuf>,
    /// A parameter, NAME=VALUE, of whoever has it, as for `rfl drive`
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    /// Only the rows from this time on, s
    #[arg(long, value_name = "SECONDS", requires = "logs")]
    from: Option<f64>,
    /// Only the rows up to this time, s
    #[arg(long, value_name = "SECONDS", requires = "logs")]
    until: Option<f64>,
    /// From the yaw rate, through the linear model of the vehicle: takes up what that gets wrong, too
    #[arg(long)]
    by_yaw_rate: bool,
    /// Height of the step that is driven, rad
    #[arg(long, default_value_t = 0.03)]
    step: f64,
    /// Speed at which it is driven, m/s
    #[arg(long, default_value_t = 8.0)]
    speed: f64,
    /// File for the step that is driven (CSV)
    #[arg(long, value_name = "FILE", conflicts_with = "logs")]
    record: Option<PathBuf>,
    /// No closed loop to see whether knowing it drives better
    #[arg(long)]
    no_check: bool,
    /// File for the results (JSON)
    #[arg(long)]
    json: Option<PathBuf>,
}

/// Result of an identification, and its log.
struct IdentifiedLog {
    drives: Vec<SteeringDrive>,
    findings: Vec<Finding>,
    models: Vec<(DelayModel, IdentifiedActuator)>,
    steering: Option<IdentifiedSteering>,
    /// Rows that were read.
    rows: usize,
    /// Two logs that show different actuators, in words.
    contradiction: Option<String>,
}

/// Runs the command.
///
/// # Errors
/// The fault, its place, and advice.
pub fn run(args: &IdentifyArgs) -> Result<(), Box<dyn Error>> {
    identified(args).map(drop)
}

impl ReadsLogs for IdentifyArgs {
    fn reading(&mut self) -> &mut LogArgs {
        &mut self.reading
    }
}

/// Runs the command and gives what `--json` writes.
///
/// # Errors
/// As [`run`].
pub fn identified(args: &IdentifyArgs) -> Result<Value, Box<dyn Error>> {
    let written = given([("--into", &args.into), ("--record", &args.record), ("--json", &args.json)]);
    let logs: Vec<_> = args.logs.iter().map(|log| ("LOG", log)).collect();
    check_files(&written, &logs)?;
    let vehicle = args.vehicle.as_ref().map(PathBuf::from);
    // A vehicle's file may be completed in its place.
    let results = given([("--record", &args.record), ("--json", &args.json)]);
    check_files(&results, &given([("--vehicle", &vehicle), ("--into", &args.into)]))?;
    let tyres = vehicle.iter().chain(&args.into).flat_map(|file| files_behind(file));
    let tyres: Vec<_> = tyres.map(|file| ("the vehicle", file)).collect();
    check_files(&given([("--into", &args.into)]), &tyres)?;
    args.into.as_deref().map(into::target_of).transpose()?;
    let into = args.into.as_ref().filter(|file| file.exists());
    let name = match (&args.vehicle, into) {
        (Some(name), _) => name.clone(),
        (None, Some(file)) => file.display().to_string(),
        (None, None) => BUILTIN[0].to_owned(),
    };
    by_kind!(&name, identify(args, &name))
}

fn identify<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &IdentifyArgs,
    name: &str,
) -> Result<Value, Box<dyn Error>> {
    let setup = Setup::<P, S, C>::new(None, &PathOptions::default(), P::TEST, name, &args.settings)?;
    let found = found(args, name, &setup)?;
    report::print(&found, args);
    let mut results = report::as_json(&found, args);
    let asked = !args.logs.is_empty() && (args.vehicle.is_some() || args.into.is_some());
    let mut harmful = false;
    if let (true, false, Some(steering)) = (asked, args.no_check, &found.steering)
        && steering.delay.excited
    {
        let rows = check::drives::<P, S, C>(&setup, steering)?;
        harmful = check::print(&rows);
        results["closed_loop"] = check::as_json(&rows);
    }
    let written = match (&args.into, &found.steering, &found.contradiction) {
        (Some(file), _, Some(words)) => Err(format!("{}: not written: {words}", file.display()).into()),
        (Some(file), Some(steering), None) => into::write::<P, S, C>(file, name, args, steering, harmful)
            .map(|changes| {
                results["into"] = json!({"file": file.display().to_string(), "changes": changes});
            }),
        _ => Ok(()),
    };
    if let Some(file) = &args.json {
        write_json(file, &results)?;
    }
    written?;
    report::next(&found, args);
    Ok(results)
}

fn found<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &IdentifyArgs,
    name: &str,
    setup: &Setup<P, S, C>,
) -> Result<IdentifiedLog, Box<dyn Error>> {
    let vehicle = setup.controller.vehicle.nominal();
    let slowest = setup.controller.mpc.min_model_speed;
    let through = args.by_yaw_rate.then_some((&vehicle, slowest));
    let rate_limit = told_rate_limit(args, setup);
    let step = match &args.logs[..] {
        [] => Some(step::drive(setup, name, args)?),
        [file] => Some(step::read(file, args)?).filter(step::is_record),
        _ => None,
    };
    if let Some(step) = step {
        let file = args.logs.first().map(PathBuf::as_path);
        let of = file.map_or(name.to_owned(), |file| file.display().to_string());
        let models = step::models(&step, &of, file, through)?;
        step::report(&step, &models, args);
        let rows = step.time.len();
        let drives = vec![SteeringDrive {
            name: of,
            time: step.time,
            steer_cmd: step.command,
            response: step.response,
            speed: step.speed,
        }];
        // A record that is no drive has its models all the same.
        let steering = from_drives(&drives, through, rate_limit).ok().filter(|found| found.gain.excited);
        return Ok(IdentifiedLog {
            drives,
            findings: step.findings,
            models,
            steering,
            rows,
            contradiction: None,
        });
    }
    args.reading.check_distinct(&args.logs)?;
    let steady = |speed: f64| steady_steering(&vehicle, speed);
    let (mut drives, mut findings, mut rows) = (Vec::new(), Vec::new(), 0);
    let (mut in_other_unit, mut too_short) = (false, None);
    for file in &args.logs {
        let log = args.reading.read(file)?;
        let read = if args.by_yaw_rate {
            SteeringLog::by_yaw_rate(&log, &steady)
        } else {
            // The words for a missing column are the same as for a step.
            step::read(file, args)?;
            SteeringLog::by_angle(&log, &steady)
        };
        let read = match read {
            Err(error) if args.logs.len() > 1 && error.cause.is_too_short() => {
                let words = format!("{error}: left out");
                findings.push(Finding::new(FindingSeverity::Warning, Some("time"), words));
                too_short = Some(error);
                continue;
            }
            read => read?,
        };
        rows += log.column("time").map_or(0, <[f64]>::len);
        in_other_unit |= read.in_other_unit;
        let several = args.logs.len() > 1;
        findings.extend(read.findings.into_iter().map(|finding| match several {
            true => Finding { summary: format!("{}: {}", file.display(), finding.summary), ..finding },
            false => finding,
        }));
        drives.extend(read.drives.into_iter().map(|drive| part_of(drive, args)));
    }
    if let Some(error) = too_short.filter(|_| drives.is_empty()) {
        return Err(error.into());
    }
    let mut steering = from_drives(&drives, through, rate_limit).map_err(|error| match &args.logs[..] {
        [file] => format!("{}: {error}", file.display()),
        _ => error.to_string(),
    })?;
    if in_other_unit {
        findings.extend(leave_to_user(&mut steering));
    }
    let contradiction = contradiction(&drives, through, rate_limit);
    Ok(IdentifiedLog { drives, findings, models: Vec::new(), steering: Some(steering), rows, contradiction })
}

/// Takes out what is in an angle's unknown unit; says what was found of it.
fn leave_to_user(steering: &mut IdentifiedSteering) -> Option<Finding> {
    steering.offset.excited = false;
    let width = steering.shown_backlash();
    steering.backlash = None;
    let width = width?.value;
    let words = format!(
        "the backlash of {width:.4} is in the angle's unit, and is left out: divided by the steering's ratio it is actuator.backlash"
    );
    Some(Finding::new(FindingSeverity::Warning, Some("steer_cmd"), words))
}

/// The rate limit of the vehicle's file, rad/s; infinite where no vehicle is named: that of another one tells nothing.
fn told_rate_limit<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &IdentifyArgs,
    setup: &Setup<P, S, C>,
) -> f64 {
    let named = args.vehicle.is_some() || args.into.as_ref().is_some_and(|file| file.exists());
    let declared = P::Parameters::TABLE.iter().find(|parameter| parameter.name == "steering.rate_limit");
    declared.filter(|_| named).map_or(f64::INFINITY, |parameter| parameter.get(&setup.vehicle))
}

fn from_drives<V: LateralVehicle<S>, const S: usize>(
    drives: &[SteeringDrive],
    through: Option<(&V, f64)>,
    rate_limit: f64,
) -> Result<IdentifiedSteering, crate::nominal::DrivesError> {
    match through {
        Some((vehicle, slowest)) => identify_by_yaw_rate_from_drives(drives, vehicle, slowest),
        None => identify_with_limit_from_drives(drives, rate_limit),
    }
}

/// Two logs that show different actuators, each by itself, in words.
fn contradiction<V: LateralVehicle<S>, const S: usize>(
    drives: &[SteeringDrive],
    through: Option<(&V, f64)>,
    rate_limit: f64,
) -> Option<String> {
    let logs: Vec<&[SteeringDrive]> = drives.chunk_by(|a, b| a.name == b.name).collect();
    if logs.len() < 2 {
        return None;
    }
    let alone: Vec<(&str, IdentifiedSteering)> = logs
        .into_iter()
        .filter_map(|log| Some((log[0].name.as_str(), from_drives(log, through, rate_limit).ok()?)))
        .collect();
    alone.iter().enumerate().find_map(|(place, (name, found))| {
        alone[place + 1..].iter().find_map(|(other, others)| {
            let (quantity, [a, b]) = found.contradiction(others)?;
            Some(format!(
                "the logs contradict each other: {quantity} {:.4} ({:.4} ... {:.4}) in {name}, {:.4} ({:.4} ... {:.4}) in \
                 {other}; give logs of one vehicle, in one state",
                a.value, a.low, a.high, b.value, b.low, b.high
            ))
        })
    })
}

/// The rows between --from and --until.
fn part_of(drive: SteeringDrive, args: &IdentifyArgs) -> SteeringDrive {
    let within =
        |time: f64| args.from.is_none_or(|from| time >= from) && args.until.is_none_or(|until| time <= until);
    let part = |column: &[f64]| -> Vec<f64> {
        drive.time.iter().zip(column).filter(|(time, _)| within(**time)).map(|(_, value)| *value).collect()
    };
    SteeringDrive {
        time: part(&drive.time),
        steer_cmd: part(&drive.steer_cmd),
        response: part(&drive.response),
        speed: part(&drive.speed),
        name: drive.name,
    }
}

/// Name of the response.
fn response(args: &IdentifyArgs) -> &'static str {
    if args.by_yaw_rate { YAW_RATE.name } else { STEER.name }
}

/// Models of a step for the results.
fn models_as_json(found: &IdentifiedLog) -> Vec<Value> {
    found.models.iter().map(|(model, fit)| step::as_json(*model, fit)).collect()
}
