//! `rfl learn`: the whole ladder on one of our plants: drive, identify, collect, train, prove.
//!
//! ```text
//! drive   the default controller on the training road; knowing what a lost drive shows, then slower, while it is lost
//! identify    dead time and lag from that drive; from here on the controller begins with them
//! collect     calmly, with dither, on the training road and on random ones: bends and speeds to come
//! train       `rfl train`: refused unless better in closed loop on plants that explain the drives
//! prove       default, identified, learned on roads that none was learned on, at full speed
//! ```

mod inputs;

use super::diagnose::steady_steering;
use super::drive::{MODELS, Setup, setting};
use super::logs::LimitArgs;
use super::output::{hold_folder, write_file, write_json};
use super::progress_bar;
use super::vehicle::{Commanded, VehicleLinearModel, by_kind};
use super::{Cli, Command, NOT_BETTER, train};
use crate::control::{
    Choice, ControlVariant, ControlledParameters, ControllerFile, ControllerParametersFor,
    PredictionModelFor, Propagation, RollOut,
};
use crate::log::{DriveLog, drives_of};
use crate::nominal::Actuator;
use crate::path::{Path, RandomRoad};
use crate::residual::{DataSet, ShownActuator};
use crate::simulate::{CAR_COLUMNS, DriveFor, Outcome, STATION};
use crate::vehicle::{BUILTIN, VehicleParameters as _};
use clap::{Args, Parser};
use inputs::{check_outputs, check_road};
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

/// Learns a vehicle in one go: drives, identifies the steering, collects, trains, and proves it on roads it has not seen
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl learn                                                       the C-class car, to out/learn
  rfl learn --set effect.steer_lag=0.1 --set effect.steer_delay=0.06
  rfl learn --vehicle my_car.toml --path my_road.csv --out out/my_car
  rfl learn --vehicle truck_simulation
  rfl drive --controller out/learn/controller.toml --residual out/learn/model.rflm      drive with what was learned

Written: drive.csv and collect_N.csv (logs), controller.toml (identified steering), model.rflm (only if it is better), train.json,
learn.json. A vehicle of your own, not simulated here: docs/learning.md.

Exit status: 0 done, 1 bad input or a failure, 2 wrong usage, 3 nothing drives better than the default controller.")]
pub struct LearnArgs {
    /// Car or truck: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = BUILTIN[0])]
    vehicle: String,
    /// A parameter, NAME=VALUE, of whoever has it, as for `rfl drive`
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    /// Road to learn on: a CSV file with columns x, y [default: the vehicle's training route]
    #[arg(long)]
    path: Option<PathBuf>,
    /// Road to prove on [default: the vehicle's test route]
    #[arg(long, value_name = "FILE")]
    test: Option<PathBuf>,
    #[command(flatten)]
    limit: LimitArgs,
    /// Random roads to collect on beside it
    #[arg(long, default_value_t = 6)]
    roads: usize,
    /// Kind of model to learn
    #[arg(long, default_value = "rfl_s")]
    kind: String,
    /// Seed of roads, dither and training
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; 0 for all there are. The result does not depend on it
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Folder for logs, model, controller file and report
    #[arg(long, value_name = "DIR", default_value = "out/learn")]
    out: PathBuf,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// First seed of the random roads to collect on, and of those to prove on: no other command's.
const COLLECT_SEED: u64 = 55_000_000;
const PROVE_SEED: u64 = 56_000_000;
/// Random roads to prove on.
const PROVE_ROADS: usize = 2;
/// Speed and lateral acceleration of the next try, as shares, after a vehicle was lost; and such tries.
const SLOWER: (f64, f64) = (0.7, 0.5);
const TRIES: usize = 4;
/// Time after which a drive is given up, s.
const LONGEST: f64 = 1800.0;

/// Runs the command.
///
/// # Errors
/// The fault, its place, and advice.
pub fn run(args: &LearnArgs) -> Result<u8, Box<dyn Error>> {
    by_kind!(&args.vehicle, learn(args))
}

/// Roads by name.
type NamedRoads = Vec<(String, Arc<Path>)>;

/// The controller of the first drive, and the steering that it has shown.
type FirstDrive<G> = (ControllerParametersFor<G>, Option<ShownActuator>);

struct Ladder<'a, P: Commanded<S, C>, const S: usize, const C: usize> {
    args: &'a LearnArgs,
    vehicle: P::Parameters,
    effects: P::Effects,
    controller: ControllerParametersFor<P::Nominal>,
}

