//! Files that commands write (see [`crate::output`]), with errors that name them.

use crate::output::{self, HeldFolder};
use std::error::Error;
use std::fmt::Display;
use std::io::{BufWriter, Write};
use std::path::Path;

fn named(file: &Path, error: impl Display) -> Box<dyn Error> {
    format!("{}: {error}", file.display()).into()
}

/// Refuses `-`, which elsewhere is standard output.
fn check_name(file: &Path) -> Result<(), Box<dyn Error>> {
    if file.as_os_str() == "-" {
        return Err("-: standard output is for words here; name a file (./- is one with that name)".into());
    }
    Ok(())
}

/// Tries whether a file can be written: before the work, not after it.
///
/// # Errors
/// The file with its fault.
pub(super) fn check_writable(file: &Path) -> Result<(), Box<dyn Error>> {
    check_name(file)?;
    if is_pipe(file) {
        warn!("note: {}: is a pipe; the command waits there for a program that reads it", file.display());
    }
    output::check_writable(file).map_err(|error| named(file, error))
}

/// Makes a folder for several files, tries whether files can be written there, and holds it for this run.
///
/// # Errors
/// The folder with its fault.
pub(super) fn hold_folder(folder: &Path) -> Result<HeldFolder, Box<dyn Error>> {
    check_name(folder)?;
    output::hold_folder(folder).map_err(|error| named(folder, error))
}

/// Writes a file.
///
/// # Errors
/// The file with its fault; the old file is then still there.
pub(super) fn write_file(
    file: &Path,
    content: impl FnOnce(&mut dyn Write) -> Result<(), Box<dyn Error>>,
) -> Result<(), Box<dyn Error>> {
    let fill = |to: &mut std::fs::File| -> Result<(), Box<dyn Error>> {
        let mut writer = BufWriter::new(to);
        content(&mut writer)?;
        Ok(writer.flush()?)
    };
    output::write_with(file, fill).map_err(|error| named(file, error))
}

/// Writes a text.
///
/// # Errors
/// As [`write_file`].
pub(super) fn write_text(file: &Path, text: &str) -> Result<(), Box<dyn Error>> {
    output::write_bytes(file, text).map_err(|error| named(file, error))
}

/// Writes a value as JSON.
///
/// # Errors
/// As [`write_file`].
pub(super) fn write_json(file: &Path, value: &serde_json::Value) -> Result<(), Box<dyn Error>> {
    write_file(file, |writer| {
        serde_json::to_writer_pretty(&mut *writer, value)?;
        Ok(writeln!(writer)?)
    })
}

/// True if a file is a named pipe: whoever opens it waits for the other end.
#[cfg(unix)]
fn is_pipe(file: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    std::fs::symlink_metadata(file).is_ok_and(|about| about.file_type().is_fifo())
}

/// True if a file is a named pipe: whoever opens it waits for the other end.
#[cfg(not(unix))]
fn is_pipe(_: &Path) -> bool {
    false
}
