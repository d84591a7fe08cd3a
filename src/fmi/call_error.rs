//! Reasons for which a call was refused. Unless a variant says otherwise, a refused call has changed nothing.

use super::instance_state::InstanceState;
use super::seconds::Seconds;
use super::types::Status;
use super::version::Version;

/// One cause per variant. [`CallError::status`] gives what the host gets:
///
/// - discard: the function was used well, but this *value* (or step) cannot be taken; the value before it
///   stands, and the host may try another;
/// - error: the function was used wrongly, or the model failed.
#[derive(Debug)]
#[allow(missing_docs)]
pub enum CallError {
    OutOfOrder {
        function: &'static str,
        life: InstanceState,
    },
    Unsupported {
        function: &'static str,
        reason: &'static str,
    },
    NullPointer {
        argument: &'static str,
    },
    ImpossibleCount {
        argument: &'static str,
        count: usize,
    },
    ValueCount {
        references: usize,
        needed: usize,
        given: usize,
    },
    UnknownReference {
        reference: u32,
        last: usize,
    },
    ElementOfArray {
        name: String,
        array: String,
        reference: usize,
    },
    WrongType {
        name: String,
        reference: u32,
        declared: &'static str,
    },
    NotSettable {
        name: String,
    },
    Fixed {
        name: String,
        life: InstanceState,
    },
    NotFinite {
        name: String,
        value: f64,
        kept: f64,
    },
    OutOfRange {
        name: String,
        value: String,
        range: String,
        kept: String,
    },
    NotAMember {
        name: String,
        value: i64,
        allowed: String,
        kept: i32,
    },
    NotUtf8 {
        name: String,
    },
    TooManyBytes {
        name: String,
        given: usize,
        max_size: usize,
    },
    StartTime {
        start: f64,
    },
    StopTime {
        start: f64,
        stop: f64,
    },
    StepSize {
        step: f64,
    },
    CommunicationPoint {
        point: f64,
    },
    SteppedBack {
        point: f64,
        time: f64,
    },
    SteppedAhead {
        point: f64,
        time: f64,
    },
    PastStopTime {
        point: f64,
        end: f64,
        stop: f64,
    },

    /// The instance is then in state "step failed".
    StepDiscarded {
        time: f64,
        message: String,
    },

    /// The instance is then in state "error".
    StepFailed {
        time: f64,
        message: String,
    },

    /// When initialisation mode is left, the instance is in state "error"; after a get call nothing has changed.
    Initialization {
        message: String,
    },

    /// The instance is then in state "error".
    Panic {
        function: &'static str,
        message: String,
    },
    ForeignState,
    SmallBuffer {
        given: usize,
        needed: usize,
    },
    NotAState,
    StateVersion {
        found: u32,
        known: u32,
    },
    StateOfOtherFmu {
        found: String,
        own: String,
    },
    TruncatedState {
        given: usize,
        needed: usize,
    },
    DamagedState {
        what: &'static str,
    },
    StateContent {
        message: String,
    },
    Restore {
        message: String,
    },
    NoSuchStatus {
        kind: i32,
        reason: &'static str,
    },
    /// Another call of the instance is running.
    Busy,
}

