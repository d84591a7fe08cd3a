//! A limit of the angle's rate: modelled if it explains clearly more.
//!
//! ```text
//! x' = clamp((u(t - T) - x) / tau, +-limit)
//! ```
//!
//! Limits are tried from the greatest observed rate downwards; then the best near it is found by golden sections, each with the
//! best of the rest. What one explains is judged where it acts: a few quick steps tell it in however long a drive.

use super::best_point::BestPoint;
use super::fit::{ActuatorProblem, GRID, LEAST_NOISE, Point, ROUGH};
use super::interval::FitNoise;
use super::record::golden_section;

/// Number of rate limits that are tried, each this share of the one before, from the greatest observed rate.
const LIMITS: i32 = 12;
const LIMIT_RATIO: f64 = 0.82;
/// Golden sections of the limit on some of the rows, about the best that was tried; then of all rows within this share of it.
const ROUGH_SECTIONS: u32 = 12;
const FINE_SECTIONS: u32 = 6;
const FINE_RATIO: f64 = 0.98;
/// A rate limit must lower the error where it acts to this share of it.
const CLEARLY_BETTER: f64 = 0.7;

impl BestPoint {
    /// Finds a rate limit, if one explains the response clearly better.
    pub fn limited(self) -> Self {
        // What is exact has no limit.
        if self.rms() < 10.0 * LEAST_NOISE {
            return self;
        }
        // Rows at a limit may have passed for wrong where there was none.
        let judged_anew = self.with_all_rows();
        let begins = [Some(&self), judged_anew.as_ref()];
        let found = begins.into_iter().flatten().filter_map(Self::with_limit);
        let Some(mut other) = found.min_by(|a, b| a.rms().total_cmp(&b.rms())) else { return self };
        let mut without = self.on_rows_of(&other);
        let noise = FitNoise::of(&mut other.problem, &other.best);
        let is_more_than_chance =
            without.problem.is_worse(&without.best, &mut other.problem, &other.best, &noise);
        let errors = [&mut without, &mut other].map(|it| it.problem.counted_residuals(&it.best));
        if is_more_than_chance && is_clearly_better(&errors) { other } else { self }
    }

    /// With the limit that lowers the error most, if one lowers it clearly.
    fn with_limit(&self) -> Option<Self> {
        let mut part = self.problem.part();
        let greatest = self.problem.greatest_rate() / self.best.beta[0].abs().max(1e-9);
        let without = part.coarse(&self.best);
        let mut best = (f64::INFINITY, without);
        for k in 0..LIMITS {
            let limit = greatest * LIMIT_RATIO.powi(k);
            part.response.rate_limit = limit;
            let found = part.coarse(&self.best);
            if found.cost < best.1.cost {
                best = (limit, found);
            }
        }
        let errors = [(f64::INFINITY, without), best].map(|(limit, point)| {
            part.response.rate_limit = limit;
            part.counted_residuals(&point)
        });
        if !is_clearly_better(&errors) {
            return None;
        }
        // The limit, with the best of the rest for each: a valley leads from a wrong limit to a wrong lag.
        let most = self.best.dead_time + self.best.lag + 2.0 * GRID;
        let window = most / f64::from(ROUGH);
        let found = Self::nearest_limit(&mut part, best, LIMIT_RATIO, (ROUGH_SECTIONS, window));
        let mut other = self.clone();
        let (limit, point) =
            Self::nearest_limit(&mut other.problem, found, FINE_RATIO, (FINE_SECTIONS, 0.01));
        (other.problem.response.rate_limit, other.best) = (limit, point);
        Some(other.polished())
    }

    /// The best limit within a ratio of another, and its point with a dead time within a window of the other's.
    fn nearest_limit(
        problem: &mut ActuatorProblem,
        (near, point): (f64, Point),
        ratio: f64,
        (sections, window): (u32, f64),
    ) -> (f64, Point) {
        let of = |limit: f64| {
            problem.response.rate_limit = limit;
            (limit, problem.refine(&point, window, 2.0 * window))
        };
        golden_section(near * ratio, near / ratio, sections, of, |(_, point)| point.cost)
    }
}

/// True if errors with a limit are clearly less than those without one, in rows in which the two answers differ by more than the
/// error that is left.
fn is_clearly_better([without, with]: &[Vec<f64>; 2]) -> bool {
    let left = with.iter().map(|error| error * error).sum::<f64>() / with.len().max(1) as f64;
    let acts = without.iter().zip(with).filter(|(without, with)| (*without - *with).powi(2) > left);
    let [without, with] =
        acts.fold([0.0; 2], |[a, b], (without, with)| [a + without * without, b + with * with]);
    with < CLEARLY_BETTER * CLEARLY_BETTER * without
}
