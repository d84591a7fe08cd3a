//! The C types that all versions of FMI share. Each has a name of one word, for the lists of functions in the macros that
//! export them. The widths are Rust's own and those of `std::ffi`: a crate of C types would add nothing.

use std::ffi::{c_char, c_uint, c_void};

/// `fmi2Status` and `fmi3Status`, which have the same numbers; only the former has `Pending`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Status {
    Ok,
    Warning,
    Discard,
    Error,
    Fatal,
    Pending,
}

/// What a host has of an instance: `fmi2Component`, `fmi3Instance`.
pub type Component = *mut c_void;
/// What a host gets back with each message.
pub type Environment = *mut c_void;
/// `size_t`.
pub type Count = usize;
/// Where a `size_t` goes.
pub type CountOut = *mut usize;
/// A C string.
pub type Text = *const c_char;
/// C strings.
pub type Texts = *const *const c_char;
/// Where pointers to C strings go.
pub type TextsOut = *mut *const c_char;
/// A `double`.
pub type Real = f64;
/// `double`s.
pub type Reals = *const f64;
/// Where `double`s go.
pub type RealsOut = *mut f64;
/// Value references.
pub type References = *const c_uint;
/// A stored FMU state.
pub type State = *mut c_void;
/// Where a pointer to a stored FMU state is and goes.
pub type StateOut = *mut *mut c_void;
/// A serialised FMU state.
pub type Bytes = *const c_char;
/// Where a serialised FMU state goes.
pub type BytesOut = *mut c_char;
