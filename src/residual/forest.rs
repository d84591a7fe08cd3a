//! Random forests: trees that differ by their rows and by the features at their splits.
//!
//! Each tree sees a bootstrap sample: `n` draws with replacement out of `n` rows (Breiman 2001), or of blocks of rows.
//! The rows that it did not draw are *out of bag*, about `1/e` of all, and serve as its test data.
//!
//! Complexity: `O(T D n F)` to grow, `O(T D)` to look up.

use super::table::{Columns, FeatureTable, Resolution};
use super::tree::{self, Growth, MAX_DEPTH, Tree};
use crate::numerics::Random;
use crate::numerics::parallel;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Growth of a forest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForestConfig {
    /// Number of trees, T.
    pub trees: usize,
    /// Depth of the trees, at most [`MAX_DEPTH`].
    pub depth: usize,
    /// Fewest distinct rows in a leaf.
    pub min_leaf: usize,
    /// Features tried at a split, F; a larger number means all.
    pub features_per_split: usize,
    /// Bootstrap sample of each tree, and its unit; `None`: all trees see all rows.
    pub bootstrap: Option<Block>,
    /// Resolution of values.
    pub resolution: Resolution,
    /// Seed of bootstrap and feature sampling.
    pub seed: u64,
    /// Threads to use; 0 for all. The result does not depend on it.
    pub threads: usize,
}

/// Consecutive rows that a bootstrap draws together, at least 1.
///
/// Rows of a time series resemble their neighbours. Drawn one by one, a row out of bag has neighbours in the bag, and
/// its error says little about roads not driven. Drawn in blocks, it does (Kunsch 1989).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block(pub usize);

/// The trees, flat: those of one forest lie one behind the other, all of one depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Forest {
    pub(super) depth: u8,
    pub(super) trees: u32,
    /// `2^depth - 1` nodes a tree.
    pub(super) feature: Vec<u16>,
    pub(super) threshold: Vec<f64>,
    /// `2^depth` ends a tree: number of the leaf among all leaves of the forest.
    pub(super) leaf: Vec<u32>,
    /// Leaves of all trees.
    pub(super) leaves: u32,
}

/// A forest, and the rows of each tree.
#[derive(Debug, Clone)]
pub struct GrownForest {
    /// The forest.
    pub forest: Forest,
    /// Number of draws of each row for each tree; 0 is out of bag.
    pub in_bag: Vec<Vec<u16>>,
}

/// Trees that are looked up at once: their loads overlap.
const LANES: usize = 4;

impl Forest {
    /// The forest of these trees, all of one depth.
    #[must_use]
    pub(super) fn new(trees: &[Tree]) -> Self {
        let mut forest = Self {
            depth: trees.first().map_or(0, |tree| tree.depth),
            trees: trees.len() as u32,
            feature: vec![],
            threshold: vec![],
            leaf: vec![],
            leaves: 0,
        };
        for tree in trees {
            crate::invariant!(tree.depth == forest.depth);
            forest.feature.extend(&tree.feature);
            forest.threshold.extend(&tree.threshold);
            forest.leaf.extend(tree.leaf.iter().map(|leaf| leaf + forest.leaves));
            forest.leaves += tree.leaves;
        }
        forest
    }

    /// The forest of one tree that does not split.
    #[must_use]
    pub(super) fn single_leaf() -> Self {
        Self { depth: 0, trees: 1, feature: vec![], threshold: vec![], leaf: vec![0], leaves: 1 }
    }

