//! `rfl drive`: the closed loop in native code, on any road, with any car or truck.
//!
//! A drive ends in one of four outcomes, the same in text, JSON and exit status. Log and JSON are written in each case.

use super::logs::LimitArgs;
use super::output::{check_writable, write_file, write_json};
use super::require::{Check, Figures, Requirement, figures_help, write_junit};
use super::vehicle::{Commanded, VehicleLinearModel, by_kind, vehicle_named};
use super::{named, progress_bar};
use crate::control::{
    Choice, ControlVariant, ControlledParameters, ControllerFile, ControllerFor, ControllerParametersFor,
    KnownActuator, Measurement, PredictionModelFor, Propagation, RollOut, Sampler, StepError, StepReport,
};
use crate::parameter::{NoValue, Parameter};
use crate::path::sudoku::Route;
use crate::path::{Path, PathOptions, RoadClass, Smoothing};
use crate::simulate::{
    ClosedLoopFor, DriveFor, LaneLimits, Outcome, Place, STATION, SimulatedVehicle, StepTimes, TIME,
};
use crate::vehicle::{BUILTIN, VehicleParameters as VehicleFile};
use clap::Args;
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

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
    #[command(flatten)]
    limit: LimitArgs,
    /// Car or truck: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = BUILTIN[0])]
    vehicle: String,
    /// Longest drive in s of simulated time; a drive that it cuts on the road is a success [default: 1800, which is none]
    #[arg(long)]
    duration: Option<f64>,
    /// Communication step in s
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
    #[command(flatten)]
    model: ModelArgs,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Default time, s, after which a drive is given up.
const LONGEST: f64 = 1800.0;

/// Exit status of a requirement that is not met.
const NOT_MET: u8 = 6;

/// Exit status of an outcome; `cut`: the user chose the duration.
fn status(outcome: Outcome, cut: bool, met: bool) -> u8 {
    match outcome {
        Outcome::Stopped => 3,
        Outcome::Lost => 4,
        Outcome::TimedOut if !cut => 5,
        _ if !met => NOT_MET,
        Outcome::Completed | Outcome::TimedOut => 0,
    }
}

fn after_help() -> String {
    format!(
        "{EXAMPLES}

{}

Exit status: 0 completed, or on the road when the --duration given was over; 1 bad input or a failure; 2 wrong usage;
3 stopped before the road's end; 4 lost: off its lane, rolled over, jack-knifed, or it could not be driven on;
5 timed out after {LONGEST} s; 6 a requirement is not met. Log, JSON and JUnit file are written in each case from 3 on.",
        figures_help()
    )
}

const EXAMPLES: &str = "Examples:
  rfl drive                                            the Sudoku test route, the C-class car
  rfl drive --path road.csv --vehicle my_car.toml --log out/drive.csv
  rfl drive --set mpc.q_e2=1 --set effect.steer_delay=0.06
  rfl drive --set car.vehicle.mass=1600                the car's mass, not the controller's
  rfl drive --set initial.y=1 --set initial.vx=5       a start beside the road's first point, at another speed
  rfl drive --vehicle my_car.toml --controller out/tune/controller.toml    as tuned by rfl tune
  rfl drive --vehicle truck_simulation                 the truck's test route, the truck paper's truck
  rfl drive --residual out/residual/rfl_s.rflm         with what rfl train learned
  rfl drive --variant rfl_s                            the same: models are looked for in out/residual
  rfl drive --set effect.steer_lag=0.1 --set effect.steer_delay=0.06    a slow steering: it is found while driving
  rfl drive --variant actuator --set actuator.dead_time=0.06 --set actuator.time_constant=0.1
  rfl drive --variant actuator --set actuator.dead_time=0.12 --set actuator.dead_time_model=pade_2_2
  rfl drive --require 'max_e1<=0.1' --require p99_step_time=0.001 --junit out/drive.xml       a test in CI";

