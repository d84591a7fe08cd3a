//! Why a call was refused. Unless a variant says otherwise, a refused call has changed nothing.

use super::abi::Status;
use super::life::Life;

/// One cause per variant. [`Refusal::status`] gives what the host gets:
///
/// - `fmi2Discard`: the function was used well, but this *value* (or step) cannot be taken; the value before it
///   stands, and the host may try another;
/// - `fmi2Error`: the function was used wrongly, or the model failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum Refusal {
    #[error("{function} must not be called in state \"{life}\" (FMI 2.0, section 4.2.4). {}", life.way_out())]
    OutOfOrder { function: &'static str, life: Life },
    #[error("{function} is not supported: {reason}")]
    Unsupported { function: &'static str, reason: &'static str },
    #[error(
        "the argument `{argument}` is a null pointer. Pass an array of as many elements as there are references."
    )]
    NullPointer { argument: &'static str },
    #[error("the argument `{argument}` counts {count} elements, more than memory can hold")]
    ImpossibleCount { argument: &'static str, count: usize },

    #[error(
        "there is no variable with value reference {reference}: this FMU has the references 0 to {last}. Take \
         them from this FMU's modelDescription.xml."
    )]
    UnknownReference { reference: u32, last: usize },
    #[error(
        "variable `{name}` (reference {reference}) is of type {declared}: use fmi2Get{declared} or fmi2Set{declared}"
    )]
    WrongType { name: String, reference: u32, declared: &'static str },
    #[error(
        "variable `{name}` is an output, which the model calculates: it cannot be set. Set an input or a parameter."
    )]
    NotSettable { name: String },
    #[error(
        "parameter `{name}` is fixed: it cannot be set in state \"{life}\". Set it before \
         fmi2ExitInitializationMode, or call fmi2Reset first."
    )]
    Fixed { name: String, life: Life },

    #[error(
        "variable `{name}` was set to {value}, which is no finite number. The value before, {kept}, stands."
    )]
    NotFinite { name: String, value: f64, kept: f64 },
    #[error("parameter `{name}` = {value} is outside its range {range}. The value before, {kept}, stands.")]
    OutOfRange { name: String, value: String, range: String, kept: String },
    #[error(
        "variable `{name}` = {value} is none of its values: {allowed}. The value before, {kept}, stands."
    )]
    NotAMember { name: String, value: i32, allowed: String, kept: i32 },
    #[error("the string for variable `{name}` is not UTF-8. The value before stands.")]
    NotUtf8 { name: String },

    #[error("the start time {start} s is no finite number")]
    StartTime { start: f64 },
    #[error("the stop time {stop} s is no finite number, or before the start time {start} s")]
    StopTime { start: f64, stop: f64 },

    #[error("a communication step of {step} s cannot be made: it must be finite and greater than zero")]
    StepSize { step: f64 },
    #[error("the communication point {point} s is no finite number")]
    CommunicationPoint { point: f64 },
    #[error(
        "the host steps from {point} s, but the instance is already at {time} s. To repeat a step, restore an FMU \
         state that was stored at {point} s (fmi2SetFMUstate) first."
    )]
    SteppedBack { point: f64, time: f64 },
    #[error(
        "the host steps from {point} s, but the instance is still at {time} s: the time between is missing. Step \
         from {time} s."
    )]
    SteppedAhead { point: f64, time: f64 },
    #[error("a step from {point} s to {end} s passes the stop time {stop} s that fmi2SetupExperiment gave")]
    PastStopTime { point: f64, end: f64, stop: f64 },

    /// The instance is then in state "step failed".
    #[error("the step from {time} s was discarded: {message}")]
    StepDiscarded { time: f64, message: String },
    /// The instance is then in state "error".
    #[error("the step from {time} s failed: {message}")]
    StepFailed { time: f64, message: String },
    /// After `fmi2ExitInitializationMode` the instance is in state "error"; after a get call nothing has changed.
    #[error("the model cannot be initialised: {message}")]
    Initialization { message: String },
    /// The instance is then in state "error".
    #[error("internal error in {function}: {message}. Please report it. Call fmi2Reset to start again.")]
    Panic { function: &'static str, message: String },

    #[error(
        "this FMU state is not one of this instance. Before fmi2GetFMUstate, let the pointer be NULL or a state of \
         this instance; to carry a state to another instance, serialise it."
    )]
    ForeignState,
    #[error(
        "the buffer of {given} bytes is too small for the FMU state of {needed}. Ask fmi2SerializedFMUstateSize."
    )]
    SmallBuffer { given: usize, needed: usize },
    #[error("these bytes are no serialised FMU state: they do not begin with its mark")]
    NotAState,
    #[error(
        "the serialised FMU state has format version {found}; this FMU reads version {known}. Store it anew."
    )]
    StateVersion { found: u32, known: u32 },
    #[error("the serialised FMU state is of another FMU, with GUID {found}; this one has {own}")]
    StateOfOtherFmu { found: String, own: String },
    #[error("the serialised FMU state is truncated: it has {given} bytes of {needed}")]
    TruncatedState { given: usize, needed: usize },
    #[error("the serialised FMU state is damaged: {what}")]
    DamagedState { what: &'static str },
    #[error("the serialised FMU state holds what no run can have: {message}")]
    StateContent { message: String },
    #[error("the FMU state cannot be restored: {message}")]
    Restore { message: String },

    #[error("the status {kind} is not available: {reason}")]
    NoSuchStatus { kind: i32, reason: &'static str },
}

impl Refusal {
    /// What the host gets.
    #[must_use]
    pub fn status(&self) -> Status {
        match self {
            Refusal::NotFinite { .. }
            | Refusal::OutOfRange { .. }
            | Refusal::NotAMember { .. }
            | Refusal::NotUtf8 { .. }
            | Refusal::StepDiscarded { .. }
            | Refusal::NoSuchStatus { .. } => Status::Discard,
            _ => Status::Error,
        }
    }
}
