//! `rfl tune`: weights and horizon for one vehicle, searched over a family of vehicles around it.

use super::drive::{ModelArgs, Setup};
use super::logs::LimitArgs;
use super::output::{hold_folder, write_json, write_text};
use super::progress_bar;
use super::vehicle::{Commanded, by_kind};
use crate::control::{ControlVariant, ControllerFile, Margins};
use crate::diagnose::page::{Answer, AtSpeed, Tuned, tuning_page};
use crate::path::{Closure, Path, PathOptions, Sample, Smoothing};
use crate::simulate::tune::{
    Actuators, Controlled, ControllerNumbers, Ensemble, Family, MarginGoal, Purpose, SPEEDS, Scenario,
    SearchSettings, TuneCandidate, answer_to_offset, margins_over_speeds, number_of, search, standard_axes,
};
use crate::vehicle::{BUILTIN, TruckEffects, VehicleParameters as _};
use clap::Args;
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

/// Tunes the controller for a vehicle: weights and horizon that stand a family of vehicles around it
#[derive(Debug, Args)]
#[command(
    after_help = "The family: stiffness of each axle 0.8 to 1.1, payload, friction 1 and 0.8, noise, and the vehicle's own steering (lag and
dead time of its file) 0.7 to 1.3 of what the file says. The cost is the worst drive's error and a share of the mean, and what
the wanted margins miss. What is found is written only if it is better than the default controller on other roads and
vehicles of the family; else nothing is written, and that is said.

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
/// Factors on stiffness and on the own steering, and on the friction.
const STIFFNESS: (f64, f64) = (0.8, 1.1);
const OWN_STEERING: (f64, f64) = (0.7, 1.3);
const FRICTION: [f64; 3] = [1.0, 1.0, 0.8];
/// Share of the mean in the cost.
const MEAN_SHARE: f64 = 0.3;
/// First step of the search, decades of a weight.
const STEP: f64 = 0.35;
/// Highest speed at which margins are asked for, m/s.
const FASTEST: f64 = 24.0;
/// Pieces of a long road, m.
const PIECE: f64 = 500.0;
/// Pieces of a road at most, half for training and half held out.
const PIECES: usize = 8;
/// Speeds at which the answer to an offset is shown, m/s.
const SHOWN_SPEEDS: [f64; 3] = [5.0, 12.0, 22.0];

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
    by_kind!(&args.vehicle, tune(args))
}

/// Data of the command.
struct TuneData<'a, P: Commanded<S, C>, const S: usize, const C: usize> {
    args: &'a TuneArgs,
    vehicle: P::Parameters,
    controlled: Controlled<P, S, C>,
    family: Family<P, S, C>,
    /// Roads held out, if a road is given.
    other_roads: Vec<Arc<Path>>,
    variant: ControlVariant,
}

