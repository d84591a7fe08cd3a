//! Hostile input at every border where a file comes in: no panic, no hang (1 s for an input), no memory without bound (200 MB).
//!
//! `RFL_FUZZ=N` tries N inputs for each format (default 300), from the seed `RFL_FUZZ_SEED` (default 1). The states of FMUs are in
//! `fmi_hostile_states.rs`.

use crate::counting::{peak, took};
use crate::sealed::{parts, sealed};
use rfl_mpc::log::{CleanLog, DriveLog};
use rfl_mpc::numerics::Random;
use rfl_mpc::path::{Path, PathOptions};
use rfl_mpc::residual::gp::GpModel;
use rfl_mpc::residual::{ResidualModel, TrainConfig, train};
use rfl_mpc::table::{Limits, Table};
use rfl_mpc::vehicle::tyre::Coefficients;
use rfl_mpc::vehicle::{CarParameters, VehicleParameters};
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path as FilePath;
use std::time::Duration;

const MEMORY: isize = 200 << 20;
const LONGEST: Duration = Duration::from_secs(1);

/// What people and attackers write into fields.
const TOKENS: [&str; 26] = [
    "",
    "nan",
    "-inf",
    "1e308",
    "-1e308",
    "1e-320",
    "0",
    "-0.0",
    "1",
    "9999999999999999999999",
    "0x10",
    "1_000",
    "1,5",
    "x",
    "\"",
    "\"\"\"",
    "#",
    ";",
    "\t",
    "[",
    "]",
    "=",
    "\0",
    "\u{feff}",
    "ä",
    "2024-05-01T12:00:00Z",
];

/// Damages some places.
fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    let mut pick = |count: usize| ((random.uniform() * count as f64) as usize).min(count.saturating_sub(1));
    for _ in 0..=pick(4) {
        if bytes.is_empty() {
            return;
        }
        let at = pick(bytes.len());
        let word = |byte: &u8| byte.is_ascii_alphanumeric() || b".-+_".contains(byte);
        match pick(9) {
            0 => bytes[at] ^= 1 << pick(8),
            1 => bytes[at] = pick(256) as u8,
            2 => bytes.truncate(at),
            3 => {
                // A whole field.
                let end = at + bytes[at..].iter().position(|byte| !word(byte)).unwrap_or(bytes.len() - at);
                let begin = bytes[..at].iter().rposition(|byte| !word(byte)).map_or(0, |place| place + 1);
                bytes.splice(begin..end.max(begin), TOKENS[pick(TOKENS.len())].bytes());
            }
            4 => drop(bytes.splice(at..at, TOKENS[pick(TOKENS.len())].bytes())),
            5 => {
                // A piece again, once or many times.
                let piece = bytes[at..(at + 1 + pick(60)).min(bytes.len())].to_vec();
                let times = [1, 2, 100][pick(3)];
                bytes.splice(at..at, piece.repeat(times));
            }
            6 => drop(bytes.drain(at..(at + pick(200)).min(bytes.len()))),
            7 => {
                let other = pick(bytes.len());
                bytes.swap(at, other);
            }
            _ => {
                let numbers = [f64::NAN, f64::INFINITY, 1e300, -1.0, 1e-300];
                for (to, from) in bytes[at..].iter_mut().zip(numbers[pick(numbers.len())].to_le_bytes()) {
                    *to = from;
                }
            }
        }
    }
}

fn fuzz(good: &[Vec<u8>], take: impl Fn(&[u8]) -> bool) {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    let (count, first) = (number("RFL_FUZZ", 300), number("RFL_FUZZ_SEED", 1));
    for (place, good) in good.iter().enumerate() {
        assert!(take(good), "good input {place} is refused");
    }
    let (mut taken, mut longest, mut most) = (0, Duration::ZERO, 0);
    for seed in first..first + count {
        let mut random = Random::new(seed);
        let mut bytes = good[(seed % good.len() as u64) as usize].clone();
        damage(&mut bytes, &mut random);
        let mut outcome = Ok(false);
        let mut memory = 0;
        let elapsed = took(|| memory = peak(|| outcome = catch_unwind(AssertUnwindSafe(|| take(&bytes)))));
        match outcome {
            Ok(good) => taken += u64::from(good),
            Err(_) => panic!("input {seed} ends in a panic: {:?}", String::from_utf8_lossy(&bytes)),
        }
        assert!(elapsed < LONGEST, "input {seed} takes {elapsed:?}: {}", String::from_utf8_lossy(&bytes));
        assert!(memory < MEMORY, "input {seed} takes {memory} bytes: {}", String::from_utf8_lossy(&bytes));
        (longest, most) = (longest.max(elapsed), most.max(memory));
    }
    let longest = 1e3 * longest.as_secs_f64();
    println!("{count} inputs, {taken} taken, longest {longest:.3} ms, most memory {} kB", most >> 10);
}

