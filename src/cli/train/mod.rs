//! `rfl train`: residual models from drive logs, proven in simulated closed loop before they are handed over.
//!
//! | file | problem |
//! |---|---|
//! | `settings.rs` | the training's settings |
//! | `logs.rs` | the logs, read |
//! | `coverage.rs` | the logs' coverage, and the steering that they show |
//! | `fit.rs` | a model's training and the table of its fit |
//! | `proof.rs` | its proof in closed loop |

mod coverage;
mod fit;
mod logs;
mod proof;
mod settings;

pub(super) use coverage::shown_by;
pub(super) use fit::{followed_by, head, line};

use super::drive::MODELS;
use super::files::check_files;
use super::logs::{LogArgs, ReadsLogs};
use super::output::{hold_folder, write_json};
use super::progress::Bar;
use super::vehicle::{Commanded, by_kind, controller_with, vehicle_named};
use super::{NOT_BETTER, named, progress_bar};
use crate::control::{ControlVariant, ControllerParametersFor, MODEL_EXTENSION};
use crate::residual::{CommandPrior, Kind, ShownActuator};
use crate::simulate::prove::NotBetter;
use crate::vehicle::BUILTIN;
use clap::Args;
use coverage::Coverage;
use logs::TrainLogs;
use proof::Prover;
use serde_json::{Value, json};
use settings::TrainSettings;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

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

A model is written only if it is shown to drive better than the default controller, in simulation: on plants that explain the logs,
each on a road of its own.

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
    let models = jobs(args).into_iter().map(|(_, file)| ("--out", file));
    let written: Vec<_> = models.chain(args.json.clone().map(|file| ("--json", file))).collect();
    let mut read: Vec<_> = args.logs.iter().map(|log| ("LOG", log.clone())).collect();
    read.extend(args.test.iter().map(|log| ("--test", log.clone())));
    read.extend(args.path.clone().map(|file| ("--path", file)));
    read.push(("--vehicle", PathBuf::from(&args.vehicle)));
    check_files(&written, &read)?;
    let idle = if args.all.is_none() { args.tuning.without_effect(args.kind) } else { Vec::new() };
    if !idle.is_empty() {
        warn!("note: {} has no {}: without effect", args.kind.name(), idle.join(", "));
    }
    let parameters = controller::<P, S, C>(args)?;
    let logs = TrainLogs::<P, S, C>::read(args, &parameters)?;
    let _held = args.all.as_deref().map(hold_folder).transpose()?;
    let (data, found) = (&logs.data, logs.data.report());
    say!("{} rows, {} samples", found.rows, found.labels);
    logs.notes.iter().for_each(|note| say!("note: {note}"));

    let shown = shown_by(&logs.angles, data, args.tuning.threads);
    let covered = Coverage::of(data, shown);
    covered.say();
    let (models, refused) = Trainer::new(args, &logs, shown, parameters)?.models()?;
    let car = if args.vehicle == BUILTIN[0] { String::new() } else { format!(" --vehicle {}", args.vehicle) };
    say_next(args, &car, refused.is_none());
    let report = json!({
        "data": {
            "rows": found.rows, "labels": found.labels, "gaps": found.gaps, "not_finite": found.not_finite,
            "implausible": found.implausible, "hash": format!("{:016x}", data.hash()), "notes": logs.notes,
        },
        "coverage": covered.json(),
        "models": models,
    });
    if let Some(file) = &args.json {
        write_json(file, &report)?;
    }
    let refused = refused.map(|reason| {
        let advice = covered.advice(&car, &reason);
        format!("no model is written, for it is not shown to be better than the default controller: {reason}. {advice}; or --force")
    });
    Ok(TrainingResult { report, refused })
}

/// Says what comes next, for a vehicle as the command line has it.
fn say_next(args: &TrainArgs, car: &str, written: bool) {
    if args.all.is_some() || args.no_proof {
        say!(
            "without a proof in closed loop: compare the model with the default controller before it drives"
        );
    }
    let files: Vec<String> = jobs(args).into_iter().map(|(_, file)| file.display().to_string()).collect();
    if written {
        say!("next: rfl drive --residual {}{car}, fmu-build --residual {}{car}", files[0], files.join(" "));
    }
}

/// The training of all models that are asked for, one after the other.
struct Trainer<'a, P: Commanded<S, C>, const S: usize, const C: usize> {
    args: &'a TrainArgs,
    logs: &'a TrainLogs<P, S, C>,
    parameters: ControllerParametersFor<P::Nominal>,
    prior: Option<CommandPrior>,
    window: usize,
    prover: Option<Prover<'a, P, S, C>>,
}

impl<'a, P, const S: usize, const C: usize> Trainer<'a, P, S, C>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    fn new(
        args: &'a TrainArgs,
        logs: &'a TrainLogs<P, S, C>,
        shown: Option<ShownActuator>,
        parameters: ControllerParametersFor<P::Nominal>,
    ) -> Result<Self, Box<dyn Error>> {
        let prior = shown.map(|shown| shown.prior);
        let least = P::SETTING.window;
        let window = prior.map_or(least, |prior| prior.window(logs.data.sample_time(), least));
        let prover = shown
            .filter(|_| args.all.is_none() && !args.no_proof && args.kind.residual().is_some())
            .map(|shown| Prover::new(args, &logs.data, &shown, parameters))
            .transpose()?;
        Ok(Self { args, logs, parameters, prior, window, prover })
    }

    /// The fits of all models as JSON, and the reason if one is refused.
    fn models(&self) -> Result<(Vec<Value>, Option<NotBetter>), Box<dyn Error>> {
        let args = self.args;
        let (mut models, mut refused) = (Vec::new(), None);
        for (variant, file) in jobs(args) {
            let bar = progress_bar(&format!("training {}", variant.name()), 1.0, args.quiet);
            models.push(match variant.residual() {
                Some(kind) => {
                    let said;
                    (said, refused) = self.residual(kind, &file, &bar, models.is_empty())?;
                    said
                }
                None => {
                    let config = args.tuning.gp_config(self.parameters.nmpc.friction);
                    P::learn_gp(&self.logs.data, self.logs.test.as_ref(), &config, &file, &bar)?
                }
            });
            if refused.is_none() {
                say!("model: {}", file.display());
            }
        }
        Ok((models, refused))
    }

    /// The fit of a residual model that is trained, proven and written, or the reason of its refusal beside it.
    fn residual(
        &self,
        kind: Kind,
        file: &Path,
        bar: &Bar,
        first: bool,
    ) -> Result<(Value, Option<NotBetter>), Box<dyn Error>> {
        let (args, mut refused) = (self.args, None);
        let config = args.tuning.config(kind, args.all.is_some(), self.window, self.prior);
        let fit::Learned { model, left, mut said } =
            fit::learn(&self.logs.data, self.logs.test.as_ref(), &config, bar, first)?;
        if let Some(determined) = said["determined"].as_f64() {
            say!(
                "the logs determine {:.0} % of the window's directions, the prior the others",
                100.0 * determined
            );
        }
        let model = Arc::new(model);
        if let Some(prover) = &self.prover {
            let (proof, verdict) = prover.prove(&model, &left)?;
            said["proof"] = proof;
            said["proven"] = json!(verdict.is_ok());
            match verdict {
                Err(reason) if args.force => {
                    say!(
                        "warning: not shown to be better than the default controller: {reason}; written all the same (--force)"
                    );
                }
                Err(reason) => refused = Some(reason),
                Ok(()) => {}
            }
        }
        if refused.is_none() {
            model.write(file)?;
            said["file"] = json!(file.display().to_string());
        }
        Ok((said, refused))
    }
}
