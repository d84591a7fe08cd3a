//! Bytes to lines of text: encodings, and how much is read.

use super::table_error::{LONGEST_LINE, TableError};
use std::io::{BufRead, BufReader, Read};

/// Encoding of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    /// UTF-8, and Latin-1 in lines that are no UTF-8.
    Bytes,
    /// UTF-16 or UTF-32: bytes of a unit, low or high byte first.
    Wide { width: usize, low_first: bool },
}

/// The lines of a file, decoded.
pub(super) struct Lines<R: Read> {
    reader: BufReader<R>,
    encoding: Encoding,
    /// The end of a line of bytes.
    end: u8,
    /// Bytes that may still come, and the limit.
    left: u64,
    limit: u64,
    number: u64,
    /// True if a line was read as Latin-1.
    pub latin1: bool,
}

impl<R: Read> Lines<R> {
    pub fn new(reader: R, limit: u64) -> Result<Self, TableError> {
        let mut reader = BufReader::with_capacity(1 << 16, reader);
        let first = reader.fill_buf().map_err(cause)?;
        let wide = |width, low_first| Encoding::Wide { width, low_first };
        let (encoding, mark) = match first {
            [0xef, 0xbb, 0xbf, ..] => (Encoding::Bytes, 3),
            // The mark of UTF-32 begins like that of UTF-16.
            [0xff, 0xfe, 0, 0, ..] => (wide(4, true), 4),
            [0, 0, 0xfe, 0xff, ..] => (wide(4, false), 4),
            [0xff, 0xfe, ..] => (wide(2, true), 2),
            [0xfe, 0xff, ..] => (wide(2, false), 2),
            // Without a mark: a table begins with two letters of ASCII.
            [a, 0, 0, 0, b, 0, 0, 0, ..] if *a != 0 && *b != 0 => (wide(4, true), 0),
            [0, 0, 0, a, 0, 0, 0, b, ..] if *a != 0 && *b != 0 => (wide(4, false), 0),
            [a, 0, b, 0, ..] if *a != 0 && *b != 0 => (wide(2, true), 0),
            [0, a, 0, b, ..] if *a != 0 && *b != 0 => (wide(2, false), 0),
            _ => (Encoding::Bytes, 0),
        };
        // As programs wrote them on a Mac once, and some devices do.
        let end = if first.contains(&b'\r') && !first.contains(&b'\n') { b'\r' } else { b'\n' };
        reader.consume(mark);
        Ok(Self { reader, encoding, end, left: limit, limit, number: 0, latin1: false })
    }

    /// The next line without its end; `None` after the last one.
    pub fn next_line(&mut self) -> Result<Option<String>, TableError> {
        self.number += 1;
        let mut bytes = Vec::new();
        match self.encoding {
            Encoding::Bytes => {
                let most = LONGEST_LINE.min(self.left.saturating_add(1));
                (&mut self.reader).take(most).read_until(self.end, &mut bytes).map_err(cause)?;
            }
            Encoding::Wide { width, low_first } => {
                let mut unit = [0; 4];
                let unit = &mut unit[..width];
                while (bytes.len() as u64) < LONGEST_LINE && self.unit(unit)? {
                    bytes.extend_from_slice(unit);
                    if number(unit, low_first) == u32::from(b'\n') {
                        break;
                    }
                }
            }
        }
        let Some(left) = self.left.checked_sub(bytes.len() as u64) else {
            return Err(TableError::TooLarge { limit: self.limit, unpacked: false });
        };
        self.left = left;
        if bytes.len() as u64 >= LONGEST_LINE {
            return Err(TableError::LongLine { line: self.number });
        }
        Ok((!bytes.is_empty()).then(|| self.decoded(bytes)))
    }

    /// The bytes of a unit; those of half a one at the end are dropped.
    fn unit(&mut self, unit: &mut [u8]) -> Result<bool, TableError> {
        for byte in unit {
            let Some(&next) = self.reader.fill_buf().map_err(cause)?.first() else { return Ok(false) };
            *byte = next;
            self.reader.consume(1);
        }
        Ok(true)
    }

    fn decoded(&mut self, bytes: Vec<u8>) -> String {
        let mut text = match self.encoding {
            Encoding::Bytes => String::from_utf8(bytes).unwrap_or_else(|error| {
                self.latin1 = true;
                error.as_bytes().iter().map(|&byte| char::from(byte)).collect()
            }),
            Encoding::Wide { width, low_first } => {
                let units = bytes.chunks_exact(width).map(|unit| number(unit, low_first));
                let known = |letter: Option<char>| letter.unwrap_or(char::REPLACEMENT_CHARACTER);
                if width == 2 {
                    char::decode_utf16(units.map(|unit| unit as u16))
                        .map(|letter| known(letter.ok()))
                        .collect()
                } else {
                    units.map(|unit| known(char::from_u32(unit))).collect()
                }
            }
        };
        if text.ends_with(['\n', char::from(self.end)]) {
            text.pop();
        }
        text
    }
}

/// The number that a unit's bytes are.
fn number(unit: &[u8], low_first: bool) -> u32 {
    let append = |sum: u32, byte: &u8| (sum << 8) | u32::from(*byte);
    if low_first { unit.iter().rev().fold(0, append) } else { unit.iter().fold(0, append) }
}

/// The limit that stopped an unpacking, or the operating system's error.
fn cause(error: std::io::Error) -> TableError {
    match error.downcast::<TableError>() {
        Ok(error) => error,
        Err(error) => TableError::Broken(error),
    }
}

/// A line without blanks at its ends; with `tab`, tabs there are delimiters.
pub(super) fn trim(line: &str, tab: bool) -> &str {
    if tab { line.trim_matches([' ', '\r', '\n']) } else { line.trim_ascii() }
}

/// Text of a line of comment.
pub(super) fn comment(line: &str) -> Option<&str> {
    line.trim_start().strip_prefix(['#', '%'])
}
