//! One instance of a model: its state, its values, and what each call of the standard does to them.
//!
//! Everything here is safe code on Rust types; `handle.rs` and the versions' adapters translate from C. Decisions
//! where the standard leaves room:
//!
//! - *Values.* A set call is checked as a whole before anything is written. A real that is not finite, a parameter
//!   outside its range, an enumeration value that is none: discarded, the value before stands. An *input*
//!   outside its range (a range says what is certainly wrong, not what a vehicle can do) is taken, with one
//!   message until it is back inside. So is one that is not finite, where the model knows what to do without a number.
//! - *Warnings.* A call that did its work returns OK, and the log says what to look at: many hosts end a run at a
//!   warning. A model may have a parameter with which such a call returns a warning
//!   ([`Model::reports_warnings`]).
//! - *Choices.* Some hosts write every start value before they initialise. A value equal to the declared start is no
//!   choice of the user, so that what a parameter file says stands, and the log
//!   tells it. A start value with which the FMU was packed is one.
//! - *Initialisation.* The model is initialised when initialisation mode is left, or before, when the host asks for
//!   a value that the model calculates; it is initialised again if the host sets something after that.
//! - *Communication points.* The host's point counts, so that its rounding does not add up; it may differ from the
//!   instance's time by 1e-4 of the step. A step must be positive. A step past the stop time is an error, as the
//!   standard demands.
//! - *Discarded steps.* They lead to "step failed"; the model itself is as it was before the step. In FMI 2.0 a stored FMU
//!   state or a reset leads out of it, in 3.0 another step, too.
//! - *Time.* Where the version has it as a variable, it stands behind the model's own.
//! - `noSetFMUStatePriorToCurrentPoint` allows to flush buffers. There are none: older states stay restorable.

use super::call_error::CallError;
use super::instance_state::{Function, InstanceState};
use super::logger::{Logger, Messages, STANDARD_CATEGORIES, status_category};
use super::model::{Array, Context, Declaration, Model, ModelError};
use super::seconds::Seconds;
use super::snapshot::Snapshot;
use super::start::StartError;
use super::types::Status;
use super::value::Value;
use super::values::Values;
use super::variable::{Causality, Initial, Variability, Variable, VariableKind, Vr};
use super::version::Version;
use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Greatest distance of the host's communication point from the instance's time, in steps.
const POINT_TOLERANCE: f64 = 1e-4;

/// An instance of a model.
pub struct Instance<M: Model> {
    version: &'static Version,
    guid: &'static str,
    declaration: Declaration,
    context: Context,
    pub(super) logger: Logger,
    model: M,
    values: Values,
    life: InstanceState,
    start_time: f64,
    stop_time: Option<f64>,
    time: f64,
    /// True if the host lets a step end early.
    pub(super) may_end_early: bool,
    /// True if the newest step did.
    ended_early: bool,
    /// Time as a variable.
    time_variable: Option<Vr>,
    /// Per variable: the array, by its place in the declaration, of which it is an element; empty where a version has none.
    array_of: Vec<Option<usize>>,
    /// In initialisation mode: what the model does not know yet.
    stale: Stale,
    /// Per variable: an input outside its range, of which the host was warned.
    outside: Vec<bool>,
    /// Per variable: the host wrote its start value, which is no choice.
    wrote_start: Vec<bool>,
    /// Strings that the host got last; they live until it asks for strings again.
    strings: Vec<CString>,
    /// The host's FMU states by address. A handle is looked up here and never followed, so that a foreign one does
    /// no harm.
    snapshots: BTreeMap<usize, Box<Snapshot>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stale {
    parameters: bool,
    inputs: bool,
}

const ALL_STALE: Stale = Stale { parameters: true, inputs: true };
const NOTHING_STALE: Stale = Stale { parameters: false, inputs: false };

type CallResult = Result<Status, CallError>;

impl<M: Model> Instance<M> {
    /// A fresh instance.
    ///
    /// # Errors
    /// Start values in its resources that cannot be used.
    pub fn new(
        version: &'static Version,
        guid: &'static str,
        logger: Logger,
        context: Context,
    ) -> Result<Self, StartError> {
        let mut declaration = M::declaration();
        let time_variable = declaration.complete(version);
        if let Some(resources) = &context.resources {
            declaration.start_as_packed(resources)?;
        }
        let values = Values::starting_from(&declaration.variables);
        let mut array_of = vec![None; declaration.variables.len()];
        for (place, array) in declaration.arrays.iter().enumerate().filter(|_| version.has_arrays) {
            array.elements.iter().for_each(|vr| array_of[*vr] = Some(place));
        }
        Ok(Self {
            version,
            guid,
            context,
            logger,
            model: M::new(),
            values,
            life: InstanceState::Instantiated,
            start_time: 0.0,
            stop_time: None,
            time: 0.0,
            may_end_early: false,
            ended_early: false,
            time_variable,
            array_of,
            stale: ALL_STALE,
            outside: vec![false; declaration.variables.len()],
            wrote_start: vec![false; declaration.variables.len()],
            strings: Vec::new(),
            snapshots: BTreeMap::new(),
            declaration,
        })
    }

