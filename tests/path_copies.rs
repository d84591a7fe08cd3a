//! Public circuits, and what people make of them on the way (noise, fewer points, another direction, points and laps twice), are driven
//! near the true line: within 0.3 m of what racetrack-database gives.
//!
//! The circuits are data from outside: where `../shared/data/paths` is absent the test skips and says so.

use crate::command::{done, rfl};
use rfl_mpc::numerics::Random;
use rfl_mpc::path::Path;
use std::fmt::Write;
use std::path::{Path as FilePath, PathBuf};

fn circuits() -> Vec<PathBuf> {
    let folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/paths");
    let files = std::fs::read_dir(&folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    let is_track = |file: &PathBuf| {
        std::fs::read_to_string(file).is_ok_and(|text| text.starts_with("# x_m,y_m,w_tr_right_m"))
    };
    let mut circuits: Vec<_> = files.filter(is_track).collect();
    circuits.sort();
    if circuits.is_empty() {
        eprintln!("SKIPPED: no circuits in {}", folder.display());
    }
    circuits
}

/// The true line, point by point each `spacing` metres, round once.
fn points(line: &Path, spacing: f64) -> Vec<[f64; 2]> {
    let count = (line.length() / spacing).round();
    let at = |k: f64| line.at(line.length() * k / count);
    (0..count as usize).map(|k| at(k as f64)).map(|pose| [pose.x, pose.y]).collect()
}

/// Noise of a variance, some of it slow, as a receiver's is.
fn noisy(points: &[[f64; 2]], size: f64) -> Vec<[f64; 2]> {
    let mut random = Random::new(5);
    let mut draw = || size * ((0..12).map(|_| random.uniform()).sum::<f64>() - 6.0);
    points.iter().map(|[x, y]| [x + draw(), y + draw()]).collect()
}

fn copies(line: &Path) -> Vec<(&'static str, Vec<[f64; 2]>)> {
    let exact = points(line, 5.0);
    let reversed: Vec<_> = exact.iter().rev().copied().collect();
    let twice = exact.iter().flat_map(|&point| [point, point]).collect();
    vec![
        ("as it is", exact.clone()),
        ("noise of 2 cm, 1 m apart", noisy(&points(line, 1.0), 0.02)),
        ("noise of 10 cm, 1 m apart", noisy(&points(line, 1.0), 0.1)),
        ("each second point", exact.iter().step_by(2).copied().collect()),
        ("points 0.2 m apart", points(line, 0.2)),
        ("reversed", reversed),
        ("points twice", twice),
        ("two laps", [&exact[..], &exact[..]].concat()),
    ]
}

#[test]
fn copies_of_public_circuits_are_driven_near_the_true_line() {
    let mut far = Vec::new();
    for file in circuits() {
        let line = Path::read(&file).unwrap();
        for (what, points) in copies(&line) {
            let folder = tempfile::tempdir().unwrap();
            let mut text = String::from("x,y\n");
            points.iter().for_each(|[x, y]| writeln!(text, "{x:.4},{y:.4}").unwrap());
            std::fs::write(folder.path().join("road.csv"), text).unwrap();
            done(&rfl(folder.path(), &["drive", "--path", "road.csv", "--quiet", "--log", "drive.csv"]));
            let log = std::fs::read_to_string(folder.path().join("drive.csv")).unwrap();
            let mut rows = log.lines().map(|row| row.split(',').collect::<Vec<_>>());
            let header = rows.next().unwrap();
            let [x, y] = ["x", "y"].map(|name| header.iter().position(|other| *other == name).unwrap());
            let off = rows.map(|row| {
                let [x, y] = [x, y].map(|place| row[place].parse::<f64>().unwrap());
                line.project(x, y, 0.0, None).e1.abs()
            });
            let most = off.fold(0.0, f64::max);
            println!("{}, {what}: {most:.3} m", file.file_stem().unwrap().display());
            if most > 0.3 {
                far.push(format!("{}, {what}: {most:.2} m", file.display()));
            }
        }
    }
    assert!(far.is_empty(), "{far:#?}");
}