/// Prediction model of the controller: the same words as the FMU's.
#[derive(Debug, Clone, Args)]
pub(super) struct ModelArgs {
    /// Prediction model of the controller; none with --residual: what the file is for
    #[arg(long, default_value = "adaptive", hide_possible_values = true, value_parser = named(ControlVariant::ALL, ControlVariant::name, ControlVariant::meaning))]
    variant: ControlVariant,
    /// Learned model to predict with (from rfl train) [default: VARIANT.rflm in --models]
    #[arg(long, value_name = "FILE")]
    residual: Option<PathBuf>,
    /// Folder with a learned model for each variant
    #[arg(long, value_name = "DIR", default_value = MODELS)]
    models: PathBuf,
    /// Add the residual without propagating it, as printed by Zhao et al., eq. (9)
    #[arg(long)]
    direct: bool,
}

/// Folder in which `rfl train` puts models and `rfl drive` looks for them.
pub(super) const MODELS: &str = "out/residual";

/// A variant and its prediction model.
type Chosen<G, const S: usize> =
    (ControlVariant, PredictionModelFor<<G as ControlledParameters<S>>::Vehicle, S>);

impl ModelArgs {
    /// Takes a file's variant if the command line asks for none.
    pub fn prefer(&mut self, variant: Option<ControlVariant>) {
        if let (ControlVariant::None, None, Some(variant)) = (self.variant, &self.residual, variant) {
            self.variant = variant;
        }
    }

    /// The variant and its model for a controller with these parameters.
    pub fn choose<G: ControlledParameters<S>, const S: usize>(
        &self,
        parameters: &ControllerParametersFor<G>,
    ) -> Result<Chosen<G, S>, Box<dyn Error>> {
        let choice = Choice {
            variant: self.variant,
            file: self.residual.clone(),
            folder: self.models.clone(),
            propagation: if self.direct { Propagation::Direct } else { Propagation::Propagated },
            roll_out: RollOut::Corrected,
        };
        Ok(choice.prediction_model(parameters)?)
    }
}

/// A road, and the parameters of vehicle and controller that `--set` reaches.
pub(super) struct Setup<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> {
    pub path: Arc<Path>,
    pub controller: ControllerParametersFor<P::Nominal>,
    pub vehicle: P::Parameters,
    pub effects: P::Effects,
}

impl<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> Setup<P, S, C> {
    /// Reads road and vehicle and applies the settings.
    pub fn new(
        path: Option<&std::path::Path>,
        reading: &PathOptions,
        course: Route,
        vehicle: &str,
        settings: &[String],
    ) -> Result<Self, Box<dyn Error>> {
        let path = Arc::new(match path {
            Some(road) => Path::named(road, reading)?,
            None => course.path()?,
        });
        Self::on(path, vehicle, settings)
    }

    /// As [`new`](Self::new), on a road that is read already.
    pub fn on(path: Arc<Path>, vehicle: &str, settings: &[String]) -> Result<Self, Box<dyn Error>> {
        for note in path.notes() {
            warn!("{}: {note}", if note.warning { "warning" } else { "note" });
        }
        let vehicle: P::Parameters = vehicle_named(vehicle)?;
        let controller = P::controller(&vehicle);
        let effects = vehicle.effects().clone();
        let mut setup = Self { path, controller, vehicle, effects };
        settings.iter().try_for_each(|text| setup.apply(text))?;
        Ok(setup)
    }

    /// Connects controller and vehicle at the road's beginning, with a communication step in s.
    pub fn connect(
        self,
        model: PredictionModelFor<VehicleLinearModel<P, S, C>, S>,
        step: f64,
    ) -> Result<ClosedLoopFor<P, S, C>, Box<dyn Error>> {
        let controller = ControllerFor::predicting_with(self.controller, self.path, model)?;
        Ok(ClosedLoopFor::at_start(controller, &self.vehicle, &self.effects, step)?)
    }

    fn apply(&mut self, text: &str) -> Result<(), Box<dyn Error>> {
        let (full_name, value) = setting(text)?;
        let (controller, vehicle, name) = match full_name.split_once('.') {
            Some((kind, name)) if kind == P::KIND => (false, true, name),
            Some(("controller", name)) => (true, false, name),
            _ => (true, true, full_name),
        };
        let declared = ControllerParametersFor::<P::Nominal>::declared(name).filter(|_| controller);
        let value = number(text, declared, value)?;
        let mut found = false;
        if controller {
            found |= self.controller.set::<S>(name, value)?;
        }
        if vehicle {
            if let Some(parameter) = P::Parameters::TABLE.iter().find(|parameter| parameter.name == name) {
                parameter.set(&mut self.vehicle, value);
                found = true;
            }
            let effect = name.strip_prefix("effect.").and_then(|id| P::effect(&mut self.effects, id));
            if let Some(effect) = effect {
                *effect = value;
                found = true;
            }
        }
        if found {
            return Ok(());
        }
        Err(format!("--set {text}: there is no number '{name}' to set; 'rfl parameters' lists all").into())
    }
}

