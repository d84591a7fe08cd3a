//! `rfl train`: residual models from drive logs, proven in simulated closed loop before they are handed over.

use super::diagnose::steady_steering;
use super::drive::MODELS;
use super::logs::{LogArgs, ReadsLogs};
use super::output::{check_writable, hold_folder, write_json};
use super::progress::Bar;
use super::vehicle::{Commanded, VehicleLinearModel, by_kind, controller_with, vehicle_named};
use super::{NOT_BETTER, named, progress_bar};
use crate::control::{
    Choice, ControlVariant, ControlledParameters, ControllerParametersFor, MODEL_EXTENSION,
    PredictionModelFor, Propagation, Residual, RollOut,
};
use crate::log::{SteeringLog, drives_of};
use crate::nominal::{Actuator, LateralVehicle, SteeringDrive, identify_from_drives};
use crate::path;
use crate::residual::gp::GpConfig;
use crate::residual::{
    CommandPrior, DataReport, DataSet, FitErrors, Kind, LambdaChoice, Progress, ResidualModelFor,
    ShownActuator, ShownBy, TrainConfig, TrainReport, TreeFeatures, train,
};
use crate::signal::{STEER, YAW_RATE};
use crate::simulate::prove::{Contest, Exam, NotBetter, explaining_plants};
use crate::vehicle::BUILTIN;
use clap::Args;
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Learns what the nominal model misses from drive logs
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl train out/collect/*.csv                         RFL+S for the C-class car, to out/residual/rfl_s.rflm
  rfl train drives/*.csv --vehicle my_car.toml --kind rfl --test other_day.csv
  rfl train drive.csv --rate 50                       no time column: 50 rows a second
  rfl train drives/*.csv --path road.csv              logs with poses only: errors by projection onto the road
  rfl train drives/*.csv --all out/residual           every kind, to compare them
  rfl train out/collect/*.csv --vehicle truck_simulation   for the truck, whose logs have articulation and articulation_rate
  rfl drive --residual out/residual/rfl_s.rflm        drive with it
  fmu-build --residual out/residual/rfl_s.rflm        pack it into the controller's FMU

A log is a CSV file with the columns time, steer_cmd, vx, e1, e1_rate, e2, e2_rate, curvature, curvature_rate (a log of
rfl or of the FMU in any host), or with x, y, yaw, vx, vy, yaw_rate beside time and steer_cmd, and --path. SI units.

A model is written only if it drives better than the default controller, in simulation, on plants that explain the logs and on roads
of their own.

Exit status: 0 done, 1 bad input or a failure, 2 wrong usage, 3 a model that is not better, and is not written.")]
pub struct TrainArgs {
    /// Drive logs (CSV)
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    reading: LogArgs,
    /// Logs to measure the fit on, not learned from
    #[arg(long)]
    test: Vec<PathBuf>,
    /// Road that was driven: for logs that lack errors or curvature
    #[arg(long)]
    path: Option<PathBuf>,
    /// Car or truck whose nominal model is corrected: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = BUILTIN[0])]
    vehicle: String,
    /// A parameter of the controller that is to use the model, NAME=VALUE: mpc.sample_time, vehicle.mass, ...
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    /// Kind of model to learn, by the controller's variant
    #[arg(long, default_value = "rfl_s", hide_possible_values = true, value_parser = named(LEARNED, ControlVariant::name, ControlVariant::meaning))]
    kind: ControlVariant,
    /// Train every kind, to DIR/KIND.rflm
    #[arg(long, value_name = "DIR", conflicts_with_all = ["kind", "out"])]
    all: Option<PathBuf>,
    #[command(flatten)]
    tuning: TrainSettings,
    /// File for the model [default: out/residual/KIND.rflm]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Write the model even if it is not better than the default controller in simulated closed loop
    #[arg(long)]
    force: bool,
    /// Write the model as fitted, without the proof in simulated closed loop: quicker, to compare many
    #[arg(long, conflicts_with = "force")]
    no_proof: bool,
    /// File for the fit (JSON)
    #[arg(long)]
    json: Option<PathBuf>,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

/// Variants that are learned.
const LEARNED: &[ControlVariant] = &[
    ControlVariant::Linear,
    ControlVariant::Rt,
    ControlVariant::Rf,
    ControlVariant::Rtl,
    ControlVariant::Rfl,
    ControlVariant::RflS,
    ControlVariant::GpNmpc,
];

/// Settings of the training; those not given are the kind's defaults.
#[derive(Debug, Args)]
#[command(next_help_heading = "Tuning")]
struct TrainSettings {
    /// Window of commands in steps: it should cover the actuator's delay and four of its time constants [default: 28;
    /// of a truck 60]
    #[arg(long)]
    window: Option<usize>,
    /// Trees of a forest [default: 20]
    #[arg(long)]
    trees: Option<usize>,
    /// Depth of the trees [default: 6]
    #[arg(long)]
    depth: Option<usize>,
    /// Features tried at each split of a forest [default: 8; rfl_s: 3, all that it has]
    #[arg(long, value_name = "N")]
    features_per_split: Option<usize>,
    /// Fewest samples in a leaf [default: 100 with linear leaves, 20 with constant ones]
    #[arg(long, value_name = "N")]
    min_leaf: Option<usize>,
    /// Shrinkage of linear leaves to the global fit: a number, held-out (the number with the least error on samples
    /// that a tree has not seen) or least-squares (not at all: the paper's)
    #[arg(long, default_value = "held-out", value_parser = lambda)]
    lambda: Lambda,
    /// Memory of the filter on linear leaves' samples before the fit, 0 (none) to less than 1. Measured states are
    /// noisy, and the noise of one-step labels is mostly of high frequency, where it hides the response to commands
    /// [default: 0.8; with --lambda least-squares 0, the paper's way]
    #[arg(long, value_name = "MEMORY")]
    prefilter: Option<f64>,
    /// No prior for the effects of past commands: shrink them towards zero. Without --no-prior towards those of the actuator that
    /// the logs show
    #[arg(long)]
    no_prior: bool,
    /// Features that trees split on [default: errors; rfl_s: road]
    #[arg(long, value_name = "WHAT", hide_possible_values = true, value_parser = named(TreeFeatures::ALL, TreeFeatures::name, TreeFeatures::meaning))]
    tree_features: Option<TreeFeatures>,
    /// Curvature, its rate and curvature times speed squared in linear leaves, too [rfl_s: always]
    #[arg(long)]
    road_regressors: bool,
    /// So many of the newest error states in linear leaves, too: they fit better, and suffer from sensor noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    state_regressors: usize,
    /// Most points of a Gaussian process (gp_nmpc)
    #[arg(long, value_name = "N", default_value_t = 300)]
    points: usize,
    /// Samples that the hyperparameters of a Gaussian process are fitted on: time grows with their cube (gp_nmpc)
    #[arg(long, value_name = "N", default_value_t = 400)]
    hyperparameter_samples: usize,
    /// Seed of all that is random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; 0 for all there are. The model does not depend on it
    #[arg(long, default_value_t = 0)]
    threads: usize,
}

/// Shrinkage, as a user writes it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Lambda {
    HeldOut,
    LeastSquares,
    Fixed(f64),
}

fn lambda(text: &str) -> Result<Lambda, String> {
    match text {
        "held-out" => Ok(Lambda::HeldOut),
        "least-squares" => Ok(Lambda::LeastSquares),
        number => match number.parse::<f64>() {
            Ok(value) if value >= 0.0 => Ok(Lambda::Fixed(value)),
            _ => Err("give a number from 0, held-out or least-squares".to_owned()),
        },
    }
}

impl TrainSettings {
    /// The configuration for a kind. For all kinds at once, each takes only the settings that it has.
    fn config(&self, kind: Kind, all: bool, window: usize, prior: Option<CommandPrior>) -> TrainConfig {
        let mut config = TrainConfig::new(kind);
        config.window = self.window.unwrap_or(window);
        config.prior = prior.filter(|_| !self.no_prior);
        config.trees = self.trees.unwrap_or(config.trees);
        config.depth = self.depth.unwrap_or(config.depth);
        config.features_per_split = self.features_per_split.unwrap_or(config.features_per_split);
        config.min_leaf = self.min_leaf.unwrap_or(config.min_leaf);
        if !(all && kind == Kind::RflS) {
            config.tree_features = self.tree_features.unwrap_or(config.tree_features);
        }
        config.regressors.road |= self.road_regressors;
        config.regressors.states = self.state_regressors;
        match self.lambda {
            Lambda::HeldOut => {}
            Lambda::LeastSquares => {
                config.lambda = LambdaChoice::LeastSquares;
                config.prefilter = 0.0;
            }
            Lambda::Fixed(lambda) => config.lambda = LambdaChoice::Fixed(lambda),
        }
        config.prefilter = self.prefilter.unwrap_or(config.prefilter);
        (config.seed, config.threads) = (self.seed, self.threads);
        config
    }
}

/// Kinds to train, and the file of each.
fn jobs(args: &TrainArgs) -> Vec<(ControlVariant, PathBuf)> {
    let in_folder =
        |folder: &Path, kind: ControlVariant| folder.join(kind.name()).with_extension(MODEL_EXTENSION);
    match (&args.all, &args.out) {
        (Some(folder), _) => LEARNED.iter().map(|&kind| (kind, in_folder(folder, kind))).collect(),
        (None, Some(file)) => vec![(args.kind, file.clone())],
        (None, None) => vec![(args.kind, in_folder(MODELS.as_ref(), args.kind))],
    }
}

/// The nominal controller whose model is corrected.
fn controller<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &TrainArgs,
) -> Result<ControllerParametersFor<P::Nominal>, Box<dyn Error>> {
    controller_with::<P, S, C>(&vehicle_named(&args.vehicle)?, &args.settings)
}

/// Runs the command.
///
/// # Errors
/// The fault, its place, and advice.
pub fn run(args: &TrainArgs) -> Result<u8, Box<dyn Error>> {
    let Some(refused) = trained(args)?.refused else { return Ok(0) };
    warn!("{refused}");
    Ok(NOT_BETTER)
}

impl ReadsLogs for TrainArgs {
    fn reading(&mut self) -> &mut LogArgs {
        &mut self.reading
    }
}

/// Result of the training.
#[derive(Debug, Clone)]
pub struct TrainingResult {
    /// Contents for `--json`.
    pub report: Value,
    /// Reason for writing no model, if none is written.
    pub refused: Option<String>,
}

/// Runs the command and gives the result.
///
/// # Errors
/// As [`run`], but that a model which is no better than the default controller is an answer.
pub fn trained(args: &TrainArgs) -> Result<TrainingResult, Box<dyn Error>> {
    by_kind!(&args.vehicle, learn_all(args))
}

fn learn_all<P, const S: usize, const C: usize>(args: &TrainArgs) -> Result<TrainingResult, Box<dyn Error>>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    for file in jobs(args).iter().map(|(_, file)| file).chain(&args.json) {
        check_writable(file)?;
    }
    let _held = args.all.as_deref().map(hold_folder).transpose()?;
    let parameters = controller::<P, S, C>(args)?;
    let vehicle = parameters.vehicle.nominal();
    let data_config = parameters.data_config();
    let reading = args.reading.limit.road();
    let road = args
        .path
        .as_deref()
        .map(|road| path::Path::named(road, &reading).map(|read| (read, road)))
        .transpose()?;
    let steering = |speed: f64| steady_steering(&vehicle, speed);
    let mut notes = Vec::new();
    let mut read = |files: &[PathBuf]| -> Result<_, Box<dyn Error>> {
        let (mut drives, mut angles) = (Vec::new(), Vec::new());
        for file in files {
            let road = road.as_ref().map(|(road, file)| (road, *file));
            let log = args.reading.read(file)?;
            drives.extend(drives_of(&log, road, &steering, &mut |note| notes.push(note))?);
            // What is wrong with a log was said above.
            angles.extend(SteeringLog::by_angle(&log, &steering).into_iter().flat_map(|log| log.drives));
        }
        let data: DataSet<VehicleLinearModel<P, S, C>, S> = DataSet::new(&drives, &vehicle, data_config)?;
        Ok((data, angles))
    };
    let (data, angles) = read(&args.logs)?;
    let test = if args.test.is_empty() { None } else { Some(read(&args.test)?.0) };
    notes.extend(found(data.report()));
    say!("{} rows, {} samples", data.report().rows, data.report().labels);
    notes.iter().for_each(|note| say!("note: {note}"));

    let shown = shown_by(&angles, &data, args.tuning.threads);
    let prior = shown.map(|shown| shown.prior);
    let least = P::SETTING.window;
    let window = prior.map_or(least, |prior| prior.window(data_config.sample_time, least));
    let covered = Coverage::of(&data, shown);
    covered.say();
    let prover = shown
        .filter(|_| args.all.is_none() && !args.no_proof && args.kind.residual().is_some())
        .map(|shown| Prover::<P, S, C>::new(args, &data, &shown, parameters))
        .transpose()?;
    let mut refused = None;

    let mut models = Vec::new();
    for (variant, file) in jobs(args) {
        let bar = progress_bar(&format!("training {}", variant.name()), 1.0, args.quiet);
        let (test, first) = (test.as_ref(), models.is_empty());
        models.push(match variant.residual() {
            Some(kind) => {
                let config = args.tuning.config(kind, args.all.is_some(), window, prior);
                let (model, mut said) = learn(&data, test, &config, &bar, first)?;
                if let Some(determined) = said["determined"].as_f64() {
                    say!(
                        "the logs determine {:.0} % of the window's directions, the prior the others",
                        100.0 * determined
                    );
                }
                let model = Arc::new(model);
                if let Some(prover) = &prover {
                    let (proof, verdict) = prover.prove(&model, args)?;
                    said["proof"] = proof;
                    if let Err(reason) = verdict {
                        said["proven"] = json!(false);
                        if args.force {
                            say!("warning: not better than the default controller: {reason}; written all the same (--force)");
                        } else {
                            refused = Some(reason);
                        }
                    } else {
                        said["proven"] = json!(true);
                    }
                }
                if refused.is_none() {
                    model.write(&file)?;
                    said["file"] = json!(file.display().to_string());
                }
                said
            }
            None => {
                let TrainSettings { points, hyperparameter_samples, seed, threads, .. } = args.tuning;
                let friction = parameters.nmpc.friction;
                let config = GpConfig {
                    friction,
                    points,
                    hyperparameter_samples,
                    seed,
                    threads,
                    ..GpConfig::default()
                };
                P::learn_gp(&data, test, &config, &file, &bar)?
            }
        });
        if refused.is_none() {
            say!("model: {}", file.display());
        }
    }
    if args.all.is_some() || args.no_proof {
        say!(
            "without a proof in closed loop: compare the model with the default controller before it drives"
        );
    }
    let files: Vec<String> = jobs(args).into_iter().map(|(_, file)| file.display().to_string()).collect();
    let car = if args.vehicle == BUILTIN[0] { String::new() } else { format!(" --vehicle {}", args.vehicle) };
    if refused.is_none() {
        say!("next: rfl drive --residual {}{car}, fmu-build --residual {}{car}", files[0], files.join(" "));
    }
    let report = data.report();
    let report = json!({
        "data": {
            "rows": report.rows, "labels": report.labels, "gaps": report.gaps, "not_finite": report.not_finite,
            "implausible": report.implausible, "hash": format!("{:016x}", data.hash()), "notes": notes,
        },
        "coverage": covered.json(),
        "models": models,
    });
    if let Some(file) = &args.json {
        write_json(file, &report)?;
    }
    let refused = refused.map(|reason| {
        let advice = covered.advice(&car);
        format!("no model is written, for it is not better than the default controller: {reason}. {advice}; or --force")
    });
    Ok(TrainingResult { report, refused })
}

/// The steering actuator as logs show it: by the measured angle where there is one, else by the yaw rate.
pub(super) fn shown_by<V: LateralVehicle<S>, const S: usize>(
    angles: &[SteeringDrive],
    data: &DataSet<V, S>,
    threads: usize,
) -> Option<ShownActuator> {
    // A copy of the command in the place of the angle shows no actuator.
    let copied = angles.iter().all(|drive| drive.steer_cmd == drive.response);
    let measured = || identify_from_drives(angles).ok().and_then(|found| ShownActuator::measured(&found));
    (!copied).then(measured).flatten().or_else(|| data.actuator(threads))
}

/// Coverage of the logs.
struct Coverage {
    /// Least, greatest and 5 %, 95 % quantiles of the speed, m/s.
    speed: [f64; 4],
    /// Greatest curvature, 1/m.
    curvature: f64,
    /// Greatest lateral acceleration, m/s2.
    lateral_accel: f64,
    /// Root mean square of the command's change over a second, rad/s.
    command_rate: f64,
    shown: Option<ShownActuator>,
}

impl Coverage {
    fn of<V: LateralVehicle<S>, const S: usize>(data: &DataSet<V, S>, shown: Option<ShownActuator>) -> Self {
        let windows = data.windows(2);
        let mut speeds: Vec<f64> = (0..windows.len()).map(|i| windows.road(i)[0]).collect();
        speeds.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            let place = (share * speeds.len().saturating_sub(1) as f64).round() as usize;
            speeds.get(place).copied().unwrap_or(f64::NAN)
        };
        let most = |of: fn([f64; 3]) -> f64| {
            (0..windows.len()).map(|i| of(windows.road(i)).abs()).fold(0.0, f64::max)
        };
        let change = |i: usize| windows.commands(i)[1] - windows.commands(i)[0];
        let squares: f64 = (0..windows.len()).map(|i| change(i).powi(2)).sum();
        Self {
            speed: [0.0, 1.0, 0.05, 0.95].map(quantile),
            curvature: most(|[_, curvature, _]| curvature),
            lateral_accel: most(|[speed, curvature, _]| speed * speed * curvature),
            command_rate: (squares / windows.len().max(1) as f64).sqrt() / data.sample_time(),
            shown,
        }
    }

    fn say(&self) {
        let [least, greatest, low, high] = self.speed;
        say!(
            "covered: speed {least:.1} to {greatest:.1} m/s (90 % of the time {low:.1} to {high:.1}), curvature up to {:.3} 1/m, \
             lateral acceleration up to {:.1} m/s2, command changing by {:.3} rad/s (RMS)",
            self.curvature,
            self.lateral_accel,
            self.command_rate
        );
        match self.shown {
            Some(shown) if shown.is_shown() => {
                let Actuator { dead_time, time_constant, .. } = shown.prior.actuator;
                let by = match shown.by {
                    ShownBy::Angle => "its measured angle",
                    ShownBy::YawRate => "its yaw response",
                };
                say!(
                    "steering by {by}: dead time {dead_time:.3} s, lag {time_constant:.3} s, both together {:.3} +- {:.3} s",
                    dead_time + time_constant,
                    shown.spread
                );
            }
            _ => say!("steering: the logs do not excite it enough to show dead time and lag"),
        }
    }

    fn json(&self) -> Value {
        let [least, greatest, low, high] = self.speed;
        json!({
            "speed": { "min": least, "max": greatest, "p05": low, "p95": high },
            "curvature_max": self.curvature,
            "lateral_accel_max": self.lateral_accel,
            "command_rate_rms": self.command_rate,
            "steering": self.shown.map(|shown| json!({
                "dead_time": shown.prior.actuator.dead_time,
                "lag": shown.prior.actuator.time_constant,
                "sum_spread": shown.spread,
                "by": match shown.by { ShownBy::Angle => STEER.name, ShownBy::YawRate => YAW_RATE.name },
                "shown": shown.is_shown(),
            })),
        })
    }

    /// Advice for better logs.
    fn advice(&self, car: &str) -> String {
        if self.shown.is_some_and(|shown| shown.is_shown()) {
            format!(
                "The default controller is the better choice (rfl drive{car}). Drives with dither at the speeds and bends to come say \
                 more: rfl collect{car}, then rfl train out/collect/*.csv{car}"
            )
        } else {
            format!(
                "The steering is not excited enough: rfl collect{car}, then rfl train out/collect/*.csv{car}"
            )
        }
    }
}

/// Proves models in closed loop.
struct Prover<P: Commanded<S, C>, const S: usize, const C: usize> {
    exam: Mutex<Exam<P, S, C>>,
}

impl<P, const S: usize, const C: usize> Prover<P, S, C>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    fn new(
        args: &TrainArgs,
        data: &DataSet<VehicleLinearModel<P, S, C>, S>,
        shown: &ShownActuator,
        controller: ControllerParametersFor<P::Nominal>,
    ) -> Result<Self, Box<dyn Error>> {
        let vehicle: P::Parameters = vehicle_named(&args.vehicle)?;
        let nominal = controller.vehicle.nominal();
        let mass = P::mass(&nominal);
        let loaded = |stiffness, payload| P::loaded(nominal, stiffness, payload);
        let TrainSettings { seed, threads, .. } = args.tuning;
        let plants =
            explaining_plants::<P, S, C>(data, shown, &vehicle, mass, &loaded, [seed, threads as u64])?;
        let default = Choice {
            variant: ControlVariant::Adaptive,
            file: None,
            folder: MODELS.into(),
            propagation: Propagation::Propagated,
            roll_out: RollOut::Corrected,
        };
        let default = default.prediction_model(&controller)?.1;
        let contest = Contest { vehicle, controller, default };
        let bar = progress_bar("default controller", 1.0, args.quiet);
        let exam = Exam::new(&contest, &plants, seed, threads, &|| bar.step())?;
        bar.finish_and_clear();
        Ok(Self { exam: Mutex::new(exam) })
    }

    fn prove(
        &self,
        model: &Arc<ResidualModelFor<VehicleLinearModel<P, S, C>, S>>,
        args: &TrainArgs,
    ) -> Result<(Value, Result<(), NotBetter>), Box<dyn Error>> {
        let mut exam = self.exam.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let bar = progress_bar("proving", exam.len() as f64, args.quiet);
        let residual = Residual {
            model: model.clone(),
            propagation: Propagation::Propagated,
            roll_out: RollOut::Corrected,
        };
        let proof = exam.prove(&PredictionModelFor::Residual(residual), &|| bar.step())?;
        bar.finish_and_clear();
        let [default, learned] = proof.figures();
        say!(
            "proof: {} drives on roads and plants that explain the logs: mean {:.2} mm, max {:.1} mm, lost {}; default controller \
             {:.2} mm, {:.1} mm, {}",
            proof.drives.len(),
            1e3 * learned.mean,
            1e3 * learned.max,
            learned.lost,
            1e3 * default.mean,
            1e3 * default.max,
            default.lost
        );
        let verdict = proof.check();
        let value = json!({ "default": default, "learned": learned, "drives": proof.drives });
        Ok((value, verdict))
    }
}

/// A listener that shows progress on a bar.
pub(super) fn followed_by(bar: &Bar) -> impl Fn(Progress) + Sync {
    |progress| {
        bar.set_share(progress.done as u64, progress.total as u64);
    }
}

/// Trains a residual and prints its fit, under a header if it is the first; gives it and its fit as JSON.
fn learn<V: LateralVehicle<S>, const S: usize>(
    data: &DataSet<V, S>,
    test: Option<&DataSet<V, S>>,
    config: &TrainConfig,
    bar: &Bar,
    first: bool,
) -> Result<(ResidualModelFor<V, S>, Value), Box<dyn Error>> {
    let kind = config.kind;
    let trained =
        train(data, test, config, &followed_by(bar)).map_err(|error| format!("{}: {error}", kind.name()))?;
    bar.finish_and_clear();
    let (schema, report) = (trained.model.schema(), &trained.report);
    show(kind, report, first);
    let said = json!({
        "kind": kind.name(),
        "window": schema.window,
        "samples": schema.training.samples,
        "global_lambda": schema.training.global_lambda,
        "leaf_lambda": schema.training.leaf_lambda,
        "determined": report.determined,
        "leaves": report.leaves,
        "smallest_leaf": report.smallest_leaf,
        "train": as_json(&report.train),
        "held_out": report.held_out.as_ref().map(as_json),
        "test": report.test.as_ref().map(as_json),
    });
    Ok((trained.model, said))
}

/// Findings and repairs in the logs, in sentences.
fn found(report: &DataReport) -> Vec<String> {
    let mut notes = Vec::new();
    let mut note = |count: usize, text: &str| {
        if count > 0 {
            notes.push(format!("{count} {text}"));
        }
    };
    note(report.not_finite, "rows left out: a value is missing or not a number");
    note(report.implausible, "rows left out: a value cannot be");
    note(report.gaps, "gaps: no window reaches over them");
    let thinned = report.thinned.iter().map(|(drive, factor)| {
        format!("{drive}: recorded {factor} times as fast as the controller steps, and thinned")
    });
    notes.extend(thinned);
    let constant = report.constant.iter();
    notes.extend(constant.map(|column| format!("{column} never changes: its effect cannot be learned")));
    notes
}

/// States of any vehicle that we know, with their units.
const HEADINGS: [&str; 6] = ["e1 m", "e1' m/s", "e2 rad", "e2' rad/s", "phi rad", "phi' rad/s"];

fn right(text: &(impl AsRef<str> + ?Sized)) -> String {
    format!(" {:>10}", text.as_ref())
}

/// Head of a table of fits.
pub(super) fn head(headings: &[&str]) {
    say!("{:<28}{}", "RMS of one step", headings.iter().map(right).collect::<String>());
}

/// A line of it.
pub(super) fn line<const N: usize>(name: &str, values: [f64; N]) {
    say!("{name:<28}{}", values.map(|value| right(&format!("{value:.2e}"))).concat());
}

/// Prints the fit of a model, under a header if it is the first.
fn show<const S: usize>(kind: Kind, report: &TrainReport<S>, first: bool) {
    if first {
        head(&HEADINGS[..S]);
    }
    if first {
        line("nominal, training", report.train.nominal_rmse);
        if let Some(fit) = &report.test {
            line("nominal, test", fit.nominal_rmse);
        }
    }
    line(&format!("{}, training", kind.name()), report.train.rmse);
    if let Some(fit) = &report.held_out {
        line(&format!("{}, held out", kind.name()), fit.rmse);
    }
    if let Some(fit) = &report.test {
        line(&format!("{}, test", kind.name()), fit.rmse);
    }
}

fn as_json<const S: usize>(fit: &FitErrors<S>) -> Value {
    json!({
        "samples": fit.samples, "rmse": fit.rmse[..], "max": fit.max[..], "nominal_rmse": fit.nominal_rmse[..],
    })
}