    /// The splits of a tree, `(feature, threshold)` in order of its nodes; `None` where a node does not split. The
    /// children of node `i` are `2 i + 1` and `2 i + 2`.
    pub fn splits(&self, tree: usize) -> impl Iterator<Item = Option<(u16, f64)>> + '_ {
        let nodes = (1_usize << self.depth) - 1;
        let (features, thresholds) =
            (&self.feature[tree * nodes..][..nodes], &self.threshold[tree * nodes..]);
        features.iter().zip(thresholds).map(|(&f, &t)| (t < f64::INFINITY).then_some((f, t)))
    }

    /// Number of trees.
    #[must_use]
    pub fn trees(&self) -> usize {
        self.trees as usize
    }

    /// Number of leaves of all trees.
    #[must_use]
    pub fn leaves(&self) -> usize {
        self.leaves as usize
    }

    /// First leaf of each tree, and the number of all.
    pub(super) fn first_leaves(&self) -> Vec<u32> {
        let ends = 1_usize << self.depth;
        let first = self.leaf.chunks(ends).map(|ends| ends.iter().copied().min().unwrap_or(0));
        first.chain([self.leaves]).collect()
    }

    /// Calls `found(tree, leaf)` for each tree in order with the leaf, numbered over all trees, into which the
    /// features fall. A feature that is not a number goes to the left.
    #[inline]
    pub fn look_up(&self, features: &[f64], mut found: impl FnMut(usize, usize)) {
        self.reach(features, |tree, _, leaf| found(tree, leaf as usize));
    }

    /// The same with the end between tree and leaf, counted in each tree from the left.
    #[inline]
    pub(super) fn reach(&self, features: &[f64], mut found: impl FnMut(usize, usize, u32)) {
        let ends = 1_usize << self.depth;
        let whole = self.trees() - self.trees() % LANES;
        for first in (0..whole).step_by(LANES) {
            for (lane, end) in self.ends_of::<LANES>(first, features).into_iter().enumerate() {
                found(first + lane, end, self.leaf[(first + lane) * ends + end]);
            }
        }
        for tree in whole..self.trees() {
            let [end] = self.ends_of::<1>(tree, features);
            found(tree, end, self.leaf[tree * ends + end]);
        }
    }

    /// The ends of so many trees from a first one on.
    #[inline]
    fn ends_of<const L: usize>(&self, first: usize, features: &[f64]) -> [usize; L] {
        let nodes = (1_usize << self.depth) - 1;
        let asked = &self.feature[first * nodes..][..L * nodes];
        let thresholds = &self.threshold[first * nodes..][..L * nodes];
        // Counted on over the trees: the children of a tree's node `i` are `2 i + 1` and `2 i + 2`.
        let mut at: [usize; L] = std::array::from_fn(|lane| lane * nodes);
        for _ in 0..self.depth {
            for (lane, at) in at.iter_mut().enumerate() {
                let right = features[usize::from(asked[*at])] > thresholds[*at];
                *at = 2 * *at + 1 - lane * nodes + usize::from(right);
            }
        }
        std::array::from_fn(|lane| at[lane] - (lane + 1) * nodes)
    }

    /// End and leaf of one tree below a node so many levels above the ends, where a feature has the value
    /// `value(feature)`. Nodes are counted from 1 level by level, ends from the left.
    #[inline]
    pub(super) fn descend(
        &self,
        tree: usize,
        node: usize,
        above: u16,
        value: impl Fn(usize) -> f64,
    ) -> (u16, u32) {
        let nodes = (1_usize << self.depth) - 1;
        let features = &self.feature[tree * nodes..][..nodes];
        let thresholds = &self.threshold[tree * nodes..][..nodes];
        let mut node = node;
        for _ in 0..above {
            let right = value(usize::from(features[node - 1])) > thresholds[node - 1];
            node = 2 * node + usize::from(right);
        }
        let end = node - nodes - 1;
        (end as u16, self.leaf[tree * (nodes + 1) + end])
    }
}

/// Grows a forest on the columns of `table` that `features` names, for the outputs `labels` of each row.
///
/// `grown` is called with the number of trees that are done, from the thread that finished one.
#[must_use]
pub fn grow<const K: usize>(
    table: &dyn Columns,
    features: &[u16],
    labels: &[[f64; K]],
    config: &ForestConfig,
    grown: &(dyn Fn(usize) + Sync),
) -> GrownForest {
    let threads = parallel::threads(config.threads);
    let table = FeatureTable::new(table, features, config.resolution, threads);
    let targets = tree::standardise(labels);
    let growth = Growth {
        depth: config.depth.min(MAX_DEPTH),
        min_leaf: config.min_leaf,
        features_per_split: config.features_per_split.clamp(1, features.len().max(1)),
    };
    let done = AtomicUsize::new(0);
    let trees = parallel::map(threads, config.trees, |tree| {
        let mut random = Random::stream(config.seed, tree as u64);
        let weights = match config.bootstrap {
            Some(block) => bootstrap(table.rows, block, &mut random),
            None => vec![1; table.rows],
        };
        let tree = tree::grow(&table, &targets, &weights, growth, &mut random);
        grown(done.fetch_add(1, Ordering::Relaxed) + 1);
        (tree, weights)
    });
    let (trees, in_bag): (Vec<Tree>, _) = trees.into_iter().unzip();
    GrownForest { forest: Forest::new(&trees), in_bag }
}

/// Number of draws of each row, where as many blocks as there are, are drawn with replacement.
fn bootstrap(rows: usize, Block(size): Block, random: &mut Random) -> Vec<u16> {
    let mut count = vec![0; rows];
    let size = size.clamp(1, rows.max(1));
    let blocks = rows.div_ceil(size);
    for _ in 0..blocks {
        let first = random.below(blocks as u32) as usize * size;
        count[first..(first + size).min(rows)].iter_mut().for_each(|count| *count += 1);
    }
    count
}
