//! `modelDescription.xml` from a model's declaration (FMI 2.0, section 2.2 and 4.3.1).
//!
//! The GUID is a UUID of version 5 over the document without it: the same declaration gives the same GUID, any
//! change another one.

use crate::xml::{Attributes, Xml};
use rfl_mpc::fmi::abi::guid_of;
use rfl_mpc::fmi::logger::STANDARD_CATEGORIES;
use rfl_mpc::fmi::{Causality, Declaration, Initial, Kind, Variability, Variable};
use rfl_mpc::signal::{self, Signal, Unit};
use std::collections::BTreeMap;
use uuid::Uuid;

/// The document with its GUID.
#[must_use]
pub fn describe(declaration: &Declaration) -> String {
    let without = document(declaration, "");
    let guid = Uuid::new_v5(&Uuid::NAMESPACE_OID, without.as_bytes());
    document(declaration, &guid.braced().to_string())
}

/// The document of an FMU whose library is another declaration's, that differs in start values only: with the
/// library's GUID.
#[must_use]
pub fn describe_for(library: &Declaration, declaration: &Declaration) -> String {
    document(declaration, guid_of(&describe(library)).unwrap_or_default())
}

fn document(declaration: &Declaration, guid: &str) -> String {
    let mut xml = Xml::new();
    xml.open(
        "fmiModelDescription",
        Attributes::new()
            .with("fmiVersion", "2.0")
            .with("modelName", declaration.name)
            .with("guid", guid)
            .with("description", declaration.description)
            .with("author", env!("CARGO_PKG_AUTHORS"))
            .with("version", env!("CARGO_PKG_VERSION"))
            .with("license", env!("CARGO_PKG_LICENSE"))
            .with("generationTool", concat!("fmu-build ", env!("CARGO_PKG_VERSION")))
            .with("variableNamingConvention", "structured")
            .with("numberOfEventIndicators", 0),
    );
    xml.empty(
        "CoSimulation",
        Attributes::new()
            .with("modelIdentifier", declaration.name)
            .with("needsExecutionTool", false)
            .with("canHandleVariableCommunicationStepSize", true)
            .with("canInterpolateInputs", false)
            .with("maxOutputDerivativeOrder", 0)
            .with("canRunAsynchronuously", false)
            .with("canBeInstantiatedOnlyOncePerProcess", false)
            .with("canNotUseMemoryManagementFunctions", true)
            .with("canGetAndSetFMUstate", true)
            .with("canSerializeFMUstate", true)
            .with("providesDirectionalDerivative", false),
    );
    units(&mut xml, declaration);
    types(&mut xml, declaration);
    xml.open("LogCategories", Attributes::new());
    for category in STANDARD_CATEGORIES.iter().chain(declaration.log_categories) {
        let attributes = Attributes::new().with("name", category.name);
        xml.empty("Category", attributes.with("description", category.description));
    }
    xml.close();
    let experiment = &declaration.experiment;
    xml.empty(
        "DefaultExperiment",
        Attributes::new()
            .with("startTime", experiment.start_time)
            .with("stopTime", experiment.stop_time)
            .with("tolerance", experiment.tolerance)
            .with("stepSize", experiment.step_size),
    );
    xml.open("ModelVariables", Attributes::new());
    for (vr, variable) in declaration.variables.iter().enumerate() {
        scalar_variable(&mut xml, vr, variable);
    }
    xml.close();
    structure(&mut xml, declaration);
    xml.close();
    xml.finish()
}

fn unit_of(variable: &Variable) -> Option<Unit> {
    match &variable.kind {
        Kind::Real { unit, .. } => Some(*unit),
        _ => None,
    }
}

/// The units of some variables, each once, in the order of the vocabulary.
pub(crate) fn units_of(variables: &[&Variable]) -> Vec<&'static Unit> {
    let used = |unit: &&Unit| variables.iter().any(|variable| unit_of(variable) == Some(**unit));
    Unit::ALL.iter().filter(used).collect()
}

