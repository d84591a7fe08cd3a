//! The steering actuator from any drives: dead time, lag, backlash, gain and offset, each with an interval.
//!
//! ```text
//! y = gain P(x) + offset,     tau x' = u(t - T) - x
//! ```
//!
//! `u` is the command, held from its row on; `y` the measurement at each row; `P` the gap of a backlash, if the drives
//! show one. The drives may begin in a bend, have gaps, uneven rows, wrong rows, lost rows and stretches at a rate limit:
//!
//! - a row whose residual stands out of those beside it is wrong and left out: errors of a model last longer;
//! - where rows were lost, or commands are repeated, those between may explain more if they are put on a line,
//!   and held like the others;
//! - a limit of the angle's rate is modelled if it explains clearly more;
//! - so is a gap, which without one would pass for a long lag, if the squares fall by more than chance makes them;
//! - where commands are recorded more slowly than they are given, a line between rows may explain much more than steps.
//!
//! A dead time and a lag act alike on slow commands: if only their sum is known, this is reported.

use super::best_point::BestPoint;
use super::estimate::Estimate;
use super::fit::{ActuatorProblem, LEAST_NOISE, LONGEST_DEAD_TIME, LONGEST_LAG, Point};
use super::interval::{Along, Ends, FitNoise, GAUSS};
use super::model_error::{ConstantsReach, Reach};
use super::response::Response;
use super::rows::DriveRows;
use super::steering_drive::{Between, LeftOut, SteeringDrive};
use crate::nominal::{Actuator, DeadTimeModel, LateralVehicle, SingleTrackError};

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
    /// Angle without a command, rad: at the sensor, or by yaw rate at the wheels. The command `-offset / gain` goes straight.
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
    /// Part of the dead time that no row shows, s: commands are taken to be given at 50 Hz or faster.
    pub unseen_delay: f64,
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
/// Rise of the squares that counts as flat, as a share of the noise's variance.
const FLAT: f64 = 0.5;
/// Half width of an interval that determines a gap, as a share, or in rad.
const GAP_SHARE: f64 = 0.25;
const GAP_ENOUGH: f64 = 1e-3;
/// Commands in the place of lost ones must lower the error to this share of it: with steps that are steps they only raise it.
const FILLED_BETTER: f64 = 0.9;
/// Lines between rows must lower it to this one. They also soften what an actuator of another order softens.
const LINE_BETTER: f64 = 0.7;

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

    /// Quantity in which this actuator is another than that of other drives: determined in both, and farther apart than
    /// intervals that determine it are wide.
    #[must_use]
    pub fn contradiction(&self, other: &Self) -> Option<(&'static str, [Estimate; 2])> {
        let none = Estimate { value: 0.0, low: 0.0, high: GAP_ENOUGH, excited: true };
        let gap = |found: &Self| found.backlash.unwrap_or(none);
        [
            ("dead time and lag together", [self.delay, other.delay], TIME_ENOUGH),
            ("gain", [self.gain, other.gain], GAIN_SHARE * self.gain.value.abs()),
            ("backlash", [gap(self), gap(other)], GAP_ENOUGH),
        ]
        .into_iter()
        .find(|(_, [a, b], enough)| a.excited && b.excited && (a.low - b.high).max(b.low - a.high) > *enough)
        .map(|(name, both, _)| (name, both))
    }

    /// Full width of the gap, rad of the command, if the drives determine it.
    #[must_use]
    pub fn shown_backlash(&self) -> Option<Estimate> {
        self.backlash.filter(|width| width.excited)
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
    identify_with_limit_from_drives(drives, f64::INFINITY)
}

