//! `rfl evaluate`: all variants on several plants: fit, tracking and time.

use super::output::{hold_folder, write_file};
use super::progress_bar;
use super::results_file::{self, ResultsFile};
use super::vehicle::{by_kind, vehicle_named};
use crate::control::{Propagation, Residual, RollOut};
use crate::residual::{LambdaChoice, Regressors, TrainConfig};
use crate::simulate::DriveFor;
use crate::simulate::experiment::{
    Compared, ComparisonFor, Condition, DriveMetrics, Edge, Effort, FitMetrics, Predictor, Roads, RowFit,
    RowResult, SweepPoint, TableRow, TestPlant, sweep,
};
use crate::vehicle::VehicleParameters as _;
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
  rfl evaluate --vehicle truck_simulation --noise off --sweep      the truck, with the sweep over dead time
  rfl evaluate --plants lag --noise off --rows NMPC,GP-NMPC        two rows more, put beside those that are there

Plants of a car: as_is, lag, lag_and_dead_time, payload_low_friction. Rows: MPC, RT, RTL, RF, RFL, linear,
linear_curvature, RFL+S, RFL+S+observer, MPC+observer, NMPC, GP-NMPC, oracle.
Plants of a truck: low_delay, high_delay. Rows: MPC, first_order, pade_1_1, pade_2_2, identified, oracle, RT, RF, linear,
RTL, RFL, RFL+S, NMPC, GP-NMPC, and most with +observer.")]
pub struct EvaluateArgs {
    /// Plants to drive, separated by commas [default: all]
    #[arg(long, value_delimiter = ',')]
    plants: Vec<String>,
    /// Rows of the comparison, separated by commas; the nominal MPC is always among them [default: all]
    #[arg(long, value_delimiter = ',')]
    rows: Vec<String>,
    /// Without sensor noise, with it, or both
    #[arg(long, value_enum, default_value_t = NoiseChoice::Both)]
    noise: NoiseChoice,
    /// Car or truck: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = crate::vehicle::BUILTIN[0])]
    vehicle: String,
    /// Seeds: each has drives, models and noise of its own [default: 5; of a truck 3]
    #[arg(long)]
    seeds: Option<usize>,
    /// Drives of the training route that each seed learns from, before any second round [default: 2; of a truck 1]
    #[arg(long)]
    drives: Option<usize>,
    /// Candidates of each row's search for weights [default: 64; of a truck 24]
    #[arg(long)]
    budget: Option<usize>,
    /// One seed and a small budget
    #[arg(long)]
    quick: bool,
    /// Add ablations of RFL+S on the plants without noise
    #[arg(long)]
    ablations: bool,
    /// Add the sweep over the dead time of a truck's steering
    #[arg(long)]
    sweep: bool,
    /// Threads; 0 for all there are
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Folder for the results; conditions and rows that are there already are not repeated [default: out/evaluate; of another
    /// vehicle than the default one out/evaluate_VEHICLE]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Put the rows of another folder's results beside those in --out, and run nothing: what was made apart
    #[arg(long, value_name = "FOLDER")]
    join: Option<PathBuf>,
    /// Say the plants and noises that would be driven, one file of results a line, and run nothing
    #[arg(long)]
    list: bool,
    /// Spread plants and noises over a Dask cluster: `local`, or the address of a scheduler (Python package, extra `fleet`)
    #[arg(long, value_name = "ADDRESS")]
    dask: Option<String>,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

/// Choice of noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum NoiseChoice {
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
    outcome: DriveMetrics,
    /// One step ahead on the test route.
    test: FitMetrics,
    train: FitMetrics,
    /// 16 steps ahead on the test route.
    test_16_steps: FitMetrics,
}

fn chosen<T: Clone, N: AsRef<str> + PartialEq<String>>(
    names: &[String],
    all: &[T],
    name: impl Fn(&T) -> N,
    what: &str,
) -> Result<Vec<T>, String> {
    if names.is_empty() {
        return Ok(all.to_vec());
    }
    let known = || all.iter().map(|item| name(item).as_ref().to_owned()).collect::<Vec<_>>().join(", ");
    names
        .iter()
        .map(|asked| {
            all.iter()
                .find(|item| name(item) == *asked)
                .cloned()
                .ok_or_else(|| format!("there is no {what} '{asked}'; there are {}", known()))
        })
        .collect()
}

/// Runs the command.
///
/// # Errors
/// The fault, its place, and advice.
pub fn run(args: &EvaluateArgs) -> Result<(), Box<dyn Error>> {
    by_kind!(&args.vehicle, evaluate(args))
}

fn evaluate<P: Compared<S, C>, const S: usize, const C: usize>(
    args: &EvaluateArgs,
) -> Result<(), Box<dyn Error>> {
    let setting = P::SETTING;
    let plants: Vec<TestPlant> = chosen(&args.plants, setting.plants, |plant| plant.name.clone(), "plant")?;
    let rows: Vec<TableRow> = chosen(&args.rows, setting.rows, |row| row.name(), "row")?;
    let effort = Effort {
        seeds: args.seeds.unwrap_or(if args.quick { 1 } else { setting.seeds }),
        drives: args.drives.unwrap_or(setting.drives),
        budget: args.budget.unwrap_or(if args.quick { 12 } else { setting.budget }),
        threads: args.threads,
    };
    if effort.seeds == 0 || effort.drives == 0 || effort.budget == 0 {
        return Err("--seeds, --drives and --budget must be positive".into());
    }
    let noises: &[bool] = match args.noise {
        NoiseChoice::Off => &[false],
        NoiseChoice::On => &[true],
        NoiseChoice::Both => &[false, true],
    };
    // The plants of the headline come first.
    let mut conditions: Vec<(&TestPlant, bool)> =
        plants.iter().flat_map(|plant| noises.iter().map(move |&noise| (plant, noise))).collect();
    conditions.sort_by_key(|(plant, _)| !plant.timed);
    if args.list {
        for (plant, noise) in conditions {
            say!("{} {}", plant.name, if noise { "on" } else { "off" });
        }
        return Ok(());
    }
    if args.dask.is_some() {
        return Err(super::fleet::elsewhere("rfl evaluate --dask").into());
    }
    let out = folder(args);
    let vehicle: P::Parameters = vehicle_named(&args.vehicle)?;
    let _held = hold_folder(&out)?;
    let evaluator = Evaluator::<P, S, C> { args, rows, effort, out, vehicle };
    for (plant, noise) in conditions {
        evaluator.condition(plant, noise)?;
    }
    if args.sweep && args.join.is_none() {
        evaluator.sweep()?;
    }
    Ok(())
}

/// The comparison, condition by condition.
struct Evaluator<'a, P: Compared<S, C>, const S: usize, const C: usize> {
    args: &'a EvaluateArgs,
    rows: Vec<TableRow>,
    effort: Effort,
    out: PathBuf,
    vehicle: P::Parameters,
}

