//! The program `rfl`; see `rfl --help`.

fn main() {}
