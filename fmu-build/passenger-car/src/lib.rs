//! FMU library.
