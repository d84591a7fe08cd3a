//! (module vehicle)
