//! `modelDescription.xml` from a model's declaration (FMI 2.0, section 2.2 and 4.3.1; FMI 3.0, section 2.4 and 4.4).
//!
//! The GUID (3.0: instantiation token) is a UUID of version 5 over the document without it: the same declaration gives the
//! same GUID, any change another one.

use crate::GENERATION_TOOL;
use crate::standard::Standard;
use crate::xml::{Attributes, Xml};
use rfl_mpc::fmi::logger::STANDARD_CATEGORIES;
use rfl_mpc::fmi::{Causality, Declaration, Initial, Variability, Variable, VariableKind, VersionedVariable};
use rfl_mpc::signal::{self, Signal, Unit};
use std::collections::BTreeMap;
use uuid::Uuid;

/// The document of FMI 2.0, with its GUID.
#[must_use]
pub fn describe(declaration: &Declaration) -> String {
    describe_in(Standard::Fmi2, declaration)
}

/// The document of a version, with its GUID or token.
#[must_use]
pub fn describe_in(standard: Standard, declaration: &Declaration) -> String {
    let mut declaration = declaration.clone();
    declaration.complete(standard.version());
    let without = document(standard, &declaration, "");
    let mark = Uuid::new_v5(&Uuid::NAMESPACE_OID, without.as_bytes());
    document(standard, &declaration, &mark.braced().to_string())
}

/// The document of an FMU whose library is another declaration's, that differs in start values only: with the
/// library's GUID. Of FMI 2.0.
#[must_use]
pub fn describe_for(library: &Declaration, declaration: &Declaration) -> String {
    describe_for_in(Standard::Fmi2, library, declaration)
}

/// The same for any version.
#[must_use]
pub fn describe_for_in(standard: Standard, library: &Declaration, declaration: &Declaration) -> String {
    let of_library = describe_in(standard, library);
    let mut declaration = declaration.clone();
    declaration.complete(standard.version());
    document(standard, &declaration, standard.mark_of(&of_library))
}

fn document(standard: Standard, declaration: &Declaration, mark: &str) -> String {
    let mut xml = Xml::new();
    let is_old = standard == Standard::Fmi2;
    xml.open(
        "fmiModelDescription",
        Attributes::new()
            .with("fmiVersion", standard.number())
            .with("modelName", declaration.name)
            .with(if is_old { "guid" } else { "instantiationToken" }, mark)
            .with("description", declaration.description)
            .with("author", env!("CARGO_PKG_AUTHORS"))
            .with("version", env!("CARGO_PKG_VERSION"))
            .with("license", env!("CARGO_PKG_LICENSE"))
            .with("generationTool", GENERATION_TOOL)
            .with("variableNamingConvention", "structured")
            .with_some("numberOfEventIndicators", is_old.then_some(0)),
    );
    xml.empty("CoSimulation", abilities(standard, declaration));
    units(&mut xml, declaration);
    types(&mut xml, standard, declaration);
    xml.open("LogCategories", Attributes::new());
    for category in STANDARD_CATEGORIES.iter().chain(declaration.log_categories) {
        let attributes = Attributes::new().with("name", category.name);
        let meaning = standard.version().words(category.description);
        xml.empty("Category", attributes.with("description", meaning));
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
    for VersionedVariable { vr, variable, size } in declaration.shown(standard.version()) {
        match standard {
            Standard::Fmi2 => scalar_variable(&mut xml, vr, &variable),
            Standard::Fmi3 => typed_variable(&mut xml, vr, &variable, size),
        }
    }
    xml.close();
    structure(&mut xml, standard, declaration);
    xml.close();
    xml.finish()
}

/// Abilities of the library as a unit of co-simulation.
fn abilities(standard: Standard, declaration: &Declaration) -> Attributes<'static> {
    let common =
        Attributes::new().with("modelIdentifier", declaration.name).with("needsExecutionTool", false);
    match standard {
        Standard::Fmi2 => common
            .with("canHandleVariableCommunicationStepSize", true)
            .with("canInterpolateInputs", false)
            .with("maxOutputDerivativeOrder", 0)
            .with("canRunAsynchronuously", false)
            .with("canBeInstantiatedOnlyOncePerProcess", false)
            .with("canNotUseMemoryManagementFunctions", true)
            .with("canGetAndSetFMUstate", true)
            .with("canSerializeFMUstate", true)
            .with("providesDirectionalDerivative", false),
        Standard::Fmi3 => common
            .with("canBeInstantiatedOnlyOncePerProcess", false)
            .with("canGetAndSetFMUState", true)
            .with("canSerializeFMUState", true)
            .with("providesDirectionalDerivatives", false)
            .with("providesAdjointDerivatives", false)
            .with("providesPerElementDependencies", false)
            .with("canHandleVariableCommunicationStepSize", true)
            .with("maxOutputDerivativeOrder", 0)
            .with("providesIntermediateUpdate", false)
            .with("mightReturnEarlyFromDoStep", declaration.ends_early)
            .with("canReturnEarlyAfterIntermediateUpdate", false)
            .with("hasEventMode", false),
    }
}