/// The same of a vehicle that is told to have a rate limit, in rad/s of the command: it is modelled if the drives do not speak against it.
///
/// # Errors
/// As [`identify_from_drives`].
pub fn identify_with_limit_from_drives(
    drives: &[SteeringDrive],
    rate_limit: f64,
) -> Result<IdentifiedSteering, DrivesError> {
    let rows = checked(drives, false)?;
    let held = |rows: &DriveRows| {
        let response = Response::angle(rows, Between::Held);
        BestPoint::of(ActuatorProblem::new(rows.clone(), response)).with_gap_and_limit(rate_limit)
    };
    let mut found = held(&rows);
    if found.rms() <= 10.0 * LEAST_NOISE {
        return found.between_rows().identified(ConstantsReach::default());
    }
    let filled = rows.with_lost_rows(drives).map(|rows| held(&rows));
    let is_better = |filled: &mut BestPoint| {
        // Under noise a wrong delay makes up for most of what slow commands lack.
        let alike = filled.problem.rows.time.len() == found.problem.rows.time.len();
        filled.rms() < FILLED_BETTER * found.rms()
            || filled.problem.rows.laid && alike && filled.explains_more_than(&found)
    };
    found = filled.and_then(|mut filled| is_better(&mut filled).then_some(filled)).unwrap_or(found);
    found.between_rows().identified(ConstantsReach::default())
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
    let found = BestPoint::of(ActuatorProblem::new(rows, response)).with_gap();
    let error = found.model_error(vehicle, slowest)?;
    found.between_rows().identified(error)
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

impl BestPoint {
    /// With the course of the command between rows that explains them, as far as one of the two does.
    fn between_rows(mut self) -> Self {
        let mut line = self.clone();
        line.problem.response.between = Between::Line;
        line.problem.response.rate_limit = f64::INFINITY;
        // A line runs half a step behind the step before it.
        let (half, best) = (0.5 * self.problem.rows.step, self.best);
        let near = Point { dead_time: (best.dead_time + half).min(LONGEST_DEAD_TIME), ..best };
        line.best = line.problem.refine(&near, 2.0 * half, 4.0 * half);
        if line.rms() < LINE_BETTER * self.rms() {
            return line.polished();
        }
        self.problem.response.between =
            if self.explains_more_than(&line) { Between::Held } else { Between::Either };
        self
    }

    fn identified(mut self, error: ConstantsReach) -> Result<IdentifiedSteering, DrivesError> {
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
        }
        let whole = best.dead_time + best.lag;
        let between = if self.problem.rows.laid { Between::Line } else { self.problem.response.between };
        let unseen = if self.problem.rows.laid { [0.0; 3] } else { between.unseen(self.problem.rows.step) };
        let time =
            |value: f64, ends: &Ends, error: Reach, of: fn(&Point) -> f64, [early, usual, late]: [f64; 3]| {
                let (low, high) = (of(&ends.low).min(value) + early, of(&ends.high).max(value));
                let enough = TIME_ENOUGH.max(TIME_SHARE * whole);
                // Rows at the rate of ordinary controllers are taken for theirs.
                let half = 0.5 * (high + usual - low);
                let excited = ends.closed.iter().all(|closed| *closed) && half <= enough;
                let high = high + late;
                let found = error.widen(Estimate { value: value + usual, low, high, excited });
                Estimate { low: found.low.max(0.0), ..found }
            };
        let mut identified = IdentifiedSteering {
            dead_time: time(best.dead_time, &dead_times, error.dead_time, |point| point.dead_time, unseen),
            lag: time(best.lag, &lags, error.lag, |point| point.lag, [0.0; 3]),
            delay: time(whole, &sums, error.delay, |point| point.dead_time + point.lag, unseen),
            gain: error.gain.widen(estimate(gain, GAIN_SHARE * gain[1].abs())),
            offset: error.offset.widen(estimate(offset, OFFSET_ENOUGH)),
            rmse: self.rms(),
            explained,
            rows,
            left_out: std::mem::take(&mut self.problem.rows.left_out),
            backlash: backlash.map(|width| estimate(width, GAP_ENOUGH.max(GAP_SHARE * width[1]))),
            rate_limit: Some(self.problem.response.rate_limit * best.beta[0].abs())
                .filter(|limit| limit.is_finite()),
            between,
            unseen_delay: unseen[1],
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
