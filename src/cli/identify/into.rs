//! A vehicle file with its identified steering actuator: `[steering]` edited, everything else as its author wrote it.
//!
//! The identified actuator is the whole of it: the additions in `[effect]` of the file are taken off. Gain and offset
//! of the measured angle are written if the file has none of its own. Those of the file stand behind the sensor, where
//! a measured angle does not reach. Written apart and then renamed: a reader sees the old file or the new one.

use super::super::vehicle::Commanded;
use super::IdentifyArgs;
use super::check::number;
use crate::diagnose::simulator::copy_tyres;
use crate::nominal::{Estimate, IdentifiedSteering};
use crate::output::write_bytes;
use crate::vehicle::{VehicleParameters, builtin_text};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use toml_edit::{DocumentMut, Item, Value};

/// Digits after the point that are written: a tenth of a millisecond.
const DIGITS: f64 = 1e4;
/// Deviation of a gain from 1, or of an offset from 0 in rad, that counts as none.
const GAIN_NONE: f64 = 0.01;
const OFFSET_NONE: f64 = 5e-4;
/// Range of plausible gains: beyond, it is a unit or a steering wheel's.
const PLAUSIBLE: std::ops::Range<f64> = 0.5..2.0;

/// The file that is written: where a link leads to.
///
/// # Errors
/// No ordinary file, a folder that is missing.
pub(super) fn target_of(file: &Path) -> Result<PathBuf, String> {
    let place = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let exists = file.exists();
    let target = if exists { file.canonicalize().map_err(|error| place(&error))? } else { file.to_owned() };
    if exists && !target.is_file() {
        return Err(place(&"is no ordinary file; give the name of a vehicle file (TOML)"));
    }
    if folder_of(&target).is_some_and(|folder| !folder.is_dir()) {
        return Err(place(&"its folder is missing; make it first"));
    }
    Ok(target)
}

fn folder_of(file: &Path) -> Option<&Path> {
    file.parent().filter(|folder| !folder.as_os_str().is_empty())
}

/// Writes the result into a file; gives the changed numbers. `harmful`: the closed loop is lost with it.
///
/// # Errors
/// A result that is not excited, and would change something; a file that cannot be read, edited or written.
pub(super) fn write<P: Commanded<S, C>, const S: usize, const C: usize>(
    file: &Path,
    vehicle: &str,
    args: &IdentifyArgs,
    found: &IdentifiedSteering,
    harmful: bool,
) -> Result<BTreeMap<&'static str, f64>, Box<dyn Error>> {
    let place = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let (exists, target) = (file.exists(), target_of(file)?);
    let folder = folder_of(&target);
    let text = match builtin_text(vehicle).filter(|_| !exists) {
        Some(text) => text.to_owned(),
        None => {
            let source = if exists { target.clone() } else { PathBuf::from(vehicle) };
            std::fs::read_to_string(&source).map_err(|error| format!("{}: {error}", source.display()))?
        }
    };
    let mut old = if exists {
        P::Parameters::of_file(&target)?
    } else {
        super::super::vehicle::vehicle_named(vehicle)?
    };
    let changes = changes::<P, S, C>(&old, found, args)?;
    if changes.is_empty() && exists {
        say!("{}: nothing changes", file.display());
        return Ok(changes);
    }
    if !found.excited() {
        return Err(place(&format!(
            "not written: {} not excited by the logs; drive as said above, and give both logs",
            match (found.dead_time.excited, found.lag.excited) {
                (false, false) => "dead time and lag are",
                (false, true) => "the dead time is",
                _ => "the lag is",
            }
        ))
        .into());
    }
    if harmful {
        return Err(place(
            &"not written: a controller that knows it loses the vehicle in closed loop (above)",
        )
        .into());
    }
    let mut document: DocumentMut = text.parse().map_err(|error| place(&error))?;
    for (key, value) in &changes {
        put(&mut document, key, *value).ok_or_else(|| place(&"[steering] is no table"))?;
    }
    // A new file in another folder has its tyres beside it, as that of a diagnosis.
    if let (false, Some(from)) = (exists || builtin_text(vehicle).is_some(), Path::new(vehicle).parent()) {
        for (key, tyre) in copy_tyres(&mut old, from, folder.unwrap_or(Path::new("")))? {
            let axle = key.split('.').rev().nth(1).unwrap_or_default();
            document["tyre"][axle]["file"] = toml_edit::value(tyre);
        }
    }
    replace::<P, S, C>(&target, &document.to_string()).map_err(|error| place(&error))?;
    let words: Vec<String> = changes.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    if words.is_empty() {
        say!("{}: [steering] stays as it was", file.display());
    } else {
        say!("{}: [steering] {}", file.display(), words.join(", "));
    }
    if args.by_yaw_rate {
        say!(
            "gain and offset are not written: by yaw rate the tyres' stiffness and the sensor's bias are in them; \
             --set actuator.gain={:.3} --set actuator.offset={:.4} tells them to a controller",
            found.gain.value,
            found.offset.value
        );
    }
    Ok(changes)
}

