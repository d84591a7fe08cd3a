//! Our own courses: the files are what the generator draws, the geometry is sane, and a round trip keeps it.

use rfl_mpc::path::sudoku::{Route, off_road};
use rfl_mpc::path::{Closure, Course, Path, RoadClass, Sample, to_csv};
use std::f64::consts::TAU;

fn file(route: Route) -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("paths").join(format!("{}.csv", route.name()))
}

/// Least radius of each class and turn direction on a course: `radius(class, left)`.
fn radii(course: &Course, class: RoadClass) -> Vec<f64> {
    let mut radii: Vec<f64> = course
        .segments
        .iter()
        .filter(|segment| segment.class == class && segment.start_curvature == segment.end_curvature)
        .filter(|segment| segment.start_curvature != 0.0)
        .map(|segment| 1.0 / segment.start_curvature)
        .collect();
    radii.sort_by(f64::total_cmp);
    radii.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    radii
}

#[test]
fn the_files_are_what_the_generator_draws() {
    for route in Route::ALL {
        let text = std::fs::read_to_string(file(route)).unwrap();
        assert!(
            text == to_csv(&route.samples()),
            "paths/{}.csv is not what the generator draws; run `rfl course` and look at the difference",
            route.name()
        );
        assert!(text.len() < 500_000, "{}: {} bytes", route.name(), text.len());
    }
}

#[test]
fn a_file_s_path_is_the_course() {
    for route in Route::ALL {
        let course = route.course();
        let path = Path::read(&file(route)).unwrap();
        assert_eq!(path.is_periodic(), course.closed, "{}", route.name());
        let others = path.notes().iter().filter(|note| !note.text.contains("taken as closed"));
        assert_eq!(others.count(), 0, "{}: {:?}", route.name(), path.notes());
        assert!((path.length() - course.length()).abs() < 1e-3, "{}", route.name());
        let (mut worst, mut sum, mut count) = ([0.0f64; 3], 0.0, 0.0);
        let mut s = 0.0;
        while s < course.length() {
            let (pose, curvature) = course.at(s);
            let foot = path.project(pose.x, pose.y, pose.yaw, Some(s));
            let error = (foot.curvature - curvature).abs();
            worst = [worst[0].max(error), worst[1].max(foot.e1.abs()), worst[2].max(foot.e2.abs())];
            (sum, count) = (sum + error, count + 1.0);
            s += 0.73;
        }
        println!(
            "{}: curvature {:.1e} (mean {:.1e}), e1 {:.1e} m, e2 {:.1e} rad",
            route.name(),
            worst[0],
            sum / count,
            worst[1],
            worst[2]
        );
        assert!(worst[0] < 1e-3 && worst[1] < 1e-5 && worst[2] < 1e-4, "{}: {worst:?}", route.name());
        assert!(sum / count < 3e-5);
    }
}

#[test]
fn points_alone_give_the_curvature_too() {
    for route in Route::ALL {
        let course = route.course();
        let bare = route.samples().iter().map(|sample| Sample::at(sample.x, sample.y)).collect();
        let closure = if course.closed { Closure::Closed } else { Closure::Open };
        let path = Path::from_samples(bare, closure).unwrap();
        let (mut worst, mut square, mut count) = (0.0f64, 0.0, 0.0);
        let mut s = 0.0;
        while s < course.length() {
            let (pose, curvature) = course.at(s);
            let error = path.project(pose.x, pose.y, pose.yaw, Some(s)).curvature - curvature;
            worst = worst.max(error.abs());
            (square, count) = (square + error * error, count + 1.0);
            s += 0.73;
        }
        let rms = (square / count).sqrt();
        println!("{}: curvature error {worst:.1e} at most, {rms:.1e} RMS", route.name());
        assert!(worst < 5e-3 && rms < 5e-4, "{}: {worst} {rms}", route.name());
    }
}

#[test]
fn courses_have_no_jump() {
    for route in Route::ALL {
        let course = route.course();
        let mut last = 0.0;
        for (i, segment) in course.segments.iter().enumerate() {
            assert!(segment.length > 0.0 && segment.speed > 0.0);
            assert!((segment.start_curvature - last).abs() < 1e-12, "{}: segment {i}", route.name());
            last = segment.end_curvature;
        }
        assert_eq!(last, 0.0);
        // Positions by the pen (along its lanes) and by integration from the start agree.
        if course.closed {
            let end = course.end();
            assert!((end.x - course.start.x).hypot(end.y - course.start.y) < 1e-8, "{end:?}");
            let laps = (end.yaw - course.start.yaw) / TAU;
            assert!((laps - laps.round()).abs() < 1e-12 && laps.round() != 0.0);
        }
    }
}

