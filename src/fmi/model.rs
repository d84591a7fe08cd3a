//! The trait that the FMI layer asks of a model. It knows nothing else of vehicles or controllers.

use super::values::Values;
use super::variable::{Causality, Variable, VariableKind, Vr};
use super::version::Version;
use std::borrow::Cow;
use std::path::PathBuf;

/// Everything about a model that its `modelDescription.xml` says.
#[derive(Debug, Clone, PartialEq)]
pub struct Declaration {
    /// FMI `modelName`, and the `modelIdentifier` of the library.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// All variables; a [`Vr`] is an index here.
    pub variables: Vec<Variable>,
    /// Parameters that are bytes. They stand behind the other variables, in order, in a version that has this type.
    pub binaries: Vec<Variable>,
    /// Outputs that are one array in versions of FMI that have arrays.
    pub arrays: Vec<Array>,
    /// True if [`Model::step_to_event`] may end before the step does.
    pub ends_early: bool,
    /// FMI `DefaultExperiment`.
    pub experiment: DefaultExperiment,
    /// Log categories beyond the standard ones.
    pub log_categories: &'static [LogCategory],
}

/// Real outputs that belong together. They are one variable, with the reference of the first, in a version that has arrays;
/// elsewhere each is a scalar.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct Array {
    pub name: Cow<'static, str>,
    pub description: Cow<'static, str>,
    /// The scalars, in order.
    pub elements: Vec<Vr>,
}

/// A variable as a version of FMI shows it.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct VersionedVariable<'a> {
    pub vr: Vr,
    pub variable: Cow<'a, Variable>,
    /// Number of elements of an array.
    pub size: Option<usize>,
}

impl Declaration {
    /// The variables as a version shows them: arrays instead of their scalars where it has arrays.
    #[must_use]
    pub fn shown(&self, version: &Version) -> Vec<VersionedVariable<'_>> {
        let arrays: &[Array] = if version.has_arrays { &self.arrays } else { &[] };
        let variables = self.variables.iter().enumerate();
        let shown = variables.filter_map(|(vr, variable)| {
            let array = arrays.iter().find(|array| array.elements.contains(&vr));
            let Some(Array { name, description, elements }) = array else {
                return Some(VersionedVariable { vr, variable: Cow::Borrowed(variable), size: None });
            };
            let whole = Variable { name: name.clone(), description: description.clone(), ..variable.clone() };
            (elements.first() == Some(&vr)).then_some(VersionedVariable {
                vr,
                variable: Cow::Owned(whole),
                size: Some(elements.len()),
            })
        });
        shown.collect()
    }

    /// Declares scalars as an array.
    pub fn add_array(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        description: impl Into<Cow<'static, str>>,
        elements: Vec<Vr>,
    ) {
        let alike = |vr: &Vr| {
            let Variable { causality, kind, .. } = &self.variables[*vr];
            *causality == Causality::Output && matches!(kind, VariableKind::Real { .. })
        };
        crate::invariant!(elements.iter().all(alike), "an array is of real outputs");
        self.arrays.push(Array { name: name.into(), description: description.into(), elements });
    }

    /// Adds a variable and gives its reference.
    pub fn add(&mut self, variable: Variable) -> Vr {
        crate::invariant!(self.find(&variable.name).is_none(), "{} is declared twice", variable.name);
        self.variables.push(variable);
        self.variables.len() - 1
    }

    /// Adds a parameter that is bytes and gives its reference; all other variables must be there.
    pub fn add_binary(&mut self, variable: Variable) -> Vr {
        self.binaries.push(variable);
        self.variables.len() + self.binaries.len() - 1
    }

    /// Adds what not all versions have, bytes and time, behind the other variables. Gives time.
    pub fn complete(&mut self, version: &Version) -> Option<Vr> {
        if version.has_binaries {
            self.variables.append(&mut self.binaries);
        }
        version.has_time.then(|| self.add(Variable::time()))
    }

    /// Looks a variable up by name.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<Vr> {
        self.variables.iter().position(|variable| variable.name == name)
    }
}

/// FMI `DefaultExperiment`, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct DefaultExperiment {
    pub start_time: f64,
    pub stop_time: f64,
    pub tolerance: f64,
    pub step_size: f64,
}