fn tune<P, const S: usize, const C: usize>(args: &TuneArgs) -> Result<Value, Box<dyn Error>>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    let _held = hold_folder(&args.out)?;
    let tuning = TuneData::<P, S, C>::new(args)?;
    let training = tuning.ensemble(args.scenarios, Purpose::Training, args.seed)?;
    let default = ControllerNumbers::of(&tuning.controlled.0, &standard_axes());
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
        tuning.vehicle.name(),
        args.budget,
        args.scenarios,
        2 * args.held_out
    );
    let bar = progress_bar("tuning", args.budget as f64, args.quiet);
    let mut trace = vec![];
    let found = search(&training, &standard_axes(), &settings, |number, candidate| {
        bar.set_position(number as u64);
        trace.push((candidate.complete, candidate.cost));
    })?;
    bar.finish_and_clear();
    // The default is the first start, so that it was driven to its end.
    let of_default = found.iter().find(|candidate| candidate.values == default);
    let validation = tuning.ensemble(args.scenarios, Purpose::Training, args.seed + VALIDATION)?;
    let mut best: Option<(f64, &TuneCandidate)> = None;
    for candidate in found.iter().take(SHORTLIST) {
        let cost = validation.examine(&candidate.values)?.cost;
        if best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, candidate));
        }
    }
    let (Some(of_default), Some((_, best))) = (of_default, best) else {
        return Err("no candidate was driven to its end; give --budget more".into());
    };
    let held_out = tuning.ensemble(args.held_out, Purpose::HeldOut, args.seed)?;
    let examined = [&default, &best.values].map(|values| held_out.examine(values));
    let [default_held_out, best_held_out] = examined;
    let (default_held_out, best_held_out) = (default_held_out?, best_held_out?);
    let better = best.values != default
        && best_held_out.cost < default_held_out.cost
        && best_held_out.lost() <= default_held_out.lost();

    let sets = [[of_default, best], [&default_held_out, &best_held_out]];
    let margins = [tuning.margins(&default)?, tuning.margins(&best.values)?];
    let answers = tuning.answers([&default, &best.values])?;
    print(&tuning, sets, &margins);
    let file = args.out.join("controller.toml");
    let words = if better {
        format!(
            "written to {}: rfl drive --vehicle {} --controller {}",
            file.display(),
            args.vehicle,
            file.display()
        )
    } else {
        "nothing is written: what was found is no better than the default controller on other roads and vehicles; \
         keep the default, or search longer (--budget)"
            .to_owned()
    };
    say!("{words}");
    let io = |file: &std::path::Path, error: std::io::Error| format!("{}: {error}", file.display());
    let content = tuning.file(&best.values);
    if better {
        let head = tuning.head(sets[1]);
        write_text(&file, &content.to_text(&head))?;
    } else {
        // An older one would be taken for this one.
        match std::fs::remove_file(&file) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(io(&file, error).into()),
            _ => (),
        }
    }
    let names = |ensemble: &Ensemble<P, S, C>| -> Vec<String> {
        ensemble.scenarios.iter().map(|scenario| scenario.name.clone()).collect()
    };
    let shown_margins = |margins: &[AtSpeed]| -> Vec<Value> {
        let one = |(speed, margins): &AtSpeed| match margins {
            Some(m) => {
                json!({ "speed": speed, "stable": true, "gain": finite(m.gain), "phase": finite(m.phase),
                "delay": finite(m.delay), "sensitivity": m.sensitivity })
            }
            None => json!({ "speed": speed, "stable": false }),
        };
        margins.iter().map(one).collect()
    };
    let value = json!({
        "vehicle": tuning.vehicle.name(), "kind": P::KIND, "variant": tuning.variant.name(), "seed": args.seed,
        "budget": args.budget, "written": better, "controller": content.values.iter().cloned().collect::<std::collections::BTreeMap<_, _>>(),
        "default": { "values": default, "training": of_default, "held_out": default_held_out, "margins": shown_margins(&margins[0]) },
        "tuned": { "values": best.values, "training": best, "held_out": best_held_out, "margins": shown_margins(&margins[1]) },
        "scenarios": { "training": names(&training), "held_out": names(&held_out) },
    });
    let json_file = args.out.join("tune.json");
    write_json(&json_file, &value)?;
    let page = tuning_page(&Tuned {
        vehicle: tuning.vehicle.name(),
        variant: tuning.variant.name(),
        words: &words,
        better,
        sets: [("training", names(&training), sets[0]), ("held out", names(&held_out), sets[1])],
        margins: &margins,
        goal: (args.delay_margin, args.gain_margin),
        answers: &answers,
        trace: &trace,
    });
    let page_file = args.out.join("tune.html");
    write_text(&page_file, &page)?;
    say!("page: {}; figures: {}", page_file.display(), json_file.display());
    Ok(value)
}

