//! `rfl drive`: the closed loop in native code, on any road, with any car or truck.

use super::vehicle::{Commanded, Linear, by_kind, vehicle_named};
use super::{named, progress_bar};
use crate::control::{
    Choice, ControlVariant, ControllerFile, ControllerFor, ControllerParametersFor, PredictionModelFor,
    Propagation, RollOut, VehicleParameters,
};
use crate::parameter::{NoValue, Parameter};
use crate::path::sudoku::Route;
use crate::path::{Path, RoadClass};
use crate::simulate::{ClosedLoopFor, DriveFor, STATION, SimulatedVehicle, StepTimes};
use crate::vehicle::{BUILTIN, VehicleParameters as VehicleFile};
use clap::Args;
use serde_json::json;
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

/// Drives a car or a truck along a road with the MPC, natively, and says how well it tracked.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl drive                                            the Sudoku test route, the C-class car
  rfl drive --path road.csv --vehicle my_car.toml --log out/drive.csv
  rfl drive --set mpc.q_e2=1 --set effect.steer_delay=0.06
  rfl drive --set car.vehicle.mass=1600                the car's mass, not the controller's
  rfl drive --vehicle my_car.toml --controller out/tune/controller.toml    as tuned by rfl tune
  rfl drive --vehicle truck_simulation                 the truck's test route, the truck paper's truck
  rfl drive --residual out/residual/rfl_s.rflm         with what rfl train learned
  rfl drive --variant rfl_s                            the same: models are looked for in out/residual
  rfl drive --variant actuator --set actuator.dead_time=0.06 --set actuator.time_constant=0.1
  rfl drive --variant actuator --set actuator.dead_time=0.12 --set actuator.dead_time_model=pade_2_2")]
pub struct DriveArgs {
    /// Road to follow: a CSV file with columns x, y [default: the vehicle's test route]
    #[arg(long)]
    path: Option<PathBuf>,
    /// Car or truck: a vehicle file (TOML) or a built-in name
    #[arg(long, default_value = BUILTIN[0])]
    vehicle: String,
    /// Longest drive in s of simulated time
    #[arg(long, default_value_t = 1800.0)]
    duration: f64,
    /// Communication step in s
    #[arg(long, default_value_t = 0.02)]
    step: f64,
    /// Controller file (from rfl tune); what is set beside it counts more
    #[arg(long, value_name = "FILE")]
    controller: Option<PathBuf>,
    /// A parameter, NAME=VALUE, of whoever has it; `car.` (`truck.`) or `controller.` before the name means one of them only
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    /// File for the drive log (CSV)
    #[arg(long)]
    log: Option<PathBuf>,
    /// File for the results (JSON)
    #[arg(long)]
    json: Option<PathBuf>,
    #[command(flatten)]
    model: ModelArgs,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

/// What the controller predicts with: the same words as the FMU's.
#[derive(Debug, Clone, Args)]
pub(super) struct ModelArgs {
    /// What the controller predicts with; none with --residual: what the file is for
    #[arg(long, default_value = "none", hide_possible_values = true, value_parser = named(ControlVariant::ALL, ControlVariant::name, ControlVariant::meaning))]
    variant: ControlVariant,
    /// Learned model to predict with (from rfl train) [default: VARIANT.rflm in --models]
    #[arg(long, value_name = "FILE")]
    residual: Option<PathBuf>,
    /// Folder with a learned model for each variant
    #[arg(long, value_name = "DIR", default_value = MODELS)]
    models: PathBuf,
    /// Add the residual without propagating it, as printed by Zhao et al., eq. (9)
    #[arg(long)]
    direct: bool,
}

/// Where `rfl train` puts models, and `rfl drive` looks for them.
pub(super) const MODELS: &str = "out/residual";

/// A variant and what it predicts with.
type Chosen<G, const S: usize> =
    (ControlVariant, PredictionModelFor<<G as VehicleParameters<S>>::Vehicle, S>);

impl ModelArgs {
    /// Takes a file's variant where the command line asks for none.
    pub fn prefer(&mut self, variant: Option<ControlVariant>) {
        if let (ControlVariant::None, None, Some(variant)) = (self.variant, &self.residual, variant) {
            self.variant = variant;
        }
    }

