//! How well a learned residual predicts: one step ahead, and a whole horizon ahead without looking.

use crate::nominal::{ContinuousErrorModel, ErrorState};
use crate::residual::{DataSet, Fit, OUTPUTS, ResidualModel};
use serde::Serialize;

/// Errors of `[e1 m, e1' m/s, e2 rad, e2' rad/s]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FitMetrics {
    /// Root mean square.
    pub rmse: [f64; OUTPUTS],
    /// Largest magnitude.
    pub max: [f64; OUTPUTS],
    /// Root mean square of the nominal model.
    pub nominal_rmse: [f64; OUTPUTS],
}

impl From<Fit> for FitMetrics {
    fn from(fit: Fit) -> Self {
        Self { rmse: fit.rmse, max: fit.max, nominal_rmse: fit.nominal_rmse }
    }
}

/// Every so many rows a prediction begins.
const STRIDE: usize = 5;

/// Errors after `steps` steps that are predicted from a recorded state with the recorded commands and road.
#[must_use]
pub fn steps_ahead(model: &ResidualModel, data: &DataSet, steps: usize) -> FitMetrics {
    let schema = model.schema();
    let window = schema.window;
    let windows = data.windows(window);
    let (mut features, mut room) = (vec![0.0; model.features()], model.room());
    let mut states = vec![[0.0; OUTPUTS]; window + steps];
    let mut sums = [[0.0_f64; OUTPUTS]; 3];
    let mut count = 0_usize;
    let contiguous = |i: usize| (1..=steps).all(|j| windows.follows(i + j));
    for i in (0..windows.len().saturating_sub(steps)).step_by(STRIDE).filter(|&i| contiguous(i)) {
        states[..window].copy_from_slice(windows.states(i));
        let mut nominal = ErrorState::from(states[window - 1]);
        for j in 0..steps {
            let (measured, next) = (newest(windows.states(i + j)), newest(windows.states(i + j + 1)));
            let [speed, ..] = windows.road(i + j);
            let Ok(a) = ContinuousErrorModel::new(&schema.vehicle, speed.max(schema.min_model_speed)) else {
                continue;
            };
            let a = a.discretise(schema.sample_time).a;
            // What the nominal model makes of the measured state, then of ours: it is linear.
            let from_measured = next - ErrorState::from(windows.label(i + j));
            let ours = ErrorState::from(states[window + j - 1]);
            nominal = from_measured + a * (nominal - measured);

            let (errors, road) = features.split_at_mut(OUTPUTS * window);
            errors.copy_from_slice(states[j..j + window].as_flattened());
            road.copy_from_slice(&windows.road(i + j));
            model.coefficients(&features, &[], &mut room);
            let known = states[window + j - schema.regressors.states..window + j].as_flattened();
            let residual = ErrorState::from(room.residual(windows.commands(i + j), known));
            states[window + j] = (from_measured + a * (ours - measured) + residual).into();
        }
        let truth = newest(windows.states(i + steps));
        let mine = ErrorState::from(states[window + steps - 1]) - truth;
        for o in 0..OUTPUTS {
            sums[0][o] += mine[o] * mine[o];
            sums[1][o] = sums[1][o].max(mine[o].abs());
            sums[2][o] += (nominal - truth)[o].powi(2);
        }
        count += 1;
    }
    let root = |sum: [f64; OUTPUTS]| sum.map(|sum| (sum / count.max(1) as f64).sqrt());
    FitMetrics { rmse: root(sums[0]), max: sums[1], nominal_rmse: root(sums[2]) }
}

fn newest(states: &[[f64; OUTPUTS]]) -> ErrorState {
    states.last().map_or_else(ErrorState::zeros, |state| ErrorState::from(*state))
}
