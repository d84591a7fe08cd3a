//! A limit of the angle's rate: that of the vehicle's file, if it explains more than chance does; or one that explains clearly more.
//!
//! ```text
//! x' = clamp((u(t - T) - x) / tau, +-limit)
//! ```
//!
//! Limits are tried from the greatest observed rate downwards; then the best near it is found by golden sections, each with the
//! best of the rest.

use super::best_point::BestPoint;
use super::fit::{ActuatorProblem, GRID, LEAST_NOISE, Point, ROUGH};
use super::record::golden_section;

/// Number of rate limits that are tried, each this share of the one before, from the greatest observed rate.
const LIMITS: i32 = 12;
const LIMIT_RATIO: f64 = 0.82;
/// Golden sections of the limit on some of the rows, about the best that was tried; then of all rows within this share of it.
const ROUGH_SECTIONS: u32 = 12;
const FINE_SECTIONS: u32 = 6;
const FINE_RATIO: f64 = 0.98;
/// A rate limit must lower the error to this share of it.
const CLEARLY_BETTER: f64 = 0.7;

impl BestPoint {
    /// With the rate limit that the drives show, if they show one: that of the vehicle's file, `told` in rad/s of
    /// the command and infinite for none, or one near it, or another one.
    pub fn limited(self, told: f64) -> Self {
        // What is exact has no limit.
        if self.rms() < 10.0 * LEAST_NOISE {
            return self;
        }
        self.at_told_limit(told).or_else(|| self.at_searched_limit()).unwrap_or(self)
    }

    /// With the limit of the vehicle's file. Without commands that are faster it changes nothing.
    fn at_told_limit(&self, told: f64) -> Option<Self> {
        if told.is_infinite() {
            return None;
        }
        let mut known = self.unjudged();
        known.problem.response.rate_limit = told;
        known.best = known.problem.refine(&known.best, 0.02, 0.04);
        let mut known = known.polished();
        if !known.explains_more_anywhere_than(self) {
            return None;
        }
        let mut near = known.unjudged().near_limit((told, known.best), (LIMIT_RATIO, ROUGH_SECTIONS, 0.01));
        Some(if near.explains_more_anywhere_than(&known) { near } else { known })
    }

    /// With the limit that explains most, from the greatest rate downwards, if that is clear, or more than chance.
    fn at_searched_limit(&self) -> Option<Self> {
        // Rows at a limit may stand out of a fit without one.
        let all = Some(self.unjudged()).filter(|_| self.outlying() > 0);
        let found = all.iter().chain([self]).filter_map(Self::searched);
        let mut limited = found.min_by(|a, b| a.charged().total_cmp(&b.charged()))?;
        let clear = limited.rms() < CLEARLY_BETTER * self.rms();
        (clear || limited.explains_more_anywhere_than(self)).then_some(limited)
    }

    fn searched(&self) -> Option<Self> {
        let mut part = self.problem.part();
        let greatest = self.problem.greatest_rate() / self.best.beta[0].abs().max(1e-9);
        let mut best = (f64::INFINITY, part.coarse(&self.best));
        let without = best.1;
        for k in 0..LIMITS {
            let limit = greatest * LIMIT_RATIO.powi(k);
            part.response.rate_limit = limit;
            let found = part.coarse(&self.best);
            if found.cost < best.1.cost {
                best = (limit, found);
            }
        }
        if best.0.is_infinite() || !part.may_be_better(&best.1, &without, self.problem.rows.counted()) {
            return None;
        }
        // The limit, with the best of the rest for each: a valley leads from a wrong limit to a wrong lag.
        let most = self.best.dead_time + self.best.lag + 2.0 * GRID;
        let window = most / f64::from(ROUGH);
        let found = Self::nearest_limit(&mut part, best, LIMIT_RATIO, (ROUGH_SECTIONS, window));
        Some(self.clone().near_limit(found, (FINE_RATIO, FINE_SECTIONS, 0.01)))
    }

    /// With the best limit near another one.
    fn near_limit(mut self, near: (f64, Point), (ratio, sections, window): (f64, u32, f64)) -> Self {
        let (limit, point) = Self::nearest_limit(&mut self.problem, near, ratio, (sections, window));
        (self.problem.response.rate_limit, self.best) = (limit, point);
        self.polished()
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
