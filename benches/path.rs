//! Path queries of a controller in each step: a projection with a hint, and a horizon of curvatures.

use criterion::{Criterion, criterion_group, criterion_main};
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path, SpeedLimits, SpeedPlan};
use std::hint::black_box;

fn path_lookups(criterion: &mut Criterion) {
    let path = Path::from_samples(Route::SudokuTrain.samples(), Closure::Open).expect("our own course");
    let plan = SpeedPlan::new(&path, &SpeedLimits::default());
    let length = path.length();
    // Stations all over the road, so that no cache holds them all.
    let next = |station: &mut f64| {
        *station = (*station + 617.3) % (length - 60.0);
        *station
    };

    let mut station = 0.0;
    criterion.bench_function("project, hint 0.3 m behind", |bench| {
        bench.iter(|| {
            let s = next(&mut station);
            let point = path.at(s + 0.3);
            black_box(path.project(point.x + 0.1, point.y, point.yaw, Some(s)))
        });
    });
    criterion.bench_function("project, no hint, 5.7 km", |bench| {
        bench.iter(|| {
            let point = path.at(next(&mut station));
            black_box(path.project(point.x + 0.1, point.y, point.yaw, None))
        });
    });
    criterion.bench_function("60 curvatures, 0.3 m apart", |bench| {
        bench.iter(|| {
            let s = next(&mut station);
            (0..60)
                .map(|j| path.curvature(s + 0.3 * f64::from(j)))
                .fold(0.0, |sum, curvature| sum + curvature)
        });
    });
    criterion.bench_function("60 planned speeds, 0.3 m apart", |bench| {
        bench.iter(|| {
            let s = next(&mut station);
            (0..60).map(|j| plan.speed(s + 0.3 * f64::from(j))).fold(0.0, |sum, speed| sum + speed)
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).measurement_time(std::time::Duration::from_secs(1));
    targets = path_lookups
}
criterion_main!(benches);
