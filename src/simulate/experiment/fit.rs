//! Prediction errors of a learned residual: one step ahead, and a whole horizon ahead without measurements.

use crate::nominal::LateralVehicle;
use crate::residual::{DataSet, FitErrors, ResidualModelFor};
use nalgebra::SVector;
use serde::Serialize;

/// Errors of the states: `[e1 m, e1' m/s, e2 rad, e2' rad/s]`, and what a vehicle has behind them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitMetrics {
    /// Root mean square.
    pub rmse: Vec<f64>,
    /// Largest magnitude.
    pub max: Vec<f64>,
    /// Root mean square of the nominal model.
    pub nominal_rmse: Vec<f64>,
}

impl<const S: usize> From<FitErrors<S>> for FitMetrics {
    fn from(fit: FitErrors<S>) -> Self {
        Self { rmse: fit.rmse.to_vec(), max: fit.max.to_vec(), nominal_rmse: fit.nominal_rmse.to_vec() }
    }
}

/// Every so many rows a prediction begins.
const STRIDE: usize = 5;

/// Errors after `steps` steps that are predicted from a recorded state with the recorded commands and road.
#[must_use]
pub fn steps_ahead<V: LateralVehicle<S>, const S: usize>(
    model: &ResidualModelFor<V, S>,
    data: &DataSet<V, S>,
    steps: usize,
) -> FitMetrics {
    let schema = model.schema();
    let window = schema.window;
    let windows = data.windows(window);
    let (mut features, mut room) = (vec![0.0; model.features()], model.workspace());
    let mut states = vec![[0.0; S]; window + steps];
    let mut sums = [[0.0_f64; S]; 3];
    let mut count = 0_usize;
    let contiguous = |i: usize| (1..=steps).all(|j| windows.follows(i + j));
    for i in (0..windows.len().saturating_sub(steps)).step_by(STRIDE).filter(|&i| contiguous(i)) {
        states[..window].copy_from_slice(windows.states(i));
        let mut nominal = SVector::<f64, S>::from(states[window - 1]);
        for j in 0..steps {
            let (measured, next) = (newest(windows.states(i + j)), newest(windows.states(i + j + 1)));
            let [speed, ..] = windows.road(i + j);
            let Ok(a) = schema.vehicle.model_at(speed.max(schema.min_model_speed)) else {
                continue;
            };
            let a = a.discretise(schema.sample_time).a;
            // What the nominal model makes of the measured state, then of ours: it is linear.
            let from_measured = next - SVector::from(windows.label(i + j));
            let ours = SVector::from(states[window + j - 1]);
            nominal = from_measured + a * (nominal - measured);

            let (errors, road) = features.split_at_mut(S * window);
            errors.copy_from_slice(states[j..j + window].as_flattened());
            road.copy_from_slice(&windows.road(i + j));
            model.coefficients(&features, &[], &mut room);
            let known = states[window + j - schema.regressors.states..window + j].as_flattened();
            let residual = SVector::from(room.residual(windows.commands(i + j), known));
            states[window + j] = (from_measured + a * (ours - measured) + residual).into();
        }
        let truth = newest(windows.states(i + steps));
        let mine = SVector::from(states[window + steps - 1]) - truth;
        for o in 0..S {
            sums[0][o] += mine[o] * mine[o];
            sums[1][o] = sums[1][o].max(mine[o].abs());
            sums[2][o] += (nominal - truth)[o].powi(2);
        }
        count += 1;
    }
    let root = |sum: [f64; S]| sum.map(|sum| (sum / count.max(1) as f64).sqrt()).to_vec();
    FitMetrics { rmse: root(sums[0]), max: sums[1].to_vec(), nominal_rmse: root(sums[2]) }
}

fn newest<const S: usize>(states: &[[f64; S]]) -> SVector<f64, S> {
    states.last().map_or_else(SVector::zeros, |state| SVector::from(*state))
}
