//! Delimiter, decimal mark, names and units, from a file's first lines.

use super::decimal::Decimal;
use super::header::{Header, of_names};
use super::text;
use super::unit::{is_unit, split_unit};
use std::cmp::Reverse;

/// Lines looked at ...
pub(super) const LINES: usize = 1000;
/// ... and bytes.
pub(super) const BYTES: usize = 256 << 10;

/// The delimiter of columns that are aligned: any number of blanks.
pub(super) const BLANKS: u8 = b' ';

/// Format of a file.
pub(super) struct Head {
    pub delimiter: u8,
    pub decimal: Decimal,
    pub header: Header,
    /// Lines before the first row of values.
    pub body: usize,
}

/// A line with its number (from 0), and its fields.
struct Line {
    index: usize,
    comment: bool,
    fields: Vec<String>,
}

/// Detects the format of a file that begins with `lines`; `known` tells if a name is known.
pub(super) fn find(lines: &[String], known: &dyn Fn(&str) -> bool) -> Head {
    let (start, told) = told_delimiter(lines);
    let delimiter = told.unwrap_or_else(|| most_numbers(&lines[start..]));
    let rows: Vec<Line> = lines
        .iter()
        .enumerate()
        .skip(start)
        .filter_map(|(index, line)| {
            let line = text::trim(line, delimiter == b'\t');
            let comment = text::comment(line, delimiter);
            let said = comment.unwrap_or(line);
            (!said.trim().is_empty()).then(|| Line {
                index,
                comment: comment.is_some(),
                fields: split(said, delimiter),
            })
        })
        .collect();
    let decimal = decimal(&rows, delimiter);
    let width = width(&rows);
    let data = rows.iter().position(|row| !row.comment && is_data(row, width)).unwrap_or(rows.len());
    // A block before the names may have numbers, too; then known names tell its end.
    let known_names = |row: &Line| count_known(row, known);
    let later = rows.iter().skip(data).position(|row| !row.comment && known_names(row) >= 2);
    let later = later.filter(|_| rows[..data].iter().all(|row| known_names(row) == 0));
    // Without numbers there is no block before them.
    let (before, _) = rows.split_at(data + later.map_or(0, |row| row + 1));
    let guess = data < rows.len();
    let Some(names) = names_row(before, known, width, guess)
        .or_else(|| commented(&rows[..data], width))
        .or_else(|| rows.iter().position(|row| !row.comment))
    else {
        return Head { delimiter, decimal, header: Header::default(), body: lines.len() };
    };
    let units =
        (names + 1..rows.len()).find(|&row| !rows[row].comment).filter(|&row| is_units(&rows[row].fields));
    let header = header(&rows[names], units.map(|row| rows[row].fields.as_slice()));
    Head { delimiter, decimal, header, body: rows[units.unwrap_or(names)].index + 1 }
}

/// A line `sep=;`, as spreadsheets write it: how many lines it takes, and the delimiter.
fn told_delimiter(lines: &[String]) -> (usize, Option<u8>) {
    let told = lines.first().and_then(|line| line.trim_matches(['\r', '"', ' ']).strip_prefix("sep="));
    match told.map(str::as_bytes) {
        Some(&[delimiter @ (b',' | b';' | b'\t' | b'|')]) => (1, Some(delimiter)),
        _ => (0, None),
    }
}

/// The delimiter by which most fields are numbers, and fewest are not; commas if none is better.
fn most_numbers(lines: &[String]) -> u8 {
    let score = |delimiter: u8| -> (i64, i64) {
        let (mut numbers, mut fields) = (0, 0);
        for line in lines {
            let line = text::trim(line, delimiter == b'\t');
            let comment = text::comment(line, delimiter);
            let row = split(comment.unwrap_or(line), delimiter);
            if row.len() < 2 {
                continue;
            }
            fields += row.len() as i64;
            // Rows without any number are names, or a block before them.
            let filled = row.iter().filter(|field| !field.is_empty()).count() as i64;
            let values = row.iter().filter(|field| is_value(field)).count() as i64;
            if comment.is_none() && values > 0 {
                numbers += 2 * values - filled;
            }
        }
        (numbers, fields)
    };
    let commas = score(b',');
    // By the numbers; in a file of names alone by the fields.
    let better = |delimiter: u8| {
        let other = score(delimiter);
        (other.1 > 0 && (other.0 > commas.0 || commas.1 == 0)).then_some((other, delimiter))
    };
    [b';', b'\t', b'|', BLANKS].into_iter().filter_map(better).max().map_or(b',', |best| best.1)
}

/// A line's fields, trimmed.
fn split(line: &str, delimiter: u8) -> Vec<String> {
    if delimiter == BLANKS && !line.contains('"') {
        return line.split(' ').filter(|field| !field.is_empty()).map(str::to_owned).collect();
    }
    if !line.contains('"') {
        // A parser takes longer to be made than a line to be split.
        return line.split(char::from(delimiter)).map(|field| field.trim().to_owned()).collect();
    }
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .delimiter(delimiter)
        .from_reader(line.as_bytes());
    let mut record = csv::StringRecord::new();
    match reader.read_record(&mut record) {
        Ok(true) => record.iter().map(str::to_owned).collect(),
        _ => Vec::new(),
    }
}

