//! The values of one instance's variables.

use super::value::{BinaryValue, Value};
use super::variable::{Initial, Variability, Variable, VariableKind, Vr};
use serde::{Deserialize, Serialize};

/// Values of all variables of an instance, by value reference, with a mark for those that the host has chosen. A
/// parameter file may give the others.
///
/// The typed getters are for models, which ask for their own variables by references they got when they declared them.
/// A reference of the wrong type is an error in the model's code. The getters then give the type's neutral value in
/// release builds and fail in debug builds. Hosts' references are checked before, in the FMI layer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Values {
    values: Vec<Value>,
    set_by_host: Vec<bool>,
    /// Start values that are choices; the FMU's, and no part of a stored state.
    #[serde(skip)]
    packed: Vec<bool>,
}

impl Values {
    /// The start values of a model's variables.
    #[must_use]
    pub fn starting_from(variables: &[Variable]) -> Self {
        let values = variables.iter().map(|variable| variable.kind.start()).collect();
        let mut started = Self { values, set_by_host: vec![false; variables.len()], packed: Vec::new() };
        started.mark_packed(variables);
        started
    }

    /// Marks the start values with which the FMU was packed.
    pub(super) fn mark_packed(&mut self, variables: &[Variable]) {
        self.packed = variables.iter().map(|variable| variable.chosen).collect();
    }

    /// The value behind a reference, if there is one.
    #[must_use]
    pub fn get(&self, vr: Vr) -> Option<&Value> {
        self.values.get(vr)
    }

    /// Sets a value of `variable`, the one behind `vr`, on behalf of the host. The caller has checked reference, type,
    /// range and permission. The declared start is no choice: hosts write it unasked.
    pub fn set_by_host(&mut self, vr: Vr, variable: &Variable, value: Value) {
        self.set_by_host[vr] = value != variable.kind.start();
        self.values[vr] = value;
    }

    /// True if the host has given this variable another value than its declared start.
    #[must_use]
    pub fn is_set_by_host(&self, vr: Vr) -> bool {
        self.set_by_host[vr]
    }

    /// True if the value is a choice: the host's, or of who packed the FMU. It counts more than a file's.
    #[must_use]
    pub fn is_chosen(&self, vr: Vr) -> bool {
        self.set_by_host[vr] || self.packed.get(vr).is_some_and(|packed| *packed)
    }

    /// A real's value.
    #[must_use]
    #[inline]
    pub fn real(&self, vr: Vr) -> f64 {
        match self.values[vr] {
            Value::Real(value) => value,
            _ => Self::wrong_type(vr, f64::NAN),
        }
    }

    /// An integer's or enumeration's value.
    #[must_use]
    #[inline]
    pub fn integer(&self, vr: Vr) -> i32 {
        match self.values[vr] {
            Value::Integer(value) => value,
            _ => Self::wrong_type(vr, 0),
        }
    }

    /// A boolean's value.
    #[must_use]
    #[inline]
    pub fn boolean(&self, vr: Vr) -> bool {
        match self.values[vr] {
            Value::Boolean(value) => value,
            _ => Self::wrong_type(vr, false),
        }
    }

    /// A string's value.
    #[must_use]
    pub fn string(&self, vr: Vr) -> &str {
        match &self.values[vr] {
            Value::String(value) => value,
            _ => Self::wrong_type(vr, ""),
        }
    }

    /// Bytes; none where the version of FMI has no such type.
    #[must_use]
    pub fn binary(&self, vr: Vr) -> BinaryValue {
        match self.values.get(vr) {
            Some(Value::Binary(value)) => value.clone(),
            _ => BinaryValue::default(),
        }
    }

    /// Sets a real that the model calculates.
    #[inline]
    pub fn set_real(&mut self, vr: Vr, value: f64) {
        self.values[vr] = Value::Real(value);
    }

    /// Sets an integer or enumeration that the model calculates.
    #[inline]
    pub fn set_integer(&mut self, vr: Vr, value: i32) {
        self.values[vr] = Value::Integer(value);
    }

    /// Sets a boolean that the model calculates.
    #[inline]
    pub fn set_boolean(&mut self, vr: Vr, value: bool) {
        self.values[vr] = Value::Boolean(value);
    }

    /// Sets a string that the model calculates.
    pub fn set_string(&mut self, vr: Vr, value: String) {
        self.values[vr] = Value::String(value);
    }

    /// Gives all variables that the host has not set their start values again, as before an initialisation.
    pub(super) fn forget_calculated(&mut self, variables: &[Variable]) {
        let start = Self::starting_from(variables);
        for (i, value) in start.values.into_iter().enumerate() {
            if !self.set_by_host[i] {
                self.values[i] = value;
            }
        }
    }

    /// True if values read from a file can be those of these variables: number, types, finite reals where a host
    /// must set such, known enumeration values.
    pub(super) fn fit(&self, variables: &[Variable]) -> bool {
        let fits = |(variable, value): (&Variable, &Value)| match (&variable.kind, value) {
            (VariableKind::Real { .. }, Value::Real(value)) => {
                variable.initial == Initial::Calculated || variable.may_be_missing || value.is_finite()
            }
            (VariableKind::Enumeration { items, .. }, Value::Integer(value)) => {
                items.iter().any(|item| item.0 == *value)
            }
            (VariableKind::Integer { .. }, Value::Integer(_))
            | (VariableKind::Boolean { .. }, Value::Boolean(_))
            | (VariableKind::String { .. }, Value::String(_)) => true,
            (VariableKind::Binary { max_size }, Value::Binary(value)) => value.len() <= *max_size,
            _ => false,
        };
        self.values.len() == variables.len()
            && self.set_by_host.len() == variables.len()
            && variables.iter().zip(&self.values).all(fits)
    }

    /// True if two sets of values agree in the inputs of a model's construction: the fixed parameters.
    pub(super) fn same_fixed_parameters(&self, other: &Self, variables: &[Variable]) -> bool {
        variables.iter().enumerate().all(|(i, variable)| {
            variable.variability != Variability::Fixed
                || (self.set_by_host[i] == other.set_by_host[i] && self.values[i] == other.values[i])
        })
    }

    fn wrong_type<T>(vr: Vr, neutral: T) -> T {
        crate::invariant!(false, "the model asked for variable {vr} by a wrong type");
        neutral
    }
}
