//! A regression tree with several outputs, grown by CART.
//!
//! A node splits its rows at `x_f <= t` so that the outputs' squared deviation from their means falls most,
//!
//! ```text
//! gain = sum_o  S_left,o^2 / w_left + S_right,o^2 / w_right - S_o^2 / w        (S: weighted sum of output o)
//! ```
//!
//! with outputs standardised, so that metres and radians count alike (Breiman et al. 1984). Of the features, `F`
//! that are not constant in the node are drawn for each split.
//!
//! Sums are kept as integers of 2^-24 standard deviations: they are exact, whatever the order of summation.

use super::table::{ColumnValues, FeatureTable, middle};
use crate::numerics::Random;

/// Deepest tree: complete trees grow by two for each level.
pub const MAX_DEPTH: usize = 12;

/// Steps of a standardised target in one standard deviation.
const FIXED_POINT: f64 = (1_u64 << 24) as f64;

/// A complete binary tree: node `i` has the children `2 i + 1` (feature at most the threshold) and `2 i + 2`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tree {
    pub depth: u8,
    /// `2^depth - 1` features, level by level. A node that does not split has the threshold infinity.
    pub feature: Vec<u16>,
    pub threshold: Vec<f64>,
    /// Leaf of each of the `2^depth` ends. The ends below a node that does not split are one leaf.
    pub leaf: Vec<u32>,
    pub leaves: u32,
}

/// Growth of a tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Growth {
    pub depth: usize,
    /// Fewest distinct rows in a leaf.
    pub min_leaf: usize,
    /// Features tried at a split.
    pub features_per_split: usize,
}

/// Outputs of one row, standardised.
pub(super) type Target<const K: usize> = [i64; K];

/// Standardises each output to zero mean and unit variance. A constant output counts for nothing.
pub(super) fn standardise<const K: usize>(labels: &[[f64; K]]) -> Vec<Target<K>> {
    let n = labels.len().max(1) as f64;
    let mut mean = [0.0; K];
    let mut deviation = [0.0; K];
    for o in 0..K {
        mean[o] = labels.iter().map(|y| y[o]).sum::<f64>() / n;
        deviation[o] = (labels.iter().map(|y| (y[o] - mean[o]).powi(2)).sum::<f64>() / n).sqrt();
    }
    let standard = |y: &[f64; K]| {
        std::array::from_fn(|o| {
            let scale = if deviation[o] > 0.0 { FIXED_POINT / deviation[o] } else { 0.0 };
            // The clamp cannot bind for less than a million rows; it keeps sums from overflow beyond.
            ((y[o] - mean[o]) * scale).clamp(-1024.0 * FIXED_POINT, 1024.0 * FIXED_POINT).round() as i64
        })
    };
    labels.iter().map(standard).collect()
}

/// Grows a tree on the rows with a weight.
pub(super) fn grow<const K: usize>(
    table: &FeatureTable,
    targets: &[Target<K>],
    weights: &[u16],
    growth: Growth,
    random: &mut Random,
) -> Tree {
    let nodes = (1 << growth.depth) - 1;
    let mut rows: Vec<u32> = (0..table.rows as u32).filter(|&row| weights[row as usize] > 0).collect();
    let mut grower = Grower {
        table,
        targets,
        weights,
        growth,
        random,
        order: (0..table.columns.len()).collect(),
        histogram: vec![SplitSums::ZERO; 256],
        gathered: Vec::with_capacity(rows.len()),
        sorted: Vec::new(),
        kept: Vec::with_capacity(rows.len()),
        tree: Tree {
            depth: growth.depth as u8,
            feature: vec![0; nodes],
            threshold: vec![f64::INFINITY; nodes],
            leaf: vec![0; nodes + 1],
            leaves: 0,
        },
    };
    grower.node(0, 0, &mut rows);
    grower.tree
}

/// Weighted sums over rows.
#[derive(Debug, Clone, Copy)]
struct SplitSums<const K: usize> {
    outputs: [i64; K],
    weight: u32,
    rows: u32,
}

impl<const K: usize> SplitSums<K> {
    const ZERO: Self = Self { outputs: [0; K], weight: 0, rows: 0 };

    #[inline]
    fn add(&mut self, other: &Self) {
        for o in 0..K {
            self.outputs[o] += other.outputs[o];
        }
        self.weight += other.weight;
        self.rows += other.rows;
    }

    fn minus(&self, other: &Self) -> Self {
        Self {
            outputs: std::array::from_fn(|o| self.outputs[o] - other.outputs[o]),
            weight: self.weight - other.weight,
            rows: self.rows - other.rows,
        }
    }

    /// `sum_o S_o^2 / w`: the part that the mean explains.
    fn explained(&self) -> f64 {
        self.outputs.iter().map(|&s| s as f64 * s as f64).sum::<f64>() / f64::from(self.weight)
    }
}

/// The best split so far.
#[derive(Debug, Clone, Copy)]
struct Split {
    explained: f64,
    column: usize,
    threshold: f64,
    /// Last bin on the left, for a binned column.
    bin: usize,
}

