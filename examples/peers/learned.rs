//! A drive with a slow actuator to learn from, as `rfl collect` makes it.

use rfl_mpc::control::{Controller, ControllerParameters};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::{DataConfig, DataSet, Drive};
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Effects, builtin};
use std::error::Error;
use std::sync::Arc;

/// The car of all drives here.
pub const CAR: &str = "c_class";
/// Its steering, slower than the controller thinks.
pub const SLOW: f64 = 0.1;

/// Drives the training route for so many seconds with calm weights and a little dither.
pub fn collect(duration: f64) -> Result<DataSet, Box<dyn Error>> {
    let car = builtin(CAR)?;
    let mut parameters = ControllerParameters::of_the_papers(&car);
    (parameters.mpc.r_rate, parameters.mpc.q_e1_rate, parameters.mpc.q_e2) = (0.3, 1.0, 2.0);
    parameters.mpc.dither = 0.005;
    let path = Arc::new(Path::from_samples(Route::SudokuTrain.samples(), Closure::Detect)?);
    let controller = Controller::new(parameters, path)?;
    let effects = Effects { steer_lag: SLOW, ..Effects::default() };
    let step = parameters.mpc.sample_time;
    let driven = ClosedLoop::at_start(controller, &car, &effects, step)?.drive(duration, |_| ())?;
    let mut log = Drive { name: "collected".into(), ..Drive::default() };
    let names = log.columns().map(|(name, _)| name);
    log.columns_mut().into_iter().zip(names).for_each(|(column, name)| *column = driven.column(name));
    Ok(DataSet::new(&[log], &parameters.vehicle.single_track(), DataConfig::default())?)
}
