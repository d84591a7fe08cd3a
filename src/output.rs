//! Files that are written: whole or not at all.
//!
//! A file is written beside its place and renamed into it. So a reader never sees half of one, and a stopped program
//! leaves the old one. Special files are written through, not replaced: a link, a pipe, a device such as `/dev/stdout`.
//! Half-written files of a killed run (`.NAME.PROCESS.NUMBER.part`) are removed by the next run that writes to that
//! folder.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Tests that a file can be written: before the work, not after it. Nothing is left behind, no folder either.
///
/// # Errors
/// The fault; the caller names the file.
pub fn check_writable(file: &Path) -> io::Result<()> {
    if file.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a folder; name a file in it"));
    }
    if is_written_through(file) {
        // Opening a pipe would wait for its reader; a link's target may not be there yet.
        return Ok(());
    }
    // Where the folder is to be made, the one above it counts.
    let here = Path::new(".");
    let above =
        file.ancestors().skip(1).map(|folder| if folder.as_os_str().is_empty() { here } else { folder });
    let folder = above.into_iter().find(|folder| folder.exists()).unwrap_or(here);
    if !folder.is_dir() {
        let words = format!("{} is no folder", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotADirectory, words));
    }
    remove_abandoned(folder);
    let draft = folder.join(draft_of(file).file_name().unwrap_or_default());
    // A full disk takes a file, but nothing in it.
    with_draft(&draft, |to| {
        to.write_all(&[0; 4096])?;
        std::fs::remove_file(&draft)
    })
}

/// A folder that one run writes several files to. While it is held no other run gets it: their files would mix.
#[derive(Debug)]
#[must_use]
pub struct HeldFolder {
    /// The lock goes with the file, also when the program is killed.
    _lock: Option<File>,
}

/// Makes a folder, tests that files can be written there, and holds it.
///
/// # Errors
/// The fault; the caller names the folder.
pub fn hold_folder(folder: &Path) -> io::Result<HeldFolder> {
    if folder.exists() && !folder.is_dir() {
        return Err(io::Error::new(io::ErrorKind::NotADirectory, "is no folder; name one, or a new one"));
    }
    std::fs::create_dir_all(folder)?;
    check_writable(&folder.join("trial"))?;
    // Folders can be opened on Unix only, and not every file system knows locks: there runs are told apart by their user.
    let Ok(lock) = File::open(folder) else { return Ok(HeldFolder { _lock: None }) };
    match lock.try_lock() {
        Err(TryLockError::WouldBlock) => Err(io::Error::new(
            io::ErrorKind::WouldBlock,
            "another run writes to this folder; wait for it, or name another folder",
        )),
        held => Ok(HeldFolder { _lock: held.is_ok().then_some(lock) }),
    }
}

fn make_folder_of(file: &Path) -> io::Result<()> {
    match file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        Some(folder) => std::fs::create_dir_all(folder),
        None => Ok(()),
    }
}

/// Writes a file, and its folder, with the output of `fill`.
///
/// # Errors
/// The error of `fill`, or a fault of the file; the old file is then still there.
pub fn write_with<E: From<io::Error>>(
    file: &Path,
    fill: impl FnOnce(&mut File) -> Result<(), E>,
) -> Result<(), E> {
    if is_written_through(file) {
        return fill(&mut OpenOptions::new().write(true).create(true).truncate(true).open(file)?);
    }
    make_folder_of(file)?;
    let draft = draft_of(file);
    with_draft(&draft, |to| {
        fill(to)?;
        if let Ok(old) = std::fs::metadata(file) {
            to.set_permissions(old.permissions())?;
        }
        Ok(std::fs::rename(&draft, file)?)
    })
}

/// Writes bytes to a file.
///
/// # Errors
/// A fault of the file; the old file is then still there.
pub fn write_bytes(file: &Path, bytes: impl AsRef<[u8]>) -> io::Result<()> {
    write_with(file, |to| to.write_all(bytes.as_ref()))
}

/// True if a file is a link, a pipe or a device.
fn is_written_through(file: &Path) -> bool {
    std::fs::symlink_metadata(file).is_ok_and(|what| !what.is_file() || has_other_names(&what))
}

/// True if a file has a second name (a hard link).
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
    static DRAFTS: AtomicU32 = AtomicU32::new(0);
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    // Neither two programs nor two threads write the same draft.
    let number = DRAFTS.fetch_add(1, Ordering::Relaxed);
    file.with_file_name(format!(".{name}.{}.{number}.part", std::process::id()))
}