/// Pose and speed at the start as set, in the order of [`Initial::NAMES`]; where not set, those of the road.
struct Initial([Option<f64>; 4]);

impl Initial {
    /// Names of the numbers, as the FMUs have them.
    const NAMES: [&str; 4] = ["initial.x", "initial.y", "initial.yaw", "initial.vx"];

    /// Takes its settings out of all; `kind` is the word for the vehicle that may stand before a name.
    fn take(settings: &mut Vec<String>, kind: &str) -> Result<Self, Box<dyn Error>> {
        let mut all = Self([None; 4]);
        for text in std::mem::take(settings) {
            let named = setting(&text).ok().and_then(|(name, value)| {
                let own = name.strip_prefix(kind).and_then(|rest| rest.strip_prefix('.')).unwrap_or(name);
                Some((Self::NAMES.iter().position(|known| *known == own)?, value))
            });
            let Some((place, value)) = named else {
                settings.push(text);
                continue;
            };
            let value = number(&text, None, value)?;
            if !value.is_finite() {
                return Err(format!("--set {text}: a finite number is needed").into());
            }
            all.0[place] = Some(value);
        }
        Ok(all)
    }
}

/// Name and value of a setting `NAME=VALUE`.
pub(super) fn setting(text: &str) -> Result<(&str, &str), Box<dyn Error>> {
    let (name, value) =
        text.split_once('=').ok_or_else(|| format!("--set {text}: write it as NAME=VALUE"))?;
    Ok((name.trim(), value.trim()))
}

/// The number of a setting's value: a number or, of a declared parameter whose values have names, a name.
pub(super) fn number(text: &str, declared: Option<&Parameter>, value: &str) -> Result<f64, Box<dyn Error>> {
    let number = match declared {
        Some(parameter) => parameter.read(value),
        None => value.parse().map_err(|_| NoValue::NotANumber { text: value.to_owned() }),
    };
    number.map_err(|error| format!("--set {text}: {error}").into())
}

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
    let positive = |value: f64| value.is_finite() && value > 0.0;
    if !(positive(args.step) && args.duration.is_none_or(positive) && positive(args.lane)) {
        return Err("--step, --duration and --lane must be positive".into());
    }
    for file in [&args.log, &args.json, &args.junit].into_iter().flatten() {
        check_writable(file)?;
    }
    by_kind!(&args.vehicle, drive(args))
}

/// A controller that is called step by step.
pub trait Stepwise: Send {
    /// One control step, at a time in s; without, a sample time after the one before.
    ///
    /// # Errors
    /// A first measurement that is not finite.
    fn step(&mut self, time: Option<f64>, measured: &Measurement) -> Result<StepReport, StepError>;

    /// Sample time, s.
    fn sample_time(&self) -> f64;

    /// Start of the road and planned speed there: x, y, yaw, speed.
    fn start(&self) -> [f64; 4];

    /// Length of the road, m.
    fn length(&self) -> f64;

    /// Dead time and lag of the steering actuator, and the uncertainty of their sum, as the drive has shown them, s.
    fn actuator(&self) -> Option<[f64; 3]>;
}

impl<G: ControlledParameters<S>, const S: usize> Stepwise for ControllerFor<G, S>
where
    ControllerFor<G, S>: Send,
{
    fn step(&mut self, time: Option<f64>, measured: &Measurement) -> Result<StepReport, StepError> {
        match time {
            Some(time) => self.step_at(time, measured).copied(),
            None => ControllerFor::step(self, measured).copied(),
        }
    }

    fn sample_time(&self) -> f64 {
        self.parameters().mpc.sample_time
    }

    fn start(&self) -> [f64; 4] {
        let begin = self.path().at(0.0);
        [begin.x, begin.y, begin.yaw, self.start_speed()]
    }

    fn length(&self) -> f64 {
        self.path().length()
    }

    fn actuator(&self) -> Option<[f64; 3]> {
        let KnownActuator { actuator, spread, .. } = self.known_actuator()?;
        Some([actuator.dead_time, actuator.time_constant, spread])
    }
}