impl CallError {
    /// The fault and its remedy, in the words of the host's version.
    #[must_use]
    pub fn message(&self, v: &Version) -> String {
        let Version { state, times, mark, .. } = v;
        match self {
            CallError::OutOfOrder { function, life } => format!(
                "{function} must not be called in state \"{life}\" ({}). {}",
                v.states,
                life.way_out(v)
            ),
            CallError::Unsupported { function, reason } => format!("{function} is not supported: {reason}"),
            CallError::NullPointer { argument } => format!(
                "the argument `{argument}` is a null pointer. Pass an array of as many elements as there are references."
            ),
            CallError::ImpossibleCount { argument, count } => {
                format!("the argument `{argument}` counts {count} elements, more than memory can hold")
            }
            CallError::ValueCount { references, needed, given } => format!(
                "there are {given} values for {references} references, which have {needed}: one value for each reference of \
                 a scalar, and as many as its Dimension says for an array's"
            ),
            CallError::UnknownReference { reference, last } => format!(
                "there is no variable with value reference {reference}: this FMU has the references 0 to {last}. Take \
         them from this FMU's modelDescription.xml."
            ),
            CallError::ElementOfArray { name, array, reference } => format!(
                "`{name}` is an element of the array `{array}`: get the array, by its reference {reference}"
            ),
            CallError::WrongType { name, reference, declared } => format!(
                "variable `{name}` (reference {reference}) is of type {declared}: use fmi{v}Get{declared} or fmi{v}Set{declared}"
            ),
            CallError::NotSettable { name } => format!(
                "variable `{name}` is an output, which the model calculates: it cannot be set. Set an input or a parameter."
            ),
            CallError::Fixed { name, life } => format!(
                "parameter `{name}` is fixed: it cannot be set in state \"{life}\". Set it before \
         fmi{v}ExitInitializationMode, or call fmi{v}Reset first."
            ),
            CallError::NotFinite { name, value, kept } => format!(
                "variable `{name}` was set to {value}, which is no finite number. The value before, {kept}, stands."
            ),
            CallError::OutOfRange { name, value, range, kept } => format!(
                "parameter `{name}` = {value} is outside its range {range}. The value before, {kept}, stands."
            ),
            CallError::NotAMember { name, value, allowed, kept } => format!(
                "variable `{name}` = {value} is none of its values: {allowed}. The value before, {kept}, stands."
            ),
            CallError::NotUtf8 { name } => {
                format!("the string for variable `{name}` is not UTF-8. The value before stands.")
            }
            CallError::TooManyBytes { name, given, max_size } => format!(
                "parameter `{name}` has {given} bytes, and takes {max_size} at most. The value before stands."
            ),
            CallError::StartTime { start } => format!("the start time {start} s is no finite number"),
            CallError::StopTime { start, stop } => {
                let (start, stop) = (Seconds(*start), Seconds(*stop));
                format!("the stop time {stop} is no finite number, or before the start time {start}")
            }
            CallError::StepSize { step } => format!(
                "a communication step of {step} s cannot be made: it must be finite and greater than zero"
            ),
            CallError::CommunicationPoint { point } => {
                format!("the communication point {point} s is no finite number")
            }
            CallError::SteppedBack { point, time } => {
                let (point, time) = (Seconds(*point), Seconds(*time));
                format!(
                    "the host steps from {point}, but the instance is already at {time}. To repeat a step, restore an FMU \
                     state that was stored at {point} (fmi{v}Set{state}) first."
                )
            }
            CallError::SteppedAhead { point, time } => {
                let (point, time) = (Seconds(*point), Seconds(*time));
                format!(
                    "the host steps from {point}, but the instance is still at {time}: the time between is missing. Step \
                     from {time}."
                )
            }
            CallError::PastStopTime { point, end, stop } => {
                let [point, end, stop] = [*point, *end, *stop].map(Seconds);
                format!("a step from {point} to {end} passes the stop time {stop} that {times} gave")
            }
            CallError::StepDiscarded { time, message } => {
                format!("the step from {} was discarded: {message}", Seconds(*time))
            }
            CallError::StepFailed { time, message } => {
                format!("the step from {} failed: {message}", Seconds(*time))
            }
            CallError::Initialization { message } => format!("the model cannot be initialised: {message}"),
            CallError::Panic { function, message } => format!(
                "internal error in {function}: {message}. Please report it. Call fmi{v}Reset to start again."
            ),
            CallError::ForeignState => format!(
                "this FMU state is not one of this instance. Before fmi{v}Get{state}, let the pointer be NULL or a state of \
         this instance; to carry a state to another instance, serialise it."
            ),
            CallError::SmallBuffer { given, needed } => format!(
                "the buffer of {given} bytes is too small for the FMU state of {needed}. Ask fmi{v}Serialized{state}Size."
            ),
            CallError::NotAState => {
                "these bytes are no serialised FMU state: they do not begin with its mark".to_owned()
            }
            CallError::StateVersion { found, known } => format!(
                "the serialised FMU state has format version {found}; this FMU reads version {known}. Store it anew."
            ),
            CallError::StateOfOtherFmu { found, own } => {
                format!("the serialised FMU state is of another FMU, with {mark} {found}; this one has {own}")
            }
            CallError::TruncatedState { given, needed } => {
                format!("the serialised FMU state is truncated: it has {given} bytes of {needed}")
            }
            CallError::DamagedState { what } => format!("the serialised FMU state is damaged: {what}"),
            CallError::StateContent { message } => {
                format!("the serialised FMU state holds what no run can have: {message}")
            }
            CallError::Restore { message } => format!("the FMU state cannot be restored: {message}"),
            CallError::Busy => {
                "another call of this instance is still running (on another thread, or this call came out of \
                              the logger). Make one call of an instance at a time."
                    .to_owned()
            }
            CallError::NoSuchStatus { kind, reason } => {
                format!("the status {kind} is not available: {reason}")
            }
        }
    }

    /// Status that the host gets.
    #[must_use]
    pub fn status(&self) -> Status {
        match self {
            CallError::NotFinite { .. }
            | CallError::OutOfRange { .. }
            | CallError::NotAMember { .. }
            | CallError::NotUtf8 { .. }
            | CallError::TooManyBytes { .. }
            | CallError::StepDiscarded { .. }
            | CallError::NoSuchStatus { .. } => Status::Discard,
            _ => Status::Error,
        }
    }
}
