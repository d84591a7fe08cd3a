//! Diagnoses simulated logs of our own plants, each with one effect (or a pair, or none) put in, or a recorded log.
//!
//! ```text
//! diagnose_cases VEHICLE none COUNT SEED            sound logs
//! diagnose_cases VEHICLE moderate|small SEED [ID..]  each effect of the library
//! diagnose_cases VEHICLE pairs COUNT SEED           random pairs, moderate
//! diagnose_cases VEHICLE log FILE [REFERENCE]        a recorded log as it is (clean, even clock)
//! ```

use rfl_mpc::diagnose::simulated::{Conditions, SimulatedVehicle, drive, normal};
use rfl_mpc::diagnose::{Diagnosis, Options, diagnose};
use rfl_mpc::log::{CleanLog, DriveLog};
use rfl_mpc::residual::Random;
use rfl_mpc::vehicle::{BUILTIN_TRUCKS, TruckEffects, builtin, builtin_truck};
use std::collections::BTreeMap;
use std::path::Path;

#[path = "diagnose_cases/values.rs"]
mod values;
use values::VALUES;

fn line(label: &str, truth: &[(String, f64)], found: &Diagnosis, seconds: f64) -> (bool, bool) {
    let report = &found.report;
    let names: Vec<&str> = report.verdict.effects.iter().map(|effect| effect.id.as_str()).collect();
    let mut right = !truth.is_empty() || names.is_empty();
    let mut in_class = right;
    if !truth.is_empty() {
        right = names.len() == truth.len() && truth.iter().all(|(id, _)| names.contains(&id.as_str()));
        in_class = truth.iter().all(|(id, _)| {
            report.verdict.effects.iter().any(|effect| effect.class.iter().any(|member| member == id))
        });
    }
    let mut text = format!("{label:34} {:?} p {:.2}", report.verdict.kind, report.verdict.probability);
    for effect in &report.verdict.effects {
        text += &format!(
            " | {} = {:.4} [{:.4}, {:.4}] d {:.1} {:?}",
            effect.id, effect.value, effect.low, effect.high, effect.dominance, effect.class
        );
    }
    text += " |";
    for candidate in report.candidates.iter().take(3) {
        text += &format!(" {} {:.0},", candidate.effects.join("+"), candidate.evidence);
    }
    if let Some((id, _)) = truth.first() {
        let rank =
            report.candidates.iter().filter(|c| c.effects.len() == 1).position(|c| c.effects[0] == *id);
        text += &format!(" truth at {rank:?}");
        if let Some(candidate) =
            report.candidates.iter().find(|c| c.effects.len() == 1 && c.effects[0] == *id)
        {
            text += &format!(" {:.4} ({:.0})", candidate.values[0], candidate.evidence);
        }
    }
    for signal in ["yaw_rate", "ay", "vy"] {
        if let Some(gap) = report.shrink.open_loop.get(signal) {
            text += &format!(
                " | {signal} {:.4} > {:.4} > {:.4} ({:.4}; {:.4})",
                gap.before,
                gap.effect,
                gap.recalibrated,
                gap.learnable.unwrap_or(f64::NAN),
                gap.noise
            );
        }
    }
    println!("{}{} {text} {seconds:.1} s", if right { '+' } else { '-' }, if in_class { '+' } else { '-' });
    (right, in_class)
}

fn conditions(seed: u64, truck: bool) -> Conditions {
    let mut random = Random::stream(seed, 9);
    let _ = normal(&mut random);
    let speed = if truck { (6.0, 19.0) } else { (7.0, 20.0 + 8.0 * random.uniform()) };
    let lateral = if truck { 1.5 + 1.0 * random.uniform() } else { 2.5 + 3.0 * random.uniform() };
    Conditions {
        seed,
        duration: 60.0,
        speed,
        lateral,
        quick: 0.15 + 0.25 * random.uniform(),
        ..Conditions::default()
    }
}

fn case<V: SimulatedVehicle>(vehicle: &V, put_in: &[(String, f64)], seed: u64) -> Option<(bool, bool)> {
    let mut effects = TruckEffects::default();
    for (id, value) in put_in {
        *effects.get_mut(id)? = *value;
    }
    let log = drive(vehicle, &effects, &conditions(seed, V::TRUCK))?;
    let begin = std::time::Instant::now();
    let label: Vec<String> = put_in.iter().map(|(id, value)| format!("{id} {value}")).collect();
    match diagnose(&log, None, vehicle, &Options::default(), &|_, _| {}) {
        Ok(found) => Some(line(&label.join(" + "), put_in, &found, begin.elapsed().as_secs_f64())),
        Err(error) => {
            println!("{} {error}", label.join(" + "));
            None
        }
    }
}

fn run<V: SimulatedVehicle>(vehicle: &V, arguments: &[String]) {
    let number = |i: usize, or: u64| arguments.get(i).and_then(|text| text.parse().ok()).unwrap_or(or);
    let mut counts = (0, 0, 0);
    let mut count = |result: Option<(bool, bool)>| {
        if let Some((right, in_class)) = result {
            counts = (counts.0 + 1, counts.1 + usize::from(right), counts.2 + usize::from(in_class));
        }
    };
    let small = arguments[0] == "small";
    match arguments[0].as_str() {
        "none" => (0..number(1, 8)).for_each(|k| count(case(vehicle, &[], number(2, 1) + k))),
        "pairs" => {
            let all: Vec<_> = VALUES
                .iter()
                .filter(|(id, ..)| V::TRUCK || rfl_mpc::vehicle::Effects::find(id).is_some())
                .collect();
            for k in 0..number(1, 10) {
                let mut random = Random::stream(number(2, 1) + k, 21);
                let (a, b) =
                    (random.below(all.len() as u32) as usize, random.below(all.len() as u32) as usize);
                if a != b {
                    let pair = [(all[a].0.to_owned(), all[a].1), (all[b].0.to_owned(), all[b].1)];
                    count(case(vehicle, &pair, number(2, 1) + k));
                }
            }
        }
        _ => {
            let seed = number(1, 1);
            for (k, &(id, moderate, little)) in VALUES.iter().enumerate() {
                let known = V::TRUCK || rfl_mpc::vehicle::Effects::find(id).is_some();
                if known && (arguments.len() < 3 || arguments[2..].iter().any(|wanted| wanted == id)) {
                    let value = if small { little } else { moderate };
                    let value = match id {
                        "payload" if V::TRUCK => 5.0 * value,
                        "brake_pull" if V::TRUCK => 8.0 * value,
                        _ => value,
                    };
                    count(case(vehicle, &[(id.to_owned(), value)], 1000 * seed + k as u64));
                }
            }
        }
    }
    println!("{} cases: {} named right, {} within the class", counts.0, counts.1, counts.2);
}

