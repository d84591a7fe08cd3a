//! What commands write: in the folder that the user names and nowhere else, whole or not at all, one run at a time.
#![cfg(unix)]

use crate::command::{done, refused, rfl, road, text};
use crate::drive_table::DriveTable;
use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

fn start(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rfl"));
    command.args(arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// All files below a folder, by their way there.
fn files(folder: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.is_symlink() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(folder).unwrap().to_owned());
            }
        }
    }
    found
}

/// A car of one's own in `a/b/car.toml`, whose tyres lie where `tyres` say.
fn car(folder: &Path, tyres: [&str; 2]) {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles");
    let mut vehicle = fs::read_to_string(project.join("c_class.toml")).unwrap();
    let tyre = vehicle.split('"').find(|part| part.ends_with(".tir")).unwrap().to_owned();
    let bytes = fs::read(project.join(&tyre)).unwrap();
    let home = folder.join("a/b");
    for place in tyres {
        let file = home.join(place);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, &bytes).unwrap();
        vehicle = vehicle.replacen(&format!("\"{tyre}\""), &format!("\"{place}\""), 1);
    }
    fs::write(home.join("car.toml"), vehicle).unwrap();
}

/// Leaves of a drive's log its first half minute: enough to learn from and to diagnose.
fn begin(log: &Path) {
    let table = DriveTable::read(log).keep(|row| row < 1500);
    std::fs::write(log, table.text()).unwrap();
}

#[test]
fn a_vehicle_with_tyres_elsewhere_is_calibrated_inside_the_folder() {
    let outside = tempfile::tempdir().unwrap();
    let absolute = outside.path().join("absolute.tir");
    for (case, tyres) in [
        ["../../report.html", "../../Cargo.toml"],
        ["tyres/front.tir", "../other.tir"],
        [absolute.to_str().unwrap(), "../../../rear.tir"],
    ]
    .into_iter()
    .enumerate()
    {
        let folder = tempfile::tempdir_in(outside.path()).unwrap();
        car(folder.path(), tyres);
        let slow = ["--set", "effect.steer_gain=1.1", "--quiet", "--path", &road(), "--log", "drive.csv"];
        done(&rfl(folder.path(), &[&["drive", "--vehicle", "a/b/car.toml"], &slow[..]].concat()));
        begin(&folder.path().join("drive.csv"));
        let before = files(outside.path());
        // Exit codes tell verdicts apart; what counts here is what is written.
        let told = rfl(
            folder.path(),
            &[
                "diagnose",
                "drive.csv",
                "--vehicle",
                "a/b/car.toml",
                "--out",
                "deep/out",
                "--no-pairs",
                "--quiet",
            ],
        );
        let after = files(outside.path());
        let out = folder.path().strip_prefix(outside.path()).unwrap().join("deep/out");
        let new: Vec<_> = after.difference(&before).collect();
        assert!(new.iter().all(|file| file.starts_with(&out)), "case {case}: {new:?}");
        assert!(new.contains(&&out.join("report.json")), "{}", text(&told.stderr));
        // The calibrated car finds its tyres.
        done(&rfl(
            folder.path(),
            &["drive", "--vehicle", "deep/out/calibrated.toml", "--path", &road(), "--quiet"],
        ));
    }
}

#[test]
fn a_pipe_that_nobody_reads_is_said() {
    use std::io::{BufRead, BufReader};
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut waiting = start(folder.path(), &["course", "--route", "sudoku_turns", "--out", "pipe"]);
    let mut said = String::new();
    BufReader::new(waiting.stderr.as_mut().unwrap()).read_line(&mut said).unwrap();
    assert!(said.contains("pipe: is a pipe") && said.contains("waits"), "{said}");
    assert!(fs::read_to_string(&pipe).unwrap().starts_with("x,"));
    assert!(waiting.wait().unwrap().success());
}

