//! Training of a forest with constant leaves on a table that another program made.

use crate::{Outcome, median_time, read_table, write_table};
use rfl_mpc::residual::{Block, Dense, ForestConfig, Resolution, grow};
use serde_json::json;
use std::path::Path;

const COLUMNS: usize = 64;
const OUTPUTS: usize = 4;
const REPEATS: usize = 3;

/// The forest that is compared and grown: 20 trees, depth 6.
pub fn config() -> ForestConfig {
    ForestConfig {
        trees: 20,
        depth: 6,
        min_leaf: 20,
        features_per_split: 8,
        bootstrap: Some(Block(1)),
        resolution: Resolution::Histogram(255),
        seed: 1,
        threads: 2,
    }
}

/// Trains on the first `rows` rows (64 features and 4 outputs each) and predicts the `tests` rows after them.
pub fn run(table: &Path, rows: usize, tests: usize, fits: &Path) -> Outcome {
    let values = read_table(table)?;
    let wanted = (rows + tests) * (COLUMNS + OUTPUTS);
    if values.len() != wanted || rows == 0 {
        return Err(format!("{}: {} numbers, {wanted} are needed", table.display(), values.len()).into());
    }
    let mut features = Vec::with_capacity((rows + tests) * COLUMNS);
    let mut labels = Vec::with_capacity(rows + tests);
    for row in values.chunks_exact(COLUMNS + OUTPUTS) {
        features.extend(&row[..COLUMNS]);
        labels.push(std::array::from_fn::<f64, OUTPUTS, _>(|o| row[COLUMNS + o]));
    }
    let config = config();
    let columns: Vec<u16> = (0..COLUMNS as u16).collect();
    let learned = &features[..rows * COLUMNS];
    let mut grown = None;
    let seconds = median_time(REPEATS, || {
        grown = Some(grow(&Dense::new(learned, COLUMNS), &columns, &labels[..rows], &config, &|_| ()));
    });
    let grown = grown.ok_or("no forest was grown")?;

    // Each leaf predicts the mean of the rows that its tree drew.
    let forest = &grown.forest;
    let mut sums = vec![([0.0; OUTPUTS], 0.0); forest.leaves()];
    for (row, (x, y)) in learned.chunks_exact(COLUMNS).zip(&labels).enumerate() {
        forest.look_up(x, |tree, leaf| {
            let weight = f64::from(grown.in_bag[tree][row]);
            (0..OUTPUTS).for_each(|o| sums[leaf].0[o] += weight * y[o]);
            sums[leaf].1 += weight;
        });
    }
    let mut predicted = vec![0.0; tests * OUTPUTS];
    for (x, fit) in features[rows * COLUMNS..].chunks_exact(COLUMNS).zip(predicted.chunks_exact_mut(OUTPUTS))
    {
        forest.look_up(x, |_, leaf| {
            let (sum, weight) = &sums[leaf];
            fit.iter_mut().zip(sum).for_each(|(fit, sum)| *fit += sum / (weight * forest.trees() as f64));
        });
    }
    write_table(fits, &predicted)?;
    Ok(
        json!({ "train_s": seconds, "repeats": REPEATS, "trees": config.trees, "depth": config.depth, "leaves": forest.leaves() }),
    )
}
