//! The steering actuator from any drives: dead time, lag, backlash, gain and offset, each with an interval.
//!
//! ```text
//! y = gain P(x) + offset,     tau x' = u(t - T) - x
//! ```
//!
//! `u` is the command, held from its row on; `y` the measurement at each row; `P` the gap of a backlash, if the drives
//! show one. The drives may begin in a bend, have
//! gaps, uneven rows, wrong rows and stretches at a rate limit:
//!
//! - a row whose residual stands out of those beside it is wrong and left out: errors of a model last longer;
//! - a limit of the angle's rate is modelled if it explains clearly more;
//! - so is a gap, which without one would pass for a long lag, if the squares fall by more than chance makes them;
//! - where commands are recorded more slowly than they are given, a line between rows may explain much more than steps.
//!
//! A dead time and a lag act alike on slow commands: if only their sum is known, this is reported.

use super::fit::{ActuatorProblem, LEAST_NOISE, LONGEST_DEAD_TIME, LONGEST_LAG, Point};
use super::interval::{Along, Ends, FitNoise, GAUSS};
use super::response::Response;
use super::rows::DriveRows;
use super::steering_drive::{Between, LeftOut, SteeringDrive};
use crate::nominal::{Actuator, DeadTimeModel, LateralVehicle, SingleTrackError};
use crate::numerics::statistics::upper_median;

/// A number with its 90 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// True if the drives determine it: the interval is narrow enough to be used.
    pub excited: bool,
}

/// A steering actuator as drives show it.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedSteering {
    /// Dead time, s.
    pub dead_time: Estimate,
    /// Time constant of the first-order lag, s.
    pub lag: Estimate,
    /// Their sum, s: known before either is.
    pub delay: Estimate,
    /// Steady response to a command of 1: measured angle over command, or yaw rate over the model's.
    pub gain: Estimate,
    /// Angle without a command, rad, at the sensor; by yaw rate, the command that goes straight, with its sign
    /// reversed.
    pub offset: Estimate,
    /// Root of the mean squared error, in the response's unit.
    pub rmse: f64,
    /// Share of the response's variance that is explained, at most 1.
    pub explained: f64,
    /// Rows that were used.
    pub rows: usize,
    /// Values that were taken for wrong.
    pub left_out: Vec<LeftOut>,
    /// Full width of the gap behind the lag, rad of the command, if the drives show one.
    pub backlash: Option<Estimate>,
    /// The response's rate limit, rad/s, if one had to be modelled.
    pub rate_limit: Option<f64>,
    /// Assumption between rows.
    pub between: Between,
}

/// Reasons for which drives tell nothing of the steering.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum DrivesError {
    #[error("no drive was given")]
    None,
    #[error(
        "{name}: {time} times, {commands} commands, {responses} responses and {speeds} speeds: each row needs one of each"
    )]
    Lengths { name: String, time: usize, commands: usize, responses: usize, speeds: usize },
    #[error("{found} usable rows are too few: at least {least} with a command and a response are needed")]
    TooFew { found: usize, least: usize },
    #[error(
        "the response does not follow the command: the best fit explains {:.0} % of it; is it the right column, and does \
         its time belong to the command's?",
        100.0 * share
    )]
    NoResponse { share: f64 },
    #[error("the vehicle's linear model: {0}")]
    Vehicle(#[from] SingleTrackError),
}