#[test]
fn links_and_devices_stay_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("target.csv"), "old").unwrap();
    symlink("target.csv", at("link.csv")).unwrap();
    done(&rfl(folder.path(), &["course", "--route", "sudoku_turns", "--out", "link.csv"]));
    assert!(at("link.csv").is_symlink() && fs::read_to_string(at("target.csv")).unwrap().starts_with("x,"));
    done(&rfl(folder.path(), &["drive", "--quiet", "--path", "link.csv", "--log", "/dev/null"]));
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
    let full = refused(&rfl(folder.path(), &["course", "--route", "sudoku_turns", "--out", "/dev/full"]));
    assert!(full.contains("/dev/full"), "{full}");
    for (place, words) in [("target.csv/below/model.rflm", "target.csv"), (".", "is a folder")] {
        let error = refused(&rfl(folder.path(), &["train", "target.csv", "--out", place]));
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn what_a_killed_run_left_half_written_is_taken_away() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let road = road();
    let leave = |file: &str| {
        fs::create_dir_all(at(file).parent().unwrap()).unwrap();
        fs::write(at(file), "half").unwrap();
    };
    for (left, command) in [
        (
            "c/.drive_9.csv.1.4.part",
            &["collect", "--path", &road, "--runs", "1", "--out", "c", "--quiet"][..],
        ),
        (
            ".own.json.77.0.part",
            &["drive", "--path", &road, "--duration", "1", "--log", "own.csv", "--quiet"],
        ),
        ("p/.smooth.csv.1.0.part", &["path", &road, "--write", "p/smooth.csv"]),
    ] {
        leave(left);
        done(&rfl(folder.path(), command));
        assert!(!at(left).exists(), "{left}");
    }
    let hidden = |file: &PathBuf| file.file_name().unwrap().to_string_lossy().starts_with('.');
    assert!(!files(folder.path()).iter().any(hidden));
}

#[test]
fn two_runs_do_not_share_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let collect = |seed: &'static str| {
        let road = road();
        start(
            folder.path(),
            &["collect", "--path", &road, "--runs", "2", "--seed", seed, "--out", "c", "--quiet"],
        )
    };
    let runs = [collect("1"), collect("50")].map(|run| run.wait_with_output().unwrap());
    let went = runs.iter().filter(|run| run.status.success()).count();
    assert!(went >= 1, "{}", text(&runs[0].stderr));
    for run in runs.iter().filter(|run| !run.status.success()) {
        assert!(text(&run.stderr).contains("another run writes to this folder"), "{}", text(&run.stderr));
    }
    let names: Vec<_> = files(&folder.path().join("c")).into_iter().collect();
    assert_eq!(names, [Path::new("drive_1.csv"), Path::new("drive_2.csv")]);
    // After that the folder is free again.
    done(&collect("7").wait_with_output().unwrap());
}

/// `RFL_KILLS=N` kills each command N times (default 5, and the short ones only).
#[test]
fn what_a_killed_run_leaves_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let road = road();
    let run = |arguments: &[&str]| done(&rfl(folder.path(), arguments));
    run(&["collect", "--path", &road, "--runs", "1", "--out", "good", "--quiet"]);
    begin(&folder.path().join("good/drive_1.csv"));
    let train = ["train", "good/drive_1.csv", "--quiet", "--no-proof", "--trees", "3", "--depth", "3"];
    let mut commands: Vec<Vec<&str>> = vec![
        vec!["collect", "--path", &road, "--runs", "3", "--out", "logs", "--quiet"],
        [&train[..], &["--out", "models/rfl_s.rflm", "--json", "models/fit.json"]].concat(),
        vec!["course"],
        vec!["path", &road, "--write", "roads/smooth.csv"],
        vec!["drive", "--quiet", "--path", &road, "--log", "logs/own.csv", "--json", "logs/own.json"],
        vec![
            "identify",
            "good/drive_1.csv",
            "--no-check",
            "--into",
            "cars/own.toml",
            "--json",
            "cars/own.json",
        ],
        vec!["diagnose", "good/drive_1.csv", "--no-pairs", "--quiet", "--out", "report"],
    ];
    let kills = std::env::var("RFL_KILLS").ok().map(|count| count.parse().unwrap());
    // These take too long for a few kills each.
    if kills.is_some() {
        let tune = ["--budget", "2", "--scenarios", "2", "--held-out", "2", "--out", "tune", "--quiet"];
        commands.push([&["tune", "--path", &road][..], &tune].concat());
        commands.push(vec![
            "learn", "--path", &road, "--test", &road, "--roads", "1", "--out", "learn", "--quiet",
        ]);
        let rows =
            ["--rows", "linear", "--plants", "as_is", "--noise", "off", "--out", "evaluate", "--quiet"];
        commands.push([&["evaluate", "--quick", "--budget", "1"][..], &rows].concat());
    }
    let kills = kills.unwrap_or(5);
    let mut random = rfl_mpc::numerics::Random::new(1);
    for command in &commands {
        let begin = std::time::Instant::now();
        let whole = start(folder.path(), command).wait_with_output().unwrap();
        assert!(whole.status.code().is_some_and(|code| code < 2), "{command:?}: {}", text(&whole.stderr));
        let takes = begin.elapsed();
        for _ in 0..kills {
            let mut child = start(folder.path(), command);
            std::thread::sleep(Duration::from_secs_f64(takes.as_secs_f64() * random.uniform()));
            // It may have ended before.
            let _ = child.kill();
            child.wait().unwrap();
            for file in files(folder.path()) {
                check_whole(&folder.path().join(file));
            }
        }
    }
}