    /// The variant and its model for a controller with these parameters.
    pub fn choose<G: VehicleParameters<S>, const S: usize>(
        &self,
        parameters: &ControllerParametersFor<G>,
    ) -> Result<Chosen<G, S>, Box<dyn Error>> {
        let choice = Choice {
            variant: self.variant,
            file: self.residual.clone(),
            folder: self.models.clone(),
            propagation: if self.direct { Propagation::Direct } else { Propagation::Propagated },
            roll_out: RollOut::Corrected,
        };
        Ok(choice.prediction_model(parameters)?)
    }
}

/// A road, and the parameters of vehicle and controller that `--set` reaches.
pub(super) struct Setup<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> {
    pub path: Arc<Path>,
    pub controller: ControllerParametersFor<P::Nominal>,
    pub vehicle: P::Parameters,
    pub effects: P::Effects,
}

impl<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> Setup<P, S, C> {
    /// Reads road and vehicle and applies the settings.
    pub fn new(
        path: Option<&std::path::Path>,
        course: Route,
        vehicle: &str,
        settings: &[String],
    ) -> Result<Self, Box<dyn Error>> {
        let path = Arc::new(match path {
            Some(file) => Path::read(file)?,
            None => course.path()?,
        });
        for note in path.notes() {
            eprintln!("note: {note}");
        }
        let vehicle: P::Parameters = vehicle_named(vehicle)?;
        let controller = P::controller(&vehicle);
        let effects = vehicle.effects().clone();
        let mut setup = Self { path, controller, vehicle, effects };
        settings.iter().try_for_each(|text| setup.apply(text))?;
        Ok(setup)
    }

    /// Connects controller and vehicle at the road's beginning, with a communication step in s.
    pub fn connect(
        self,
        model: PredictionModelFor<Linear<P, S, C>, S>,
        step: f64,
    ) -> Result<ClosedLoopFor<P, S, C>, Box<dyn Error>> {
        let controller = ControllerFor::predicting_with(self.controller, self.path, model)?;
        Ok(ClosedLoopFor::at_start(controller, &self.vehicle, &self.effects, step)?)
    }