/// Two ways to write a table of some columns.
fn tables(names: &[&str], rows: usize, value: impl Fn(usize, usize) -> f64) -> Vec<Vec<u8>> {
    let write = |delimiter: &str, comma: bool| {
        let mut text = format!("{}\n", names.join(delimiter));
        for row in 0..rows {
            let fields = (0..names.len()).map(|column| format!("{:.5}", value(row, column)));
            let line = fields.collect::<Vec<_>>().join(delimiter);
            writeln!(text, "{}", if comma { line.replace('.', ",") } else { line }).unwrap();
        }
        text.into_bytes()
    };
    vec![write(",", false), write(";", true)]
}

fn roads() -> Vec<Vec<u8>> {
    let point = |row: usize, column: usize| {
        let s = 2.0 * row as f64;
        [s, 0.02 * s * s / 2.0, 8.0, 1.0][column]
    };
    let mut roads = tables(&["x", "y", "speed", "friction"], 25, point);
    roads.extend(tables(&["lat", "lon"], 25, |row, column| 48.0 + 1e-4 * (row * (column + 1)) as f64));
    roads
}

fn logs() -> Vec<Vec<u8>> {
    let names = ["time", "steer_cmd", "vx", "yaw_rate", "ay", "x", "y"];
    let signal = |row: usize, column: usize| {
        let t = 0.1 * row as f64;
        let steer = 0.03 * (0.9 * t).sin() + 0.01 * (2.3 * t).sin();
        [t, steer, 10.0, 3.4 * steer, 34.0 * steer, 10.0 * t, 0.1 * steer][column]
    };
    tables(&names, 150, signal)
}

#[test]
fn tables_of_any_kind() {
    let known = |name: &str| ["x", "y", "time", "vx"].contains(&name);
    fuzz(&[roads(), logs()].concat(), |bytes| {
        let Ok(mut table) = Table::new(bytes, Limits::default(), &known) else { return false };
        while let Ok(Some(row)) = table.next_row() {
            let _ = (row.field(0).len(), row.number(1));
        }
        true
    });
}

#[test]
fn roads_of_any_kind() {
    fuzz(&roads(), |bytes| Path::from_csv(bytes, FilePath::new("road.csv"), &PathOptions::default()).is_ok());
}

#[test]
fn logs_of_any_kind() {
    fuzz(&logs(), |bytes| {
        let log = DriveLog::from_reader(bytes, FilePath::new("log.csv"));
        log.is_ok_and(|log| CleanLog::of(&log, &|speed| 2.9 + 0.002 * speed * speed).is_ok())
    });
}

#[test]
fn tyres_of_any_kind() {
    let file = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("vehicles/tyres/c_class.tir");
    fuzz(&[std::fs::read(file).unwrap()], |bytes| {
        Coefficients::parse(&String::from_utf8_lossy(bytes), FilePath::new("tyre.tir")).is_ok()
    });
}

#[test]
fn vehicles_of_any_kind() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("car.toml");
    let vehicles = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("vehicles");
    let tyre = "c_class.tir";
    std::fs::copy(vehicles.join("tyres").join(tyre), folder.path().join(tyre)).unwrap();
    fuzz(&[std::fs::read(vehicles.join("c_class.toml")).unwrap()], |bytes| {
        std::fs::write(&file, bytes).unwrap();
        CarParameters::of_file(&file).is_ok()
    });
}

/// A model's file whose first line fits its body again.
fn resealed(kind: &str, bytes: &[u8]) -> Vec<u8> {
    parts(bytes).map_or_else(|| bytes.to_vec(), |(head, numbers)| sealed(kind, head, numbers))
}

#[test]
fn models_of_any_kind() {
    use crate::residual_plant::{Plant, data};
    use rfl_mpc::residual::Kind;
    let samples = data(&Plant { lag: 0.1, noise: 1.0, ..Plant::exact() }, &[6.0, 10.0], 800, 1);
    let model = |kind| {
        let config = TrainConfig { trees: 2, depth: 2, window: 4, ..TrainConfig::new(kind) };
        train(&samples, None, &config, &|_| ()).unwrap().model.to_bytes().unwrap()
    };
    fuzz(&[model(Kind::Rfl), model(Kind::RflS), model(Kind::Rt)], |bytes| {
        // As it comes, and with a right checksum.
        let whole = ResidualModel::from_bytes(bytes).is_ok();
        whole | ResidualModel::from_bytes(&resealed("rfl-residual", bytes)).is_ok()
    });
}

#[test]
fn processes_of_any_kind() {
    fuzz(&[crate::gp_file::file().to_vec()], |bytes| {
        GpModel::from_bytes(bytes).is_ok() | GpModel::from_bytes::<4>(&resealed("rfl-gp", bytes)).is_ok()
    });
}
