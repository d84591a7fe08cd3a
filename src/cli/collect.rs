//! `rfl collect`: drives to learn from, made in the native loop by the nominal controller, or by one that has learned from
//! such drives.

use super::drive::{MODELS, Setup};
use super::files::{check_folder, given};
use super::logs::LimitArgs;
use super::output::{hold_folder, write_file};
use super::progress_bar;
use super::vehicle::{Commanded, VehicleLinearModel, by_kind};
use crate::control::{
    Choice, ControlVariant, ControllerParametersFor, PredictionModelFor, Propagation, RollOut,
};
use crate::simulate::{End, STATION};
use clap::Args;
use std::error::Error;
use std::path::PathBuf;

/// Drives the nominal MPC along the training route, with a little steering dither, and records drive logs
#[derive(Debug, Args)]
#[command(
    after_help = "The controller stays calm, as it is before it knows its vehicle (mpc.tightening=1): --set overrides.

Examples:
  rfl collect                                        three drives of the training route to out/collect/
  rfl collect --vehicle my_car.toml --runs 5
  rfl collect --set effect.steer_lag=0.1 --set effect.steer_delay=0.06     a car with a slow actuator
  rfl collect --vehicle truck_simulation --set effect.steer_lag=0.2 --set effect.steer_delay=0.3 --set speed.limit=8

Where the nominal MPC must be so calm that it weaves, collect again with what was learned, and learn from both:
  rfl train out/collect/*.csv --kind linear --out out/linear.rflm
  rfl collect --residual out/linear.rflm --out out/again
  rfl train out/collect/*.csv out/again/*.csv"
)]
pub struct CollectArgs {
    /// Road to drive: a CSV file with columns x, y [default: the vehicle's training route]
    #[arg(long)]
    path: Option<PathBuf>,
    #[command(flatten)]
    limit: LimitArgs,
    /// Car or truck: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = crate::vehicle::BUILTIN[0])]
    vehicle: String,
    /// A parameter, NAME=VALUE, of whoever has it; `car.` (`truck.`) or `controller.` before the name means one of them only
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    /// Number of drives, each with a dither of its own
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
    /// Learned model (from rfl train) to drive with, at the weights for driving: a second round, near the drives to come
    #[arg(long, value_name = "FILE")]
    residual: Option<PathBuf>,
    /// Amplitude of the dither in rad [default: 0.01; of a truck 0.005, with --residual 0.01]
    #[arg(long)]
    dither: Option<f64>,
    /// Seed of the first drive's dither
    #[arg(long, default_value_t = 1)]
    seed: usize,
    /// Folder for the logs
    #[arg(long, default_value = "out/collect")]
    out: PathBuf,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

/// Runs the command.
///
/// # Errors
/// The fault, its place, and advice.
pub fn run(args: &CollectArgs) -> Result<(), Box<dyn Error>> {
    by_kind!(&args.vehicle, collect(args))
}

fn collect<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &CollectArgs,
) -> Result<(), Box<dyn Error>> {
    let file_of = |run: u32| args.out.join(format!("drive_{run}.csv"));
    // `rfl train` takes all of them: drives of an earlier run may be another vehicle's.
    if file_of(args.runs + 1).exists() {
        return Err(format!(
            "{}: an earlier run left more drives than {} here, and whoever learns from the folder would mix them; delete \
             them, or give another folder (--out)",
            file_of(args.runs + 1).display(),
            args.runs
        )
        .into());
    }
    let setup = prepared::<P, S, C>(args)?;
    let model = model::<P, S, C>(args, &setup.controller)?;
    let vehicle = Some(PathBuf::from(&args.vehicle));
    check_folder(
        &args.out,
        &(1..=args.runs).map(|run| format!("drive_{run}.csv")).collect::<Vec<_>>(),
        &given([("--path", &args.path), ("--vehicle", &vehicle), ("--residual", &args.residual)]),
    )?;
    let _held = hold_folder(&args.out)?;
    for run in 0..args.runs {
        let Setup { path, controller, vehicle, effects } = &setup;
        let (vehicle, effects) = (vehicle.clone(), effects.clone());
        let mut setup = Setup::<P, S, C> { path: path.clone(), controller: *controller, vehicle, effects };
        setup.controller.mpc.dither_seed = args.seed + run as usize;
        let sample_time = setup.controller.mpc.sample_time;
        let bar = progress_bar("collecting", setup.path.length(), args.quiet);
        let mut closed = setup.connect(model.clone(), sample_time)?;
        let drive = closed.record(1800.0, |row, _| {
            bar.set_position(row[STATION].max(0.0) as u64);
            true
        });
        bar.finish_and_clear();
        let file = file_of(run + 1);
        write_file(&file, |to| Ok(drive.write_csv(to)?))?;
        let tracking = drive.tracking();
        say!(
            "{}: {:.0} s, lateral error mean {:.4} m, max {:.4} m; {}: {}",
            file.display(),
            drive.duration(),
            tracking.mae,
            tracking.max,
            drive.ending.outcome.name(),
            drive.ending.reason()
        );
        if let End::Failed(error) = drive.ending.end {
            return Err(format!("{}: {error}; the log ends there", file.display()).into());
        }
    }
    say!("next: rfl train {}/*.csv --vehicle {}", args.out.display(), args.vehicle);
    Ok(())
}

/// Road, vehicle and controller of all drives.
fn prepared<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &CollectArgs,
) -> Result<Setup<P, S, C>, Box<dyn Error>> {
    let mut settings: Vec<String> = match args.residual {
        Some(_) => vec![],
        // Calm throughout: dither is to be answered by the vehicle, not by the controller.
        None => vec!["mpc.tightening=1".to_owned()],
    };
    settings.extend_from_slice(&args.settings);
    let mut setup = Setup::<P, S, C>::new(
        args.path.as_deref(),
        &args.limit.road(),
        P::SETTING.training,
        &args.vehicle,
        &settings,
    )?;
    let again = P::SETTING.again.filter(|_| args.residual.is_some());
    setup.controller.mpc.dither =
        args.dither.unwrap_or_else(|| again.map_or(P::SETTING.dither, |again| again.dither));
    Ok(setup)
}

/// The model that the controller predicts with.
fn model<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &CollectArgs,
    controller: &ControllerParametersFor<P::Nominal>,
) -> Result<PredictionModelFor<VehicleLinearModel<P, S, C>, S>, Box<dyn Error>> {
    let Some(file) = &args.residual else {
        return Ok(PredictionModelFor::Adaptive(controller.actuator.actuator()));
    };
    let choice = Choice {
        variant: ControlVariant::None,
        file: Some(file.clone()),
        folder: MODELS.into(),
        propagation: Propagation::Propagated,
        roll_out: RollOut::Corrected,
    };
    Ok(choice.prediction_model(controller)?.1)
}
