//! A log's rows on their way to a clean log: columns in the order of their clocks, and what is found and left out on the way.

use super::finding::{Finding, FindingSeverity};
use std::collections::BTreeMap;
use std::ops::Range;

/// Columns of a log by name.
pub(super) type LogColumns = BTreeMap<&'static str, Vec<f64>>;

/// Rows of the file whose value in a column is wrong.
pub(super) type WrongRows = BTreeMap<&'static str, Vec<usize>>;

/// Stretches of one value within a span, no shorter than so many rows.
pub(super) fn repeats(values: &[f64], span: Range<usize>, shortest: usize) -> Vec<Range<usize>> {
    let (mut found, mut start) = (Vec::new(), span.start);
    for i in span.start + 1..=span.end {
        if i == span.end || values[i] != values[start] {
            if i - start >= shortest {
                found.push(start..i);
            }
            start = i;
        }
    }
    found
}

/// Rows of a log.
pub(super) struct LogRows<'a> {
    /// The columns as the file has them.
    pub file: &'a LogColumns,
    /// Columns, one drive after the other.
    pub columns: LogColumns,
    /// The drives: stretches without a break.
    pub spans: Vec<Range<usize>>,
    /// Usual time from row to row, s.
    pub spacing: f64,
    /// Row of the file for each row here.
    pub in_file: Vec<usize>,
    pub findings: Vec<Finding>,
    pub left_out: WrongRows,
}

impl LogRows<'_> {
    /// Rows that last so long, at least `least` of them.
    pub fn lasting(&self, seconds: f64, least: usize) -> usize {
        ((seconds / self.spacing).ceil() as usize).max(least)
    }

    /// Leaves out values of a column: they are missing then.
    pub fn leave_out(&mut self, name: &'static str, places: impl IntoIterator<Item = usize>) {
        let Some(values) = self.columns.get_mut(name) else { return };
        let left_out = self.left_out.entry(name).or_default();
        for place in places {
            values[place] = f64::NAN;
            left_out.push(self.in_file[place]);
        }
    }

    pub fn find(&mut self, gravity: FindingSeverity, name: &'static str, words: String) {
        self.findings.push(Finding::new(gravity, Some(name), words));
    }

    /// Number of a row in the file, counted from 1 after the header.
    pub fn number(&self, place: usize) -> usize {
        self.in_file[place] + 1
    }
}
