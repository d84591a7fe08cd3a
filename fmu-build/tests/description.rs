//! The XML is what the declarations say, stands in the project as generated, and is read by others.

#[path = "../../tests/common/toy.rs"]
#[allow(dead_code)]
mod toy;

use fmi_schema::fmi2::{self, Fmi2ModelDescription};
use fmu_build::description::{describe, describe_in};
use fmu_build::shipped;
use fmu_build::standard::Standard;
use rfl_mpc::fmi::v2::guid_of;
use rfl_mpc::fmi::{Causality, Declaration, Initial, Model, Variable, VariableKind};
use std::path::{Path, PathBuf};

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn declarations() -> Vec<Declaration> {
    let shipped = shipped::fmus().into_iter().map(|fmu| fmu.declaration);
    shipped.chain([toy::SteeringLag::declaration()]).collect()
}

#[test]
fn descriptions_stand_as_generated() {
    for fmu in shipped::fmus() {
        for standard in Standard::ALL {
            let file = fmu.description_in(standard);
            let committed = std::fs::read_to_string(project().join(&file)).unwrap();
            assert!(
                committed == describe_in(standard, &fmu.declaration),
                "{} is not what its declaration says: cargo run -p fmu-build -- --describe",
                file.display()
            );
        }
    }
}

/// `UPDATE_TOY=1` writes the test model's description.
#[test]
fn the_test_models_description_stands_as_generated() {
    for standard in Standard::ALL {
        let path = project().join("tests/common").join(standard.folder()).join("SteeringLag.xml");
        let xml = describe_in(standard, &toy::SteeringLag::declaration());
        if std::env::var_os("UPDATE_TOY").is_some() {
            std::fs::write(&path, &xml).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap(), xml, "run UPDATE_TOY=1 cargo test -p fmu-build");
    }
}

/// The same declaration in the words of 3.0: types, time, the functions' names in texts.
#[test]
fn a_description_of_3_0_has_its_types_and_time() {
    let declaration = toy::SteeringLag::declaration();
    let xml = describe_in(Standard::Fmi3, &declaration);
    assert_eq!(
        (Standard::of(&xml), Standard::of(&describe(&declaration))),
        (Some(Standard::Fmi3), Some(Standard::Fmi2))
    );
    let mark = Standard::Fmi3.mark_of(&xml);
    assert!(mark.len() == 38 && mark != Standard::Fmi2.mark_of(&describe(&declaration)), "{mark}");
    for wanted in [
        "<Float64Type name=\"SteerCmd\"",
        "<EnumerationType name=\"Method\">",
        "<Float64 name=\"steer_cmd\" valueReference=\"0\"",
        "<Int32 name=\"steps\"",
        "<Enumeration name=\"method_used\"",
        "<Start value=\"\"/>",
        "<Binary name=\"actuator_data\" valueReference=\"20\"",
        "<Float64 name=\"time\" valueReference=\"21\"",
        "causality=\"independent\"",
        "<Output valueReference=\"2\" dependencies=\"\"/>",
        "Calls that returned fmi3Discard",
        "<Dimension start=\"2\"/>",
    ] {
        assert!(xml.contains(wanted), "{wanted} is missing in {xml}");
    }
    assert!(xml.contains("name=\"history\" valueReference=\"17\"") && !xml.contains("history["));
    assert!(!xml.contains("valueReference=\"18\"") && describe(&declaration).contains("history[2]"));
    assert!(!describe(&declaration).contains("actuator_data"));
    assert!(!xml.contains("fmi2") && !describe(&declaration).contains("fmi3"));
}

/// The GUID follows from the content, and only from it.
#[test]
fn the_guid_is_the_contents() {
    let declaration = toy::SteeringLag::declaration();
    let (first, second) = (describe(&declaration), describe(&declaration));
    assert_eq!(first, second);
    let guid = guid_of(&first).unwrap();
    assert!(guid.starts_with('{') && guid.ends_with('}') && guid.len() == 38, "{guid}");
    assert_eq!(guid.as_bytes()[15], b'5', "version 5 of RFC 9562");
    let mut other = declaration.clone();
    other.variables[0].description = "another meaning".into();
    let other = describe(&other);
    assert_ne!(guid_of(&other), guid_of(&first));
}

/// An independent reader finds every variable with its attributes, and writes a document that reads the same.
#[test]
fn fmi_schema_reads_what_was_declared() {
    for declaration in declarations() {
        let xml = describe(&declaration);
        let read: Fmi2ModelDescription = fmi_schema::deserialize(&xml).unwrap();
        assert_eq!((read.fmi_version.as_str(), read.model_name.as_str()), ("2.0", declaration.name));
        assert_eq!(Some(read.guid.as_str()), guid_of(&xml));
        assert_eq!(read.description.as_deref(), Some(declaration.description));
        let found = &read.model_variables.variables;
        assert_eq!(found.len(), declaration.variables.len());
        for (vr, (found, declared)) in found.iter().zip(&declaration.variables).enumerate() {
            assert_eq!(found.value_reference as usize, vr);
            check_variable(found, declared);
        }
        check_structure(&read, &declaration);
        check_units(&read, &declaration);
        let written = fmi_schema::serialize(&read, false).unwrap();
        let again: Fmi2ModelDescription = fmi_schema::deserialize(&written).unwrap();
        assert_eq!(fmi_schema::serialize(&again, false).unwrap(), written);
        check_structure(&again, &declaration);
        check_units(&again, &declaration);
    }
}

