//! Files that commands write: whole or not at all.
//!
//! A file is written beside its place and renamed into it, so that whoever reads it never sees half of one, and a
//! command that is stopped leaves the old one. What is no ordinary file is written through, not replaced: a link, a
//! pipe, a device such as `/dev/stdout`.

use std::error::Error;
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Makes the folder of a file, and tries whether the file can be written: before the work, not after it.
///
/// # Errors
/// The file with what is wrong.
pub(super) fn check_writable(file: &Path) -> Result<(), Box<dyn Error>> {
    let failed = |error: std::io::Error| -> Box<dyn Error> { format!("{}: {error}", file.display()).into() };
    if file.is_dir() {
        return Err(format!("{}: is a folder; name a file in it", file.display()).into());
    }
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    if is_written_through(file) {
        // Opening a pipe would wait for its reader; a link's target may not be there yet.
        return Ok(());
    }
    let draft = draft_of(file);
    File::create(&draft).and_then(|_| std::fs::remove_file(&draft)).map_err(failed)
}

/// Writes a file.
///
/// # Errors
/// The file with what is wrong; the old file is then still there.
pub(super) fn write_file(
    file: &Path,
    content: impl FnOnce(&mut dyn Write) -> Result<(), Box<dyn Error>>,
) -> Result<(), Box<dyn Error>> {
    let named =
        |error: &dyn std::fmt::Display| -> Box<dyn Error> { format!("{}: {error}", file.display()).into() };
    let fill = |to: File| -> Result<(), Box<dyn Error>> {
        let mut writer = BufWriter::new(to);
        content(&mut writer)?;
        Ok(writer.flush()?)
    };
    if is_written_through(file) {
        let opened = OpenOptions::new().write(true).create(true).truncate(true).open(file);
        return fill(opened.map_err(|error| named(&error))?).map_err(|error| named(&error));
    }
    let draft = draft_of(file);
    let written = File::create(&draft).map_err(Into::into).and_then(fill);
    let placed = written.and_then(|()| {
        if let Ok(old) = std::fs::metadata(file) {
            std::fs::set_permissions(&draft, old.permissions())?;
        }
        Ok(std::fs::rename(&draft, file)?)
    });
    placed.map_err(|error| {
        // The draft is of no use to anybody; that it cannot be removed either says nothing new.
        let _ = std::fs::remove_file(&draft);
        named(&error)
    })
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

/// Whether a file is a link, a pipe or a device.
fn is_written_through(file: &Path) -> bool {
    std::fs::symlink_metadata(file).is_ok_and(|what| !what.is_file() || has_other_names(&what))
}

/// Whether a file has a second name (a hard link).
#[cfg(unix)]
fn has_other_names(what: &std::fs::Metadata) -> bool {
    std::os::unix::fs::MetadataExt::nlink(what) > 1
}

#[cfg(not(unix))]
fn has_other_names(_: &std::fs::Metadata) -> bool {
    false
}

/// The place beside a file where it is written first.
fn draft_of(file: &Path) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!(".{name}.{}.part", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(file: &Path, text: &str) -> Result<(), Box<dyn Error>> {
        write_file(file, |writer| Ok(write!(writer, "{text}")?))
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_write_that_fails_leaves_the_old_file_and_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("deep/drive.csv");
        check_writable(&file).unwrap();
        write(&file, "old").unwrap();
        let error = write_file(&file, |writer| {
            write!(writer, "half")?;
            Err("no more".into())
        });
        assert!(error.unwrap_err().to_string().contains("drive.csv: no more"));
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "old");
        assert_eq!(names(file.parent().unwrap()), ["drive.csv"]);
        assert!(check_writable(folder.path()).unwrap_err().to_string().contains("is a folder"));
        assert!(check_writable(&file.join("below.csv")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let [target, soft, hard] = ["target", "soft", "hard"].map(|name| folder.path().join(name));
        std::fs::write(&target, "a long old text").unwrap();
        std::os::unix::fs::symlink(&target, &soft).unwrap();
        std::fs::hard_link(&target, &hard).unwrap();
        for (file, text) in [(&soft, "one"), (&hard, "two"), (&target, "three")] {
            check_writable(file).unwrap();
            write(file, text).unwrap();
            for name in [&target, &soft, &hard] {
                assert_eq!(std::fs::read_to_string(name).unwrap(), text);
            }
        }
        assert!(soft.is_symlink());
        assert_eq!(names(folder.path()), ["hard", "soft", "target"]);
        write(Path::new("/dev/null"), "into the void").unwrap();
    }
}
