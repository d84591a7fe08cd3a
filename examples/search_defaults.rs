//! Searches a controller that stands what vehicles are: `search_defaults car|truck [OPTIONS]`, see `--help`.
//!
//! Prints each candidate that is the best so far, and writes the best ones with what they did in each scenario, on the
//! training ensemble and on one with other seeds.

use clap::Parser;
use rfl_mpc::control::PredictionModelFor;
use rfl_mpc::simulate::experiment::Compared;
use rfl_mpc::simulate::tune::{
    Axis, ControllerNumbers, Ensemble, Family, MarginGoal, Purpose, SearchSettings, TuneCandidate, search,
    standard_axes,
};
use rfl_mpc::vehicle::{Car, Truck, VehicleParameters as _};
use serde_json::json;
use std::error::Error;
use std::path::PathBuf;

/// Searches a controller that stands what vehicles are.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:
  search_defaults car --start mpc.horizon=30,mpc.q_e1=.118,mpc.q_e1_rate=.0138,mpc.q_e2=30.2,mpc.q_e2_rate=4.88,mpc.r_rate=.015
  search_defaults truck --budget 100 --scenarios 10 --json truck.json
  search_defaults car --told 0.2 --lag 0,0.2      the controller is told the actuator, wrong by up to 20 %
  search_defaults car --budget 0 --start mpc.r_rate=.03     what a controller does, without a search")]
struct Arguments {
    /// car or truck
    kind: String,
    /// Vehicles, built-in names or files [default: all that are built in]
    #[arg(long, value_delimiter = ',')]
    vehicles: Vec<String>,
    /// Drives of the training ensemble
    #[arg(long, default_value_t = 16)]
    scenarios: usize,
    /// Drives of the held-out ensemble
    #[arg(long, default_value_t = 24)]
    held_out: usize,
    /// Candidates
    #[arg(long, default_value_t = 150)]
    budget: usize,
    /// A start, NAME=VALUE,NAME=VALUE..; may be given more than once; the default controller is always one
    #[arg(long = "start")]
    starts: Vec<String>,
    /// What is searched [default: the weights and the horizon]
    #[arg(long, value_delimiter = ',')]
    axes: Vec<String>,
    /// Settings of the controller that are not searched, NAME=VALUE
    #[arg(long = "set")]
    settings: Vec<String>,
    /// First step, in decades of a weight
    #[arg(long, default_value_t = 0.35)]
    step: f64,
    /// Candidates of a generation; 0 for as many as CMA-ES takes
    #[arg(long, default_value_t = 0)]
    population: usize,
    /// Share of the mean in the cost
    #[arg(long, default_value_t = 0.3)]
    mean_share: f64,
    /// Delay margin to be had, s
    #[arg(long, default_value_t = 0.0)]
    delay_margin: f64,
    /// Gain margin to be had, a factor
    #[arg(long, default_value_t = 1.0)]
    gain_margin: f64,
    /// Speeds up to this are looked at for margins, m/s
    #[arg(long, default_value_t = 25.0)]
    margin_speed: f64,
    /// Least and greatest lag, s
    #[arg(long, value_delimiter = ',')]
    lag: Vec<f64>,
    /// Least and greatest dead time, s
    #[arg(long, value_delimiter = ',')]
    dead_time: Vec<f64>,
    /// Lateral accelerations of the speed plan, m/s2
    #[arg(long, value_delimiter = ',')]
    lateral_accel: Vec<f64>,
    /// Factors on the friction
    #[arg(long, value_delimiter = ',')]
    friction: Vec<f64>,
    /// Multiples of typical noise
    #[arg(long, value_delimiter = ',')]
    noise: Vec<f64>,
    /// Length of the random roads, m
    #[arg(long)]
    length: Option<f64>,
    /// Tell the controller the actuator (variant actuator), wrong by up to this share
    #[arg(long)]
    told: Option<f64>,
    /// Seed of the ensemble and of the search
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; 0 for all
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// File for the best candidates (JSON)
    #[arg(long)]
    json: Option<PathBuf>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    match arguments.kind.as_str() {
        "car" => run::<Car, 4, { rfl_mpc::simulate::CAR_COLUMNS }>(&arguments),
        "truck" => run::<Truck, 6, { rfl_mpc::simulate::TRUCK_COLUMNS }>(&arguments),
        other => Err(format!("'{other}': write car or truck").into()),
    }
}

fn values(text: &str) -> Result<ControllerNumbers, Box<dyn Error>> {
    let mut values = ControllerNumbers::default();
    for setting in text.split(',') {
        let (name, value) = setting.split_once('=').ok_or(format!("{setting}: write NAME=VALUE"))?;
        values.0.insert(name.trim().to_owned(), value.trim().parse()?);
    }
    Ok(values)
}

