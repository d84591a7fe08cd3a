//! Lookups, projections and the speed plan allocate nothing: they run inside a controller's step.

use crate::counting::allocated;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path, SpeedLimits, SpeedPlan};
use std::hint::black_box;

#[test]
fn nothing_is_allocated_after_loading() {
    for (route, closure) in [(Route::SudokuTest, Closure::Open), (Route::HairpinCircuit, Closure::Closed)] {
        let path = Path::from_samples(route.samples(), closure).unwrap();
        let plan = SpeedPlan::new(&path, &SpeedLimits::default());
        let (count, _) = allocated(|| {
            for i in 0..200 {
                let s = 3.0 * f64::from(i);
                let point = path.at(s);
                for hint in [None, Some(s), Some(s + 300.0)] {
                    black_box(path.project(point.x + 1.0, point.y, point.yaw, hint));
                }
                black_box(path.project(1e4, 1e4, 0.0, Some(s)));
                black_box((path.curvature(s), path.curvature_rate(s), plan.speed(s), plan.accel(s)));
            }
        });
        assert_eq!(count, 0, "{}", route.name());
    }
}
