//! Commands for each kind of vehicle: the same words, other courses and defaults.

use super::drive::{number, setting};
use super::progress::Bar;
use super::train_gp;
use crate::control::{ControlledParameters, ControllerParametersFor, TRUCK_STATES};
use crate::nominal::ERRORS;
use crate::path::sudoku::Route;
use crate::residual::DataSet;
use crate::residual::gp::GpConfig;
use crate::simulate::experiment::Compared;
use crate::simulate::{CAR_COLUMNS, SimulatedVehicle, TRUCK_COLUMNS};
use crate::vehicle::{
    Articulated, BUILTIN, BUILTIN_TRUCKS, Car, SingleTrack, Truck, VehicleError,
    VehicleParameters as VehicleFile, VehiclePlace,
};
use serde_json::Value;
use std::error::Error;
use std::path::Path;

/// The linear model that the controller of a vehicle has of it.
pub(super) type VehicleLinearModel<P, const S: usize, const C: usize> =
    <<P as SimulatedVehicle<S, C>>::Nominal as ControlledParameters<S>>::Vehicle;

/// A vehicle that the commands know.
pub(super) trait Commanded<const S: usize, const C: usize>: Compared<S, C> {
    /// The road to be measured on.
    const TEST: Route;

    /// The mass that a payload is compared with, kg.
    fn mass(of: &VehicleLinearModel<Self, S, C>) -> f64;

    /// Learns what a nonlinear model misses.
    ///
    /// # Errors
    /// Too little data; a file that cannot be written.
    fn learn_gp(
        data: &DataSet<VehicleLinearModel<Self, S, C>, S>,
        test: Option<&DataSet<VehicleLinearModel<Self, S, C>, S>>,
        config: &GpConfig,
        file: &Path,
        bar: &Bar,
    ) -> Result<Value, Box<dyn Error>>;
}

impl Commanded<ERRORS, CAR_COLUMNS> for Car {
    const TEST: Route = Route::SudokuTest;

    fn mass(of: &SingleTrack) -> f64 {
        of.mass
    }

    fn learn_gp(
        data: &DataSet,
        test: Option<&DataSet>,
        config: &GpConfig,
        file: &Path,
        bar: &Bar,
    ) -> Result<Value, Box<dyn Error>> {
        train_gp::learn(data, test, config, file, bar)
    }
}

impl Commanded<TRUCK_STATES, TRUCK_COLUMNS> for Truck {
    const TEST: Route = Route::TruckTest;

    fn mass(of: &Articulated) -> f64 {
        of.mass2
    }

    fn learn_gp(
        data: &DataSet<Articulated, TRUCK_STATES>,
        test: Option<&DataSet<Articulated, TRUCK_STATES>>,
        config: &GpConfig,
        file: &Path,
        bar: &Bar,
    ) -> Result<Value, Box<dyn Error>> {
        train_gp::learn(data, test, config, file, bar)
    }
}

/// A vehicle by built-in name or file.
pub(super) fn vehicle_named<F: VehicleFile>(name: &str) -> Result<F, Box<dyn Error>> {
    Ok(F::named(name, |name| name.into()).map_err(of_any_kind)?)
}

/// The error of a name that is neither a file's nor a built-in vehicle's: its kind cannot be told, and all are possible.
fn of_any_kind(error: VehicleError) -> VehicleError {
    match error {
        VehicleError::Unreadable { file, source, .. } => {
            VehicleError::Unreadable { file, source, builtin: [BUILTIN, BUILTIN_TRUCKS].concat() }
        }
        other => other,
    }
}

/// Says which numbers of a vehicle's file contradict each other.
pub(super) fn say_doubts<F: VehicleFile>(name: &str) {
    // What cannot be read is said by whoever needs it.
    let doubts = vehicle_named::<F>(name).map_or_else(|_| Vec::new(), |vehicle| vehicle.doubts());
    for doubt in doubts {
        warn!("warning: {}: {}", VehiclePlace::of(Path::new(name), doubt.name), doubt.words);
    }
}

/// The default controller for a vehicle, with a user's settings.
pub(super) fn controller_with<P: Commanded<S, C>, const S: usize, const C: usize>(
    vehicle: &P::Parameters,
    settings: &[String],
) -> Result<ControllerParametersFor<P::Nominal>, Box<dyn Error>> {
    let mut parameters = P::controller(vehicle);
    for text in settings {
        let (name, value) = setting(text)?;
        let name = name.strip_prefix("controller.").unwrap_or(name);
        let value = number(text, ControllerParametersFor::<P::Nominal>::declared(name), value)?;
        if !parameters.set::<S>(name, value)? {
            let lists = "'rfl parameters' lists those of the controller";
            return Err(format!("--set {text}: the controller has no number '{name}'; {lists}").into());
        }
    }
    Ok(parameters)
}

/// Calls a command's function for the kind of a vehicle, by built-in name or file. Doubts about the file are said first.
macro_rules! by_kind {
    ($vehicle:expr, $function:ident($($argument:expr),*)) => {
        match $crate::vehicle::VehicleKind::of($vehicle) {
            $crate::vehicle::VehicleKind::Car => {
                $crate::cli::vehicle::say_doubts::<$crate::vehicle::CarParameters>($vehicle);
                $function::<
                    $crate::vehicle::Car,
                    { $crate::nominal::ERRORS },
                    { $crate::simulate::CAR_COLUMNS },
                >($($argument),*)
            }
            $crate::vehicle::VehicleKind::Truck => {
                $crate::cli::vehicle::say_doubts::<$crate::vehicle::TruckParameters>($vehicle);
                $function::<
                    $crate::vehicle::Truck,
                    { $crate::control::TRUCK_STATES },
                    { $crate::simulate::TRUCK_COLUMNS },
                >($($argument),*)
            }
        }
    };
}
pub(super) use by_kind;