impl<P: Compared<S, C>, const S: usize, const C: usize> Evaluator<'_, P, S, C> {
    /// Runs the rows that a condition's file lacks, and puts them there.
    fn condition(&self, plant: &TestPlant, noise: bool) -> Result<(), Box<dyn Error>> {
        let (args, setting) = (self.args, P::SETTING);
        let name = format!("{}{}", plant.name, if noise { "_noise" } else { "" });
        let file = self.out.join(format!("{name}.json"));
        let there = ResultsFile::read(&file, self.vehicle.name(), &self.effort)?;
        if let Some(folder) = &args.join {
            return self.join(&name, &file, there, folder);
        }
        let known: Vec<&str> = there.iter().flat_map(ResultsFile::rows).collect();
        let rows: Vec<TableRow> =
            self.rows.iter().copied().filter(|row| !known.contains(&row.name().as_str())).collect();
        if there.is_some() && rows.is_empty() {
            say!("{name}: there already ({}); delete the file to repeat it", file.display());
            return Ok(());
        }
        let bar = progress_bar(&name, 3.0 * rows.len() as f64, args.quiet);
        bar.set_message(format!("{name}: collecting"));
        let noise = noise.then_some(setting.noise);
        let roads = Roads::new(&setting, plant)?;
        let comparison =
            ComparisonFor::<P, S, C>::collect(&self.vehicle, plant, noise, &roads, self.effort.clone())?;
        let nominal = there.as_ref().and_then(|there| there.weights(TableRow::NOMINAL));
        let mut condition = comparison.run(&rows, nominal, &|text| {
            bar.set_message(format!("{name}: {text}"));
            bar.step();
        })?;
        let mut ablations = vec![];
        if plant.timed {
            bar.set_message(format!("{name}: timing"));
            let drives = self.out.join(format!("drives_{name}"));
            time(&comparison, &mut condition.rows, &drives)?;
        }
        if plant.edge {
            bar.set_message(format!("{name}: the nominal's edge"));
            condition.edges = edges(&comparison, &condition.rows, there.as_ref())?;
        }
        if args.ablations && noise.is_none() {
            bar.set_message(format!("{name}: ablations"));
            ablations = ablate(&comparison, &condition.rows)?;
        }
        bar.finish_and_clear();
        print(&condition);
        let results = Results { condition: &condition, ablations };
        match there {
            Some(there) => results_file::write(&file, &there.with(&results, setting.rows)?),
            None => results_file::write(&file, &results),
        }
    }

    /// Puts the rows of another folder's file beside those of a condition's.
    fn join(
        &self,
        name: &str,
        file: &Path,
        there: Option<ResultsFile>,
        folder: &Path,
    ) -> Result<(), Box<dyn Error>> {
        let other =
            ResultsFile::read(&folder.join(format!("{name}.json")), self.vehicle.name(), &self.effort)?;
        if let (Some(there), Some(other)) = (there, other) {
            results_file::write(file, &there.join(&other, P::SETTING.rows)?)?;
            say!("{name}: rows of {} put into {}", folder.display(), file.display());
        } else {
            say!("{name}: not in both folders; left as it is");
        }
        Ok(())
    }

    /// Runs the sweep over the dead time, unless its file is there.
    fn sweep(&self) -> Result<(), Box<dyn Error>> {
        let file = self.out.join("sweep.json");
        if file.exists() {
            say!("sweep: there already ({}); delete the file to repeat it", file.display());
            return Ok(());
        }
        let steps = P::SETTING.sweep.map_or(0, |sweep| sweep.dead_times.len());
        let bar = progress_bar("sweep", steps as f64, self.args.quiet);
        let points = sweep::<P, S, C>(&self.vehicle, self.args.threads, &|text| {
            bar.set_message(format!("sweep: {text}"));
            bar.step();
        })?;
        bar.finish_and_clear();
        print_sweep(&points);
        results_file::write(&file, &points)
    }
}

