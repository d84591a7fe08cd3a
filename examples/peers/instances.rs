//! Many controllers in one process, with one model and one road between them: what a step costs, and memory.
//!
//! Each controller is at a place of its own of one recorded drive, so that all the road and all the model are asked, and all
//! step in turn, so that between two steps of one everything else of the process was needed. Vehicles are not simulated.

use crate::Outcome;
use crate::steps::{Model, SAMPLE_TIME, TIMED, car};
use rfl_mpc::control::{Controller, Measurement};
use rfl_mpc::path::Path;
use rfl_mpc::simulate::{CAR_COLUMNS, SimulatedVehicle};
use rfl_mpc::vehicle::Car;
use serde_json::json;
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

type CarModel = Model<Car, 4, CAR_COLUMNS>;

const COUNTS: [usize; 5] = [1, 10, 100, 1000, 3000];
/// Steps of each controller before any is timed: the first one looks everything up and touches its memory first, and a
/// window fills.
const BEFORE: usize = 40;
/// Steps of each controller that are timed, at least.
const LEAST: usize = 20;
/// Numbers of controllers take turns so many times.
const REPEATS: usize = 5;

/// Controllers, and where in the drive each of them is.
struct Fleet<'a> {
    drive: &'a [Measurement],
    all: Vec<(Controller, usize)>,
}

impl<'a> Fleet<'a> {
    /// Controllers that are spread over a drive, each with room for so many steps.
    fn new(
        count: usize,
        steps: usize,
        drive: &'a [Measurement],
        path: &Arc<Path>,
        model: &CarModel,
    ) -> Result<Self, Box<dyn Error>> {
        let parameters = car().timed;
        let last = drive.len() - steps;
        let all = (0..count).map(|k| {
            let controller = Controller::predicting_with(parameters, path.clone(), model.clone())?;
            Ok((controller, k * last / (count - 1).max(1)))
        });
        Ok(Self { drive, all: all.collect::<Result<_, Box<dyn Error>>>()? })
    }

    /// So many steps of each, one of each in turn: seconds of a step.
    fn go(&mut self, steps: usize, threads: usize) -> f64 {
        let drive = self.drive;
        let share = self.all.len().div_ceil(threads);
        let count = steps * self.all.len();
        let go = |all: &mut [(Controller, usize)]| {
            for _ in 0..steps {
                for (controller, at) in all.iter_mut() {
                    controller.step(&drive[*at]).expect("what was measured is finite");
                    *at += 1;
                }
            }
        };
        let begin = Instant::now();
        if threads == 1 {
            go(&mut self.all);
        } else {
            std::thread::scope(|scope| {
                self.all.chunks_mut(share).for_each(|all| _ = scope.spawn(move || go(all)));
            });
        }
        begin.elapsed().as_secs_f64() / count as f64
    }
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

/// Memory of this process that is in use, in bytes, where the system says.
pub fn memory(name: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024.0 * kib)
}

/// Controllers that step in turn in one thread, and shared out among two.
pub fn run(model: &CarModel) -> Outcome {
    let drive = record(model)?;
    let path = Arc::new(car().test.path()?);
    let mut measured = COUNTS.map(|count| (count, vec![], vec![], vec![], vec![]));
    for _ in 0..REPEATS {
        for (count, first, alone, shared, kib) in &mut measured {
            let steps = ((drive.len() - BEFORE) / *count / 2).max(LEAST);
            let before = memory("VmRSS:");
            let mut fleet = Fleet::new(*count, BEFORE + 2 * steps, &drive, &path, model)?;
            first.push(fleet.go(1, 1));
            fleet.go(BEFORE - 1, 1);
            alone.push(fleet.go(steps, 1));
            shared.push(fleet.go(steps, 2));
            let each = |(before, after): (f64, f64)| (after - before) / (1024.0 * *count as f64);
            kib.extend(before.zip(memory("VmRSS:")).map(each));
        }
    }
    let middle = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let rows = measured.map(|(count, mut first, mut alone, mut shared, kib)| {
        let us = |values| middle(values).map(|seconds| 1e6 * seconds);
        let row = json!({
            "first_step_us": us(&mut first),
            "step_us": us(&mut alone),
            "step_us_2_threads": us(&mut shared),
            // Later, there is memory from before.
            "kib": kib.first(),
        });
        (count.to_string(), row)
    });
    Ok(serde_json::Value::Object(rows.into_iter().collect()))
}
