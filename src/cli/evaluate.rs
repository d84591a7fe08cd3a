//! `rfl evaluate`: all variants on several plants: fit, tracking and time.

use super::progress_bar;
use super::vehicle::vehicle_named;
use crate::control::{Propagation, Residual, RollOut};
use crate::residual::{LambdaChoice, Regressors, TrainConfig};
use crate::simulate::SensorNoise;
use crate::simulate::experiment::{
    Comparison, Condition, Effort, FitMetrics, Outcome, Plant, Roads, Row, RowResult,
};
use clap::Args;
use serde::Serialize;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Compares all variants on several plants: each row tuned with one budget on training roads, then driven on the test
/// route; one JSON file for each plant
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl evaluate --quick                                     a first impression in a few minutes
  rfl evaluate --plants lag_and_dead_time --noise off      one table of the comparison
  rfl evaluate                                             all of it: an hour on two cores; goes on where it stopped

Plants: as_is, lag, lag_and_dead_time, payload_low_friction. Rows: MPC, RT, RTL, RF, RFL, linear, linear_curvature,
RFL+S, RFL+S+observer, MPC+observer, NMPC, GP-NMPC, oracle.")]
pub struct EvaluateArgs {
    /// Plants to drive, separated by commas [default: all]
    #[arg(long, value_delimiter = ',')]
    plants: Vec<String>,
    /// Rows of the comparison, separated by commas; the nominal MPC is always among them [default: all]
    #[arg(long, value_delimiter = ',')]
    rows: Vec<String>,
    /// Without sensor noise, with it, or both
    #[arg(long, value_enum, default_value_t = Noise::Both)]
    noise: Noise,
    /// Car: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = crate::vehicle::BUILTIN[0])]
    vehicle: String,
    /// Seeds: each has drives, models and noise of its own
    #[arg(long, default_value_t = 5)]
    seeds: usize,
    /// Candidates of each row's search for weights
    #[arg(long, default_value_t = 64)]
    budget: usize,
    /// One seed and a small budget
    #[arg(long)]
    quick: bool,
    /// Add ablations of RFL+S on the plants without noise
    #[arg(long)]
    ablations: bool,
    /// Threads; 0 for all there are
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Folder for the results; conditions that are there already are not repeated
    #[arg(long, default_value = "out/evaluate")]
    out: PathBuf,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

/// Which noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Noise {
    Off,
    On,
    Both,
}

/// A file of results.
#[derive(Serialize)]
struct Results<'a> {
    #[serde(flatten)]
    condition: &'a Condition,
    ablations: Vec<Ablation>,
}

/// RFL+S with one thing changed, at the weights of RFL+S.
#[derive(Serialize)]
struct Ablation {
    name: String,
    outcome: Outcome,
    /// One step ahead on the test route.
    test: FitMetrics,
    train: FitMetrics,
    /// 16 steps ahead on the test route.
    test_16_steps: FitMetrics,
}

fn chosen<T: Copy>(
    names: &[String],
    all: &[T],
    name: fn(T) -> &'static str,
    what: &str,
) -> Result<Vec<T>, String> {
    if names.is_empty() {
        return Ok(all.to_vec());
    }
    let known = || all.iter().map(|&item| name(item)).collect::<Vec<_>>().join(", ");
    names
        .iter()
        .map(|asked| {
            all.iter()
                .copied()
                .find(|&item| name(item) == asked)
                .ok_or_else(|| format!("there is no {what} '{asked}'; there are {}", known()))
        })
        .collect()
}

/// Runs the command.
///
/// # Errors
/// What was wrong, where, and what to do.
pub fn run(args: &EvaluateArgs) -> Result<(), Box<dyn Error>> {
    let plants = chosen(&args.plants, Plant::ALL, Plant::name, "plant")?;
    let rows = chosen(&args.rows, Row::ALL, Row::name, "row")?;
    let mut effort =
        Effort { seeds: args.seeds, budget: args.budget, threads: args.threads, ..Effort::default() };
    if args.quick {
        (effort.seeds, effort.budget) = (1, 12);
    }
    if effort.seeds == 0 || effort.budget == 0 {
        return Err("--seeds and --budget must be positive".into());
    }
    std::fs::create_dir_all(&args.out).map_err(|error| format!("{}: {error}", args.out.display()))?;
    let car = vehicle_named(&args.vehicle)?;
    let roads = Roads::new()?;
    let noises: &[bool] = match args.noise {
        Noise::Off => &[false],
        Noise::On => &[true],
        Noise::Both => &[false, true],
    };
    // The plants of the headline come first: lag and dead time.
    let mut conditions: Vec<(Plant, bool)> =
        plants.iter().flat_map(|&plant| noises.iter().map(move |&noise| (plant, noise))).collect();
    conditions.sort_by_key(|&(plant, _)| plant != Plant::LagAndDeadTime);
    for (plant, noise) in conditions {
        let name = format!("{}{}", plant.name(), if noise { "_noise" } else { "" });
        let file = args.out.join(format!("{name}.json"));
        if file.exists() {
            println!("{name}: there already ({}); delete the file to repeat it", file.display());
            continue;
        }
        let bar = progress_bar(&name, 3.0 * rows.len() as f64, args.quiet);
        bar.set_message(format!("{name}: collecting"));
        let noise = noise.then_some(SensorNoise::TYPICAL);
        let comparison = Comparison::collect(&car, plant, noise, &roads, effort.clone())?;
        let mut condition = comparison.run(&rows, &|text| {
            bar.set_message(format!("{name}: {text}"));
            bar.inc(1);
        })?;
        let mut ablations = vec![];
        if plant == Plant::LagAndDeadTime {
            bar.set_message(format!("{name}: timing"));
            let drives = args.out.join(format!("drives_{name}"));
            time(&comparison, &mut condition.rows, &drives)?;
        }
        if args.ablations && noise.is_none() {
            bar.set_message(format!("{name}: ablations"));
            ablations = ablate(&comparison, &condition.rows)?;
        }
        bar.finish_and_clear();
        print(&condition);
        let text = serde_json::to_string(&Results { condition: &condition, ablations })?;
        std::fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
    }
    Ok(())
}

