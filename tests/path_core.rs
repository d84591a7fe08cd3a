//! A circle's path against closed forms.
use rfl_mpc::path::{Closure, Path, Sample, SpeedLimits, SpeedPlan};
use std::f64::consts::TAU;

fn circle(radius: f64, count: usize) -> Path {
    let samples = (0..count)
        .map(|i| {
            let angle = TAU * i as f64 / count as f64;
            Sample::at(radius * angle.cos(), radius * angle.sin())
        })
        .collect();
    Path::from_samples(samples, Closure::Detect).unwrap()
}

#[test]
fn a_circle_has_its_length_curvature_and_distance() {
    let path = circle(50.0, 314);
    assert!(path.is_periodic());
    assert!((path.length() - TAU * 50.0).abs() < 1e-4, "{}", path.length());
    for i in 0..1000 {
        let s = 0.7 * f64::from(i);
        let point = path.at(s);
        assert!((point.curvature - 0.02).abs() < 1e-5);
        assert!((point.x.hypot(point.y) - 50.0).abs() < 1e-5);
        let (sin, cos) = point.yaw.sin_cos();
        let foot = path.project(point.x - 0.8 * sin, point.y + 0.8 * cos, point.yaw + 0.1, Some(s - 1.0));
        assert!((foot.e1 - 0.8).abs() < 1e-9, "{foot:?}");
        assert!((foot.e2 - 0.1).abs() < 1e-9);
        let wrapped = (foot.station - s).rem_euclid(path.length());
        assert!(wrapped.min(path.length() - wrapped) < 1e-7, "{s} {foot:?}");
    }
    let plan =
        SpeedPlan::new(&path, &SpeedLimits { lateral_accel: 2.0, accel: 1.0, decel: 1.0, speed: 30.0 });
    assert!((plan.speed(10.0) - 10.0).abs() < 1e-2);
}

#[test]
fn real_roads_are_read_where_present() {
    for name in ["tum_Norisring", "tum_BrandsHatch", "genesis_cpg_winding_lap"] {
        let file =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../shared/data/paths/{name}.csv"));
        if !file.exists() {
            eprintln!("SKIPPED {name}: {} is not there", file.display());
            continue;
        }
        let path = Path::read(&file).unwrap();
        let peak = (0..(path.length() * 4.0) as usize)
            .map(|i| path.curvature(i as f64 / 4.0).abs())
            .fold(0.0, f64::max);
        println!(
            "{name}: {:.1} m, closed {}, least radius {:.2} m, {:?}",
            path.length(),
            path.is_periodic(),
            1.0 / peak,
            path.notes()
        );
    }
}
