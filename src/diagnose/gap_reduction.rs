//! Reduction of the gap on parts of the log that the fit has not seen.
//!
//! Blocks of 8 s belong in turn to two halves; a fit on one is tried on the other. The ceiling of all learning is the
//! part of the rest that a model learned from past commands removes. The model is a ridge regression on lagged
//! steering, by speed.

use super::calibration::Calibration;
use super::fit::{Fit, Linearisation, Prior, fit};
use super::problem::{Problem, rms};
use super::rank::Ranking;
use super::replay::{Channel, ReplayVehicle, Trace};
use super::report::{Gap, GapReduction};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Length of a block, s.
const BLOCK: f64 = 8.0;
/// Lags of the ridge, samples of 10 Hz; its penalty as a share of the mean diagonal.
const LAGS: [usize; 6] = [0, 1, 2, 4, 7, 12];
const RIDGE: f64 = 1e-3;
/// Steps of a recalibration.
const STEPS: usize = 3;
/// Horizons, s.
const HORIZONS: [f64; 3] = [0.5, 1.0, 2.0];

/// The half that a compared row belongs to.
fn half<V: ReplayVehicle>(problem: &Problem<V>, k: usize) -> usize {
    let row = problem.rows[k];
    ((problem.drive.time[row] - problem.drive.time[0]) / BLOCK) as usize % 2
}

/// The weights of one half.
fn of_half<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    slopes: &[Arc<Vec<f64>>],
    which: usize,
) -> Linearisation {
    let is_other = |i: usize| {
        let block = problem.blocks.iter().find(|(_, block)| block.contains(&i));
        block.is_some_and(|(_, block)| half(problem, i - block.start) != which)
    };
    Linearisation::new(slopes.to_vec(), Arc::new(ranking.linear.weights.without(is_other)))
}

/// Coordinates of the winner fitted on one half: all, and the effect alone.
fn fitted_on<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    winner: &Fit,
    local: &Linearisation,
) -> (Vec<f64>, Vec<f64>) {
    let precision = ranking.prior.free(problem, &winner.free);
    let step = ranking.prior.step(local, &winner.x, &winner.gap, &precision);
    let at = |length: f64| -> Vec<f64> {
        let moved = winner.x.iter().zip(&step.change).map(|(x, change)| x + length * change);
        moved.enumerate().map(|(i, x)| problem.uncertain[i].within(x, winner.free.contains(&i))).collect()
    };
    let cost = |x: &[f64]| {
        let gap = problem.residual(x)?;
        Some(local.square(&gap) + precision.penalty(&ranking.prior.off(x)))
    };
    // A linear step that makes it worse is too long.
    let before = cost(&winner.x).unwrap_or(f64::INFINITY);
    let all = [1.0, 0.4, 0.16]
        .map(at)
        .into_iter()
        .find(|x| cost(x).is_some_and(|cost| cost < before))
        .unwrap_or_else(|| winner.x.clone());
    let simulator = recalibrated(problem, &ranking.prior, local, &winner.free, &all);
    (ranking.prior.only(problem, &winner.free, &all), simulator)
}

/// Coordinates of a simulator without some effects, fitted on one half. The effects are held at what is expected: a large one
/// stretches its own tolerance too, and a simulator that has it so predicts as well as one that names it.
fn without_on<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    effects: &[usize],
    local: &Linearisation,
) -> Vec<f64> {
    let start = ranking.prior.without(problem, effects, &ranking.none.x);
    recalibrated(problem, &ranking.prior, local, effects, &start)
}

/// The simulator for coordinates, without the errors of its form, which no simulator can be given. Their explanation
/// goes to the tolerances as far as these allow it, and the effects keep their values.
#[must_use]
pub fn recalibrated<V: ReplayVehicle>(
    problem: &Problem<V>,
    prior: &Prior,
    linear: &Linearisation,
    free: &[usize],
    x: &[f64],
) -> Vec<f64> {
    let mut start = x.to_vec();
    let forms = (0..x.len()).filter(|&i| problem.uncertain[i].is_form());
    let mut held = problem.with_companions(free);
    for i in forms {
        start[i] = 0.0;
        held.push(i);
    }
    let prior = prior.holding(&held, &start);
    fit(problem, &prior, linear, &[], &start, STEPS).map_or(start, |fit| fit.x)
}

