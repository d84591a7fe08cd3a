//! Result of the tuning: on the terminal, in the controller's file and in `tune.json`.

use super::super::output::write_text;
use super::super::vehicle::Commanded;
use super::family::{FASTEST, TuneData};
use crate::control::{ControlVariant, ControllerFile, Margins};
use crate::diagnose::page::{AtSpeed, Tuned};
use crate::simulate::tune::{ControllerNumbers, TuneCandidate, number_of};
use crate::vehicle::VehicleParameters as _;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::error::Error;

impl<P, const S: usize, const C: usize> TuneData<'_, P, S, C>
where
    P: Commanded<S, C, Effects: Sync, Nominal: Sync>,
{
    /// The result in words, with the controller's file written if it is better.
    pub fn write_controller(
        &self,
        content: &ControllerFile,
        better: bool,
        held_out: [&TuneCandidate; 2],
    ) -> Result<String, Box<dyn Error>> {
        let file = self.args.out.join("controller.toml");
        let words = if better {
            let price = price(held_out).map_or_else(String::new, |price| format!("; {price}"));
            format!(
                "written to {}: rfl drive --vehicle {} --controller {}{price}",
                file.display(),
                self.args.vehicle,
                file.display()
            )
        } else {
            "nothing is written: what was found is no better than the default controller on other roads and vehicles; \
             keep the default, or search longer (--budget)"
                .to_owned()
        };
        say!("{words}");
        if better {
            write_text(&file, &content.to_text(&self.head(held_out)))?;
            return Ok(words);
        }
        // An older one would be taken for this one.
        match std::fs::remove_file(&file) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(format!("{}: {error}", file.display()).into())
            }
            _ => Ok(words),
        }
    }

    /// Contents of `tune.json`.
    pub fn as_json(&self, tuned: &Tuned<'_>, content: ControllerFile) -> Value {
        let [(_, training, on_training), (_, held_out, on_held_out)] = &tuned.sets;
        let of = |place: usize| {
            json!({
                "values": on_training[place].values, "training": on_training[place], "held_out": on_held_out[place],
                "margins": margins_as_json(&tuned.margins[place]),
                "missed": missed(&tuned.margins[place], tuned.goal),
            })
        };
        json!({
            "vehicle": tuned.vehicle, "kind": P::KIND, "variant": tuned.variant, "seed": self.args.seed,
            "goal": { "delay": tuned.goal.0, "gain": tuned.goal.1 },
            "budget": self.args.budget, "written": tuned.better,
            "price": if tuned.better { price(*on_held_out) } else { None },
            "controller": content.values.into_iter().collect::<BTreeMap<_, _>>(),
            "default": of(0),
            "tuned": of(1),
            "scenarios": { "training": training, "held_out": held_out },
        })
    }

    /// The controller's file: what was searched, what was set beside, what it predicts with.
    pub fn file(&self, values: &ControllerNumbers) -> ControllerFile {
        let mut all: Vec<(String, f64)> = values.0.clone().into_iter().collect();
        for text in &self.args.settings {
            let Some((name, _)) = text.split_once('=') else { continue };
            let name = name.trim();
            let name = name.strip_prefix("controller.").unwrap_or(name);
            if all.iter().any(|(known, _)| known == name) {
                continue;
            }
            if let Some(value) = number_of(&self.controlled.0, name) {
                all.push((name.to_owned(), value));
            }
        }
        ControllerFile {
            kind: P::KIND.to_owned(),
            vehicle: self.vehicle.name().to_owned(),
            variant: (self.variant != ControlVariant::None).then_some(self.variant),
            values: all,
        }
    }

    /// The comment above the file.
    fn head(&self, [default, tuned]: [&TuneCandidate; 2]) -> String {
        format!(
            "Tuned by rfl tune, seed {}, {} candidates. On {} drives that it was not tuned on: lost {} (default {}),\n\
             largest error {:.3} m ({:.3} m), mean {:.4} m ({:.4} m).",
            self.args.seed,
            self.args.budget,
            tuned.outcomes.len(),
            tuned.lost(),
            default.lost(),
            tuned.worst(),
            default.worst(),
            tuned.mean(),
            default.mean()
        )
    }
}

/// What a better controller costs, in words: larger errors of drives that neither was tuned on. None where neither the
/// mean error nor the largest is larger, and where one of the two loses more drives.
fn price([default, tuned]: [&TuneCandidate; 2]) -> Option<String> {
    let more = |of: fn(&TuneCandidate) -> f64| (100.0 * (of(tuned) / of(default) - 1.0)).round();
    let errors = [more(TuneCandidate::mean), more(TuneCandidate::worst)];
    if default.lost() != tuned.lost() || errors.iter().all(|&percent| percent <= 0.0) {
        return None;
    }
    let gain = match tuned {
        _ if tuned.penalty < default.penalty => "larger margins",
        _ if tuned.roughness() < default.roughness() => "calmer steering",
        _ => "a smaller cost",
    };
    let [mean, max] = errors.map(|percent| match percent {
        more if more > 0.0 => format!("{more} % larger"),
        less => format!("{} % smaller", -less),
    });
    Some(format!(
        "it has {gain} at the price of errors: on held-out drives the mean error is {mean} than the default's, the \
         largest {max}"
    ))
}

