//! The speed plan keeps its limits, everywhere, and uses them.

use proptest::prelude::*;
use rfl_mpc::path::sudoku::Route;
use rfl_mpc::path::{
    AxleShares, BRAKED_SHARE, CAR_GRIP, Closure, DRIVEN_SHARE, Path, Sample, SpeedLimits, SpeedPlan,
    TightestTurn,
};
use std::f64::consts::TAU;

const LIMITS: SpeedLimits = SpeedLimits {
    lateral_accel: 2.0,
    accel: 1.0,
    decel: 1.5,
    brake_decel: f64::INFINITY,
    speed: 20.0,
    curvature_rate: f64::INFINITY,
    turn: None,
    lateral_jerk: f64::INFINITY,
    grip: CAR_GRIP,
    axles: AxleShares::UNKNOWN,
};

fn straight(length: usize) -> Path {
    Path::from_samples((0..=length).map(|i| Sample::at(i as f64, 0.0)).collect(), Closure::Open).unwrap()
}

fn course(route: Route) -> Path {
    let closure = if route.course().closed { Closure::Closed } else { Closure::Open };
    Path::from_samples(route.samples(), closure).unwrap()
}

fn circle(radius: f64) -> Path {
    let angles = (0..314).map(|i| TAU * f64::from(i) / 314.0);
    let samples = angles.map(|a| Sample::at(radius * a.cos(), radius * a.sin()));
    Path::from_samples(samples.collect(), Closure::Detect).unwrap()
}

#[test]
fn a_circle_is_driven_at_its_lateral_limit() {
    let path = circle(50.0);
    let plan = SpeedPlan::new(&path, &LIMITS);
    for i in 0..100 {
        assert!((plan.speed(f64::from(i)) - 10.0).abs() < 1e-3);
        assert!(plan.accel(f64::from(i)).abs() < 1e-3);
    }
    assert!((plan.duration() - path.length() / 10.0).abs() < 0.01);
}

#[test]
fn an_open_road_starts_from_the_given_speed_and_stops_at_its_end() {
    let path = straight(600);
    let plan = SpeedPlan::between(&path, &LIMITS, Some(4.0), true);
    // v^2 = v0^2 + 2 a s, and v^2 = 2 b (L - s): closed forms. Away from the fixed ends, the blend accelerates 2 m
    // later and brakes 2 m earlier.
    assert!((plan.speed(0.0) - 4.0).abs() < 1e-9);
    assert!((plan.speed(50.0) - (16.0f64 + 2.0 * 48.0).sqrt()).abs() < 1e-6);
    assert!(
        (plan.speed(1.0) - 18.0f64.sqrt()).abs() < 0.06 && (plan.speed(599.0) - 3.0f64.sqrt()).abs() < 0.06
    );
    assert!((plan.accel(50.0) - 1.0).abs() < 1e-6 && (plan.accel(550.0) + 1.5).abs() < 1e-6);
    assert!((plan.speed(300.0) - 20.0).abs() < 1e-9);
    assert!((plan.speed(550.0) - (2.0f64 * 1.5 * 48.0).sqrt()).abs() < 1e-6);
    assert!(plan.speed(600.0) == 0.0 && plan.speed(700.0) == 0.0 && plan.accel(700.0) == 0.0);
    let free = SpeedPlan::new(&path, &LIMITS);
    assert!((free.speed(0.0) - 20.0).abs() < 1e-9 && (free.speed(600.0) - 20.0).abs() < 1e-9);
}

#[test]
fn a_start_from_rest_gets_going() {
    let plan = SpeedPlan::between(&straight(100), &LIMITS, Some(0.0), false);
    assert!(plan.speed(0.0) == 0.0 && plan.accel(0.0) > 0.9 && (plan.speed(2.0) - 2.0).abs() < 0.1);
    assert!(plan.duration().is_finite());
}

#[test]
fn the_road_s_own_limit_and_grip_count() {
    let samples = (0..=200)
        .map(|i| Sample {
            speed: Some(if i < 100 { 15.0 } else { 5.0 }),
            friction: Some(0.1),
            ..Sample::at(f64::from(i), 20.0 * (f64::from(i) / 60.0).sin())
        })
        .collect();
    let path = Path::from_samples(samples, Closure::Open).unwrap();
    let plan = SpeedPlan::new(&path, &LIMITS);
    for i in 0..2000 {
        let s = 0.1 * f64::from(i);
        let v = plan.speed(s);
        assert!(v <= path.at(s).speed.unwrap() + 1e-9, "{s}");
        assert!(v * v * path.curvature(s).abs() <= 0.1 * CAR_GRIP + 0.01, "{s}");
    }
}

