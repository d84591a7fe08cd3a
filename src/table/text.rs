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

    /// Skips the empty lines that come next, and gives their number: a file may be full of them.
    pub fn skip_empty(&mut self) -> Result<u64, TableError> {
        let mut count = 0;
        while let Encoding::Bytes = self.encoding {
            let bytes = self.reader.fill_buf().map_err(|error| cause(error, self.number + 1))?;
            let empty = bytes.iter().take_while(|byte| matches!(byte, b'\n' | b'\r')).count();
            let Some(last) = bytes[..empty].iter().rposition(|byte| *byte == self.end) else { break };
            let lines = bytes[..=last].iter().filter(|byte| **byte == self.end).count() as u64;
            self.reader.consume(last + 1);
            (self.number, count) = (self.number + lines, count + lines);
            self.left = self
                .left
                .checked_sub(last as u64 + 1)
                .ok_or(TableError::TooLarge { limit: self.limit, unpacked: false })?;
        }
        Ok(count)
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

/// Errors that spreadsheets write in place of a value, in English, German, French, Italian and Spanish.
const SPREADSHEET_ERRORS: [&str; 20] = [
    "#n/a", "#value!", "#ref!", "#div/0!", "#name?", "#num!", "#null!", "#spill!", "#calc!", "#nv", "#wert!",
    "#bezug!", "#zahl!", "#n/d", "#valeur!", "#nom?", "#nombre!", "#nul!", "#valore!", "#nome?",
];

/// True if a field is the error of a spreadsheet.
pub(super) fn is_spreadsheet_error(field: &str) -> bool {
    SPREADSHEET_ERRORS.iter().any(|error| field.eq_ignore_ascii_case(error))
}

/// Text of a line of comment. A row whose first field is the error of a spreadsheet is none.
pub(super) fn comment(line: &str, delimiter: u8) -> Option<&str> {
    let line = line.trim_start();
    let text = line.strip_prefix(['#', '%'])?;
    let first = line.split(char::from(delimiter)).next().unwrap_or_default();
    (!is_spreadsheet_error(first.trim_end())).then_some(text)
}
