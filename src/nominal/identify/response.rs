//! The response of a dead time and a first-order lag to recorded commands.
//!
//! ```text
//! tau x' = u(t - T) - x          u held from each row on, or on a line between rows
//! ```
//!
//! A rate limit, where there is one, governs as long as the command is far: `x' = +-rate` for `|u - x| > rate tau`. A
//! gap of width `2 h` behind the lag, backlash, holds the answer back: `y = clamp(y before, x - h, x + h)`. Its
//! derivative by `h` is -1 after a motion to the left, 1 after one to the right.
//!
//! Rows need not be even: between the instants at which a command arrives the answer has a closed form. Behind a vehicle,
//! whose speed varies, the lateral velocity and yaw rate follow the angle's mean over each step,
//!
//! ```text
//! z_{k+1} = A(v_k) z_k + B(v_k) mean(x),          z = [vy, r, ..]
//! ```
//!
//! which the linear error model gives on a straight path that begins anew at each row (`e1 = e2 = 0`, `e1' = vy`).

use super::rows::DriveRows;
use super::steering_drive::Between;
use crate::nominal::{LateralVehicle, SingleTrackError};

/// A lag shorter than this is none, s.
const NO_LAG: f64 = 1e-6;
/// Arrivals this close to a row come with it, s.
const TOGETHER: f64 = 1e-9;
/// Speeds in one bin share a model, m/s.
const BIN: f64 = 0.25;

/// Regressors: the response to the commands, which depends on dead time and lag, and terms that do not.
#[derive(Debug, Clone)]
pub(super) struct Response {
    pub between: Between,
    /// Limit of the answer's rate, rad/s of the command; infinite for none. Only of commands that are held.
    pub rate_limit: f64,
    /// Half the width of a gap behind the lag, in the command's unit; its derivative is then a column. None: no gap.
    pub half_gap: Option<f64>,
    /// The answer times this is a column, too: a gain that varies with speed. Empty for none.
    pub varies: Vec<f64>,
    /// Columns that stay.
    pub fixed: Vec<Vec<f64>>,
    /// True if the actuator's state at a piece's beginning shows in the response as such.
    pub free: bool,
    vehicle: Option<Sampled>,
}

/// The answer to the commands at each row.
#[derive(Debug, Clone)]
pub(super) struct Answer {
    /// With a gain of 1.
    pub angle: Vec<f64>,
    /// Its derivative by half the gap, where there is one.
    pub by_gap: Vec<f64>,
}

/// A vehicle sampled at the speed of each row.
#[derive(Debug, Clone)]
struct Sampled {
    size: usize,
    /// By bin of speed, row by row; `[f64; 4]` is enough for tractor and trailer.
    models: Vec<([[f64; 4]; 4], [f64; 4])>,
    bin: Vec<u16>,
    step: f64,
}

impl Sampled {
    fn of<V: LateralVehicle<S>, const S: usize>(
        rows: &DriveRows,
        vehicle: &V,
        slowest: f64,
    ) -> Result<Self, SingleTrackError> {
        let step = rows.step;
        let bin_of = |speed: f64| (speed.clamp(slowest, 100.0) / BIN).round().max(1.0) as u16;
        let bin: Vec<u16> = rows.speed.iter().map(|&speed| bin_of(speed)).collect();
        let most = bin.iter().copied().max().unwrap_or(0);
        let mut models = Vec::with_capacity(usize::from(most) + 1);
        for bin in 0..=most {
            models.push(reduced(vehicle, f64::from(bin) * BIN, slowest, step)?);
        }
        Ok(Self { size: S - 2, models, bin, step })
    }
}

impl Response {
    /// The road-wheel angle: `gain x + offset`.
    pub fn angle(rows: &DriveRows, between: Between) -> Self {
        Self {
            between,
            varies: Vec::new(),
            rate_limit: f64::INFINITY,
            half_gap: None,
            fixed: vec![vec![1.0; rows.time.len()]],
            free: true,
            vehicle: None,
        }
    }