#[test]
fn the_sudoku_lies_on_its_grid() {
    for route in [Route::SudokuTrain, Route::SudokuTest, Route::TruckTrain, Route::TruckTest] {
        let course = route.course();
        let mut on_grid = 0;
        for sample in route.samples().iter().filter(|sample| sample.class == Some(RoadClass::Straight)) {
            // Across the heading, a lane lies 1.75 m to the right of a street's middle.
            let yaw = sample.yaw.unwrap();
            let east_west = yaw.sin().abs() < 0.5;
            let (across, right) =
                if east_west { (sample.y, -yaw.cos().signum()) } else { (sample.x, yaw.sin().signum()) };
            let street = (across - 1.75 * right) / 150.0;
            assert!((street - street.round()).abs() < 1e-9, "{}: {sample:?}", route.name());
            assert!((-0.5..3.5).contains(&street));
            on_grid += 1;
        }
        assert!(on_grid > 500);
        let length = course.length();
        println!("{}: {length:.0} m", route.name());
    }
    for route in [Route::SudokuTrain, Route::TruckTrain] {
        assert!((5_400.0..6_800.0).contains(&route.course().length()));
    }
}

#[test]
fn a_truck_can_take_the_turns_of_its_courses() {
    use RoadClass::{CrossCountry, LeftTurn, RightTurn, Sweeper, UTurn};
    let of = |route: Route, class| radii(&route.course(), class);
    for route in [Route::TruckTrain, Route::TruckTest, Route::TruckOffRoad, Route::TruckUTurn] {
        for class in [RightTurn, LeftTurn, Sweeper] {
            assert!(of(route, class).iter().all(|radius| radius.abs() >= 15.0), "{}", route.name());
        }
        // A U-turn's swerves have 20 m, its turn 12.5 to 15.
        let turns = of(route, UTurn).into_iter().map(f64::abs).filter(|radius| *radius < 19.9);
        assert!(turns.into_iter().all(|radius| (12.5 - 1e-9..=15.0 + 1e-9).contains(&radius)));
        let samples = route.samples();
        let rough = samples.iter().filter(|sample| sample.class == Some(CrossCountry));
        assert!(rough.into_iter().all(|sample| sample.curvature.unwrap().abs() <= 0.05));
    }
    for class in [Sweeper, UTurn, CrossCountry] {
        let radii = of(Route::TruckTrain, class);
        assert!(radii.iter().any(|r| *r > 0.0) && radii.iter().any(|r| *r < 0.0), "{radii:?}");
    }
}

#[test]
fn every_element_has_the_radii_and_speeds_of_the_method() {
    use RoadClass::{CrossCountry, LeftTurn, RightTurn, Straight, Sweeper, UTurn};
    for route in [Route::SudokuTrain, Route::SudokuTest, Route::SudokuTurns, Route::OffRoad] {
        let course = route.course();
        for (class, low, high) in [(RightTurn, 10.0, 12.0), (LeftTurn, 16.0, 20.0), (Sweeper, 40.0, 60.0)] {
            for radius in radii(&course, class) {
                assert!((low - 1e-9..=high + 1e-9).contains(&radius.abs()), "{}: {radius}", route.name());
            }
        }
        assert!(radii(&course, RightTurn).iter().all(|radius| *radius < 0.0));
        assert!(radii(&course, LeftTurn).iter().all(|radius| *radius > 0.0));
        // A U-turn's swerves have 20 m, its turn 6.5 to 7.
        for radius in radii(&course, UTurn).iter().map(|radius| radius.abs()).filter(|radius| *radius < 19.9)
        {
            assert!((6.5 - 1e-9..=7.0 + 1e-9).contains(&radius), "{}: {radius}", route.name());
        }
        for sample in course.samples(1.0) {
            let (class, kmh) = (sample.class.unwrap(), 3.6 * sample.speed.unwrap());
            let allowed = match class {
                Straight => 40.0..=50.0,
                RightTurn => 15.0..=15.0,
                LeftTurn => 20.0..=20.0,
                UTurn => 10.0..=10.0,
                Sweeper => 35.0..=35.0,
                CrossCountry => 15.0..=25.0,
            };
            assert!(
                kmh > allowed.start() - 1e-6 && kmh < allowed.end() + 1e-6,
                "{} at {kmh} km/h",
                class.name()
            );
            if class == CrossCountry {
                assert!(sample.curvature.unwrap().abs() <= 0.05);
                assert!(sample.bank.unwrap().abs() <= 0.05 && sample.grade.unwrap().abs() <= 0.05);
                assert!((0.5..=1.0).contains(&sample.friction.unwrap()));
            } else if class == Straight {
                assert!(sample.friction.unwrap_or(1.0) > 0.999);
            }
        }
    }
    // Training meets each element both ways, and unevenness that deserves its name.
    let train = Route::SudokuTrain.course();
    for class in [Sweeper, UTurn, CrossCountry] {
        let radii = radii(&train, class);
        assert!(
            radii.iter().any(|r| *r > 0.0) && radii.iter().any(|r| *r < 0.0),
            "{}: {radii:?}",
            class.name()
        );
    }
    for route in [Route::SudokuTrain, Route::SudokuTest, Route::OffRoad] {
        let course = route.course();
        let rough: Vec<_> =
            course.samples(1.0).into_iter().filter(|sample| sample.class == Some(CrossCountry)).collect();
        assert!(rough.len() >= 400, "{}: {}", route.name(), rough.len());
        let peak = |value: fn(&Sample) -> f64| rough.iter().map(value).fold(0.0, f64::max);
        assert!(peak(|s| s.bank.unwrap().abs()) > 0.035 && peak(|s| s.grade.unwrap().abs()) > 0.03);
        assert!(peak(|s| s.curvature.unwrap().abs()) > 0.025);
        let grip = rough.iter().filter(|sample| (0.5..=0.6).contains(&sample.friction.unwrap())).count();
        assert!(grip as f64 > 0.9 * rough.len() as f64);
    }
}