fn run<P: Compared<S, C, Effects: Sync, Nominal: Sync>, const S: usize, const C: usize>(
    arguments: &Arguments,
) -> Result<(), Box<dyn Error>> {
    let names: Vec<String> = match arguments.vehicles.is_empty() {
        true => P::Parameters::BUILTIN.iter().map(|name| (*name).to_owned()).collect(),
        false => arguments.vehicles.clone(),
    };
    let mut vehicles = vec![];
    for name in &names {
        let builtin = P::Parameters::BUILTIN.contains(&name.as_str());
        vehicles.push(match builtin {
            true => P::Parameters::builtin(name)?,
            false => P::Parameters::of_file(name.as_ref())?,
        });
    }
    let mut family = Family::<P, S, C>::around(vehicles);
    let range = |given: &[f64], of: &mut (f64, f64)| {
        if let [low, high] = given {
            *of = (*low, *high);
        }
    };
    range(&arguments.lag, &mut family.actuators.lag);
    range(&arguments.dead_time, &mut family.actuators.dead_time);
    for (given, of) in [
        (&arguments.lateral_accel, &mut family.lateral_accel),
        (&arguments.friction, &mut family.friction),
        (&arguments.noise, &mut family.noise),
    ] {
        if !given.is_empty() {
            of.clone_from(given);
        }
    }
    family.told = arguments.told;
    if let Some(length) = arguments.length {
        family.road.length = length;
    }
    let fixed = match arguments.settings.is_empty() {
        true => ControllerNumbers::default(),
        false => values(&arguments.settings.join(","))?,
    };
    let controller = |vehicle: &P::Parameters| {
        let mut parameters = P::controller(vehicle);
        if let Err(error) = fixed.apply::<P::Nominal, S>(&mut parameters) {
            eprintln!("--set: {error}");
            std::process::exit(1);
        }
        (parameters, PredictionModelFor::Adaptive(parameters.actuator.actuator()))
    };
    let goal = (arguments.delay_margin > 0.0 || arguments.gain_margin > 1.0).then_some(MarginGoal {
        delay: arguments.delay_margin,
        gain: arguments.gain_margin,
        speed: arguments.margin_speed,
    });
    let ensemble = |count, purpose| -> Result<Ensemble<P, S, C>, Box<dyn Error>> {
        Ok(Ensemble {
            scenarios: family.scenarios(count, arguments.seed, purpose, controller)?,
            mean_share: arguments.mean_share,
            goal,
            threads: arguments.threads,
        })
    };
    let training = ensemble(arguments.scenarios, Purpose::Training)?;
    let held_out = ensemble(arguments.held_out, Purpose::HeldOut)?;
    let axes: Vec<Axis> = match arguments.axes.is_empty() {
        true => standard_axes(),
        false => arguments.axes.iter().map(|name| Axis::of(name)).collect(),
    };
    let default = ControllerNumbers::of(&training.scenarios[0].controller, &axes);
    let mut starts = vec![default.clone()];
    for text in &arguments.starts {
        let mut start = default.clone();
        start.0.extend(values(text)?.0);
        starts.push(start);
    }
    let settings = SearchSettings {
        budget: arguments.budget.max(starts.len()),
        starts,
        step: arguments.step,
        population: arguments.population,
        seed: arguments.seed,
    };
    let begin = std::time::Instant::now();
    let mut best = f64::INFINITY;
    let found = search(&training, &axes, &settings, |number, candidate| {
        if candidate.complete && (candidate.cost < best || number <= settings.starts.len()) {
            best = best.min(candidate.cost);
            let time = begin.elapsed().as_secs();
            println!("{number:>4} {time:>5} s  {}", line(candidate));
        }
    })?;
    let mut rows = vec![];
    for candidate in found.iter().take(5) {
        let held_out = held_out.examine(&candidate.values)?;
        println!("training {}\nheld out {}", line(candidate), line(&held_out));
        rows.push(json!({ "training": candidate, "held_out": held_out }));
    }
    if let Some(file) = &arguments.json {
        let names = |of: &Ensemble<P, S, C>| -> Vec<String> {
            of.scenarios.iter().map(|scenario| scenario.name.clone()).collect()
        };
        let value = json!({
            "arguments": std::env::args().skip(1).collect::<Vec<_>>(),
            "training": names(&training), "held_out": names(&held_out), "best": rows,
        });
        std::fs::write(file, serde_json::to_string_pretty(&value)?)?;
    }
    Ok(())
}

fn line(candidate: &TuneCandidate) -> String {
    let values: Vec<String> =
        candidate.values.0.iter().map(|(name, value)| format!("{name}={value:.4}")).collect();
    format!(
        "cost {:.3} (margins {:.3}), lost {} of {}, worst {:.3} m, mean {:.4} m: {}",
        candidate.cost,
        candidate.penalty,
        candidate.lost(),
        candidate.outcomes.len(),
        candidate.worst(),
        candidate.mean(),
        values.join(",")
    )
}