/// Outcomes of all rows at the nominal's edge, those that were there already too.
fn edges<P: Compared<S, C>, const S: usize, const C: usize>(
    comparison: &ComparisonFor<'_, P, S, C>,
    rows: &[RowResult],
    there: Option<&ResultsFile>,
) -> Result<Vec<Edge>, Box<dyn Error>> {
    let of = |row: &TableRow| {
        let new = rows.iter().find(|result| result.row == row.name());
        let weights = new.map(|result| result.weights).or_else(|| there?.weights(*row));
        weights.map(|weights| (*row, weights))
    };
    let best: Vec<_> = P::SETTING.rows.iter().filter_map(of).collect();
    let mut edges = vec![comparison.edge_of_weights(&best)?];
    edges.extend(comparison.edge_of_delay(&best)?);
    Ok(edges)
}

/// The folder for results.
fn folder(args: &EvaluateArgs) -> PathBuf {
    let stem = || Path::new(&args.vehicle).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    args.out.clone().unwrap_or_else(|| {
        let of =
            if args.vehicle == crate::vehicle::BUILTIN[0] { String::new() } else { format!("_{}", stem()) };
        PathBuf::from(format!("out/evaluate{of}"))
    })
}

/// Times each row and keeps the logs of its drives.
fn time<P: Compared<S, C>, const S: usize, const C: usize>(
    comparison: &ComparisonFor<'_, P, S, C>,
    rows: &mut [RowResult],
    folder: &Path,
) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    for result in rows {
        let Some(&row) = P::SETTING.rows.iter().find(|row| row.name() == result.row) else { continue };
        let write = |name: String, drive: &DriveFor<C>| {
            write_file(&folder.join(format!("{name}.csv")), |writer| Ok(drive.write_csv(writer)?))
        };
        let (time, drive) = comparison.time(row, &result.weights)?;
        result.time = Some(time);
        write(result.row.clone(), &drive)?;
        for (route, path) in &comparison.roads.further {
            let drive = comparison.drive(row, &result.weights, path)?;
            write(format!("{}_{}", route.name(), result.row), &drive)?;
        }
    }
    Ok(())
}