#[test]
fn the_test_route_is_disjoint_from_the_training_route() {
    disjoint(Route::SudokuTrain, Route::SudokuTest);
    disjoint(Route::TruckTrain, Route::TruckTest);
}

fn disjoint(train: Route, test: Route) {
    for class in [RoadClass::RightTurn, RoadClass::LeftTurn, RoadClass::Sweeper] {
        let (a, b) = (radii(&train.course(), class), radii(&test.course(), class));
        assert!(!a.is_empty() && !b.is_empty());
        for radius in &b {
            assert!(a.iter().all(|other| (radius - other).abs() > 0.05), "{}: {radius}", class.name());
        }
    }
    // No lane in common: only in crossings does a point of one lie on the other with the same heading.
    let path = Path::from_samples(train.samples(), Closure::Open).unwrap();
    let samples = test.samples();
    let shared = samples
        .iter()
        .filter(|sample| {
            let foot = path.project(sample.x, sample.y, sample.yaw.unwrap(), None);
            foot.e1.abs() < 0.5 && foot.e2.abs() < 0.1 && (0.0..path.length()).contains(&foot.station)
        })
        .count();
    println!("{shared} of {} points shared", samples.len());
    assert!(shared * 50 < samples.len(), "{shared} of {} points shared", samples.len());
}

#[test]
fn the_circuit_s_hairpin_has_ten_metres() {
    let course = Route::HairpinCircuit.course();
    assert!(course.closed);
    let tightest = course.segments.iter().map(|segment| segment.start_curvature.abs()).fold(0.0, f64::max);
    assert!((tightest - 0.1).abs() < 1e-12);
    // It turns by far more than a right angle in one go.
    let hairpin: f64 = course
        .segments
        .windows(3)
        .filter(|three| (three[1].start_curvature - 0.1).abs() < 1e-12)
        .map(|three| three.iter().map(|segment| segment.turn(segment.length)).sum())
        .fold(0.0, f64::max);
    assert!(hairpin > 2.5, "{hairpin}");
}

#[test]
fn another_seed_is_another_path_and_the_same_seed_the_same() {
    assert_eq!(off_road(5), off_road(5));
    assert_ne!(off_road(5).samples(1.0), off_road(6).samples(1.0));
    for seed in (0..300).chain([u64::MAX]) {
        let course = off_road(seed);
        assert!(
            course.samples(1.0).iter().all(|sample| sample.curvature.unwrap().abs() <= 0.05),
            "seed {seed}"
        );
        assert!(Path::from_samples(course.samples(1.0), Closure::Open).is_ok());
    }
}

#[test]
fn names_find_their_routes() {
    for route in Route::ALL {
        assert_eq!(Route::from_name(route.name()), Some(route));
        assert!(!route.summary().is_empty());
    }
    assert_eq!(Route::from_name("monza"), None);
}
