//! Quadratic programs of closed-loop drives, with our solutions and their times.
//!
//! Ordinary drives have few active bounds. The others here are driven into theirs: a car that starts beside its path,
//! steering that may hardly turn, an actuator that makes the nominal controller ring, tight soft bounds. One has a learned
//! residual, which perturbs the prediction in every step.

use crate::Outcome;
use crate::learned::{CAR, SLOW, collect};
use rfl_mpc::control::{
    Controller, ControllerParameters, MpcParameters, PredictionModel, Propagation, Residual, RollOut,
    TrackingQp, build_solver,
};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::{Kind, TrainConfig, train};
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Car, Effects, builtin};
use serde_json::{Value, json};
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

/// Steps from one of the problems that are spread over the drive to the next.
const SPREAD: usize = 40;
const REPEATS: usize = 9;

/// How a drive differs from the default.
pub struct Case {
    pub name: &'static str,
    /// Metres to the left of the path at the start.
    beside: f64,
    /// Time constant of the steering, s.
    lag: f64,
    /// Whether the controller has a learned residual.
    learned: bool,
    change: fn(&mut MpcParameters),
}

const ORDINARY: Case = Case { name: "ordinary", beside: 0.0, lag: 0.0, learned: false, change: |_| () };

pub const CASES: [Case; 9] = [
    ORDINARY,
    Case { name: "beside the path", beside: 1.5, change: |p| p.steer_rate_max = 0.2, ..ORDINARY },
    Case { name: "little steering", change: |p| p.steer_max = 0.12, ..ORDINARY },
    Case { name: "ringing", beside: 0.3, lag: 0.15, change: |p| p.r_rate = 0.01, ..ORDINARY },
    Case {
        name: "tight soft bounds",
        beside: 0.1,
        lag: SLOW,
        change: |p| (p.e1_max, p.slack_linear) = (0.01, 10.0),
        ..ORDINARY
    },
    // Far beside narrow soft bounds. The controller aims at a parallel path within them, so that none has to yield.
    Case {
        name: "narrow soft bounds",
        beside: 2.0,
        change: |p| (p.e1_max, p.steer_rate_max) = (0.2, 0.3),
        ..ORDINARY
    },
    Case { name: "all rate bounds", beside: 3.0, change: |p| p.steer_rate_max = 0.05, ..ORDINARY },
    // Hardly a cost on commands: its Hessian is nearly that of the outputs alone, which is singular.
    Case { name: "nearly singular", beside: 0.2, change: |p| p.r_rate = 1e-6, ..ORDINARY },
    Case { name: "learned residual", beside: 0.5, lag: SLOW, learned: true, ..ORDINARY },
];

/// Seconds of driving that are learned from.
const COLLECTED: f64 = 120.0;

/// The residual of the case that has one.
pub fn learn() -> Result<Residual, Box<dyn Error>> {
    let config = TrainConfig { window: 28, ..TrainConfig::new(Kind::RflS) };
    let model = Arc::new(train(&collect(COLLECTED)?, None, &config, &|_| ())?.model);
    Ok(Residual { model, propagation: Propagation::Propagated, roll_out: RollOut::Corrected })
}

/// The case's car at the start of the test route.
pub fn start(case: &Case, residual: &Residual, horizon: usize) -> Result<ClosedLoop, Box<dyn Error>> {
    let path = Arc::new(Path::from_samples(Route::SudokuTest.samples(), Closure::Detect)?);
    let car = builtin(CAR)?;
    let mut parameters = ControllerParameters::of_the_papers(&car);
    parameters.mpc.horizon = horizon;
    (case.change)(&mut parameters.mpc);
    let model = PredictionModel::from(case.learned.then(|| residual.clone()));
    let sample_time = parameters.mpc.sample_time;
    let controller = Controller::predicting_with(parameters, path.clone(), model)?;
    let effects = Effects { steer_lag: case.lag, ..Effects::default() };
    let mut car = Car::new(&car, &effects, None)?;
    let start = path.at(0.0);
    let (x, y) = (start.x - case.beside * start.yaw.sin(), start.y + case.beside * start.yaw.cos());
    car.place(x, y, start.yaw, controller.speed_plan().speed(0.0));
    Ok(ClosedLoop::new(controller, car, sample_time))
}

fn drive(
    case: &Case,
    residual: &Residual,
    horizon: usize,
    count: usize,
) -> Result<Vec<TrackingQp>, Box<dyn Error>> {
    let mut closed = start(case, residual, horizon)?;
    let mut problems = Vec::with_capacity(count);
    // Half of them one after the other from the start, where a car beside its path has most to do; half spread.
    let (dense, spread) = (count / 2, count - count / 2);
    for step in 0..dense + SPREAD * spread {
        closed.advance()?;
        if step < dense || (step - dense) % SPREAD == SPREAD - 1 {
            problems.push(closed.controller().problem().clone());
        }
    }
    Ok(problems)
}

/// A solution, and how long it took.
struct Solved {
    inputs: Vec<f64>,
    iterations: u32,
    seconds: f64,
}

/// Solves in the order of the drive, as a controller does: what a solver keeps is from the problem before. `solver` is as
/// `mpc.solver` numbers them.
fn solve(problems: &[TrackingQp], solver: usize) -> Result<Vec<Solved>, Box<dyn Error>> {
    let mut solver = build_solver(solver, problems.first().ok_or("no problems were recorded")?, 50)?;
    let mut times = vec![vec![]; problems.len()];
    let mut solved = vec![];
    for _ in 0..REPEATS {
        solved.clear();
        for (problem, times) in problems.iter().zip(&mut times) {
            let (mut inputs, mut outputs) = (vec![0.0; problem.columns()], vec![0.0; problem.free.len()]);
            let begin = Instant::now();
            let report = solver.solve(problem, f64::INFINITY, &mut inputs, &mut outputs)?;
            times.push(begin.elapsed().as_secs_f64());
            solved.push(Solved { inputs, iterations: report.iterations, seconds: 0.0 });
        }
    }
    for (solved, mut times) in solved.iter_mut().zip(times) {
        times.sort_by(f64::total_cmp);
        solved.seconds = times[times.len() / 2];
    }
    Ok(solved)
}

/// The solver that controllers have by default, and Clarabel alone.
const SOLVERS: [usize; 2] = [0, 1];

/// Writes `count` problems of each case for N = 16 and N = 60.
pub fn run(count: usize, file: &std::path::Path) -> Outcome {
    let residual = learn()?;
    let mut records: Vec<Value> = vec![];
    for horizon in [16, 60] {
        for case in &CASES {
            let failed = |error| format!("{}, N = {horizon}: {error}", case.name);
            let problems = drive(case, &residual, horizon, count).map_err(failed)?;
            let [default, clarabel] = SOLVERS.map(|solver| solve(&problems, solver));
            let (default, clarabel) = (default.map_err(failed)?, clarabel.map_err(failed)?);
            for ((problem, ours), clarabel) in problems.iter().zip(default).zip(clarabel) {
                records.push(json!({
                    "case": case.name, "problem": problem,
                    "inputs": ours.inputs, "seconds": ours.seconds, "iterations": ours.iterations,
                    "clarabel_inputs": clarabel.inputs, "clarabel_seconds": clarabel.seconds,
                }));
            }
        }
    }
    let out = std::io::BufWriter::new(std::fs::File::create(file)?);
    serde_json::to_writer(out, &records)?;
    Ok(json!({ "problems": records.len() }))
}
