//! `rfl diagnose`: the differences between a log and a simulator, and the reduction of the gap.
//!
//! | file | problem |
//! |---|---|
//! | `terminal.rs` | the answer on a terminal |
//! | `explain.rs` | effects in words |

mod explain;
mod terminal;

use super::files::{check_folder, given};
use super::logs::{LogArgs, ReadsLogs};
use super::output::{hold_folder, write_text};
use super::progress_bar;
use super::vehicle::{Commanded, by_kind, controller_with, vehicle_named};
use crate::control::{Choice, ControlVariant, ControlledParameters as _, Propagation, RollOut};
use crate::diagnose::beliefs::{Beliefs, Trust};
use crate::diagnose::closed_loop::{self, LateralErrorProfile};
use crate::diagnose::page::{PageInput, page};
use crate::diagnose::replay::ReplayVehicle;
use crate::diagnose::simulator::{
    CalibrationExtent, calibrated, changes, differences, parameter_set, write_vehicle,
};
use crate::diagnose::{Gap, InputFile, Options, Report, VerdictKind, diagnose};
use crate::log::{CleanLog, DriveLog, Finding, FindingSeverity};
use crate::nominal::LateralVehicle;
use crate::path::Path as Road;
use crate::vehicle::{BUILTIN, BUILTIN_TRUCKS, VehicleKind, VehicleParameters};
use clap::Args;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Diagnoses the gap between a log and a simulator: where it lies, which unmodelled effect causes it, how far it shrinks.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl diagnose drive.csv                                     a log of the C-class car
  rfl diagnose real.csv.gz --vehicle my_car.toml
  rfl diagnose june.csv --reference march.csv --vehicle my_car.toml     what changed since
  rfl diagnose drive.csv sweep.csv --vehicle my_car.toml     both drives together: what the next manoeuvre adds
  rfl diagnose drive.csv --path road.csv                     with the loop closed: what the gap does to tracking
  rfl diagnose truck.csv --unit truck
  rfl diagnose drive.csv --rate 100                          no time column: 100 rows a second
  rfl diagnose drive.csv --trust low --prior payload=0.3     a catalogue's numbers; a load is likely
  rfl diagnose --explain                                     all effects; --explain steer_delay: one

A log is a CSV with time, steer_cmd (or steer), vx, yaw_rate, and as many of ay, vy, x, y, yaw, ax, accel_cmd, steer, roll,
articulation as there are. SI units, radians, to the left positive. scripts/import_log.py brings in MF4, Parquet, MATLAB
and ROS bags.