struct Grower<'a, const K: usize> {
    table: &'a FeatureTable,
    targets: &'a [Target<K>],
    weights: &'a [u16],
    growth: Growth,
    random: &'a mut Random,
    /// Columns, in the order in which the last node drew them.
    order: Vec<usize>,
    histogram: Vec<SplitSums<K>>,
    /// Contribution of each row of the node.
    gathered: Vec<SplitSums<K>>,
    sorted: Vec<(f64, u32)>,
    kept: Vec<u32>,
    tree: Tree,
}

impl<const K: usize> Grower<'_, K> {
    fn node(&mut self, node: usize, level: usize, rows: &mut [u32]) {
        let split = if level < self.growth.depth && rows.len() >= 2 * self.growth.min_leaf.max(1) {
            self.best_split(rows)
        } else {
            None
        };
        let Some(split) = split else {
            let leaf = self.tree.leaves;
            self.tree.leaves += 1;
            // The ends below this node: `width` of them, from the leftmost descendant on.
            let width = 1 << (self.growth.depth - level);
            let first = (node + 1) * width - (1 << self.growth.depth);
            self.tree.leaf[first..first + width].fill(leaf);
            return;
        };
        self.tree.feature[node] = self.table.columns[split.column].feature;
        self.tree.threshold[node] = split.threshold;
        let left = self.partition(rows, &split);
        let (left, right) = rows.split_at_mut(left);
        self.node(2 * node + 1, level + 1, left);
        self.node(2 * node + 2, level + 1, right);
    }

    fn best_split(&mut self, rows: &[u32]) -> Option<Split> {
        self.gathered.clear();
        let mut total = SplitSums::ZERO;
        for &row in rows {
            let (target, w) = (&self.targets[row as usize], self.weights[row as usize]);
            let outputs = std::array::from_fn(|o| target[o] * i64::from(w));
            let sums = SplitSums { outputs, weight: u32::from(w), rows: 1 };
            total.add(&sums);
            self.gathered.push(sums);
        }
        // A gain within rounding is none.
        let mut best = Split {
            explained: total.explained() * (1.0 + 1e-12) + 1.0,
            column: usize::MAX,
            threshold: 0.0,
            bin: 0,
        };
        let mut tried = 0;
        let count = self.order.len();
        for i in 0..count {
            if tried == self.growth.features_per_split {
                break;
            }
            // A partial shuffle: the columns drawn so far stand in front.
            if self.growth.features_per_split < count {
                let other = i + self.random.below((count - i) as u32) as usize;
                self.order.swap(i, other);
            }
            let varies = self.try_column(self.order[i], rows, &total, &mut best);
            tried += usize::from(varies);
        }
        (best.column != usize::MAX).then_some(best)
    }

    /// Looks for a better split of a column; false if the column is constant in the node.
    fn try_column(&mut self, column: usize, rows: &[u32], total: &SplitSums<K>, best: &mut Split) -> bool {
        let min_leaf = self.growth.min_leaf.max(1) as u32;
        let mut left = SplitSums::ZERO;
        let mut consider = |left: &SplitSums<K>, threshold: f64, bin: usize| {
            if left.rows < min_leaf || total.rows - left.rows < min_leaf {
                return;
            }
            let explained = left.explained() + total.minus(left).explained();
            // Of equal splits the one of the first column counts, whatever order they were drawn in.
            if explained > best.explained || (explained == best.explained && column < best.column) {
                *best = Split { explained, column, threshold, bin };
            }
        };
        match &self.table.columns[column].values {
            ColumnValues::Bins { edges, bins } => {
                let histogram = &mut self.histogram[..=edges.len()];
                histogram.fill(SplitSums::ZERO);
                for (&row, sums) in rows.iter().zip(&self.gathered) {
                    histogram[usize::from(bins[row as usize])].add(sums);
                }
                if histogram.iter().any(|bin| bin.rows == total.rows) {
                    return false;
                }
                for (bin, &edge) in edges.iter().enumerate() {
                    // An empty bin splits the rows as the bin before it did.
                    if histogram[bin].rows > 0 {
                        left.add(&histogram[bin]);
                        consider(&left, edge, bin);
                    }
                }
            }
            ColumnValues::Raw(values) => {
                self.sorted.clear();
                self.sorted.extend(rows.iter().enumerate().map(|(i, &row)| (values[row as usize], i as u32)));
                self.sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                for pair in self.sorted.windows(2) {
                    left.add(&self.gathered[pair[0].1 as usize]);
                    if pair[0].0 < pair[1].0 {
                        consider(&left, middle(pair[0].0, pair[1].0), 0);
                    }
                }
                return self.sorted.first().map(|s| s.0) < self.sorted.last().map(|s| s.0);
            }
        }
        true
    }

    /// Moves the rows on the left to the front, keeping their order; returns how many they are.
    fn partition(&mut self, rows: &mut [u32], split: &Split) -> usize {
        self.kept.clear();
        let mut left = 0;
        for i in 0..rows.len() {
            let row = rows[i];
            let goes_left = match &self.table.columns[split.column].values {
                ColumnValues::Bins { bins, .. } => usize::from(bins[row as usize]) <= split.bin,
                ColumnValues::Raw(values) => values[row as usize] <= split.threshold,
            };
            if goes_left {
                rows[left] = row;
                left += 1;
            } else {
                self.kept.push(row);
            }
        }
        rows[left..].copy_from_slice(&self.kept);
        left
    }
}
