//! `rfl train`: residual models from drive logs.

use super::drive::MODELS;
use super::vehicle::{Commanded, Linear, by_kind, controller_with, vehicle_named};
use super::{named, progress_bar};
use crate::control::{ControlVariant, ControllerParametersFor, MODEL_EXTENSION, VehicleParameters};
use crate::log::{DriveLog, drive_of};
use crate::nominal::LateralVehicle;
use crate::path;
use crate::residual::gp::GpConfig;
use crate::residual::{
    DataReport, DataSet, Fit, Kind, LambdaChoice, Progress, TrainConfig, TrainReport, TreeFeatures, train,
};
use crate::vehicle::BUILTIN;
use clap::Args;
use indicatif::ProgressBar;
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Learns what the nominal model misses from drive logs
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl train out/collect/*.csv                         RFL+S for the C-class car, to out/residual/rfl_s.rflm
  rfl train drives/*.csv --vehicle my_car.toml --kind rfl --test other_day.csv
  rfl train drives/*.csv --path road.csv              logs with poses only: errors by projection onto the road
  rfl train drives/*.csv --all out/residual           every kind, to compare them
  rfl train out/collect/*.csv --vehicle truck_simulation   for the truck, whose logs have articulation and articulation_rate
  rfl drive --residual out/residual/rfl_s.rflm        drive with it
  fmu-build --residual out/residual/rfl_s.rflm        pack it into the controller's FMU

A log is a CSV file with the columns time, steer_cmd, vx, e1, e1_rate, e2, e2_rate, curvature, curvature_rate (a log of
rfl or of the FMU in any host), or with x, y, yaw, vx, vy, yaw_rate beside time and steer_cmd, and --path. SI units.")]
pub struct TrainArgs {
    /// Drive logs (CSV)
    #[arg(required = true)]
    logs: Vec<PathBuf>,
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
    /// What to learn, by the controller's variant
    #[arg(long, default_value = "rfl_s", hide_possible_values = true, value_parser = named(LEARNED, ControlVariant::name, ControlVariant::meaning))]
    kind: ControlVariant,
    /// Train every kind, to DIR/KIND.rflm
    #[arg(long, value_name = "DIR", conflicts_with_all = ["kind", "out"])]
    all: Option<PathBuf>,
    #[command(flatten)]
    tuning: Tuning,
    /// File for the model [default: out/residual/KIND.rflm]
    #[arg(long)]
    out: Option<PathBuf>,
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

/// How a model is learned; what is not given is the kind's default.
#[derive(Debug, Args)]
#[command(next_help_heading = "Tuning")]
struct Tuning {
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
    /// How strongly linear leaves are shrunk to the global fit: a number, held-out (the number with the least error on
    /// samples that a tree has not seen) or least-squares (not at all: the paper's)
    #[arg(long, default_value = "held-out", value_parser = lambda)]
    lambda: Lambda,
    /// Memory of the filter that linear leaves' samples go through before the fit, 0 (none) to less than 1: measured
    /// states are noisy, and the noise of one-step labels is mostly of high frequency, where it hides the response to
    /// commands [default: 0.8; with --lambda least-squares 0, the paper's way]
    #[arg(long, value_name = "MEMORY")]
    prefilter: Option<f64>,
    /// What trees split on [default: errors; rfl_s: road]
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

impl Tuning {
    /// The configuration for a kind; where all are trained, what only some can have is left to them.
    fn config(&self, kind: Kind, all: bool, window: usize) -> TrainConfig {
        let mut config = TrainConfig::new(kind);
        config.window = self.window.unwrap_or(window);
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
/// What was wrong, where, and what to do.
pub fn run(args: &TrainArgs) -> Result<(), Box<dyn Error>> {
    by_kind!(&args.vehicle, learn_all(args))
}

fn learn_all<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &TrainArgs,
) -> Result<(), Box<dyn Error>> {
    let parameters = controller::<P, S, C>(args)?;
    let vehicle = parameters.vehicle.nominal();
    let data_config = parameters.mpc.data_config();
    let road =
        args.path.as_deref().map(|file| path::Path::read(file).map(|road| (road, file))).transpose()?;
    let mut notes = Vec::new();
    let mut read = |files: &[PathBuf]| -> Result<DataSet<Linear<P, S, C>, S>, Box<dyn Error>> {
        let mut drives = Vec::new();
        for file in files {
            let road = road.as_ref().map(|(road, file)| (road, *file));
            drives.push(drive_of(&DriveLog::read(file)?, road, &mut |note| notes.push(note))?);
        }
        Ok(DataSet::new(&drives, &vehicle, data_config)?)
    };
    let data = read(&args.logs)?;
    let test = if args.test.is_empty() { None } else { Some(read(&args.test)?) };
    notes.extend(found(data.report()));
    say!("{} rows, {} samples", data.report().rows, data.report().labels);
    notes.iter().for_each(|note| say!("note: {note}"));

    let mut models = Vec::new();
    for (variant, file) in jobs(args) {
        let bar = progress_bar(&format!("training {}", variant.name()), 1.0, args.quiet);
        let (test, first) = (test.as_ref(), models.is_empty());
        models.push(match variant.residual() {
            Some(kind) => {
                let config = args.tuning.config(kind, args.all.is_some(), P::SETTING.window);
                learn(&data, test, &config, &file, &bar, first)?
            }
            None => {
                let Tuning { points, hyperparameter_samples, seed, threads, .. } = args.tuning;
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
        say!("model: {}", file.display());
    }
    let files: Vec<String> = jobs(args).into_iter().map(|(_, file)| file.display().to_string()).collect();
    let car = if args.vehicle == BUILTIN[0] { String::new() } else { format!(" --vehicle {}", args.vehicle) };
    say!("next: rfl drive --residual {}{car}, fmu-build --residual {}{car}", files[0], files.join(" "));
    if let Some(file) = &args.json {
        let report = data.report();
        let value = json!({
            "data": {
                "rows": report.rows, "labels": report.labels, "gaps": report.gaps, "not_finite": report.not_finite,
                "implausible": report.implausible, "hash": format!("{:016x}", data.hash()), "notes": notes,
            },
            "models": models,
        });
        std::fs::write(file, serde_json::to_string_pretty(&value)?)
            .map_err(|error| format!("{}: {error}", file.display()))?;
    }
    Ok(())
}

/// Makes the folder of a file that is about to be written.
pub(super) fn make_folder_of(file: &Path) -> Result<(), Box<dyn Error>> {
    match file.parent() {
        Some(folder) => {
            std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()).into())
        }
        None => Ok(()),
    }
}

/// A listener that shows progress on a bar.
pub(super) fn followed_by(bar: &ProgressBar) -> impl Fn(Progress) + Sync {
    |progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
    }
}

/// Trains a residual, writes it to a file and prints its fit, under a header if it is the first; gives it as JSON.
fn learn<V: LateralVehicle<S>, const S: usize>(
    data: &DataSet<V, S>,
    test: Option<&DataSet<V, S>>,
    config: &TrainConfig,
    file: &Path,
    bar: &ProgressBar,
    first: bool,
) -> Result<Value, Box<dyn Error>> {
    let kind = config.kind;
    let trained =
        train(data, test, config, &followed_by(bar)).map_err(|error| format!("{}: {error}", kind.name()))?;
    bar.finish_and_clear();
    make_folder_of(file)?;
    trained.model.write(file)?;
    let (schema, report) = (trained.model.schema(), &trained.report);
    show(kind, report, first);
    Ok(json!({
        "kind": kind.name(),
        "file": file.display().to_string(),
        "window": schema.window,
        "samples": schema.training.samples,
        "global_lambda": schema.training.global_lambda,
        "leaf_lambda": schema.training.leaf_lambda,
        "leaves": report.leaves,
        "smallest_leaf": report.smallest_leaf,
        "train": as_json(&report.train),
        "held_out": report.held_out.as_ref().map(as_json),
        "test": report.test.as_ref().map(as_json),
    }))
}

/// What was found in the logs and done about it, in sentences.
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

fn as_json<const S: usize>(fit: &Fit<S>) -> Value {
    json!({
        "samples": fit.samples, "rmse": fit.rmse[..], "max": fit.max[..], "nominal_rmse": fit.nominal_rmse[..],
    })
}