/// A log category with what a person finds in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct LogCategory {
    pub name: &'static str,
    pub description: &'static str,
}

/// Severity of a log message; it becomes the message's status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Severity {
    Info,
    Warning,
    Error,
}

/// Receiver of a model's messages.
pub trait Log {
    /// Tells the host something. `category` is one of the declaration's log categories.
    fn log(&mut self, severity: Severity, category: &'static str, message: &str);
}

/// Surroundings of a model, as it may know them when it is initialised.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Context {
    /// The FMU's `resources/` folder, where the host gave a usable one.
    pub resources: Option<PathBuf>,
    /// The instance's name.
    pub instance_name: String,
}

impl Context {
    /// Finds a file that a string parameter names: as it is if it is absolute, else in `resources/`, else
    /// relative to the working directory.
    #[must_use]
    pub fn locate(&self, name: &str) -> PathBuf {
        let path = PathBuf::from(name);
        match &self.resources {
            Some(resources) if path.is_relative() && resources.join(&path).exists() => resources.join(path),
            _ => path,
        }
    }
}

/// Reason for which a model could not be initialised or make a step. The message says what was wrong, where (file, line,
/// variable) and what to do.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The step cannot be made, the instance stays usable: other inputs or another step may work, and
    /// is discarded.
    #[error("{0}")]
    Discard(String),
    /// The instance is of no further use until it is reset.
    #[error("{0}")]
    Failed(String),
}

/// A model that the FMI layer can export.
///
/// A life: [`new`](Model::new), then [`initialize`](Model::initialize) when the host leaves initialisation mode,
/// then [`step`](Model::step) any number of times. [`save`](Model::save) and [`restore`](Model::restore) carry
/// everything that steps change and that does not stand in [`Values`]: a restored model continues bit for bit.
pub trait Model: Send + Sized + 'static {
    /// Variables and description. Cheap enough to be called once per instance.
    fn declaration() -> Declaration;

    /// A model that is not initialised yet.
    fn new() -> Self;

    /// Reads parameters and resources, and calculates the outputs at the start. Called once on a new model, but
    /// perhaps on several models of one instance: when the host reads an output in initialisation mode and then
    /// sets something, after a reset, and before [`restore`](Model::restore) into an instance of other parameters.
    /// So tunable parameters are read in each step, not here.
    /// Parameters given by a file are written back to `values`, unless the host has set them itself.
    ///
    /// # Errors
    /// A parameter out of its meaning, or a resource that cannot be read: with file, line and remedy.
    fn initialize(
        &mut self,
        values: &mut Values,
        start_time: f64,
        context: &Context,
        log: &mut dyn Log,
    ) -> Result<(), ModelError>;

    /// Advances from `time` to `time + step`, both in seconds, `step` positive and finite. Inputs in `values` are
    /// finite, but for those that may be missing, and hold over the step; outputs are written to `values`. An error leaves the model as it was.
    ///
    /// # Errors
    /// The reason for which the step could not be made.
    fn step(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<(), ModelError>;

    /// The same for a host that lets a step end early. It ends where the host should look at once, say at a change of a
    /// status. Gives the length of the step that was made, more than 0 and at most `step`.
    ///
    /// # Errors
    /// As [`step`](Model::step).
    fn step_to_event(
        &mut self,
        values: &mut Values,
        time: f64,
        step: f64,
        log: &mut dyn Log,
    ) -> Result<f64, ModelError> {
        self.step(values, time, step, log).map(|()| step)
    }

    /// True if a call that did its work with a warning returns a warning. Many hosts end a run at any status but
    /// OK, so it returns OK unless the user asks for the warning; the log tells it in either case.
    fn reports_warnings(&self, _values: &Values) -> bool {
        false
    }

    /// Appends the internal state to `bytes`.
    fn save(&self, bytes: &mut Vec<u8>);

    /// Checks bytes that are to become a state later: decodable, and numbers and places in them that a run can have.
    ///
    /// # Errors
    /// The fault in them.
    fn check(bytes: &[u8]) -> Result<(), ModelError>;

    /// Sets the internal state of an initialised model (same parameters) from what [`save`](Model::save) wrote.
    ///
    /// # Errors
    /// Bytes that are truncated or of another model or version. The model is then as it was.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), ModelError>;
}