    /// The yaw rate of a vehicle, with an angle's offset and a bias of the sensor. Its gain varies with the speed's
    /// square, as understeer makes it.
    ///
    /// # Errors
    /// A vehicle whose model cannot be made.
    pub fn yaw_rate<V: LateralVehicle<S>, const S: usize>(
        rows: &DriveRows,
        vehicle: &V,
        slowest: f64,
    ) -> Result<Self, SingleTrackError> {
        let mut response = Self {
            between: Between::Held,
            rate_limit: f64::INFINITY,
            half_gap: None,
            varies: Vec::new(),
            fixed: Vec::new(),
            free: false,
            vehicle: Some(Sampled::of(rows, vehicle, slowest)?),
        };
        let steady = response.steady(rows);
        // The gain is that at the speeds at which the drives turn.
        let (mut sum, mut weight) = (0.0, 0.0);
        for row in (0..rows.time.len()).filter(|&row| rows.counts[row]) {
            let turning = rows.command[row] * rows.command[row];
            sum += turning * rows.speed[row] * rows.speed[row];
            weight += turning;
        }
        let mean = if weight > 0.0 { sum / weight } else { 0.0 };
        if mean > 0.0 {
            response.varies = rows.speed.iter().map(|speed| speed * speed / mean - 1.0).collect();
        }
        response.fixed = vec![steady, vec![1.0; rows.time.len()]];
        Ok(response)
    }

    /// The same behind another vehicle.
    ///
    /// # Errors
    /// A vehicle whose model cannot be made.
    pub fn behind<V: LateralVehicle<S>, const S: usize>(
        &self,
        rows: &DriveRows,
        vehicle: &V,
        slowest: f64,
    ) -> Result<Self, SingleTrackError> {
        let mut other = Self { vehicle: Some(Sampled::of(rows, vehicle, slowest)?), ..self.clone() };
        let behind = other.steady(rows);
        if let Some(steady) = other.fixed.first_mut() {
            *steady = behind;
        }
        Ok(other)
    }

    /// The vehicle's answer to an angle of 1 that stands.
    fn steady(&self, rows: &DriveRows) -> Vec<f64> {
        let mut steady = vec![0.0; rows.time.len()];
        self.drive(rows, 1.0, &mut steady, |_, _| 1.0);
        steady
    }

    /// The same of some of the rows.
    pub fn of_part(&self, places: &[usize]) -> Self {
        let part = |column: &Vec<f64>| places.iter().map(|&row| column[row]).collect::<Vec<f64>>();
        let vehicle = self.vehicle.as_ref().map(|sampled| Sampled {
            bin: places.iter().map(|&row| sampled.bin[row]).collect(),
            ..sampled.clone()
        });
        let varies = if self.varies.is_empty() { Vec::new() } else { part(&self.varies) };
        Self { varies, fixed: self.fixed.iter().map(part).collect(), vehicle, ..*self }
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.offset_column() + self.fixed.len()
    }

    /// Place of the column whose factor is a change of half the gap times the gain; only of a response with a gap.
    pub fn gap_column(&self) -> usize {
        1 + usize::from(!self.varies.is_empty())
    }

    /// Place of the column whose factor is the steering's offset times the gain, or the offset itself.
    pub fn offset_column(&self) -> usize {
        self.gap_column() + usize::from(self.half_gap.is_some())
    }