/// Prediction of held-out parts by the fits: weighted squares of the held-out gap.
#[derive(Debug, Clone, Copy, Default)]
pub struct Predictive {
    /// Of the simulator as given.
    given: f64,
    /// With the effects alone, and recalibrated besides.
    effect: f64,
    recalibrated: f64,
    /// Recalibrated without the effects.
    without: f64,
}

impl Predictive {
    /// What a prediction gains by the effects, as evidence: by them alone over the simulator as given; or, with all else
    /// within tolerance, over all that without them.
    fn gained(&self) -> f64 {
        (self.given - self.effect).max(self.without - self.recalibrated)
    }

    /// True if so many effects predict: they gain what makes them more probable than nothing. Chance alone gains
    /// something every other time. The difference of two held-out log scores is a logarithm of a Bayes factor (Geisser
    /// and Eddy, J. Am. Stat. Assoc. 74, 1979).
    #[must_use]
    pub fn names(&self, effects: usize) -> bool {
        self.gained() > Calibration::built_in().telling() * effects as f64
    }

    /// True if a recalibration besides the effects predicts better than they alone.
    #[must_use]
    pub fn recalibration_gains(&self) -> bool {
        self.recalibrated < self.effect
    }
}

/// Shrinkage of the winner, and its prediction; without free effects the effect's part is none.
#[must_use]
pub fn gap_reduction<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    winner: &Fit,
    slopes: &[Arc<Vec<f64>>],
) -> (GapReduction, Predictive) {
    let mut effect = vec![0.0; ranking.neutral.len()];
    let (mut whole, mut without) = (effect.clone(), effect.clone());
    let mut points = Vec::new();
    for which in 0..2 {
        let (alone, all) = fitted_on(problem, ranking, winner, &of_half(problem, ranking, slopes, which));
        let of_none = if winner.free.is_empty() {
            all.clone()
        } else {
            let local = of_half(problem, ranking, &ranking.linear.slopes, which);
            without_on(problem, ranking, &winner.free, &local)
        };
        for (x, into) in [(&alone, &mut effect), (&all, &mut whole), (&of_none, &mut without)] {
            let Some(gap) = problem.residual(x) else { continue };
            for (_, block) in &problem.blocks {
                for (k, i) in block.clone().enumerate() {
                    if half(problem, k) != which {
                        into[i] = gap[i];
                    }
                }
            }
        }
        points.push((alone, all));
    }
    let mut reduction = GapReduction::default();
    let features = features(problem);
    for ((channel, block), &noise) in problem.blocks.iter().zip(&ranking.noise.white) {
        let part = |gap: &[f64]| rms(&gap[block.clone()]);
        let rest = learnable(problem, &features, &whole[block.clone()]);
        let gap = Gap {
            before: part(&ranking.neutral),
            effect: part(&effect),
            recalibrated: part(&whole),
            learnable: Some(rest.min(part(&whole))),
            noise,
        };
        reduction.open_loop.insert(channel.name().to_owned(), gap);
    }
    for horizon in HORIZONS {
        reduction.horizons.insert(format!("{horizon}"), at_horizon(problem, ranking, &points, horizon));
    }
    let [given, effect, recalibrated, without] =
        [&ranking.neutral, &effect, &whole, &without].map(|gap| ranking.linear.square(gap));
    let predictive = Predictive { given, effect, recalibrated, without };
    (reduction, predictive)
}

/// Lagged steering by speed for each compared row.
fn features<V: ReplayVehicle>(problem: &Problem<V>) -> Vec<Vec<f64>> {
    let drive = problem.drive;
    let vx = drive.column("vx");
    let every = problem.filter.every;
    problem
        .rows
        .iter()
        .map(|&row| {
            let v = vx[row] / 15.0;
            let mut all = vec![1.0, v, drive.accel[row]];
            for lag in LAGS {
                let steer = drive.steer[row.saturating_sub(lag * every)];
                all.extend([steer, steer * v, steer * v * v]);
            }
            all
        })
        .collect()
}