/// Fewest rows that count.
const LEAST_ROWS: usize = 30;
/// Half width of an interval that determines a time, as a share of the whole delay, or in s.
const TIME_SHARE: f64 = 0.2;
const TIME_ENOUGH: f64 = 0.015;
/// Half width of an interval that determines a gain, as a share.
const GAIN_SHARE: f64 = 0.05;
/// Half width of an interval that determines an offset, rad.
const OFFSET_ENOUGH: f64 = 2e-3;
/// Least explained share of a valid fit, for a command whose effect would be seen.
const LEAST_SHARE: f64 = 0.5;
/// Number of rows on each side for the expected residual of one.
const BESIDE: usize = 4;
/// Distance of a wrong residual from those beside it, in typical distances, and as a share of all.
const OUTLYING: f64 = 8.0;
const OUTLYING_SHARE: f64 = 0.3;
/// Differences of residuals below this are rounding, rad or rad/s.
const ROUNDING: f64 = 1e-5;
/// Rise of the squares that counts as flat, as a share of the noise's variance.
const FLAT: f64 = 0.5;
/// Window of the last search, s.
const FINE: f64 = 3e-4;
/// Rounds of looking for wrong rows.
const ROUNDS: usize = 3;
/// Number of rate limits that are tried, each this share of the one before, from the greatest observed rate.
const LIMITS: i32 = 12;
const LIMIT_RATIO: f64 = 0.82;
/// Rounds of finding the limit and the rest in turn.
const LIMIT_ROUNDS: usize = 5;
/// A rate limit must lower the error to this share of it.
const CLEARLY_BETTER: f64 = 0.7;
/// Number of half gaps that are tried, each this share of the one before, from half the command's range.
const GAPS: i32 = 12;
const GAP_RATIO: f64 = 0.6;
/// Number of them from which the gap is refined.
const GAP_BEGINS: usize = 3;
/// Rounds of finding the gap and the rest in turn, and change of the gap that ends them, rad.
const GAP_ROUNDS: usize = 12;
const GAP_FINE: f64 = 1e-7;
/// Half width of an interval that determines a gap, as a share, or in rad.
const GAP_SHARE: f64 = 0.25;
const GAP_ENOUGH: f64 = 1e-3;
/// So must lines between rows: with steps that are steps they only raise it.
const LINE_BETTER: f64 = 0.9;

impl IdentifiedSteering {
    /// The actuator to predict with.
    #[must_use]
    pub fn actuator(&self) -> Actuator {
        Actuator {
            dead_time: self.dead_time.value,
            time_constant: self.lag.value,
            dead_time_model: DeadTimeModel::Exact,
        }
    }

    /// True if dead time and lag are determined, both of them.
    #[must_use]
    pub fn excited(&self) -> bool {
        self.dead_time.excited && self.lag.excited
    }
}

/// The actuator from drives whose response is the road-wheel angle; gain and offset are those of the sensor against the
/// command.
///
/// # Errors
/// Too few rows; a response that does not follow.
pub fn identify_from_drives(drives: &[SteeringDrive]) -> Result<IdentifiedSteering, DrivesError> {
    let rows = checked(drives, false)?;
    let held = ActuatorProblem::new(rows.clone(), Response::angle(&rows, Between::Held));
    let mut found = BestPoint::of(held).with_gap();
    let limited = found.clone().limited();
    if limited.problem.response.rate_limit.is_finite() {
        // What looked like a gap may have been the limit.
        found = limited.without_gap().with_gap();
    }
    let mut line = found.clone();
    line.problem.response = Response::angle(&rows, Between::Line);
    // A line runs half a step behind the step before it.
    let (half, best) = (0.5 * rows.step, found.best);
    let near = Point { dead_time: (best.dead_time + half).min(LONGEST_DEAD_TIME), ..best };
    line.best = line.problem.refine(&near, 2.0 * half, 4.0 * half);
    if found.rms() > 10.0 * LEAST_NOISE && line.rms() < LINE_BETTER * found.rms() {
        found = line.polished();
    }
    found.identified()
}

/// The actuator from drives whose response is the yaw rate, at whatever speeds. The linear model of the vehicle lies
/// between, held below the speed `slowest` in m/s. Its errors in time, relaxation of tyres and roll above all, enter
/// the constants, too. Rows should be even.
///
/// # Errors
/// Too few rows; a response that does not follow; a vehicle whose model cannot be made.
pub fn identify_by_yaw_rate_from_drives<V: LateralVehicle<S>, const S: usize>(
    drives: &[SteeringDrive],
    vehicle: &V,
    slowest: f64,
) -> Result<IdentifiedSteering, DrivesError> {
    let rows = checked(drives, true)?;
    let response = Response::yaw_rate(&rows, vehicle, slowest)?;
    BestPoint::of(ActuatorProblem::new(rows, response)).with_gap().identified()
}