impl<'a, P, const S: usize, const C: usize> TuneData<'a, P, S, C>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    fn new(args: &'a TuneArgs) -> Result<Self, Box<dyn Error>> {
        let setup = Setup::<P, S, C>::new(
            args.path.as_deref(),
            &args.limit.road(),
            P::TEST,
            &args.vehicle,
            &args.settings,
        )?;
        let (variant, model) = args.model.choose(&setup.controller)?;
        let mut roads = match &args.path {
            Some(_) => pieces(&setup.path)?,
            None => vec![],
        };
        // Every second one is held out; a short road is both, with other vehicles.
        let other_roads = match roads.len() {
            0 | 1 => roads.clone(),
            _ => roads.iter().skip(1).step_by(2).cloned().collect(),
        };
        roads = roads.into_iter().step_by(2).collect();
        let family = Family {
            stiffness: STIFFNESS,
            friction: FRICTION.into(),
            actuators: Actuators { lag: (0.0, 0.0), dead_time: (0.0, 0.0), own: OWN_STEERING },
            lateral_accel: vec![setup.controller.speed.lateral_accel],
            roads,
            ..Family::around(vec![setup.vehicle.clone()])
        };
        // Effects that were set are the vehicle's here; what they add to its steering is known of it.
        let mut vehicle = setup.vehicle;
        let mut effects = setup.effects;
        for effect in TruckEffects::all() {
            let Some(set) = P::effect(&mut effects, effect.id).map(|value| *value) else { continue };
            let Some(own) = vehicle.effect_mut(effect.id) else { continue };
            let more = set - *own;
            let steering = match effect.id {
                "steer_lag" => "steering.lag",
                "steer_delay" => "steering.dead_time",
                _ => {
                    *own = set;
                    continue;
                }
            };
            if let Some(parameter) = P::Parameters::TABLE.iter().find(|parameter| parameter.name == steering)
            {
                let value = parameter.get(&vehicle) + more;
                parameter.set(&mut vehicle, value);
            }
        }
        let family = Family { vehicles: vec![vehicle.clone()], ..family };
        Ok(Self { args, vehicle, controlled: (setup.controller, model), family, other_roads, variant })
    }

    fn ensemble(
        &self,
        count: usize,
        purpose: Purpose,
        seed: u64,
    ) -> Result<Ensemble<P, S, C>, Box<dyn Error>> {
        let mut scenarios = self.family.scenarios(count, seed, purpose, |_| self.controlled.clone())?;
        if purpose == Purpose::HeldOut && !self.other_roads.is_empty() {
            for (number, scenario) in scenarios.iter_mut().enumerate() {
                scenario.path = self.other_roads[number % self.other_roads.len()].clone();
            }
        }
        let goal = MarginGoal { delay: self.args.delay_margin, gain: self.args.gain_margin, speed: FASTEST };
        Ok(Ensemble { scenarios, mean_share: MEAN_SHARE, goal: Some(goal), threads: self.args.threads })
    }

    /// The vehicle as its file has it.
    fn nominal(&self) -> Result<Scenario<P, S, C>, Box<dyn Error>> {
        let exact = Actuators { own: (1.0, 1.0), ..self.family.actuators };
        let family = Family {
            vehicles: vec![self.vehicle.clone()],
            stiffness: (1.0, 1.0),
            payloads: vec![0.0],
            friction: vec![1.0],
            actuators: exact,
            lateral_accel: self.family.lateral_accel.clone(),
            noise: vec![0.0],
            roads: vec![],
            road: self.family.road,
            told: None,
        };
        let mut scenarios = family.scenarios(1, 0, Purpose::Training, |_| self.controlled.clone())?;
        Ok(scenarios.remove(0))
    }

    fn margins(&self, values: &ControllerNumbers) -> Result<Vec<AtSpeed>, Box<dyn Error>> {
        let scenario = self.nominal()?;
        let found = margins_over_speeds(&scenario, values, &SPEEDS)?;
        Ok(SPEEDS.into_iter().zip(found.into_iter().map(|(_, margins)| margins)).collect())
    }

    fn answers(&self, values: [&ControllerNumbers; 2]) -> Result<Vec<Answer>, Box<dyn Error>> {
        let scenario = self.nominal()?;
        let limit = self.controlled.0.speed.limit;
        let speeds = SHOWN_SPEEDS.into_iter().filter(|speed| *speed <= limit);
        speeds
            .map(|speed| {
                let [before, after] = values.map(|values| answer_to_offset(&scenario, values, speed));
                Ok(Answer { speed, curves: [before?, after?] })
            })
            .collect()
    }

    /// The controller's file: what was searched, what was set beside, what it predicts with.
    fn file(&self, values: &ControllerNumbers) -> ControllerFile {
        let mut all: Vec<(String, f64)> = values.0.clone().into_iter().collect();
        for text in &self.args.settings {
            let Some((name, _)) = text.split_once('=') else { continue };
            let name = name.trim();
            let name = name.strip_prefix("controller.").unwrap_or(name);
            if all.iter().any(|(known, _)| known == name) {
                continue;
            }
            if let Some(value) = number_of(&self.controlled.0, name) {
                all.push((name.to_owned(), value));
            }
        }
        ControllerFile {
            kind: P::KIND.to_owned(),
            vehicle: self.vehicle.name().to_owned(),
            variant: (self.variant != ControlVariant::None).then_some(self.variant),
            values: all,
        }
    }

    /// The comment above the file.
    fn head(&self, [default, tuned]: [&TuneCandidate; 2]) -> String {
        format!(
            "Tuned by rfl tune, seed {}, {} candidates. On {} drives that it was not tuned on: lost {} (default {}),\n\
             largest error {:.3} m ({:.3} m), mean {:.4} m ({:.4} m).",
            self.args.seed,
            self.args.budget,
            tuned.outcomes.len(),
            tuned.lost(),
            default.lost(),
            tuned.worst(),
            default.worst(),
            tuned.mean(),
            default.mean()
        )
    }
}

