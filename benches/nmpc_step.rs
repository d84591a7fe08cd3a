//! The step of nonlinear MPC, with and without a Gaussian process, beside the nominal one. `cargo bench --bench nmpc_step`.
//!
//! Each controller replays the measurements of its own drive on the Sudoku test route with the default car. Criterion
//! gives the median over the drive; p99 and max of the recorded drive and the number of QPs are printed after it.

use criterion::{Criterion, criterion_group, criterion_main};
use rfl_mpc::control::{BicycleModel, Controller, ControllerParameters, Measurement, PredictionModel};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path};
use rfl_mpc::residual::gp::{GpConfig, GpModel, train};
use rfl_mpc::residual::{DataConfig, DataSet, Drive};
use rfl_mpc::simulate::{ClosedLoop, TimeMetrics};
use rfl_mpc::vehicle::{Effects, builtin};
use std::hint::black_box;
use std::sync::Arc;

/// Seconds of the drive that are recorded.
const DURATION: f64 = 120.0;

fn controller(
    route: Route,
    model: PredictionModel,
    change: impl Fn(&mut ControllerParameters),
) -> Controller {
    let path = Arc::new(Path::from_samples(route.samples(), Closure::Detect).expect("our own course"));
    let mut parameters = ControllerParameters::for_car(&builtin("c_class").expect("the default car"));
    change(&mut parameters);
    Controller::predicting_with(parameters, path, model).expect("the defaults are sound")
}

fn connect(controller: Controller) -> ClosedLoop {
    let car = builtin("c_class").expect("the default car");
    ClosedLoop::at_start(controller, &car, &Effects::default(), 0.02).expect("sound parameters")
}

/// A process of 300 points a component, learned on the training route.
fn process() -> Arc<GpModel> {
    let mut closed =
        connect(controller(Route::SudokuTrain, PredictionModel::Nominal, |p| p.mpc.dither = 0.005));
    let mut log = Drive { name: "collected".into(), ..Drive::default() };
    let vehicle = closed.controller().parameters().vehicle.single_track();
    for _ in 0..10_000 {
        let (row, _) = closed.advance().expect("the drive goes on");
        let at = closed.controller().report();
        let row = [
            row[0],
            at.steer_cmd,
            at.e1,
            at.e1_rate,
            at.e2,
            at.e2_rate,
            row[6],
            at.curvature,
            at.curvature_rate,
        ];
        log.columns_mut().into_iter().zip(row).for_each(|(column, value)| column.push(value));
    }
    let data = DataSet::new(&[log], &vehicle, DataConfig::default()).expect("a sound drive");
    let config = GpConfig { candidates: 2000, hyperparameter_samples: 250, starts: 1, ..GpConfig::default() };
    let model = train(&data, None, &config, &|_| ()).expect("a sound drive").model;
    println!("process with {:?} points", model.schema().outputs.iter().map(|o| o.points).collect::<Vec<_>>());
    Arc::new(model)
}

fn steps(criterion: &mut Criterion) {
    let gp = process();
    let nmpc = PredictionModel::Nonlinear(BicycleModel::default());
    let gp_nmpc = PredictionModel::Nonlinear(BicycleModel { gp: Some(gp), ..BicycleModel::default() });
    for (name, model) in [("nominal", PredictionModel::Nominal), ("nmpc", nmpc), ("gp_nmpc", gp_nmpc)] {
        for horizon in [16, 60] {
            let new = || controller(Route::SudokuTest, model.clone(), |p| p.mpc.horizon = horizon);
            let mut closed = connect(new());
            let (mut measurements, mut times, mut qps) = (Vec::new(), Vec::new(), [0_usize; 32]);
            for _ in 0..(DURATION / 0.02) as usize {
                let (row, time) = closed.advance().expect("the drive goes on");
                measurements.push(Measurement {
                    x: row[3],
                    y: row[4],
                    yaw: row[5],
                    vx: row[6],
                    vy: row[7],
                    yaw_rate: row[8],
                    steer: row[11],
                    ..Measurement::default()
                });
                times.extend(time);
                qps[closed.controller().lateral().qps() as usize] += 1;
            }
            let (mut replay, mut at) = (new(), 0);
            criterion.bench_function(&format!("step_{name}_{horizon}"), |bencher| {
                bencher.iter(|| {
                    let report = *replay.step(&measurements[at]).unwrap();
                    at = (at + 1) % measurements.len();
                    black_box(report)
                });
            });
            let TimeMetrics { mean_s, p99_s, max_s, .. } = TimeMetrics::of(&mut times, 0.02);
            println!(
                "step_{name}_{horizon} over {} steps of the drive: mean {:.0} us, p99 {:.0} us, max {:.0} us; steps with 1, 2, .. QPs {:?}",
                times.len(),
                1e6 * mean_s,
                1e6 * p99_s,
                1e6 * max_s,
                &qps[1..8]
            );
        }
    }
}

criterion_group!(benches, steps);
criterion_main!(benches);