Written to --out: report.html, report.json, and the calibrated simulator: calibrated.toml (rfl drive --vehicle),
calibrated.ssv (SSP 1.0 parameters of the vehicle's FMU), system.ssv (the same, for the SSP of vehicle and controller).

The first line and the exit status are the verdict: 0 none, 3 effect, 4 not_in_library, 5 cannot_tell; 1 bad input or a
failure, 2 wrong usage.")]
pub struct DiagnoseArgs {
    /// Drive log (CSV, .csv.gz); several of one vehicle, on one day, are diagnosed together
    #[arg(required_unless_present = "explain", value_name = "LOG")]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    reading: LogArgs,
    /// Log of the same vehicle when it was as modelled
    #[arg(long, value_name = "LOG")]
    reference: Option<PathBuf>,
    /// The simulator's vehicle: a vehicle file (TOML) or a built-in name [default: c_class; of a truck truck_simulation]
    #[arg(long)]
    vehicle: Option<String>,
    /// Kind of vehicle [default: that of --vehicle; without, a truck if the log has an articulation angle]
    #[arg(long)]
    unit: Option<VehicleKind>,
    /// Path that was driven: tells bank, grade and friction, and adds the closed loop
    #[arg(long, value_name = "ROUTE")]
    path: Option<PathBuf>,
    /// Learned model of the controller that drove (from rfl train) [default: the nominal controller]
    #[arg(long, value_name = "MODEL", requires = "path")]
    controller: Option<PathBuf>,
    /// A parameter of that controller, NAME=VALUE
    #[arg(long = "set", value_name = "NAME=VALUE", requires = "path")]
    settings: Vec<String>,
    /// Folder for page, report and calibrated simulator
    #[arg(long, value_name = "DIR", default_value = "out/diagnosis")]
    out: PathBuf,
    /// Seed of all that is random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; 0 for all there are. The answer does not depend on it
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// An effect that is not to be named (its tolerance stays); repeatable
    #[arg(long, value_name = "EFFECT")]
    without: Vec<String>,
    /// Quality of the vehicle's numbers; [tolerance] of the vehicle file states it for one
    #[arg(long, value_enum, default_value = "usual")]
    trust: Trust,
    /// Probability of an effect before the log is seen, EFFECT=P; repeatable
    #[arg(long = "prior", value_name = "EFFECT=P")]
    priors: Vec<String>,
    /// Single effects only
    #[arg(long)]
    no_pairs: bool,
    /// Print report.json instead of the text
    #[arg(long)]
    json: bool,
    /// Explain an effect, or all
    #[arg(long, value_name = "EFFECT", num_args = 0..=1, default_missing_value = "")]
    explain: Option<String>,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

/// Runs the command.
///
/// # Errors
/// The fault, its place, and advice.
pub fn run(args: &DiagnoseArgs) -> Result<u8, Box<dyn Error>> {
    if let Some(effect) = &args.explain {
        explain::explain(effect)?;
        return Ok(0);
    }
    let found = diagnosed(args, Some(&args.out))?;
    Ok(status(found.report.verdict.kind))
}

impl ReadsLogs for DiagnoseArgs {
    fn reading(&mut self) -> &mut LogArgs {
        &mut self.reading
    }
}

/// An answer, and its page.
#[derive(Debug, Clone)]
pub struct Diagnosed {
    /// The answer.
    pub report: Report,
    /// The page (HTML).
    pub page: String,
}

/// Runs the command and gives the answer; writes page, report and calibrated simulator where a folder for them is given.
///
/// # Errors
/// As [`run`].
pub fn diagnosed(args: &DiagnoseArgs, out: Option<&Path>) -> Result<Diagnosed, Box<dyn Error>> {
    args.reading.check_distinct(&args.logs)?;
    let logs = args.logs.iter().map(|file| args.reading.read(file)).collect::<Result<Vec<_>, _>>()?;
    let vehicle = vehicle(args, &logs)?;
    by_kind!(&vehicle, answer(args, &vehicle, &logs, out))
}

/// The vehicle's name or file.
fn vehicle(args: &DiagnoseArgs, logs: &[DriveLog]) -> Result<String, Box<dyn Error>> {
    let Some(vehicle) = &args.vehicle else {
        let truck = match args.unit {
            Some(unit) => unit == VehicleKind::Truck,
            None => logs.iter().any(DriveLog::is_articulated),
        };
        return Ok(if truck { BUILTIN_TRUCKS[0] } else { BUILTIN[0] }.to_owned());
    };
    let found = VehicleKind::of(vehicle);
    match args.unit.filter(|unit| *unit != found) {
        Some(_) => Err(format!(
            "--unit and --vehicle disagree: {vehicle} is a {}",
            if found == VehicleKind::Truck { "truck" } else { "car" }
        )
        .into()),
        None => Ok(vehicle.clone()),
    }
}

/// Refuses a log as its own reference, which would hide every fault.
fn check_reference(reference: &DriveLog, logs: &[DriveLog]) -> Result<(), String> {
    match logs.iter().find(|log| log.is_same_drive(reference)) {
        Some(log) => Err(format!(
            "--reference {}: the same drive as {}, which would hide every fault; give a log of the vehicle when it was as \
             modelled",
            reference.file.display(),
            log.file.display()
        )),
        None => Ok(()),
    }
}

/// Ratios of the wheelbase that a log shows to the vehicle's that gains of the steering explain.
const OWN_WHEELBASE: std::ops::Range<f64> = 0.8..1.25;

/// A finding on a log of another kind of vehicle than the simulator's: with a trailer, or turning as none of its wheelbase does.
fn another_vehicle(is_articulated: bool, log: &CleanLog, kind: &str, wheelbase: f64) -> Option<Finding> {
    let of = |signal: &str, summary: String| Finding {
        gravity: FindingSeverity::Suspicion,
        signal: Some(signal.to_owned()),
        summary,
    };
    match (is_articulated, kind == "truck") {
        (true, false) => Some(of(
            "articulation",
            "the log has an articulation angle, and the simulator is a car: choose the truck with --vehicle or --unit truck".to_owned(),
        )),
        (false, true) => {
            let (shown, error) = log.wheelbase_shown()?;
            let is_own = OWN_WHEELBASE.contains(&(shown / wheelbase)) || (shown - wheelbase).abs() < 5.0 * error;
            (!is_own).then(|| {
                let words = format!(
                    "the log turns as a vehicle of {shown:.1} m wheelbase, the truck's is {wheelbase:.1} m, and there is no articulation: \
                     another vehicle drove; choose it with --vehicle"
                );
                of("steer", words)
            })
        }
        _ => None,
    }
}

fn answer<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &DiagnoseArgs,
    name: &str,
    logs: &[DriveLog],
    out: Option<&Path>,
) -> Result<Diagnosed, Box<dyn Error>>
where
    P::Parameters: ReplayVehicle,
{
    let given: P::Parameters = vehicle_named(name)?;
    let nominal = P::controller(&given).vehicle.nominal();
    let steering = |speed: f64| steady_steering(&nominal, speed);
    let reading = args.reading.limit.road();
    let read = |road: &Path| Road::named(road, &reading);
    let road = args.path.as_deref().map(read).transpose()?.map(Arc::new);
    let clean_one = |log: &DriveLog| {
        let mut clean = CleanLog::of_vehicle(log, &steering, given.rear())?;
        if let Some(road) = &road {
            lay_on(&mut clean, road);
        }
        Ok((log.file.display().to_string(), clean))
    };
    let cleaned = logs.iter().map(clean_one).collect::<Result<Vec<_>, Box<dyn Error>>>()?;
    let mut clean = CleanLog::joined(cleaned)?.ok_or("give a log")?;
    let foreign =
        another_vehicle(logs.iter().any(DriveLog::is_articulated), &clean, P::KIND, nominal.wheelbase());
    clean.findings.splice(0..0, foreign);
    let reference = match &args.reference {
        Some(file) => {
            let log = args.reading.read(file)?;
            check_reference(&log, logs)?;
            Some(clean_one(&log)?.1)
        }
        None => None,
    };
    let options = Options {
        seed: args.seed,
        threads: args.threads,
        pairs: !args.no_pairs,
        without: args.without.clone(),
        own: Vec::new(),
        beliefs: Beliefs { trust: args.trust, probabilities: priors(&args.priors)? },
    };
    if let Some(out) = out {
        check_outputs(args, name, out)?;
    }
    let _held = out.map(hold_folder).transpose()?;
    let bar = progress_bar("diagnosing", 1000.0, args.quiet || args.json);
    let follow = |what: &str, share: f64| {
        bar.set_message(what.to_owned());
        bar.set_position((1000.0 * share.clamp(0.0, 1.0)) as u64);
    };
    let mut diagnosis = diagnose(&clean, reference.as_ref(), &given, &options, &follow)?;
    let report = &mut diagnosis.report;
    report.inputs.files.extend(inputs(args, name)?);
    if let Some(road) = &road {
        // Whatever becomes of it, what was found before stands.
        let gap = match args.logs.len() {
            1 => closed_loop::<P, S, C>(args, road, &clean, &given, report, &follow),
            _ => Err("it is closed along one drive, and several logs are given".into()),
        };
        match gap {
            Ok(gap) => report.gap_reduction.closed_loop = Some(BTreeMap::from([("e1".to_owned(), gap)])),
            Err(error) => {
                let words = format!("the loop was not closed: {error}");
                report.findings.push(Finding {
                    gravity: FindingSeverity::Warning,
                    signal: None,
                    summary: words,
                });
            }
        }
    }
    bar.finish_and_clear();

    let files = match out {
        Some(out) => simulator::<P, S, C>(args, name, &given, &diagnosis.report, out)?,
        None => Vec::new(),
    };
    let (wheelbase, steering, files) = (nominal.wheelbase(), &steering, &files[..]);
    let page = page(&PageInput { diagnosis: &diagnosis, log: &clean, wheelbase, steering, files });
    if let Some(out) = out {
        let json = serde_json::to_string_pretty(&diagnosis.report)? + "\n";
        write_text(&out.join("report.json"), &json)?;
        write_text(&out.join("report.html"), &page)?;
    }
    if args.json {
        say!("{}", serde_json::to_string_pretty(&diagnosis.report)?);
    } else {
        terminal::print(&diagnosis.report);
        if let Some(out) = out {
            say!("look at: {}", out.join("report.html").display());
        }
        if let Some(out) = out.filter(|_| !files.is_empty()) {
            let file = out.join(CALIBRATED_FILES[0]);
            say!("next: rfl drive --vehicle {0}, rfl learn --vehicle {0}", file.display());
        }
    }
    Ok(Diagnosed { report: diagnosis.report, page })
}

/// Checks that no file of the folder for results is one of those that are read.
fn check_outputs(args: &DiagnoseArgs, vehicle: &str, out: &Path) -> Result<(), Box<dyn Error>> {
    let mut read: Vec<_> = args.logs.iter().map(|log| ("LOG", log.as_path())).collect();
    read.extend(given([("--path", &args.path), ("--reference", &args.reference)]));
    read.push(("--vehicle", Path::new(vehicle)));
    check_folder(out, &[&CALIBRATED_FILES[..], &["report.json", "report.html"]].concat(), &read)
}

/// Probabilities of effects as a user writes them.
fn priors(given: &[String]) -> Result<BTreeMap<String, f64>, String> {
    let prior = |text: &String| {
        let found =
            text.split_once('=').and_then(|(id, p)| Some((id.trim().to_owned(), p.trim().parse().ok()?)));
        found.ok_or_else(|| format!("--prior {text}: write EFFECT=P, such as steer_delay=0.2"))
    };
    given.iter().map(prior).collect()
}

/// Exit status of a verdict.
fn status(kind: VerdictKind) -> u8 {
    match kind {
        VerdictKind::None => 0,
        VerdictKind::Effect => 3,
        VerdictKind::NotInLibrary => 4,
        VerdictKind::CannotTell => 5,
    }
}

/// Road-wheel angle for each 1/m of curvature in steady cornering: the model's lateral equation at rest.
pub(super) fn steady_steering<V: LateralVehicle<S>, const S: usize>(vehicle: &V, speed: f64) -> f64 {
    let speed = speed.max(1.0);
    match vehicle.model_at(speed) {
        Ok(model) => {
            let held = (model.a.row(1) * vehicle.steady_state(speed))[0];
            -(held + model.d[1] * speed) / model.b[1]
        }
        // The vehicle was read and checked; a wheelbase is a fair guess in any case.
        Err(_) => vehicle.wheelbase(),
    }
}

/// Inputs of the diagnosis, with hashes.
fn inputs(args: &DiagnoseArgs, vehicle: &str) -> Result<BTreeMap<String, InputFile>, Box<dyn Error>> {
    let mut files = BTreeMap::new();
    // Built-in vehicles and courses have names, and no files.
    let file = |name: &Path| Some(name.to_owned()).filter(|file| file.is_file());
    let (vehicle_file, path) = (file(vehicle.as_ref()), args.path.as_deref().and_then(file));
    let logs = args.logs.iter().enumerate().map(|(i, file)| {
        let what = if i == 0 { "log".to_owned() } else { format!("log {}", i + 1) };
        (what, file)
    });
    let others = [
        ("reference", &args.reference),
        ("vehicle", &vehicle_file),
        ("path", &path),
        ("controller", &args.controller),
    ];
    let others = others.into_iter().filter_map(|(what, file)| Some((what.to_owned(), file.as_ref()?)));
    for (what, file) in logs.chain(others) {
        let hash = args.reading.hash(file).map_err(|error| format!("{}: {error}", file.display()))?;
        let hash = format!("{hash:016x}");
        files.insert(what, InputFile { file: file.display().to_string(), hash });
    }
    Ok(files)
}

/// Tells a log of its road.
fn lay_on(log: &mut CleanLog, road: &Road) {
    if let Err(error) = log.lay_on(road) {
        let words = format!("bank, grade and friction of --path are not known to the replay: {error}");
        log.findings.push(Finding { gravity: FindingSeverity::Warning, signal: None, summary: words });
    }
}

/// The gap in tracking error.
fn closed_loop<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &DiagnoseArgs,
    path: &Arc<Road>,
    log: &CleanLog,
    given: &P::Parameters,
    report: &Report,
    progress: &dyn Fn(&str, f64),
) -> Result<Gap, Box<dyn Error>> {
    let (logged, noise) = closed_loop::logged(log, path)?;
    let parameters = controller_with::<P, S, C>(given, &args.settings)?;
    let model = || {
        let choice = Choice {
            variant: ControlVariant::Adaptive,
            file: args.controller.clone(),
            folder: PathBuf::new(),
            propagation: Propagation::Propagated,
            roll_out: RollOut::Corrected,
        };
        choice.prediction_model(&parameters).map(|(_, model)| model)
    };
    let drive = |what: &str, vehicle: &P::Parameters| -> Result<LateralErrorProfile, Box<dyn Error>> {
        let follow = |share| progress(what, share);
        Ok(closed_loop::simulated::<P, S, C>(vehicle, parameters, model()?, path, follow)?)
    };
    let with = |calibration| calibrated(given, &changes(report, calibration));
    let as_given = drive("closed loop as given", given)?;
    let effect = drive("closed loop with the effect", &with(CalibrationExtent::Effect)?)?;
    let whole = drive("closed loop recalibrated", &with(CalibrationExtent::Whole)?)?;
    Ok(closed_loop::gap(&logged, noise, [&as_given, &effect, &whole])?)
}