/// Pieces of a road, evenly spread; all of it where it is short.
fn pieces(road: &Arc<Path>) -> Result<Vec<Arc<Path>>, Box<dyn Error>> {
    let length = road.length();
    if length < 3.0 * PIECE {
        return Ok(vec![road.clone()]);
    }
    let count = ((length / PIECE) as usize).min(PIECES);
    let begin = |piece: usize| length * piece as f64 / count as f64;
    let sample = |station: f64| {
        let at = road.at(station);
        Sample { yaw: Some(at.yaw), friction: Some(at.friction), ..Sample::at(at.x, at.y) }
    };
    let piece = |number: usize| {
        let samples = (0..=PIECE as usize).map(|i| sample(begin(number) + i as f64)).collect();
        let options =
            PathOptions { closure: Closure::Open, smoothing: Smoothing::None, ..PathOptions::default() };
        Ok(Arc::new(Path::from_samples_with(samples, &options)?))
    };
    (0..count).map(piece).collect()
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn print<P: Commanded<S, C>, const S: usize, const C: usize>(
    tuning: &TuneData<'_, P, S, C>,
    sets: [[&TuneCandidate; 2]; 2],
    margins: &[Vec<AtSpeed>; 2],
) {
    say!("{:<28} {:>9} {:>9} {:>9} {:>9}", "", "cost m", "lost", "max m", "mean m");
    for (name, set) in ["training", "held out"].into_iter().zip(sets) {
        for (who, candidate) in ["default", "tuned"].into_iter().zip(set) {
            say!(
                "{:<28} {:>9.3} {:>9} {:>9.3} {:>9.4}",
                format!("{name}, {who}"),
                candidate.cost,
                format!("{}/{}", candidate.lost(), candidate.outcomes.len()),
                candidate.worst(),
                candidate.mean()
            );
        }
    }
    say!("{:<28} {:>9} {:>9} {:>9} {:>9}", "margins", "gain", "", "delay s", "");
    say!("{:<28} {:>9} {:>9} {:>9} {:>9}", "  at m/s", "default", "tuned", "default", "tuned");
    let text = |margins: &Option<Margins>, of: fn(&Margins) -> f64| match margins {
        Some(margins) if of(margins).is_finite() => format!("{:.3}", of(margins)),
        Some(_) => "any".to_owned(),
        None => "unstable".to_owned(),
    };
    for ((speed, before), (_, after)) in margins[0].iter().zip(&margins[1]) {
        let [gain, delay] = [(|m| m.gain) as fn(&Margins) -> f64, |m| m.delay];
        say!(
            "{:<28} {:>9} {:>9} {:>9} {:>9}",
            format!("  {speed}"),
            text(before, gain),
            text(after, gain),
            text(before, delay),
            text(after, delay)
        );
    }
    let tuned = &sets[0][1].values;
    say!("tuned for {}: {}", tuning.vehicle.name(), tuned.settings().join(" "));
}