/// The controller that the command drives with.
///
/// # Errors
/// As [`run`].
pub fn controller(args: &DriveArgs) -> Result<Box<dyn Stepwise>, Box<dyn Error>> {
    by_kind!(&args.vehicle, controller_of(args))
}

fn controller_of<P: Commanded<S, C, Nominal: Send>, const S: usize, const C: usize>(
    args: &DriveArgs,
) -> Result<Box<dyn Stepwise>, Box<dyn Error>>
where
    ControllerFor<P::Nominal, S>: Send + 'static,
{
    let (setup, _, model) = set_up::<P, S, C>(args)?;
    Ok(Box::new(ControllerFor::predicting_with(setup.controller, setup.path, model)?))
}

/// Road, vehicle and controller from the arguments, and the controller's prediction model.
#[allow(clippy::type_complexity)]
fn set_up<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &DriveArgs,
) -> Result<
    (Setup<P, S, C>, ControlVariant, PredictionModelFor<VehicleLinearModel<P, S, C>, S>),
    Box<dyn Error>,
> {
    let smoothing = args.smooth.map_or(Smoothing::AsAccurate, Smoothing::Within);
    let reading = PathOptions { smoothing, ..args.limit.road() };
    let mut setup = Setup::<P, S, C>::new(args.path.as_deref(), &reading, P::TEST, &args.vehicle, &[])?;
    let mut model = args.model.clone();
    if let Some(file) = &args.controller {
        let read = ControllerFile::read(file)?;
        read.apply::<P::Nominal, S>(&mut setup.controller, file)?;
        model.prefer(read.variant);
    }
    let sample_time = setup.controller.mpc.sample_time;
    args.settings.iter().try_for_each(|text| setup.apply(text))?;
    keep_up_with(args.step, sample_time, &model, &mut setup.controller)?;
    if let Some(warning) = setup.controller.too_tight::<S>(&setup.path) {
        warn!("warning: {warning}");
    }
    let (variant, model) = model.choose(&setup.controller)?;
    Ok((setup, variant, model))
}

/// A controller is called once a communication step at most: one that computes more often predicts steps that do not come.
/// Its sample time becomes the step, unless it was set (`own` is the one before) or a learned model has it.
fn keep_up_with<G: ControlledParameters<S>, const S: usize>(
    step: f64,
    own: f64,
    model: &ModelArgs,
    controller: &mut ControllerParametersFor<G>,
) -> Result<(), Box<dyn Error>> {
    let sample_time = controller.mpc.sample_time;
    if !Sampler::is_outpaced(step, sample_time) || sample_time != own || is_learned(model) {
        return Ok(());
    }
    let mut longer = *controller;
    longer.mpc.sample_time = step;
    longer.check::<S>().map_err(|error| format!("--step {step}, the controller's sample time: {error}"))?;
    *controller = longer;
    warn!(
        "note: mpc.sample_time = {step} s, the communication step: the controller is not called more often"
    );
    Ok(())
}

fn is_learned(model: &ModelArgs) -> bool {
    model.variant.is_learned() || model.residual.is_some()
}

/// Warns of a sample time that is shorter than the communication step, of a controller that has been made.
fn warn_of_long_steps(step: f64, sample_time: f64, model: &ModelArgs) {
    if Sampler::is_outpaced(step, sample_time) {
        let why = if is_learned(model) { "the learned model's" } else { "as set" };
        warn!(
            "warning: the controller predicts steps of {sample_time} s (mpc.sample_time, {why}), and is called every \
             {step} s (--step): what it predicts does not come, and the vehicle may leave the road"
        );
    }
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
    warn_of_long_steps(args.step, sample_time, &args.model);
    let begin = std::time::Instant::now();
    let drive = closed.record(args.duration.unwrap_or(LONGEST), |row, _| {
        bar.set_position(row[STATION].max(0.0) as u64);
        true
    });
    let wall = begin.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let found = closed.controller().known_actuator();
    DriveReport { found, ..DriveReport::of(&drive, variant, sample_time, wall, args) }.give(&drive, args)
}

