//! What a host reads and writes: each call is checked as a whole, and says what was wrong with which variable.
//!
//! What happens to a value that is no number or outside its range stands in `instance.rs`.

use super::{CallResult, Instance};
use crate::fmi::call_error::CallError;
use crate::fmi::instance_state::InstanceState;
use crate::fmi::logger::status_category;
use crate::fmi::model::{Array, Model};
use crate::fmi::types::Status;
use crate::fmi::value::Value;
use crate::fmi::variable::{Causality, Initial, Variability, Variable, VariableKind, Vr};
use crate::numerics::Readable;
use std::ffi::{CStr, CString, c_char};

impl<M: Model> Instance<M> {
    /// Gives values of reals to `write(position, value)`.
    pub fn get_real(&mut self, references: &[u32], mut write: impl FnMut(usize, f64)) -> CallResult {
        self.get(references, self.version.real, |i, value| {
            if let Value::Real(value) = value {
                write(i, *value);
            }
        })
    }

    /// Gives values of integers to `write(position, value)`, and of enumerations where the version has them as integers.
    pub fn get_integer(&mut self, references: &[u32], write: impl FnMut(usize, i32)) -> CallResult {
        self.get_whole(references, self.version.integer, write)
    }

    /// Gives values of enumerations to `write(position, value)`.
    pub fn get_enumeration(&mut self, references: &[u32], write: impl FnMut(usize, i32)) -> CallResult {
        self.get_whole(references, self.version.enumeration, write)
    }

    fn get_whole(
        &mut self,
        references: &[u32],
        expected: &'static str,
        mut write: impl FnMut(usize, i32),
    ) -> CallResult {
        self.get(references, expected, |i, value| {
            if let Value::Integer(value) = value {
                write(i, *value);
            }
        })
    }

    /// Gives values of booleans to `write(position, value)`.
    pub fn get_boolean(&mut self, references: &[u32], mut write: impl FnMut(usize, bool)) -> CallResult {
        self.get(references, "Boolean", |i, value| {
            if let Value::Boolean(value) = value {
                write(i, *value);
            }
        })
    }

    /// Gives strings to `write(position, pointer)`; the pointers are valid until the next call of this function.
    pub fn get_string(
        &mut self,
        references: &[u32],
        mut write: impl FnMut(usize, *const c_char),
    ) -> CallResult {
        let mut strings = Vec::with_capacity(references.len());
        let status = self.get(references, "String", |_, value| {
            if let Value::String(value) = value {
                strings.push(CString::new(value.replace('\0', "\u{fffd}")).unwrap_or_default());
            }
        })?;
        self.strings = strings;
        for (i, string) in self.strings.iter().enumerate() {
            write(i, string.as_ptr());
        }
        Ok(status)
    }

    /// Gives bytes to `write(position, bytes)`; they are valid until the variable is set, or the instance changes.
    pub fn get_binary(&mut self, references: &[u32], mut write: impl FnMut(usize, &[u8])) -> CallResult {
        self.get(references, "Binary", |i, value| {
            if let Value::Binary(value) = value {
                write(i, value);
            }
        })
    }

    fn get(
        &mut self,
        references: &[u32],
        expected: &'static str,
        mut write: impl FnMut(usize, &Value),
    ) -> CallResult {
        let mut unknown = false;
        for reference in references {
            let (_, variable) = self.variable(*reference, expected)?;
            unknown |= variable.causality != Causality::Independent
                && variable.initial == Initial::Calculated
                && (self.stale.parameters || (self.stale.inputs && !variable.depends_on.is_empty()));
        }
        let mut status = Status::Ok;
        if unknown && self.life == InstanceState::InitializationMode {
            status = self.initialize()?;
        }
        let mut position = 0;
        for reference in references {
            let scalar = [*reference as Vr];
            let elements = self.array(scalar[0]).map_or(&scalar[..], |array| &array.elements);
            for value in elements.iter().filter_map(|vr| self.values.get(*vr)) {
                write(position, value);
                position += 1;
            }
        }
        Ok(status)
    }

    /// Number of values of some variables: one of a scalar, those of its elements of an array.
    pub fn count_values(&self, references: &[u32]) -> Result<usize, CallError> {
        references.iter().try_fold(0, |count, reference| {
            let (vr, _) = self.any_variable(*reference)?;
            Ok(count + self.array(vr).map_or(1, |array| array.elements.len()))
        })
    }

