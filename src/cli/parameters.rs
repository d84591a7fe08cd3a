//! `rfl parameters`: every parameter of the FMUs and of `--set`, with unit, default, range and meaning.

use crate::fmi::{Causality, Declaration, Model, Variable, VariableKind};
use crate::fmu::{PassengerCar, RflMpc, SemiTrailerTruck, TruckRflMpc};
use clap::Args;
use serde_json::{Value, json};
use std::error::Error;

/// Lists the parameters of car, truck and their controllers
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  rfl parameters                 all
  rfl parameters effect          those with 'effect' in the name or meaning
  rfl parameters mpc --json      for a script")]
pub struct ParametersArgs {
    /// Only parameters whose name or meaning contains this
    text: Option<String>,
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Nothing contains the text.
pub fn run(args: &ParametersArgs) -> Result<(), Box<dyn Error>> {
    let text = args.text.as_deref().unwrap_or_default().to_lowercase();
    let units = [
        ("controller", RflMpc::declaration()),
        ("car", PassengerCar::declaration()),
        ("truck", SemiTrailerTruck::declaration()),
        ("truck controller", TruckRflMpc::declaration()),
    ];
    let found: Vec<(&str, &Variable)> = units
        .iter()
        .flat_map(|(unit, declaration)| matching(declaration, &text).map(move |variable| (*unit, variable)))
        .collect();
    if found.is_empty() {
        return Err(
            format!("no parameter has '{text}' in its name or meaning; 'rfl parameters' lists all").into()
        );
    }
    if args.json {
        let all: Vec<Value> = found.iter().map(|(unit, variable)| as_json(unit, variable)).collect();
        say!("{}", serde_json::to_string_pretty(&all)?);
        return Ok(());
    }
    say!("{:<16} {:<34} {:>12} {:<9} {:<20} meaning", "of", "name", "default", "unit", "range");
    for (unit, variable) in found {
        let (default, symbol, range) = columns(&variable.kind);
        say!(
            "{unit:<16} {:<34} {default:>12} {symbol:<9} {range:<20} {}",
            variable.name,
            variable.description
        );
    }
    Ok(())
}

fn matching<'a>(declaration: &'a Declaration, text: &'a str) -> impl Iterator<Item = &'a Variable> {
    declaration.variables.iter().filter(move |variable| {
        variable.causality == Causality::Parameter
            && (variable.name.to_lowercase().contains(text)
                || variable.description.to_lowercase().contains(text))
    })
}

/// Default, unit and range as text.
fn columns(kind: &VariableKind) -> (String, &'static str, String) {
    let range = |min: Option<String>, max: Option<String>| match (min, max) {
        (None, None) => String::new(),
        (min, max) => format!("{} ... {}", min.unwrap_or("-inf".into()), max.unwrap_or("inf".into())),
    };
    let text = |value: &f64| value.to_string();
    match kind {
        VariableKind::Real { unit, start, min, max, .. } => {
            (start.to_string(), unit.symbol, range(min.as_ref().map(text), max.as_ref().map(text)))
        }
        VariableKind::Integer { start, min, max } => {
            (start.to_string(), "", range(min.map(|min| min.to_string()), max.map(|max| max.to_string())))
        }
        VariableKind::Boolean { start } => (start.to_string(), "", String::new()),
        VariableKind::String { start } => (start.to_string(), "", String::new()),
        VariableKind::Binary { .. } => (String::new(), "", String::new()),
        VariableKind::Enumeration { items, start, .. } => {
            let names: Vec<&str> = items.iter().map(|item| item.1).collect();
            let default = items.iter().find(|item| item.0 == *start).map_or("", |item| item.1);
            (default.to_string(), "", names.join(" | "))
        }
    }
}

fn as_json(unit: &str, variable: &Variable) -> Value {
    let (default, symbol, range) = columns(&variable.kind);
    let numbers = match &variable.kind {
        VariableKind::Real { start, min, max, .. } => json!({"default": start, "min": min, "max": max}),
        VariableKind::Integer { start, min, max } => json!({"default": start, "min": min, "max": max}),
        _ => json!({"default": default, "values": range}),
    };
    let mut value =
        json!({"of": unit, "name": variable.name, "unit": symbol, "meaning": variable.description});
    if let (Some(value), Value::Object(numbers)) = (value.as_object_mut(), numbers) {
        value.extend(numbers);
    }
    value
}
