//! Many vehicles in one process, with one model and one road between them: what a step costs, and memory. Each has a
//! controller of its own, or one controller serves them all, with a state of each.
//!
//! Each vehicle is at a place of its own of one recorded drive, so that all the road and all the model are asked, and all
//! step in turn, so that between two steps of one everything else of the process was needed. Vehicles are not simulated.

use crate::steps::{Model, SAMPLE_TIME, TIMED, car};
use crate::{Outcome, memory};
use rfl_mpc::control::{Controller, ControllerError, Measurement, StepError};
use rfl_mpc::simulate::{CAR_COLUMNS, SimulatedVehicle};
use rfl_mpc::vehicle::Car;
use serde_json::json;
use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

type CarModel = Model<Car, 4, CAR_COLUMNS>;

const COUNTS: [usize; 5] = [1, 10, 100, 1000, 3000];
/// Steps of each vehicle before any is timed: the first one looks everything up and touches its memory first, and a
/// window fills.
const BEFORE: usize = 40;
/// Steps of each vehicle that are timed, at least.
const LEAST: usize = 20;
/// Numbers of vehicles take turns so many times.
const REPEATS: usize = 5;
/// Neighbours in the turn are far apart on the road: what one has just looked up is not what the next one needs.
const STRIDE: usize = 7919;
/// Steps of one controller before each of which the caches are emptied, by numbers that are more than they hold.
const COLD: usize = 200;
const EMPTYING: usize = 1 << 25;

/// Vehicles that are controlled: what each has of its own, and where in the drive it is.
type Fleet<T> = [(T, usize)];

/// Spread over a drive, each with room for so many steps.
fn spread<T>(
    count: usize,
    room: usize,
    each: impl Fn() -> Result<T, ControllerError>,
) -> Result<Vec<(T, usize)>, ControllerError> {
    (0..count).map(|k| Ok((each()?, k * STRIDE % count * room / (count - 1).max(1)))).collect()
}

/// So many steps of each vehicle, one of each in turn, shared out among threads with a worker each: seconds of a step.
fn go<W: Send, T: Send>(
    drive: &[Measurement],
    workers: &mut [W],
    fleet: &mut Fleet<T>,
    steps: usize,
    step: impl Fn(&mut W, &mut T, &Measurement) -> Result<f64, StepError> + Sync,
) -> f64 {
    let share = fleet.len().div_ceil(workers.len());
    let count = steps * fleet.len();
    let go = |worker: &mut W, fleet: &mut Fleet<T>| {
        for _ in 0..steps {
            for (own, at) in fleet.iter_mut() {
                black_box(step(worker, own, &drive[*at]).expect("what was measured is finite"));
                *at += 1;
            }
        }
    };
    let begin = Instant::now();
    if let [worker] = workers {
        go(worker, fleet);
    } else {
        std::thread::scope(|scope| {
            for (fleet, worker) in fleet.chunks_mut(share).zip(workers) {
                scope.spawn(|| go(worker, fleet));
            }
        });
    }
    begin.elapsed().as_secs_f64() / count as f64
}

/// What the vehicle measures on the test route under a controller with the model.
fn record(model: &CarModel) -> Result<Vec<Measurement>, Box<dyn Error>> {
    let car = car();
    let mut driver = car.connect(car.test, car.timed, model.clone());
    let drive = (0..(TIMED / SAMPLE_TIME) as usize).map(|_| {
        let seen = SimulatedVehicle::<4, CAR_COLUMNS>::measured(driver.vehicle());
        driver.advance().map(|_| seen)
    });
    Ok(drive.collect::<Result<_, _>>()?)
}

/// What was measured of so many vehicles, repeat by repeat.
#[derive(Default)]
struct Measured {
    first: Vec<f64>,
    alone: Vec<f64>,
    shared: Vec<f64>,
    kib: Vec<f64>,
}

impl Measured {
    /// The first step of each, then steps in one thread, then in two.
    fn add<W: Send, T: Send>(
        &mut self,
        drive: &[Measurement],
        workers: &mut [W; 2],
        fleet: &mut Fleet<T>,
        steps: usize,
        step: impl Fn(&mut W, &mut T, &Measurement) -> Result<f64, StepError> + Sync,
    ) {
        self.first.push(go(drive, &mut workers[..1], fleet, 1, &step));
        go(drive, &mut workers[..1], fleet, BEFORE - 1, &step);
        self.alone.push(go(drive, &mut workers[..1], fleet, steps, &step));
        self.shared.push(go(drive, workers, fleet, steps, &step));
    }

    fn row(mut self) -> serde_json::Value {
        let middle = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).map(|seconds| 1e6 * seconds)
        };
        json!({
            "first_step_us": middle(&mut self.first),
            "step_us": middle(&mut self.alone),
            "step_us_2_threads": middle(&mut self.shared),
            // Later, there is memory from before.
            "kib": self.kib.first(),
        })
    }
}

/// A step of one controller that finds nothing in the caches, in us: what one costs where others work between its steps.
fn cold(drive: &[Measurement], controller: &mut Controller) -> f64 {
    let mut numbers = vec![0_u64; EMPTYING];
    let mut times: Vec<f64> = drive
        .iter()
        .take(BEFORE + COLD)
        .map(|seen| {
            numbers.iter_mut().for_each(|number| *number += 1);
            black_box(&mut numbers);
            let begin = Instant::now();
            black_box(controller.step(seen).expect("what was measured is finite"));
            1e6 * begin.elapsed().as_secs_f64()
        })
        .skip(BEFORE)
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Vehicles with a controller each, and vehicles that one controller of each thread serves; in one thread and in two.
pub fn run() -> Outcome {
    let model = &crate::growth::learned()?;
    let drive = record(model)?;
    let path = Arc::new(car().test.path()?);
    let new = || Controller::predicting_with(car().timed, path.clone(), model.clone());
    let mut of_each = COUNTS.map(|_| Measured::default());
    let mut of_one = COUNTS.map(|_| Measured::default());
    for _ in 0..REPEATS {
        for ((count, each), one) in COUNTS.into_iter().zip(&mut of_each).zip(&mut of_one) {
            let steps = ((drive.len() - BEFORE) / count / 2).max(LEAST);
            let room = drive.len() - BEFORE - 2 * steps;
            let mut served = [new()?, new()?];
            let mut states = spread(count, room, || Ok(served[0].state().clone()))?;
            one.add(&drive, &mut served, &mut states, steps, |controller, state, seen| {
                Ok(controller.step_for(state, seen)?.steer_cmd)
            });
            one.kib.push(postcard::to_allocvec(&states[0].0)?.len() as f64 / 1024.0);
            let before = memory("VmRSS:");
            let mut controllers = spread(count, room, new)?;
            each.add(&drive, &mut [(), ()], &mut controllers, steps, |(), controller, seen| {
                Ok(controller.step(seen)?.steer_cmd)
            });
            let after = memory("VmRSS:");
            each.kib
                .extend(before.zip(after).map(|(before, after)| (after - before) / (1024.0 * count as f64)));
        }
    }
    let rows = |measured: [Measured; COUNTS.len()]| -> serde_json::Value {
        let rows = COUNTS.into_iter().zip(measured).map(|(count, of)| (count.to_string(), of.row()));
        serde_json::Value::Object(rows.collect())
    };
    Ok(json!({ "cold_us": cold(&drive, &mut new()?), "each": rows(of_each), "one": rows(of_one) }))
}
