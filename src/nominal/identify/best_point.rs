//! A problem with its best point, without rows that stand out.
//!
//! A row whose residual stands out of those beside it is wrong: errors of a model last longer,
//!
//! ```text
//! |r_k - m_k| > 8 typical ones,      m_k = median(r_{k-4} .. r_{k+4})
//! |r_k - m_k| > 8 median(|r_j - m_k|),   j = k-4 .. k+4
//! ```
//!
//! The second is Hampel's, where a vehicle's model lies between: if it misses a bend, all rows of that bend are far from
//! one another.

use super::fit::{ActuatorProblem, Point};
use super::steering_drive::LeftOut;
use crate::numerics::statistics::upper_median;

/// Number of rows on each side for the expected residual of one.
const BESIDE: usize = 4;
/// Distance of a wrong residual from those beside it, in typical distances, and as a share of all.
const OUTLYING: f64 = 8.0;
const OUTLYING_SHARE: f64 = 0.3;
/// Differences of residuals below this are rounding, rad or rad/s.
const ROUNDING: f64 = 1e-5;
/// Window of the last search, s.
const FINE: f64 = 3e-4;
/// Rounds of looking for wrong rows.
const ROUNDS: usize = 3;

/// A problem with its best point.
#[derive(Debug, Clone)]
pub(super) struct BestPoint {
    pub problem: ActuatorProblem,
    pub best: Point,
    /// Rows that count before any is judged by a fit, and values left out by then.
    given: (Vec<bool>, usize),
}

impl BestPoint {
    /// A first point, before any row is judged.
    pub fn at(problem: ActuatorProblem, best: Point) -> Self {
        let given = (problem.rows.counts.clone(), problem.rows.left_out.len());
        Self { problem, best, given }
    }

    /// The best of all, without rows that stand out.
    pub fn of(mut problem: ActuatorProblem) -> Self {
        let best = problem.search();
        Self::at(problem, best).polished()
    }

    /// Rows that stand out of the fit.
    pub fn outlying(&self) -> usize {
        self.problem.rows.left_out.len() - self.given.1
    }

    /// The squares, with as much for a row that stands out as one does at least.
    pub fn charged(&self) -> f64 {
        self.best.cost + self.outlying() as f64 * (OUTLYING * self.rms()).powi(2)
    }

    /// With all rows that were given: no fit has said anything of them.
    pub fn unjudged(&self) -> Self {
        let mut all = self.clone();
        all.forget();
        all
    }

    fn forget(&mut self) {
        self.problem.rows.counts.copy_from_slice(&self.given.0);
        self.problem.rows.left_out.truncate(self.given.1);
    }

    /// The best near the best, without rows that stand out.
    pub fn polished(mut self) -> Self {
        for round in 0..ROUNDS {
            let before = self.problem.rows.counts.clone();
            self.leave_out_outliers();
            let changed = before != self.problem.rows.counts;
            let (dead_times, lags) = if round == 0 { (0.02, 0.04) } else { (4e-3, 8e-3) };
            self.best = self.problem.refine(&self.best, dead_times, lags);
            if !changed && round > 0 {
                break;
            }
        }
        for _ in 0..ROUNDS {
            let before = self.best;
            self.best = self.problem.refine(&before, FINE, 2.0 * FINE);
            if (self.best.dead_time - before.dead_time).abs().max((self.best.lag - before.lag).abs())
                < 0.5 * FINE
            {
                break;
            }
        }
        self
    }

    /// Root of the mean squared residual of the rows that count.
    pub fn rms(&self) -> f64 {
        (self.best.cost / self.problem.rows.counted().max(1) as f64).sqrt()
    }

    /// Takes out rows whose residual stands out. All are judged anew: a rough fit is no judge for good.
    fn leave_out_outliers(&mut self) {
        let least = self.rms();
        let through_vehicle = !self.problem.response.free;
        self.problem.residuals(&self.best);
        self.forget();
        let ActuatorProblem { rows, residual, .. } = &mut self.problem;
        let stretches: Vec<_> = rows.stretches().collect();
        let mut off = vec![0.0; rows.time.len()];
        let mut beside_off = off.clone();
        for stretch in stretches {
            let counted: Vec<usize> = stretch.filter(|&row| rows.counts[row]).collect();
            for (i, &row) in counted.iter().enumerate() {
                let from = i.saturating_sub(BESIDE);
                let mut beside: Vec<f64> = counted[from..(i + BESIDE + 1).min(counted.len())]
                    .iter()
                    .map(|&row| residual[row])
                    .collect();
                let middle = upper_median(&mut beside);
                off[row] = (residual[row] - middle).abs();
                if through_vehicle {
                    beside.iter_mut().for_each(|residual| *residual = (*residual - middle).abs());
                    beside_off[row] = upper_median(&mut beside);
                }
            }
        }
        let mut typical: Vec<f64> =
            (0..off.len()).filter(|&row| rows.counts[row]).map(|row| off[row]).collect();
        let far = OUTLYING * 1.4826;
        let limit = (far * upper_median(&mut typical)).max(OUTLYING_SHARE * least).max(ROUNDING);
        for (row, off) in off.iter().enumerate() {
            let (drive, place) = rows.origin[row];
            if rows.counts[row]
                && *off > limit.max(far * beside_off[row]).max(rows.resolutions[drive as usize])
            {
                rows.counts[row] = false;
                let value = rows.response[row] + rows.mean;
                rows.left_out.push(LeftOut { drive, row: place, signal: "response", value });
            }
        }
    }
}
