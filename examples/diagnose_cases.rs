//! Diagnoses simulated logs of our own plants, each with one effect (or a pair, or none) put in.
//!
//! ```text
//! diagnose_cases VEHICLE none COUNT SEED            sound logs
//! diagnose_cases VEHICLE moderate|small SEED [ID..]  each effect of the library
//! diagnose_cases VEHICLE pairs COUNT SEED           random pairs, moderate
//! ```
//!
//! A last word `table` prints rows of a Markdown table, as in docs/results/diagnosis.md.

use rfl_mpc::diagnose::simulated::{Conditions, DrivableVehicle, drive};
use rfl_mpc::diagnose::{Diagnosis, Options, diagnose};
use rfl_mpc::numerics::Random;
use rfl_mpc::vehicle::{BUILTIN_TRUCKS, TruckEffects, builtin, builtin_truck};

#[path = "diagnose_cases/values.rs"]
mod values;
use values::{VALUES, of_truck};

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
    if std::env::args().next_back().is_some_and(|word| word == "table") {
        println!("{}", row(label, truth, found, right, in_class));
        return (right, in_class);
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
    if let Some(varies) = &report.verdict.varying {
        text += &format!(" {} varies with {:?}, evidence {:.0}", varies.id, varies.with, varies.evidence);
    }
    if let Some(strained) = &report.verdict.strained {
        text += &format!(" strained: {strained:?}");
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
        if let Some(gap) = report.gap_reduction.open_loop.get(signal) {
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

/// A case as a row: what was put in, what was named, error of the value, exact and in class, the gap that shrinks most.
fn row(label: &str, truth: &[(String, f64)], found: &Diagnosis, right: bool, in_class: bool) -> String {
    let report = &found.report;
    let named: Vec<String> =
        report.verdict.effects.iter().map(|effect| format!("`{}` {:.4}", effect.id, effect.value)).collect();
    let error = truth.first().and_then(|(id, value)| {
        let effect = report.verdict.effects.iter().find(|effect| effect.id == *id)?;
        let neutral = TruckEffects::all().find(|it| it.id == *id).map_or(0.0, |it| it.neutral);
        let from = if neutral.is_finite() { neutral } else { 0.0 };
        Some(100.0 * ((effect.value - from) / (value - from) - 1.0).abs())
    });
    let share = |gap: &rfl_mpc::diagnose::Gap| 1.0 - gap.effect / gap.before.max(1e-12);
    let most = report.gap_reduction.open_loop.iter().max_by(|a, b| share(a.1).total_cmp(&share(b.1)));
    let shrunk = most.map_or(String::new(), |(signal, gap)| {
        let left = 100.0 * (1.0 - gap.recalibrated / gap.before.max(1e-12));
        format!("`{signal}` {:.0} %, {left:.0} %", 100.0 * share(gap))
    });
    let yes = |it: bool| if it { "yes" } else { "no" };
    format!(
        "| {label} | {} | {} | {} | {} | {:.2} | {shrunk} |",
        if named.is_empty() { format!("{:?}", report.verdict.kind) } else { named.join(", ") },
        error.map_or("-".to_owned(), |error| format!("{error:.0} %")),
        yes(right),
        yes(in_class),
        report.verdict.probability,
    )
}

fn conditions(seed: u64, truck: bool) -> Conditions {
    let mut random = Random::stream(seed, 9);
    let _ = random.normal();
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

fn case<V: DrivableVehicle>(vehicle: &V, put_in: &[(String, f64)], seed: u64) -> Option<(bool, bool)> {
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

fn run<V: DrivableVehicle>(vehicle: &V, arguments: &[String]) {
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
            let chosen = arguments.iter().skip(2).any(|word| word != "table");
            for (k, &(id, moderate, little)) in VALUES.iter().enumerate() {
                let known = V::TRUCK || rfl_mpc::vehicle::Effects::find(id).is_some();
                if known && (!chosen || arguments[2..].iter().any(|wanted| wanted == id)) {
                    let value = if small { little } else { moderate };
                    let value = if V::TRUCK { of_truck(id, value) } else { value };
                    count(case(vehicle, &[(id.to_owned(), value)], 1000 * seed + k as u64));
                }
            }
        }
    }
    println!("{} cases: {} named right, {} within the class", counts.0, counts.1, counts.2);
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [vehicle, rest @ ..] = arguments.as_slice() else {
        println!("usage: diagnose_cases VEHICLE none|moderate|small|pairs ... [table]");
        return;
    };
    if rest.is_empty() {
        return;
    }
    if BUILTIN_TRUCKS.contains(&vehicle.as_str()) {
        let truck = builtin_truck(vehicle).expect("built in");
        run(&truck, rest);
    } else {
        let car = builtin(vehicle).expect("built in");
        run(&car, rest);
    }
}
