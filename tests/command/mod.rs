//! The program `rfl`, as a user calls it.
#![allow(dead_code)]

use std::path::Path;
use std::process::{Command, Output};

/// Calls it in a folder.
pub fn rfl(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rfl")).args(arguments).current_dir(folder).output().unwrap()
}

/// What it wrote.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// What a command printed that must succeed.
pub fn done(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    text(&output.stdout)
}

/// What a command said that must fail.
pub fn refused(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stdout));
    let error = text(&output.stderr);
    assert!(error.starts_with("error: "), "{error}");
    error
}

/// A short road with turns.
pub fn road() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("paths/sudoku_turns.csv").to_str().unwrap().to_owned()
}
