//! A limit of the angle's rate: modelled if it explains clearly more.
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
    /// Finds a rate limit, if one explains the response clearly better.
    pub fn limited(mut self) -> Self {
        // What is exact has no limit.
        if self.rms() < 10.0 * LEAST_NOISE {
            return self;
        }
        let least = self.rms();
        let mut part = self.problem.part();
        let greatest = self.problem.greatest_rate() / self.best.beta[0].abs().max(1e-9);
        let mut best = (f64::INFINITY, part.coarse(&self.best));
        let without = best.1.cost;
        for k in 0..LIMITS {
            let limit = greatest * LIMIT_RATIO.powi(k);
            part.response.rate_limit = limit;
            let found = part.coarse(&self.best);
            if found.cost < best.1.cost {
                best = (limit, found);
            }
        }
        let clear = CLEARLY_BETTER * CLEARLY_BETTER * without;
        if best.1.cost.is_nan() || best.1.cost >= clear {
            return self;
        }
        // The limit, with the best of the rest for each: a valley leads from a wrong limit to a wrong lag.
        let most = self.best.dead_time + self.best.lag + 2.0 * GRID;
        let window = most / f64::from(ROUGH);
        let found = Self::nearest_limit(&mut part, best, LIMIT_RATIO, (ROUGH_SECTIONS, window));
        let mut other = self.clone();
        let (limit, point) =
            Self::nearest_limit(&mut other.problem, found, FINE_RATIO, (FINE_SECTIONS, 0.01));
        (other.problem.response.rate_limit, other.best) = (limit, point);
        let other = other.polished();
        if other.rms() < CLEARLY_BETTER * least {
            self = other;
        }
        self
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
