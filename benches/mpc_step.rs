//! The control step: whole, and its parts. `cargo bench --bench mpc_step`.
//!
//! Problems are those of a drive on the Sudoku test route with the default car, recorded once and replayed.
//! Criterion gives the median; the distribution over the drive (p99, max) is printed after it, because a
//! controller is judged by its slow steps.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use rfl_mpc::control::{
    ActiveSetSolver, ClarabelSolver, Controller, ControllerParameters, FastSolver, Measurement, QpSolver,
    TrackingQp,
};
use rfl_mpc::path::Path;
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Car, Effects, builtin};
use std::hint::black_box;
use std::sync::Arc;

/// Seconds of the drive that are recorded.
const DURATION: f64 = 120.0;

struct Recording {
    measurements: Vec<Measurement>,
    problems: Vec<TrackingQp>,
    times: Vec<f64>,
}

fn controller(horizon: usize) -> Controller {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../paths/sudoku_test.csv");
    let path = Arc::new(Path::read(&file).expect("the course comes with the project"));
    let car = builtin("c_class").expect("the default car is built in");
    let mut parameters = ControllerParameters::for_car(&car);
    parameters.mpc.horizon = horizon;
    Controller::new(parameters, path).expect("the defaults are sound")
}

fn record(horizon: usize) -> Recording {
    let controller = controller(horizon);
    let start = controller.path().at(0.0);
    let mut car = Car::new(&builtin("c_class").unwrap(), &Effects::default(), None).expect("the default car");
    car.place(start.x, start.y, start.yaw, 0.0);
    let sample_time = controller.parameters().mpc.sample_time;
    let mut closed = ClosedLoop::new(controller, car, sample_time);
    let mut recording = Recording { measurements: Vec::new(), problems: Vec::new(), times: Vec::new() };
    for _ in 0..(DURATION / sample_time) as usize {
        let (row, time) = closed.advance().expect("the drive goes on");
        recording.measurements.push(Measurement {
            x: row[3],
            y: row[4],
            yaw: row[5],
            vx: row[6],
            vy: row[7],
            yaw_rate: row[8],
            steer: row[11],
            ..Measurement::default()
        });
        recording.problems.push(closed.controller().problem().clone());
        recording.times.extend(time);
    }
    recording
}

/// The hardest problems of `recording`'s shape for the active-set method: 3 m beside the road.
fn hard_problems(horizon: usize) -> Vec<TrackingQp> {
    let controller = controller(horizon);
    let start = controller.path().at(30.0);
    let mut car = Car::new(&builtin("c_class").unwrap(), &Effects::default(), None).expect("the default car");
    let (sin, cos) = start.yaw.sin_cos();
    car.place(start.x - 3.0 * sin, start.y + 3.0 * cos, start.yaw + 0.35, 0.0);
    let mut closed = ClosedLoop::new(controller, car, 0.02);
    let problems = (0..500).map(|_| {
        closed.advance().expect("the drive goes on");
        closed.controller().problem().clone()
    });
    let mut solver = None;
    problems
        .filter(|problem| {
            let solver = solver.get_or_insert_with(|| ActiveSetSolver::new(&problem.shape));
            let (mut inputs, mut outputs) = (vec![0.0; horizon], vec![0.0; problem.free.len()]);
            solver
                .solve(problem, f64::INFINITY, &mut inputs, &mut outputs)
                .is_ok_and(|report| report.iterations > 5)
        })
        .collect()
}

/// Solves problems in turn, in an order that no cache or branch predictor knows from the drive.
fn bench_qp(criterion: &mut Criterion, name: &str, solver: &mut dyn QpSolver, problems: &[TrackingQp]) {
    let (mut inputs, mut outputs) = (vec![0.0; problems[0].columns()], vec![0.0; problems[0].free.len()]);
    let mut at = 0;
    criterion.bench_function(name, |bencher| {
        bencher.iter_batched(
            || {
                at = (at + 37) % problems.len();
                &problems[at]
            },
            |problem| solver.solve(problem, f64::INFINITY, &mut inputs, &mut outputs),
            BatchSize::SmallInput,
        );
    });
}

fn steps(criterion: &mut Criterion) {
    for horizon in [16, 60] {
        let mut recording = record(horizon);
        let mut replay = controller(horizon);
        let mut at = 0;
        criterion.bench_function(&format!("step_nominal_{horizon}"), |bencher| {
            bencher.iter(|| {
                let report = *replay.step(&recording.measurements[at]).unwrap();
                at = (at + 1) % recording.measurements.len();
                black_box(report)
            });
        });
        let typical = &recording.problems[0];
        let mut clarabel = ClarabelSolver::new(typical, 50).unwrap();
        let mut fast = FastSolver::new(typical, 50).unwrap();
        let hard = hard_problems(horizon);
        bench_qp(criterion, &format!("qp_clarabel_{horizon}"), &mut clarabel, &recording.problems);
        bench_qp(criterion, &format!("qp_fast_{horizon}"), &mut fast, &recording.problems);
        bench_qp(criterion, &format!("qp_clarabel_hard_{horizon}"), &mut clarabel, &hard);
        bench_qp(criterion, &format!("qp_fast_hard_{horizon}"), &mut fast, &hard);
        let times = &mut recording.times;
        times.sort_by(f64::total_cmp);
        let rank = |share: f64| (times.len() as f64 * share).ceil() as usize;
        let at = |share: f64| 1e6 * times[rank(share).saturating_sub(1)];
        println!(
            "step_nominal_{horizon} over {} steps of the drive: median {:.0} us, p99 {:.0} us, max {:.0} us",
            times.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        );
    }
}

criterion_group!(benches, steps);
criterion_main!(benches);
