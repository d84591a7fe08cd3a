//! Tables from text files: one reader for drive logs and roads.
//!
//! A table is a names row and rows of values. People's files write it in many ways, and state none of them:
//!
//! | a file may have | detection |
//! |---|---|
//! | commas, semicolons, tabs, bars or blanks | the delimiter by which most fields of the head are numbers; a line `sep=;` decides |
//! | thousands apart (`"1,234.5"`, `1.234,5`, `1 234,5` with a hard blank, `1'234`), a minus of typography | read where the number shows it |
//! | decimal commas | with commas as delimiter only in quotation marks (`"0,05"`); a file that mixes commas and points is refused |
//! | lines of comment (`#`, `%`), blank lines | skipped; names may stand in a comment (racing lines); `#N/A,1,2` is none |
//! | a block before the names (`"Venue","Test"`) | names are the row before the numbers that has most known names |
//! | a row of units below the names, or `vx [km/h]` | kept beside the name ([`Header::units`]) |
//! | UTF-8, UTF-16, UTF-32, Latin-1, a byte order mark | by mark, by zero bytes, and line by line |
//! | lines that end in a carriage return alone | by the beginning of the file |
//! | `n/a`, `null`, `-1.#IND`, `#REF!` and the like | a missing value ([`Row::is_missing`]) |
//! | gzip (feature `cli`) | by the file's ending or its first bytes |
//!
//! The meaning of a name is the caller's business, and so are units unknown here. Rows are read as a stream, and never
//! more of it than [`Limits`] allow: a packed file of 6 MB may unpack to 6 GB.
//!
//! ```
//! use rfl_mpc::table::{Limits, Table};
//!
//! let text = b"\"Venue\";\"Test\"\n\nx [m];y [m]\n0,5;1\n1,5;2\n";
//! let mut table = Table::new(&text[..], Limits::default(), &|name| ["x", "y"].contains(&name))?;
//! assert_eq!((table.header().names.join(" "), table.header().line), ("x y".into(), 3));
//! let row = table.next_row()?.unwrap();
//! assert_eq!((row.line, row.number(0)), (4, Some(0.5)));
//! # Ok::<(), rfl_mpc::table::TableError>(())
//! ```
//!
//! | file | idea |
//! |---|---|
//! | `open.rs` | files: refusals, gzip, the limit of bytes |
//! | `text.rs` | encodings, lines |
//! | `head.rs` | delimiter, names and units from the first lines |
//! | `header.rs` | names and units of the columns |
//! | `decimal.rs` | the decimal mark, and fields with decimal points |
//! | `table_error.rs` | limits of reading, and reasons for which a file gives no table |
//! | `unit.rs`, `units.txt` | units in names and in rows of units |
//! | `time.rs` | dates and times |

mod decimal;
mod head;
mod header;
mod open;
mod table_error;
mod text;
pub mod time;
mod unit;

pub use header::Header;
pub use open::open;
pub use table_error::{Limits, TableError};
pub use unit::{factor, split_unit};

use decimal::Decimal;
use head::Head;
use std::borrow::Cow;
use std::io::Read;
use text::Lines;

/// Words in place of a value, of spreadsheets, databases, C libraries and sensors.
const MISSING: [&str; 31] = [
    "na",
    "n/a",
    "<na>",
    "null",
    "none",
    "nil",
    "-",
    "--",
    "nan",
    "-nan",
    "nan(ind)",
    "-nan(ind)",
    "1.#qnan",
    "-1.#qnan",
    "1.#ind",
    "-1.#ind",
    "1.#inf",
    "-1.#inf",
    "sna",
    "n.a.",
    "n/v",
    "void",
    "missing",
    "unavailable",
    "invalid",
    "inv",
    "off",
    "fault",
    "error",
    "err",
    "?",
];

/// A table, read row by row.
pub struct Table<R: Read> {
    rows: csv::Reader<DataLines<R>>,
    record: csv::ByteRecord,
    header: Header,
    decimal: Decimal,
    count: u64,
    limits: Limits,
}

/// One row of values.
pub struct Row<'a> {
    /// The line, counted from 1: of a field of several lines the first one.
    pub line: u64,
    record: &'a csv::ByteRecord,
    decimal: Decimal,
}

impl<'a> Row<'a> {
    /// Fields in the row.
    #[must_use]
    pub fn len(&self) -> usize {
        self.record.len()
    }

    /// True if the row has no field; blank lines are no rows, so this is rare.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.record.is_empty()
    }

    /// Fields up to the last one that is not empty, or `least`: delimiters at the end of a line are ignored.
    #[must_use]
    pub fn filled(&self, least: usize) -> usize {
        (least..self.len())
            .rev()
            .find(|&i| !self.field(i).is_empty())
            .map_or(self.len().min(least), |i| i + 1)
    }

    /// A field, trimmed; empty where the row is too short.
    #[must_use]
    pub fn field(&self, column: usize) -> &'a str {
        let bytes = self.record.get(column).unwrap_or_default();
        // Lines are text before they are split.
        std::str::from_utf8(bytes).unwrap_or("\u{fffd}")
    }

    /// True if a field holds no value: it is empty, or a word that programs write in its place.
    #[must_use]
    pub fn is_missing(&self, column: usize) -> bool {
        let field = self.field(column);
        field.is_empty()
            || text::is_spreadsheet_error(field)
            || MISSING.iter().any(|word| field.eq_ignore_ascii_case(word))
    }

    /// A field with a decimal point, where this file writes commas.
    #[must_use]
    pub fn plain(&self, column: usize) -> Cow<'a, str> {
        self.decimal.plain(self.field(column))
    }

    /// A field as a number; `None` where it is none. Underscores (`1_000`) make no number.
    #[must_use]
    pub fn number(&self, column: usize) -> Option<f64> {
        self.plain(column).parse().ok()
    }
}

