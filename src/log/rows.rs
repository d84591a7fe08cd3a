//! A log's rows on their way to a clean log: columns in the order of their clocks, and what is found and left out on the way.

use super::clean_log::Coarseness;
use super::finding::{Finding, FindingSeverity};
use crate::numerics::statistics::median;
use std::collections::BTreeMap;
use std::ops::Range;

/// Columns of a log by name.
pub(super) type LogColumns = BTreeMap<&'static str, Vec<f64>>;

/// Rows of the file whose value in a column is wrong.
pub(super) type WrongRows = BTreeMap<&'static str, Vec<usize>>;

/// Longest time from a value to the next one over which it is held, in usual ones.
const HELD: f64 = 2.5;

/// A column that stands in some rows only, each value held up to the next one; not where that is far off.
pub(super) fn hold(time: &[f64], values: &[f64]) -> Vec<f64> {
    let stated: Vec<f64> =
        time.iter().zip(values).filter(|(_, value)| value.is_finite()).map(|(time, _)| *time).collect();
    let Some(usual) = median(stated.windows(2).map(|pair| pair[1] - pair[0]).collect()) else {
        return values.to_vec();
    };
    let (mut last, mut since) = (f64::NAN, f64::NEG_INFINITY);
    let each = time.iter().zip(values).map(|(&time, &value)| {
        if value.is_finite() {
            (last, since) = (value, time);
        }
        if time - since < HELD * usual { last } else { f64::NAN }
    });
    each.collect()
}

/// A column that stands in some rows only, on lines over gaps of up to `longest` seconds.
pub(super) fn bridge(time: &[f64], values: &[f64], longest: f64) -> Vec<f64> {
    let mut bridged = values.to_vec();
    let stated: Vec<usize> = (0..values.len()).filter(|&row| values[row].is_finite()).collect();
    for pair in stated.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let apart = time[to] - time[from];
        if to - from > 1 && apart <= longest {
            let slope = (values[to] - values[from]) / apart;
            (from + 1..to).for_each(|row| bridged[row] = values[from] + slope * (time[row] - time[from]));
        }
    }
    bridged
}

/// Stretches of rows that follow each other; `rows` rise.
pub(super) fn runs(rows: &[usize]) -> impl Iterator<Item = Range<usize>> {
    rows.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[run.len() - 1] + 1)
}

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
    /// Time of each row, s.
    pub time: Vec<f64>,
    /// The drives: stretches without a break.
    pub spans: Vec<Range<usize>>,
    /// Usual time from row to row, s.
    pub spacing: f64,
    /// Row of the file for each row here.
    pub in_file: Vec<usize>,
    pub findings: Vec<Finding>,
    pub left_out: WrongRows,
    /// Columns that are written in steps.
    pub coarse: BTreeMap<&'static str, Coarseness>,
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
