//! Confidence intervals from the profile of the squares.
//!
//! ```text
//! { theta : (S_profile(theta) - S_min) / sigma^2 <= c chi2 }          c = sum_l w_l cov(v_k r_k, v_{k-l} r_{k-l}) / (sigma^2 sum v_k^2)
//! ```
//!
//! `v` is the derivative of the best fit's residual along the parameter, `r` the residual. With white noise `c` is 1. A
//! residual that stays on one side for a while, as that of a wrong model does, tells less than its number of rows. `c`
//! is that factor (Newey and West's estimate with Bartlett's weights). The profile itself knows limits and steps of the
//! squares.
//!
//! The error of a number that is written in steps repeats itself wherever the quantity comes by again: no window sees
//! that. Where the steps lie is chance, so that its share of the variance is the mean over their places,
//!
//! ```text
//! mean_j (sum_k v_k e_jk)^2,      e_jk = q round((m_k + phi_j) / q) - phi_j - m_k,     m the fit, q the step
//! ```
//!
//! Source: Bates and Watts, Nonlinear Regression Analysis, ch. 6 (profiles); Newey and West, Econometrica 55 (1987).

use super::fit::{ActuatorProblem, LEAST_NOISE, Point};
use super::rows::DriveRows;

/// 90 % of a chi-squared variable of one degree of freedom is below this.
const CHI2: f64 = 2.7055;
/// The greatest of a dozen is below this in 99 %: more is no chance of a width that was searched.
const CHI2_SEARCHED: f64 = 11.2;
/// 90 % of a Gaussian's magnitude is below this.
pub(super) const GAUSS: f64 = 1.6449;
/// Autocorrelation below which rows count as independent.
const INDEPENDENT: f64 = 0.1;
/// Reach of the weights, in rows of correlation.
const WIDTH: usize = 5;
/// Places of the steps of a coarse number that are tried.
const PLACES: usize = 24;
/// Sections of a bracket in which an end lies.
const SECTIONS: u32 = 7;
/// First step away from the best, s.
const FIRST_STEP: f64 = 1e-3;

/// Noise of a fit.
#[derive(Debug, Clone)]
pub(super) struct FitNoise {
    pub variance: f64,
    /// Rows over which it is correlated.
    rows: usize,
    residual: Vec<f64>,
    /// Fit of each row and the step in which it was written; empty where none is.
    steps: Vec<(f64, f64)>,
}

/// Parameter that is varied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Along {
    DeadTime,
    Lag,
    Sum,
}

impl Along {
    fn of(self, point: &Point) -> f64 {
        match self {
            Self::DeadTime => point.dead_time,
            Self::Lag => point.lag,
            Self::Sum => point.dead_time + point.lag,
        }
    }
}

/// Sum of products of a sequence with itself, so many places later.
fn product(of: &[f64], lag: usize) -> f64 {
    of[lag..].iter().zip(of).map(|(a, b)| a * b).sum()
}

/// Factor by which noise that hangs together makes a sum over rows less sure.
pub(super) type Inflation = fn(&FitNoise, &[f64]) -> f64;

impl FitNoise {
    /// Noise at a point: with free parameters, and with rounding as the least.
    pub fn of(problem: &mut ActuatorProblem, best: &Point) -> Self {
        problem.residuals(best);
        let counts = &problem.rows.counts;
        let residual: Vec<f64> =
            problem.residual.iter().zip(counts).filter(|(_, counts)| **counts).map(|(r, _)| *r).collect();
        let count = residual.len() as f64;
        let free = 2.0 + problem.response.columns() as f64;
        let squares = residual.iter().map(|r| r * r).sum::<f64>();
        let variance = (squares / (count - free).max(1.0)).max(LEAST_NOISE * LEAST_NOISE);
        let correlated = |lag: usize| {
            let sum: f64 = residual[lag..].iter().zip(&residual).map(|(a, b)| a * b).sum();
            squares > 0.0 && sum > INDEPENDENT * squares
        };
        let longest = residual.len() / 10;
        let rows = (1..longest).find(|&lag| !correlated(lag)).unwrap_or(longest);
        let DriveRows { counts, response, origin, resolutions, mean, .. } = &problem.rows;
        let step = |row: usize| resolutions.get(origin[row].0 as usize).copied().unwrap_or(0.0);
        let coarse = resolutions.iter().any(|step| *step > 0.0);
        let steps = (0..counts.len())
            .filter(|&row| coarse && counts[row])
            .map(|row| (response[row] + mean - problem.residual[row], step(row)))
            .collect();
        Self { variance, rows, residual, steps }
    }