fn check_variable(found: &fmi2::ScalarVariable, declared: &Variable) {
    let name = &declared.name;
    assert_eq!(&found.name, name);
    let description = Standard::Fmi2.version().words(&declared.description);
    assert_eq!(found.description, Some(description), "{name}");
    let causality = match declared.causality {
        Causality::Parameter => fmi2::Causality::Parameter,
        Causality::Input => fmi2::Causality::Input,
        Causality::Output => fmi2::Causality::Output,
        Causality::Local => fmi2::Causality::Local,
        Causality::Independent => fmi2::Causality::Independent,
    };
    assert_eq!(found.causality, causality, "{name}");
    let exact = declared.initial == Initial::Exact;
    match (&found.elem, &declared.kind) {
        (fmi2::ScalarVariableElement::Real(found), VariableKind::Real { start, .. }) => {
            assert_eq!(found.start, exact.then_some(*start), "{name}");
        }
        (fmi2::ScalarVariableElement::Integer(found), VariableKind::Integer { start, .. }) => {
            assert_eq!(found.start, exact.then_some(*start), "{name}");
        }
        (fmi2::ScalarVariableElement::Boolean(found), VariableKind::Boolean { start }) => {
            assert_eq!(found.start, exact.then_some(*start), "{name}");
        }
        // The crate keeps nothing of these but their kind.
        (fmi2::ScalarVariableElement::String, VariableKind::String { .. })
        | (fmi2::ScalarVariableElement::Enumeration, VariableKind::Enumeration { .. }) => {}
        (found, declared) => panic!("{name}: {found:?} is no {declared:?}"),
    }
}

/// Every unit in use is defined, with the exponents and display units of the vocabulary.
fn check_units(read: &Fmi2ModelDescription, declaration: &Declaration) {
    let units = &read.unit_definitions.as_ref().unwrap().units;
    for variable in &declaration.variables {
        let VariableKind::Real { unit, .. } = variable.kind else { continue };
        let found = units.iter().find(|found| found.name == unit.symbol).unwrap();
        let base = found.base_unit.as_ref().unwrap();
        let exponents = [base.kg, base.m, base.s, base.rad].map(Option::unwrap_or_default);
        assert_eq!(exponents, [unit.base.kg, unit.base.m, unit.base.s, unit.base.rad], "{}", unit.symbol);
        let display = unit.display.map(|display| (display.symbol.to_owned(), Some(display.factor)));
        let found: Vec<_> =
            found.display_unit.iter().map(|display| (display.name.clone(), display.factor)).collect();
        assert_eq!(found, display.into_iter().collect::<Vec<_>>(), "{}", unit.symbol);
    }
}

/// Outputs and initial unknowns are the variables that the standard wants there, with their dependencies.
fn check_structure(read: &Fmi2ModelDescription, declaration: &Declaration) {
    let indices = |wanted: &dyn Fn(&Variable) -> bool| -> Vec<u32> {
        let all = declaration.variables.iter().zip(1..);
        all.filter(|(variable, _)| wanted(variable)).map(|(_, index)| index).collect()
    };
    let outputs = indices(&|variable| variable.causality == Causality::Output);
    let calculated = indices(&|variable| {
        variable.causality == Causality::Output && variable.initial == Initial::Calculated
    });
    let parameters = indices(&|variable| variable.causality == Causality::Parameter);
    let structure = &read.model_structure;
    let found: Vec<u32> = structure.outputs.unknowns.iter().map(|unknown| unknown.index).collect();
    assert_eq!(found, outputs);
    let found: Vec<u32> = structure.initial_unknowns.unknowns.iter().map(|unknown| unknown.index).collect();
    assert_eq!(found, calculated);
    for unknown in &structure.initial_unknowns.unknowns {
        let wanted: Vec<u32> = parameters.clone();
        assert_eq!(unknown.dependencies, wanted, "index {}", unknown.index);
    }
}

/// Names follow FMI's structured convention (section 2.2.9), which the description claims.
#[test]
fn names_are_structured() {
    let part = |text: &str| {
        let (name, indices) = text.split_once('[').map_or((text, None), |(name, rest)| (name, Some(rest)));
        let number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && indices
                .is_none_or(|indices| indices.strip_suffix(']').is_some_and(|all| all.split(',').all(number)))
    };
    for declaration in declarations() {
        for variable in &declaration.variables {
            assert!(variable.name.split('.').all(part), "{}: {}", declaration.name, variable.name);
        }
    }
}

/// What a start value is, the ranges must allow: the standard demands it, and hosts set start values.
#[test]
fn start_values_are_in_range() {
    for declaration in declarations() {
        for variable in &declaration.variables {
            let good = match &variable.kind {
                VariableKind::Real { start, min, max, .. } => {
                    let range = min.unwrap_or(f64::NEG_INFINITY)..=max.unwrap_or(f64::INFINITY);
                    variable.initial == Initial::Calculated || range.contains(start)
                }
                VariableKind::Integer { start, min, max } => {
                    (min.unwrap_or(i32::MIN)..=max.unwrap_or(i32::MAX)).contains(start)
                }
                VariableKind::Enumeration { items, start, .. } => items.iter().any(|item| item.0 == *start),
                VariableKind::Boolean { .. } | VariableKind::String { .. } | VariableKind::Binary { .. } => {
                    true
                }
            };
            assert!(good, "{}: {}", declaration.name, variable.name);
        }
    }
}