/// A unit in the base units of SI; FMI and SSP write it with the same attributes.
pub(crate) fn base_unit(unit: &Unit) -> Attributes<'static> {
    let exponent = |value: i32| (value != 0).then_some(value);
    Attributes::new()
        .with_some("kg", exponent(unit.base.kg))
        .with_some("m", exponent(unit.base.m))
        .with_some("s", exponent(unit.base.s))
        .with_some("rad", exponent(unit.base.rad))
        .with_some("factor", (unit.factor != 1.0).then_some(unit.factor))
}

fn units(xml: &mut Xml, declaration: &Declaration) {
    let units = units_of(&declaration.variables.iter().collect::<Vec<_>>());
    if units.is_empty() {
        return;
    }
    xml.open("UnitDefinitions", Attributes::new());
    for unit in units {
        xml.open("Unit", Attributes::new().with("name", unit.symbol));
        xml.empty("BaseUnit", base_unit(unit));
        if let Some(display) = unit.display {
            let attributes = Attributes::new().with("name", display.symbol);
            xml.empty("DisplayUnit", attributes.with("factor", display.factor));
        }
        xml.close();
    }
    xml.close();
}

/// The signal of the vocabulary that a variable is in all respects; such a variable refers to the signal's type.
fn signal_of(variable: &Variable) -> Option<&'static Signal> {
    let signal = signal::find(&variable.name)?;
    match &variable.kind {
        Kind::Real { unit, quantity, min, max, nominal, .. } => (*unit == signal.unit
            && *quantity == Some(signal.quantity)
            && (*min, *max) == (Some(signal.range.0), Some(signal.range.1))
            && *nominal == Some(signal.nominal))
        .then_some(signal),
        _ => None,
    }
}

/// A type's name: the signal's in camel case (it must differ from the variable's name).
fn type_name(signal: &Signal) -> String {
    let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
    signal.name.split('_').map(capital).collect()
}

fn types(xml: &mut Xml, declaration: &Declaration) {
    let signals: Vec<&Signal> = declaration.variables.iter().filter_map(signal_of).collect();
    let mut enumerations = BTreeMap::new();
    for variable in &declaration.variables {
        if let Kind::Enumeration { type_name, items, .. } = variable.kind {
            enumerations.insert(type_name, items);
        }
    }
    if signals.is_empty() && enumerations.is_empty() {
        return;
    }
    xml.open("TypeDefinitions", Attributes::new());
    for signal in signals {
        let attributes = Attributes::new().with("name", type_name(signal));
        xml.open("SimpleType", attributes.with("description", signal.meaning));
        let (min, max) = (Some(signal.range.0), Some(signal.range.1));
        let attributes = real_attributes(signal.unit, Some(signal.quantity), min, max, Some(signal.nominal));
        xml.empty("Real", attributes);
        xml.close();
    }
    for (name, items) in enumerations {
        xml.open("SimpleType", Attributes::new().with("name", name));
        xml.open("Enumeration", Attributes::new());
        for (value, name, meaning) in items {
            let attributes = Attributes::new().with("name", name).with("value", value);
            xml.empty("Item", attributes.with("description", meaning));
        }
        xml.close();
        xml.close();
    }
    xml.close();
}

fn real_attributes<'a>(
    unit: Unit,
    quantity: Option<&str>,
    min: Option<f64>,
    max: Option<f64>,
    nominal: Option<f64>,
) -> Attributes<'a> {
    Attributes::new()
        .with_some("quantity", quantity)
        .with("unit", unit.symbol)
        .with_some("displayUnit", unit.display.map(|display| display.symbol))
        .with_some("min", min)
        .with_some("max", max)
        .with_some("nominal", nominal)
}

/// The standard's word.
#[must_use]
pub fn causality(variable: &Variable) -> &'static str {
    match variable.causality {
        Causality::Parameter => "parameter",
        Causality::Input => "input",
        Causality::Output => "output",
        Causality::Local => "local",
    }
}