/// Changes in `[steering]`.
fn changes<P: Commanded<S, C>, const S: usize, const C: usize>(
    old: &P::Parameters,
    found: &IdentifiedSteering,
    args: &IdentifyArgs,
) -> Result<BTreeMap<&'static str, f64>, Box<dyn Error>> {
    let mut effects = old.effects().clone();
    let mut effect = |id: &str| P::effect(&mut effects, id).map(|value| *value);
    let round = |value: f64| (value * DIGITS).round() / DIGITS;
    let mut changes = BTreeMap::new();
    let gap = found.shown_backlash();
    for (key, name, id, unit, estimate) in [
        ("dead_time", "steering.dead_time", "steer_delay", "s", found.dead_time),
        ("lag", "steering.lag", "steer_lag", "s", found.lag),
    ]
    .into_iter()
    .chain(gap.map(|width| ("backlash", "steering.backlash", "steer_backlash", "rad", width)))
    {
        let added = effect(id).unwrap_or(0.0);
        if estimate.high < added {
            return Err(format!(
                "the vehicle file's effect.{id} = {added} {unit} alone is more than the {:.4} {unit} that were found: take \
                 it out of [effect]",
                estimate.value
            )
            .into());
        }
        let value = round((estimate.value - added).max(0.0));
        let before = number(old, name).unwrap_or(0.0);
        // Within the interval, and to a tenth of a millisecond, it is what the file says.
        if value != round(before) {
            changes.insert(key, value);
        }
    }
    let mut none = |key: &str, id: &str, neutral: f64| {
        number(old, key) == Some(neutral) && effect(id).is_none_or(|value| value == neutral)
    };
    let off = |estimate: Estimate, neutral: f64, least: f64| {
        estimate.excited
            && (estimate.value - neutral).abs() > least
            && !(estimate.low..=estimate.high).contains(&neutral)
    };
    let plausible = PLAUSIBLE.contains(&found.gain.value);
    if !args.by_yaw_rate && plausible {
        if off(found.gain, 1.0, GAIN_NONE) && none("steering.gain", "steer_gain", 1.0) {
            changes.insert("gain", round(found.gain.value));
        }
        if off(found.offset, 0.0, OFFSET_NONE) && none("steering.offset", "steer_offset", 0.0) {
            changes.insert("offset", round(found.offset.value));
        }
    }
    Ok(changes)
}

/// Puts a number into `[steering]`; its comment stays.
fn put(document: &mut DocumentMut, key: &str, number: f64) -> Option<()> {
    let table = document.get_mut("steering")?.as_table_like_mut()?;
    let mut value = Value::from(number);
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => {
            *value.decor_mut() = old.decor().clone();
            *old = value;
        }
        None => {
            table.insert(key, Item::Value(value));
        }
    }
    Some(())
}

/// Replaces a vehicle file by a text that is one, whole or not at all.
fn replace<P: Commanded<S, C>, const S: usize, const C: usize>(
    target: &Path,
    text: &str,
) -> Result<(), Box<dyn Error>> {
    let mut name = target.file_name().ok_or("is no name of a file")?.to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = target.with_file_name(name);
    let written = (|| -> Result<(), Box<dyn Error>> {
        std::fs::write(&part, text)?;
        // Beside its place it finds the tyres that it will find there.
        P::Parameters::of_file(&part)?;
        Ok(write_bytes(target, text)?)
    })();
    // What is left of an attempt helps nobody.
    let _ = std::fs::remove_file(&part);
    written.map_err(|error| {
        error.to_string().replace(&part.display().to_string(), &target.display().to_string()).into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_stay_and_new_keys_come_last() {
        let text =
            "# mine\n[steering] # chain\nlag = 0.05   # s, guessed\nangle_limit = 0.6\n\n[drive] # x\n";
        let mut document: DocumentMut = text.parse().unwrap();
        put(&mut document, "lag", 0.12).unwrap();
        put(&mut document, "dead_time", 0.06).unwrap();
        assert_eq!(
            document.to_string(),
            "# mine\n[steering] # chain\nlag = 0.12   # s, guessed\nangle_limit = 0.6\ndead_time = 0.06\n\n[drive] # x\n"
        );
    }
}