    /// Makes one call: checks that it is allowed now, stops panics, tells the host what was wrong.
    pub fn call(&mut self, function: impl Function, body: impl FnOnce(&mut Self) -> CallResult) -> Status {
        let outcome = if function.allowed_in(self.life) {
            // After a panic the instance is in state "error", out of which only fresh models lead: nothing that is
            // half done is used again.
            catch_unwind(AssertUnwindSafe(|| body(self))).unwrap_or_else(|payload| {
                self.life = InstanceState::Error;
                Err(CallError::Panic { function: function.name(), message: panic_message(&*payload) })
            })
        } else {
            Err(CallError::OutOfOrder { function: function.name(), life: self.life })
        };
        let status = outcome.unwrap_or_else(|refusal| {
            let status = refusal.status();
            let text = format!("{}: {}", function.name(), refusal.message(self.version));
            self.logger.tell(status, status_category(status), &text);
            status
        });
        match status {
            Status::Warning if !self.model.reports_warnings(&self.values) => Status::Ok,
            status => status,
        }
    }

    /// Switches debug logging; no category means all.
    pub fn set_debug_logging(&mut self, on: bool, categories: &[&CStr]) -> CallResult {
        if !on || categories.is_empty() {
            self.logger.enable(if on { vec!["logAll"] } else { Vec::new() });
            return Ok(Status::Ok);
        }
        let known: Vec<&'static str> = STANDARD_CATEGORIES
            .iter()
            .chain(self.declaration.log_categories)
            .map(|known| known.name)
            .collect();
        let mut enabled = Vec::new();
        let mut status = Status::Ok;
        for category in categories {
            match known.iter().find(|known| known.as_bytes() == category.to_bytes()) {
                Some(known) => enabled.push(*known),
                None => {
                    status = Status::Warning;
                    let message = format!(
                        "fmi{}SetDebugLogging: there is no log category \"{}\"; there are {}",
                        self.version,
                        category.to_string_lossy(),
                        known.join(", ")
                    );
                    self.logger.tell(status, status_category(status), &message);
                }
            }
        }
        self.logger.enable(enabled);
        Ok(status)
    }

    /// Start and stop time. The tolerance is not used: models integrate with fixed steps.
    pub fn setup_experiment(&mut self, start: f64, stop: Option<f64>) -> CallResult {
        if !start.is_finite() {
            return Err(CallError::StartTime { start });
        }
        if let Some(stop) = stop
            && !(stop.is_finite() && stop >= start)
        {
            return Err(CallError::StopTime { start, stop });
        }
        (self.start_time, self.stop_time) = (start, stop);
        self.set_time(start);
        Ok(Status::Ok)
    }

    /// Enters initialisation mode.
    pub fn enter_initialization_mode(&mut self) -> CallResult {
        self.life = InstanceState::InitializationMode;
        self.stale = ALL_STALE;
        Ok(Status::Ok)
    }

    /// Leaves initialisation mode.
    pub fn exit_initialization_mode(&mut self) -> CallResult {
        let status = if self.stale == NOTHING_STALE { Ok(Status::Ok) } else { self.initialize() };
        self.life = if status.is_ok() { InstanceState::StepComplete } else { InstanceState::Error };
        if status.is_ok() {
            self.logger.event(format_args!("initialised at {}", Seconds(self.start_time)));
        }
        status
    }

