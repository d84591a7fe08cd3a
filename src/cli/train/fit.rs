//! The fit of a residual model: trained, and its errors in a table and as JSON.

use super::super::progress::Bar;
use crate::nominal::LateralVehicle;
use crate::residual::{
    DataSet, FitErrors, Kind, Progress, ResidualModelFor, TrainConfig, TrainReport, train,
};
use serde_json::{Value, json};
use std::error::Error;

/// A listener that shows progress on a bar.
pub(in crate::cli) fn followed_by(bar: &Bar) -> impl Fn(Progress) + Sync {
    |progress| {
        bar.set_share(progress.done as u64, progress.total as u64);
    }
}

/// A residual with its fit.
pub(super) struct Learned<V: LateralVehicle<S>, const S: usize> {
    pub model: ResidualModelFor<V, S>,
    /// Share of the states' one-step errors that it leaves, on samples held out where there are any.
    pub left: [f64; S],
    /// The fit as JSON.
    pub said: Value,
}

/// Trains a residual and prints its fit, under a header if it is the first.
pub(super) fn learn<V: LateralVehicle<S>, const S: usize>(
    data: &DataSet<V, S>,
    test: Option<&DataSet<V, S>>,
    config: &TrainConfig,
    bar: &Bar,
    first: bool,
) -> Result<Learned<V, S>, Box<dyn Error>> {
    let kind = config.kind;
    let trained =
        train(data, test, config, &followed_by(bar)).map_err(|error| format!("{}: {error}", kind.name()))?;
    bar.finish_and_clear();
    let (schema, report) = (trained.model.schema(), &trained.report);
    show(kind, report, first);
    let said = json!({
        "kind": kind.name(),
        "window": schema.window,
        "samples": schema.training.samples,
        "global_lambda": schema.training.global_lambda,
        "leaf_lambda": schema.training.leaf_lambda,
        "determined": report.determined,
        "leaves": report.leaves,
        "smallest_leaf": report.smallest_leaf,
        "train": as_json(&report.train),
        "held_out": report.held_out.as_ref().map(as_json),
        "test": report.test.as_ref().map(as_json),
    });
    let FitErrors { rmse, nominal_rmse, .. } = report.held_out.as_ref().unwrap_or(&report.train);
    let left = std::array::from_fn(|i| if nominal_rmse[i] > 0.0 { rmse[i] / nominal_rmse[i] } else { 1.0 });
    Ok(Learned { model: trained.model, left, said })
}

/// States of any vehicle that we know, with their units.
const HEADINGS: [&str; 6] = ["e1 m", "e1' m/s", "e2 rad", "e2' rad/s", "phi rad", "phi' rad/s"];

fn right(text: &(impl AsRef<str> + ?Sized)) -> String {
    format!(" {:>10}", text.as_ref())
}

/// Head of a table of fits.
pub(in crate::cli) fn head(headings: &[&str]) {
    say!("{:<28}{}", "RMS of one step", headings.iter().map(right).collect::<String>());
}

/// A line of it.
pub(in crate::cli) fn line<const N: usize>(name: &str, values: [f64; N]) {
    say!("{name:<28}{}", values.map(|value| right(&format!("{value:.2e}"))).concat());
}

/// Prints the fit of a model, under a header if it is the first.
fn show<const S: usize>(kind: Kind, report: &TrainReport<S>, first: bool) {
    if first {
        head(&HEADINGS[..S]);
    }
    if first {
        line("nominal, training", report.train.nominal_rmse);
        if let Some(fit) = &report.test {
            line("nominal, test", fit.nominal_rmse);
        }
    }
    line(&format!("{}, training", kind.name()), report.train.rmse);
    if let Some(fit) = &report.held_out {
        line(&format!("{}, held out", kind.name()), fit.rmse);
    }
    if let Some(fit) = &report.test {
        line(&format!("{}, test", kind.name()), fit.rmse);
    }
}

fn as_json<const S: usize>(fit: &FitErrors<S>) -> Value {
    json!({
        "samples": fit.samples, "rmse": fit.rmse[..], "max": fit.max[..], "nominal_rmse": fit.nominal_rmse[..],
    })
}
