//! A system of FMUs as an SSP archive (System Structure and Parameterization). Units of FMI 2.0 make one of SSP 1.0, those of FMI 3.0
//! one of SSP 2.0, which has their types and arrays.
//!
//! Components are connected by name: an output of one feeds the input of the same name of another. Masters that
//! step components one after the other follow their order here, so the plant comes first.
//!
//! Hosts read different parts. libcosim and ecos match prefixes literally (`ssd:`, `ssc:`, `ssv:`) and want parameters
//! inside the component; ecos only those of the set that its `init` names (the system's name). libcosim takes its step
//! from an OSP annotation, OMSimulator its master and step from one of OpenModelica. fmpy takes parameters from an
//! `.ssv` file with names `COMPONENT.PARAMETER`, and no step at all. libcosim ends at a connector that is an
//! enumeration, and the standard does not let one be an integer: those stay out.

use crate::GENERATION_TOOL;
use crate::description::{base_unit, units_of};
use crate::standard::Standard;
use crate::xml::{Attributes, Xml};
use rfl_mpc::fmi::{
    Causality, Declaration, DefaultExperiment, Value, Variable, VariableKind, VersionedVariable,
};

/// A parameter's value for one component.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    component: usize,
    name: String,
    value: Value,
}

impl Setting {
    /// The element of a parameter set, and the value in it.
    fn element(&self, words: &Words) -> (&'static str, String) {
        match &self.value {
            Value::Real(value) => (words.real_value, value.to_string()),
            // Hosts set enumerations as integers.
            Value::Integer(value) => (words.integer_value, value.to_string()),
            Value::Boolean(value) => ("ssv:Boolean", value.to_string()),
            Value::String(value) => ("ssv:String", value.clone()),
            // No text is a value of it, so that it is never set.
            Value::Binary(_) => ("ssv:Binary", String::new()),
        }
    }
}

/// Differences between the versions of SSP: types are named as the variables of the units are.
struct Words {
    real: &'static str,
    integer: &'static str,
    real_value: &'static str,
    integer_value: &'static str,
}

impl Words {
    fn of(standard: Standard) -> &'static Self {
        match standard {
            Standard::Fmi2 => &Self {
                real: "ssc:Real",
                integer: "ssc:Integer",
                real_value: "ssv:Real",
                integer_value: "ssv:Integer",
            },
            Standard::Fmi3 => &Self {
                real: "ssc:Float64",
                integer: "ssc:Int32",
                real_value: "ssv:Float64",
                integer_value: "ssv:Int32",
            },
        }
    }
}

/// Reasons for which a setting cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum SettingError {
    #[error("`{0}` is no setting: write COMPONENT.PARAMETER=VALUE, e.g. PassengerCar.vehicle.mass=1500")]
    Form(String),
    #[error("there is no component of which `{name}` is a parameter; components: {components}")]
    Unknown { name: String, components: String },
    #[error(
        "`{name}` is set in a system, and no system is made: it needs both its FMUs, {needed}. Give both, or --start {name}=... \
         for the FMU alone"
    )]
    NoSystem { name: String, needed: String },
    #[error("`{name}` is {wanted}, which `{value}` is not")]
    Value { name: String, value: String, wanted: String },
}

/// An output that feeds an input; components are indices in their system.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct Connection<'a> {
    pub source: usize,
    pub output: &'a Variable,
    pub target: usize,
    pub input: &'a Variable,
}

/// A system of components.
#[derive(Debug)]
pub struct System {
    name: String,
    components: Vec<Declaration>,
    settings: Vec<Setting>,
}

impl System {
    /// A system of these components, connected by name.
    #[must_use]
    pub fn new(name: &str, components: Vec<Declaration>) -> Self {
        Self { name: name.to_owned(), components, settings: Vec::new() }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its components, in the order in which they step.
    pub fn components(&self) -> impl Iterator<Item = &Declaration> {
        self.components.iter()
    }

    /// Sets a parameter, as `COMPONENT.PARAMETER=VALUE`.
    ///
    /// # Errors
    /// If there is no such parameter, or the value is not of its type and range.
    pub fn set(&mut self, text: &str) -> Result<(), SettingError> {
        let (name, value) = text.split_once('=').ok_or_else(|| SettingError::Form(text.to_owned()))?;
        let (name, value) = (name.trim(), value.trim());
        let found = self.components.iter().enumerate().find_map(|(i, component)| {
            let parameter = name.strip_prefix(component.name)?.strip_prefix('.')?;
            let variable = &component.variables[component.find(parameter)?];
            (variable.causality == Causality::Parameter).then_some((i, variable))
        });
        let (component, variable) = found.ok_or_else(|| {
            let components: Vec<_> = self.components.iter().map(|component| component.name).collect();
            SettingError::Unknown { name: name.to_owned(), components: components.join(", ") }
        })?;
        let value = variable.value_of(value).map_err(|wanted| SettingError::Value {
            name: name.to_owned(),
            value: value.to_owned(),
            wanted,
        })?;
        let name = variable.name.to_string();
        self.settings.retain(|setting| (setting.component, &setting.name) != (component, &name));
        self.settings.push(Setting { component, name, value });
        Ok(())
    }

    /// The values that were set for a component, by parameter.
    pub fn settings_of<'a>(&'a self, component: &'a str) -> impl Iterator<Item = (&'a str, &'a Value)> {
        let of = move |setting: &&Setting| self.components[setting.component].name == component;
        self.settings.iter().filter(of).map(|setting| (setting.name.as_str(), &setting.value))
    }