/// Report of a drive.
struct DriveReport {
    figures: Figures,
    times: StepTimes,
    variant: ControlVariant,
    /// Time that the drive took on the clock, s.
    wall: f64,
    /// The outcome first, then the requirements.
    checks: Vec<Check>,
    status: u8,
    /// Place of the largest lateral error.
    largest: Option<Place>,
    /// The steering actuator as the drive has shown it.
    found: Option<KnownActuator>,
}

impl DriveReport {
    fn of<const C: usize>(
        drive: &DriveFor<C>,
        variant: ControlVariant,
        sample_time: f64,
        wall: f64,
        args: &DriveArgs,
    ) -> Self {
        let figures = Figures::of(drive, sample_time, wall);
        let required: Vec<Check> = args.requirements.iter().map(|wanted| wanted.check(&figures)).collect();
        let outcome = drive.ending.outcome;
        let met = required.iter().all(|check| check.met);
        let cut = args.duration.is_some();
        let mut checks = vec![Check {
            name: "outcome".to_owned(),
            met: status(outcome, cut, true) == 0,
            words: format!("{}: {}", outcome.name(), drive.ending.reason()),
        }];
        checks.extend(required);
        let errors = drive.lateral_errors.iter().zip(&drive.rows);
        let largest = errors.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        Self {
            times: drive.times(sample_time),
            variant,
            wall,
            checks,
            status: status(outcome, cut, met),
            largest: largest.map(|(&lateral_error, row)| Place {
                time: row[TIME],
                station: row[STATION],
                lateral_error,
                ..Place::default()
            }),
            figures,
            found: None,
        }
    }

    /// Writes all files, then prints. A file that cannot be written keeps none of the others from it.
    fn give<const C: usize>(
        &self,
        drive: &DriveFor<C>,
        args: &DriveArgs,
    ) -> Result<DriveResult, Box<dyn Error>> {
        let report = self.json(drive);
        let log = args.log.as_ref().map(|file| write_file(file, |to| Ok(drive.write_csv(to)?)));
        let json = args.json.as_ref().map(|file| write_json(file, &report));
        let class = args.path.as_deref().and_then(std::path::Path::file_stem);
        let class = class.map_or("test_route".into(), |stem| stem.to_string_lossy());
        let junit = args.junit.as_ref().map(|file| {
            write_junit(file, "rfl drive", &format!("rfl.drive.{class}"), self.wall, &self.checks)
        });
        self.print(drive, args);
        for written in [log, json, junit].into_iter().flatten() {
            written?;
        }
        Ok(DriveResult {
            columns: drive.columns.iter().map(|signal| (signal.name, drive.column(signal.name))).collect(),
            statuses: drive.statuses.iter().map(|status| status.name()).collect(),
            report,
            status: self.status,
        })
    }

    fn json<const C: usize>(&self, drive: &DriveFor<C>) -> Value {
        let ending = &drive.ending;
        let StepTimes { step, look_up, condense, solve } = self.times;
        let classes: serde_json::Map<String, Value> = RoadClass::ALL
            .into_iter()
            .map(|class| (class, drive.tracking_on(class)))
            .filter(|(_, metrics)| metrics.count > 0)
            .map(|(class, metrics)| (class.name().to_owned(), json!(metrics)))
            .collect();
        let place =
            |at: Place| json!({ "time": at.time, "station": at.station, "lateral_error": at.lateral_error });
        let requirements: Vec<Value> = self.checks[1..]
            .iter()
            .map(|check| json!({ "requirement": check.name, "met": check.met, "summary": check.words, "words": check.words }))
            .collect();
        json!({
            "outcome": ending.outcome.name(),
            "reason": ending.reason(),
            "end": place(ending.place),
            "left_lane": ending.departure.map(place),
            "largest": self.largest.map(place),
            "length": ending.length,
            "driven": ending.driven,
            "variant": self.variant.name(),
            "actuator": self.found.map(|found| json!({
                "dead_time": found.actuator.dead_time,
                "time_constant": found.actuator.time_constant,
                "spread": found.spread,
            })),
            "tracking": self.figures.tracking,
            "classes": classes,
            "duration": self.figures.duration,
            "finished": drive.finished,
            "real_time_factor": self.figures.real_time_factor,
            "step": step,
            "parts": { "look_up": look_up, "condense": condense, "solve": solve },
            "requirements": requirements,
            "exit_status": self.status,
        })
    }

