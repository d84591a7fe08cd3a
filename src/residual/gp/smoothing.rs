//! Smoothing of recorded states before anything is learned from them.
//!
//! The state stands in the inputs *and* in the labels, so its noise biases the process. With the errors of ordinary
//! sensors it predicts twice as badly as it could. Offline, the states can be smoothed without delay; too much
//! smoothing removes the signal to be learned. The right amount depends on noise and plant, so it is measured: small
//! processes are trained at each candidate. The one with the best free prediction of the *record* over [`STEPS`] steps
//! is taken, as the controller needs it. The noise of that record is the same for all candidates and independent of
//! their inputs.

use super::dictionary::choose;
use super::fit::{FitConfig, fit};
use super::samples::Samples;
use super::sparse::Sparse;
use super::vehicle::GpVehicle;
use crate::numerics::Random;
use crate::numerics::parallel;
use crate::residual::dataset::DataSet;

/// Smoothing of the body's states: a cubic fitted to so many rows on each side.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StateSmoothing {
    /// Over this many rows; 0 and 1 for not at all.
    Fixed(usize),
    /// The candidate whose free prediction is best.
    Choose(Vec<usize>),
}

/// Steps of the free prediction: the horizon of the paper's controller.
pub const STEPS: usize = 16;
/// Smoothing of the states from which all candidates' predictions start.
const START: usize = 2;
/// Size of the small processes.
const HYPERPARAMETER_SAMPLES: usize = 250;
const POINTS: usize = 100;
const ROWS: usize = 4000;
const ITERATIONS: u64 = 30;

/// The best smoothing, and the score of each candidate: mean square error of the free prediction in units of the
/// nominal model's, mean over outputs.
pub(super) fn reach<V: GpVehicle<S, D, O>, const S: usize, const D: usize, const O: usize>(
    smoothing: &StateSmoothing,
    data: &DataSet<V, S>,
    nominal: &V::Model,
    seed: u64,
    threads: usize,
) -> (usize, Vec<(usize, f64)>) {
    let candidates = match smoothing {
        StateSmoothing::Fixed(reach) => return (*reach, vec![]),
        StateSmoothing::Choose(candidates) => candidates,
    };
    let judge = Samples::new(data, nominal, START);
    let without = judge.rollout(data, nominal, STEPS, |_| [0.0; O]);
    let scores = parallel::map(threads, candidates.len(), |c| {
        let samples = Samples::new(data, nominal, candidates[c]);
        let error = small(&samples, seed)
            .map(|outputs| {
                judge.rollout(data, nominal, STEPS, |input| std::array::from_fn(|o| outputs[o].mean(input).0))
            })
            .unwrap_or([f64::INFINITY; O]);
        let score: f64 = (0..O).map(|o| (error[o] / without[o]).powi(2)).sum();
        (candidates[c], score / O as f64)
    });
    // The first of the best; drives too short to be judged on give no numbers, and the first candidate.
    let best = scores.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    (best.or(scores.first()).map_or(0, |&(reach, _)| reach), scores)
}

/// A process of some points, made fast.
fn small<const D: usize, const O: usize>(samples: &Samples<D, O>, seed: u64) -> Option<Vec<Sparse<D>>> {
    let rows = Random::stream(seed, 2).draw(samples.inputs.len(), ROWS);
    let inputs: Vec<_> = rows.iter().map(|&row| samples.inputs[row]).collect();
    let labels: [Vec<f64>; O] =
        std::array::from_fn(|o| rows.iter().map(|&row| samples.labels[row][o]).collect());
    let few = inputs.len().min(HYPERPARAMETER_SAMPLES);
    let config = FitConfig { starts: 1, iterations: ITERATIONS, seed, threads: 1 };
    let fitted = fit(&inputs[..few], &labels.each_ref().map(|y| y[..few].to_vec()), &config, &|| ());
    let output = |o: usize| {
        let kernel = fitted[o].kernel;
        let taken = choose(&kernel, &inputs[..inputs.len().min(1000)], POINTS, 1e-8);
        Sparse::new(kernel, taken.iter().map(|&i| inputs[i]).collect(), &inputs, &labels[o], 1)
    };
    (0..O).map(output).collect()
}
