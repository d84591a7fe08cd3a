//! `rfl drive`: the closed loop in native code, on any road, with any car or truck.
//!
//! A drive ends in one of four outcomes, the same in text, JSON and exit status. Log and JSON are written in each case.
//!
//! | file | problem |
//! |---|---|
//! | `setup.rs` | road, vehicle and controller, and the numbers that `--set` reaches |
//! | `model.rs` | the controller's prediction model |
//! | `sample_time.rs` | the controller's sample time against the communication step |
//! | `stepwise.rs` | the controller for a program that closes the loop itself |
//! | `report.rs` | the drive in words, files and an exit status |

mod model;
mod report;
mod sample_time;
mod setup;
mod stepwise;

pub(super) use model::{MODELS, ModelArgs};
pub(super) use setup::{Setup, number, setting};
use stepwise::Steps;
pub use stepwise::Stepwise;

use super::files::{Named, check_files, given};
use super::logs::LimitArgs;
use super::path::reading;
use super::require::{Check, Requirement, figures_help, write_junit};
use super::vehicle::{Commanded, VehicleLinearModel, by_kind};
use super::{progress_bar, said};
use crate::control::{ControlVariant, ControllerFile, ControllerFor, PredictionModelFor};
use crate::input;
use crate::simulate::{LaneLimits, STATION};
use crate::vehicle::{BUILTIN, VehicleParameters as _};
use clap::Args;
use report::DriveReport;
use sample_time::{keep_up_with, warn_of_long_steps};
use serde_json::Value;
use setup::{DriveNumbers, Initial};
use std::error::Error;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Drives a car or a truck along a road with the MPC, natively, and says how well it tracked.
#[derive(Debug, Clone, Args)]
#[command(after_help = after_help())]
pub struct DriveArgs {
    /// Road to follow: a CSV file with columns x, y, or a built-in course (rfl course lists them) [default: the vehicle's test route]
    #[arg(long)]
    path: Option<PathBuf>,
    /// Allowed distance of the path from the road's noisy points, RMS in m [default: as accurate as the file is, or its
    /// measured noise]
    #[arg(long, value_name = "METRES", requires = "path")]
    smooth: Option<f64>,
    /// The road leads from its last point to its first [default: if its ends lie so]
    #[arg(long, requires = "path", conflicts_with = "open")]
    closed: bool,
    /// The road ends at its last point
    #[arg(long, requires = "path")]
    open: bool,
    #[command(flatten)]
    limit: LimitArgs,
    /// Car or truck: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = BUILTIN[0])]
    vehicle: String,
    /// Longest drive in s of simulated time; a drive that it cuts on the road is a success [default: 1800, which is none]
    #[arg(long)]
    duration: Option<f64>,
    /// Communication step in s, 0.001 to 0.2
    #[arg(long, default_value_t = 0.02)]
    step: f64,
    /// Controller file (from rfl tune); what is set beside it counts more
    #[arg(long, value_name = "FILE")]
    controller: Option<PathBuf>,
    /// True lateral error in m beyond which the vehicle has left its lane and the drive is lost
    #[arg(long, value_name = "M", default_value_t = LaneLimits::default().lateral_error)]
    lane: f64,
    /// A parameter, NAME=VALUE, of whoever has it; `car.` (`truck.`) or `controller.` before the name means one of them only
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    /// File for the drive log (CSV)
    #[arg(long)]
    log: Option<PathBuf>,
    /// File for the results (JSON)
    #[arg(long)]
    json: Option<PathBuf>,
    /// A figure that must be met, FIGURE<=VALUE or FIGURE=VALUE, such as max_e1=0.5; the figures stand below
    #[arg(long = "require", value_name = "REQUIREMENT")]
    requirements: Vec<Requirement>,
    /// File for the outcome and the requirements as test cases (JUnit XML)
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Class of the test cases in the JUnit file [default: rfl.drive.VEHICLE.ROAD, files with their folder]
    #[arg(long, value_name = "NAME", requires = "junit")]
    junit_name: Option<String>,
    #[command(flatten)]
    model: ModelArgs,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Default time, s, after which a drive is given up.
const LONGEST: f64 = 1800.0;
/// Range of the communication step, s: that of a controller's sample time.
const STEP: (f64, f64) = (0.001, 0.2);
/// Longest drive, s: a day.
const LONGEST_DURATION: f64 = 86_400.0;

fn after_help() -> String {
    format!(
        "{EXAMPLES}

{}

Exit status: 0 completed, or on the road when the --duration given was over; 1 bad input or a failure; 2 wrong usage;
3 stopped before the road's end; 4 lost: off its lane, rolled over, jack-knifed, or it could not be driven on;
5 timed out after {LONGEST} s; 6 a requirement is not met. An outcome that --require outcome=... asks for is 0. Log, JSON and JUnit file are written in each case from 3 on; with
1 and 2 the JUnit file says the error.",
        figures_help()
    )
}

const EXAMPLES: &str = "Examples:
  rfl drive                                            the Sudoku test route, the C-class car
  rfl drive --path road.csv --vehicle my_car.toml --log out/drive.csv
  rfl drive --set mpc.q_e2=1 --set effect.steer_delay=0.06
  rfl drive --set car.vehicle.mass=1600                the car's mass, not the controller's
  rfl drive --set initial.y=149.25 --set initial.vx=5  a start 1 m beside the test route's first point (0, 148.25), at 5 m/s
  rfl drive --vehicle my_car.toml --controller out/tune/controller.toml    as tuned by rfl tune
  rfl drive --vehicle truck_simulation                 the truck's test route, the truck paper's truck
  rfl drive --residual out/residual/rfl_s.rflm         with what rfl train learned
  rfl drive --variant rfl_s                            the same: models are looked for in out/residual
  rfl drive --set effect.steer_lag=0.1 --set effect.steer_delay=0.06    a slow steering: it is found while driving
  rfl drive --variant actuator --set actuator.dead_time=0.06 --set actuator.time_constant=0.1
  rfl drive --variant actuator --set actuator.dead_time=0.12 --set actuator.dead_time_model=pade_2_2
  rfl drive --require 'max_e1<=0.1' --require p99_step_time=0.001 --junit out/drive.xml       a test in CI";

/// A drive: its log and its report.
#[derive(Debug, Clone)]
pub struct DriveResult {
    /// Columns of the log by their names, a value for each communication step.
    pub columns: Vec<(&'static str, Vec<f64>)>,
    /// The controller's status at each step, in a word.
    pub statuses: Vec<&'static str>,
    /// Contents for `--json`.
    pub report: Value,
    /// Exit status.
    pub status: u8,
}

impl DriveArgs {
    /// Checks the numbers against their ranges.
    fn check_numbers(&self) -> Result<(), String> {
        let numbers = [
            ("--step", Some(self.step), STEP, "the controller is called once a step"),
            ("--duration", self.duration, (STEP.0, LONGEST_DURATION), "the time that is driven at most"),
        ];
        for (name, value, (least, most), meaning) in numbers {
            if let Some(value) = value.filter(|value| !(least..=most).contains(value)) {
                return Err(format!("{name} {value}: give a time between {least} and {most} s ({meaning})"));
            }
        }
        if !(self.lane.is_finite() && self.lane > 0.0) {
            return Err(format!("--lane {}: give a width in m that is greater than 0", self.lane));
        }
        Ok(())
    }