    fn print<const C: usize>(&self, drive: &DriveFor<C>, args: &DriveArgs) {
        let all = &self.figures.tracking;
        say!("{:<16} {:>9} {:>9} {:>9} {:>8}", "lateral error", "mean m", "RMS m", "max m", "share %");
        let line = |name: &str, metrics: &crate::simulate::TrackingMetrics| {
            let share = 100.0 * metrics.count as f64 / all.count.max(1) as f64;
            say!("{name:<16} {:>9.4} {:>9.4} {:>9.4} {share:>8.1}", metrics.mae, metrics.rmse, metrics.max);
        };
        line("whole drive", all);
        for class in RoadClass::ALL {
            let metrics = drive.tracking_on(class);
            if metrics.count > 0 {
                line(class.name(), &metrics);
            }
        }
        let step = &self.times.step;
        say!(
            "step time: mean {:.0} us, p99 {:.0} us, max {:.0} us, {} over Ts",
            1e6 * step.mean_s,
            1e6 * step.p99_s,
            1e6 * step.max_s,
            step.missed
        );
        let (driven, factor) = (self.figures.duration, self.figures.real_time_factor);
        say!("{driven:.2} s driven in {:.2} s ({factor:.0} times real time)", self.wall);
        if let Some(found) = self.found {
            let KnownActuator { actuator, spread, shown } = found;
            let (dead_time, lag) = (actuator.dead_time, actuator.time_constant);
            if shown {
                say!(
                    "steering as driven: dead time {dead_time:.3} s, lag {lag:.3} s; the sum within {spread:.3} s"
                );
            } else {
                say!("steering: the drive does not show its dead time and lag");
            }
        }
        for check in &self.checks[1..] {
            say!("{}: {}", if check.met { "met" } else { "NOT met" }, check.words);
        }
        let at = self.largest.map_or(String::new(), |at| {
            let error = at.lateral_error.abs();
            format!(
                "; farthest from the path {error:.3} m, at {:.2} s and station {:.0} m",
                at.time, at.station
            )
        });
        say!("outcome: {}{at}", self.checks[0].words);
        if let Some(words) = next(drive.ending.outcome, args) {
            say!("next: {words}");
        }
    }
}

/// Advice after an outcome.
fn next(outcome: Outcome, args: &DriveArgs) -> Option<String> {
    let log = args.log.as_ref().map_or("LOG".to_owned(), |log| log.display().to_string());
    let written = if args.log.is_some() { "" } else { " (--log LOG writes it)" };
    match outcome {
        Outcome::Completed => None,
        Outcome::TimedOut if args.duration.is_some() => None,
        Outcome::TimedOut => Some("drive longer, with --duration S".to_owned()),
        Outcome::Stopped => Some(format!("look at the columns status and vx at the end of {log}{written}")),
        Outcome::Lost => Some(format!(
            "look at e1, steer_cmd and status in {log}{written}; a steering that is slower than the controller knows: \
             rfl identify {log}; slower in bends: --set speed.lateral_accel=A"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_chosen_end_on_the_road_is_a_success() {
        let statuses = |cut, met| Outcome::ALL.iter().map(|&of| status(of, cut, met)).collect::<Vec<_>>();
        assert_eq!(
            Outcome::ALL.iter().map(|of| of.name()).collect::<Vec<_>>(),
            ["timed_out", "completed", "stopped", "lost"]
        );
        assert_eq!(statuses(true, true), [0, 0, 3, 4]);
        assert_eq!(statuses(false, true), [5, 0, 3, 4]);
        // What happened to the drive says more than a figure.
        assert_eq!(statuses(true, false), [6, 6, 3, 4]);
        assert_eq!(statuses(false, false), [5, 6, 3, 4]);
    }
}
