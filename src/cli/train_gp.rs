//! `rfl train --kind gp_nmpc`: Gaussian processes on the errors of a vehicle's nonlinear model.

use super::progress::Bar;
use super::train::{followed_by, head, line};
use crate::residual::DataSet;
use crate::residual::gp::{GpConfig, GpFit, GpVehicle, train};
use serde_json::{Value, json};
use std::error::Error;
use std::path::Path;

/// Outputs of any vehicle that we know, with their units.
const HEADINGS: [&str; 3] = ["vy m/s", "r rad/s", "phi' rad/s"];

/// Trains the processes, writes them to a file and prints their fit; gives it as JSON.
///
/// # Errors
/// Too little data, or a file that cannot be written.
pub fn learn<V: GpVehicle<S, D, O>, const S: usize, const D: usize, const O: usize>(
    data: &DataSet<V, S>,
    test: Option<&DataSet<V, S>>,
    config: &GpConfig,
    file: &Path,
    bar: &Bar,
) -> Result<Value, Box<dyn Error>> {
    let trained =
        train(data, test, config, &followed_by(bar)).map_err(|error| format!("gp_nmpc: {error}"))?;
    bar.finish_and_clear();
    trained.model.write(file)?;
    let report = &trained.report;
    head(&HEADINGS[..O]);
    line("nonlinear model, training", report.train.nominal_rmse);
    line("gp_nmpc, training", report.train.rmse);
    if let Some(fit) = &report.test {
        line("nonlinear model, test", fit.nominal_rmse);
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

fn as_json<const O: usize>(fit: &GpFit<O>) -> Value {
    json!({"samples": fit.samples, "rmse": fit.rmse[..], "max": fit.max[..], "nominal_rmse": fit.nominal_rmse[..]})
}