    /// Ends the simulation.
    pub fn terminate(&mut self) -> CallResult {
        self.life = InstanceState::Terminated;
        self.logger.event(format_args!("terminated at {}", Seconds(self.time)));
        Ok(Status::Ok)
    }

    /// As after instantiation. Stored FMU states stay valid.
    pub fn reset(&mut self) -> CallResult {
        self.model = M::new();
        self.values = Values::starting_from(&self.declaration.variables);
        (self.life, self.stale) = (InstanceState::Instantiated, ALL_STALE);
        (self.start_time, self.stop_time) = (0.0, None);
        self.set_time(0.0);
        self.outside.fill(false);
        self.wrote_start.fill(false);
        self.logger.event(format_args!("reset"));
        Ok(Status::Ok)
    }

    /// Initialises a fresh model with the host's values.
    fn initialize(&mut self) -> CallResult {
        self.model = M::new();
        self.stale = ALL_STALE;
        self.values.forget_calculated(&self.declaration.variables);
        self.set_time(self.time);
        let mut messages = Messages::to(&self.logger);
        self.model
            .initialize(&mut self.values, self.start_time, &self.context, &mut messages)
            .map_err(|error| CallError::Initialization { message: error.to_string() })?;
        let status = if messages.warned { Status::Warning } else { Status::Ok };
        self.stale = NOTHING_STALE;
        self.tell_overruled();
        Ok(status)
    }

    /// Tells which start values that the host wrote gave way to a file's.
    fn tell_overruled(&self) {
        const NAMED: usize = 5;
        let variables = self.declaration.variables.iter().enumerate();
        let mut named = variables.filter_map(|(vr, variable)| {
            let (start, value) = (variable.kind.start(), self.values.get(vr)?);
            let overruled =
                self.wrote_start[vr] && variable.causality == Causality::Parameter && *value != start;
            overruled.then(|| format!("{} = {value} (start {start})", variable.name))
        });
        let mut shown = named.by_ref().take(NAMED).collect::<Vec<_>>().join(", ");
        let more = named.count();
        if more > 0 {
            shown += &format!(" and {more} more");
        }
        if !shown.is_empty() {
            self.logger.event(format_args!(
                "values of a file count where the host wrote the start value, which is no choice: {shown}. To insist on a \
                 start value, set a number near it, or pack it (fmu-build --start)."
            ));
        }
    }

    /// Makes a step, or its first part where the host lets it end early.
    pub fn do_step(&mut self, point: f64, step: f64) -> CallResult {
        self.ended_early = false;
        if !point.is_finite() {
            return Err(CallError::CommunicationPoint { point });
        }
        let end = point + step;
        if !(step > 0.0 && end.is_finite()) {
            return Err(CallError::StepSize { step });
        }
        let rounding = 64.0 * f64::EPSILON * point.abs().max(self.time.abs());
        let tolerance = POINT_TOLERANCE * step + rounding;
        if point < self.time - tolerance {
            return Err(CallError::SteppedBack { point, time: self.time });
        }
        if point > self.time + tolerance {
            return Err(CallError::SteppedAhead { point, time: self.time });
        }
        if let Some(stop) = self.stop_time
            && end > stop + tolerance
        {
            return Err(CallError::PastStopTime { point, end, stop });
        }
        let mut messages = Messages::to(&self.logger);
        let made = match self.may_end_early {
            false => self.model.step(&mut self.values, point, step, &mut messages).map(|()| step),
            true => self.model.step_to_event(&mut self.values, point, step, &mut messages),
        };
        match made {
            Ok(made) => {
                let status = if messages.warned { Status::Warning } else { Status::Ok };
                self.life = InstanceState::StepComplete;
                self.ended_early = made < step;
                self.set_time(if self.ended_early { point + made } else { end });
                Ok(status)
            }
            Err(ModelError::Discard(message)) => {
                self.life = InstanceState::StepFailed;
                Err(CallError::StepDiscarded { time: self.time, message })
            }
            Err(ModelError::Failed(message)) => {
                self.life = InstanceState::Error;
                Err(CallError::StepFailed { time: self.time, message })
            }
        }
    }

    fn set_time(&mut self, time: f64) {
        self.time = time;
        if let Some(vr) = self.time_variable {
            self.values.set_real(vr, time);
        }
    }

