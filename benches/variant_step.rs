//! What a learned residual adds to the control step: the nominal MPC and its variants side by side.
//! `cargo bench --bench variant_step`.
//!
//! Each controller drives its own vehicle, with the dead time and lag that its model was learned on, along the test
//! route; all make a step in turn, so that whatever else the machine does, it does to all of them. Printed are the times
//! that the controllers themselves report, and ratios to the nominal controller of the same run.
//!
//! With `--profile NAME` (`nominal`, `rtl`, .. or `truck_nominal`, `truck_rfl`) that controller alone drives, for callgrind.

use rfl_mpc::control::{
    ControllerFor, ControllerParametersFor, PredictionModelFor, Propagation, Residual, RollOut,
    VehicleParameters,
};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::residual::{DataConfig, DataSet, Kind, TrainConfig, train};
use rfl_mpc::simulate::{ClosedLoopFor, SimulatedVehicle, TimeMetrics};
use rfl_mpc::vehicle::{Car, Effects, Truck, TruckEffects, builtin, builtin_truck};
use std::sync::Arc;

/// Seconds of the drive that teaches, and of those that are timed.
const LEARNED: f64 = 250.0;
const TIMED: f64 = 60.0;
const SAMPLE_TIME: f64 = 0.02;

type Vehicle<P, const S: usize, const C: usize> =
    <<P as SimulatedVehicle<S, C>>::Nominal as VehicleParameters<S>>::Vehicle;
type Model<P, const S: usize, const C: usize> = PredictionModelFor<Vehicle<P, S, C>, S>;

/// A vehicle, its delay and where it learns and is timed.
struct Plant<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> {
    parameters: P::Parameters,
    effects: P::Effects,
    training: Route,
    test: Route,
    /// Weights, calm enough for learning.
    calm: ControllerParametersFor<P::Nominal>,
    /// Weights of the timed drives.
    timed: ControllerParametersFor<P::Nominal>,
}

impl<P: SimulatedVehicle<S, C>, const S: usize, const C: usize> Plant<P, S, C> {
    fn connect(
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
    fn learn(&self, kind: Kind, window: usize) -> Model<P, S, C> {
        let mut closed = self.connect(self.training, self.calm, PredictionModelFor::Nominal);
        let log = closed.drive(LEARNED, |_| ()).expect("the drive goes on").to_learn_from();
        let data = DataConfig { sample_time: SAMPLE_TIME, min_model_speed: self.calm.mpc.min_model_speed };
        let data = DataSet::new(&[log], &self.calm.vehicle.nominal(), data).expect("a sound drive");
        let config = TrainConfig { window, ..TrainConfig::new(kind) };
        let model = Arc::new(train(&data, None, &config, &|_| ()).expect("a sound drive").model);
        let (propagation, roll_out) = (Propagation::Propagated, RollOut::Corrected);
        PredictionModelFor::Residual(Residual { model, propagation, roll_out })
    }

    /// Drives all in turn, a step each, and prints what the steps took.
    fn time(&self, group: &str, models: Vec<(&str, Model<P, S, C>)>) {
        let mut all: Vec<_> = models
            .into_iter()
            .map(|(name, model)| (name, self.connect(self.test, self.timed, model), vec![]))
            .collect();
        for _ in 0..(TIMED / SAMPLE_TIME) as usize {
            for (_, closed, times) in &mut all {
                times.extend(closed.advance().expect("the drive goes on").1);
            }
        }
        let mut nominal = None;
        println!("{group}: {TIMED} s of the test route, us");
        for (name, _, times) in &mut all {
            let mean = times.iter().sum::<f64>() / times.len() as f64;
            let TimeMetrics { p99_s, .. } = TimeMetrics::of(times, SAMPLE_TIME);
            times.sort_by(f64::total_cmp);
            let [fast, median] = [10, 2].map(|share| times[times.len() / share]);
            let of = *nominal.get_or_insert([fast, median]);
            println!(
                "  {name:10} median {:7.2} ({:4.2} x nominal)   10th percentile {:7.2} ({:4.2} x)   mean {:7.2}   p99 {:7.2}",
                1e6 * median,
                median / of[1],
                1e6 * fast,
                fast / of[0],
                1e6 * mean,
                1e6 * p99_s
            );
        }
    }
}

fn car() -> Plant<Car, 4, { rfl_mpc::simulate::CAR_COLUMNS }> {
    let parameters = builtin("c_class").expect("the default car");
    let timed = <Car as SimulatedVehicle<4, _>>::controller(&parameters);
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

fn truck() -> Plant<Truck, 6, { rfl_mpc::simulate::TRUCK_COLUMNS }> {
    let parameters = builtin_truck("truck_simulation").expect("the truck");
    let mut calm = <Truck as SimulatedVehicle<6, _>>::controller(&parameters);
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
const CAR_WINDOW: usize = 28;
const TRUCK_WINDOW: usize = 60;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let alone = arguments.iter().position(|argument| argument == "--profile");
    let alone = alone.and_then(|at| arguments.get(at + 1)).cloned();
    let wanted = |name: &str| alone.as_deref().is_none_or(|alone| alone == name);

    let car = car();
    let mut models = vec![];
    if wanted("nominal") {
        models.push(("nominal", PredictionModelFor::Nominal));
    }
    for (name, kind) in [("rtl", Kind::Rtl), ("rfl", Kind::Rfl), ("rfl_s", Kind::RflS)] {
        if wanted(name) {
            models.push((name, car.learn(kind, CAR_WINDOW)));
        }
    }
    if wanted("rfl_16") {
        models.push(("rfl, W=16", car.learn(Kind::Rfl, 16)));
    }
    if !models.is_empty() {
        car.time("car, N = 16, W = 28", models);
    }

    let truck = truck();
    let mut models = vec![];
    if wanted("truck_nominal") {
        models.push(("nominal", PredictionModelFor::Nominal));
    }
    if wanted("truck_rfl") {
        models.push(("rfl", truck.learn(Kind::Rfl, TRUCK_WINDOW)));
    }
    if !models.is_empty() {
        truck.time("truck, N = 60, W = 60", models);
    }
}