    /// The array that a variable is an element of.
    fn array(&self, vr: Vr) -> Option<&Array> {
        self.array_of[vr].map(|place| &self.declaration.arrays[place])
    }

    /// Sets reals.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> CallResult {
        let mut status = Status::Ok;
        for (reference, value) in references.iter().zip(values) {
            let (vr, variable) = self.settable(*reference, self.version.real)?;
            if !value.is_finite() && variable.may_be_missing {
                self.missing(vr, *value);
                status = Status::Warning;
                continue;
            }
            if !value.is_finite() {
                let (name, kept) = (variable.name.to_string(), self.values.real(vr));
                return Err(CallError::NotFinite { name, value: *value, kept });
            }
            if let VariableKind::Real { min, max, .. } = variable.kind {
                let low = min.unwrap_or(f64::NEG_INFINITY);
                let high = max.unwrap_or(f64::INFINITY);
                if !(low..=high).contains(value) {
                    self.outside(vr, format_args!("{}", Readable(*value)), format_args!("[{low}, {high}]"))?;
                    status = Status::Warning;
                    continue;
                }
            }
            self.outside[vr] = false;
        }
        for (reference, value) in references.iter().zip(values) {
            self.write(*reference, Value::Real(*value));
        }
        Ok(status)
    }

    /// Sets integers, and enumerations where the version has them as integers.
    pub fn set_integer(&mut self, references: &[u32], values: &[i32]) -> CallResult {
        self.set_whole(references, self.version.integer, values.iter().copied().map(i64::from))
    }

    /// Sets enumerations.
    pub fn set_enumeration(&mut self, references: &[u32], values: &[i64]) -> CallResult {
        self.set_whole(references, self.version.enumeration, values.iter().copied())
    }

    fn set_whole(
        &mut self,
        references: &[u32],
        expected: &'static str,
        values: impl Iterator<Item = i64> + Clone,
    ) -> CallResult {
        let mut status = Status::Ok;
        for (reference, value) in references.iter().zip(values.clone()) {
            let (vr, variable) = self.settable(*reference, expected)?;
            match &variable.kind {
                VariableKind::Enumeration { items, .. }
                    if items.iter().all(|item| i64::from(item.0) != value) =>
                {
                    let allowed: Vec<String> =
                        items.iter().map(|(value, name, _)| format!("{value} ({name})")).collect();
                    return Err(CallError::NotAMember {
                        name: variable.name.to_string(),
                        value,
                        allowed: allowed.join(", "),
                        kept: self.values.integer(vr),
                    });
                }
                VariableKind::Integer { min, max, .. } => {
                    let (low, high) = (min.unwrap_or(i32::MIN), max.unwrap_or(i32::MAX));
                    if !(i64::from(low)..=i64::from(high)).contains(&value) {
                        self.outside(vr, format_args!("{value}"), format_args!("[{low}, {high}]"))?;
                        status = Status::Warning;
                        continue;
                    }
                    self.outside[vr] = false;
                }
                _ => {}
            }
        }
        for (reference, value) in references.iter().zip(values) {
            // An integer of the standard, or one of an enumeration's.
            self.write(*reference, Value::Integer(value as i32));
        }
        Ok(status)
    }

    /// Sets booleans.
    pub fn set_boolean(
        &mut self,
        references: &[u32],
        values: impl Iterator<Item = bool> + Clone,
    ) -> CallResult {
        for reference in references {
            self.settable(*reference, "Boolean")?;
        }
        for (reference, value) in references.iter().zip(values) {
            self.write(*reference, Value::Boolean(value));
        }
        Ok(Status::Ok)
    }

    /// Sets strings.
    pub fn set_string(&mut self, references: &[u32], values: &[&CStr]) -> CallResult {
        let mut strings = Vec::with_capacity(values.len());
        for (reference, value) in references.iter().zip(values) {
            let (_, variable) = self.settable(*reference, "String")?;
            let value = value.to_str().map_err(|_| CallError::NotUtf8 { name: variable.name.to_string() })?;
            strings.push(value.to_owned());
        }
        for (reference, value) in references.iter().zip(strings) {
            self.write(*reference, Value::String(value));
        }
        Ok(Status::Ok)
    }

    /// Sets bytes.
    pub fn set_binary(&mut self, references: &[u32], values: &[&[u8]]) -> CallResult {
        for (reference, value) in references.iter().zip(values) {
            let (_, variable) = self.settable(*reference, "Binary")?;
            if let VariableKind::Binary { max_size } = variable.kind
                && value.len() > max_size
            {
                let name = variable.name.to_string();
                return Err(CallError::TooManyBytes { name, given: value.len(), max_size });
            }
        }
        for (reference, value) in references.iter().zip(values) {
            self.write(*reference, Value::Binary(value.to_vec().into()));
        }
        Ok(Status::Ok)
    }

    /// A value outside its range: refuses a parameter, warns of an input once.
    fn outside(
        &mut self,
        vr: Vr,
        value: std::fmt::Arguments<'_>,
        range: std::fmt::Arguments<'_>,
    ) -> Result<(), CallError> {
        let variable = &self.declaration.variables[vr];
        if variable.causality != Causality::Input {
            let kept = self.values.get(vr).map(ToString::to_string).unwrap_or_default();
            let name = variable.name.to_string();
            return Err(CallError::OutOfRange {
                name,
                value: value.to_string(),
                range: range.to_string(),
                kept,
            });
        }
        if !std::mem::replace(&mut self.outside[vr], true) {
            let message = format!(
                "input `{}` = {value} is outside its range {range}; the model is given it all the same. Check units (SI, \
                 radians) and the connection. There is no further message until it is back inside.",
                variable.name
            );
            self.logger.tell(Status::Warning, status_category(Status::Warning), &message);
        }
        Ok(())
    }

    /// An input without a number, of which the model makes what it can: warns once.
    fn missing(&mut self, vr: Vr, value: f64) {
        if !std::mem::replace(&mut self.outside[vr], true) {
            let message = format!(
                "input `{}` = {value} is no number: it counts as missing. There is no further message until it is one.",
                self.declaration.variables[vr].name
            );
            self.logger.tell(Status::Warning, status_category(Status::Warning), &message);
        }
    }

    fn write(&mut self, reference: u32, value: Value) {
        let vr = reference as Vr;
        let variable = &self.declaration.variables[vr];
        match variable.causality {
            Causality::Input => self.stale.inputs = true,
            _ => self.stale.parameters = true,
        }
        self.wrote_start[vr] = value == variable.kind.start();
        self.values.set_by_host(vr, variable, value);
    }

    /// The variable behind a reference; of an array the first element.
    fn any_variable(&self, reference: u32) -> Result<(Vr, &Variable), CallError> {
        let variables = &self.declaration.variables;
        let vr = reference as Vr;
        let variable = variables
            .get(vr)
            .ok_or(CallError::UnknownReference { reference, last: variables.len().saturating_sub(1) })?;
        match self.array(vr) {
            Some(Array { name, elements, .. }) if elements[0] != vr => Err(CallError::ElementOfArray {
                name: variable.name.to_string(),
                array: name.to_string(),
                reference: elements[0],
            }),
            _ => Ok((vr, variable)),
        }
    }

    /// The same, if it is of the expected type.
    fn variable(&self, reference: u32, expected: &'static str) -> Result<(Vr, &Variable), CallError> {
        let (vr, variable) = self.any_variable(reference)?;
        let declared = self.version.type_of(&variable.kind);
        if declared != expected {
            return Err(CallError::WrongType { name: variable.name.to_string(), reference, declared });
        }
        Ok((vr, variable))
    }

    /// The variable behind a reference, if the host may set it now.
    fn settable(&self, reference: u32, expected: &'static str) -> Result<(Vr, &Variable), CallError> {
        let (vr, variable) = self.variable(reference, expected)?;
        let before = matches!(self.life, InstanceState::Instantiated | InstanceState::InitializationMode);
        match (variable.causality, variable.variability) {
            (Causality::Input, _) | (Causality::Parameter, Variability::Tunable) => Ok((vr, variable)),
            (Causality::Parameter, _) if before => Ok((vr, variable)),
            (Causality::Parameter, _) => {
                Err(CallError::Fixed { name: variable.name.to_string(), life: self.life })
            }
            _ if before && variable.initial == Initial::Exact => Ok((vr, variable)),
            _ => Err(CallError::NotSettable { name: variable.name.to_string() }),
        }
    }
}
