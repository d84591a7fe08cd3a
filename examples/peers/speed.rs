//! The whole control step of car and truck, nominal and with a learned residual, and the closed loop against real time.

use crate::steps::{CAR_WINDOW, TRUCK_WINDOW, car, percentile, truck};
use crate::{Outcome, median_time};
use rfl_mpc::control::PredictionModelFor::Nominal;
use rfl_mpc::residual::Kind;
use serde_json::json;

/// Seconds of driving against real time, and how often.
const DRIVEN: f64 = 60.0;
const DRIVES: usize = 5;

pub fn run() -> Outcome {
    let car = car();
    let mut of_car = vec![("nominal_16", Nominal)];
    for (name, kind) in [("rtl_16", Kind::Rtl), ("rfl_16", Kind::Rfl), ("rfl_s_16", Kind::RflS)] {
        of_car.push((name, car.learn(kind, CAR_WINDOW)));
    }
    let truck = truck();
    let of_truck =
        vec![("truck_nominal_60", Nominal), ("truck_rfl_60", truck.learn(Kind::Rfl, TRUCK_WINDOW))];
    let mut steps = serde_json::Map::new();
    for (name, times) in car.time(of_car).into_iter().chain(truck.time(of_truck)) {
        let [fast, median, p99] = [0.1, 0.5, 0.99].map(|share| 1e6 * percentile(&times, share));
        steps.insert(name.to_owned(), json!({ "median_us": median, "p99_us": p99, "p10_us": fast }));
    }
    let seconds = median_time(DRIVES, || {
        let mut closed = car.connect(car.test, car.timed, Nominal);
        std::hint::black_box(closed.drive(DRIVEN, |_| ()).is_ok());
    });
    Ok(json!({ "step": steps, "closed_loop_x_real_time": DRIVEN / seconds }))
}
