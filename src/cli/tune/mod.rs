//! `rfl tune`: weights and horizon for one vehicle, searched over a family of vehicles around it.
//!
//! | file | problem |
//! |---|---|
//! | `family.rs` | the vehicles and roads that are driven |
//! | `result.rs` | the result in words and files |

mod family;
mod result;

use super::drive::ModelArgs;
use super::files::{check_folder, given};
use super::logs::LimitArgs;
use super::output::{hold_folder, write_json, write_text};
use super::progress_bar;
use super::vehicle::{Commanded, by_kind};
use crate::diagnose::page::{Tuned, tuning_page};
use crate::simulate::tune::{
    ControllerNumbers, Ensemble, Purpose, SearchSettings, TuneCandidate, search, standard_axes,
};
use crate::vehicle::{BUILTIN, VehicleParameters as _};
use clap::Args;
use family::TuneData;
use serde_json::Value;
use std::error::Error;
use std::path::PathBuf;

/// Tunes the controller for a vehicle: weights and horizon that stand a family of vehicles around it
#[derive(Debug, Args)]
#[command(
    after_help = "The family: stiffness of each axle 0.8 to 1.1, payload, friction 1 and 0.8, noise, and the vehicle's own steering (lag and
dead time of its file) 0.7 to 1.3 of what the file says. The cost is the worst drive's error and a share of the mean, and what
the wanted margins miss. What is found is written only if it is better than the default controller on other roads and
vehicles of the family; else nothing is written, and that is said. Margins and calm may cost errors: then the result says how much.

Examples:
  rfl tune --vehicle my_car.toml                        on our own random roads; out/tune/controller.toml
  rfl drive --vehicle my_car.toml --controller out/tune/controller.toml
  rfl tune --vehicle my_car.toml --path my_road.csv     on a road of your own
  rfl tune --vehicle my_car.toml --variant rfl_s        with a learned model (from rfl train)
  rfl tune --vehicle my_car.toml --variant actuator --set actuator.dead_time=0.06 --set actuator.time_constant=0.1
  rfl tune --vehicle my_car.toml --set speed.lateral_accel=4 --budget 300
  rfl tune --vehicle truck_real --delay-margin 0.3      a controller that stands 0.3 s more of dead time"
)]
pub struct TuneArgs {
    /// Car or truck: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = BUILTIN[0])]
    vehicle: String,
    /// Road to tune for: a CSV file with columns x, y [default: random roads]
    #[arg(long)]
    path: Option<PathBuf>,
    #[command(flatten)]
    limit: LimitArgs,
    /// A parameter that is not searched, NAME=VALUE, as for `rfl drive`
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    #[command(flatten)]
    model: ModelArgs,
    /// Candidates that are tried
    #[arg(long, default_value_t = 120)]
    budget: usize,
    /// Drives of each candidate
    #[arg(long, default_value_t = 10)]
    scenarios: usize,
    /// Drives with which the default and what was found are compared in the end
    #[arg(long, default_value_t = 16)]
    held_out: usize,
    /// Delay margin that is wanted at every speed, s
    #[arg(long, default_value_t = 0.05)]
    delay_margin: f64,
    /// Gain margin that is wanted at every speed, a factor
    #[arg(long, default_value_t = 2.0)]
    gain_margin: f64,
    /// Seed of roads, vehicles and search
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; 0 for all. The result does not depend on them
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Folder for controller.toml, tune.html and tune.json
    #[arg(long, value_name = "DIR", default_value = "out/tune")]
    out: PathBuf,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

/// Starts beside the default: controllers that stood many vehicles. Of cars, then of trucks; found by searches of this
/// kind.
const KNOWN: [[(&str, f64); 6]; 2] = [
    [
        ("mpc.horizon", 30.0),
        ("mpc.q_e1", 0.118),
        ("mpc.q_e1_rate", 0.0138),
        ("mpc.q_e2", 30.2),
        ("mpc.q_e2_rate", 4.88),
        ("mpc.r_rate", 0.015),
    ],
    [
        ("mpc.horizon", 60.0),
        ("mpc.q_e1", 0.046),
        ("mpc.q_e1_rate", 0.012),
        ("mpc.q_e2", 0.073),
        ("mpc.q_e2_rate", 1.83),
        ("mpc.r_rate", 0.13),
    ],
];
/// Candidates that are compared on validation drives.
const SHORTLIST: usize = 3;
/// Offset between the seeds of validation and those of training.
const VALIDATION: u64 = 500_000;
/// First step of the search, decades of a weight.
const STEP: f64 = 0.35;
/// Runs the command.
///
/// # Errors
/// The fault, its place, and advice.
pub fn run(args: &TuneArgs) -> Result<(), Box<dyn Error>> {
    tuned(args).map(drop)
}

/// Runs the command and gives what it writes to `tune.json`.
///
/// # Errors
/// As [`run`].
pub fn tuned(args: &TuneArgs) -> Result<Value, Box<dyn Error>> {
    if args.budget == 0 || args.scenarios == 0 || args.held_out == 0 {
        return Err("--budget, --scenarios and --held-out must be at least 1".into());
    }
    if !(args.delay_margin.is_finite() && args.delay_margin >= 0.0) {
        return Err(
            format!("--delay-margin {}: give a time in s that is not below 0", args.delay_margin).into()
        );
    }
    if !(args.gain_margin.is_finite() && args.gain_margin >= 1.0) {
        return Err(format!("--gain-margin {}: give a factor of 1 or more", args.gain_margin).into());
    }
    by_kind!(&args.vehicle, tune(args))
}

/// Candidates driven to their end, the best first, and the course of the search for the page.
type Searched = (Vec<TuneCandidate>, Vec<(bool, f64)>);

fn tune<P, const S: usize, const C: usize>(args: &TuneArgs) -> Result<Value, Box<dyn Error>>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    let tuning = TuneData::<P, S, C>::new(args)?;
    let training = tuning.ensemble(args.scenarios, Purpose::Training, args.seed)?;
    let vehicle = Some(PathBuf::from(&args.vehicle));
    let mut read = given([("--path", &args.path), ("--vehicle", &vehicle)]);
    read.extend(args.model.files());
    check_folder(&args.out, &["controller.toml", "tune.json", "tune.html"], &read)?;
    let _held = hold_folder(&args.out)?;
    let default = ControllerNumbers::of(&tuning.controlled.0, &standard_axes());
    let (found, trace) = tuning.search(&training, &default)?;
    // The default is the first start, so that it was driven to its end.
    let of_default = found.iter().find(|candidate| candidate.values == default);
    let (Some(of_default), Some(best)) = (of_default, tuning.best(&found)?) else {
        return Err("no candidate was driven to its end; give --budget more".into());
    };
    let held_out = tuning.ensemble(args.held_out, Purpose::HeldOut, args.seed)?;
    let bar = progress_bar("proving on other roads", 2.0, args.quiet);
    let default_held_out = held_out.examine(&default)?;
    bar.step();
    let best_held_out = held_out.examine(&best.values)?;
    bar.finish_and_clear();
    let better = best.values != default
        && best_held_out.cost < default_held_out.cost
        && best_held_out.lost() <= default_held_out.lost();

