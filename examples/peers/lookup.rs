//! A residual's coefficients for a horizon of 60 rows: leaves found, their linear models averaged.

use crate::learned::collect;
use crate::{Outcome, median_time, write_table};
use rfl_mpc::residual::{Kind, TrainConfig, train};
use serde_json::json;
use std::hint::black_box;

/// Seconds of driving that are learned from.
const COLLECTED: f64 = 400.0;
/// Rows that a horizon asks for.
const ROWS: usize = 60;
const REPEATS: usize = 2001;

/// Drives a car with a slow actuator, trains RFL (T = 20, depth 6, W = 16) and times it. Writes the features and labels
/// of the training, for another program's forest; its last 60 rows are those that are looked up.
pub fn run(features_file: &std::path::Path, labels_file: &std::path::Path) -> Outcome {
    let data = collect(COLLECTED)?;
    let config = TrainConfig { window: 16, threads: 2, ..TrainConfig::new(Kind::Rfl) };
    let model = train(&data, None, &config, &|_| ())?.model;

    let windows = data.windows(config.window);
    let (mut table, mut labels) = (vec![0.0; windows.len() * model.features()], vec![]);
    for (sample, row) in table.chunks_exact_mut(model.features()).enumerate() {
        windows.features(sample, row);
        labels.extend(windows.label(sample));
    }
    write_table(features_file, &table)?;
    write_table(labels_file, &labels)?;

    let first = windows.len() - ROWS;
    let rows: Vec<&[f64]> = table.chunks_exact(model.features()).skip(first).collect();
    // One room for all rows, as the controller has it: it keeps the leaves of the row before.
    let mut room = model.workspace();
    let seconds = median_time(REPEATS, || {
        for (j, row) in rows.iter().enumerate() {
            model.coefficients(black_box(row), windows.commands(first + j), &mut room);
            black_box(&room);
        }
    });
    let regressors = room.command().len() + 1;
    Ok(json!({
        "lookup_s": seconds, "rows": ROWS, "features": model.features(), "samples": windows.len(),
        "trees": model.forest().trees(), "depth": config.depth, "min_leaf": config.min_leaf,
        "features_per_split": config.features_per_split, "tree_features": 4 * config.window,
        "leaves": model.forest().leaves(), "regressors": regressors,
    }))
}
