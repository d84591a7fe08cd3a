//! A residual of one's own: no forest, but a steering that is known to be late.

use crate::counting::allocated;
use rfl_mpc::control::{Controller, ControllerParameters, PredictionModel, Propagation, Residual, RollOut};
use rfl_mpc::nominal::{Actuator, ERRORS, LateralVehicle as _};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::{EachRow, Expected, LinearResidual, ModelMismatch, ROAD, ResidualRows, RowResidual};
use rfl_mpc::simulate::{ClosedLoop, SimulatedVehicle};
use rfl_mpc::vehicle::{Effects, SingleTrack, builtin};
use std::sync::Arc;

const TS: f64 = 0.02;
const LATE: usize = 6;

/// The command of so many steps ago acts in place of the newest: `r = B u_{k-late} - B u_k`.
#[derive(Debug)]
struct Late {
    vehicle: SingleTrack,
    steps: usize,
}

impl RowResidual<ERRORS> for Late {
    fn window(&self) -> usize {
        self.steps + 1
    }

    fn row(
        &self,
        _: &[[f64; ERRORS]],
        road: &[f64; ROAD],
        command: &mut [[f64; ERRORS]],
    ) -> ([f64; ERRORS], f64) {
        // The controller does not predict at walking speed.
        if let Ok(model) = self.vehicle.model_at(road[0].max(1.5)) {
            let b: [f64; ERRORS] = model.discretise(TS).b.into();
            command[self.steps] = b.map(|x| -x);
            command[0] = b;
        }
        ([0.0; ERRORS], 0.0)
    }
}

impl LinearResidual<SingleTrack, ERRORS> for Late {
    fn window(&self) -> usize {
        RowResidual::window(self)
    }

    fn check_fits(&self, expected: &Expected<SingleTrack>) -> Result<(), ModelMismatch> {
        if expected.sample_time == TS {
            return Ok(());
        }
        Err(ModelMismatch::SampleTime { model: TS, controller: expected.sample_time })
    }

    fn rows(self: Arc<Self>, horizon: usize) -> Box<dyn ResidualRows<ERRORS>> {
        Box::new(EachRow::new(self, horizon))
    }
}

/// The settings of the papers: they do not find out by themselves how late the steering is.
fn parameters() -> ControllerParameters {
    ControllerParameters::of_the_papers(&builtin("c_class").unwrap())
}

fn late() -> PredictionModel {
    PredictionModel::Residual(Residual {
        model: Arc::new(Late { vehicle: parameters().vehicle.single_track(), steps: LATE }),
        propagation: Propagation::Propagated,
        roll_out: RollOut::Nominal,
    })
}

fn closed_loop(model: PredictionModel) -> ClosedLoop {
    let road = Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let controller = Controller::predicting_with(parameters(), road, model).unwrap();
    let effects = Effects { steer_delay: LATE as f64 * TS, ..Effects::default() };
    ClosedLoop::at_start(controller, &builtin("c_class").unwrap(), &effects, TS).unwrap()
}

/// Root mean square of the lateral error over the first 30 s, m.
fn error(model: PredictionModel) -> f64 {
    let mut closed = closed_loop(model);
    let mut sum = 0.0;
    for _ in 0..1500 {
        closed.advance().unwrap();
        sum += closed.lateral_error().powi(2);
    }
    (sum / 1500.0_f64).sqrt()
}

#[test]
fn the_controller_drives_with_it() {
    // It is that of an actuator with this dead time, which the controller knows, too.
    let known = Actuator { dead_time: LATE as f64 * TS, ..Actuator::default() };
    let (without, with) = (error(PredictionModel::Nominal), error(late()));
    let by_actuator = error(PredictionModel::Actuator(known));
    assert!((with / by_actuator - 1.0).abs() < 0.01, "{with} {by_actuator} {without}");
    assert!(with < 0.8 * without, "{with} {by_actuator} {without}");
}

#[test]
fn a_control_step_with_it_allocates_nothing() {
    let mut closed = closed_loop(late());
    for _ in 0..100 {
        closed.advance().unwrap();
    }
    let at = SimulatedVehicle::measured(closed.vehicle());
    let road = Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let mut controller = Controller::predicting_with(parameters(), road, late()).unwrap();
    controller.step(&at).unwrap();
    let allocations = allocated(|| assert!(controller.step(&at).is_ok())).0;
    assert_eq!(allocations, 0);
}

#[test]
fn it_is_refused_for_another_sample_time() {
    let mut parameters = parameters();
    parameters.mpc.sample_time = 0.01;
    let road = Arc::new(Path::from_samples(Route::SudokuTurns.samples(), Closure::Detect).unwrap());
    let error = Controller::predicting_with(parameters, road, late()).err().unwrap().to_string();
    assert!(error.contains("0.02") && error.contains("0.01"), "{error}");
}
