//! Noisy points: the curvature of a smoothed path is usable, and the path stays within its tolerance.

use rfl_mpc::path::{Closure, Path, PathError, PathOptions, Sample, Smoothing};
use std::f64::consts::TAU;

/// A bell-shaped, repeatable noise of unit variance (sum of 12 uniform numbers).
fn noise(seed: &mut u64) -> f64 {
    (0..12).map(|_| uniform(seed)).sum::<f64>() - 6.0
}

fn uniform(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

fn within(tolerance: f64, closure: Closure) -> PathOptions {
    PathOptions { closure, smoothing: Smoothing::Within(tolerance), ..PathOptions::default() }
}

/// A ring road with bends both ways: radius 60 + 8 sin(3 angle).
fn ring(angle: f64) -> [f64; 2] {
    let radius = 60.0 + 8.0 * (3.0 * angle).sin();
    [radius * angle.cos(), radius * angle.sin()]
}

fn ring_curvature(angle: f64) -> f64 {
    let r = 60.0 + 8.0 * (3.0 * angle).sin();
    let d = 24.0 * (3.0 * angle).cos();
    let dd = -72.0 * (3.0 * angle).sin();
    (r * r + 2.0 * d * d - r * dd) / (r * r + d * d).powf(1.5)
}

#[test]
fn two_centimetres_of_noise_at_one_metre_leave_a_usable_curvature() {
    let count = 400;
    for closure in [Closure::Closed, Closure::Open] {
        let mut seed = 1;
        let points: Vec<Sample> = (0..count)
            .map(|i| {
                let [x, y] = ring(TAU * f64::from(i) / f64::from(count));
                // Noise of 2 cm RMS in distance.
                Sample::at(x + 0.0141 * noise(&mut seed), y + 0.0141 * noise(&mut seed))
            })
            .collect();
        let smooth = Path::from_samples_with(points.clone(), &within(0.02, closure)).unwrap();
        let raw = Path::from_samples(points.clone(), closure).unwrap();
        let worst = |path: &Path| {
            (20..780).fold(0.0f64, |worst, i| {
                let angle = TAU * f64::from(i) / 800.0;
                let [x, y] = ring(angle);
                let foot = path.project(x, y, angle + TAU / 4.0, None);
                worst.max((foot.curvature - ring_curvature(angle)).abs())
            })
        };
        let (with, without) = (worst(&smooth), worst(&raw));
        println!("{closure:?}: curvature error {with:.5} smoothed, {without:.5} through the points");
        assert!(with < 0.004, "{with}");
        assert!(without > 10.0 * with, "the check checks nothing: {without}");
        let square: f64 =
            points.iter().map(|point| smooth.project(point.x, point.y, 0.0, None).e1.powi(2)).sum::<f64>()
                / f64::from(count);
        assert!(square.sqrt() <= 0.0201, "RMS {}", square.sqrt());
    }
}

/// Points 0.1 m apart of a road with hairpins of 8 to 12 m radius between wide bends, each with clothoids of `transition` radii.
fn hairpins(transition: f64) -> Vec<[f64; 2]> {
    let step = 0.1;
    let bends =
        [(60.0, 0.9), (-10.0, 2.9), (8.0, 2.5), (-100.0, 0.6), (12.0, 3.0), (-40.0, 1.2), (-9.0, 1.6)];
    let ([mut x, mut y, mut yaw], mut points) = ([0.0f64; 3], Vec::new());
    let mut draw = |length: f64, from: f64, to: f64| {
        let count = (length / step).ceil() as usize;
        for k in 0..count {
            let curvature = from + (to - from) * (k as f64 + 0.5) / count as f64;
            points.push([x, y]);
            let middle = yaw + 0.5 * step * curvature;
            x += step * middle.cos();
            y += step * middle.sin();
            yaw += step * curvature;
        }
    };
    draw(40.0, 0.0, 0.0);
    for (radius, angle) in bends {
        let (curvature, clothoid) = (1.0 / radius, transition * f64::abs(radius));
        draw(clothoid, 0.0, curvature);
        // The clothoids turn by half of an arc's angle each.
        draw((angle - transition) * f64::abs(radius), curvature, curvature);
        draw(clothoid, curvature, 0.0);
        draw(30.0, 0.0, 0.0);
    }
    points
}

#[test]
fn noise_leaves_tight_bends_where_they_are() {
    for (sigma, spacing, bound) in [(0.02, 1, 0.1), (0.1, 1, 0.3), (0.1, 2, 0.3)] {
        for (case, transition) in [0.3, 0.5].into_iter().enumerate() {
            let truth = hairpins(transition);
            let mut seed = case as u64 + 3;
            let text: String = truth.iter().step_by(10 * spacing).fold("x,y\n".to_owned(), |text, [x, y]| {
                let mut off = || sigma * noise(&mut seed);
                format!("{text}{:.3},{:.3}\n", x + off(), y + off())
            });
            let path =
                Path::from_csv(text.as_bytes(), std::path::Path::new("road.csv"), &PathOptions::default())
                    .unwrap();
            let inner = &truth[50..truth.len() - 50];
            let off = inner.iter().map(|[x, y]| path.project(*x, *y, 0.0, None).e1.abs()).fold(0.0, f64::max);
            println!(
                "{sigma} m each {spacing} m, clothoids of {transition} radii: {off:.3} m, {:?}",
                path.notes()
            );
            assert!(off < bound, "{sigma} m each {spacing} m, clothoids of {transition} radii: {off} m");
        }
    }
}

#[test]
fn rounding_to_millimetres_is_smoothed_away() {
    let text: String = std::iter::once("x,y\n".to_string())
        .chain((0..400).map(|i| {
            let [x, y] = ring(TAU * f64::from(i) / 400.0);
            format!("{x:.3},{y:.3}\n")
        }))
        .collect();
    let name = std::path::Path::new("ring.csv");
    let error = |options: &PathOptions| {
        let path = Path::from_csv(text.as_bytes(), name, options).unwrap();
        assert!(path.is_periodic());
        let worst = (0..800).fold(0.0f64, |worst, i| {
            let angle = TAU * f64::from(i) / 800.0;
            let [x, y] = ring(angle);
            worst.max((path.project(x, y, angle + TAU / 4.0, None).curvature - ring_curvature(angle)).abs())
        });
        (worst, path.notes().to_vec())
    };
    let (smoothed, notes) = error(&PathOptions::default());
    let (raw, _) = error(&PathOptions { smoothing: Smoothing::None, ..PathOptions::default() });
    println!("{smoothed:.6} {raw:.6} {notes:?}");
    assert!(smoothed < 4e-4 && raw > 3.0 * smoothed, "{smoothed} {raw}");
    assert!(notes.iter().any(|note| note.text.contains("rounding")), "{notes:?}");
}

#[test]
fn a_vehicle_at_rest_in_the_log_does_no_harm() {
    let mut seed = 7;
    let mut points = Vec::new();
    for i in 0..200 {
        // Stands still for 50 samples in the middle.
        let repeats = if i == 100 { 50 } else { 1 };
        for _ in 0..repeats {
            points.push(Sample::at(f64::from(i) + 0.005 * noise(&mut seed), 0.005 * noise(&mut seed)));
        }
    }
    let path = Path::from_samples_with(points, &within(0.02, Closure::Open)).unwrap();
    assert!((path.length() - 199.0).abs() < 0.5, "{}", path.length());
    let worst = (0..790).fold(0.0f64, |worst, i| worst.max(path.curvature(f64::from(i) * 0.25).abs()));
    assert!(worst < 0.005, "{worst}");
    assert!(path.notes().iter().any(|note| note.text.contains("dropped")), "{:?}", path.notes());
}

/// A kidney, `radius` metres about, with points of `noise` each `spacing` metres from a start on; `missing` metres short of a lap.
fn kidney(radius: f64, [spacing, noise_size, missing]: [f64; 3], seed: &mut u64) -> Vec<Sample> {
    let start = TAU * uniform(seed);
    let at = |angle: f64| {
        let r = radius * (1.0 + 0.25 * (2.0 * angle).cos() + 0.1 * (3.0 * angle).sin());
        [r * angle.cos(), r * angle.sin()]
    };
    let (mut points, mut angle) = (Vec::new(), 0.0);
    let mut left = 0.0;
    while angle < TAU {
        let next = angle + 1e-4;
        let ([x, y], [u, v]) = (at(start + angle), at(start + next));
        left -= (u - x).hypot(v - y);
        if left <= 0.0 {
            points.push(Sample::at(x + noise_size * noise(seed), y + noise_size * noise(seed)));
            left += spacing;
        }
        angle = next;
    }
    points.truncate(points.len() - (missing / spacing) as usize);
    points
}

#[test]
fn a_noisy_lap_is_closed_and_a_noisy_road_that_ends_short_of_it_is_open() {
    let mut seed = 11;
    for (radius, noise_size) in [(25.0, 0.1), (40.0, 0.3), (60.0, 1.0), (150.0, 2.0)] {
        for spacing in [0.2, 1.0, 3.0] {
            for missing in [0.0, 45.0 * f64::max(1.0, noise_size)] {
                let points = kidney(radius, [spacing, noise_size, missing], &mut seed);
                let path = Path::from_samples_with(points, &PathOptions::default()).unwrap();
                let case = format!("{radius} m, noise {noise_size} m each {spacing} m, {missing} m missing");
                assert_eq!(path.is_periodic(), missing == 0.0, "{case}: {:?}", path.notes());
            }
        }
    }
}

/// A road out, half a circle of `radius` m, and back beside it.
fn out_and_back(way: f64, radius: f64, [spacing, noise_size]: [f64; 2], seed: &mut u64) -> Vec<Sample> {
    let half = TAU / 2.0 * radius;
    let count = ((2.0 * way + half) / spacing) as usize;
    let at = |s: f64| match s {
        s if s < way => [s, 0.0],
        s if s < way + half => {
            let (sin, cos) = ((s - way) / radius).sin_cos();
            [way + radius * sin, radius * (1.0 - cos)]
        }
        s => [2.0 * way + half - s, 2.0 * radius],
    };
    let points = (0..=count).map(|k| at(k as f64 * spacing));
    points.map(|[x, y]| Sample::at(x + noise_size * noise(seed), y + noise_size * noise(seed))).collect()
}

#[test]
fn a_road_out_and_back_is_open_however_noisy() {
    let mut seed = 17;
    // The last have their ends within two spacings.
    for (way, radius, spacing) in [(60.0, 12.0, 5.0), (200.0, 6.0, 3.0), (200.0, 6.0, 5.0), (60.0, 5.0, 5.0)]
    {
        for noise_size in [0.0, 0.3, 0.5, 1.0] {
            for _ in 0..8 {
                let points = out_and_back(way, radius, [spacing, noise_size], &mut seed);
                let case = format!("{way} m, radius {radius} m, noise {noise_size} m each {spacing} m");
                match Path::from_samples_with(points, &PathOptions::default()) {
                    Ok(path) => assert!(!path.is_periodic(), "{case}: {:?}", path.notes()),
                    Err(error) => panic!("{case}: {error}"),
                }
            }
        }
    }
}

#[test]
fn a_small_noisy_lap_is_closed_and_it_is_said() {
    let mut seed = 23;
    let mut closed = 0;
    for _ in 0..16 {
        let point = |k: u32| {
            let (sin, cos) = (f64::from(k) * TAU / 20.0).sin_cos();
            Sample::at(9.55 * cos + 0.5 * noise(&mut seed), 9.55 * sin + 0.5 * noise(&mut seed))
        };
        let path = Path::from_samples_with((0..20).map(point).collect(), &PathOptions::default()).unwrap();
        let said = path.notes().iter().any(|note| note.text.contains("taken as closed (--open"));
        assert_eq!(said, path.is_periodic(), "{:?}", path.notes());
        closed += u32::from(said);
    }
    assert!(closed >= 15, "{closed} of 16");
}

/// A receiver's points, ten a second, of a drive along the ring: it stands, speeds up, and stops again.
fn drive(noise_size: f64, correlation: f64, seed: &mut u64) -> Vec<Sample> {
    let (mut points, mut off) = (Vec::new(), [0.0; 2]);
    let (mut angle, mut speed) = (0.0, 0.0);
    for k in 0..600 {
        let stops = k > 450;
        speed = if k < 50 { 0.0 } else { f64::clamp(speed + if stops { -0.2 } else { 0.15 }, 0.0, 10.0) };
        angle += 0.1 * speed / 60.0;
        let fresh = (1.0 - correlation * correlation).sqrt();
        off = off.map(|off| correlation * off + fresh * noise_size * noise(seed));
        let [x, y] = ring(angle);
        points.push(Sample::at(x + off[0], y + off[1]));
    }
    points
}

#[test]
fn a_drive_that_begins_and_ends_at_rest_is_a_road() {
    let mut seed = 5;
    for (noise_size, correlation) in
        [(0.0, 0.0), (0.01, 0.0), (0.1, 0.0), (0.3, 0.0), (0.02, 0.95), (0.1, 0.95)]
    {
        let points = drive(noise_size, correlation, &mut seed);
        let count = points.len();
        let path = Path::from_samples_with(points, &PathOptions::default()).unwrap();
        let case = format!("noise {noise_size} m, correlated {correlation}: {:?}", path.notes());
        println!("{case}");
        let off = (0..360).map(|degree| {
            let [x, y] = ring(f64::from(degree).to_radians());
            path.project(x, y, 0.0, None)
        });
        let on_the_road = off.filter(|foot| foot.station > 2.0 && foot.station < path.length() - 2.0);
        let most = on_the_road.map(|foot| foot.e1.abs()).filter(|e1| *e1 < 20.0).fold(0.0, f64::max);
        assert!(most < 0.05 + 2.5 * noise_size, "{most} m; {case}");
        let tightest = (0..=1000)
            .map(|i| path.curvature(path.length() * f64::from(i) / 1000.0).abs())
            .fold(0.0, f64::max);
        assert!(tightest < 0.25, "{tightest} 1/m; {case}");
        let said = path.notes().iter().any(|note| note.text.contains("stood or crawled"));
        assert!(said == (noise_size > 0.0) && count == 600, "{case}");
    }
}

#[test]
fn a_slow_hairpin_is_no_stop() {
    // Points 0.2 m apart in a hairpin of 6 m, 3 m on the straights; the last one out of order.
    let mut points: Vec<Sample> = (0..30).map(|i| Sample::at(-87.0 + 3.0 * f64::from(i), 0.0)).collect();
    points.extend(
        (1..94).map(|i| f64::from(i) * 0.2 / 6.0).map(|a| Sample::at(6.0 * a.sin(), 6.0 - 6.0 * a.cos())),
    );
    points.extend((1..30).map(|i| Sample::at(-3.0 * f64::from(i), 12.0)));
    assert!(Path::from_samples_with(points.clone(), &PathOptions::default()).is_ok());
    points.push(Sample::at(-60.0, 12.0));
    let error = Path::from_samples_with(points, &PathOptions::default()).unwrap_err();
    assert!(matches!(error, PathError::TurnsBack { .. }), "{error}");
}

#[test]
fn a_tolerance_that_is_none_is_refused() {
    let points: Vec<Sample> = (0..20).map(|i| Sample::at(f64::from(i), 0.0)).collect();
    for value in [-0.1, f64::NAN, 6.0] {
        let error = Path::from_samples_with(points.clone(), &within(value, Closure::Open)).unwrap_err();
        assert!(matches!(error, PathError::Tolerance { .. }), "{error}");
    }
}

/// A receiver slower than its log: each of its points stands there several times.
#[test]
fn points_that_repeat_are_as_noisy_as_those_that_do_not() {
    let road = |repeats: usize| {
        let mut seed = 3;
        let points = (0..400).flat_map(|i| {
            let [x, y] = ring(TAU * f64::from(i) / 400.0);
            let point = Sample::at(x + 0.1 * noise(&mut seed), y + 0.1 * noise(&mut seed));
            std::iter::repeat_n(point, repeats)
        });
        let options = PathOptions { closure: Closure::Closed, ..PathOptions::default() };
        Path::from_samples_with(points.collect(), &options).unwrap()
    };
    let once = road(1);
    for repeats in [2, 3, 10] {
        let repeated = road(repeats);
        assert!((repeated.length() / once.length() - 1.0).abs() < 1e-9, "{repeats}: {} m", repeated.length());
        let of = |path: &Path| (0..300).map(|s| path.at(f64::from(s)).curvature).collect::<Vec<_>>();
        let worst = of(&repeated).iter().zip(of(&once)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{repeats}: {worst}");
    }
}

/// A road with bends of 80 m radius both ways, its points 1 m apart, with an error of 0.3 m that lasts for about 20 m.
fn drifting(seed: u64, deviation: f64) -> Vec<Sample> {
    let (mut seed, keep) = (seed, (-1.0f64 / 20.0).exp());
    let (mut x, mut y, mut yaw, mut error) = (0.0, 0.0, 0.0f64, [0.0; 2]);
    (0..600)
        .map(|i| {
            yaw += (f64::from(i) / 60.0).sin() / 80.0;
            (x, y) = (x + yaw.cos(), y + yaw.sin());
            error =
                error.map(|error| keep * error + deviation * (1.0 - keep * keep).sqrt() * noise(&mut seed));
            Sample::at(x + error[0], y + error[1])
        })
        .collect()
}

#[test]
fn a_drifting_receiver_is_said_and_the_tolerance_that_is_named_takes_it_away() {
    let warning = |path: &Path| {
        let warnings = path.notes().iter().filter(|note| note.warning).map(|note| note.text.clone());
        warnings.collect::<Vec<_>>().join("; ")
    };
    let least = |path: &Path| path.tighter_than(1e6).map_or(f64::INFINITY, |(_, radius, _)| radius);
    for seed in 1..4 {
        let points = drifting(seed, 0.3);
        let drawn = Path::from_samples_with(points.clone(), &PathOptions::default()).unwrap();
        let words = warning(&drawn);
        assert!(words.contains("to and fro") && least(&drawn) < 40.0, "{}: {words}", least(&drawn));
        let named = words.split("--smooth ").nth(1).and_then(|rest| rest.split(' ').next());
        let tolerance: f64 = named.expect("a tolerance").parse().expect("a number");
        let smooth = Path::from_samples_with(points, &within(tolerance, Closure::Detect)).unwrap();
        assert_eq!(warning(&smooth), "", "{tolerance}");
        assert!(least(&smooth) > 50.0, "{tolerance}: {}", least(&smooth));
        let exact = Path::from_samples_with(drifting(seed, 0.0), &PathOptions::default()).unwrap();
        assert_eq!(warning(&exact), "");
    }
}

#[test]
fn a_slalom_and_a_small_track_do_not_sway() {
    let wave = |amplitude: f64, length: f64| -> Vec<Sample> {
        let place = |i: i32| 0.02 * length * f64::from(i);
        (0..400).map(place).map(|x| Sample::at(x, amplitude * (TAU * x / length).sin())).collect()
    };
    for (amplitude, length) in [(1.2, 36.0), (0.4, 2.5)] {
        let path = Path::from_samples_with(wave(amplitude, length), &PathOptions::default()).unwrap();
        assert!(path.notes().iter().all(|note| !note.text.contains("to and fro")), "{:?}", path.notes());
    }
}

fn read(rows: &str) -> Path {
    let text = format!("x,y\n{rows}");
    Path::from_csv(text.as_bytes(), std::path::Path::new("road.csv"), &PathOptions::default()).unwrap()
}

#[test]
fn a_curve_that_rings_about_a_corner_names_it() {
    // 60 m, a corner, 60 m, another one, 60 m, in steps of 0.1 mm.
    let corners = |turns: [f64; 2]| -> String {
        let (mut place, mut heading) = ([0.0, 0.0], 0.0);
        let point = |k: u32| {
            let text = format!("{:.4},{:.4}\n", place[0], place[1]);
            heading += match k {
                60 => turns[0].to_radians(),
                120 => turns[1].to_radians(),
                _ => 0.0,
            };
            place = [place[0] + f64::cos(heading), place[1] + f64::sin(heading)];
            text
        };
        (0..180).map(point).collect()
    };
    let mut named = 0;
    for turns in [[10.0, 10.0], [10.0, -10.0], [20.0, 5.0]] {
        let path = read(&corners(turns));
        let words: String = path.notes().iter().map(|note| note.text.clone() + "; ").collect();
        assert!(!words.contains("receiver"), "{turns:?}: {words}");
        named += u32::from(words.contains("has a corner at station"));
    }
    assert!(named > 0);
}

#[test]
fn a_cusp_of_exact_points_is_no_noise() {
    // A bend of 0.15 m radius, drawn each 0.1 m in steps of 0.1 mm, which the points' rounding does not make.
    let cusp: String = (0..400)
        .map(|k| {
            let s = 0.1 * f64::from(k) - 20.0;
            format!("{s:.4},{:.4}\n", (0.3 * s * s + 0.02).sqrt())
        })
        .collect();
    let path = read(&cusp);
    assert!(path.tighter_than(0.6).is_some());
    assert!(path.notes().iter().all(|note| !note.text.contains("noise")), "{:?}", path.notes());
}