fn checked(drives: &[SteeringDrive], with_speed: bool) -> Result<DriveRows, DrivesError> {
    if drives.is_empty() {
        return Err(DrivesError::None);
    }
    for SteeringDrive { name, time, steer_cmd, response, speed, .. } in drives {
        let rows = time.len();
        let speeds_fit =
            if with_speed { speed.len() == rows } else { speed.is_empty() || speed.len() == rows };
        if steer_cmd.len() != rows || response.len() != rows || !speeds_fit {
            let (name, commands, responses, speeds) =
                (name.clone(), steer_cmd.len(), response.len(), speed.len());
            return Err(DrivesError::Lengths { name, time: rows, commands, responses, speeds });
        }
    }
    let rows = DriveRows::of(drives, with_speed);
    match rows.counted() {
        found if found < LEAST_ROWS => Err(DrivesError::TooFew { found, least: LEAST_ROWS }),
        _ => Ok(rows),
    }
}

/// A problem with its best point.
#[derive(Debug, Clone)]
struct BestPoint {
    problem: ActuatorProblem,
    best: Point,
    /// Rows that count before any is judged by a fit, and values left out by then.
    given: (Vec<bool>, usize),
}

impl BestPoint {
    /// The best of all, without rows that stand out.
    fn of(mut problem: ActuatorProblem) -> Self {
        let best = problem.search();
        let given = (problem.rows.counts.clone(), problem.rows.left_out.len());
        Self { problem, best, given }.polished()
    }