#[test]
fn brakes_and_drive_count_on_the_grip_that_the_road_gives() {
    // Dry, then ice; with and without a slope of a tenth. Tyres hold the vehicle on the slope, and brake it.
    for grade in [0.0, 0.1, -0.1] {
        let samples = (0..=400)
            .map(|i| Sample {
                speed: Some(if i < 240 { 15.0 } else { 5.0 }),
                friction: Some(if i < 100 { 1.0 } else { 0.2 }),
                grade: Some(grade),
                ..Sample::at(f64::from(i), 0.0)
            })
            .collect();
        let path = Path::from_samples(samples, Closure::Open).unwrap();
        let plan = SpeedPlan::between(&path, &LIMITS, Some(2.0), true);
        let slope = 9.81 * f64::sin(grade);
        let mut used = 0.0f64;
        for i in 1050..4000 {
            let s = 0.1 * f64::from(i);
            let by_tyres = plan.accel(s) + slope;
            let [brakes, drive] = [BRAKED_SHARE, DRIVEN_SHARE].map(|share| share * 0.2 * CAR_GRIP);
            // Uphill, where one axle holds the vehicle but hardly drives it, and downhill, where tyres hold it and hardly
            // brake it, a plan still gets on.
            let drive = drive.max(slope + 0.15 * LIMITS.accel);
            assert!((-brakes..drive + 0.01).contains(&by_tyres), "{grade} at {s}: {by_tyres}");
            used = used.max(-by_tyres);
        }
        assert!(grade > 0.0 || used > 0.7 * BRAKED_SHARE * 0.2 * CAR_GRIP, "{grade}: {used}");
    }
}

#[test]
fn every_course_is_driven_within_its_limits_without_a_jump_of_acceleration() {
    let limits = SpeedLimits::default();
    for route in Route::ALL {
        let path = course(route);
        let plan = SpeedPlan::new(&path, &limits);
        let mut last: Option<f64> = None;
        let mut used = [0.0f64; 3];
        for i in 0..(path.length() * 10.0) as usize {
            let s = 0.1 * i as f64;
            let (v, a) = (plan.speed(s), plan.accel(s));
            let lateral = v * v * path.curvature(s).abs();
            assert!(v > 1.0 && v <= path.at(s).speed.unwrap() + 1e-3, "{} at {s}: {v}", route.name());
            assert!(lateral <= limits.lateral_accel * 1.005, "{} at {s}: {lateral}", route.name());
            assert!(a <= limits.accel + 1e-6 && a >= -limits.decel - 1e-6, "{} at {s}: {a}", route.name());
            if let Some(last) = last {
                assert!((a - last).abs() < 0.35, "{} at {s}: from {last} to {a}", route.name());
            }
            last = Some(a);
            used = [used[0].max(lateral), used[1].max(a), used[2].max(-a)];
        }
        // The limits are used, not only kept.
        assert!(used[1] > 0.95 * limits.accel && used[2] > 0.95 * limits.decel, "{} {used:?}", route.name());
        let kmh = 3.6 * path.length() / plan.duration();
        println!(
            "{}: {:.0} m in {:.0} s, mean {kmh:.0} km/h, {used:?}",
            route.name(),
            path.length(),
            plan.duration()
        );
        assert!((10.0..60.0).contains(&kmh));
    }
}

#[test]
fn a_closed_plan_is_the_same_wherever_the_lap_begins() {
    let samples = Route::HairpinCircuit.samples();
    let mut turned = samples.clone();
    turned.rotate_left(430);
    let (a, b) = (samples, turned);
    let start = Path::from_samples(a, Closure::Closed).unwrap();
    let moved = Path::from_samples(b, Closure::Closed).unwrap();
    let (plan, other) = (SpeedPlan::new(&start, &LIMITS), SpeedPlan::new(&moved, &LIMITS));
    for i in 0..800 {
        let s = f64::from(i);
        let point = start.at(s);
        let there = moved.project(point.x, point.y, point.yaw, None);
        assert!((plan.speed(s) - other.speed(there.station)).abs() < 0.05, "{s}");
    }
    let length = start.length();
    assert!((plan.speed(length - 1e-6) - plan.speed(0.0)).abs() < 1e-3);
    assert!((plan.speed(3.0 * length + 17.0) - plan.speed(17.0)).abs() < 1e-6);
}

/// Two straights that meet at an angle, with a point each metre.
fn kinked(angle: f64) -> Path {
    let there = (0..=100).map(|i| Sample::at(f64::from(i), 0.0));
    let on = (1..=100).map(|i| Sample::at(100.0 + f64::from(i) * angle.cos(), f64::from(i) * angle.sin()));
    Path::from_samples(there.chain(on).collect(), Closure::Open).unwrap()
}

