//! What a learned residual adds to the control step: nominal controllers and learned ones side by side.
//!
//! Each controller drives its own vehicle, with the dead time and lag that its model was learned on, along the test
//! route; all make a step in turn, so that whatever else the machine does, it does to all of them. Times are those that
//! the controllers themselves report.

use rfl_mpc::control::{
    ControlledParameters, ControllerFor, ControllerParametersFor, PredictionModelFor, Propagation, Residual,
    RollOut,
};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::residual::{DataSet, Kind, TrainConfig, train};
use rfl_mpc::simulate::{CAR_COLUMNS, ClosedLoopFor, SimulatedVehicle, TRUCK_COLUMNS};
use rfl_mpc::vehicle::{Car, Effects, Truck, TruckEffects, builtin, builtin_truck};
use std::sync::Arc;

/// Seconds of the drive that teaches, and of those that are timed.
const LEARNED: f64 = 250.0;
pub const TIMED: f64 = 60.0;
pub const SAMPLE_TIME: f64 = 0.02;

type Vehicle<P, const S: usize, const C: usize> =
    <<P as SimulatedVehicle<S, C>>::Nominal as ControlledParameters<S>>::Vehicle;
pub type Model<P, const S: usize, const C: usize> = PredictionModelFor<Vehicle<P, S, C>, S>;

/// A vehicle, its delay and where it learns and is timed.
pub struct Plant<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> {
    pub parameters: P::Parameters,
    effects: P::Effects,
    training: Route,
    pub test: Route,
    /// Weights, calm enough for learning.
    pub calm: ControllerParametersFor<P::Nominal>,
    /// Weights of the timed drives.
    pub timed: ControllerParametersFor<P::Nominal>,
}

impl<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> Plant<P, S, C> {
    /// A controller and its vehicle at the start of a route.
    pub fn connect(
        &self,
        route: Route,
        parameters: ControllerParametersFor<P::Nominal>,
        model: Model<P, S, C>,
    ) -> ClosedLoopFor<P, S, C> {
        let path = Arc::new(route.path().expect("our own course"));
        let controller =
            ControllerFor::predicting_with(parameters, path, model).expect("the defaults are sound");
        let closed = ClosedLoopFor::at_start(controller, &self.parameters, &self.effects, SAMPLE_TIME);
        closed.unwrap_or_else(|error| panic!("sound parameters: {error}"))
    }

    /// A residual learned on the training route.
    pub fn learn(&self, kind: Kind, window: usize) -> Model<P, S, C> {
        let mut closed = self.connect(self.training, self.calm, PredictionModelFor::Nominal);
        let log = closed.drive(LEARNED, |_| ()).expect("the drive goes on").to_learn_from();
        let data = self.calm.data_config();
        let data = DataSet::new(&[log], &self.calm.vehicle.nominal(), data).expect("a sound drive");
        let config = TrainConfig { window, ..TrainConfig::new(kind) };
        let model = Arc::new(train(&data, None, &config, &|_| ()).expect("a sound drive").model);
        let (propagation, roll_out) = (Propagation::Propagated, RollOut::Corrected);
        PredictionModelFor::Residual(Residual { model, propagation, roll_out })
    }

    /// Drives all in turn, a step each: the seconds of each one's steps, sorted.
    pub fn time<'a>(&self, models: Vec<(&'a str, Model<P, S, C>)>) -> Vec<(&'a str, Vec<f64>)> {
        let mut all: Vec<_> = models
            .into_iter()
            .map(|(name, model)| (name, self.connect(self.test, self.timed, model), vec![]))
            .collect();
        for _ in 0..(TIMED / SAMPLE_TIME) as usize {
            for (_, closed, times) in &mut all {
                times.extend(closed.advance().expect("the drive goes on").1);
            }
        }
        let sorted = all.into_iter().map(|(name, _, mut times)| {
            times.sort_by(f64::total_cmp);
            (name, times)
        });
        sorted.collect()
    }
}

/// The value that a share of sorted ones is not above.
pub fn percentile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

/// A car with a slow steering, as its model was learned on.
pub fn car() -> Plant<Car, 4, CAR_COLUMNS> {
    let parameters = builtin("c_class").expect("the default car");
    let timed = <Car as SimulatedVehicle<4, _>>::controller_of_the_papers(&parameters);
    let mut calm = timed;
    (calm.mpc.r_rate, calm.mpc.q_e1_rate, calm.mpc.q_e2, calm.mpc.dither) = (0.3, 1.0, 2.0, 0.01);
    Plant {
        parameters,
        effects: Effects { steer_lag: 0.1, steer_delay: 0.06, ..Effects::default() },
        training: Route::SudokuTrain,
        test: Route::SudokuTest,
        calm,
        timed,
    }
}

/// A truck likewise.
pub fn truck() -> Plant<Truck, 6, TRUCK_COLUMNS> {
    let parameters = builtin_truck("truck_simulation").expect("the truck");
    let mut calm = <Truck as SimulatedVehicle<6, _>>::controller_of_the_papers(&parameters);
    (calm.mpc.r_rate, calm.mpc.q_e1_rate, calm.mpc.q_e2) = (300.0, 3.0, 1000.0);
    calm.speed.limit = 8.0;
    // The same weights for both: the nominal controller, too, has to stay on the road.
    let timed = calm;
    calm.mpc.dither = 0.01;
    let mut effects = TruckEffects::default();
    (effects.vehicle.steer_delay, effects.vehicle.steer_lag) = (0.3, 0.2);
    Plant { parameters, effects, training: Route::TruckTrain, test: Route::TruckTest, calm, timed }
}

/// Windows that `rfl train` takes by default, in steps.
pub const CAR_WINDOW: usize = 28;
pub const TRUCK_WINDOW: usize = 60;