/// Margins at each speed for `tune.json`.
fn margins_as_json(margins: &[AtSpeed]) -> Vec<Value> {
    let one = |(speed, margins): &AtSpeed| match margins {
        Some(m) => {
            json!({ "speed": speed, "stable": true, "gain": finite(m.gain), "phase": finite(m.phase),
                "delay": finite(m.delay), "sensitivity": m.sensitivity })
        }
        None => json!({ "speed": speed, "stable": false }),
    };
    margins.iter().map(one).collect()
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Speeds up to the fastest asked for at which margins are below a goal of delay in s and gain, m/s.
fn missed(margins: &[AtSpeed], (delay, gain): (f64, f64)) -> Vec<f64> {
    let falls_short =
        |found: &Option<Margins>| found.is_none_or(|found| found.delay < delay || found.gain < gain);
    margins
        .iter()
        .filter(|(speed, found)| *speed <= FASTEST && falls_short(found))
        .map(|(speed, _)| *speed)
        .collect()
}

/// Says where the controller that is in force now falls short of the goal.
pub(super) fn print_missed(tuned: &Tuned<'_>) {
    let speeds = missed(&tuned.margins[usize::from(tuned.better)], tuned.goal);
    if speeds.is_empty() {
        return;
    }
    let speeds: Vec<String> = speeds.iter().map(f64::to_string).collect();
    warn!(
        "warning: the wanted margins, {} s of delay and a gain of {}, are not reached at {} m/s by the {} controller (above): \
         ask for less, or search longer (--budget)",
        tuned.goal.0,
        tuned.goal.1,
        speeds.join(", "),
        if tuned.better { "tuned" } else { "default" }
    );
}

/// Prints both controllers side by side.
pub(super) fn print<P: Commanded<S, C>, const S: usize, const C: usize>(
    tuning: &TuneData<'_, P, S, C>,
    sets: [[&TuneCandidate; 2]; 2],
    margins: &[Vec<AtSpeed>; 2],
) {
    say!("{:<28} {:>9} {:>9} {:>9} {:>9}", "", "cost m", "lost", "max m", "mean m");
    for (name, set) in ["training", "held out"].into_iter().zip(sets) {
        for (who, candidate) in ["default", "tuned"].into_iter().zip(set) {
            say!(
                "{:<28} {:>9.3} {:>9} {:>9.3} {:>9.4}",
                format!("{name}, {who}"),
                candidate.cost,
                format!("{}/{}", candidate.lost(), candidate.outcomes.len()),
                candidate.worst(),
                candidate.mean()
            );
        }
    }
    say!("{:<28} {:>9} {:>9} {:>9} {:>9}", "margins", "gain", "", "delay s", "");
    say!("{:<28} {:>9} {:>9} {:>9} {:>9}", "  at m/s", "default", "tuned", "default", "tuned");
    let text = |margins: &Option<Margins>, of: fn(&Margins) -> f64| match margins {
        Some(margins) if of(margins).is_finite() => format!("{:.3}", of(margins)),
        Some(_) => "any".to_owned(),
        None => "unstable".to_owned(),
    };
    for ((speed, before), (_, after)) in margins[0].iter().zip(&margins[1]) {
        let [gain, delay] = [(|m| m.gain) as fn(&Margins) -> f64, |m| m.delay];
        say!(
            "{:<28} {:>9} {:>9} {:>9} {:>9}",
            format!("  {speed}"),
            text(before, gain),
            text(after, gain),
            text(before, delay),
            text(after, delay)
        );
    }
    let tuned = &sets[0][1].values;
    say!("tuned for {}: {}", tuning.vehicle.name(), tuned.settings().join(" "));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::tune::ScenarioResult;

    /// A candidate with a drive of this mean and largest error, m.
    fn candidate(mean: f64, max: f64, penalty: f64) -> TuneCandidate {
        let outcome = ScenarioResult {
            cost: max,
            max,
            mean,
            rms: mean,
            roughness: 0.0,
            lost: false,
            driven: 1.0,
            given_up: false,
            faded: 0.0,
        };
        let values = ControllerNumbers(BTreeMap::new());
        TuneCandidate { values, cost: max + penalty, penalty, complete: true, outcomes: vec![Some(outcome)] }
    }

    #[test]
    fn larger_errors_are_said_with_what_they_buy() {
        let default = candidate(0.05, 0.30, 0.5);
        let said = price([&default, &candidate(0.056, 0.27, 0.2)]).unwrap();
        assert!(said.contains("larger margins") && said.contains("12 % larger"), "{said}");
        assert!(said.contains("largest 10 % smaller"), "{said}");
        assert!(price([&default, &candidate(0.04, 0.33, 0.5)]).unwrap().contains("a smaller cost"));
        assert_eq!(price([&default, &candidate(0.05, 0.29, 0.2)]), None);
        let mut lost = candidate(0.5, 2.0, 0.5);
        lost.outcomes.push(lost.outcomes[0].map(|outcome| ScenarioResult { lost: true, ..outcome }));
        assert_eq!(price([&lost, &candidate(0.6, 1.9, 0.2)]), None);
    }
}
