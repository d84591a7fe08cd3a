//! Files of others: ordinary ones, of a size that memory holds.
//!
//! A path in a vehicle file or in an FMU's parameter may name a file that harms the host. It may be a pipe whose next
//! byte never comes, `/dev/zero`, which never ends, or a file that fills the memory. All are refused before they are
//! read.

use crate::encoding::decode;
use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Largest text that describes something (vehicle, tyre, controller), in bytes.
pub const TEXT: u64 = 16 << 20;
/// Largest learned model, in bytes: hundreds of trees.
pub const MODEL: u64 = 64 << 20;

/// Reads a file of at most `limit` bytes.
///
/// # Errors
/// No ordinary file, too large, or not readable; the caller names the file.
pub fn read(file: &Path, limit: u64) -> Result<Vec<u8>> {
    ordinary(file)?;
    // What a system makes up as it is read says that it is empty: the bytes are counted as they come.
    let mut bytes = Vec::new();
    File::open(file)?.take(limit + 1).read_to_end(&mut bytes)?;
    within(bytes.len() as u64, limit)?;
    Ok(bytes)
}

/// Opens a file of at most `limit` bytes, to be read at any place.
///
/// # Errors
/// As [`read`].
pub fn open(file: &Path, limit: u64) -> Result<File> {
    within(ordinary(file)?.len(), limit)?;
    File::open(file)
}

fn ordinary(file: &Path) -> Result<Metadata> {
    let about = std::fs::metadata(file)?;
    if !about.is_file() {
        let words = format!("it is {}, and no file", kind(&about));
        return Err(Error::new(ErrorKind::InvalidInput, words));
    }
    Ok(about)
}

fn within(bytes: u64, limit: u64) -> Result<()> {
    if bytes > limit {
        let words = format!("it is larger than {} MB", limit >> 20);
        return Err(Error::new(ErrorKind::FileTooLarge, words));
    }
    Ok(())
}

/// Reads a text of at most [`TEXT`] bytes: UTF-8, UTF-16 or UTF-32.
///
/// # Errors
/// As [`read`]; another encoding.
pub fn read_text(file: &Path) -> Result<String> {
    decode(read(file, TEXT)?)
        .map_err(|_| Error::new(ErrorKind::InvalidData, "it is no text in UTF-8 or UTF-16"))
}

/// Line (from 1) and words of what is wrong with a TOML text, for people: without the parser's drawing of the place.
pub(crate) fn toml_error(text: &str, error: &toml::de::Error) -> (usize, String) {
    let start = error.span().map_or(0, |span| span.start);
    let line = text.bytes().take(start).filter(|byte| *byte == b'\n').count() + 1;
    let mut words = error.message().replace('\n', ", ");
    let digits = |pair: &[u8]| pair[0].is_ascii_digit() && pair[2].is_ascii_digit() && pair[1] == b',';
    let written = text.lines().nth(line - 1).unwrap_or_default();
    if !written.contains('[') && written.as_bytes().windows(3).any(digits) {
        words.push_str("; a number has a decimal point, no comma");
    }
    (line, words)
}

/// Kind of a file that is not an ordinary one.
#[cfg(unix)]
pub(crate) fn kind(about: &Metadata) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    let kind = about.file_type();
    match () {
        () if kind.is_dir() => "a folder",
        () if kind.is_fifo() => "a pipe (FIFO)",
        () if kind.is_socket() => "a socket",
        () if kind.is_char_device() || kind.is_block_device() => "a device",
        () => "something else",
    }
}

/// Kind of a file that is not an ordinary one.
#[cfg(not(unix))]
pub(crate) fn kind(about: &Metadata) -> &'static str {
    if about.is_dir() { "a folder" } else { "something else" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_never_ends_is_not_begun() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("some.toml");
        std::fs::write(&file, "1234").unwrap();
        assert_eq!(read(&file, 4).unwrap(), b"1234");
        assert_eq!(read(&file, 3).unwrap_err().to_string(), "it is larger than 0 MB");
        assert!(
            open(&file, 4).is_ok() && open(&file, 3).is_err() && open(Path::new("/dev/zero"), 9).is_err()
        );
        assert!(read(folder.path(), 9).unwrap_err().to_string().contains("a folder"));
        assert!(read(Path::new("/dev/zero"), 9).is_err());
        std::fs::write(&file, [0xff]).unwrap();
        assert!(read_text(&file).unwrap_err().to_string().contains("UTF-8"));
    }
}
