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

mod access;
mod stored;

use super::call_error::CallError;
use super::instance_state::{Function, InstanceState};
use super::logger::{Logger, Messages, STANDARD_CATEGORIES, status_category};
use super::model::{Context, Declaration, Model, ModelError};
use super::seconds::Seconds;
use super::snapshot::Snapshot;
use super::start::StartError;
use super::types::Status;
use super::values::Values;
use super::variable::{Causality, Vr};
use super::version::Version;
use std::collections::BTreeMap;
use std::ffi::{CStr, CString};
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
}

/// Words of a panic.
fn panic_message(payload: &(dyn std::any::Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic without message".to_owned())
}