#[test]
fn a_kink_is_driven_as_slowly_as_the_steering_turns_and_no_slower() {
    let turn = TightestTurn { lock: 0.5, wheelbase: 5.0 * 0.5_f64.tan(), rear: 0.0, understeer: 0.0 };
    let steered = SpeedLimits { curvature_rate: 0.15, turn: Some(turn), ..LIMITS };
    for angle in [0.35, 0.5, 0.8] {
        let plan = SpeedPlan::new(&kinked(angle), &steered);
        let slowest = (0..400).map(|i| plan.speed(80.0 + 0.1 * f64::from(i))).fold(f64::INFINITY, f64::min);
        // From lock to lock within 2 m: 2 m * 0.15 / 0.4; the tightest bend may ask for less.
        assert!((0.3..=0.8).contains(&slowest), "{slowest} m/s at {angle} rad");
        assert!(plan.duration() < 60.0);
    }
    // No road that the vehicle can follow is driven otherwise.
    for route in [Route::SudokuTurns, Route::HairpinCircuit] {
        let path = course(route);
        let [with, without] =
            [Some(turn), None].map(|turn| SpeedPlan::new(&path, &SpeedLimits { turn, ..steered }));
        let all = 0..path.length() as usize;
        assert!(all.into_iter().all(|s| with.speed(s as f64).to_bits() == without.speed(s as f64).to_bits()));
    }
}

#[test]
fn a_bend_leaves_understeer_the_rest_of_the_steering() {
    // A circle of 20 m of the CG, whose rear axle drives on one of 19.96 m.
    let circle = circle(20.0);
    for (lock, expected) in
        [(0.2, None), (0.16, None), (0.145, Some(4.05)), (0.12, Some(1.4)), (0.05, Some(1.4))]
    {
        let turn = TightestTurn { lock, wheelbase: 2.7, rear: 1.3, understeer: 0.004 };
        let [with, without] = [Some(turn), None].map(|turn| {
            SpeedPlan::new(&circle, &SpeedLimits { turn, lateral_accel: 2.25, ..LIMITS }).speed(30.0)
        });
        let left = 0.95 * lock - 2.7_f64.atan2((400.0_f64 - 1.69).sqrt());
        let by_hand = (left / 0.004 * 20.0).max(1.4 * 1.4).sqrt().min(without);
        assert!((with - by_hand).abs() < 0.01, "{lock}: {with} {by_hand}");
        assert!(expected.is_none_or(|expected| (with - expected).abs() < 0.5), "{lock}: {with}");
    }
}

#[test]
fn a_plan_brakes_with_less_than_the_brakes_give() {
    // A slope down of 5 %, then a bend.
    let slope = 0.05_f64;
    let bend = |k: i32| f64::from(k) / 30.0;
    let down = (0..=300).map(|i| Sample { grade: Some(-slope), ..Sample::at(f64::from(i), 0.0) });
    let round = (1..=40).map(|k| Sample {
        grade: Some(0.0),
        ..Sample::at(300.0 + 30.0 * bend(k).sin(), 30.0 * (1.0 - bend(k).cos()))
    });
    let path = Path::from_samples(down.chain(round).collect(), Closure::Open).unwrap();
    for brake_decel in [0.6, 1.0, 2.0] {
        let plan = SpeedPlan::new(&path, &SpeedLimits { brake_decel, ..LIMITS });
        let steepest = (0..2900).map(|i| plan.accel(0.1 * f64::from(i))).fold(0.0, f64::min);
        let given = brake_decel - 9.81 * slope.sin();
        assert!(-steepest < given && steepest < -0.05, "{steepest} of {given} m/s2");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn limits_hold_for_any_limits(
        lateral_accel in 0.3..8.0f64, accel in 0.2..4.0f64, decel in 0.2..8.0f64, speed in 1.0..60.0f64,
        start in proptest::option::of(0.0..30.0f64), stop in any::<bool>(),
    ) {
        let limits = SpeedLimits { lateral_accel, accel, decel, speed, ..LIMITS };
        for route in [Route::SudokuTurns, Route::HairpinCircuit] {
            let path = course(route);
            let plan = SpeedPlan::between(&path, &limits, start, stop);
            for i in 0..(path.length() * 4.0) as usize {
                let s = 0.25 * i as f64;
                let (v, a) = (plan.speed(s), plan.accel(s));
                prop_assert!(v <= speed + 1e-9 && v * v * path.curvature(s).abs() <= lateral_accel * 1.02);
                // Where the blend gives way to a fixed speed at an end, slopes grow a little.
                prop_assert!(a <= 1.25 * accel + 1e-6 && a >= -1.25 * decel - 1e-6, "{a} at {s}");
            }
            if let (Some(start), false) = (start, path.is_periodic()) {
                prop_assert!(plan.speed(0.0) <= start + 1e-9);
            }
        }
    }
}
