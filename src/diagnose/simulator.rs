//! The calibrated simulator: the vehicle with the named effects and the adjusted numbers. Written as a vehicle file,
//! and as a parameter set of SSP 1.0 for the plant's FMU in any host.

use super::report::{Adjustment, Report};
use crate::output::write_bytes;
use crate::vehicle::{TruckEffects, VehicleParameters};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, Event};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Reasons for which a calibrated simulator cannot be written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum CalibratedError {
    #[error("the diagnosis adjusted '{parameter}', which this vehicle does not have; please report this")]
    Unknown { parameter: String },
    #[error("{}: {source}", file.display())]
    File { file: PathBuf, source: std::io::Error },
    #[error("the calibrated vehicle cannot be written as TOML: {0}")]
    Toml(#[from] toml::ser::Error),
}

/// Extent of the calibration of a simulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CalibrationExtent {
    /// The named effects only.
    Effect,
    /// All that was adjusted, too.
    Whole,
}

/// Changes by parameter, with values.
#[must_use]
pub fn changes(report: &Report, calibration: CalibrationExtent) -> BTreeMap<String, f64> {
    let mut changes = BTreeMap::new();
    if calibration == CalibrationExtent::Whole {
        changes
            .extend(report.recalibration.iter().map(|one: &Adjustment| (one.parameter.clone(), one.value)));
    }
    let found = report.verdict.effects.iter().chain(&report.verdict.nearest);
    for effect in found {
        let whole = BTreeMap::from([(effect.id.clone(), effect.total)]);
        let components = if effect.components.is_empty() { &whole } else { &effect.components };
        changes.extend(components.iter().map(|(id, value)| (format!("effect.{id}"), *value)));
    }
    changes
}

/// The vehicle with these changes; values are limited to the vehicle's ranges. Adjustments of the sensors (`sensor.*`)
/// are no part of a vehicle.
///
/// # Errors
/// A parameter that the vehicle does not have.
pub fn calibrated<V: VehicleParameters>(
    vehicle: &V,
    changes: &BTreeMap<String, f64>,
) -> Result<V, CalibratedError> {
    let mut vehicle = vehicle.clone();
    let (mut known, mut found) = (TruckEffects::default(), TruckEffects::default());
    for effect in TruckEffects::all() {
        if let (Some(place), Some(value)) = (known.get_mut(effect.id), vehicle.effect_mut(effect.id)) {
            *place = *value;
        }
    }
    for (name, value) in changes.iter().filter(|(name, _)| !name.starts_with("sensor.")) {
        let id = name.strip_prefix("effect.").unwrap_or_default();
        if let (true, Some(place)) = (vehicle.effect_mut(id).is_some(), found.get_mut(id)) {
            *place = *value;
        } else if let Some(parameter) = V::TABLE.iter().find(|parameter| parameter.name == name) {
            parameter.set(&mut vehicle, value.clamp(parameter.range.0, parameter.range.1));
        } else {
            return Err(CalibratedError::Unknown { parameter: name.clone() });
        }
    }
    // What was found comes on top of what the file knows already.
    let both = found.on_top_of(&known);
    for effect in TruckEffects::all() {
        let (Some(value), Some(place)) = (both.get(effect.id), vehicle.effect_mut(effect.id)) else {
            continue;
        };
        *place = value.clamp(effect.range.0, effect.range.1);
        // Quicker than the file says: less of what the file has.
        let own = QUICKER.iter().find(|(slower, _)| *slower == effect.id && value < 0.0);
        if let Some(own) = own.and_then(|(_, own)| V::TABLE.iter().find(|parameter| parameter.name == *own)) {
            let shorter = (own.get(&vehicle) + value).max(0.0);
            own.set(&mut vehicle, shorter);
        }
    }
    Ok(vehicle)
}

/// Effects that add to a number of the file.
const QUICKER: [(&str, &str); 3] =
    [("steer_delay", "steering.dead_time"), ("steer_lag", "steering.lag"), ("drive_lag", "drive.lag")];

/// Differences between two vehicles, by the FMU's parameters.
#[must_use]
pub fn differences<V: VehicleParameters>(from: &V, to: &V) -> BTreeMap<String, f64> {
    let mut differences = BTreeMap::new();
    for parameter in V::TABLE.iter().filter(|parameter| parameter.get(from) != parameter.get(to)) {
        differences.insert(parameter.name.to_owned(), parameter.get(to));
    }
    let (mut from, mut to) = (from.clone(), to.clone());
    for effect in TruckEffects::all() {
        if let (Some(from), Some(to)) = (from.effect_mut(effect.id), to.effect_mut(effect.id))
            && from != to
        {
            differences.insert(format!("effect.{}", effect.id), *to);
        }
    }
    differences
}

