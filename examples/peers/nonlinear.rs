//! Nonlinear MPC problems of a closed-loop drive with our solutions: NMPC, and with Gaussian processes GP-NMPC.
//!
//! Each problem is complete: another solver that is given these numbers solves the same problem. The curvature of the
//! road is a chain of parabolas in the station; for a solver that wants one formula for all of them there is also the
//! cubic that comes nearest over the stretch ahead.

use super::Outcome;
use super::learned::{CAR, SLOW, collect};
use nalgebra::{Matrix4, Vector4};
use rfl_mpc::control::{BicycleModel, ControlStatus, Controller, ControllerParameters, PredictionModel};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::gp::{GpConfig, GpModel, train};
use rfl_mpc::simulate::ClosedLoop;
use rfl_mpc::vehicle::{Effects, builtin};
use serde_json::{Value, json};
use std::sync::Arc;

/// Seconds of driving that the processes are learned from: several times round the training route.
const LEARNED_FROM: f64 = 600.0;
/// Longest cell of a path in m, and the parabola of curvature in each: see `src/path/grid.rs`.
const CELL: f64 = 0.25;

/// Parabolas `c0 + c1 u + c2 u^2` of the curvature from `from` to `to`, `u` counted from each one's station.
fn parabolas(path: &Path, from: f64, to: f64) -> Result<Vec<Value>, String> {
    let length = path.length();
    let step = length / (length / CELL).ceil();
    let (first, last) = ((from / step).floor() as usize, (to / step).ceil() as usize);
    (first..last)
        .map(|cell| {
            let begin = cell as f64 * step;
            // The ends of a cell may belong to its neighbours: three points within.
            let at = |share: f64| path.curvature(begin + share * step);
            let [a, b, c] = [0.25, 0.5, 0.75].map(at);
            let (square, middle_slope) = (8.0 * (a - 2.0 * b + c), 2.0 * (c - a));
            let linear = middle_slope - square;
            let c0 = b - 0.5 * linear - 0.25 * square;
            let check = c0 + 0.9 * (linear + 0.9 * square) - at(0.9);
            if check.abs() > 1e-10 {
                return Err(format!("the curvature is no parabola at station {begin} m: off by {check}"));
            }
            Ok(json!({ "station": begin, "coefficients": [c0, linear / step, square / (step * step)] }))
        })
        .collect()
}

/// The cubic in the distance from `from` that comes nearest to the curvature, by least squares.
fn cubic(path: &Path, from: f64, to: f64) -> Vec<f64> {
    let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for k in 0..=200 {
        let u = f64::from(k) / 200.0;
        let powers = Vector4::new(1.0, u, u * u, u * u * u);
        normal += powers * powers.transpose();
        right += powers * path.curvature(from + u * (to - from));
    }
    let coefficients = normal.lu().solve(&right).unwrap_or_default();
    (0..4).map(|i| coefficients[i] / (to - from).powi(i as i32)).collect()
}