/// A change: its name, its training, its propagation.
type Change = (&'static str, TrainConfig, Propagation, RollOut);

/// Changes, one at a time.
fn changes(rfl_s: &TrainConfig) -> Vec<Change> {
    let base = || rfl_s.clone();
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
    type TrainingChange = (&'static str, fn(&mut TrainConfig));
    let trained: [TrainingChange; 12] = [
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

fn ablate<P: Compared<S, C>, const S: usize, const C: usize>(
    comparison: &ComparisonFor<'_, P, S, C>,
    rows: &[RowResult],
) -> Result<Vec<Ablation>, Box<dyn Error>> {
    let base = TableRow::plain(Predictor::RflS).name();
    let Some(result) = rows.iter().find(|result| result.row == base) else { return Ok(vec![]) };
    let ablate_one = |(name, config, propagation, roll_out): Change| {
        let model = comparison.train(&config, 0)?;
        let fit = comparison.fit(&model, 0);
        let residual = Residual { model: Arc::new(model), propagation, roll_out };
        let outcome = comparison.drive_with(residual, &result.weights)?;
        let RowFit { train, test, test_16_steps, .. } = fit;
        Ok(Ablation { name: name.to_string(), outcome, test, train, test_16_steps })
    };
    let rfl_s = comparison.training(Predictor::RflS);
    rfl_s.iter().flat_map(changes).map(ablate_one).collect()
}

/// Mean and standard deviation.
fn spread(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, variance.sqrt())
}

/// Prints a table of outcomes; `base` is the mean error that PE is measured by, not a number if there is none.
fn print_table<'a>(title: &str, base: f64, rows: impl Iterator<Item = (&'a str, &'a [DriveMetrics])>) {
    say!("{title:<18} {:>15} {:>8} {:>8} {:>8} {:>10}", "MAE (sd)", "RMSE", "max", "PE", "roughness");
    for (row, outcomes) in rows {
        let mean = |value: fn(&DriveMetrics) -> f64| spread(outcomes.iter().map(value)).0;
        let (mae, sd) = spread(outcomes.iter().map(|outcome| outcome.tracking.mae));
        let lost = outcomes.iter().filter(|outcome| outcome.lost).count();
        let note =
            if lost > 0 { format!("  diverged in {lost} of {}", outcomes.len()) } else { String::new() };
        let cut = if base.is_nan() { "-".to_owned() } else { format!("{:.1}", 100.0 * (1.0 - mae / base)) };
        say!(
            "{row:<18} {:>8.2} ({:>4.2}) {:>8.2} {:>8.1} {cut:>8} {:>10.3}{note}",
            1e3 * mae,
            1e3 * sd,
            1e3 * mean(|o| o.tracking.rmse),
            1e3 * mean(|o| o.tracking.max),
            mean(|o| o.steering.rate_rms),
        );
    }
}

fn mae_of(outcomes: &[DriveMetrics]) -> f64 {
    spread(outcomes.iter().map(|outcome| outcome.tracking.mae)).0
}

fn print(condition: &Condition) {
    let noise = if condition.noise { "with" } else { "without" };
    let seeds = condition.effort.seeds;
    let plural = if seeds == 1 { "" } else { "s" };
    say!("\nplant {}, {noise} sensor noise, {seeds} seed{plural}", condition.plant);
    say!("lateral error in mm, PE in % of the nominal MPC's mean; roughness: RMS steering rate in rad/s");
    if !condition.left_out.is_empty() {
        say!("left out, for there is no such model of it: {}", condition.left_out.join(", "));
    }
    let Some(nominal) = condition.rows.first() else { return };
    // Rows that are put beside others come without the nominal MPC: then there is no PE.
    let mae_of = |outcomes| if nominal.row == TableRow::NOMINAL.name() { mae_of(outcomes) } else { f64::NAN };
    for (place, (protocol, base)) in nominal.protocols().into_iter().enumerate() {
        let rows = condition.rows.iter().map(|row| (row.row.as_str(), row.protocols()[place].1));
        print_table(protocol, mae_of(base), rows);
    }
    for (road, base) in &nominal.further {
        let rows = condition.rows.iter().map(|row| (row.row.as_str(), row.further[road].as_slice()));
        print_table(road, mae_of(base), rows);
    }
    for edge in &condition.edges {
        let base = edge.rows.first().map_or(f64::NAN, |(_, nominal)| nominal.tracking.mae);
        let rows = edge.rows.iter().map(|(row, outcome)| (row.as_str(), std::slice::from_ref(outcome)));
        print_table("nominal's edge", base, rows);
        let (percent, delay) = (100.0 * edge.share, edge.dead_time);
        say!("  ({percent:.0} % of the way to {}; dead time {delay:.3} s)", edge.towards);
    }
}

fn print_sweep(points: &[SweepPoint]) {
    say!("\nmean lateral error in mm over the dead time of the steering");
    for point in points {
        let SweepPoint { dead_time, weights, row, outcome, .. } = point;
        let text = match outcome {
            None => "nothing to learn from: the collecting MPC was lost".to_owned(),
            Some(outcome) if outcome.lost => "diverged".to_owned(),
            Some(outcome) => format!("{:.2}", 1e3 * outcome.tracking.mae),
        };
        say!("{weights:<10} {dead_time:>4.1} s {row:<14} {text}");
    }
}
