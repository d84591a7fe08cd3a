//! Hyperparameters of the maximum likelihood.
//!
//! `log p(y|X)` of [`Exact`] on some hundred samples is maximised by L-BFGS with analytic gradients, from several
//! starts. Variables are the logarithms of length scales, signal and noise. Inputs and labels are standardised before,
//! so that one set of starts and bounds serves all data. The bounds limit a flat likelihood (an input without effect);
//! they are met smoothly,
//!
//! ```text
//! log theta = c + h tanh((p - c) / h)        c: middle of the bounds, h: half their width
//! ```
//!
//! Labels are divided by their root mean square and not centred. Far from all data, the mean of the process is zero,
//! and that must mean the nominal model.

use super::exact::Exact;
use super::kernel::Kernel;
use crate::numerics::Random;
use crate::numerics::parallel;
use argmin::core::{CostFunction, Error, Executor, Gradient};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use std::cell::RefCell;

/// Settings of the search for hyperparameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitConfig {
    /// Starts of the search; the first is always the same, the others are random.
    pub starts: usize,
    /// Most iterations of L-BFGS from each start.
    pub iterations: u64,
    /// Seed of the starts.
    pub seed: u64,
    /// Threads; the result does not depend on it.
    pub threads: usize,
}

/// Result of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fitted<const D: usize> {
    /// The hyperparameters, in the units of inputs and labels.
    pub kernel: Kernel<D>,
    /// Logarithm of the probability density of the labels divided by their root mean square.
    pub log_likelihood: f64,
    /// Evaluations of the likelihood, over all starts.
    pub evaluations: usize,
}

/// Bounds of length scales in standard deviations of the input.
const LENGTHS: [f64; 2] = [0.03, 300.0];
/// Bounds of the signal in root mean squares of the label.
const SIGNAL: [f64; 2] = [0.01, 100.0];
/// Bounds of the noise in the same unit.
const NOISE: [f64; 2] = [1e-4, 3.0];

/// Corrections that L-BFGS keeps: as many as there are unknowns, or more.
const MEMORY: usize = 8;
/// Change of the mean log likelihood of a sample below which the search ends.
const TOLERANCE: f64 = 1e-7;

/// Searches the hyperparameters of one output or of several, on the same inputs. `labels[o]` are those of output `o`;
/// `done` is called after each start of each output.
///
/// # Panics
/// If there is not one label for each input: a mistake of the calling code.
pub fn fit<const D: usize>(
    inputs: &[[f64; D]],
    labels: &[Vec<f64>],
    config: &FitConfig,
    done: &(dyn Fn() + Sync),
) -> Vec<Fitted<D>> {
    let scales: [f64; D] = std::array::from_fn(|d| spread(inputs.iter().map(|x| x[d])));
    let standard: Vec<[f64; D]> = inputs.iter().map(|x| std::array::from_fn(|d| x[d] / scales[d])).collect();
    let label_scales: Vec<f64> = labels.iter().map(|y| root_mean_square(y)).collect();
    let scaled = |o: usize| -> Vec<f64> { labels[o].iter().map(|y| y / label_scales[o]).collect() };
    let scaled: Vec<Vec<f64>> = (0..labels.len()).map(scaled).collect();
    let searches = parallel::map(config.threads, labels.len() * config.starts, |piece| {
        let (o, start) = (piece / config.starts, piece % config.starts);
        let found = search(&standard, &scaled[o], start_at::<D>(start, config.seed), config.iterations);
        done();
        found
    });
    searches
        .chunks(config.starts)
        .zip(&label_scales)
        .map(|(starts, label_scale)| {
            // The first of the best.
            let best = starts.iter().rev().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
            let mut found = best.copied().unwrap_or_else(|| Fitted {
                kernel: kernel(&to_search::<D>([0.0; D], 0.0, 0.0)),
                log_likelihood: f64::NEG_INFINITY,
                evaluations: 0,
            });
            found.evaluations = starts.iter().map(|start| start.evaluations).sum();
            found.kernel.signal *= label_scale;
            found.kernel.noise *= label_scale;
            (0..D).for_each(|d| found.kernel.length_scales[d] *= scales[d]);
            found
        })
        .collect()
}

/// Standard deviation; 1 for a column that never changes, whose length scale then means nothing.
fn spread(column: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = column.clone().count().max(1) as f64;
    let mean = column.clone().sum::<f64>() / n;
    let deviation = (column.map(|x| (x - mean) * (x - mean)).sum::<f64>() / n).sqrt();
    if deviation > 1e-12 * mean.abs() { deviation } else { 1.0 }
}

