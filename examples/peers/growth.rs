//! How cost grows: with the horizon, the window, trees and their depth, training rows and the length of a log.
//!
//! Each table is one run in which all its entries take turns, so that a busy machine is busy for all of them.

use crate::steps::{Model, SAMPLE_TIME, car, percentile};
use crate::{Outcome, median_time, memory};
use rfl_mpc::control::{PredictionModelFor, Propagation, Residual, RollOut};
use rfl_mpc::numerics::Random;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::residual::{DataConfig, DataSet, Dense, Kind, LambdaChoice, TrainConfig, grow, train};
use rfl_mpc::simulate::{CAR_COLUMNS, ClosedLoop};
use rfl_mpc::vehicle::Car;
use serde_json::{Value, json};
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

type CarModel = Model<Car, 4, CAR_COLUMNS>;

/// Seconds of driving that models learn from, and that each controller is timed for.
const LEARNED: f64 = 120.0;
const TIMED: f64 = 10.0;

fn data(seconds: f64) -> Result<DataSet, Box<dyn Error>> {
    let car = car();
    let mut closed = car.connect(Route::SudokuTrain, car.calm, PredictionModelFor::Nominal);
    let log = closed.drive(seconds, |_| ())?.to_learn_from();
    let config = car.calm.data_config();
    Ok(DataSet::new(&[log], &rfl_mpc::control::ControlledParameters::nominal(&car.calm.vehicle), config)?)
}

/// A forest of linear leaves, of other sizes than by default.
fn learn(data: &DataSet, change: impl Fn(&mut TrainConfig)) -> Result<CarModel, Box<dyn Error>> {
    // Which shrinkage is best is no question of cost.
    let lambda = LambdaChoice::Fixed(1e-3);
    let mut config =
        TrainConfig { window: 28, lambda, global_lambda: vec![1e-6], ..TrainConfig::new(Kind::Rfl) };
    change(&mut config);
    let model = Arc::new(train(data, None, &config, &|_| ())?.model);
    let (propagation, roll_out) = (Propagation::Propagated, RollOut::Corrected);
    Ok(PredictionModelFor::Residual(Residual { model, propagation, roll_out }))
}

/// Median step times of controllers that take turns, in us.
fn steps(mut all: Vec<(usize, ClosedLoop)>) -> Result<Value, Box<dyn Error>> {
    let mut times = vec![vec![]; all.len()];
    for _ in 0..(TIMED / SAMPLE_TIME) as usize {
        for ((_, closed), times) in all.iter_mut().zip(&mut times) {
            times.extend(closed.advance()?.1);
        }
    }
    let rows = all.iter().zip(&mut times).map(|((size, _), times)| {
        times.sort_by(f64::total_cmp);
        (size.to_string(), json!(1e6 * percentile(times, 0.5)))
    });
    Ok(Value::Object(rows.collect()))
}

fn with_horizon(horizon: usize, model: CarModel) -> ClosedLoop {
    let car = car();
    let mut parameters = car.timed;
    parameters.mpc.horizon = horizon;
    car.connect(car.test, parameters, model)
}

/// Horizon, window, trees and depth.
fn of_steps() -> Result<Value, Box<dyn Error>> {
    const N: usize = 16;
    let data = data(LEARNED)?;
    let rfl = learn(&data, |_| ())?;
    let horizons = [8, 16, 30, 60, 90, 120];
    let of_horizon =
        |model: &CarModel| steps(horizons.iter().map(|&n| (n, with_horizon(n, model.clone()))).collect());
    let of_size = |sizes: &[usize], change: fn(&mut TrainConfig, usize)| {
        let all: Result<Vec<_>, Box<dyn Error>> = sizes
            .iter()
            .map(|&size| Ok((size, with_horizon(N, learn(&data, |config| change(config, size))?))))
            .collect();
        steps(all?)
    };
    Ok(json!({
        "horizon_nominal_us": of_horizon(&PredictionModelFor::Nominal)?,
        "horizon_rfl_us": of_horizon(&rfl)?,
        "window_rfl_us": of_size(&[8, 16, 28, 60, 120], |config, window| config.window = window)?,
        "trees_rfl_us": of_size(&[5, 10, 20, 40, 80, 160], |config, trees| config.trees = trees)?,
        // Leaves of few rows, so that trees get as deep as they may.
        "depth_rfl_us": of_size(&[2, 4, 6, 8, 10], |config, depth| {
            (config.depth, config.min_leaf) = (depth, 5);
        })?,
    }))
}

/// Columns of the table of random numbers, as `benches/residual.rs` has it.
const COLUMNS: usize = 64;

/// Seconds to grow 20 trees on a table of so many rows, and to look a row up in them; memory against the table's.
pub fn training(rows: usize) -> Outcome {
    let mut random = Random::new(1);
    let values: Vec<f64> = (0..rows * COLUMNS).map(|_| random.uniform()).collect();
    let labels: Vec<[f64; 4]> = values
        .chunks_exact(COLUMNS)
        .map(|x| {
            let step = f64::from(x[0] > 0.3);
            [step + x[1] * x[2], (4.0 * x[3]).sin() * step, x[4] * x[4] + x[0], x[5] - x[1]]
        })
        .collect();
    let config = crate::forest::config();
    let columns: Vec<u16> = (0..COLUMNS as u16).collect();
    let begin = Instant::now();
    let grown = grow(&Dense::new(&values, COLUMNS), &columns, &labels, &config, &|_| ());
    let seconds = begin.elapsed().as_secs_f64();
    let mut sum = 0;
    let look_up = median_time(201, || {
        for row in values.chunks_exact(COLUMNS).take(100) {
            grown.forest.look_up(row, |_, leaf| sum += leaf);
        }
    });
    std::hint::black_box(sum);
    let table = (size_of_val(&values[..]) + size_of_val(&labels[..])) as f64;
    Ok(json!({
        "train_s": seconds, "row_us": 1e6 * look_up / 100.0, "leaves": grown.forest.leaves(),
        "memory_over_data": memory("VmHWM:").map(|bytes| bytes / table),
    }))
}

/// Seconds to make samples of a log of so many seconds of driving, for each.
fn logs() -> Result<Value, Box<dyn Error>> {
    let mut rows = serde_json::Map::new();
    for seconds in [60.0, 240.0, 960.0] {
        let car = car();
        let mut closed = car.connect(Route::SudokuTrain, car.calm, PredictionModelFor::Nominal);
        let log = [closed.drive(seconds, |_| ())?.to_learn_from()];
        let config = DataConfig { min_model_speed: 1.0, ..DataConfig::default() };
        let vehicle = rfl_mpc::control::ControlledParameters::nominal(&car.calm.vehicle);
        let time = median_time(5, || {
            std::hint::black_box(DataSet::new(&log, &vehicle, config).is_ok());
        });
        rows.insert(seconds.to_string(), json!(1e3 * time));
    }
    Ok(Value::Object(rows))
}

/// All but training, which wants a process of its own for its memory.
pub fn run() -> Outcome {
    Ok(json!({ "steps": of_steps()?, "log_ms": logs()? }))
}

/// The model that the others are compared with.
pub fn learned() -> Result<CarModel, Box<dyn Error>> {
    learn(&data(LEARNED)?, |_| ())
}