    /// The answer at each row with a gain of 1; with a gap its derivative by half the gap, too.
    pub fn fill(&self, rows: &DriveRows, dead_time: f64, lag: f64, answer: &mut Answer) {
        if self.vehicle.is_none() {
            for stretch in rows.stretches() {
                let mut actuator = Walk::new(rows, &stretch, self, dead_time, lag);
                for row in stretch {
                    actuator.to(rows.time[row]);
                    answer.angle[row] = actuator.y;
                    answer.by_gap[row] = actuator.by_gap;
                }
            }
            return;
        }
        let means = |begin: f64, area: fn(&Walk) -> f64, now: fn(&Walk) -> f64, out: &mut [f64]| {
            let mut walk: Option<Walk> = None;
            self.drive(rows, begin, out, |stretch, row| {
                if row == stretch.start {
                    walk = Some(Walk::new(rows, stretch, self, dead_time, lag));
                }
                let Some(walk) = &mut walk else { return 0.0 };
                let begin = area(walk);
                let from = rows.time[row];
                let to = if row + 1 < stretch.end { rows.time[row + 1] } else { from };
                if to <= from {
                    return now(walk);
                }
                walk.to(to);
                (area(walk) - begin) / (to - from)
            });
        };
        means(1.0, |walk| walk.area, |walk| walk.y, &mut answer.angle);
        if self.half_gap.is_some() {
            means(0.0, |walk| walk.area_by_gap, |walk| walk.by_gap, &mut answer.by_gap);
        }
    }

    /// Drives the vehicle with a mean angle for each step; gives the yaw rate at each row. Each stretch begins as if this
    /// share of its first command had stood: less is left to be forgotten.
    fn drive(
        &self,
        rows: &DriveRows,
        begin: f64,
        out: &mut [f64],
        mut angle: impl FnMut(&std::ops::Range<usize>, usize) -> f64,
    ) {
        let Some(Sampled { size, models, bin, step }) = &self.vehicle else { return };
        for stretch in rows.stretches() {
            let mut z = [0.0; 4];
            let first = begin * rows.command[stretch.start];
            for _ in 0..(1.0 / step).ceil() as usize {
                z = next(&models[usize::from(bin[stretch.start])], *size, &z, first);
            }
            for row in stretch.clone() {
                out[row] = z[1];
                let mean = angle(&stretch, row);
                z = next(&models[usize::from(bin[row])], *size, &z, mean);
            }
        }
    }
}

fn next((a, b): &([[f64; 4]; 4], [f64; 4]), size: usize, z: &[f64; 4], angle: f64) -> [f64; 4] {
    let mut out = [0.0; 4];
    for i in 0..size {
        out[i] = b[i] * angle + (0..size).map(|j| a[i][j] * z[j]).sum::<f64>();
    }
    out
}

/// A vehicle's model at a speed without the errors' integrals: states `[vy, r, ..]`.
fn reduced<V: LateralVehicle<S>, const S: usize>(
    vehicle: &V,
    speed: f64,
    slowest: f64,
    step: f64,
) -> Result<([[f64; 4]; 4], [f64; 4]), SingleTrackError> {
    let speed = speed.max(slowest);
    let model = vehicle.model_at(speed)?.discretise(step);
    // Places of the states that stay: e1' is the lateral velocity where e2 is 0.
    let kept: Vec<usize> = (0..S).filter(|&state| state != 0 && state != 2).collect();
    let (mut a, mut b) = ([[0.0; 4]; 4], [0.0; 4]);
    for (i, &to) in kept.iter().enumerate().take(4) {
        // The heading that a step turned by takes its share of e1'.
        let turned = if to == 1 { speed } else { 0.0 };
        b[i] = model.b[to] - turned * model.b[2];
        for (j, &from) in kept.iter().enumerate().take(4) {
            a[i][j] = model.a[(to, from)] - turned * model.a[(2, from)];
        }
    }
    Ok((a, b))
}

/// The actuator on its way along a stretch.
struct Walk<'a> {
    rows: &'a DriveRows,
    end: usize,
    between: Between,
    rate_limit: f64,
    half_gap: Option<f64>,
    dead_time: f64,
    lag: f64,
    /// The command that arrived last.
    arrived: usize,
    now: f64,
    /// Before the gap.
    x: f64,
    /// Behind it, and its derivative by half the gap.
    y: f64,
    by_gap: f64,
    /// Integrals of both.
    area: f64,
    area_by_gap: f64,
    /// Decays of the last two durations: an even clock needs no more.
    decays: [(f64, f64); 2],
}