    /// Variance of `sum v_k r_k` over that of white noise, at least 1. `v` over the rows that count.
    pub fn inflation(&self, v: &[f64]) -> f64 {
        let squares = v.iter().map(|v| v * v).sum::<f64>();
        if squares <= 0.0 {
            return 1.0;
        }
        (self.long_run(v) / (self.variance * squares)).max(1.0)
    }

    /// The same by noise that is alike everywhere: its correlation is that of all rows, not of those few at which `v` is.
    pub fn inflation_anywhere(&self, v: &[f64]) -> f64 {
        let squares = v.iter().map(|v| v * v).sum::<f64>();
        if squares <= 0.0 {
            return 1.0;
        }
        let own = product(&self.residual, 0).max(f64::MIN_POSITIVE);
        let together = |lag| product(&self.residual, lag) / own * product(v, lag) / squares;
        let shared = self.shared(self.width(v), together);
        (1.0 + shared).max(self.inflation(v))
    }

    /// Number of lags at which the noise of rows hangs together.
    fn width(&self, v: &[f64]) -> usize {
        (WIDTH * self.rows).min(v.len() / 4).max(1)
    }

    /// Sum over the lags, on both sides, with the weights of a triangle (Bartlett's).
    fn shared(&self, width: usize, of: impl Fn(usize) -> f64) -> f64 {
        if self.rows <= 1 {
            return 0.0;
        }
        (1..width).map(|lag| 2.0 * (1.0 - lag as f64 / width as f64) * of(lag)).sum()
    }

    /// Long-run variance of `sum v_k r_k`.
    pub fn long_run(&self, v: &[f64]) -> f64 {
        let z: Vec<f64> = v.iter().zip(&self.residual).map(|(v, r)| v * r).collect();
        let (width, own) = (self.width(v), product(&z, 0));
        let shared = self.shared(width, |lag| product(&z, lag));
        // A wide window knows the variance itself less well (Kiefer and Vogelsang's fixed share, to first order).
        let unsure = if self.rows <= 1 { 1.0 } else { 1.0 + 2.0 * width as f64 / z.len().max(1) as f64 };
        let floor = LEAST_NOISE * LEAST_NOISE * v.iter().map(|v| v * v).sum::<f64>();
        (unsure * (own + shared)).max(own).max(floor).max(self.of_steps(v))
    }

    /// Variance of `sum v_k e_k` of the errors of coarse numbers, over the places of their steps.
    fn of_steps(&self, v: &[f64]) -> f64 {
        if self.steps.is_empty() {
            return 0.0;
        }
        let of_place = |place: usize| {
            let share = (place as f64 + 0.5) / PLACES as f64;
            let error = |(v, (fit, step)): (&f64, &(f64, f64))| match *step > 0.0 {
                true => v * step * ((fit / step + share).round() - share - fit / step),
                false => 0.0,
            };
            v.iter().zip(&self.steps).map(error).sum::<f64>()
        };
        (0..PLACES).map(|place| of_place(place).powi(2)).sum::<f64>() / PLACES as f64
    }
}

/// The ends of an interval with their linear parameters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ends {
    pub low: Point,
    pub high: Point,
    /// True for an end that was reached before the limit of the search.
    pub closed: [bool; 2],
}

impl ActuatorProblem {
    fn along(&mut self, along: Along, value: f64, best: &Point) -> Point {
        let off = (value - along.of(best)).abs() + 0.01;
        let sum = best.dead_time + best.lag;
        match along {
            Along::DeadTime => self.lag_for(value, (sum - value).max(0.0), off),
            Along::Lag => self.dead_time_for(value, (sum - value).max(0.0), off),
            Along::Sum => self.of_sum(value, best.lag, off.max(0.25 * best.lag)),
        }
    }

