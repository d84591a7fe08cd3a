//! A limit of the angle's rate: modelled if it explains clearly more.
//!
//! ```text
//! x' = clamp((u(t - T) - x) / tau, +-limit)
//! ```
//!
//! Limits are tried from the greatest observed rate downwards, then limit and the rest are found in turn.

use super::best_point::BestPoint;
use super::fit::LEAST_NOISE;

/// Number of rate limits that are tried, each this share of the one before, from the greatest observed rate.
const LIMITS: i32 = 12;
const LIMIT_RATIO: f64 = 0.82;
/// Rounds of finding the limit and the rest in turn.
const LIMIT_ROUNDS: usize = 5;
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
        // Limit and the rest in turn.
        let (mut limit, mut ratio) = (best.0, LIMIT_RATIO);
        let mut other = self.clone();
        other.best = best.1;
        for _ in 0..LIMIT_ROUNDS {
            other.problem.response.rate_limit = limit;
            other.best = other.problem.refine(&other.best, 0.01, 0.02);
            for _ in 0..2 {
                for factor in [ratio, 1.0 / ratio] {
                    other.problem.response.rate_limit = limit * factor;
                    let found = other.problem.lag_for(other.best.dead_time, other.best.lag, 5e-3);
                    if found.cost < other.best.cost {
                        (limit, other.best) = (limit * factor, found);
                    }
                }
                ratio = ratio.sqrt();
            }
        }
        other.problem.response.rate_limit = limit;
        let other = other.polished();
        if other.rms() < CLEARLY_BETTER * least {
            self = other;
        }
        self
    }
}
