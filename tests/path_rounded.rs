//! Roads with coordinates in coarse steps: rounding is noise, and no bends; what was drawn on a grid is exact.

use rfl_mpc::path::{Closure, Path, PathOptions, RandomRoad, Sample, Smoothing, SpeedLimits, SpeedPlan};
use std::fmt::Write as _;
use std::path::Path as FilePath;

fn read(csv: &str, options: &PathOptions) -> Path {
    Path::from_csv(csv.as_bytes(), FilePath::new("road.csv"), options).unwrap()
}

/// Points of a road at a spacing, rounded to a step.
fn rounded(road: &Path, spacing: f64, step: f64) -> String {
    let mut csv = "x,y\n".to_owned();
    for Sample { x, y, .. } in road.samples(spacing) {
        let [x, y] = [x, y].map(|value| (value / step).round() * step);
        let _ = writeln!(csv, "{x:.2},{y:.2}");
    }
    csv
}

/// Largest distance, m, and largest difference of curvature from a road, and the ratio of both planned times.
fn against(found: &Path, road: &Path) -> [f64; 3] {
    let (mut off, mut bend, mut hint) = (0.0_f64, 0.0_f64, None);
    for k in 20..(road.length() - 10.0) as u32 * 2 {
        let at = road.at(0.5 * f64::from(k));
        let near = found.project(at.x, at.y, at.yaw, hint);
        hint = Some(near.station);
        off = off.max(near.e1.abs());
        bend = bend.max((near.curvature - at.curvature).abs());
    }
    let time = |path: &Path| SpeedPlan::new(path, &SpeedLimits::default()).duration();
    [off, bend, time(found) / time(road)]
}

#[test]
fn a_rounded_road_is_the_road() {
    for (seed, closed) in [(811, false), (812, true), (813, false)] {
        let road = RandomRoad { closed, ..RandomRoad::CAR }.path(seed).unwrap();
        for (step, spacing) in
            [(0.1, 0.5), (0.1, 1.0), (0.1, 5.0), (0.25, 2.0), (0.5, 2.0), (1.0, 1.0), (1.0, 2.0), (1.0, 5.0)]
        {
            let csv = rounded(&road, spacing, step);
            let found = read(&csv, &PathOptions::default());
            let [off, bend, time] = against(&found, &road);
            println!("{seed}: {step} m, {spacing} m apart: {off:.3} m, {bend:.4} 1/m, time {time:.3}");
            assert_eq!(found.is_periodic(), closed, "{step} {spacing}");
            assert!(off < 0.8 * step + 0.1, "{step} {spacing}: {off} m off");
            assert!((0.93..1.1).contains(&time), "{step} {spacing}: {time} of the time");
            let said: Vec<_> = found.notes().iter().map(|note| note.text.as_str()).collect();
            let step_said =
                |text: &&str| text.contains(&format!("multiples of {step} m")) && text.contains("--smooth 0");
            // Far apart against the step, what a bend leaves of the fit may look like more noise than rounding makes.
            let as_noise = |text: &&str| spacing >= 8.0 * step && text.contains("measured noise");
            let is_said = said.iter().any(|text| step_said(text) || as_noise(text));
            assert!(is_said, "{step} {spacing}: {said:?}");
            // As given, on demand.
            let exact =
                read(&csv, &PathOptions { smoothing: Smoothing::Within(0.0), ..PathOptions::default() });
            assert!(!exact.notes().iter().any(|note| note.text.contains("smoothed")));
        }
    }
}

/// Straights along an axis have no rounding, and hide that of the bends from a median.
#[test]
fn straights_along_an_axis_do_not_hide_the_rounding() {
    let mut samples: Vec<Sample> = (0..260).map(|k| Sample::at(f64::from(k), 0.0)).collect();
    let bend = (1..=94).map(|k| f64::from(k) / 60.0);
    samples.extend(bend.map(|t| Sample::at(259.0 + 60.0 * t.sin(), 60.0 - 60.0 * t.cos())));
    samples.extend((1..200).map(|k| Sample::at(319.0, 60.0 + f64::from(k))));
    let road = Path::from_samples(samples, Closure::Open).unwrap();
    for (step, spacing) in [(1.0, 1.0), (1.0, 2.0), (0.5, 1.0)] {
        let found = read(&rounded(&road, spacing, step), &PathOptions::default());
        let [off, bend, time] = against(&found, &road);
        println!("{step} m, {spacing} m apart: {off:.3} m, {bend:.4} 1/m, time {time:.3}");
        assert!(off < 0.8 * step && (0.95..1.05).contains(&time), "{step} {spacing}: {off} m, {time}");
    }
}

#[test]
fn a_road_that_was_drawn_on_a_grid_is_exact() {
    let straight: String = (0..100).map(|k| format!("{},{}\n", 3 * k, 4 * k)).collect();
    let few = "0,0\n20,0\n40,5\n60,20\n80,40\n".to_owned();
    let half: String = (0..60).map(|k| format!("{:.1},0\n", 0.5 * f64::from(k))).collect();
    for rows in [straight, few, half] {
        let csv = format!("x,y\n{rows}");
        let path = read(&csv, &PathOptions { closure: Closure::Open, ..PathOptions::default() });
        assert!(!path.notes().iter().any(|note| note.text.contains("smoothed")), "{:?}", path.notes());
    }
}
