//! A kind of vehicle in the closed loop: its construction, drive and measurement, and the columns of its log.

use super::columns::{COLUMNS, Common};
use crate::control::{
    ControlledParameters, ControllerParameters, ControllerParametersFor, Measurement, NominalTruck,
    NominalVehicle, TRUCK_STATES, TruckControllerParameters,
};
use crate::nominal::{ERRORS, LateralVehicle};
use crate::path::Path;
use crate::signal::{self, Signal};
use crate::vehicle::car::CarError;
use crate::vehicle::{
    Car, CarParameters, Effects, PlantStepError, ReducedVehicle, Truck, TruckEffects, TruckError,
    TruckParameters, VehicleInput, car, truck,
};
use std::sync::Arc;

/// A vehicle that a controller for `S` states drives, with `C` columns in its log.
pub trait SimulatedVehicle<const S: usize, const C: usize>: Sized {
    /// Its parameters.
    type Parameters: crate::vehicle::VehicleParameters<Effects = Self::Effects>;
    /// Differences from its model.
    type Effects: Default + Clone;
    /// Nominal vehicle of its controller.
    type Nominal: ControlledParameters<S>;
    /// Reasons for which it cannot be made.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Columns of its log: those of every vehicle, [`COLUMNS`], and its own.
    const SIGNALS: &'static [Signal; C];
    /// Name of the kind, in one word.
    const KIND: &'static str =
        <<Self::Nominal as ControlledParameters<S>>::Vehicle as LateralVehicle<S>>::KIND;

    /// The default controller for it.
    fn controller(parameters: &Self::Parameters) -> ControllerParametersFor<Self::Nominal>;

    /// The settings of the papers' tables for it.
    fn controller_of_the_papers(parameters: &Self::Parameters) -> ControllerParametersFor<Self::Nominal>;

    /// Value of the effect with this id.
    fn effect<'a>(effects: &'a mut Self::Effects, id: &str) -> Option<&'a mut f64>;

    /// Makes it.
    ///
    /// # Errors
    /// Parameters or effects out of range.
    fn make(
        parameters: &Self::Parameters,
        effects: &Self::Effects,
        road: Option<Arc<Path>>,
    ) -> Result<Self, Self::Error>;

    /// Makes it without its fast motions, for many replays.
    ///
    /// # Errors
    /// As [`make`](Self::make).
    fn reduced(
        parameters: &Self::Parameters,
        effects: &Self::Effects,
    ) -> Result<Box<dyn ReducedVehicle>, Self::Error>;

    /// Places it: m, rad, m/s.
    fn place(&mut self, x: f64, y: f64, yaw: f64, vx: f64);

    /// Makes one communication step, s.
    ///
    /// # Errors
    /// A vehicle that cannot go on.
    fn advance(&mut self, input: &VehicleInput, step: f64) -> Result<(), PlantStepError>;

    /// Measurements for the controller.
    fn measured(&self) -> Measurement;

    /// Recorded signals that the controller does not get: `ax`, `ay` in m/s2 and `roll` in rad.
    fn recorded(&self) -> [f64; 3];

    /// The row of the log from the columns of every vehicle and the controller's measurement.
    fn row(common: &Common, told: &Measurement) -> [f64; C];
}

/// Columns of a car's log.
pub const CAR_COLUMNS: usize = COLUMNS.len();
/// Columns of a truck's log.
pub const TRUCK_COLUMNS: usize = COLUMNS.len() + 2;

/// Makes, places and steps as the vehicle itself does.
macro_rules! as_itself {
    ($kind:ident) => {
        fn effect<'a>(effects: &'a mut Self::Effects, id: &str) -> Option<&'a mut f64> {
            effects.get_mut(id)
        }

        fn make(
            parameters: &Self::Parameters,
            effects: &Self::Effects,
            road: Option<Arc<Path>>,
        ) -> Result<Self, Self::Error> {
            Self::new(parameters, effects, road)
        }

        fn reduced(
            parameters: &Self::Parameters,
            effects: &Self::Effects,
        ) -> Result<Box<dyn ReducedVehicle>, Self::Error> {
            $kind::reduced(parameters, effects)
        }

        fn place(&mut self, x: f64, y: f64, yaw: f64, vx: f64) {
            self.place(x, y, yaw, vx);
        }

        fn advance(&mut self, input: &VehicleInput, step: f64) -> Result<(), PlantStepError> {
            self.step(input, step)
        }

        fn recorded(&self) -> [f64; 3] {
            let output = self.output();
            [output.ax, output.ay, output.roll]
        }
    };
}

impl SimulatedVehicle<ERRORS, CAR_COLUMNS> for Car {
    type Parameters = CarParameters;
    type Effects = Effects;
    type Nominal = NominalVehicle;
    type Error = CarError;

    const SIGNALS: &'static [Signal; CAR_COLUMNS] = &COLUMNS;

    fn controller(parameters: &CarParameters) -> ControllerParameters {
        ControllerParameters::for_car(parameters)
    }

    fn controller_of_the_papers(parameters: &CarParameters) -> ControllerParameters {
        ControllerParameters::of_the_papers(parameters)
    }

    as_itself!(car);

    fn measured(&self) -> Measurement {
        let car = self.output();
        Measurement {
            x: car.x,
            y: car.y,
            yaw: car.yaw,
            vx: car.vx,
            vy: car.vy,
            yaw_rate: car.yaw_rate,
            steer: car.steer,
            ..Measurement::default()
        }
    }

    fn row(common: &Common, _: &Measurement) -> [f64; CAR_COLUMNS] {
        *common
    }
}

impl SimulatedVehicle<TRUCK_STATES, TRUCK_COLUMNS> for Truck {
    type Parameters = TruckParameters;
    type Effects = TruckEffects;
    type Nominal = NominalTruck;
    type Error = TruckError;

    const SIGNALS: &'static [Signal; TRUCK_COLUMNS] = &{
        let mut all = [signal::ARTICULATION; TRUCK_COLUMNS];
        let mut i = 0;
        while i < COLUMNS.len() {
            all[i] = COLUMNS[i];
            i += 1;
        }
        all[COLUMNS.len() + 1] = signal::ARTICULATION_RATE;
        all
    };

    fn controller(parameters: &TruckParameters) -> TruckControllerParameters {
        TruckControllerParameters::for_truck(parameters)
    }

    fn controller_of_the_papers(parameters: &TruckParameters) -> TruckControllerParameters {
        TruckControllerParameters::of_the_papers(parameters)
    }

    as_itself!(truck);

    fn measured(&self) -> Measurement {
        let truck = self.output();
        Measurement {
            x: truck.x,
            y: truck.y,
            yaw: truck.yaw,
            vx: truck.vx,
            vy: truck.vy,
            yaw_rate: truck.yaw_rate,
            steer: truck.steer,
            articulation: truck.articulation,
            articulation_rate: truck.articulation_rate,
        }
    }

    fn row(common: &Common, told: &Measurement) -> [f64; TRUCK_COLUMNS] {
        let mut row = [0.0; TRUCK_COLUMNS];
        row[..COLUMNS.len()].copy_from_slice(common);
        row[COLUMNS.len()..].copy_from_slice(&[told.articulation, told.articulation_rate]);
        row
    }
}
