//! Files that may hold a table: refused before reading if they are none, unpacked if packed.

use super::table_error::{Limits, TableError};
use crate::input::kind;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

const UNPACK: &str = "unpack it, or pack it with gzip";
const IMPORT: &str = "save the table as CSV; scripts/import_log.py imports drive logs of this kind";

/// Formats of other programs: their first bytes, the kind, and what to do.
const FOREIGN: [(&[u8], &str, &str); 11] = [
    (b"PK\x03\x04", "a spreadsheet or a zip archive", "save the table as CSV"),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet", "save the table as CSV"),
    (b"BZh", "packed with bzip2", UNPACK),
    (b"\xfd7zXZ\x00", "packed with xz", UNPACK),
    (b"\x28\xb5\x2f\xfd", "packed with zstd", UNPACK),
    (b"7z\xbc\xaf\x27\x1c", "packed with 7-Zip", UNPACK),
    (b"MDF  ", "an MDF file", IMPORT),
    (b"PAR1", "a Parquet file", IMPORT),
    (b"MATLAB 5.0", "a MATLAB file", IMPORT),
    (b"\x89HDF", "an HDF5 or MATLAB file", IMPORT),
    (b"#ROSBAG", "a ROS bag", IMPORT),
];

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
    if let Some(&(_, kind, advice)) = FOREIGN.iter().find(|(mark, ..)| first.starts_with(mark)) {
        return Err(TableError::Foreign { kind, advice });
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