fn learn<P: Commanded<S, C>, const S: usize, const C: usize>(args: &LearnArgs) -> Result<u8, Box<dyn Error>> {
    let reading = args.limit.road();
    let setup = Setup::<P, S, C>::new(
        args.path.as_deref(),
        &reading,
        P::SETTING.training,
        &args.vehicle,
        &args.settings,
    )?;
    check_road(args, &setup.path)?;
    let mut training: NamedRoads = vec![("training road".to_owned(), setup.path.clone())];
    let test = Setup::<P, S, C>::new(args.test.as_deref(), &reading, P::TEST, &args.vehicle, &args.settings)?;
    let mut proving: NamedRoads = vec![("test road".to_owned(), test.path)];
    let road = if P::SIGNALS.len() > CAR_COLUMNS { RandomRoad::TRUCK } else { RandomRoad::CAR };
    let random = |first: u64, number: usize| -> Result<(String, Arc<Path>), Box<dyn Error>> {
        let seed = first + 1000 * args.seed + number as u64;
        let road = RandomRoad { closed: number % 3 == 2, ..road };
        Ok((format!("random road {seed}"), Arc::new(road.path(seed)?)))
    };
    for number in 0..args.roads {
        training.push(random(COLLECT_SEED, number)?);
    }
    for number in 0..PROVE_ROADS {
        proving.push(random(PROVE_SEED, number)?);
    }
    check_outputs(args)?;
    let _held = hold_folder(&args.out)?;
    let Setup { controller, vehicle, effects, .. } = setup;
    Ladder::<P, S, C> { args, vehicle, effects, controller }.climb(&training, &proving)
}

