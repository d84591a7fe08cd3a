//! Trees against an exhaustive search, and their look-up against a walk.

use rfl_mpc::numerics::Random;
use rfl_mpc::residual::{Block, Dense, Forest, ForestConfig, Resolution, grow};

const CONFIG: ForestConfig = ForestConfig {
    trees: 1,
    depth: 3,
    min_leaf: 4,
    features_per_split: usize::MAX,
    bootstrap: None,
    resolution: Resolution::Exact,
    seed: 1,
    threads: 1,
};

/// Values on a coarse grid, so that many are equal, and outputs that depend on some of them.
fn example(rows: usize, columns: usize, levels: u32, seed: u64) -> (Vec<f64>, Vec<[f64; 2]>) {
    let mut random = Random::new(seed);
    let values: Vec<f64> = (0..rows * columns).map(|_| f64::from(random.below(levels)) / 7.0).collect();
    let labels = values
        .chunks(columns)
        .map(|x| {
            [f64::from(x[0] > 1.0) * x[1] + 0.3 * random.uniform(), 100.0 * x[1] * x[1] + random.uniform()]
        })
        .collect();
    (values, labels)
}

/// The definition of CART, each split by trying all: mean outputs of each row's leaf.
fn brute_force(
    rows: &[usize],
    value: &dyn Fn(usize, usize) -> f64,
    columns: usize,
    labels: &[[f64; 2]],
    depth: usize,
    leaf_of: &mut [Vec<usize>],
) {
    let spread = |rows: &[usize]| -> f64 {
        (0..2)
            .map(|o| {
                let mean = rows.iter().map(|&r| labels[r][o]).sum::<f64>() / rows.len() as f64;
                rows.iter().map(|&r| (labels[r][o] - mean).powi(2)).sum::<f64>()
            })
            .sum()
    };
    let mut best = (spread(rows) * (1.0 - 1e-9), None);
    for column in 0..columns {
        for &at in rows {
            let threshold = value(at, column);
            let (left, right): (Vec<usize>, Vec<usize>) =
                rows.iter().partition(|&&r| value(r, column) <= threshold);
            if depth > 0 && left.len() >= CONFIG.min_leaf && right.len() >= CONFIG.min_leaf {
                let sum = spread(&left) + spread(&right);
                if sum < best.0 {
                    best = (sum, Some((left, right)));
                }
            }
        }
    }
    match best.1 {
        Some((left, right)) => {
            brute_force(&left, value, columns, labels, depth - 1, leaf_of);
            brute_force(&right, value, columns, labels, depth - 1, leaf_of);
        }
        None => rows.iter().for_each(|&r| leaf_of[r] = rows.to_vec()),
    }
}

fn leaf(forest: &Forest, features: &[f64]) -> usize {
    let mut found = usize::MAX;
    forest.look_up(features, |_, leaf| found = leaf);
    found
}

fn standardised(labels: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let n = labels.len() as f64;
    let moments = [0, 1].map(|o| {
        let mean = labels.iter().map(|y| y[o]).sum::<f64>() / n;
        (mean, (labels.iter().map(|y| (y[o] - mean).powi(2)).sum::<f64>() / n).sqrt())
    });
    labels.iter().map(|y| [0, 1].map(|o| (y[o] - moments[o].0) / moments[o].1)).collect()
}

#[test]
fn exact_and_binned_trees_are_those_of_an_exhaustive_search() {
    let (rows, columns) = (60, 3);
    for seed in 0..20 {
        let (values, labels) = example(rows, columns, 12, seed);
        let mut expected = vec![vec![]; rows];
        let all: Vec<usize> = (0..rows).collect();
        let value = |row: usize, column: usize| values[row * columns + column];
        brute_force(&all, &value, columns, &standardised(&labels), CONFIG.depth, &mut expected);
        for resolution in [Resolution::Exact, Resolution::Histogram(255)] {
            let table = Dense::new(&values, columns);
            let config = ForestConfig { resolution, ..CONFIG };
            let forest = grow(&table, &[0, 1, 2], &labels, &config, &|_| ()).forest;
            assert!(forest.leaves() > 3, "the example is worth a tree");
            let leaf_of: Vec<usize> = values.chunks(columns).map(|x| leaf(&forest, x)).collect();
            for row in 0..rows {
                let mates: Vec<usize> = (0..rows).filter(|&other| leaf_of[other] == leaf_of[row]).collect();
                assert_eq!(mates, expected[row], "seed {seed}, {resolution:?}, row {row}");
            }
        }
    }
}

