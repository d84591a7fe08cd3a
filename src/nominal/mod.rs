//! (module nominal)
