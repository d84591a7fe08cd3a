//! The command line takes what people type: negative numbers, numbers that cannot be, typos, pipes that are closed.

use crate::command::{rfl, road, text};
use std::path::Path;
use std::process::{Command, Stdio};

fn said(arguments: &[&str]) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let told = rfl(folder.path(), arguments);
    (told.status.code(), text(&told.stderr))
}

#[test]
fn a_negative_number_is_a_value() {
    for arguments in [
        &["collect", "--runs", "-1"][..],
        &["tune", "--budget", "-3"],
        &["evaluate", "--seeds", "-2"],
        &["diagnose", "log.csv", "--rate", "-50"],
        &["train", "log.csv", "--lambda", "-1"],
    ] {
        let (status, error) = said(arguments);
        let [.., option, value] = arguments else { unreachable!() };
        let line = error.lines().find(|line| line.contains(&format!("'{value}'"))).unwrap_or_default();
        assert!(status == Some(2) && line.contains(option), "{arguments:?}: {error}");
    }
    // Where it has a meaning it is taken.
    assert_eq!(said(&["identify", "--step", "-0.02"]).0, Some(0));
}

#[test]
fn numbers_that_cannot_be_are_refused_with_their_range() {
    let road = road();
    for (arguments, words) in [
        (&["collect", "--runs", "0"][..], "0 is not in 1..=100000"),
        (&["collect", "--dither", "nan", "--runs", "1"], "[0, 0.1]"),
        (&["identify", "--step", "nan"], "a number other than 0"),
        (&["drive", "--path", &road, "--smooth", "-1"], "between 0 and 5 m"),
        (&["drive", "--path", &road, "--set", "vehicle.mass=-5"], "[100, 100000]"),
        (&["path", &road, "--smooth", "1e9"], "between 0 and 5 m"),
        (&["evaluate", "--budget", "0"], "must be positive"),
    ] {
        let (status, error) = said(arguments);
        assert!(matches!(status, Some(1 | 2)) && error.contains(words), "{arguments:?}: {error}");
    }
}

#[test]
fn typos_and_missing_files_are_named() {
    for (arguments, words) in [
        (&["drvie"][..], "'drive'"),
        (&["drive", "--pth", "x.csv"], "'--path'"),
        (&["course", "--route", "sudoku_tset"], "sudoku_test"),
        (&["path", "none.csv"], "none.csv"),
        (&["train", "none.csv"], "none.csv"),
        (&["identify", "none.csv"], "none.csv"),
        (&["diagnose", "none.csv", "--vehicle", "none.toml"], "none."),
        (&["drive", "--vehicle", "none.toml"], "none.toml"),
        (&["drive", "--residual", "none.rflm"], "none.rflm"),
        (&["drive", "--set", "variant=none"], "'rfl drive --variant none'"),
    ] {
        let (status, error) = said(arguments);
        assert!(matches!(status, Some(1 | 2)) && error.contains(words), "{arguments:?}: {error}");
    }
}

/// Neither end of a pipe that closes makes a program panic (status 101).
#[cfg(unix)]
#[test]
fn a_reader_that_leaves_ends_it_in_peace() {
    let folder = tempfile::tempdir().unwrap();
    let run = |script: &str| {
        let program = Path::new(env!("CARGO_BIN_EXE_rfl"));
        let script = format!("{} {script}; exit ${{PIPESTATUS[0]}}", program.display());
        let mut bash = Command::new("bash");
        bash.args(["-c", &script]).current_dir(folder.path()).stdout(Stdio::null()).stderr(Stdio::null());
        bash.status().unwrap().code()
    };
    for (script, expected) in [
        ("parameters | head -n 1", &[0][..]),
        ("course --route off_road --out - | true", &[0]),
        ("identify 2>&1 | true", &[0]),
        ("path none.csv 2>&1 | true", &[1]),
        ("parameters > /dev/full", &[1]),
    ] {
        let status = run(script);
        assert!(status.is_some_and(|status| expected.contains(&status)), "{script}: {status:?}");
    }
}

/// A shell completes every command.
#[test]
fn completions_name_every_command() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let told = rfl(folder.path(), &["completions", shell]);
        let script = text(&told.stdout);
        for command in ["drive", "diagnose", "completions"] {
            assert!(told.status.success() && script.contains(command), "{shell}: no {command}");
        }
        assert!(script.contains("require"), "{shell}: no option of a command");
    }
    assert_eq!(said(&["completions", "cmd"]).0, Some(2));
}