#[test]
fn coarse_bins_cost_little() {
    let (values, labels) = example(5000, 4, 1 << 20, 3);
    let explained = |resolution| {
        let table = Dense::new(&values, 4);
        let config = ForestConfig { depth: 6, resolution, ..CONFIG };
        let forest = grow(&table, &[0, 1, 2, 3], &labels, &config, &|_| ()).forest;
        let leaf_of: Vec<usize> = values.chunks(4).map(|x| leaf(&forest, x)).collect();
        let mut sums = vec![(0.0, 0.0); forest.leaves()];
        let y = standardised(&labels);
        leaf_of.iter().zip(&y).for_each(|(&l, y)| sums[l] = (sums[l].0 + y[1], sums[l].1 + 1.0));
        leaf_of.iter().zip(&y).map(|(&l, y)| (y[1] - sums[l].0 / sums[l].1).powi(2)).sum::<f64>()
    };
    let (exact, fine, coarse) = (
        explained(Resolution::Exact),
        explained(Resolution::Histogram(255)),
        explained(Resolution::Histogram(16)),
    );
    // In units of what there is to explain, one for each row.
    assert!((fine - exact).abs() < 1e-3 * 5000.0, "{fine} against {exact}");
    assert!(coarse > fine, "bins matter: {coarse} against {fine}");
}

#[test]
fn the_look_up_is_the_walk_through_the_splits() {
    let (values, labels) = example(2000, 5, 1 << 16, 9);
    let table = Dense::new(&values, 5);
    let config =
        ForestConfig { trees: 11, depth: 5, bootstrap: Some(Block(1)), features_per_split: 2, ..CONFIG };
    let forest = grow(&table, &[0, 1, 2, 3, 4], &labels, &config, &|_| ()).forest;
    let mut ends = vec![vec![usize::MAX; 1 << 5]; 11];
    for x in values.chunks(5) {
        forest.look_up(x, |tree, leaf| {
            let splits: Vec<_> = forest.splits(tree).collect();
            let mut node = 0;
            while node < splits.len() {
                // A node that does not split: any way leads to the same leaf.
                let right = splits[node].is_some_and(|(f, t)| x[usize::from(f)] > t);
                node = 2 * node + 1 + usize::from(right);
            }
            let end = &mut ends[tree][node - splits.len()];
            assert!(*end == usize::MAX || *end == leaf, "one end, one leaf");
            *end = leaf;
        });
    }
}

#[test]
fn features_that_are_not_numbers_find_a_leaf() {
    let (values, labels) = example(200, 3, 30, 5);
    let table = Dense::new(&values, 3);
    let forest = grow(&table, &[0, 1, 2], &labels, &CONFIG, &|_| ()).forest;
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(leaf(&forest, &[x; 3]) < forest.leaves());
    }
}

#[test]
fn constant_data_give_one_leaf() {
    let forest = grow(&Dense::new(&[1.0; 300], 3), &[0, 1, 2], &[[2.0, 3.0]; 100], &CONFIG, &|_| ()).forest;
    assert_eq!(forest.leaves(), 1);
    let values: Vec<f64> = (0..100).map(f64::from).collect();
    let forest = grow(&Dense::new(&values, 1), &[0], &[[2.0, 3.0]; 100], &CONFIG, &|_| ()).forest;
    assert_eq!(forest.leaves(), 1, "equal outputs are no reason to split");
}

#[test]
fn no_leaf_is_smaller_than_allowed() {
    let (values, labels) = example(500, 3, 1 << 16, 5);
    let config = ForestConfig { depth: 8, min_leaf: 30, ..CONFIG };
    let forest = grow(&Dense::new(&values, 3), &[0, 1, 2], &labels, &config, &|_| ()).forest;
    let mut count = vec![0; forest.leaves()];
    values.chunks(3).for_each(|x| count[leaf(&forest, x)] += 1);
    assert!(forest.leaves() > 5 && count.iter().all(|&c| c >= 30), "{count:?}");
}