/// Writes a vehicle file. `source` is the file that the vehicle was read from, if any; its tyres are copied from there
/// to the new file's folder. `words` goes into a comment.
///
/// # Errors
/// A file that cannot be written.
pub fn write_vehicle<V: VehicleParameters>(
    vehicle: &V,
    source: Option<&Path>,
    words: &str,
    file: &Path,
) -> Result<(), CalibratedError> {
    let mut vehicle = vehicle.clone();
    if let (Some(from), Some(to)) = (source.and_then(Path::parent), file.parent()) {
        copy_tyres(&mut vehicle, from, to)?;
    }
    let mut table = toml::Table::try_from(&vehicle)?;
    if let Some(toml::Value::Table(effects)) = table.get_mut("effect") {
        effects.retain(|id, value| {
            let neutral = TruckEffects::all().find(|effect| effect.id == id).map(|effect| effect.neutral);
            value.as_float() != neutral
        });
    }
    let mut text: String = words.lines().map(|line| format!("# {line}\n")).collect();
    text += "\n";
    text += &toml::to_string(&table)?;
    write(file, text.as_bytes())
}

/// Copies the tyre files of a vehicle from one folder to another, and names them there. Gives the keys of the vehicle file with
/// their new names.
///
/// # Errors
/// A file that cannot be written.
pub fn copy_tyres<V: VehicleParameters>(
    vehicle: &mut V,
    from: &Path,
    to: &Path,
) -> Result<Vec<(&'static str, String)>, CalibratedError> {
    let mut copied = Vec::new();
    for (key, tyre) in vehicle.tyres() {
        // A tyre that is built in needs no file.
        let Ok(bytes) = std::fs::read(from.join(&tyre.file)) else { continue };
        tyre.file = beside(&tyre.file);
        write(&to.join(&tyre.file), &bytes)?;
        copied.push((key, tyre.file.clone()));
    }
    Ok(copied)
}

fn write(file: &Path, bytes: &[u8]) -> Result<(), CalibratedError> {
    write_bytes(file, bytes).map_err(|source| CalibratedError::File { file: file.to_owned(), source })
}

/// A place in the new file's own folder for any file: `../tyres/car.tir` becomes `tyres_car.tir`, `tyres/car.tir`
/// stays. Nothing is written outside the folder that the user named, nor over anything else that is written there: it is a `.tir`.
fn beside(file: &str) -> String {
    let is_tir = Path::new(file).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tir"));
    let file = &if is_tir { file.to_owned() } else { format!("{file}.tir") };
    if Path::new(file).components().all(|part| matches!(part, Component::Normal(_))) {
        return file.to_owned();
    }
    let parts = Path::new(file).components().filter_map(|part| match part {
        Component::Normal(name) => name.to_str(),
        _ => None,
    });
    parts.collect::<Vec<_>>().join("_")
}

/// A parameter set: the value of `vehicle_file`, and the changes. With a `component`, names are `COMPONENT.PARAMETER`,
/// as for a system; without, those of the FMU.
#[must_use]
pub fn parameter_set(component: Option<&str>, vehicle_file: &str, changes: &BTreeMap<String, f64>) -> String {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    let mut event = |event: Event<'_>| writer.write_event(event).expect("writing to memory does not fail");
    let full =
        |name: &str| component.map_or_else(|| name.to_owned(), |component| format!("{component}.{name}"));
    event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)));
    event(Event::Start(BytesStart::new("ssv:ParameterSet").with_attributes([
        ("xmlns:ssv", "http://ssp-standard.org/SSP1/SystemStructureParameterValues"),
        ("version", "1.0"),
        ("name", "calibrated"),
    ])));
    event(Event::Start(BytesStart::new("ssv:Parameters")));
    let mut parameter = |name: &str, element: &str, value: &str| {
        event(Event::Start(
            BytesStart::new("ssv:Parameter").with_attributes([("name", full(name).as_str())]),
        ));
        event(Event::Empty(BytesStart::new(element).with_attributes([("value", value)])));
        event(Event::End(BytesEnd::new("ssv:Parameter")));
    };
    parameter("vehicle_file", "ssv:String", vehicle_file);
    for (name, value) in changes {
        parameter(name, "ssv:Real", &value.to_string());
    }
    event(Event::End(BytesEnd::new("ssv:Parameters")));
    event(Event::End(BytesEnd::new("ssv:ParameterSet")));
    String::from_utf8(writer.into_inner()).expect("names and numbers are UTF-8")
}