    /// Checks the files that are written.
    fn check_files(&self) -> Result<(), Box<dyn Error>> {
        let junit = given([("--junit", &self.junit)]);
        let results = given([("--log", &self.log), ("--json", &self.json)]);
        let read = self.read();
        let fault = check_files(&[&results[..], &junit].concat(), &read).err();
        // Only a file that is no other is one that may say so.
        if let Some(fault) = &fault
            && check_files(&junit, &[&results[..], &read].concat()).is_ok()
        {
            self.report_error(fault.as_ref());
        }
        fault.map_or(Ok(()), Err)
    }

    /// The files that are read.
    fn read(&self) -> Vec<Named<&Path>> {
        let mut read = given([("--path", &self.path), ("--controller", &self.controller)]);
        read.extend(self.model.files());
        read.push(("--vehicle", Path::new(&self.vehicle)));
        read
    }

    /// Class of the test cases: drives of other vehicles or roads have others.
    fn junit_class(&self) -> String {
        self.junit_name.clone().unwrap_or_else(|| class_of(&self.vehicle, self.path.as_deref()))
    }

    /// Writes the JUnit file of a drive that is none: an older one would say how another drive went.
    fn report_error(&self, error: &dyn Error) {
        if let Some(file) = &self.junit {
            let written =
                write_junit(file, "rfl drive", &self.junit_class(), 0.0, &[Check::error(error.to_string())]);
            if let Err(error) = written {
                warn!("error: {error}");
            }
        }
    }
}

/// Class of the test cases of a vehicle on a road.
fn class_of(vehicle: &str, road: Option<&Path>) -> String {
    let of_file = |file: &Path| {
        let folder =
            file.parent().and_then(Path::file_name).map(|name| format!("{}.", name.to_string_lossy()));
        format!("{}{}", folder.unwrap_or_default(), file.file_stem().unwrap_or_default().to_string_lossy())
    };
    let road = road.map_or("test_route".to_owned(), of_file);
    format!("rfl.drive.{}.{road}", of_file(Path::new(vehicle)))
}

/// The command's name.
pub(super) const NAME: &str = "drive";

/// Writes the JUnit file of a call that is none. It cannot be told what the words of such a call name: a file that is no JUnit
/// file is left alone.
pub(super) fn report_usage(words: &[OsString], error: &clap::Error) {
    let words: Vec<&str> = words.iter().filter_map(|word| word.to_str()).collect();
    let value = |option: &str| {
        let at = words.iter().rposition(|word| {
            word.strip_prefix(option).is_some_and(|rest| rest.is_empty() || rest.starts_with('='))
        })?;
        words[at].split_once('=').map(|(_, value)| value).or(words.get(at + 1).copied())
    };
    let Some(file) = value("--junit").map(Path::new) else { return };
    let is_another = file.exists() && !input::read_text(file).is_ok_and(|text| text.contains("<testsuite"));
    if is_another || file.to_string_lossy().starts_with('-') {
        return;
    }
    let vehicle = value("--vehicle").unwrap_or(BUILTIN[0]);
    let class = value("--junit-name")
        .map_or_else(|| class_of(vehicle, value("--path").map(Path::new)), str::to_owned);
    if let Err(error) = write_junit(file, "rfl drive", &class, 0.0, &[Check::error(said(error))]) {
        warn!("error: {error}");
    }
}

/// Runs the command.
///
/// # Errors
/// The fault, its place, and advice.
pub fn run(args: &DriveArgs) -> Result<u8, Box<dyn Error>> {
    Ok(driven(args)?.status)
}

/// Runs the command and gives the drive.
///
/// # Errors
/// As [`run`].
pub fn driven(args: &DriveArgs) -> Result<DriveResult, Box<dyn Error>> {
    args.check_files()?;
    let driven = args.check_numbers().map_err(Into::into).and_then(|()| by_kind!(&args.vehicle, drive(args)));
    driven.inspect_err(|error| args.report_error(error.as_ref()))
}

/// The controller that the command drives with.
///
/// # Errors
/// As [`run`].
pub fn controller(args: &DriveArgs) -> Result<Box<dyn Stepwise>, Box<dyn Error>> {
    args.check_numbers()?;
    by_kind!(&args.vehicle, controller_of(args))
}

fn controller_of<P: Commanded<S, C, Nominal: Send>, const S: usize, const C: usize>(
    args: &DriveArgs,
) -> Result<Box<dyn Stepwise>, Box<dyn Error>>
where
    Steps<P::Nominal, S>: Send + 'static,
{
    let (setup, _, model) = set_up::<P, S, C>(args)?;
    let controller = ControllerFor::predicting_with(setup.controller, setup.path, model.clone())?;
    Ok(Box::new(Steps { controller, model }))
}

/// Road, vehicle and controller from the arguments, and the controller's prediction model.
#[allow(clippy::type_complexity)]
fn set_up<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &DriveArgs,
) -> Result<
    (Setup<P, S, C>, ControlVariant, PredictionModelFor<VehicleLinearModel<P, S, C>, S>),
    Box<dyn Error>,
> {
    let reading = reading(args.smooth, [args.closed, args.open], &args.limit);
    let mut setup = DriveNumbers::<P, S, C>::of(&args.vehicle)?;
    let mut model = args.model.clone();
    if let Some(file) = &args.controller {
        let read = ControllerFile::read(file)?;
        read.apply::<P::Nominal, S>(&mut setup.controller, file)?;
        if let Some(note) = read.for_another(setup.vehicle.name()) {
            warn!("note: controller file {}: {note}", file.display());
        }
        model.prefer(read.variant);
    }
    let sample_time = setup.controller.mpc.sample_time;
    args.settings.iter().try_for_each(|text| setup.apply(text))?;
    let (mut variant, mut model) = model.choose(&setup.controller)?;
    let mut setup = setup.on(args.path.as_deref(), &reading, P::TEST)?;
    keep_up_with(args.step, sample_time, (&mut variant, &mut model), &mut setup.controller)?;
    if let Some(warning) = setup.controller.too_tight::<S>(&setup.path) {
        warn!("warning: {warning}");
    }
    if let Some(note) = setup.controller.slower_than_told(&setup.path) {
        warn!("note: {note}");
    }
    Ok((setup, variant, model))
}

fn drive<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &DriveArgs,
) -> Result<DriveResult, Box<dyn Error>> {
    let mut args = args.clone();
    let initial = Initial::take(&mut args.settings, P::KIND)?;
    let args = &args;
    let (setup, variant, model) = set_up::<P, S, C>(args)?;
    let sample_time = setup.controller.mpc.sample_time;
    let bar = progress_bar("driving", setup.path.length(), args.quiet);
    let limits = LaneLimits { lateral_error: args.lane, ..LaneLimits::default() };
    let mut closed = setup.connect(model, args.step)?.with_limits(limits).placed(initial.0);
    warn_of_long_steps(args.step, sample_time);
    let begin = std::time::Instant::now();
    let drive = closed.record(args.duration.unwrap_or(LONGEST), |row, _| {
        bar.set_position(row[STATION].max(0.0) as u64);
        true
    });
    let wall = begin.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let found = closed.controller().known_actuator();
    DriveReport::of(&drive, variant, sample_time, wall, found, args).give(&drive, args)
}
