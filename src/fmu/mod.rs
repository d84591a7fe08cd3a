//! (module fmu)
