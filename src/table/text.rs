//! Bytes to lines of text: encodings, and how much is read.

use super::table_error::{LONGEST_LINE, TableError};
use std::io::{BufRead, BufReader, Read};

/// Encoding of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    /// UTF-8, and Latin-1 in lines that are no UTF-8.
    Bytes,
    /// UTF-16, low or high byte first.
    Utf16 { low_first: bool },
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
        let (encoding, mark) = match first {
            [0xef, 0xbb, 0xbf, ..] => (Encoding::Bytes, 3),
            [0xff, 0xfe, ..] => (Encoding::Utf16 { low_first: true }, 2),
            [0xfe, 0xff, ..] => (Encoding::Utf16 { low_first: false }, 2),
            // Without a mark: a table begins with two letters of ASCII.
            [a, 0, b, 0, ..] if *a != 0 && *b != 0 => (Encoding::Utf16 { low_first: true }, 0),
            [0, a, 0, b, ..] if *a != 0 && *b != 0 => (Encoding::Utf16 { low_first: false }, 0),
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
            Encoding::Utf16 { low_first } => {
                let mut pair = [0; 2];
                while (bytes.len() as u64) < LONGEST_LINE && self.pair(&mut pair)? {
                    bytes.extend(pair);
                    if pair == if low_first { [b'\n', 0] } else { [0, b'\n'] } {
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

    /// Two bytes; an odd one at the end is dropped.
    fn pair(&mut self, pair: &mut [u8; 2]) -> Result<bool, TableError> {
        for byte in pair {
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
            Encoding::Utf16 { low_first } => {
                let units = bytes.chunks_exact(2).map(|pair| {
                    let pair = [pair[0], pair[1]];
                    if low_first { u16::from_le_bytes(pair) } else { u16::from_be_bytes(pair) }
                });
                char::decode_utf16(units)
                    .map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER))
                    .collect()
            }
        };
        if text.ends_with(['\n', char::from(self.end)]) {
            text.pop();
        }
        text
    }
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
