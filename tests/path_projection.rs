//! The nearest point: offsets come back, and the right branch is found where a road meets itself.

use proptest::prelude::*;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{Closure, Path, Projection, RoadClass, Sample, Where, wrap_angle};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::LazyLock;

static TRAIN: LazyLock<Path> = LazyLock::new(|| path_of(Route::SudokuTrain));
static CIRCUIT: LazyLock<Path> = LazyLock::new(|| path_of(Route::HairpinCircuit));

fn path_of(route: Route) -> Path {
    let course = route.course();
    let closure = if course.closed { Closure::Closed } else { Closure::Open };
    Path::from_samples(route.samples(), closure).unwrap()
}

/// Projects the point `d` to the left of station `s`, turned by `turn`.
fn project(path: &Path, s: f64, d: f64, turn: f64, hint: Option<f64>) -> Projection {
    let point = path.at(s);
    let (sin, cos) = point.yaw.sin_cos();
    path.project(point.x - d * sin, point.y + d * cos, point.yaw + turn, hint)
}

/// Distance between stations, around a closed path.
fn apart(path: &Path, a: f64, b: f64) -> f64 {
    let d = (a - b).abs();
    if path.is_periodic() {
        d.rem_euclid(path.length()).min(path.length() - d.rem_euclid(path.length()))
    } else {
        d
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn an_offset_comes_back_with_a_hint(s in 0.0..5700.0f64, d in -3.0..3.0f64, turn in -3.1..3.1f64, off in -4.0..4.0f64) {
        for path in [&*TRAIN, &*CIRCUIT] {
            let s = s % path.length();
            let foot = project(path, s, d, turn, Some(s + off));
            prop_assert!(apart(path, foot.station, s) < 1e-6, "{foot:?} for {s}");
            prop_assert!((foot.e1 - d).abs() < 1e-8);
            prop_assert!(wrap_angle(foot.e2 - turn).abs() < 1e-6);
            prop_assert!((foot.curvature - path.curvature(s)).abs() < 1e-6);
            prop_assert_eq!(foot.place, Where::Beside);
        }
    }

    /// Without a hint there may be a nearer branch with the same heading; it is never worse than the one asked for.
    #[test]
    fn an_offset_comes_back_without_a_hint(s in 0.0..5700.0f64, d in -1.0..1.0f64, turn in -0.3..0.3f64) {
        for path in [&*TRAIN, &*CIRCUIT] {
            let s = s % path.length();
            let foot = project(path, s, d, turn, None);
            let cost = |e1: f64, e2: f64| e1 * e1 + 18.0 * (1.0 - e2.cos());
            prop_assert!(cost(foot.e1, foot.e2) <= cost(d, turn) + 1e-6, "{foot:?} for {s}, {d}, {turn}");
            if apart(path, foot.station, s) < 1.0 {
                prop_assert!(apart(path, foot.station, s) < 1e-6 && (foot.e1 - d).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn nothing_makes_it_panic(
        x in any::<f64>(), y in any::<f64>(), yaw in any::<f64>(), hint in proptest::option::of(any::<f64>()),
    ) {
        for path in [&*TRAIN, &*CIRCUIT] {
            let foot = path.project(x, y, yaw, hint);
            prop_assert!(x.is_finite() || foot.e1.is_nan());
            let _ = path.at(foot.station);
        }
    }

    #[test]
    fn angles_wrap_into_the_half_open_circle(angle in -100.0..100.0f64) {
        let wrapped = wrap_angle(angle);
        prop_assert!(wrapped > -PI && wrapped <= PI);
        prop_assert!((wrapped.sin() - angle.sin()).abs() < 1e-12 && (wrapped.cos() - angle.cos()).abs() < 1e-12);
    }
}

#[test]
fn minus_pi_is_pi() {
    assert_eq!(wrap_angle(-PI), PI);
    assert_eq!(wrap_angle(PI), PI);
    assert_eq!(wrap_angle(3.0 * PI), PI);
}

/// A vehicle that drives the road, well beside it, with its last station as the hint, never leaves its branch.
#[test]
fn following_the_road_never_jumps() {
    for path in [&*TRAIN, &*CIRCUIT] {
        for side in [-2.5, -0.5, 0.0, 1.5, 3.0] {
            let mut hint = 0.0;
            let step = 0.4;
            for i in 0..(path.length() / step) as usize {
                let s = step * i as f64;
                let foot = project(path, s, side, 0.1, Some(hint));
                assert!(apart(path, foot.station, s) < 1e-6, "at {s}, {side} beside: {foot:?}");
                hint = foot.station;
            }
        }
    }
}

/// Out, a half circle of 3.5 m, and back 7 m beside; and the same with 7 m and 14 m.
#[test]
fn u_turns_keep_their_lanes() {
    for radius in [3.5, 7.0] {
        let out = (0..100).map(|i| Sample::at(f64::from(i), 0.0));
        let count = (PI * radius / 0.5).ceil();
        let turn = (0..count as usize).map(|i| {
            let angle = PI * i as f64 / count;
            Sample::at(100.0 + radius * angle.sin(), radius * (1.0 - angle.cos()))
        });
        let back = (0..100).map(|i| Sample::at(100.0 - f64::from(i), 2.0 * radius));
        let path = Path::from_samples(out.chain(turn).chain(back).collect(), Closure::Open).unwrap();
        // Half-way between the lanes and a little over: the hint holds the lane.
        let over = path.project(50.0, 1.2 * radius, 0.0, Some(50.0));
        assert!((over.station - 50.0).abs() < 0.01 && (over.e1 - 1.2 * radius).abs() < 0.01, "{over:?}");
        // Without a hint the heading decides.
        let east = path.project(50.0, 0.9 * radius, 0.0, None);
        let west = path.project(50.0, 1.1 * radius, PI, None);
        assert!((east.station - 50.0).abs() < 0.01 && west.station > 100.0, "{east:?} {west:?}");
        assert!(east.e2.abs() < 1e-3 && west.e2.abs() < 1e-3);
        // On the turn itself, inside and outside.
        let middle = 100.0 + 0.5 * PI * radius;
        for d in [-2.0, 0.8 * radius] {
            let foot = project(&path, middle, d, 0.0, Some(middle - 1.0));
            assert!((foot.e1 - d).abs() < 1e-6 && (foot.station - middle).abs() < 1e-4, "{foot:?}");
        }
    }
}

/// A figure of eight crosses itself at right angles.
#[test]
fn a_crossing_is_passed_on_ones_own_branch() {
    let count = 600;
    let samples: Vec<Sample> = (0..count)
        .map(|i| {
            let t = TAU * f64::from(i) / f64::from(count);
            Sample::at(80.0 * t.sin(), 80.0 * t.sin() * t.cos())
        })
        .collect();
    let path = Path::from_samples(samples, Closure::Detect).unwrap();
    assert!(path.is_periodic());
    let mut hint = Some(0.0);
    for i in 0..4000 {
        let s = path.length() * f64::from(i) / 4000.0;
        let foot = project(&path, s, 1.0, 0.0, hint);
        assert!(apart(&path, foot.station, s) < 1e-6);
        hint = Some(foot.station);
    }
    // At the crossing without a hint: by heading.
    for s in [0.0, 0.5 * path.length()] {
        let foot = project(&path, s, 0.3, 0.05, None);
        assert!(apart(&path, foot.station, s) < 1e-6, "{foot:?}");
        assert!((foot.e2 - 0.05).abs() < 1e-9);
    }
}

#[test]
fn beyond_the_ends_the_road_is_extended_and_it_is_said() {
    let path =
        Path::from_samples((0..21).map(|i| Sample::at(f64::from(i), 0.0)).collect(), Closure::Open).unwrap();
    for hint in [None, Some(1.0), Some(19.0), Some(-5.0), Some(40.0)] {
        let before = path.project(-4.0, 1.5, 0.2, hint);
        assert_eq!(before.place, Where::BeforeStart);
        assert!((before.station + 4.0).abs() < 1e-9 && (before.e1 - 1.5).abs() < 1e-9, "{before:?}");
        let beyond = path.project(23.0, -1.0, 0.0, hint);
        assert_eq!(beyond.place, Where::BeyondEnd);
        assert!(
            (beyond.station - 23.0).abs() < 1e-9 && (beyond.e1 + 1.0).abs() < 1e-9 && beyond.curvature == 0.0
        );
        let on = path.project(20.0, 0.5, 0.0, hint);
        assert_eq!(on.place, Where::Beside);
        assert!((on.station - 20.0).abs() < 1e-9);
    }
}

#[test]
fn a_closed_path_wraps() {
    let path = &*CIRCUIT;
    for s in [0.0, 0.05, path.length() - 0.05, path.length() - 1e-9] {
        for hint in [None, Some(0.0), Some(path.length()), Some(path.length() - 2.0), Some(3.0), Some(-2.0)] {
            let foot = project(path, s, 0.7, 0.0, hint);
            assert!((0.0..path.length()).contains(&foot.station));
            assert!(apart(path, foot.station, s) < 1e-6, "{foot:?} for {s} from {hint:?}");
        }
    }
    // Yaw counted over laps is the same yaw.
    let lap = path.at(path.length() + 10.0);
    let foot = path.project(lap.x, lap.y, lap.yaw, Some(10.0));
    assert!(foot.e2.abs() < 1e-9);
}

#[test]
fn a_stale_hint_does_not_lose_the_vehicle() {
    let path = &*CIRCUIT;
    for i in 0..50 {
        let s = path.length() * f64::from(i) / 50.0;
        let foot = project(path, s, 0.5, 0.0, Some(s + 0.5 * path.length()));
        // Walking downhill may end on a branch beside; but never farther away than the vehicle would notice.
        assert!(foot.e1.abs() <= 10.0, "{foot:?} for {s}");
    }
}

#[test]
fn a_pose_that_is_not_finite_gives_errors_that_are_not() {
    let foot = TRAIN.project(f64::NAN, 0.0, 0.0, Some(12.0));
    assert!(foot.e1.is_nan() && foot.station == 12.0);
    let foot = TRAIN.project(1.0, f64::INFINITY, 0.0, None);
    assert!(foot.e1.is_nan() && foot.station == 0.0);
    let foot = TRAIN.project(1.0, 2.0, f64::NAN, None);
    assert!(foot.e1.is_finite() && foot.e2.is_nan());
}

/// Far beyond an end with the end as its hint, though the road comes near elsewhere.
#[test]
fn a_vehicle_far_beyond_an_end_is_found_where_the_road_is() {
    let hook = (0..=100).map(|i| Sample::at(f64::from(i), 0.0));
    let bend = (1..=31)
        .map(|i| f64::from(i) * 0.1)
        .map(|a| Sample::at(100.0 + 30.0 * a.sin(), 30.0 - 30.0 * a.cos()));
    let path = Path::from_samples(hook.chain(bend).collect(), Closure::Open).unwrap();
    // The road ends near (101, 60), heading west; this is 60 m on, over the first straight's start, 60 m beside it.
    let foot = path.project(20.0, 3.0, 0.0, Some(path.length()));
    assert!((foot.station - 20.0).abs() < 0.01 && (foot.e1 - 3.0).abs() < 0.01, "{foot:?}");
}

/// Every class of road occurs, so the tests above mean what they say.
#[test]
fn the_training_route_has_every_class() {
    for class in RoadClass::ALL {
        assert!((0..5700).any(|s| TRAIN.at(f64::from(s)).class == Some(class)), "{}", class.name());
    }
    assert!(TRAIN.at(850.0).yaw.abs() < 20.0 * FRAC_PI_2);
}