/// The standard's word.
#[must_use]
pub fn variability(variable: &Variable) -> &'static str {
    match variable.variability {
        Variability::Fixed => "fixed",
        Variability::Tunable => "tunable",
        Variability::Discrete => "discrete",
        Variability::Continuous => "continuous",
    }
}

fn scalar_variable(xml: &mut Xml, vr: usize, variable: &Variable) {
    // Inputs have no attribute `initial`, calculated variables no start value (FMI 2.0, section 2.2.7).
    let initial = match (variable.causality, variable.initial) {
        (Causality::Input, _) => None,
        (_, Initial::Exact) => Some("exact"),
        (_, Initial::Calculated) => Some("calculated"),
    };
    let exact = variable.initial == Initial::Exact;
    xml.open(
        "ScalarVariable",
        Attributes::new()
            .with("name", &variable.name)
            .with("valueReference", vr)
            .with("description", &variable.description)
            .with("causality", causality(variable))
            .with("variability", variability(variable))
            .with_some("initial", initial),
    );
    match &variable.kind {
        Kind::Real { unit, quantity, start, min, max, nominal } => {
            let attributes = match signal_of(variable) {
                Some(signal) => {
                    Attributes::new().with("declaredType", type_name(signal)).with("unit", unit.symbol)
                }
                None => real_attributes(*unit, *quantity, *min, *max, *nominal),
            };
            xml.empty("Real", attributes.with_some("start", exact.then_some(start)));
        }
        Kind::Integer { start, min, max } => {
            let attributes = Attributes::new().with_some("min", *min).with_some("max", *max);
            xml.empty("Integer", attributes.with_some("start", exact.then_some(start)));
        }
        Kind::Boolean { start } => {
            xml.empty("Boolean", Attributes::new().with_some("start", exact.then_some(start)));
        }
        Kind::String { start } => {
            xml.empty("String", Attributes::new().with_some("start", exact.then_some(start)));
        }
        Kind::Enumeration { type_name, start, .. } => {
            let attributes = Attributes::new().with("declaredType", type_name);
            xml.empty("Enumeration", attributes.with_some("start", exact.then_some(start)));
        }
    }
    xml.close();
}

/// A list of indices, which count variables from 1 in the standard.
fn indices(references: impl Iterator<Item = usize>) -> String {
    references.map(|vr| (vr + 1).to_string()).collect::<Vec<_>>().join(" ")
}

/// At communication points an output depends on what it declares (mostly nothing: no feedthrough). At the start,
/// what the model calculates may depend on every parameter as well, because it is calculated from them.
fn structure(xml: &mut Xml, declaration: &Declaration) {
    let outputs: Vec<(usize, &Variable)> = declaration
        .variables
        .iter()
        .enumerate()
        .filter(|(_, variable)| variable.causality == Causality::Output)
        .collect();
    xml.open("ModelStructure", Attributes::new());
    if !outputs.is_empty() {
        xml.open("Outputs", Attributes::new());
        for (vr, variable) in &outputs {
            let attributes = Attributes::new().with("index", vr + 1);
            let depends = variable.depends_on.iter().copied();
            xml.empty("Unknown", attributes.with("dependencies", indices(depends)));
        }
        xml.close();
    }
    let is_parameter = |(_, variable): &(usize, &Variable)| variable.causality == Causality::Parameter;
    let parameters: Vec<usize> =
        declaration.variables.iter().enumerate().filter(is_parameter).map(|(vr, _)| vr).collect();
    let unknowns: Vec<_> =
        outputs.iter().filter(|(_, variable)| variable.initial == Initial::Calculated).collect();
    if !unknowns.is_empty() {
        xml.open("InitialUnknowns", Attributes::new());
        for (vr, variable) in unknowns {
            let mut knowns: Vec<usize> = parameters.iter().chain(&variable.depends_on).copied().collect();
            knowns.sort_unstable();
            let attributes = Attributes::new().with("index", vr + 1);
            xml.empty("Unknown", attributes.with("dependencies", indices(knowns.into_iter())));
        }
        xml.close();
    }
    xml.close();
}