impl<'a> Walk<'a> {
    fn new(
        rows: &'a DriveRows,
        stretch: &std::ops::Range<usize>,
        response: &Response,
        dead_time: f64,
        lag: f64,
    ) -> Self {
        Self {
            rows,
            end: stretch.end,
            between: response.between,
            rate_limit: response.rate_limit,
            half_gap: response.half_gap,
            dead_time,
            lag: if lag < NO_LAG { 0.0 } else { lag },
            arrived: stretch.start,
            now: rows.time[stretch.start],
            x: rows.command[stretch.start],
            y: rows.command[stretch.start],
            by_gap: 0.0,
            area: 0.0,
            area_by_gap: 0.0,
            decays: [(-1.0, 0.0); 2],
        }
    }

    /// Goes on to a time.
    fn to(&mut self, time: f64) {
        while self.arrived + 1 < self.end {
            let arrival = self.rows.time[self.arrived + 1] + self.dead_time;
            if arrival >= time - TOGETHER {
                break;
            }
            self.follow(arrival);
            self.arrived += 1;
        }
        self.follow(time);
    }

    /// Through lag and gap; the motion is monotone between commands, so that the gap acts at its end.
    fn follow(&mut self, until: f64) {
        let duration = until - self.now;
        if duration <= 0.0 {
            return;
        }
        let area = self.lag_until(until);
        let Some(half) = self.half_gap else {
            self.area += area;
            self.y = self.x;
            return;
        };
        let before = self.y;
        self.y = before.clamp(self.x - half, self.x + half);
        if self.y != before {
            self.by_gap = (before - self.y).signum();
        }
        self.area += 0.5 * (before + self.y) * duration;
        self.area_by_gap += self.by_gap * duration;
    }

    /// Goes on to a time before the gap; gives the integral on the way.
    fn lag_until(&mut self, until: f64) -> f64 {
        let duration = until - self.now;
        let mut area = 0.0;
        let (from, slope) = self.input();
        // Farther from the command than this the limit governs, nearer the lag.
        let gap = from - self.x;
        if self.rate_limit.is_finite() && gap.abs() > self.rate_limit * self.lag {
            let moving = ((gap.abs() - self.rate_limit * self.lag) / self.rate_limit).min(duration);
            let moved = self.rate_limit * moving * gap.signum();
            area += (self.x + 0.5 * moved) * moving;
            self.x += moved;
            self.now += moving;
            if moving >= duration {
                self.now = until;
                return area;
            }
        }
        let duration = until - self.now;
        let to = from + slope * duration;
        if self.lag > 0.0 {
            let decay = self.decay(duration);
            // Of a ramp the answer runs behind by the lag.
            let behind = slope * self.lag;
            let off = self.x - from + behind;
            area += (0.5 * (from + to) - behind) * duration + off * self.lag * (1.0 - decay);
            self.x = to - behind + off * decay;
        } else {
            area += 0.5 * (from + to) * duration;
            self.x = to;
        }
        self.now = until;
        area
    }

    /// The delayed command now, and its slope.
    fn input(&self) -> (f64, f64) {
        let (command, time) = (&self.rows.command, &self.rows.time);
        let row = self.arrived;
        let since = self.now - self.dead_time - time[row];
        if self.between != Between::Line || row + 1 >= self.end || since < -TOGETHER {
            return (command[row], 0.0);
        }
        let slope = (command[row + 1] - command[row]) / (time[row + 1] - time[row]);
        (command[row] + slope * since, slope)
    }

    fn decay(&mut self, duration: f64) -> f64 {
        for (known, decay) in self.decays {
            if (known - duration).abs() < 1e-12 {
                return decay;
            }
        }
        let decay = (-duration / self.lag).exp();
        self.decays = [(duration, decay), self.decays[0]];
        decay
    }
}