fn unit_of(variable: &Variable) -> Option<Unit> {
    match &variable.kind {
        VariableKind::Real { unit, .. } => Some(*unit),
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
        VariableKind::Real { unit, quantity, min, max, nominal, .. } => (*unit == signal.unit
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

fn types(xml: &mut Xml, standard: Standard, declaration: &Declaration) {
    let signals: Vec<&Signal> = declaration.variables.iter().filter_map(signal_of).collect();
    let mut enumerations = BTreeMap::new();
    for variable in &declaration.variables {
        if let VariableKind::Enumeration { type_name, items, .. } = variable.kind {
            enumerations.insert(type_name, items);
        }
    }
    if signals.is_empty() && enumerations.is_empty() {
        return;
    }
    xml.open("TypeDefinitions", Attributes::new());
    for signal in signals {
        let named = Attributes::new().with("name", type_name(signal)).with("description", signal.meaning);
        let (min, max) = (Some(signal.range.0), Some(signal.range.1));
        let of_real = |attributes| {
            real_attributes(attributes, signal.unit, Some(signal.quantity), min, max, Some(signal.nominal))
        };
        match standard {
            Standard::Fmi2 => {
                xml.open("SimpleType", named);
                xml.empty("Real", of_real(Attributes::new()));
                xml.close();
            }
            Standard::Fmi3 => xml.empty("Float64Type", of_real(named)),
        }
    }
    for (name, items) in enumerations {
        let named = Attributes::new().with("name", name);
        match standard {
            Standard::Fmi2 => {
                xml.open("SimpleType", named);
                xml.open("Enumeration", Attributes::new());
                enumeration_items(xml, items);
                xml.close();
                xml.close();
            }
            Standard::Fmi3 => {
                xml.open("EnumerationType", named);
                enumeration_items(xml, items);
                xml.close();
            }
        }
    }
    xml.close();
}

fn enumeration_items(xml: &mut Xml, items: &[(i32, &str, &str)]) {
    for (value, name, meaning) in items {
        let attributes = Attributes::new().with("name", name).with("value", value);
        xml.empty("Item", attributes.with("description", meaning));
    }
}

fn real_attributes<'a>(
    attributes: Attributes<'a>,
    unit: Unit,
    quantity: Option<&str>,
    min: Option<f64>,
    max: Option<f64>,
    nominal: Option<f64>,
) -> Attributes<'a> {
    attributes
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
        Causality::Independent => "independent",
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

/// Inputs have no attribute `initial`, and calculated variables no start value (FMI 2.0, section 2.2.7; 3.0, section 2.4.7).
fn initial(variable: &Variable) -> Option<&'static str> {
    match (variable.causality, variable.initial) {
        (Causality::Input | Causality::Independent, _) => None,
        (_, Initial::Exact) => Some("exact"),
        (_, Initial::Calculated) => Some("calculated"),
    }
}

fn scalar_variable(xml: &mut Xml, vr: usize, variable: &Variable) {
    let exact = variable.initial == Initial::Exact;
    xml.open(
        "ScalarVariable",
        Attributes::new()
            .with("name", &variable.name)
            .with("valueReference", vr)
            .with("description", Standard::Fmi2.version().words(&variable.description))
            .with("causality", causality(variable))
            .with("variability", variability(variable))
            .with_some("initial", initial(variable)),
    );
    match &variable.kind {
        VariableKind::Real { unit, quantity, start, min, max, nominal } => {
            let attributes = match signal_of(variable) {
                Some(signal) => {
                    Attributes::new().with("declaredType", type_name(signal)).with("unit", unit.symbol)
                }
                None => real_attributes(Attributes::new(), *unit, *quantity, *min, *max, *nominal),
            };
            xml.empty("Real", attributes.with_some("start", exact.then_some(start)));
        }
        VariableKind::Integer { start, min, max } => {
            let attributes = Attributes::new().with_some("min", *min).with_some("max", *max);
            xml.empty("Integer", attributes.with_some("start", exact.then_some(start)));
        }
        VariableKind::Boolean { start } => {
            xml.empty("Boolean", Attributes::new().with_some("start", exact.then_some(start)));
        }
        VariableKind::String { start } => {
            xml.empty("String", Attributes::new().with_some("start", exact.then_some(start)));
        }
        VariableKind::Enumeration { type_name, start, .. } => {
            let attributes = Attributes::new().with("declaredType", type_name);
            xml.empty("Enumeration", attributes.with_some("start", exact.then_some(start)));
        }
        // Not in 2.0: declared apart.
        VariableKind::Binary { .. } => {}
    }
    xml.close();
}

/// A variable of FMI 3.0: the element's name is the type, and a string's start value an element.
fn typed_variable(xml: &mut Xml, vr: usize, variable: &Variable, size: Option<usize>) {
    let exact = variable.initial == Initial::Exact;
    let version = Standard::Fmi3.version();
    let attributes = Attributes::new()
        .with("name", &variable.name)
        .with("valueReference", vr)
        .with("description", version.words(&variable.description))
        .with("causality", causality(variable))
        .with("variability", variability(variable))
        .with_some("initial", initial(variable));
    match &variable.kind {
        VariableKind::Real { unit, quantity, start, min, max, nominal } => {
            let attributes = match signal_of(variable) {
                Some(signal) => attributes.with("declaredType", type_name(signal)).with("unit", unit.symbol),
                None => real_attributes(attributes, *unit, *quantity, *min, *max, *nominal),
            };
            let attributes = attributes.with_some("start", exact.then_some(start));
            match size {
                None => xml.empty("Float64", attributes),
                Some(size) => {
                    xml.open("Float64", attributes);
                    xml.empty("Dimension", Attributes::new().with("start", size));
                    xml.close();
                }
            }
        }
        VariableKind::Integer { start, min, max } => {
            let attributes = attributes.with_some("min", *min).with_some("max", *max);
            xml.empty("Int32", attributes.with_some("start", exact.then_some(start)));
        }
        VariableKind::Boolean { start } => {
            xml.empty("Boolean", attributes.with_some("start", exact.then_some(start)));
        }
        VariableKind::String { start } if exact => {
            xml.open("String", attributes);
            xml.empty("Start", Attributes::new().with("value", start));
            xml.close();
        }
        VariableKind::String { .. } => xml.empty("String", attributes),
        VariableKind::Binary { max_size } => {
            let attributes = attributes.with("mimeType", "application/octet-stream");
            xml.open("Binary", attributes.with("maxSize", max_size));
            xml.empty("Start", Attributes::new().with("value", ""));
            xml.close();
        }
        VariableKind::Enumeration { type_name, start, .. } => {
            let attributes = attributes.with("declaredType", type_name);
            xml.empty("Enumeration", attributes.with_some("start", exact.then_some(start)));
        }
    }
}

/// A variable in the structure: its index, which counts from 1, in 2.0, and its reference in 3.0.
fn place(standard: Standard, vr: usize) -> usize {
    if standard == Standard::Fmi2 { vr + 1 } else { vr }
}

/// One unknown with what it depends on.
fn unknown(
    xml: &mut Xml,
    standard: Standard,
    element: &'static str,
    vr: usize,
    knowns: impl Iterator<Item = usize>,
) {
    let name = if standard == Standard::Fmi2 { "index" } else { "valueReference" };
    let knowns: Vec<_> = knowns.map(|vr| place(standard, vr).to_string()).collect();
    let attributes = Attributes::new().with(name, place(standard, vr));
    xml.empty(element, attributes.with("dependencies", knowns.join(" ")));
}

/// At communication points an output depends on what it declares (mostly nothing: no feedthrough). At the start,
/// what the model calculates may depend on every parameter as well, because it is calculated from them.
fn structure(xml: &mut Xml, standard: Standard, declaration: &Declaration) {
    // 2.0 has a list around each kind of unknowns, 3.0 says the kind of each.
    let is_old = standard == Standard::Fmi2;
    let shown = declaration.shown(standard.version());
    let outputs: Vec<(usize, &Variable)> = shown
        .iter()
        .map(|shown| (shown.vr, &*shown.variable))
        .filter(|(_, variable)| variable.causality == Causality::Output)
        .collect();
    xml.open("ModelStructure", Attributes::new());
    if !outputs.is_empty() {
        if is_old {
            xml.open("Outputs", Attributes::new());
        }
        for (vr, variable) in &outputs {
            let element = if is_old { "Unknown" } else { "Output" };
            unknown(xml, standard, element, *vr, variable.depends_on.iter().copied());
        }
        if is_old {
            xml.close();
        }
    }
    let is_parameter = |(_, variable): &(usize, &Variable)| variable.causality == Causality::Parameter;
    let parameters: Vec<usize> =
        declaration.variables.iter().enumerate().filter(is_parameter).map(|(vr, _)| vr).collect();
    let unknowns: Vec<_> =
        outputs.iter().filter(|(_, variable)| variable.initial == Initial::Calculated).collect();
    if !unknowns.is_empty() {
        if is_old {
            xml.open("InitialUnknowns", Attributes::new());
        }
        for (vr, variable) in unknowns {
            let mut knowns: Vec<usize> = parameters.iter().chain(&variable.depends_on).copied().collect();
            knowns.sort_unstable();
            let element = if is_old { "Unknown" } else { "InitialUnknown" };
            unknown(xml, standard, element, *vr, knowns.into_iter());
        }
        if is_old {
            xml.close();
        }
    }
    xml.close();
}