fn root_mean_square(values: &[f64]) -> f64 {
    let rms = (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt();
    if rms > 0.0 { rms } else { 1.0 }
}

/// Unknowns of the search: length scales, signal, noise.
fn start_at<const D: usize>(start: usize, seed: u64) -> Vec<f64> {
    if start == 0 {
        return to_search([2.0_f64.ln(); D], 0.0, 0.3_f64.ln());
    }
    let mut random = Random::stream(seed, start as u64);
    let mut between = |low: f64, high: f64| low.ln() + random.uniform() * (high / low).ln();
    let lengths = std::array::from_fn(|_| between(0.5, 20.0));
    let signal = between(0.5, 3.0);
    to_search::<D>(lengths, signal, between(0.03, 1.0))
}

/// Middle and half width of the logarithms of bounds.
fn middle([low, high]: [f64; 2]) -> (f64, f64) {
    (0.5 * (low * high).ln(), 0.5 * (high / low).ln())
}

fn bounds(unknown: usize, inputs: usize) -> (f64, f64) {
    middle(match unknown.checked_sub(inputs) {
        None => LENGTHS,
        Some(0) => SIGNAL,
        Some(_) => NOISE,
    })
}

/// Logarithms of hyperparameters as the unknowns of the search.
fn to_search<const D: usize>(lengths: [f64; D], signal: f64, noise: f64) -> Vec<f64> {
    let logarithms = lengths.into_iter().chain([signal, noise]);
    let unknown = |(i, value): (usize, f64)| {
        let (c, h) = bounds(i, D);
        c + h * ((value - c) / h).clamp(-0.99, 0.99).atanh()
    };
    logarithms.enumerate().map(unknown).collect()
}

/// The hyperparameters at unknowns of the search.
fn kernel<const D: usize>(unknowns: &[f64]) -> Kernel<D> {
    let value = |i: usize| {
        let (c, h) = bounds(i, D);
        (c + h * ((unknowns[i] - c) / h).tanh()).exp()
    };
    Kernel { length_scales: std::array::from_fn(value), signal: value(D), noise: value(D + 1) }
}

/// Negative log likelihood of a sample, the mean over all, and its derivatives.
struct LikelihoodProblem<'a, const D: usize> {
    inputs: &'a [[f64; D]],
    labels: &'a [f64],
    seen: &'a RefCell<Seen>,
}

/// The last evaluation (cost and gradient are asked for one after the other), and the best of all.
#[derive(Default)]
struct Seen {
    last: Option<(Vec<f64>, f64, Vec<f64>)>,
    best: Option<(Vec<f64>, f64)>,
    evaluations: usize,
}

/// Cost of an impossible evaluation: finite, so that the line search can go on.
const IMPOSSIBLE: f64 = 1e6;

impl<const D: usize> LikelihoodProblem<'_, D> {
    fn evaluate(&self, unknowns: &[f64]) -> (f64, Vec<f64>) {
        if let Some((at, cost, gradient)) = &self.seen.borrow().last
            && at == unknowns
        {
            return (*cost, gradient.clone());
        }
        let n = self.labels.len().max(1) as f64;
        let (cost, gradient) = match Exact::new(kernel::<D>(unknowns), self.inputs, self.labels) {
            Some(exact) => {
                let by = exact.gradient();
                let by = by.length_scales.into_iter().chain([by.signal, by.noise]);
                let slope = |(i, by): (usize, f64)| {
                    let (c, h) = bounds(i, D);
                    let tanh = ((unknowns[i] - c) / h).tanh();
                    -by / n * (1.0 - tanh * tanh)
                };
                (-exact.log_likelihood() / n, by.enumerate().map(slope).collect())
            }
            None => (IMPOSSIBLE, vec![0.0; unknowns.len()]),
        };
        let mut seen = self.seen.borrow_mut();
        seen.evaluations += 1;
        if seen.best.as_ref().is_none_or(|(_, best)| cost < *best) {
            seen.best = Some((unknowns.to_vec(), cost));
        }
        seen.last = Some((unknowns.to_vec(), cost, gradient.clone()));
        (cost, gradient)
    }
}

impl<const D: usize> CostFunction for LikelihoodProblem<'_, D> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, unknowns: &Vec<f64>) -> Result<f64, Error> {
        Ok(self.evaluate(unknowns).0)
    }
}

impl<const D: usize> Gradient for LikelihoodProblem<'_, D> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, unknowns: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.evaluate(unknowns).1)
    }
}

/// The search from one start, in the units of its input.
fn search<const D: usize>(
    inputs: &[[f64; D]],
    labels: &[f64],
    start: Vec<f64>,
    iterations: u64,
) -> Fitted<D> {
    let seen = RefCell::new(Seen::default());
    let run = || -> Result<(), Error> {
        let solver = LBFGS::new(MoreThuenteLineSearch::new(), MEMORY)
            .with_tolerance_grad(1e-5)?
            .with_tolerance_cost(TOLERANCE)?;
        let problem = LikelihoodProblem { inputs, labels, seen: &seen };
        Executor::new(problem, solver)
            .configure(|state| state.param(start.clone()).max_iters(iterations))
            .timer(false)
            .run()?;
        Ok(())
    };
    // A line search that finds no better point ends the search with an error: the best point seen is the result.
    let _ended_early = run();
    let Seen { best, evaluations, .. } = seen.into_inner();
    let (unknowns, cost) = best.unwrap_or((start, IMPOSSIBLE));
    Fitted { kernel: kernel(&unknowns), log_likelihood: -cost * labels.len() as f64, evaluations }
}
