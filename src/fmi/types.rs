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

/// A host's pointer to an instance: `fmi2Component`, `fmi3Instance`.
pub type Component = *mut c_void;
/// Pointer that a host gets back with each message.
pub type ComponentEnvironment = *mut c_void;
/// `size_t`.
pub type Count = usize;
/// Place for a `size_t`.
pub type CountOut = *mut usize;
/// A C string.
pub type Text = *const c_char;
/// C strings.
pub type Texts = *const *const c_char;
/// Place for pointers to C strings.
pub type TextsOut = *mut *const c_char;
/// A `double`.
pub type Real = f64;
/// `double`s.
pub type Reals = *const f64;
/// Place for `double`s.
pub type RealsOut = *mut f64;
/// Value references.
pub type ValueReferences = *const c_uint;
/// A stored FMU state.
pub type FmuState = *mut c_void;
/// Place of a pointer to a stored FMU state.
pub type StateOut = *mut *mut c_void;
/// A serialised FMU state.
pub type Bytes = *const c_char;
/// Place for a serialised FMU state.
pub type BytesOut = *mut c_char;
