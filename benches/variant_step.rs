//! Additional cost of a learned residual in the control step, in ratios to the nominal controller of the same run.
//! `cargo bench --bench variant_step`; see `examples/peers/steps.rs`.
//!
//! With `--profile NAME` (`nominal`, `rtl`, .. or `truck_nominal`, `truck_rfl`) that controller alone drives, for callgrind.

#[path = "../examples/peers/steps.rs"]
mod steps;

use rfl_mpc::control::PredictionModelFor;
use rfl_mpc::residual::Kind;
use steps::{CAR_WINDOW, TIMED, TRUCK_WINDOW, car, percentile, truck};

fn print(group: &str, times: &[(&str, Vec<f64>)]) {
    println!("{group}: {TIMED} s of the test route, us");
    let Some((_, nominal)) = times.first() else { return };
    for (name, times) in times {
        let [fast, median] = [0.1, 0.5].map(|share| percentile(times, share));
        println!(
            "  {name:10} median {:7.2} ({:4.2} x nominal)   10th percentile {:7.2} ({:4.2} x)   p99 {:7.2}",
            1e6 * median,
            median / percentile(nominal, 0.5),
            1e6 * fast,
            fast / percentile(nominal, 0.1),
            1e6 * percentile(times, 0.99),
        );
    }
}

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
        print("car, N = 16, W = 28", &car.time(models));
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
        print("truck, N = 60, W = 60", &truck.time(models));
    }
}
