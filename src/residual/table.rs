//! Training table of trees: features, binned or raw.
//!
//! Binning replaces each value by the number of *edges* below it, `bin(x) = #{e : x > e}`, at most 256 bins a
//! column, so one byte a value. Edges lie midway between neighbouring values at the quantiles of the column, taken from
//! a sample of its rows if there are many. A column with few distinct values has one bin for each. `bin(x) <= b` is
//! exactly `x <= edge[b]`: a tree grown on bins sorts raw values just as it sorted the bins.

use crate::numerics::Random;
use crate::numerics::parallel;

/// A table whose columns are features.
pub trait Columns: Sync {
    /// Rows of the table.
    fn rows(&self) -> usize;
    /// Columns of the table.
    fn columns(&self) -> usize;
    /// Value in a row and column.
    fn value(&self, row: usize, column: usize) -> f64;
}

/// A table in memory, row after row.
#[derive(Debug, Clone, Copy)]
pub struct Dense<'a> {
    values: &'a [f64],
    columns: usize,
}

impl<'a> Dense<'a> {
    /// A table of `values.len() / columns` rows.
    ///
    /// # Panics
    /// If the values do not fill whole rows: a mistake of the calling code, not of data.
    #[must_use]
    pub fn new(values: &'a [f64], columns: usize) -> Self {
        assert!(columns > 0 && values.len().is_multiple_of(columns), "values must fill whole rows");
        Self { values, columns }
    }
}

impl Columns for Dense<'_> {
    fn rows(&self) -> usize {
        self.values.len() / self.columns
    }
    fn columns(&self) -> usize {
        self.columns
    }
    fn value(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }
}

/// Resolution of a feature's values when a tree is grown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resolution {
    /// At most so many quantile bins a feature, 2 to 256.
    Histogram(u16),
    /// Every value: sorts the rows of each node; slow, and the reference.
    Exact,
}

/// The features that a tree may split on.
#[derive(Debug)]
pub(super) struct FeatureTable {
    pub rows: usize,
    pub columns: Vec<Column>,
}

/// One feature of all rows.
#[derive(Debug)]
pub(super) struct Column {
    /// Its number in the features of a look-up.
    pub feature: u16,
    pub values: ColumnValues,
}

#[derive(Debug)]
pub(super) enum ColumnValues {
    Bins { edges: Vec<f64>, bins: Vec<u8> },
    Raw(Vec<f64>),
}

impl FeatureTable {
    /// The columns named in `features`.
    pub fn new(source: &dyn Columns, features: &[u16], resolution: Resolution, threads: usize) -> Self {
        let rows = source.rows();
        let columns = parallel::map(threads, features.len(), |i| {
            let feature = features[i];
            let raw: Vec<f64> = (0..rows).map(|row| source.value(row, usize::from(feature))).collect();
            let values = match resolution {
                Resolution::Exact => ColumnValues::Raw(raw),
                Resolution::Histogram(bins) => {
                    let edges = edges(sample(&raw), usize::from(bins.clamp(2, 256)));
                    let bins = raw.iter().map(|&x| edges.partition_point(|&e| x > e) as u8).collect();
                    ColumnValues::Bins { edges, bins }
                }
            };
            Column { feature, values }
        });
        Self { rows, columns }
    }
}

/// Rows from which quantiles are taken: some 80 for each of 255 bins, and a fifth of the time of sorting 100 000.
const QUANTILE_ROWS: usize = 20_000;

/// Values drawn at random, always the same rows; all of them if there are few.
fn sample(values: &[f64]) -> Vec<f64> {
    if values.len() <= QUANTILE_ROWS {
        return values.to_vec();
    }
    let mut random = Random::new(0);
    (0..QUANTILE_ROWS).map(|_| values[random.below(values.len() as u32) as usize]).collect()
}

/// At most `bins - 1` edges, strictly increasing.
fn edges(mut sorted: Vec<f64>, bins: usize) -> Vec<f64> {
    sorted.sort_unstable_by(f64::total_cmp);
    let steps = || sorted.windows(2).filter(|pair| pair[0] < pair[1]);
    if steps().count() < bins {
        return steps().map(|pair| middle(pair[0], pair[1])).collect();
    }
    let mut edges: Vec<f64> = Vec::with_capacity(bins - 1);
    for b in 1..bins {
        let at = b * sorted.len() / bins;
        // At a value that fills several quantiles, the edge is put behind its last occurrence.
        let low = sorted[at - 1];
        let Some(&high) = sorted[at..].iter().find(|&&x| x > low) else { break };
        let edge = middle(low, high);
        if edges.last().is_none_or(|&last| edge > last) {
            edges.push(edge);
        }
    }
    edges
}

/// A threshold between two neighbouring values, `low <= middle < high` also where they are neighbours as floats.
pub(super) fn middle(low: f64, high: f64) -> f64 {
    let middle = 0.5 * low + 0.5 * high;
    if middle >= low && middle < high { middle } else { low }
}
