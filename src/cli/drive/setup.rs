//! Road, vehicle and controller of a command, and the numbers of each that `--set` reaches.

use super::super::vehicle::{VehicleLinearModel, vehicle_named};
use crate::control::{ControllerFor, ControllerParametersFor, PredictionModelFor};
use crate::fmu::INITIAL;
use crate::parameter::{NoValue, Parameter};
use crate::path::sudoku::Route;
use crate::path::{Path, PathOptions};
use crate::simulate::{ClosedLoopFor, SimulatedVehicle};
use crate::vehicle::VehicleParameters as _;
use std::error::Error;
use std::sync::Arc;

/// A road, and the parameters of vehicle and controller that `--set` reaches.
pub(in crate::cli) struct Setup<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> {
    pub path: Arc<Path>,
    pub controller: ControllerParametersFor<P::Nominal>,
    pub vehicle: P::Parameters,
    pub effects: P::Effects,
}

impl<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> Setup<P, S, C> {
    /// Reads vehicle and road and applies the settings.
    pub fn new(
        path: Option<&std::path::Path>,
        reading: &PathOptions,
        course: Route,
        vehicle: &str,
        settings: &[String],
    ) -> Result<Self, Box<dyn Error>> {
        let mut numbers = DriveNumbers::<P, S, C>::of(vehicle)?;
        settings.iter().try_for_each(|text| numbers.apply(text))?;
        numbers.on(path, reading, course)
    }

    /// Connects controller and vehicle at the road's beginning, with a communication step in s.
    pub fn connect(
        self,
        model: PredictionModelFor<VehicleLinearModel<P, S, C>, S>,
        step: f64,
    ) -> Result<ClosedLoopFor<P, S, C>, Box<dyn Error>> {
        let controller = ControllerFor::predicting_with(self.controller, self.path, model)?;
        Ok(ClosedLoopFor::at_start(controller, &self.vehicle, &self.effects, step)?)
    }
}

/// The parameters of vehicle and controller, before their road is read: its corners are rounded for them.
pub(in crate::cli) struct DriveNumbers<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> {
    pub controller: ControllerParametersFor<P::Nominal>,
    pub vehicle: P::Parameters,
    effects: P::Effects,
}

impl<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> DriveNumbers<P, S, C> {
    /// Those of a vehicle by name or file.
    pub fn of(vehicle: &str) -> Result<Self, Box<dyn Error>> {
        let vehicle: P::Parameters = vehicle_named(vehicle)?;
        let controller = P::controller(&vehicle);
        let effects = vehicle.effects().clone();
        Ok(Self { controller, vehicle, effects })
    }

    /// Reads the road.
    pub fn on(
        self,
        path: Option<&std::path::Path>,
        reading: &PathOptions,
        course: Route,
    ) -> Result<Setup<P, S, C>, Box<dyn Error>> {
        let path = Arc::new(match path {
            Some(road) => Path::named(road, &self.controller.reading::<S>(reading))?,
            None => course.path()?,
        });
        for note in path.notes() {
            warn!("{}: {note}", if note.warning { "warning" } else { "note" });
        }
        let Self { controller, vehicle, effects } = self;
        Ok(Setup { path, controller, vehicle, effects })
    }

    /// Takes a setting, NAME=VALUE.
    pub fn apply(&mut self, text: &str) -> Result<(), Box<dyn Error>> {
        let (full_name, value) = setting(text)?;
        let (controller, vehicle, name) = match full_name.split_once('.') {
            Some((kind, name)) if kind == P::KIND => (false, true, name),
            Some(("controller", name)) => (true, false, name),
            _ => (true, true, full_name),
        };
        if name == "variant" {
            return Err(format!(
                "--set {text}: a variant is no number; 'rfl drive --variant {value}' chooses it"
            )
            .into());
        }
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
        if INITIAL.iter().any(|initial| initial.name == name) {
            return Err(
                format!("--set {text}: only 'rfl drive' takes another start ({name}); leave it out").into()
            );
        }
        Err(format!("--set {text}: there is no number '{name}' to set; 'rfl parameters' lists all").into())
    }
}

/// Pose and speed at the start as set, in the order of [`INITIAL`]; where not set, those of the road.
pub(super) struct Initial(pub [Option<f64>; 4]);

impl Initial {
    /// Takes its settings out of all; `kind` is the word for the vehicle that may stand before a name.
    pub fn take(settings: &mut Vec<String>, kind: &str) -> Result<Self, Box<dyn Error>> {
        let mut all = Self([None; 4]);
        for text in std::mem::take(settings) {
            let named = setting(&text).ok().and_then(|(name, value)| {
                let own = name.strip_prefix(kind).and_then(|rest| rest.strip_prefix('.')).unwrap_or(name);
                Some((INITIAL.iter().position(|known| known.name == own)?, value))
            });
            let Some((place, value)) = named else {
                settings.push(text);
                continue;
            };
            let value = number(&text, None, value)?;
            if !value.is_finite() {
                return Err(format!("--set {text}: a finite number is needed").into());
            }
            INITIAL[place].check(value).map_err(|error| format!("--set {text}: {error}"))?;
            all.0[place] = Some(value);
        }
        Ok(all)
    }
}

/// Name and value of a setting `NAME=VALUE`.
pub(in crate::cli) fn setting(text: &str) -> Result<(&str, &str), Box<dyn Error>> {
    let (name, value) =
        text.split_once('=').ok_or_else(|| format!("--set {text}: write it as NAME=VALUE"))?;
    Ok((name.trim(), value.trim()))
}

/// The number of a setting's value: a number or, of a declared parameter whose values have names, a name.
pub(in crate::cli) fn number(
    text: &str,
    declared: Option<&Parameter>,
    value: &str,
) -> Result<f64, Box<dyn Error>> {
    let number = match declared {
        Some(parameter) => parameter.read(value),
        None => value.parse().map_err(|_| NoValue::NotANumber { text: value.to_owned() }),
    };
    number.map_err(|error| format!("--set {text}: {error}").into())
}