    fn apply(&mut self, text: &str) -> Result<(), Box<dyn Error>> {
        let (full_name, value) = setting(text)?;
        let (controller, vehicle, name) = match full_name.split_once('.') {
            Some((kind, name)) if kind == P::KIND => (false, true, name),
            Some(("controller", name)) => (true, false, name),
            _ => (true, true, full_name),
        };
        let declared = ControllerParametersFor::<P::Nominal>::declared(name).filter(|_| controller);
        let value = number(text, declared, value)?;
        let mut found = false;
        if controller {
            found |= self.controller.set::<S>(name, value)?;
        }
        if vehicle {
            if let Some(parameter) = P::Parameters::TABLE.iter().find(|parameter| parameter.name == name) {
                parameter.set(&mut self.vehicle, value);
                found = true;
            }
            let effect = name.strip_prefix("effect.").and_then(|id| P::effect(&mut self.effects, id));
            if let Some(effect) = effect {
                *effect = value;
                found = true;
            }
        }
        if found {
            return Ok(());
        }
        Err(format!("--set {text}: there is no number '{name}' to set; 'rfl parameters' lists all").into())
    }
}

/// Name and value of a setting `NAME=VALUE`.
pub(super) fn setting(text: &str) -> Result<(&str, &str), Box<dyn Error>> {
    let (name, value) =
        text.split_once('=').ok_or_else(|| format!("--set {text}: write it as NAME=VALUE"))?;
    Ok((name.trim(), value.trim()))
}

/// The number of a setting's value: a number or, of a declared parameter whose values have names, a name.
pub(super) fn number(text: &str, declared: Option<&Parameter>, value: &str) -> Result<f64, Box<dyn Error>> {
    let number = match declared {
        Some(parameter) => parameter.read(value),
        None => value.parse().map_err(|_| NoValue::NotANumber { text: value.to_owned() }),
    };
    number.map_err(|error| format!("--set {text}: {error}").into())
}

/// Runs the command.
///
/// # Errors
/// What was wrong, where, and what to do.
pub fn run(args: &DriveArgs) -> Result<(), Box<dyn Error>> {
    if !(args.step > 0.0 && args.duration > 0.0) {
        return Err("--step and --duration must be positive".into());
    }
    by_kind!(&args.vehicle, drive(args))
}

fn drive<P: Commanded<S, C>, const S: usize, const C: usize>(args: &DriveArgs) -> Result<(), Box<dyn Error>> {
    let mut setup = Setup::<P, S, C>::new(args.path.as_deref(), P::TEST, &args.vehicle, &[])?;
    let mut model = args.model.clone();
    if let Some(file) = &args.controller {
        let read = ControllerFile::read(file)?;
        read.apply::<P::Nominal, S>(&mut setup.controller, file)?;
        model.prefer(read.variant);
    }
    args.settings.iter().try_for_each(|text| setup.apply(text))?;
    let (variant, model) = model.choose(&setup.controller)?;
    let sample_time = setup.controller.mpc.sample_time;
    let bar = progress_bar("driving", setup.path.length(), args.quiet);
    let mut closed = setup.connect(model, args.step)?;
    let begin = std::time::Instant::now();
    let drive = closed.drive(args.duration, |row| {
        bar.set_position(row[STATION].max(0.0) as u64);
    })?;
    let wall = begin.elapsed().as_secs_f64();
    bar.finish_and_clear();

    if let Some(file) = &args.log {
        drive.write_csv(
            std::fs::File::create(file).map_err(|error| format!("{}: {error}", file.display()))?,
        )?;
    }
    report(&drive, variant, sample_time, wall, args)
}

fn report<const C: usize>(
    drive: &DriveFor<C>,
    variant: ControlVariant,
    sample_time: f64,
    wall: f64,
    args: &DriveArgs,
) -> Result<(), Box<dyn Error>> {
    let all = drive.tracking();
    let StepTimes { step, look_up, condense, solve } = drive.times(sample_time);
    let driven = drive.duration();
    say!("{:<16} {:>9} {:>9} {:>9} {:>8}", "lateral error", "mean m", "RMS m", "max m", "share %");
    let line = |name: &str, metrics: &crate::simulate::TrackingMetrics| {
        let share = 100.0 * metrics.count as f64 / all.count.max(1) as f64;
        say!("{name:<16} {:>9.4} {:>9.4} {:>9.4} {share:>8.1}", metrics.mae, metrics.rmse, metrics.max);
    };
    line("whole drive", &all);
    let mut classes = serde_json::Map::new();
    for class in RoadClass::ALL {
        let metrics = drive.tracking_on(class);
        if metrics.count > 0 {
            line(class.name(), &metrics);
            classes.insert(class.name().to_string(), json!(metrics));
        }
    }
    say!(
        "step time: mean {:.0} us, p99 {:.0} us, max {:.0} us, {} over Ts",
        1e6 * step.mean_s,
        1e6 * step.p99_s,
        1e6 * step.max_s,
        step.missed
    );
    let end = if drive.finished { "road finished" } else { "stopped before the road's end" };
    say!("{driven:.2} s driven in {wall:.2} s ({:.0} times real time), {end}", driven / wall);
    if let Some(file) = &args.json {
        let value = json!({
            "variant": variant.name(), "tracking": all, "classes": classes, "duration": driven,
            "finished": drive.finished, "real_time_factor": driven / wall,
            "step": step, "parts": { "look_up": look_up, "condense": condense, "solve": solve },
        });
        std::fs::write(file, serde_json::to_string_pretty(&value)?)?;
    }
    Ok(())
}