/// Files of the calibrated simulator.
const CALIBRATED_FILES: [&str; 3] = ["calibrated.toml", "calibrated.ssv", "system.ssv"];

/// Writes the calibrated simulator; gives its files with their descriptions. None if there is nothing to calibrate.
fn simulator<P: Commanded<S, C>, const S: usize, const C: usize>(
    args: &DiagnoseArgs,
    name: &str,
    given: &P::Parameters,
    report: &Report,
    out: &Path,
) -> Result<Vec<(String, String)>, Box<dyn Error>> {
    let at = |file: &str| out.join(file);
    let names = CALIBRATED_FILES;
    if !matches!(report.verdict.kind, VerdictKind::Effect | VerdictKind::None) {
        // Those of an earlier log would be taken for this one's.
        names.iter().for_each(|file| drop(std::fs::remove_file(at(file))));
        return Ok(Vec::new());
    }
    let vehicle = calibrated(given, &changes(report, CalibrationExtent::Whole))?;
    let logs: Vec<String> = args.logs.iter().map(|log| log.display().to_string()).collect();
    let words = format!(
        "{} as `rfl diagnose {}` found it.\nVerdict: {}",
        given.name(),
        logs.join(" ").escape_debug(),
        report.verdict.headline()
    );
    let built_in = P::Parameters::BUILTIN.contains(&name);
    let source = (!built_in).then(|| Path::new(name));
    write_vehicle(&vehicle, source, &words, &at(names[0]))?;
    let vehicle_file =
        if built_in { name.to_owned() } else { std::fs::canonicalize(name)?.display().to_string() };
    let changed = differences(given, &vehicle);
    let component = if P::KIND == "truck" { "SemiTrailerTruck" } else { "PassengerCar" };
    for (file, component) in [(names[1], None), (names[2], Some(component))] {
        let text = parameter_set(component, &vehicle_file, &changed);
        write_text(&at(file), &text)?;
    }
    Ok(vec![
        (
            names[0].into(),
            "the vehicle: rfl drive --vehicle, rfl collect and rfl train --vehicle, vehicle_file of the FMUs"
                .into(),
        ),
        (names[1].into(), format!("the same as parameters (SSP 1.0) for {component}.fmu in any FMI host")),
        (names[2].into(), "the same for the SSP of vehicle and controller, names with the component".into()),
    ])
}