    /// Residuals of a point at the rows that count.
    fn counted_residuals(&mut self, point: &Point) -> Vec<f64> {
        self.residuals(point);
        let counts = &self.rows.counts;
        self.residual.iter().zip(counts).filter(|(_, counts)| **counts).map(|(r, _)| *r).collect()
    }

    /// False if not even white noise would let these rows' better point be more than chance in so many rows of the kind.
    pub fn may_be_better(&self, better: &Point, best: &Point, rows: usize) -> bool {
        let counted = self.rows.counted().max(1) as f64;
        let variance = (better.cost / counted).max(LEAST_NOISE * LEAST_NOISE);
        (best.cost - better.cost) * rows as f64 / counted > variance * CHI2_SEARCHED
    }

    /// True if another problem's best, with one more parameter, fits the same rows better than chance makes it.
    /// The noise comes with what it makes of a difference of the fits.
    pub fn is_worse(
        &mut self,
        best: &Point,
        other: &mut Self,
        better: &Point,
        (noise, inflation): (&FitNoise, Inflation),
    ) -> bool {
        let (of_less, of_more) = (self.counted_residuals(best), other.counted_residuals(better));
        let v: Vec<f64> = of_less.iter().zip(&of_more).map(|(less, more)| less - more).collect();
        best.cost - better.cost > noise.variance * CHI2_SEARCHED * inflation(noise, &v)
    }

    /// The interval along a parameter.
    pub fn ends(&mut self, along: Along, best: &Point, noise: &FitNoise, longest: f64) -> Ends {
        let first = self.ends_at(along, best, noise.variance * CHI2, longest);
        let (high, low) = (self.counted_residuals(&first.high), self.counted_residuals(&first.low));
        let v: Vec<f64> = high.iter().zip(&low).map(|(high, low)| high - low).collect();
        let inflation = noise.inflation(&v);
        if inflation < 1.01 {
            return first;
        }
        self.ends_at(along, best, noise.variance * CHI2 * inflation, longest)
    }

    fn ends_at(&mut self, along: Along, best: &Point, more: f64, longest: f64) -> Ends {
        let (low, low_closed) = self.end(along, best, more, 0.0);
        let (high, high_closed) = self.end(along, best, more, longest);
        Ends { low, high, closed: [low_closed, high_closed] }
    }

    /// Point at which the squares have risen by `more` on the way to a limit; the limit itself where they have not.
    fn end(&mut self, along: Along, best: &Point, more: f64, limit: f64) -> (Point, bool) {
        let from = along.of(best);
        let way = limit - from;
        if way == 0.0 {
            return (*best, limit == 0.0);
        }
        let rise = |point: &Point| ((point.cost - best.cost).max(0.0) / more).sqrt();
        let mut inside = (0.0, *best);
        let mut step = FIRST_STEP / way.abs();
        let outside = loop {
            let share = (inside.0 + step).min(1.0);
            let point = self.along(along, from + share * way, best);
            if rise(&point) > 1.0 {
                break (share, point);
            }
            inside = (share, point);
            if share >= 1.0 {
                return (point, limit == 0.0);
            }
            step *= 4.0;
        };
        let (mut inside, mut outside) = (inside, outside);
        for section in 0..SECTIONS {
            let (a, b) = (rise(&inside.1), rise(&outside.1));
            // The rise is nearly a line; every third section halves, where it is a step.
            let line = if b > a { ((1.0 - a) / (b - a)).clamp(0.05, 0.95) } else { 0.5 };
            let share = if section % 3 == 2 { 0.5 } else { line };
            let between = inside.0 + share * (outside.0 - inside.0);
            let point = self.along(along, from + between * way, best);
            if rise(&point) > 1.0 { outside = (between, point) } else { inside = (between, point) }
        }
        (if 1.0 - rise(&inside.1) < rise(&outside.1) - 1.0 { inside.1 } else { outside.1 }, true)
    }
}