impl<R: Read> Table<R> {
    /// Detects the format of a file. `known` tells if a name (trimmed, without unit) is known.
    ///
    /// # Errors
    /// The file cannot be read, or is larger than the limits.
    pub fn new(reader: R, limits: Limits, known: &dyn Fn(&str) -> bool) -> Result<Self, TableError> {
        let mut lines = Lines::new(reader, limits.bytes)?;
        let mut first = Vec::new();
        let mut size = 0;
        let mut cut_off = None;
        while first.len() < head::LINES && size < head::BYTES {
            match lines.next_line() {
                Ok(Some(line)) => {
                    size += line.len();
                    first.push(line);
                }
                Ok(None) => break,
                // The lines before it are whole.
                Err(error @ TableError::CutOff { .. }) if !first.is_empty() => {
                    cut_off = Some(error);
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        let Head { delimiter, decimal, header, body } = head::find(&first, known);
        first.drain(..body);
        let body = DataLines {
            lines,
            first: first.into_iter(),
            cut_off,
            delimiter,
            number: body as u64,
            ready: Vec::new(),
            given: 0,
            count: 0,
            jumps: Vec::new(),
            error: None,
        };
        let rows = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .delimiter(delimiter)
            .from_reader(body);
        Ok(Self { rows, record: csv::ByteRecord::new(), header, decimal, count: 0, limits })
    }

    /// The names.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// True if any line so far was no UTF-8 and was read as Latin-1.
    #[must_use]
    pub fn is_latin1(&self) -> bool {
        self.rows.get_ref().lines.latin1
    }

    /// The next row; `None` at the end.
    ///
    /// # Errors
    /// The file cannot be read on, or is larger than the limits.
    pub fn next_row(&mut self) -> Result<Option<Row<'_>>, TableError> {
        let position = self.rows.position().line();
        let read = self.rows.read_byte_record(&mut self.record);
        if let Some(error) = self.rows.get_mut().error.take() {
            return Err(error);
        }
        let line = self.rows.get_ref().line(position);
        match read {
            Ok(false) => return Ok(None),
            Ok(true) => {}
            Err(error) => return Err(TableError::Broken { line, source: error.into() }),
        }
        self.count += 1;
        if self.count > self.limits.rows {
            return Err(TableError::TooManyRows { line, limit: self.limits.rows });
        }
        Ok(Some(Row { line, record: &self.record, decimal: self.decimal }))
    }
}

/// The lines with values as one UTF-8 text, without comments and blank lines, and the number that each has in the file.
struct DataLines<R: Read> {
    lines: Lines<R>,
    /// Lines that were read to find the head.
    first: std::vec::IntoIter<String>,
    /// The end of a file that is cut off among them.
    cut_off: Option<TableError>,
    /// A tab at either end of a line may be one; blanks count as one.
    delimiter: u8,
    /// Lines of the file so far.
    number: u64,
    ready: Vec<u8>,
    given: usize,
    /// Lines given so far.
    count: u64,
    /// Lines given (counted from 1) from which on the file's line numbers are higher, with the difference.
    jumps: Vec<(u64, u64)>,
    error: Option<TableError>,
}

impl<R: Read> DataLines<R> {
    /// The file's line of a line given (counted from 1).
    fn line(&self, given: u64) -> u64 {
        let after = self.jumps.partition_point(|jump| jump.0 <= given);
        given + after.checked_sub(1).map_or(0, |i| self.jumps[i].1)
    }

    fn fill(&mut self) -> Result<(), TableError> {
        self.ready.clear();
        self.given = 0;
        while self.ready.is_empty() {
            let next = match self.first.next() {
                Some(line) => Some(line),
                None => match self.cut_off.take() {
                    Some(error) => return Err(error),
                    None => {
                        self.number += self.lines.skip_empty()?;
                        self.lines.next_line()?
                    }
                },
            };
            let Some(line) = next else { return Ok(()) };
            self.number += 1;
            let text = text::trim(&line, self.delimiter == b'\t');
            if text.trim().is_empty() || text::comment(text, self.delimiter).is_some() {
                continue;
            }
            self.count += 1;
            let more = self.number - self.count;
            if self.jumps.last().map_or(0, |jump| jump.1) != more {
                self.jumps.push((self.count, more));
            }
            if self.delimiter == head::BLANKS {
                for field in text.split(' ').filter(|field| !field.is_empty()) {
                    self.ready.extend_from_slice(field.as_bytes());
                    self.ready.push(head::BLANKS);
                }
                self.ready.pop();
            } else {
                self.ready.extend_from_slice(text.as_bytes());
            }
            self.ready.push(b'\n');
        }
        Ok(())
    }
}

impl<R: Read> Read for DataLines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.given == self.ready.len()
            && let Err(error) = self.fill()
        {
            // The end, for the splitter; `next_row` gives the cause.
            self.error = Some(error);
            self.ready.clear();
            self.given = 0;
            return Ok(0);
        }
        let count = buffer.len().min(self.ready.len() - self.given);
        buffer[..count].copy_from_slice(&self.ready[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}
