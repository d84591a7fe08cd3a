//! A variable of an FMU: the declaration from which XML, checks and documentation are made.

use super::value::{BinaryValue, Value};
use crate::signal::{Signal, Unit};
use std::borrow::Cow;

/// A value reference: the index of a variable in its model's [`Declaration`](super::Declaration), for all types.
pub type Vr = usize;

/// FMI's causality (2.0, section 2.2.7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Causality {
    Parameter,
    Input,
    Output,
    Local,
    /// Time, where the version has it as a variable.
    Independent,
}

/// FMI's variability (2.0, section 2.2.7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variability {
    /// Set before the end of initialisation, then constant.
    Fixed,
    /// A parameter that may be changed between steps.
    Tunable,
    /// Changes at steps only (reals that jump, integers, booleans, strings).
    Discrete,
    /// Any real signal.
    Continuous,
}

/// FMI's attribute `initial`: where the value at the start comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Initial {
    /// The start value, as the host sets it.
    Exact,
    /// Calculated by the model during initialisation.
    Calculated,
}

/// Type of a variable with what the type needs.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub enum VariableKind {
    Real {
        unit: Unit,
        quantity: Option<&'static str>,
        start: f64,
        min: Option<f64>,
        max: Option<f64>,
        nominal: Option<f64>,
    },
    Integer {
        start: i32,
        min: Option<i32>,
        max: Option<i32>,
    },
    Boolean {
        start: bool,
    },
    String {
        start: Cow<'static, str>,
    },
    /// Bytes, which start empty. Not all versions have them; see [`Declaration::binaries`](super::Declaration::binaries).
    Binary {
        max_size: usize,
    },
    /// An integer among named values; `items` holds value, name and meaning.
    Enumeration {
        type_name: &'static str,
        items: &'static [(i32, &'static str, &'static str)],
        start: i32,
    },
}

impl VariableKind {
    /// The declared start value.
    #[must_use]
    pub fn start(&self) -> Value {
        match self {
            VariableKind::Real { start, .. } => Value::Real(*start),
            VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. } => {
                Value::Integer(*start)
            }
            VariableKind::Boolean { start } => Value::Boolean(*start),
            VariableKind::String { start } => Value::String(start.to_string()),
            VariableKind::Binary { .. } => Value::Binary(BinaryValue::default()),
        }
    }
}

/// One variable of an FMU.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct Variable {
    pub name: Cow<'static, str>,
    pub description: Cow<'static, str>,
    pub causality: Causality,
    pub variability: Variability,
    pub initial: Initial,
    pub kind: VariableKind,
    /// For outputs: the inputs on which the value at a communication point depends directly (without a step in
    /// between). Empty for models without feedthrough.
    pub depends_on: Vec<Vr>,
    /// True if the start value is a choice of the user, with which the FMU was packed. It counts whatever it is.
    pub chosen: bool,
    /// For real inputs: true if the model knows what to do without a number, so that a host may set one that is not finite.
    pub may_be_missing: bool,
}

impl Variable {
    fn real(
        causality: Causality,
        name: Cow<'static, str>,
        unit: Unit,
        description: Cow<'static, str>,
    ) -> Self {
        let (variability, initial) = match causality {
            Causality::Parameter => (Variability::Fixed, Initial::Exact),
            Causality::Input => (Variability::Continuous, Initial::Exact),
            Causality::Output | Causality::Local | Causality::Independent => {
                (Variability::Continuous, Initial::Calculated)
            }
        };
        let kind =
            VariableKind::Real { unit, quantity: None, start: 0.0, min: None, max: None, nominal: None };
        Self { variability, initial, ..Self::of(causality, kind, name, description) }
    }

    fn of_signal(causality: Causality, signal: &Signal) -> Self {
        let mut variable = Self::real(causality, signal.name.into(), signal.unit, signal.meaning.into());
        if let VariableKind::Real { quantity, min, max, nominal, .. } = &mut variable.kind {
            *quantity = Some(signal.quantity);
            (*min, *max) = (Some(signal.range.0), Some(signal.range.1));
            *nominal = Some(signal.nominal);
        }
        variable
    }

    /// An input that is a signal of the vocabulary; start 0.
    #[must_use]
    pub fn input(signal: &Signal) -> Self {
        Self::of_signal(Causality::Input, signal)
    }

    /// The same for a model that knows what to do without a number.
    #[must_use]
    pub fn input_or_missing(signal: &Signal) -> Self {
        Self { may_be_missing: true, ..Self::input(signal) }
    }

    /// An output that is a signal of the vocabulary.
    #[must_use]
    pub fn output(signal: &Signal) -> Self {
        Self::of_signal(Causality::Output, signal)
    }

    /// A real output that is not in the vocabulary of signals, e.g. a wheel load.
    #[must_use]
    pub fn real_output(
        name: impl Into<Cow<'static, str>>,
        unit: Unit,
        description: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self::real(Causality::Output, name.into(), unit, description.into())
    }

    /// The instance's time.
    pub(super) fn time() -> Self {
        let meaning = "Time of the instance: the newest communication point";
        Self::real(Causality::Independent, "time".into(), Unit::SECOND, meaning.into())
    }

    /// A fixed real parameter.
    #[must_use]
    pub fn parameter(
        name: impl Into<Cow<'static, str>>,
        unit: Unit,
        start: f64,
        description: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self::real(Causality::Parameter, name.into(), unit, description.into()).start(start)
    }

    /// A fixed parameter of another type than real (`Kind::Integer`, `Boolean`, `String`, `Enumeration`).
    #[must_use]
    pub fn parameter_of(
        kind: VariableKind,
        name: impl Into<Cow<'static, str>>,
        description: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self::of(Causality::Parameter, kind, name.into(), description.into())
    }

    fn of(
        causality: Causality,
        kind: VariableKind,
        name: Cow<'static, str>,
        description: Cow<'static, str>,
    ) -> Self {
        Self {
            name,
            description,
            causality,
            variability: Variability::Fixed,
            initial: Initial::Exact,
            kind,
            depends_on: Vec::new(),
            chosen: false,
            may_be_missing: false,
        }
    }

    /// A discrete output of another type than real.
    #[must_use]
    pub fn output_of(
        kind: VariableKind,
        name: impl Into<Cow<'static, str>>,
        description: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self {
            causality: Causality::Output,
            variability: Variability::Discrete,
            initial: Initial::Calculated,
            ..Self::parameter_of(kind, name, description)
        }
    }

    /// Sets the start value of a real.
    #[must_use]
    pub fn start(mut self, value: f64) -> Self {
        if let VariableKind::Real { start, .. } = &mut self.kind {
            *start = value;
        }
        self
    }

    /// Sets the range of a real; a set call outside it is refused.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        if let VariableKind::Real { min, max, .. } = &mut self.kind {
            (*min, *max) = (low.is_finite().then_some(low), high.is_finite().then_some(high));
        }
        self
    }

    /// Makes a parameter tunable: it may be set between steps.
    #[must_use]
    pub fn tunable(mut self) -> Self {
        self.variability = Variability::Tunable;
        self
    }
}
