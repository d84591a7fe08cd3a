//! Quadratic programs of closed-loop drives, with our solutions and their times.
//!
//! Ordinary drives have few active bounds. The others here are driven into theirs: a car that starts beside its path,
//! steering that may hardly turn, an actuator that makes the nominal controller ring, tight soft bounds. One has a learned
//! residual, which perturbs the prediction in every step.

use crate::Outcome;
use crate::learned::{CAR, SLOW, collect};
use rfl_mpc::control::{
    ClarabelSolver, Controller, ControllerParameters, MpcParameters, Propagation, QpSolver, Residual,
    RollOut, TrackingQp,
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
struct Case {
    name: &'static str,
    /// Metres to the left of the path at the start.
    beside: f64,
    /// Time constant of the steering, s.
    lag: f64,
    /// Whether the controller has a learned residual.
    learned: bool,
    change: fn(&mut MpcParameters),
}

const ORDINARY: Case = Case { name: "ordinary", beside: 0.0, lag: 0.0, learned: false, change: |_| () };

const CASES: [Case; 6] = [
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
    Case { name: "learned residual", beside: 0.5, lag: SLOW, learned: true, ..ORDINARY },
];

/// Seconds of driving that are learned from.
const COLLECTED: f64 = 120.0;

fn learn() -> Result<Residual, Box<dyn Error>> {
    let config = TrainConfig { window: 28, ..TrainConfig::new(Kind::RflS) };
    let model = Arc::new(train(&collect(COLLECTED)?, None, &config, &|_| ())?.model);
    Ok(Residual { model, propagation: Propagation::Propagated, roll_out: RollOut::Corrected })
}

fn drive(
    case: &Case,
    residual: &Residual,
    horizon: usize,
    count: usize,
) -> Result<Vec<TrackingQp>, Box<dyn Error>> {
    let path = Arc::new(Path::from_samples(Route::SudokuTest.samples(), Closure::Detect)?);
    let car = builtin(CAR)?;
    let mut parameters = ControllerParameters::for_car(&car);
    parameters.mpc.horizon = horizon;
    (case.change)(&mut parameters.mpc);
    let sample_time = parameters.mpc.sample_time;
    let controller =
        Controller::with_residual(parameters, path.clone(), case.learned.then(|| residual.clone()))?;
    let effects = Effects { steer_lag: case.lag, ..Effects::default() };
    let mut car = Car::new(&car, &effects, None)?;
    let start = path.at(0.0);
    let (x, y) = (start.x - case.beside * start.yaw.sin(), start.y + case.beside * start.yaw.cos());
    car.place(x, y, start.yaw, controller.speed_plan().speed(0.0));
    let mut closed = ClosedLoop::new(controller, car, sample_time);
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

/// A recorded problem with our solution.
struct Solved {
    problem: TrackingQp,
    inputs: Vec<f64>,
    iterations: u32,
    seconds: Vec<f64>,
}

/// Solves in the order of the drive, as a controller does: what a solver keeps is from the problem before.
fn solve(problems: Vec<TrackingQp>) -> Result<Vec<Solved>, Box<dyn Error>> {
    let mut solver = ClarabelSolver::new(problems.first().ok_or("no problems were recorded")?, 50)?;
    let unsolved = |problem: TrackingQp| Solved {
        inputs: vec![0.0; problem.columns()],
        iterations: 0,
        seconds: vec![],
        problem,
    };
    let mut all: Vec<Solved> = problems.into_iter().map(unsolved).collect();
    for _ in 0..REPEATS {
        for Solved { problem, inputs, iterations, seconds } in &mut all {
            let mut outputs = vec![0.0; problem.free.len()];
            let begin = Instant::now();
            let report = solver.solve(problem, f64::INFINITY, inputs, &mut outputs)?;
            seconds.push(begin.elapsed().as_secs_f64());
            *iterations = report.iterations;
        }
    }
    Ok(all)
}

/// Writes `count` problems of each case for N = 16 and N = 60.
pub fn run(count: usize, file: &std::path::Path) -> Outcome {
    let residual = learn()?;
    let mut records: Vec<Value> = vec![];
    for horizon in [16, 60] {
        for case in &CASES {
            let solved = drive(case, &residual, horizon, count).and_then(solve);
            let solved = solved.map_err(|error| format!("{}, N = {horizon}: {error}", case.name))?;
            records.extend(solved.into_iter().map(|Solved { problem, inputs, iterations, mut seconds }| {
                seconds.sort_by(f64::total_cmp);
                let seconds = seconds[seconds.len() / 2];
                let case = case.name;
                json!({"case": case, "problem": problem, "inputs": inputs, "seconds": seconds, "iterations": iterations})
            }));
        }
    }
    let out = std::io::BufWriter::new(std::fs::File::create(file)?);
    serde_json::to_writer(out, &records)?;
    Ok(json!({ "problems": records.len() }))
}
