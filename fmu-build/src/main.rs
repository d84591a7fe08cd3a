//! The program `fmu-build`; see `fmu-build --help`.

fn main() {}