    /// The last time up to which all went well, in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// True if the newest step ended early, at [`time`](Self::time).
    #[must_use]
    pub fn ended_early(&self) -> bool {
        self.ended_early
    }

    /// The instance's state.
    #[must_use]
    pub fn life(&self) -> InstanceState {
        self.life
    }

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
                    self.outside(vr, format_args!("{value}"), format_args!("[{low}, {high}]"))?;
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
                "input `{}` = {value} is outside its range {range}; it is used all the same. Check units (SI, \
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

    /// A new state, or the one that `handle` names is written over.
    pub fn store(&mut self, handle: *mut c_void) -> Result<*mut c_void, CallError> {
        if !handle.is_null() && !self.snapshots.contains_key(&handle.addr()) {
            return Err(CallError::ForeignState);
        }
        let model = self.life.has_working_model().then(|| {
            let mut bytes = Vec::new();
            self.model.save(&mut bytes);
            bytes
        });
        let snapshot = Snapshot {
            life: self.life,
            start_time: self.start_time,
            stop_time: self.stop_time,
            time: self.time,
            values: self.values.clone(),
            model,
        };
        match self.snapshots.get_mut(&handle.addr()) {
            Some(place) => {
                **place = snapshot;
                Ok(handle)
            }
            None => Ok(self.keep(snapshot)),
        }
    }

    /// Keeps a state and gives its handle.
    fn keep(&mut self, snapshot: Snapshot) -> *mut c_void {
        let mut snapshot = Box::new(snapshot);
        let handle: *mut Snapshot = &mut *snapshot;
        self.snapshots.insert(handle.addr(), snapshot);
        handle.cast()
    }

    /// Forgets a state.
    pub fn free_state(&mut self, handle: *mut c_void) -> CallResult {
        match self.snapshots.remove(&handle.addr()) {
            None if !handle.is_null() => Err(CallError::ForeignState),
            _ => Ok(Status::Ok),
        }
    }

    /// A state's bytes.
    pub fn serialize(&self, handle: *mut c_void) -> Result<Vec<u8>, CallError> {
        let snapshot = self.snapshots.get(&handle.addr()).ok_or(CallError::ForeignState)?;
        Ok(snapshot.to_bytes(self.guid))
    }

    /// A state from bytes.
    pub fn deserialize(&mut self, bytes: &[u8]) -> Result<*mut c_void, CallError> {
        let snapshot = Snapshot::from_bytes(bytes, self.guid, &self.declaration.variables)?;
        if let Some(state) = &snapshot.model {
            M::check(state).map_err(|error| CallError::StateContent { message: error.to_string() })?;
        }
        Ok(self.keep(snapshot))
    }

    /// Takes over a state. A model of other parameters is made anew from those of the state; if that fails, the
    /// instance is as it was.
    pub fn restore(&mut self, handle: *mut c_void) -> CallResult {
        let snapshot = self.snapshots.get(&handle.addr()).ok_or(CallError::ForeignState)?;
        let refused = |error: ModelError| CallError::Restore { message: error.to_string() };
        let variables = &self.declaration.variables;
        match &snapshot.model {
            None => self.model = M::new(),
            Some(bytes) => {
                let alive = self.life.has_working_model()
                    && self.start_time == snapshot.start_time
                    && self.values.same_fixed_parameters(&snapshot.values, variables);
                if alive {
                    self.model.restore(bytes).map_err(refused)?;
                } else {
                    let mut values = snapshot.values.clone();
                    values.forget_calculated(variables);
                    let mut model = M::new();
                    let mut messages = Messages::to(&self.logger);
                    model
                        .initialize(&mut values, snapshot.start_time, &self.context, &mut messages)
                        .map_err(refused)?;
                    model.restore(bytes).map_err(refused)?;
                    self.model = model;
                }
            }
        }
        self.values.clone_from(&snapshot.values);
        (self.life, self.stale) = (snapshot.life, ALL_STALE);
        (self.start_time, self.stop_time) = (snapshot.start_time, snapshot.stop_time);
        let time = snapshot.time;
        self.set_time(time);
        self.outside.fill(false);
        self.wrote_start.fill(false);
        Ok(Status::Ok)
    }
}

/// Words of a panic.
fn panic_message(payload: &(dyn std::any::Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic without message".to_owned())
}