fn read(file: &str) -> CleanLog {
    let log = DriveLog::read(Path::new(file)).expect("a log");
    let names = [
        "steer_cmd",
        "accel_cmd",
        "x",
        "y",
        "yaw",
        "vx",
        "vy",
        "yaw_rate",
        "ax",
        "ay",
        "steer",
        "roll",
        "articulation",
        "articulation_rate",
    ];
    let time = log.column("time").expect("time").to_vec();
    let rows = (time[time.len() - 1] - time[0]) / 0.01;
    let clock: Vec<f64> = (0..rows as usize).map(|i| time[0] + 0.01 * i as f64).collect();
    let mut columns: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for name in names {
        let Some(column) = log.column(name) else { continue };
        let mut at = 0;
        let even = clock.iter().map(|&t| {
            while at + 2 < time.len() && time[at + 1] <= t {
                at += 1;
            }
            let share = ((t - time[at]) / (time[at + 1] - time[at])).clamp(0.0, 1.0);
            column[at] + share * (column[at + 1] - column[at])
        });
        columns.insert(name, even.collect());
    }
    let commanded = columns.contains_key("steer_cmd");
    if !commanded {
        let steer = columns["steer"].clone();
        columns.insert("steer_cmd", steer);
    }
    let valid = vec![true; clock.len()];
    CleanLog { step: 0.01, time: clock, columns, commanded, valid, findings: Vec::new() }
}

/// A log with something done to its steering column: `file`, or `file:shift=0.12`, `file:add=0.0175`, `file:times=1.1`.
fn prepared(text: &str) -> CleanLog {
    let (file, change) = text.split_once(':').unwrap_or((text, ""));
    let mut log = read(file);
    if let Some((what, by)) = change.split_once('=') {
        let by: f64 = by.parse().expect("a number");
        let steer = log.columns["steer"].clone();
        let changed: Vec<f64> = (0..steer.len())
            .map(|i| match what {
                // The column shows now what the wheels do later.
                "shift" => steer[(i + (by / log.step) as usize).min(steer.len() - 1)],
                "add" => steer[i] + by,
                _ => steer[i] * by,
            })
            .collect();
        log.columns.insert("steer", changed.clone());
        log.columns.insert("steer_cmd", changed);
    }
    log
}

fn recorded<V: SimulatedVehicle>(vehicle: &V, files: &[String]) {
    let log = prepared(&files[0]);
    let reference = files.get(1).map(|file| prepared(file));
    let begin = std::time::Instant::now();
    let found = diagnose(&log, reference.as_ref(), vehicle, &Options::default(), &|_, _| {}).expect("a log");
    line(&files[0], &[], &found, begin.elapsed().as_secs_f64());
    println!("{}", found.report.verdict.words);
    for candidate in found.report.candidates.iter().take(14) {
        println!(
            "  {:40} {:?} {:.1}  {}",
            candidate.effects.join(" + "),
            candidate.values,
            candidate.evidence,
            candidate.why
        );
    }
    for (signal, gap) in &found.report.shrink.open_loop {
        println!(
            "  {signal:18} {:.5} > {:.5} > {:.5}  learnable {:.5}  noise {:.5}",
            gap.before,
            gap.effect,
            gap.recalibrated,
            gap.learnable.unwrap_or(f64::NAN),
            gap.noise
        );
    }
    for (horizon, gaps) in &found.report.shrink.horizons {
        for (signal, gap) in gaps {
            println!(
                "  {horizon} s {signal:14} {:.5} > {:.5} > {:.5}  noise {:.5}",
                gap.before, gap.effect, gap.recalibrated, gap.noise
            );
        }
    }
    for it in &found.report.recalibration {
        println!(
            "  {:34} {:.5} -> {:.5} (tolerance {:.5}, deviation {:.5})",
            it.parameter, it.given, it.value, it.tolerance, it.deviation
        );
    }
    for it in &found.report.observability {
        println!("  {:24} {} {}", it.effect, it.observable, it.why);
    }
    for place in found.report.places.iter().take(8) {
        println!("  {place:?}");
    }
    println!("  {:?}", found.report.next_manoeuvre);
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [vehicle, rest @ ..] = arguments.as_slice() else {
        println!("usage: diagnose_cases VEHICLE none|moderate|small|pairs|log ...");
        return;
    };
    if rest.is_empty() {
        return;
    }
    if BUILTIN_TRUCKS.contains(&vehicle.as_str()) {
        let truck = builtin_truck(vehicle).expect("built in");
        if rest[0] == "log" { recorded(&truck, &rest[1..]) } else { run(&truck, rest) }
    } else {
        let car = builtin(vehicle).expect("built in");
        if rest[0] == "log" { recorded(&car, &rest[1..]) } else { run(&car, rest) }
    }
}