/// Remainder of a gap on one half after a ridge regression learned on the other, RMS.
fn learnable<V: ReplayVehicle>(problem: &Problem<V>, features: &[Vec<f64>], gap: &[f64]) -> f64 {
    let count = features.first().map_or(0, Vec::len);
    let mut left = gap.to_vec();
    for which in 0..2 {
        let mut gram = DMatrix::<f64>::zeros(count, count);
        let mut right = DVector::<f64>::zeros(count);
        for (k, feature) in features.iter().enumerate().filter(|(k, _)| half(problem, *k) == which) {
            for i in 0..count {
                right[i] += feature[i] * gap[k];
                for j in 0..=i {
                    gram[(i, j)] += feature[i] * feature[j];
                }
            }
        }
        for i in 0..count {
            for j in 0..i {
                gram[(j, i)] = gram[(i, j)];
            }
        }
        for i in 0..count {
            gram[(i, i)] = gram[(i, i)] * (1.0 + RIDGE) + 1e-9;
        }
        let Some(solution) = gram.cholesky().map(|c| c.solve(&right)) else { continue };
        for (k, feature) in features.iter().enumerate().filter(|(k, _)| half(problem, *k) != which) {
            left[k] -= feature.iter().zip(solution.iter()).map(|(a, b)| a * b).sum::<f64>();
        }
    }
    rms(&left)
}

/// Gaps at the end of a horizon, the simulator started from the log each time.
fn at_horizon<V: ReplayVehicle>(
    problem: &Problem<V>,
    ranking: &Ranking,
    points: &[(Vec<f64>, Vec<f64>)],
    horizon: f64,
) -> BTreeMap<String, Gap> {
    let drive = problem.drive;
    let rows = (horizon / drive.step).round().max(2.0) as usize;
    let run = |x: &[f64]| problem.trace_anew(x, rows);
    let neutral = run(&ranking.prior.mean);
    let others: Vec<[Option<Trace>; 2]> = points.iter().map(|(alone, all)| [run(alone), run(all)]).collect();
    let mut gaps = BTreeMap::new();
    for ((channel, _), &noise) in problem.blocks.iter().zip(&ranking.noise.white) {
        if *channel == Channel::Steer {
            continue;
        }
        let logged = drive.column(channel.name());
        let mut ends = Vec::new();
        for &(from, to) in &drive.stretches {
            ends.extend(
                (from + 2 * rows - 1..to)
                    .step_by(rows)
                    .filter(|&row| drive.scored[row + 1 - rows] && drive.scored[row]),
            );
        }
        let of = |trace: &dyn Fn(usize) -> Option<f64>| {
            let all: Vec<f64> = ends.iter().filter_map(|&row| trace(row)).collect();
            rms(&all)
        };
        let gap = |trace: &Option<Trace>, row: usize| {
            let value = trace.as_ref()?.column(*channel)[row];
            Some(if channel.leaks() { -value } else { logged[row] - value })
        };
        // What was fitted on one half is tried on the other.
        let which = |row: usize| 1 - ((drive.time[row] - drive.time[0]) / BLOCK) as usize % 2;
        let before = of(&|row| gap(&neutral, row));
        let effect = of(&|row| gap(&others.get(which(row))?[0], row));
        let recalibrated = of(&|row| gap(&others.get(which(row))?[1], row));
        let sample = noise / problem.filter.gain();
        gaps.insert(
            channel.name().to_owned(),
            Gap { before, effect, recalibrated, learnable: None, noise: sample },
        );
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::{Calibration, Predictive};

    #[test]
    fn effects_that_predict_hardly_better_than_without_them_are_not_named() {
        let telling = Calibration::built_in().telling();
        let (much, little) = (1.1 * telling, 0.9 * telling);
        // Gains of the effects alone over the simulator as given, and of all over all without them.
        for (alone, beside, of_one, of_two) in [
            (much, much, true, false),
            (2.0 * much, -9.0, true, true),
            (-90.0, 2.0 * much, true, true),
            (much, -9.0, true, false),
            (little, little, false, false),
            (-90.0, 0.8, false, false),
            (-90.0, -9.0, false, false),
        ] {
            let (given, without) = (900.0, 800.0);
            let found = Predictive { given, effect: given - alone, recalibrated: without - beside, without };
            assert_eq!((found.names(1), found.names(2)), (of_one, of_two), "{found:?}");
        }
    }

    #[test]
    fn a_recalibration_gains_where_it_predicts_better_than_the_effects_alone() {
        for (effect, recalibrated, gains) in [(4.0, 3.0, true), (4.0, 5.0, false), (4.0, 4.0, false)] {
            let found = Predictive { given: 9.0, effect, recalibrated, without: 8.0 };
            assert_eq!(found.recalibration_gains(), gains, "{found:?}");
        }
    }
}