    /// The best near the best, without rows that stand out.
    fn polished(mut self) -> Self {
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
    fn rms(&self) -> f64 {
        (self.best.cost / self.problem.rows.counted().max(1) as f64).sqrt()
    }

    /// Takes out rows whose residual stands out. All are judged anew: a rough fit is no judge for good.
    fn leave_out_outliers(&mut self) {
        let least = self.rms();
        self.problem.residuals(&self.best);
        let ActuatorProblem { rows, residual, .. } = &mut self.problem;
        rows.counts.copy_from_slice(&self.given.0);
        rows.left_out.truncate(self.given.1);
        let stretches: Vec<_> = rows.stretches().collect();
        let mut off = vec![0.0; rows.time.len()];
        for stretch in stretches {
            let counted: Vec<usize> = stretch.filter(|&row| rows.counts[row]).collect();
            for (i, &row) in counted.iter().enumerate() {
                let from = i.saturating_sub(BESIDE);
                let mut beside: Vec<f64> = counted[from..(i + BESIDE + 1).min(counted.len())]
                    .iter()
                    .map(|&row| residual[row])
                    .collect();
                off[row] = (residual[row] - upper_median(&mut beside)).abs();
            }
        }
        let mut typical: Vec<f64> =
            (0..off.len()).filter(|&row| rows.counts[row]).map(|row| off[row]).collect();
        let limit =
            (OUTLYING * 1.4826 * upper_median(&mut typical)).max(OUTLYING_SHARE * least).max(ROUNDING);
        for (row, off) in off.iter().enumerate() {
            let (drive, place) = rows.origin[row];
            if rows.counts[row] && *off > limit.max(rows.resolutions[drive as usize]) {
                rows.counts[row] = false;
                let value = rows.response[row] + rows.mean;
                rows.left_out.push(LeftOut { drive, row: place, signal: "response", value });
            }
        }
    }

    /// Finds a rate limit, if one explains the response clearly better.
    fn limited(mut self) -> Self {
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

    /// The same without a gap.
    fn without_gap(mut self) -> Self {
        self.problem.response.half_gap = None;
        self.best = self.problem.refine(&self.best, 0.02, 0.04);
        self.polished()
    }

    /// With a gap, if the drives show one.
    fn with_gap(self) -> Self {
        if self.rms() < 10.0 * LEAST_NOISE {
            return self;
        }
        let part = self.problem.part();
        let given = (part.rows.counts.clone(), 0);
        let mut part = Self { problem: part, best: Point { cost: f64::INFINITY, ..self.best }, given };
        let widest = part.problem.rows.half_range();
        let mut begins = Vec::new();
        for half in (0..GAPS).map(|k| widest * GAP_RATIO.powi(k)).chain([0.0]) {
            part.problem.response.half_gap = Some(half);
            begins.push((half, part.problem.coarse(&self.best)));
        }
        begins.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
        begins.truncate(GAP_BEGINS);
        // Squares of a gap have more than one valley.
        for (half, best) in begins {
            let mut begun = part.clone();
            begun.problem.response.half_gap = Some(half);
            begun.best = begun.problem.refine(&best, 0.02, 0.04);
            let begun = begun.gap_refined();
            if begun.best.cost < part.best.cost {
                part = begun;
            }
        }
        let mut other = self.clone();
        other.problem.response.half_gap = part.problem.response.half_gap;
        other.best = other.problem.refine(&part.best, 0.02, 0.04);
        let mut other = other.gap_refined().polished().gap_refined();
        // Both by the same rows.
        let mut none = self.clone();
        none.problem.rows.counts.clone_from(&other.problem.rows.counts);
        none.best = none.problem.refine(&self.best, 0.02, 0.04);
        let noise = FitNoise::of(&mut other.problem.clone(), &other.best);
        if none.problem.is_worse(&none.best, &mut other.problem.clone(), &other.best, &noise) {
            other
        } else {
            self
        }
    }

    /// The gap and the rest in turn: the gap's column says how far the gap is off.
    fn gap_refined(mut self) -> Self {
        let place = self.problem.response.gap_column();
        let mut windows = (0.01, 0.02);
        for _ in 0..GAP_ROUNDS {
            let Some(half) = self.problem.response.half_gap else { break };
            let wider = (half + self.best.beta[place] / self.best.beta[0]).max(0.0);
            if !wider.is_finite() || (wider - half).abs() < GAP_FINE {
                break;
            }
            self.problem.response.half_gap = Some(wider);
            self.best = self.problem.refine(&self.best, windows.0, windows.1);
            windows = (0.7 * windows.0, 0.7 * windows.1);
        }
        self
    }

    fn identified(mut self) -> Result<IdentifiedSteering, DrivesError> {
        let rows = self.problem.rows.counted();
        let variance: f64 = self
            .problem
            .rows
            .response
            .iter()
            .zip(&self.problem.rows.counts)
            .map(|(y, counts)| if *counts { y * y } else { 0.0 })
            .sum();
        let explained = if variance > 0.0 { 1.0 - self.best.cost / variance } else { 0.0 };
        let noise = FitNoise::of(&mut self.problem, &self.best);
        let best = self.best;
        let ends =
            |problem: &mut ActuatorProblem, along, longest| problem.ends(along, &best, &noise, longest);
        let dead_times = ends(&mut self.problem, Along::DeadTime, LONGEST_DEAD_TIME);
        let lags = ends(&mut self.problem, Along::Lag, LONGEST_LAG);
        let sums = ends(&mut self.problem, Along::Sum, LONGEST_DEAD_TIME + LONGEST_LAG);
        let best = self.middle(&dead_times, &noise);
        let spread = |of: &dyn Fn(&Point) -> f64| {
            // Along the valley and across it.
            [dead_times.low, dead_times.high, lags.low, lags.high, sums.low, sums.high]
                .iter()
                .map(|point| (of(point) - of(&best)).abs())
                .fold(0.0, f64::max)
        };
        let gain = self.linear(&best, 0, &noise, spread(&|point| point.beta[0]));
        let backlash = self.problem.response.half_gap.map(|half| {
            let place = self.problem.response.gap_column();
            let off = self.linear(&best, place, &noise, spread(&|point| point.beta[place]));
            let mut width = off.map(|off| (2.0 * (half + off / best.beta[0])).max(0.0));
            width.sort_by(f64::total_cmp);
            width
        });
        let place = self.problem.response.offset_column();
        let mut offset = self.linear(&best, place, &noise, spread(&|point| point.beta[place]));
        if self.problem.response.free {
            // Responses were counted from their mean.
            offset = offset.map(|value| value + self.problem.rows.mean);
        } else if best.beta[0] != 0.0 {
            offset = offset.map(|value| value / best.beta[0].abs());
        }
        let whole = best.dead_time + best.lag;
        let time = |value: f64, ends: &Ends, of: fn(&Point) -> f64| {
            let (low, high) = (of(&ends.low).min(value), of(&ends.high).max(value));
            let enough = TIME_ENOUGH.max(TIME_SHARE * whole);
            let excited = ends.closed.iter().all(|closed| *closed) && 0.5 * (high - low) <= enough;
            Estimate { value, low, high, excited }
        };
        let mut identified = IdentifiedSteering {
            dead_time: time(best.dead_time, &dead_times, |point| point.dead_time),
            lag: time(best.lag, &lags, |point| point.lag),
            delay: time(whole, &sums, |point| point.dead_time + point.lag),
            gain: estimate(gain, GAIN_SHARE * gain[1].abs()),
            offset: estimate(offset, OFFSET_ENOUGH),
            rmse: self.rms(),
            explained,
            rows,
            left_out: std::mem::take(&mut self.problem.rows.left_out),
            backlash: backlash.map(|width| estimate(width, GAP_ENOUGH.max(GAP_SHARE * width[1]))),
            rate_limit: Some(self.problem.response.rate_limit * best.beta[0].abs())
                .filter(|limit| limit.is_finite()),
            between: self.problem.response.between,
        };
        if explained < LEAST_SHARE {
            self.no_response(&mut identified)?;
        }
        Ok(identified)
    }

    /// Middle of a flat minimum between the ends, as that of a pure dead time within a step.
    fn middle(&mut self, ends: &Ends, noise: &FitNoise) -> Point {
        let dead_time = 0.5 * (ends.low.dead_time + ends.high.dead_time);
        let sum = self.best.dead_time + self.best.lag;
        let middle = self.problem.lag_for(dead_time, (sum - dead_time).max(0.0), 5e-3);
        let flat = ends.closed == [true; 2] && middle.cost <= self.best.cost + FLAT * noise.variance;
        if flat { middle } else { self.best }
    }

    /// Low, value and high of a factor.
    fn linear(&mut self, best: &Point, place: usize, noise: &FitNoise, spread: f64) -> [f64; 3] {
        self.problem.alone(best, place);
        let counts = &self.problem.rows.counts;
        let v: Vec<f64> = self
            .problem
            .residual
            .iter()
            .zip(counts)
            .filter(|(_, counts)| **counts)
            .map(|(v, _)| *v)
            .collect();
        let squares = v.iter().map(|v| v * v).sum::<f64>();
        let value = best.beta[place];
        if squares <= 1e-12 * v.len() as f64 {
            return [f64::NEG_INFINITY, value, f64::INFINITY];
        }
        let variance = noise.long_run(&v).max(noise.variance * squares) / (squares * squares);
        let half = GAUSS * variance.sqrt();
        let half = half.hypot(spread);
        [value - half, value, value + half]
    }

    /// A fit that explains little: a command that hardly moves, or a response that does not follow.
    fn no_response(&mut self, identified: &mut IdentifiedSteering) -> Result<(), DrivesError> {
        let gain = identified.gain;
        if gain.low * gain.high > 0.0 {
            // It follows, under much noise: the intervals say how much is known.
            return Ok(());
        }
        self.problem.alone(&self.best, 0);
        let counts = &self.problem.rows.counts;
        let squares: f64 = self
            .problem
            .residual
            .iter()
            .zip(counts)
            .map(|(v, counts)| if *counts { v * v } else { 0.0 })
            .sum();
        let seen = (squares / identified.rows.max(1) as f64).sqrt();
        if seen > identified.rmse {
            return Err(DrivesError::NoResponse { share: identified.explained.max(0.0) });
        }
        for (estimate, longest) in [
            (&mut identified.dead_time, LONGEST_DEAD_TIME),
            (&mut identified.lag, LONGEST_LAG),
            (&mut identified.delay, LONGEST_DEAD_TIME + LONGEST_LAG),
        ] {
            (estimate.low, estimate.high, estimate.excited) = (0.0, longest, false);
        }
        identified.gain.excited = false;
        Ok(())
    }
}

fn estimate([low, value, high]: [f64; 3], enough: f64) -> Estimate {
    Estimate { value, low, high, excited: 0.5 * (high - low) <= enough }
}