/// What a later command would take for good is good.
fn check_whole(file: &Path) {
    let name = file.to_string_lossy().into_owned();
    if name.ends_with(".part") {
        return;
    }
    let bytes = fs::read(file).unwrap();
    let ends = |end: &str| name.ends_with(end);
    if ends(".csv") {
        let rows: Vec<_> = std::str::from_utf8(&bytes).unwrap().split_terminator('\n').collect();
        assert!(bytes.ends_with(b"\n") && rows.len() > 5, "{name}");
        let commas = |row: &str| row.matches(',').count();
        assert!(rows.iter().all(|row| commas(row) == commas(rows[0])), "{name}");
    } else if ends(".json") {
        serde_json::from_slice::<serde_json::Value>(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
    } else if ends(".rflm") {
        rfl_mpc::residual::ResidualModel::from_bytes(&bytes)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
    } else if ends(".html") {
        assert!(String::from_utf8(bytes).unwrap().trim_end().ends_with("</html>"), "{name}");
    } else if ends(".toml") {
        toml::from_str::<toml::Table>(std::str::from_utf8(&bytes).unwrap()).unwrap();
    }
}

#[test]
fn a_folder_s_files_are_none_of_those_that_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("out")).unwrap();
    fs::copy(road(), at("out/drive_2.csv")).unwrap();
    fs::copy(road(), at("out/drive.csv")).unwrap();
    let car = Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles/c_class.toml");
    let car = fs::read_to_string(car)
        .unwrap()
        .replace("tyres/", &format!("{}/vehicles/tyres/", env!("CARGO_MANIFEST_DIR")));
    for name in ["controller.toml", "calibrated.toml"] {
        fs::write(at("out").join(name), &car).unwrap();
    }
    done(&rfl(folder.path(), &["drive", "--quiet", "--path", &road(), "--log", "log.csv"]));
    let content = || {
        files(folder.path())
            .into_iter()
            .map(|file| fs::read(at(file.to_str().unwrap())).unwrap())
            .collect::<Vec<_>>()
    };
    let before = content();
    for (arguments, option) in [
        (&["collect", "--path", "out/drive_2.csv"][..], "--path"),
        (&["learn", "--path", "out/drive.csv"], "--path"),
        (&["learn", "--test", "out/drive.csv"], "--test"),
        (&["learn", "--vehicle", "out/controller.toml"], "--vehicle"),
        (&["tune", "--vehicle", "out/controller.toml"], "--vehicle"),
        (&["diagnose", "log.csv", "--vehicle", "out/calibrated.toml"], "--vehicle"),
    ] {
        let error = refused(&rfl(folder.path(), &[arguments, &["--quiet", "--out", "out"]].concat()));
        assert!(error.contains(&format!("is the file of {option}, and would be written over")), "{error}");
        assert!(content() == before, "{arguments:?}");
    }
}