/// Times each row and keeps the log of its drive.
fn time(comparison: &Comparison<'_>, rows: &mut [RowResult], folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    for result in rows {
        let Some(&row) = Row::ALL.iter().find(|row| row.name() == result.row) else { continue };
        let (time, drive) = comparison.time(row, &result.weights)?;
        result.time = Some(time);
        let file = folder.join(format!("{}.csv", result.row));
        drive.write_csv(
            std::fs::File::create(&file).map_err(|error| format!("{}: {error}", file.display()))?,
        )?;
    }
    Ok(())
}

/// A change: its name, what is learned, how it predicts.
type Change = (&'static str, TrainConfig, Propagation, RollOut);

/// What is changed in turn.
fn changes() -> Vec<Change> {
    let base = || Row::RflS.training().unwrap_or_else(|| TrainConfig::new(crate::residual::Kind::RflS));
    let with = |change: fn(&mut TrainConfig)| {
        let mut config = base();
        change(&mut config);
        config
    };
    let (propagated, corrected) = (Propagation::Propagated, RollOut::Corrected);
    let mut list = vec![
        ("as it is", base(), propagated, corrected),
        ("direct, as printed in eq. (9)", base(), Propagation::Direct, corrected),
        ("roll-out with the nominal model", base(), propagated, RollOut::Nominal),
    ];
    type Training = (&'static str, fn(&mut TrainConfig));
    let trained: [Training; 12] = [
        ("window 8", |c| c.window = 8),
        ("window 16", |c| c.window = 16),
        ("window 40", |c| c.window = 40),
        ("depth 3", |c| c.depth = 3),
        ("depth 8", |c| c.depth = 8),
        ("1 tree", |c| c.trees = 1),
        ("5 trees", |c| c.trees = 5),
        ("40 trees", |c| c.trees = 40),
        ("two newest states in the leaves", |c| c.regressors = Regressors { road: true, states: 2 }),
        ("plain least squares in the leaves, no prefilter (the paper's)", |c| {
            (c.lambda, c.prefilter) = (LambdaChoice::LeastSquares, 0.0);
        }),
        ("leaves shrunk wholly to the global fit", |c| c.lambda = LambdaChoice::Fixed(f64::INFINITY)),
        ("no prefilter", |c| c.prefilter = 0.0),
    ];
    list.extend(trained.map(|(name, change)| (name, with(change), propagated, corrected)));
    list
}

fn ablate(comparison: &Comparison<'_>, rows: &[RowResult]) -> Result<Vec<Ablation>, Box<dyn Error>> {
    let Some(result) = rows.iter().find(|result| result.row == Row::RflS.name()) else { return Ok(vec![]) };
    let ablate_one = |(name, config, propagation, roll_out): Change| {
        let model = comparison.train(&config, 0)?;
        let fit = comparison.fit(&model, 0);
        let residual = Residual { model: Arc::new(model), propagation, roll_out };
        let outcome = comparison.drive_with(residual, &result.weights)?;
        let (train, test, test_16_steps) = (fit.train, fit.test, fit.test_16_steps);
        Ok(Ablation { name: name.to_string(), outcome, test, train, test_16_steps })
    };
    changes().into_iter().map(ablate_one).collect()
}

/// Mean and standard deviation.
fn spread(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, variance.sqrt())
}

fn print(condition: &Condition) {
    let noise = if condition.noise { "with" } else { "without" };
    println!("\nplant {}, {noise} sensor noise, {} seeds", condition.plant, condition.effort.seeds);
    println!("lateral error in mm, PE in % of the nominal MPC's mean; roughness: RMS steering rate in rad/s");
    let Some(nominal) = condition.rows.first() else { return };
    for (place, (protocol, base)) in nominal.protocols().into_iter().enumerate() {
        let base = spread(base.iter().map(|outcome| outcome.tracking.mae)).0;
        println!(
            "{protocol:<18} {:>15} {:>8} {:>8} {:>8} {:>10}",
            "MAE (sd)", "RMSE", "max", "PE", "roughness"
        );
        for row in &condition.rows {
            let (_, outcomes) = row.protocols()[place];
            let mean = |value: fn(&Outcome) -> f64| spread(outcomes.iter().map(value)).0;
            let (mae, sd) = spread(outcomes.iter().map(|outcome| outcome.tracking.mae));
            let lost = outcomes.iter().filter(|outcome| outcome.lost).count();
            let note =
                if lost > 0 { format!("  diverged in {lost} of {}", outcomes.len()) } else { String::new() };
            println!(
                "{:<18} {:>8.2} ({:>4.2}) {:>8.2} {:>8.1} {:>8.1} {:>10.3}{note}",
                row.row,
                1e3 * mae,
                1e3 * sd,
                1e3 * mean(|o| o.tracking.rmse),
                1e3 * mean(|o| o.tracking.max),
                100.0 * (1.0 - mae / base),
                mean(|o| o.steering.rate_rms),
            );
        }
    }
}
