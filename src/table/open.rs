//! Files that may hold a table: refused before reading if they are none, unpacked if packed.

use super::table_error::{Limits, TableError};
use crate::input::kind;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Opens a file for [`Table`](super::Table), unpacked. Folders, pipes and devices are refused unread: the next byte of a
/// pipe may never come, and `/dev/zero` never ends.
///
/// # Errors
/// No regular file, too large, packed in a way that this build does not read, or not readable.
pub fn open(file: &Path, limits: Limits) -> Result<Box<dyn Read>, TableError> {
    let about = std::fs::metadata(file)?;
    if !about.is_file() {
        return Err(TableError::NotAFile { kind: kind(&about) });
    }
    if about.len() > limits.bytes {
        return Err(TableError::TooLarge { limit: limits.bytes, unpacked: false });
    }
    let mut reader = BufReader::new(File::open(file)?);
    let first = reader.fill_buf()?;
    if first.starts_with(b"PK\x03\x04") {
        return Err(TableError::Archive);
    }
    let named = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    if named || first.starts_with(b"\x1f\x8b") { unpacked(reader, limits) } else { Ok(Box::new(reader)) }
}

#[cfg(feature = "cli")]
fn unpacked(reader: BufReader<File>, limits: Limits) -> Result<Box<dyn Read>, TableError> {
    Ok(Box::new(Unpacked {
        reader: flate2::bufread::MultiGzDecoder::new(reader),
        left: limits.bytes,
        limit: limits.bytes,
    }))
}

#[cfg(not(feature = "cli"))]
fn unpacked(_: BufReader<File>, _: Limits) -> Result<Box<dyn Read>, TableError> {
    Err(TableError::Compressed)
}

/// Unpacked bytes, and the rest of their limit.
#[cfg(feature = "cli")]
struct Unpacked<R> {
    reader: R,
    left: u64,
    limit: u64,
}

#[cfg(feature = "cli")]
impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.reader.read(buffer)?;
        let Some(left) = self.left.checked_sub(count as u64) else {
            let error = TableError::TooLarge { limit: self.limit, unpacked: true };
            return Err(std::io::Error::other(error));
        };
        self.left = left;
        Ok(count)
    }
}