    let sets = [[of_default, best], [&default_held_out, &best_held_out]];
    let margins = [tuning.margins(&default)?, tuning.margins(&best.values)?];
    let answers = tuning.answers([&default, &best.values])?;
    result::print(&tuning, sets, &margins);
    let content = tuning.file(&best.values);
    let words = tuning.write_controller(&content, better, sets[1])?;
    let names = |ensemble: &Ensemble<P, S, C>| -> Vec<String> {
        ensemble.scenarios.iter().map(|scenario| scenario.name.clone()).collect()
    };
    let tuned = Tuned {
        vehicle: tuning.vehicle.name(),
        variant: tuning.variant.name(),
        words: &words,
        better,
        sets: [("training", names(&training), sets[0]), ("held out", names(&held_out), sets[1])],
        margins: &margins,
        goal: (args.delay_margin, args.gain_margin),
        answers: &answers,
        trace: &trace,
    };
    result::print_missed(&tuned);
    let value = tuning.as_json(&tuned, content);
    let json_file = args.out.join("tune.json");
    write_json(&json_file, &value)?;
    let page_file = args.out.join("tune.html");
    write_text(&page_file, &tuning_page(&tuned))?;
    say!("page: {}; figures: {}", page_file.display(), json_file.display());
    Ok(value)
}

impl<P, const S: usize, const C: usize> TuneData<'_, P, S, C>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    /// The search from the default and from controllers that stood many vehicles.
    fn search(
        &self,
        training: &Ensemble<P, S, C>,
        default: &ControllerNumbers,
    ) -> Result<Searched, Box<dyn Error>> {
        let args = self.args;
        let known = &KNOWN[usize::from(P::KIND != "car")];
        let known = ControllerNumbers(known.iter().map(|&(name, value)| (name.to_owned(), value)).collect());
        let settings = SearchSettings {
            budget: args.budget,
            starts: vec![default.clone(), known],
            step: STEP,
            population: 0,
            seed: args.seed,
        };
        say!(
            "{}: {} candidates, {} drives each; {} more to compare in the end",
            self.vehicle.name(),
            args.budget,
            args.scenarios,
            2 * args.held_out
        );
        let bar = progress_bar("tuning", args.budget as f64, args.quiet);
        let mut trace = vec![];
        let found = search(training, &standard_axes(), &settings, |number, candidate| {
            bar.set_position(number as u64);
            trace.push((candidate.complete, candidate.cost));
        })?;
        bar.finish_and_clear();
        Ok((found, trace))
    }

    /// The best of the shortlist on validation drives.
    fn best<'c>(&self, found: &'c [TuneCandidate]) -> Result<Option<&'c TuneCandidate>, Box<dyn Error>> {
        let args = self.args;
        let validation = self.ensemble(args.scenarios, Purpose::Training, args.seed + VALIDATION)?;
        let bar = progress_bar("comparing the best", found.len().min(SHORTLIST) as f64, args.quiet);
        let mut best: Option<(f64, &TuneCandidate)> = None;
        for candidate in found.iter().take(SHORTLIST) {
            let cost = validation.examine(&candidate.values)?.cost;
            bar.step();
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, candidate));
            }
        }
        bar.finish_and_clear();
        Ok(best.map(|(_, best)| best))
    }
}