/// The newest problem of a controller with its solution; `guess` is the plan that it began with.
fn problem(controller: &Controller, guess: &[f64]) -> Result<Option<Value>, String> {
    let (lateral, path) = (controller.lateral(), controller.path());
    let Some(roll_out) = lateral.roll_out() else { return Ok(None) };
    let (qp, plan) = (lateral.problem(), lateral.plan());
    let mpc = controller.parameters().mpc;
    let substeps: Vec<usize> =
        roll_out.speed.iter().map(|step| roll_out.model().substeps(step.speed[1], mpc.sample_time)).collect();
    let ahead: f64 = roll_out.speed.iter().map(|step| step.speed[1] * mpc.sample_time).sum();
    let (from, to) = (roll_out.start[0] - 0.1, roll_out.start[0] + 1.1 * ahead + 0.5);
    // Where a process fades, outside its training, it is another problem at each step.
    if roll_out.outside_training() > 0.0 {
        return Ok(None);
    }
    // One number of substeps for all steps keeps the other side simple.
    if substeps.iter().any(|count| *count != substeps[0]) || from < 0.0 || to > path.length() {
        return Ok(None);
    }
    let mut roll_out = roll_out.clone();
    let mut outputs_of = |plan: &[f64]| -> Vec<f64> {
        roll_out.follow(path, plan);
        (0..plan.len()).flat_map(|j| [0, 1, 2].map(|output| roll_out.errors(j)[output])).collect()
    };
    let outputs = outputs_of(plan);
    let timing = lateral.timing();
    let roll_out = lateral.roll_out().expect("it was there");
    Ok(Some(json!({
        "start": roll_out.start.as_slice(),
        "begin_speed": roll_out.speed.iter().map(|step| step.speed[0]).collect::<Vec<_>>(),
        "planned_speed": roll_out.speed.iter().map(|step| step.planned).collect::<Vec<_>>(),
        "accel": roll_out.speed[0].accel,
        "mean_speed": roll_out.speed.iter().map(|step| step.speed[1]).collect::<Vec<_>>(),
        "end_speed": roll_out.speed.iter().map(|step| step.speed[2]).collect::<Vec<_>>(),
        "substeps": substeps[0],
        "previous": qp.previous[0],
        "reference": qp.reference,
        "curvature": parabolas(path, from, to)?,
        "curvature_cubic": { "station": from, "coefficients": cubic(path, from, to) },
        "guess": guess,
        "plan": plan,
        "objective": qp.objective(plan, &outputs),
        "qps": lateral.qps(),
        "seconds": timing.look_up + timing.condense + timing.solve,
    })))
}

/// The processes as numbers: `mean(z) = sum_i weight_i signal^2 exp(-1/2 |(z - point_i) / length_scales|^2)`.
fn processes(model: &GpModel) -> Vec<Value> {
    let process = |gp: &rfl_mpc::residual::gp::Sparse<5>| {
        let kernel = gp.kernel();
        json!({ "length_scales": kernel.length_scales, "signal": kernel.signal,
            "points": gp.dictionary(), "weights": gp.weights() })
    };
    model.outputs().iter().map(process).collect()
}

/// `peers nonlinear`: so many problems with this horizon of a drive of the test route.
pub fn run(horizon: usize, count: usize, learned: bool) -> Outcome {
    let car = builtin(CAR)?;
    let path = Arc::new(Path::from_samples(Route::SudokuTest.samples(), Closure::Detect)?);
    let mut parameters = ControllerParameters::of_the_papers(&car);
    parameters.mpc.horizon = horizon;
    let gp = if learned {
        let data = collect(LEARNED_FROM)?;
        Some(Arc::new(train(&data, None, &GpConfig::default(), &|_| ())?.model))
    } else {
        None
    };
    let gps = gp.as_deref().map(processes);
    let model = BicycleModel { gp, ..BicycleModel::default() };
    let friction = model.friction;
    let controller = Controller::predicting_with(parameters, path, PredictionModel::Nonlinear(model))?;
    // A steering lag that the model does not know keeps the controller busy.
    let effects = Effects { steer_lag: SLOW, ..Effects::default() };
    let mut closed = ClosedLoop::at_start(controller, &car, &effects, parameters.mpc.sample_time)?;
    let (mut problems, mut k) = (Vec::new(), 0);
    let mut guess = vec![0.0; horizon];
    let every = (15_000 / count.max(1)).max(1);
    while problems.len() < count && !closed.controller().report().finished {
        closed.advance()?;
        k += 1;
        let controller = closed.controller();
        if k % every == every / 2 && controller.report().status == ControlStatus::Optimal {
            problems.extend(problem(controller, &guess)?);
        }
        guess.copy_from_slice(controller.lateral().plan());
        guess.rotate_left(1);
        guess[horizon - 1] = guess[horizon - 2];
    }
    let vehicle = parameters.vehicle;
    Ok(json!({
        "vehicle": {
            "mass": vehicle.mass, "yaw_inertia": vehicle.yaw_inertia, "lf": vehicle.lf, "lr": vehicle.lr,
            "cf": vehicle.front_stiffness, "cr": vehicle.rear_stiffness,
        },
        "processes": gps,
        "friction": friction,
        "sample_time": parameters.mpc.sample_time,
        "shape": closed.controller().problem().shape,
        "problems": problems,
    }))
}
