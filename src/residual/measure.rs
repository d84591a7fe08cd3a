//! One-step errors of a model, measured on samples.

use super::dataset::{DataSet, Windows};
use super::leaf;
use super::model::ResidualModelFor;
use crate::nominal::{ERRORS, LateralVehicle};
use crate::numerics::parallel;

/// Errors of one-step predictions of the states, `[e1 m, e1' m/s, e2 rad, e2' rad/s, ..]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitErrors<const S: usize = ERRORS> {
    /// Samples measured.
    pub samples: usize,
    /// Root mean square error.
    pub rmse: [f64; S],
    /// Largest magnitude.
    pub max: [f64; S],
    /// Root mean square of the label itself: the nominal model's error.
    pub nominal_rmse: [f64; S],
}

impl<V: LateralVehicle<S>, const S: usize> ResidualModelFor<V, S> {
    /// The model's one-step errors on other data, labelled for the same vehicle and sample time.
    #[must_use]
    pub fn measure(&self, data: &DataSet<V, S>) -> FitErrors<S> {
        measure(self, &data.windows(self.schema.window), parallel::threads(0))
    }
}

/// The errors on these samples.
pub(super) fn measure<V: LateralVehicle<S>, const S: usize>(
    model: &ResidualModelFor<V, S>,
    windows: &Windows<S>,
    threads: usize,
) -> FitErrors<S> {
    // Looking up wants room of its own on each thread: a chunk of samples at a time.
    let chunks = parallel::chunks(windows.len(), 2048);
    let errors = parallel::map(threads, chunks.len(), |chunk| {
        let mut features = vec![0.0; model.features()];
        let mut room = model.workspace();
        let states = S * model.schema.regressors.states;
        let error = |i| {
            windows.features(i, &mut features);
            model.coefficients(&features, &[], &mut room);
            let newest = &windows.states(i).as_flattened()[S * windows.window() - states..];
            let (label, fit) = (windows.label(i), room.residual(windows.commands(i), newest));
            std::array::from_fn(|o| label[o] - fit[o])
        };
        chunks[chunk].clone().map(error).collect::<Vec<[f64; S]>>()
    });
    let errors = errors.concat();
    fit(
        leaf::accumulate(threads, errors.len(), |i| Some(errors[i])),
        leaf::accumulate(threads, windows.len(), |i| Some(windows.label(i))),
    )
}

/// Samples, their squared errors and largest magnitudes.
pub(super) type ErrorSums<const S: usize> = (usize, [f64; S], [f64; S]);

/// Errors from their sums and those of the labels.
pub(super) fn fit<const S: usize>(
    (samples, squares, max): ErrorSums<S>,
    (labels, label_squares, _): ErrorSums<S>,
) -> FitErrors<S> {
    let root = |squares: [f64; S], n: usize| squares.map(|s| (s / n.max(1) as f64).sqrt());
    FitErrors { samples, rmse: root(squares, samples), max, nominal_rmse: root(label_squares, labels) }
}
