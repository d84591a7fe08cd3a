//! (module path)
