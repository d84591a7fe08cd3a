//! Bytes to lines of text: encodings, and how much is read.

use super::table_error::{LONGEST_LINE, TableError};
use crate::encoding::{Encoding, number};
use std::io::{BufRead, BufReader, Read};

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
        let first = reader.fill_buf().map_err(|error| cause(error, 1))?;
        let (encoding, mark) = Encoding::of(first);
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
                (&mut self.reader)
                    .take(most)
                    .read_until(self.end, &mut bytes)
                    .map_err(|error| cause(error, self.number))?;
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
            let Some(&next) = self.reader.fill_buf().map_err(|error| cause(error, self.number))?.first()
            else {
                return Ok(false);
            };
            *byte = next;
            self.reader.consume(1);
        }
        Ok(true)
    }

    fn decoded(&mut self, bytes: Vec<u8>) -> String {
        let (mut text, latin1) = self.encoding.decode(bytes);
        self.latin1 |= latin1;
        if !text.is_ascii() {
            text = plain_numbers(&text);
        }
        if text.ends_with(['\n', char::from(self.end)]) {
            text.pop();
        }
        text
    }
}

/// Text with an ASCII minus, and without the hard or thin blanks between the figures of a number.
fn plain_numbers(text: &str) -> String {
    let is_figure = |letter: Option<char>| letter.is_some_and(|letter| letter.is_ascii_digit());
    let mut plain = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '\u{2212}' => plain.push('-'),
            '\u{a0}' | '\u{2009}' | '\u{202f}'
                if is_figure(plain.chars().next_back()) && is_figure(letters.peek().copied()) => {}
            other => plain.push(other),
        }
    }
    plain
}

/// The limit that stopped an unpacking, its early end, or the operating system's error.
fn cause(error: std::io::Error, line: u64) -> TableError {
    match error.downcast::<TableError>() {
        Ok(error) => error,
        Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => TableError::CutOff { line },
        Err(source) => TableError::Broken { line, source },
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
