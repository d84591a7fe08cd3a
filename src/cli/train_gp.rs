//! `rfl train --kind gp_nmpc`: Gaussian processes on what the nonlinear bicycle misses.

use super::train::{followed_by, make_folder_of};
use crate::residual::DataSet;
use crate::residual::gp::{GpConfig, GpFit, train};
use indicatif::ProgressBar;
use serde_json::{Value, json};
use std::error::Error;
use std::path::Path;

/// Trains the processes, writes them to a file and prints their fit; gives it as JSON.
///
/// # Errors
/// Too little data, or a file that cannot be written.
pub fn learn(
    data: &DataSet,
    test: Option<&DataSet>,
    config: &GpConfig,
    file: &Path,
    bar: &ProgressBar,
) -> Result<Value, Box<dyn Error>> {
    let trained =
        train(data, test, config, &followed_by(bar)).map_err(|error| format!("gp_nmpc: {error}"))?;
    bar.finish_and_clear();
    make_folder_of(file)?;
    trained.model.write(file)?;
    let report = &trained.report;
    say!("{:<28} {:>10} {:>10}", "RMS of one step", "vy m/s", "r rad/s");
    let line = |name: &str, [vy, r]: [f64; 2]| say!("{name:<28} {vy:>10.2e} {r:>10.2e}");
    line("nominal bicycle, training", report.train.nominal_rmse);
    line("gp_nmpc, training", report.train.rmse);
    if let Some(fit) = &report.test {
        line("nominal bicycle, test", fit.nominal_rmse);
        line("gp_nmpc, test", fit.rmse);
    }
    Ok(json!({
        "kind": "gp_nmpc",
        "file": file.display().to_string(),
        "samples": report.train.samples,
        "train": as_json(&report.train),
        "test": report.test.as_ref().map(as_json),
    }))
}

fn as_json(fit: &GpFit) -> Value {
    json!({"samples": fit.samples, "rmse": fit.rmse, "max": fit.max, "nominal_rmse": fit.nominal_rmse})
}
