//! `rfl evaluate`: all variants on several plants: fit, tracking and time.

use super::output::{hold_folder, write_file};
use super::progress_bar;
use super::results_file::{self, ResultsFile};
use super::results_table;
use super::vehicle::{by_kind, vehicle_named};
use crate::control::{Propagation, Residual, RollOut};
use crate::residual::{LambdaChoice, Regressors, TrainConfig};
use crate::simulate::DriveFor;
use crate::simulate::experiment::{
    Compared, ComparisonFor, Condition, DriveMetrics, Edge, Effort, FitMetrics, Predictor, Roads, RowFit,
    SweepPoint, TableRow, TestPlant, sweep, vehicle_digest,
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
  rfl evaluate                                             all of it: an hour on two cores; again: goes on from the last whole row
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
    /// Folder for the results. Each row is kept when it is done, and none that is there is repeated: a run that is stopped
    /// loses the collected drives, the rows that were running, times, edges and ablations of its plant and noise [default:
    /// out/evaluate; of another vehicle than the default one out/evaluate_VEHICLE]
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
    let mut found: Vec<usize> = vec![];
    for asked in names {
        let place = all.iter().position(|item| name(item) == *asked);
        let place = place.ok_or_else(|| format!("there is no {what} '{asked}'; there are {}", known()))?;
        if !found.contains(&place) {
            found.push(place);
        }
    }
    Ok(found.into_iter().map(|place| all[place].clone()).collect())
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
    /// Runs what a condition's file lacks, and puts it there: each row when it is done, so that a run that is stopped
    /// loses only what was running.
    fn condition(&self, plant: &TestPlant, noise: bool) -> Result<(), Box<dyn Error>> {
        let (args, setting) = (self.args, P::SETTING);
        let name = format!("{}{}", plant.name, if noise { "_noise" } else { "" });
        let file = self.out.join(format!("{name}.json"));
        let there = ResultsFile::read(&file)?;
        if let Some(folder) = &args.join {
            return self.join(&name, &file, there, folder);
        }
        let rows = self.missing(there.as_ref());
        let has_base = self.rows.contains(&ABLATED) || there.as_ref().is_some_and(|there| there.has(ABLATED));
        let ablated = there.as_ref().is_some_and(ResultsFile::has_ablations);
        let ablates = args.ablations && !noise && has_base && !ablated;
        let mut whole = false;
        if let Some(there) = &there {
            let digest = vehicle_digest(&self.vehicle);
            there.check(
                &ResultsFile::asked(self.vehicle.name(), &digest, &plant.name, noise, &self.effort),
                &file,
            )?;
            whole = rows.is_empty() && !there.is_unfinished();
            if whole && !ablates {
                say!("{name}: there already ({}); delete the file to repeat it", file.display());
                return Ok(());
            }
            there.check_open(&file)?;
        }
        let bar = progress_bar(&name, 3.0 * rows.len() as f64, args.quiet);
        bar.set_message(format!("{name}: collecting"));
        let roads = Roads::new(&setting, plant)?;
        let noise = noise.then_some(setting.noise);
        let comparison =
            ComparisonFor::<P, S, C>::collect(&self.vehicle, plant, noise, &roads, self.effort.clone())?;
        let mut results = match there {
            Some(there) if rows.is_empty() => there,
            there => run_rows(&comparison, &rows, there.as_ref(), &file, &|text| {
                bar.set_message(format!("{name}: {text}"));
                bar.step();
            })?,
        };
        if !whole {
            if plant.timed {
                bar.set_message(format!("{name}: timing"));
                time(&comparison, &mut results, &self.out.join(format!("drives_{name}")))?;
            }
            if plant.edge {
                bar.set_message(format!("{name}: the nominal's edge"));
                results.set_edges(&edges(&comparison, &results)?)?;
            }
            results.set_unfinished(false);
            results.write(&file)?;
        }
        if ablates {
            bar.set_message(format!("{name}: ablations"));
            results.set_ablations(&ablate(&comparison, &results)?)?;
            results.write(&file)?;
        }
        bar.finish_and_clear();
        results_table::print(results.value());
        Ok(())
    }

    /// The rows that are asked for and that a file lacks.
    fn missing(&self, there: Option<&ResultsFile>) -> Vec<TableRow> {
        let known: Vec<&str> = there.map(ResultsFile::known).unwrap_or_default();
        self.rows.iter().copied().filter(|row| !known.contains(&row.name().as_str())).collect()
    }

    /// Puts the rows of another folder's file beside those of a condition's.
    fn join(
        &self,
        name: &str,
        file: &Path,
        there: Option<ResultsFile>,
        folder: &Path,
    ) -> Result<(), Box<dyn Error>> {
        let further = folder.join(format!("{name}.json"));
        if let (Some(there), Some(other)) = (there, ResultsFile::read(&further)?) {
            let joined = there.join(&other, P::SETTING.rows).map_err(|error| {
                format!("{}, and {} beside it: {error}", file.display(), further.display())
            })?;
            joined.write(file)?;
            say!("{name}: rows of {} put into {}", folder.display(), file.display());
            results_table::print(joined.value());
        } else {
            say!("{name}: not in both folders; left as it is");
        }
        Ok(())
    }

    /// Runs the sweep over the dead time, unless its file is there.
    fn sweep(&self) -> Result<(), Box<dyn Error>> {
        let file = self.out.join("sweep.json");
        let (name, digest) = (self.vehicle.name(), vehicle_digest(&self.vehicle));
        if results_file::has_sweep(&file, name, &digest)? {
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
        results_file::write_sweep(&file, name, &digest, &points)
    }
}

/// Runs rows, and puts each into the file when it is done; gives all rows.
fn run_rows<P: Compared<S, C>, const S: usize, const C: usize>(
    comparison: &ComparisonFor<'_, P, S, C>,
    rows: &[TableRow],
    there: Option<&ResultsFile>,
    file: &Path,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<ResultsFile, Box<dyn Error>> {
    let put = |condition: &Condition| -> Result<ResultsFile, Box<dyn Error>> {
        let mut results = ResultsFile::with(there, condition, P::SETTING.rows)?;
        results.set_unfinished(true);
        results.write(file)?;
        Ok(results)
    };
    // A file that cannot be written after a row is tried again with the next one; the last must succeed.
    let keep = |condition: &Condition| drop(put(condition));
    let nominal = there.and_then(|there| there.weights(TableRow::NOMINAL));
    put(&comparison.run_keeping(rows, nominal, progress, &keep)?)
}

/// Outcomes of all rows at the nominal's edge.
fn edges<P: Compared<S, C>, const S: usize, const C: usize>(
    comparison: &ComparisonFor<'_, P, S, C>,
    results: &ResultsFile,
) -> Result<Vec<Edge>, Box<dyn Error>> {
    let of = |row: &TableRow| results.weights(*row).map(|weights| (*row, weights));
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

/// Times each row that was not timed, and keeps the logs of its drives.
fn time<P: Compared<S, C>, const S: usize, const C: usize>(
    comparison: &ComparisonFor<'_, P, S, C>,
    results: &mut ResultsFile,
    folder: &Path,
) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    for &row in P::SETTING.rows {
        let Some(weights) = results.weights(row).filter(|_| results.lacks_time(row)) else { continue };
        let write = |name: String, drive: &DriveFor<C>| {
            write_file(&folder.join(format!("{name}.csv")), |writer| Ok(drive.write_csv(writer)?))
        };
        let (time, drive) = comparison.time(row, &weights)?;
        results.set_time(row, &time)?;
        write(row.name(), &drive)?;
        for (route, path) in &comparison.roads.further {
            let drive = comparison.drive(row, &weights, path)?;
            write(format!("{}_{}", route.name(), row.name()), &drive)?;
        }
    }
    Ok(())
}

/// The row that ablations change.
const ABLATED: TableRow = TableRow::plain(Predictor::RflS);

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
    results: &ResultsFile,
) -> Result<Vec<Ablation>, Box<dyn Error>> {
    let Some(weights) = results.weights(ABLATED) else { return Ok(vec![]) };
    let ablate_one = |(name, config, propagation, roll_out): Change| {
        let model = comparison.train(&config, 0)?;
        let fit = comparison.fit(&model, 0);
        let residual = Residual { model: Arc::new(model), propagation, roll_out };
        let outcome = comparison.drive_with(residual, &weights)?;
        let RowFit { train, test, test_16_steps, .. } = fit;
        Ok(Ablation { name: name.to_string(), outcome, test, train, test_16_steps })
    };
    let rfl_s = comparison.training(Predictor::RflS);
    rfl_s.iter().flat_map(changes).map(ablate_one).collect()
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