    /// Connections of the system.
    #[must_use]
    pub fn connections(&self) -> Vec<Connection<'_>> {
        let mut connections = Vec::new();
        for (target, component) in self.components.iter().enumerate() {
            for input in component.variables.iter().filter(|variable| variable.causality == Causality::Input)
            {
                let source = self.components.iter().enumerate().find_map(|(source, other)| {
                    let output = &other.variables[other.find(&input.name)?];
                    (source != target && output.causality == Causality::Output).then_some((source, output))
                });
                connections.extend(source.map(|(source, output)| Connection {
                    source,
                    output,
                    target,
                    input,
                }));
            }
        }
        connections
    }

    /// The longest run and the shortest step among the components' default experiments.
    fn experiment(&self) -> DefaultExperiment {
        let all = self.components.iter().map(|component| component.experiment);
        all.reduce(|a, b| DefaultExperiment {
            start_time: a.start_time.min(b.start_time),
            stop_time: a.stop_time.max(b.stop_time),
            tolerance: a.tolerance.min(b.tolerance),
            step_size: a.step_size.min(b.step_size),
        })
        .unwrap_or(DefaultExperiment {
            start_time: 0.0,
            stop_time: 1.0,
            tolerance: 1e-6,
            step_size: 0.01,
        })
    }

    /// `SystemStructure.ssd` of units of a version; FMUs are in `resources/NAME.fmu`.
    #[must_use]
    pub fn structure(&self, standard: Standard) -> String {
        let mut xml = Xml::new();
        xml.open(
            "ssd:SystemStructureDescription",
            Attributes::new()
                .with("xmlns:ssc", "http://ssp-standard.org/SSP1/SystemStructureCommon")
                .with("xmlns:ssd", "http://ssp-standard.org/SSP1/SystemStructureDescription")
                .with("xmlns:ssv", "http://ssp-standard.org/SSP1/SystemStructureParameterValues")
                .with("xmlns:osp", "http://opensimulationplatform.com/SSP/OSPAnnotations")
                .with(
                    "xmlns:oms",
                    "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
                )
                .with("version", standard.of_systems())
                .with("name", &self.name)
                .with("generationTool", GENERATION_TOOL),
        );
        xml.open("ssd:System", Attributes::new().with("name", &self.name));
        xml.open("ssd:Elements", Attributes::new());
        for component in 0..self.components.len() {
            self.component(&mut xml, component, standard);
        }
        xml.close();
        let connections = self.connections();
        if !connections.is_empty() {
            xml.open("ssd:Connections", Attributes::new());
            for Connection { source, output, target, input } in connections {
                xml.empty(
                    "ssd:Connection",
                    Attributes::new()
                        .with("startElement", self.components[source].name)
                        .with("startConnector", &output.name)
                        .with("endElement", self.components[target].name)
                        .with("endConnector", &input.name),
                );
            }
            xml.close();
        }
        let experiment = self.experiment();
        xml.open("ssd:Annotations", Attributes::new());
        xml.open("ssc:Annotation", Attributes::new().with("type", "org.openmodelica"));
        xml.open("oms:Annotations", Attributes::new());
        xml.open("oms:SimulationInformation", Attributes::new());
        xml.empty(
            "oms:FixedStepMaster",
            Attributes::new()
                // The master's name in OMSimulator: it has this one.
                .with("description", "oms-ma")
                .with("stepSize", experiment.step_size)
                .with("absoluteTolerance", experiment.tolerance)
                .with("relativeTolerance", experiment.tolerance),
        );
        for _ in 0..5 {
            xml.close();
        }
        self.units(&mut xml, standard);
        let times = Attributes::new().with("startTime", experiment.start_time);
        xml.open("ssd:DefaultExperiment", times.with("stopTime", experiment.stop_time));
        xml.open("ssd:Annotations", Attributes::new());
        xml.open("ssc:Annotation", Attributes::new().with("type", "com.opensimulationplatform"));
        xml.open("osp:Algorithm", Attributes::new());
        xml.empty("osp:FixedStepAlgorithm", Attributes::new().with("baseStepSize", experiment.step_size));
        for _ in 0..5 {
            xml.close();
        }
        xml.finish()
    }

    /// The units that connectors name.
    fn units(&self, xml: &mut Xml, standard: Standard) {
        let connectors = (0..self.components.len()).flat_map(|index| self.connectors(index, standard));
        let shown: Vec<_> = connectors.collect();
        let units = units_of(&shown.iter().map(|(shown, _)| &*shown.variable).collect::<Vec<_>>());
        if !units.is_empty() {
            xml.open("ssd:Units", Attributes::new());
            for unit in units {
                xml.open("ssc:Unit", Attributes::new().with("name", unit.symbol));
                xml.empty("ssc:BaseUnit", base_unit(unit));
                xml.close();
            }
            xml.close();
        }
    }

    /// The variables of a component that are connectors, and their kind: inputs that are connected, and outputs, which a
    /// user may want to record. Strings and enumerations are left out; nothing is connected to them.
    fn connectors(&self, index: usize, standard: Standard) -> Vec<(VersionedVariable<'_>, &'static str)> {
        let connections = self.connections();
        let into = connections.iter().filter(|connection| connection.target == index);
        let connected: Vec<&Variable> = into.map(|connection| connection.input).collect();
        let kind = |variable: &Variable| {
            let shown =
                !matches!(variable.kind, VariableKind::String { .. } | VariableKind::Enumeration { .. });
            match variable.causality {
                Causality::Input if connected.contains(&variable) => Some("input"),
                Causality::Output if shown => Some("output"),
                _ => None,
            }
        };
        let variables = self.components[index].shown(standard.version()).into_iter();
        variables
            .filter_map(|shown| {
                let kind = kind(&shown.variable)?;
                Some((shown, kind))
            })
            .collect()
    }

    fn component(&self, xml: &mut Xml, index: usize, standard: Standard) {
        let component = &self.components[index];
        xml.open(
            "ssd:Component",
            Attributes::new()
                .with("name", component.name)
                .with("type", "application/x-fmu-sharedlibrary")
                .with("source", format!("resources/{}.fmu", component.name)),
        );
        xml.open("ssd:Connectors", Attributes::new());
        let words = Words::of(standard);
        for (VersionedVariable { variable, size, .. }, kind) in self.connectors(index, standard) {
            xml.open("ssd:Connector", Attributes::new().with("name", &variable.name).with("kind", kind));
            match &variable.kind {
                VariableKind::Real { unit, .. } => {
                    xml.empty(words.real, Attributes::new().with("unit", unit.symbol))
                }
                VariableKind::Boolean { .. } => xml.empty("ssc:Boolean", Attributes::new()),
                _ => xml.empty(words.integer, Attributes::new()),
            }
            if let Some(size) = size {
                xml.empty("ssc:Dimension", Attributes::new().with("size", size));
            }
            xml.close();
        }
        xml.close();
        let settings: Vec<_> = self.settings.iter().filter(|setting| setting.component == index).collect();
        if !settings.is_empty() {
            xml.open("ssd:ParameterBindings", Attributes::new());
            xml.open("ssd:ParameterBinding", Attributes::new());
            xml.open("ssd:ParameterValues", Attributes::new());
            // Ecos chooses a set by its name: one name for all components.
            let named = settings.into_iter().map(|setting| (setting.name.clone(), setting));
            parameter_set(xml, standard, &self.name, named);
            xml.close();
            xml.close();
            xml.close();
        }
        xml.close();
    }

    /// All settings as an `.ssv` document, for hosts that take parameters apart; `None` if there is none.
    #[must_use]
    pub fn parameters(&self, standard: Standard) -> Option<String> {
        if self.settings.is_empty() {
            return None;
        }
        let mut xml = Xml::new();
        let full =
            |setting: &Setting| format!("{}.{}", self.components[setting.component].name, setting.name);
        let named = self.settings.iter().map(|setting| (full(setting), setting));
        parameter_set(&mut xml, standard, &self.name, named);
        Some(xml.finish())
    }
}

fn parameter_set<'a>(
    xml: &mut Xml,
    standard: Standard,
    name: &str,
    settings: impl Iterator<Item = (String, &'a Setting)>,
) {
    xml.open(
        "ssv:ParameterSet",
        Attributes::new()
            .with("xmlns:ssv", "http://ssp-standard.org/SSP1/SystemStructureParameterValues")
            .with("version", standard.of_systems())
            .with("name", name),
    );
    xml.open("ssv:Parameters", Attributes::new());
    for (name, setting) in settings {
        xml.open("ssv:Parameter", Attributes::new().with("name", name));
        let (element, value) = setting.element(Words::of(standard));
        xml.empty(element, Attributes::new().with("value", value));
        xml.close();
    }
    xml.close();
    xml.close();
}
