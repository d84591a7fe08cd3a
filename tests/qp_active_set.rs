//! The active-set method finds Clarabel's solutions.

use rfl_mpc::control::{
    ActiveSetSolver, ClarabelSolver, Controller, ControllerParameters, QpSolver, TrackingQp,
};
use rfl_mpc::path::Path;
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Car, Effects, builtin};
use std::sync::Arc;

fn record(change: impl Fn(&mut ControllerParameters), beside: f64, steps: usize) -> Vec<TrackingQp> {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("paths/sudoku_turns.csv");
    let path = Arc::new(Path::read(&file).unwrap());
    let parameters = builtin("c_class").unwrap();
    let mut p = ControllerParameters::for_car(&parameters);
    change(&mut p);
    let controller = Controller::new(p, path.clone()).unwrap();
    let mut car = Car::new(&parameters, &Effects::default(), None).unwrap();
    let start = path.at(5.0);
    let (sin, cos) = start.yaw.sin_cos();
    car.place(start.x - beside * sin, start.y + beside * cos, start.yaw + 0.1 * beside, 2.0);
    let mut closed = ClosedLoop::new(controller, car, 0.02);
    (0..steps)
        .map(|_| {
            closed.advance().unwrap();
            closed.controller().problem().clone()
        })
        .collect()
}

fn compare(name: &str, problems: &[TrackingQp]) {
    let mut ours = ActiveSetSolver::new(&problems[0].shape);
    let mut clarabel = ClarabelSolver::exact(&problems[0]).unwrap();
    let n = problems[0].columns();
    let rows = problems[0].free.len();
    let (mut u, mut y) = (vec![0.0; n], vec![0.0; rows]);
    let (mut v, mut z) = (vec![0.0; n], vec![0.0; rows]);
    let (mut worst, mut worst_cost, mut most, mut failed, mut free) = (0.0_f64, 0.0_f64, 0, 0, 0);
    let (mut refused, mut reduced) = (0, 0);
    let mut worse = f64::NEG_INFINITY;
    let (mut t0, mut t1) = (vec![], vec![]);
    for problem in problems {
        let b = std::time::Instant::now();
        let a = ours.solve(problem, f64::INFINITY, &mut u, &mut y);
        t0.push(b.elapsed().as_secs_f64() * 1e6);
        let b = std::time::Instant::now();
        let c = match clarabel.solve(problem, f64::INFINITY, &mut v, &mut z) {
            Ok(c) => c,
            Err(e) => {
                refused += 1;
                if refused < 3 {
                    println!("clarabel {e:?}")
                };
                continue;
            }
        };
        reduced += usize::from(c.end == rfl_mpc::control::QpEnd::ReducedAccuracy);
        t1.push(b.elapsed().as_secs_f64() * 1e6);
        match a {
            Err(e) => {
                failed += 1;
                if failed < 3 {
                    println!("{e:?}");
                }
            }
            Ok(a) => {
                most = most.max(a.iterations);
                free += usize::from(a.iterations == 1);
                for (a, b) in u.iter().zip(&v) {
                    worst = worst.max((a - b).abs());
                }
                worst_cost = worst_cost.max((a.objective - c.objective).abs() / (1.0 + c.objective.abs()));
                worse = worse.max((a.objective - c.objective) / (1.0 + c.objective.abs()));
            }
        }
    }
    t0.sort_by(f64::total_cmp);
    t1.sort_by(f64::total_cmp);
    println!(
        "refused {refused} reduced {reduced} {name}: {} problems, {failed} failed, {free} unconstrained, most {most}, |du| {worst:.1e}, cost {worst_cost:.1e} {worse:.1e}; us {:.1}/{:.1}/{:.1} clarabel {:.1}",
        problems.len(),
        t0[t0.len() / 2],
        t0[t0.len() * 99 / 100],
        t0[t0.len() - 1],
        t1[t1.len() / 2]
    );
}

#[test]
fn probe() {
    for n in [2, 16, 60] {
        let steps = if n == 60 { 600 } else { 2000 };
        compare(&format!("drive {n}"), &record(|p| p.mpc.horizon = n, 0.0, steps));
        compare(&format!("beside {n}"), &record(|p| p.mpc.horizon = n, 3.0, steps / 4));
        compare(
            &format!("narrow {n}"),
            &record(
                |p| {
                    p.mpc.horizon = n;
                    p.mpc.e1_max = 0.01;
                },
                0.3,
                steps / 2,
            ),
        );
        compare(
            &format!("narrow0 {n}"),
            &record(
                |p| {
                    p.mpc.horizon = n;
                    p.mpc.e1_max = 0.01;
                    p.mpc.slack_linear = 0.0
                },
                0.3,
                steps / 4,
            ),
        );
        compare(
            &format!("slow {n}"),
            &record(
                |p| {
                    p.mpc.horizon = n;
                    p.mpc.steer_rate_max = 0.1;
                    p.mpc.steer_max = 0.05;
                },
                0.3,
                steps / 2,
            ),
        );
        compare(
            &format!("singular {n}"),
            &record(
                |p| {
                    p.mpc.horizon = n;
                    p.mpc.r_rate = 1e-9;
                },
                0.3,
                steps / 4,
            ),
        );
        compare(
            &format!("terminal {n}"),
            &record(
                |p| {
                    p.mpc.horizon = n;
                    p.mpc.terminal_factor = 1e4;
                },
                0.3,
                steps / 4,
            ),
        );
    }
}