/// True if a field is a number, or a time, as a row of values has them.
fn is_value(field: &str) -> bool {
    let number = |text: &str| text.parse::<f64>().is_ok();
    // Between commas a decimal comma is in quotation marks.
    number(field)
        || field.matches(',').count() == 1 && number(&field.replace(',', "."))
        || super::time::seconds(field).is_some()
}

/// Decimal mark of the numbers in the head.
fn decimal(rows: &[Line], delimiter: u8) -> Decimal {
    let values = || {
        rows.iter()
            .filter(|row| !row.comment)
            .flat_map(|row| &row.fields)
            .filter(|field| is_value(field) && super::time::seconds(field).is_none())
    };
    let points = || values().any(|field| field.contains('.'));
    // Between commas `"1,234"` may be thousands, `"0,05"` is not.
    let is_decimal =
        |field: &String| field.split_once(',').is_some_and(|(_, part)| delimiter != b',' || part.len() != 3);
    if values().any(is_decimal) && (delimiter != b',' || !points()) {
        Decimal::Comma
    } else if delimiter == b',' || points() {
        Decimal::Point
    } else {
        Decimal::Unknown
    }
}

/// The most frequent number of fields.
fn width(rows: &[Line]) -> usize {
    let mut counts = std::collections::BTreeMap::new();
    for row in rows.iter().filter(|row| !row.comment) {
        *counts.entry(row.fields.len()).or_insert(0usize) += 1;
    }
    counts.into_iter().max_by_key(|&(_, count)| count).map_or(0, |(width, _)| width)
}

fn is_data(row: &Line, width: usize) -> bool {
    let filled = row.fields.iter().filter(|field| !field.is_empty());
    let (values, others): (Vec<&String>, Vec<&String>) = filled.partition(|field| is_value(field));
    row.fields.len() >= width.min(2) && values.len() > others.len()
}

/// Number of known names in a row.
fn count_known(row: &Line, known: &dyn Fn(&str) -> bool) -> usize {
    row.fields.iter().filter(|name| known(split_unit(name).0)).count()
}

/// The row of names among those before the numbers: the one with most known names. Without known names, the last before
/// the numbers. A comment counts only if it has two known names and no row has one.
fn names_row(before: &[Line], known: &dyn Fn(&str) -> bool, width: usize, guess: bool) -> Option<usize> {
    let best = |comment: bool| {
        let rows = before.iter().enumerate().filter(|(_, row)| row.comment == comment);
        // The first of equals.
        rows.map(|(index, row)| (count_known(row, known), index))
            .max_by_key(|&(count, index)| (count, Reverse(index)))
    };
    let (row, comment) = (best(false), best(true));
    if let Some((1.., index)) = row {
        return Some(index);
    }
    if let Some((2.., index)) = comment {
        return Some(index);
    }
    if !guess {
        return None;
    }
    let rows: Vec<usize> = (0..before.len()).filter(|&row| !before[row].comment).collect();
    let wide = |&&row: &&usize| before[row].fields.len() >= width.min(2);
    let last = *rows.iter().rev().find(wide)?;
    let above = rows.iter().rev().filter(wide).nth(1);
    match above {
        Some(&above) if is_units(&before[last].fields) => Some(above),
        _ => Some(last),
    }
}

/// The comment above the numbers that has as many fields: the names, though none is known (`%time,field.x`).
fn commented(before: &[Line], width: usize) -> Option<usize> {
    let last = before.last().filter(|row| row.comment && width > 1 && row.fields.len() == width)?;
    let is_number = |field: &String| field.parse::<f64>().is_ok();
    (!last.fields.iter().any(is_number)).then(|| before.len() - 1)
}

/// True for a row of units: short words, at least half of them known, none a number.
fn is_units(fields: &[String]) -> bool {
    let word = |field: &str| field.trim_matches(['[', ']', '(', ')', ' ']).to_owned();
    let filled: Vec<String> =
        fields.iter().map(|field| word(field)).filter(|field| !field.is_empty() && field != "-").collect();
    let units = filled.iter().filter(|field| is_unit(field)).count();
    units > 0
        && 2 * units >= filled.len()
        && filled.iter().all(|field| field == "1" || field.len() <= 16 && !is_value(field))
}

fn header(names: &Line, units: Option<&[String]>) -> Header {
    let mut header = of_names(&names.fields, units);
    header.line = names.index as u64 + 1;
    // A delimiter at the end of the line makes no column.
    while header.names.len() > 1 && header.written.last().is_some_and(String::is_empty) {
        header.names.pop();
        header.units.pop();
        header.written.pop();
    }
    header
}