/// Makes a draft for `put`, which renames or removes it. It is held until then: one that is closed is taken away by
/// whoever else writes to this folder.
fn with_draft<E: From<io::Error>>(
    draft: &Path,
    put: impl FnOnce(&mut File) -> Result<(), E>,
) -> Result<(), E> {
    let mut held = create_draft(draft)?;
    let done = put(&mut held);
    if done.is_err() {
        // The draft is of no use to anybody; that it cannot be removed either says nothing new.
        let _ = std::fs::remove_file(draft);
    }
    done
}

/// A draft that no other run takes for abandoned: its lock goes when it is closed, also when the program is killed.
fn create_draft(draft: &Path) -> io::Result<File> {
    loop {
        let file = File::create(draft)?;
        // Not every file system knows locks: without them no draft is taken away.
        let locked = file.lock().is_ok();
        // Another run may have taken it away in between.
        if !locked || draft.exists() {
            return Ok(file);
        }
    }
}

/// Removes the drafts in a folder whose writers are gone.
fn remove_abandoned(folder: &Path) {
    let drafts = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    for draft in
        drafts.filter(|file| is_draft(file) && file.symlink_metadata().is_ok_and(|what| what.is_file()))
    {
        // What cannot be opened or removed belongs to somebody else, and harms nobody.
        if let Ok(file) = File::open(&draft)
            && file.try_lock().is_ok()
        {
            let _ = std::fs::remove_file(&draft);
        }
    }
}

/// True if a file has the name of a draft; see [`draft_of`].
fn is_draft(file: &Path) -> bool {
    let number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let name = file.file_name().and_then(std::ffi::OsStr::to_str).unwrap_or_default();
    let parts = name.strip_prefix('.').and_then(|name| name.strip_suffix(".part"));
    let mut parts = parts.unwrap_or_default().rsplitn(3, '.');
    let numbers = parts.next().is_some_and(number) && parts.next().is_some_and(number);
    numbers && parts.next().is_some_and(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(file: &Path, text: &str) -> io::Result<()> {
        write_bytes(file, text)
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
        let error = write_with(&file, |to| {
            write!(to, "half")?;
            Err(io::Error::other("no more"))
        });
        assert_eq!(error.unwrap_err().to_string(), "no more");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "old");
        assert_eq!(names(file.parent().unwrap()), ["drive.csv"]);
        assert!(check_writable(folder.path()).unwrap_err().to_string().contains("is a folder"));
        assert!(check_writable(&file.join("below.csv")).is_err());
    }

    #[test]
    fn drafts_that_nobody_writes_are_taken_away() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let others = [".log.csv.part", ".part", "log.csv.1.2.part", ".log.csv.1.x.part", ".1.2.part"];
        for name in [".log.csv.1.0.part", ".a.b.777.12.part"].iter().chain(&others) {
            std::fs::write(at(name), "half").unwrap();
        }
        let written = create_draft(&at(".model.rflm.1.3.part")).unwrap();
        check_writable(&at("another.csv")).unwrap();
        let mut left = others.map(str::to_owned).to_vec();
        left.push(".model.rflm.1.3.part".to_owned());
        left.sort();
        assert_eq!(names(folder.path()), left);
        drop(written);
        check_writable(&at("another.csv")).unwrap();
        assert!(!at(".model.rflm.1.3.part").exists());
    }

    #[test]
    fn a_draft_is_not_taken_away_before_it_is_renamed_or_removed() {
        let folder = tempfile::tempdir().unwrap();
        let draft = folder.path().join(".log.csv.1.0.part");
        for keep in [true, false] {
            with_draft(&draft, |to| {
                to.write_all(b"whole")?;
                // Another run comes to this folder.
                remove_abandoned(folder.path());
                if keep {
                    std::fs::rename(&draft, folder.path().join("log.csv"))
                } else {
                    std::fs::remove_file(&draft)
                }
            })
            .unwrap();
        }
        // What it does all the while: each trial of the folder is over before its draft is taken.
        let over = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    remove_abandoned(folder.path());
                }
            });
            let trials = || (0..20_000).try_for_each(|_| check_writable(&folder.path().join("log.csv")));
            let tried = trials();
            over.store(true, Ordering::Relaxed);
            tried.unwrap();
        });
        assert_eq!(names(folder.path()), ["log.csv"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_is_one_run_s_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let held = hold_folder(&out).unwrap();
        assert_eq!(hold_folder(&out).unwrap_err().kind(), io::ErrorKind::WouldBlock);
        drop(held);
        drop(hold_folder(&out).unwrap());
        assert!(names(&out).is_empty());
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