impl<P: Commanded<S, C>, const S: usize, const C: usize> Ladder<'_, P, S, C> {
    fn climb(&self, training: &NamedRoads, proving: &NamedRoads) -> Result<u8, Box<dyn Error>> {
        let model = self.file("model.rflm");
        // An older model would be taken for this one.
        match std::fs::remove_file(&model) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error.into()),
            _ => {}
        }
        let (slow, shown) = self.first_drive(&training[0])?;
        let identified = self.identify(shown)?;
        let logs = self.collect(training, ControllerParametersFor { speed: slow.speed, ..identified })?;
        let refused = self
            .train(&logs, &model, &self.file("train.json"))
            .unwrap_or_else(|failure| Some(failure.to_string()));
        match &refused {
            None => say!("4 train: {}", model.display()),
            Some(reason) => say!("4 train: {reason}"),
        }
        let (best, rows) = self.prove(proving, &identified, refused.is_none().then_some(&model))?;
        let report: Value = json!({
            "recommended": best,
            "vehicle": self.args.vehicle,
            "settings": self.args.settings,
            "speed_of_collecting": { "limit": slow.speed.limit, "lateral_accel": slow.speed.lateral_accel },
            "steering": shown.map(|shown| json!({
                "dead_time": shown.prior.actuator.dead_time, "lag": shown.prior.actuator.time_constant,
                "backlash": shown.backlash,
                "sum_spread": shown.spread,
            })),
            "model": refused.is_none().then(|| model.display().to_string()),
            "refused": refused,
            "proof": rows,
        });
        write_json(&self.file("learn.json"), &report)?;
        self.say_next(best, refused.is_none().then_some(&model));
        Ok(if best == "default" { NOT_BETTER } else { 0 })
    }

    /// A file of the folder for results.
    fn file(&self, name: &str) -> PathBuf {
        self.args.out.join(name)
    }

    /// The controller with which the first drive stays on the road, as fast as it does, and the steering that was shown.
    ///
    /// A lost drive shows the steering, too: as fast again, knowing it, before slower.
    fn first_drive(&self, road: &(String, Arc<Path>)) -> Result<FirstDrive<P::Nominal>, Box<dyn Error>> {
        let mut slow = self.controller;
        let mut first = None;
        let mut told = None;
        for attempt in 0..=TRIES {
            let drive = self.drive(&slow, self.default(&slow)?, road, "driving")?;
            let lost = drive.lost;
            say!("1 drive: {}", said(&drive));
            let shown = if told.is_none() { self.shown(&drive) } else { None };
            first = Some(drive);
            if !lost || attempt == TRIES {
                break;
            }
            if let Some(shown) = shown {
                let Actuator { dead_time, time_constant, .. } = shown.prior.actuator;
                say!(
                    "  it shows a dead time of {dead_time:.3} s and a lag of {time_constant:.3} s: again, knowing them"
                );
                (slow.actuator.dead_time, slow.actuator.time_constant) = (dead_time, time_constant);
                told = Some(shown);
                continue;
            }
            slow.speed.limit *= SLOWER.0;
            slow.speed.lateral_accel *= SLOWER.1;
            say!("  slower: up to {:.1} m/s, {:.2} m/s2", slow.speed.limit, slow.speed.lateral_accel);
        }
        let first = first.ok_or("no drive was made")?;
        let log = self.file("drive.csv");
        write_file(&log, |to| Ok(first.write_csv(to)?))?;
        if first.lost {
            return Err(
                format!("the vehicle is lost however slowly it drives; look at {}", log.display()).into()
            );
        }
        Ok((slow, self.shown(&first).or(told)))
    }

    /// The default controller with the steering that was shown, which is written to a controller file.
    fn identify(
        &self,
        shown: Option<ShownActuator>,
    ) -> Result<ControllerParametersFor<P::Nominal>, Box<dyn Error>> {
        let mut values = vec![];
        if let Some(shown) = shown {
            let Actuator { dead_time, time_constant, .. } = shown.prior.actuator;
            values = vec![
                ("actuator.dead_time".to_owned(), dead_time),
                ("actuator.time_constant".to_owned(), time_constant),
            ];
            let mut gap = String::new();
            if shown.backlash > 0.0 {
                values.push(("actuator.backlash".to_owned(), shown.backlash));
                gap = format!(", backlash {:.4} rad", shown.backlash);
            }
            say!("2 identify: dead time {dead_time:.3} s, lag {time_constant:.3} s{gap}");
        } else {
            say!("2 identify: the drive does not show the steering's dead time and lag; the file's are kept");
        }
        let content = ControllerFile {
            kind: P::KIND.to_owned(),
            vehicle: self.vehicle.name().to_owned(),
            variant: None,
            values,
        };
        let head = "The steering as rfl learn found it: what the controller begins with.";
        let file = self.file("controller.toml");
        write_file(&file, |to| Ok(to.write_all(content.to_text(head).as_bytes())?))?;
        let mut identified = self.controller;
        content.apply(&mut identified, &file)?;
        Ok(identified)
    }

    /// The logs to learn from: the first drive, if it steers, and one of each road that is not lost.
    fn collect(
        &self,
        roads: &NamedRoads,
        mut controller: ControllerParametersFor<P::Nominal>,
    ) -> Result<Vec<PathBuf>, Box<dyn Error>> {
        let mut logs = vec![];
        let first = self.file("drive.csv");
        match self.check_log(&first) {
            Ok(()) => logs.push(first),
            // On a straight road nobody steers without dither.
            Err(reason) => say!("3 collect: the first drive is left out: {reason}"),
        }
        for (number, road) in roads.iter().enumerate() {
            // Calm throughout, as rfl collect.
            controller.mpc.tightening = 1.0;
            controller.mpc.dither = P::SETTING.dither;
            controller.mpc.dither_seed =
                (self.args.seed as usize).wrapping_mul(100).wrapping_add(number) % 1_000_000;
            let drive = self.drive(&controller, self.default(&controller)?, road, "collecting")?;
            let log = self.file(&format!("collect_{}.csv", number + 1));
            write_file(&log, |to| Ok(drive.write_csv(to)?))?;
            say!("3 collect: {}: {}", road.0, said(&drive));
            if !drive.lost {
                logs.push(log);
            }
        }
        Ok(logs)
    }

    /// Checks that a log can be learned from.
    fn check_log(&self, file: &std::path::Path) -> Result<(), Box<dyn Error>> {
        let vehicle = self.controller.vehicle.nominal();
        let steering = |speed: f64| steady_steering(&vehicle, speed);
        drives_of(&DriveLog::read(file)?, None, &steering, &mut |_| {})?;
        Ok(())
    }

    /// The best controller on roads not learned on, at full speed, and a row of the report for each drive.
    fn prove(
        &self,
        roads: &NamedRoads,
        identified: &ControllerParametersFor<P::Nominal>,
        model: Option<&PathBuf>,
    ) -> Result<(&'static str, Vec<Value>), Box<dyn Error>> {
        let mut rows = vec![];
        let names = ["default", "identified", "learned"];
        let count = if model.is_some() { 3 } else { 2 };
        let mut scores: Vec<Score> =
            names[..count].iter().map(|&name| Score { name, failed: 0, sum: 0.0 }).collect();
        say!("{:<24} {:<11} {:>9} {:>9}  outcome", "5 prove", "", "mean mm", "max mm");
        for road in roads {
            for score in &mut scores {
                let name = score.name;
                let controller = if name == "default" { &self.controller } else { identified };
                let file = model.filter(|_| name == "learned").cloned();
                let drive = self.drive(controller, self.choose(controller, file)?, road, "proving")?;
                let (tracking, outcome) = (drive.tracking(), drive.ending.outcome);
                score.failed += usize::from(outcome != Outcome::Completed);
                score.sum += tracking.mae;
                say!(
                    "{:<24} {name:<11} {:>9.2} {:>9.1}  {}",
                    road.0,
                    1e3 * tracking.mae,
                    1e3 * tracking.max,
                    outcome.name()
                );
                rows.push(json!({
                    "road": road.0, "controller": name, "mean": tracking.mae, "max": tracking.max,
                    "outcome": outcome.name(),
                }));
            }
        }
        let best = scores
            .iter()
            .min_by(|a, b| a.order().total_cmp(&b.order()))
            .map_or("default", |score| score.name);
        Ok((best, rows))
    }

    /// Says what comes next with the best controller; `model` is the learned one, if there is one.
    fn say_next(&self, best: &str, model: Option<&PathBuf>) {
        let vehicle = &self.args.vehicle;
        let controller = self.file("controller.toml");
        let controller = controller.display();
        // What was set is of the vehicle that was learned, and of no file.
        let set: String = self.args.settings.iter().map(|text| format!(" --set {text}")).collect();
        match (best, model) {
            ("default", _) => {
                say!(
                    "nothing of it drives better than the default controller: rfl drive --vehicle {vehicle}{set}"
                );
            }
            ("learned", Some(model)) => say!(
                "next: rfl drive --vehicle {vehicle}{set} --controller {controller} --residual {}",
                model.display()
            ),
            _ => {
                if model.is_some() {
                    say!("the learned model drives no better than the identified steering alone");
                }
                say!("next: rfl drive --vehicle {vehicle}{set} --controller {controller}");
            }
        }
    }

    /// The steering actuator, as far as a drive shows it.
    fn shown(&self, drive: &DriveFor<C>) -> Option<ShownActuator> {
        let (vehicle, config) = (self.controller.vehicle.nominal(), self.controller.data_config());
        // A drive that is too short to learn from shows nothing.
        let data = DataSet::<VehicleLinearModel<P, S, C>, S>::new(&[drive.to_learn_from()], &vehicle, config)
            .ok()?;
        let angles = [drive.to_identify_from()];
        train::shown_by(&angles, &data, self.args.threads).filter(ShownActuator::is_shown)
    }

    /// Prediction model of the default controller.
    fn default(
        &self,
        controller: &ControllerParametersFor<P::Nominal>,
    ) -> Result<PredictionModelFor<VehicleLinearModel<P, S, C>, S>, Box<dyn Error>> {
        self.choose(controller, None)
    }

    fn choose(
        &self,
        controller: &ControllerParametersFor<P::Nominal>,
        file: Option<PathBuf>,
    ) -> Result<PredictionModelFor<VehicleLinearModel<P, S, C>, S>, Box<dyn Error>> {
        let choice = Choice {
            variant: ControlVariant::Adaptive,
            file,
            folder: MODELS.into(),
            propagation: Propagation::Propagated,
            roll_out: RollOut::Corrected,
        };
        Ok(choice.prediction_model(controller)?.1)
    }

    fn drive(
        &self,
        controller: &ControllerParametersFor<P::Nominal>,
        predicts_with: PredictionModelFor<VehicleLinearModel<P, S, C>, S>,
        (_, path): &(String, Arc<Path>),
        what: &str,
    ) -> Result<DriveFor<C>, Box<dyn Error>> {
        let setup = Setup::<P, S, C> {
            path: path.clone(),
            controller: *controller,
            vehicle: self.vehicle.clone(),
            effects: self.effects.clone(),
        };
        let bar = progress_bar(what, path.length(), self.args.quiet);
        let mut closed = setup.connect(predicts_with, controller.mpc.sample_time)?;
        let drive = closed.record(LONGEST, |row, _| {
            bar.set_position(row[STATION].max(0.0) as u64);
            true
        });
        bar.finish_and_clear();
        Ok(drive)
    }

    /// `rfl train` on these logs; the reason if it writes no model.
    fn train(
        &self,
        logs: &[PathBuf],
        model: &std::path::Path,
        report: &std::path::Path,
    ) -> Result<Option<String>, Box<dyn Error>> {
        if logs.is_empty() {
            return Ok(Some("no drive is left to learn from".to_owned()));
        }
        let args = self.args;
        let text = |path: &std::path::Path| path.to_string_lossy().into_owned();
        let mut words = vec!["rfl".to_owned(), "train".to_owned()];
        words.extend(logs.iter().map(|log| text(log)));
        let options = [
            ("--vehicle", args.vehicle.clone()),
            ("--kind", args.kind.clone()),
            ("--seed", args.seed.to_string()),
            ("--threads", args.threads.to_string()),
            ("--out", text(model)),
            ("--json", text(report)),
        ];
        words.extend(options.into_iter().flat_map(|(name, value)| [name.to_owned(), value]));
        for of in &args.settings {
            let (name, _) = setting(of)?;
            let name = name.strip_prefix("controller.").unwrap_or(name);
            if ControllerParametersFor::<P::Nominal>::declared(name).is_some() {
                words.extend(["--set".to_owned(), of.clone()]);
            }
        }
        if args.quiet {
            words.push("--quiet".to_owned());
        }
        match Cli::try_parse_from(words)?.command {
            Command::Train(args) => Ok(train::trained(&args)?.refused),
            _ => Ok(None),
        }
    }
}

/// Score of a controller on the roads of the proof.
struct Score {
    name: &'static str,
    /// Drives that did not reach the end.
    failed: usize,
    /// Of the mean errors, m.
    sum: f64,
}

impl Score {
    /// Order of scores, less is better: arrival counts first.
    fn order(&self) -> f64 {
        1e6 * self.failed as f64 + self.sum
    }
}

/// A drive in a line.
fn said<const C: usize>(drive: &DriveFor<C>) -> String {
    let tracking = drive.tracking();
    let outcome: Outcome = drive.ending.outcome;
    format!(
        "{:.0} s, lateral error mean {:.2} mm, max {:.1} mm; {}",
        drive.duration(),
        1e3 * tracking.mae,
        1e3 * tracking.max,
        outcome.name()
    )
}
