//! The gap of a backlash behind the lag: without one it would pass for a long lag.
//!
//! ```text
//! y = P(x; h),     h <- h + beta_h / gain,     beta_h the factor of the column dy/dh
//! ```
//!
//! Half the gap `h` is found by Gauss-Newton steps beside dead time and lag, from several widths, since the squares have
//! more than one valley. It is taken if the squares fall by more than chance makes them.

use super::best_point::BestPoint;
use super::fit::{ActuatorProblem, LEAST_NOISE, Point};
use super::interval::{FitNoise, Inflation};

/// Number of half gaps that are tried, each this share of the one before, from half the command's range.
const GAPS: i32 = 12;
const GAP_RATIO: f64 = 0.6;
/// Number of them from which the gap is refined.
const GAP_BEGINS: usize = 3;
/// Rough steps from each.
const GAP_STEPS: usize = 5;
/// Rounds of finding the gap and the rest in turn, and change of the gap that ends them, rad and as a share.
const GAP_ROUNDS: usize = 12;
const GAP_FINE: f64 = 1e-7;
const GAP_SHARE: f64 = 1e-4;

impl BestPoint {
    /// With a gap, as far as the drives show one.
    pub fn with_gap(self) -> Self {
        self.loose(None).or(self)
    }

    /// With a gap and a rate limit, as far as the drives show them. They may show only together.
    /// `told`: the limit of the vehicle's file, as for [`limited`](Self::limited).
    pub fn with_gap_and_limit(self, told: f64) -> Self {
        let loose = self.loose(None);
        let both = loose.clone().limited(told);
        if both.problem.response.rate_limit.is_finite() {
            let known = both.problem.response.half_gap.map(|half| (half, both.best));
            let stiff = both.without_gap();
            let loose = stiff.loose(known).or(stiff);
            return if loose.problem.response.half_gap.is_some() { loose } else { self.limited(told) };
        }
        let loose = loose.or(self.clone());
        let limited = self.limited(told);
        if limited.rms() < loose.rms() { limited } else { loose }
    }

    /// This one, if its gap shows, else the other, which has none.
    fn or(mut self, stiff: Self) -> Self {
        // A gap narrower than none is none.
        if self.problem.response.half_gap.is_none_or(|half| half <= 0.0) {
            return stiff;
        }
        if self.explains_more_than(&stiff) { self } else { stiff }
    }

    /// True if it explains its rows better than another one does, by more than chance makes it.
    pub fn explains_more_than(&mut self, other: &Self) -> bool {
        self.is_ahead_of(other, FitNoise::inflation)
    }

    /// The same of what acts in a few rows: by the noise of all of them, for those few do not tell it.
    pub fn explains_more_anywhere_than(&mut self, other: &Self) -> bool {
        self.is_ahead_of(other, FitNoise::inflation_anywhere)
    }

    fn is_ahead_of(&mut self, other: &Self, inflation: Inflation) -> bool {
        // Both by the same rows.
        let mut other = other.clone();
        other.problem.rows.counts.clone_from(&self.problem.rows.counts);
        other.best = other.problem.refine(&other.best, 0.02, 0.04);
        let noise = FitNoise::of(&mut self.problem, &self.best);
        other.problem.is_worse(&other.best, &mut self.problem, &self.best, (&noise, inflation))
    }

    /// The same without a gap.
    fn without_gap(mut self) -> Self {
        self.problem.response.half_gap = None;
        self.best = self.problem.refine(&self.best, 0.02, 0.04);
        self.polished()
    }

    /// The same with its best gap; looked for from this one, too. Without one where it explains no more than chance does,
    /// as nothing does of what is exact.
    fn loose(&self, known: Option<(f64, Point)>) -> Self {
        let mut loose = self.clone();
        if self.rms() < 10.0 * LEAST_NOISE {
            return loose;
        }
        let mut part = self.problem.part();
        let stiff = part.refine(&self.best, 0.02, 0.04);
        let widest = part.rows.half_range();
        let mut begins = Vec::new();
        for half in (0..GAPS).map(|k| widest * GAP_RATIO.powi(k)).chain([0.0]) {
            part.response.half_gap = Some(half);
            begins.push((half, part.coarse(&self.best)));
        }
        begins.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
        begins.truncate(GAP_BEGINS);
        begins.extend(known);
        let begun = begins.into_iter().map(|(half, best)| {
            part.response.half_gap = Some(half);
            Self::at(part.clone(), best).gap_stepped(GAP_STEPS, |part, near| {
                let along = part.of_sum(near.dead_time + near.lag, near.lag, 0.5 * near.lag + 0.01);
                part.lag_for(along.dead_time, along.lag, 0.02)
            })
        });
        let Some(begun) = begun.min_by(|a, b| a.best.cost.total_cmp(&b.best.cost)) else { return loose };
        if !begun.problem.may_be_better(&begun.best, &stiff, self.problem.rows.counted()) {
            return loose;
        }
        loose.problem.response.half_gap = begun.problem.response.half_gap;
        loose.best = loose.problem.refine(&begun.best, 0.02, 0.04);
        loose.gap_refined().polished().gap_refined()
    }

    /// The gap and the rest in turn, to the end.
    fn gap_refined(self) -> Self {
        let mut windows = (0.01, 0.02);
        self.gap_stepped(GAP_ROUNDS, |problem, near| {
            let found = problem.refine(near, windows.0, windows.1);
            windows = (0.5 * windows.0, 0.5 * windows.1);
            found
        })
    }

    /// The gap and the rest in turn: the gap's column says how far the gap is off.
    fn gap_stepped(
        mut self,
        rounds: usize,
        mut rest: impl FnMut(&mut ActuatorProblem, &Point) -> Point,
    ) -> Self {
        let place = self.problem.response.gap_column();
        for _ in 0..rounds {
            let Some(half) = self.problem.response.half_gap else { break };
            let wider = (half + self.best.beta[place] / self.best.beta[0]).max(0.0);
            if !wider.is_finite() || (wider - half).abs() < GAP_FINE + GAP_SHARE * half {
                break;
            }
            self.problem.response.half_gap = Some(wider);
            self.best = rest(&mut self.problem, &self.best);
        }
        self
    }
}
