//! A log prepared for the replay.

use super::channel::{CHANNELS, Channel};
use crate::log::{CleanLog, Coarseness};
use crate::signal::{self, Signal};
use std::collections::BTreeMap;

/// Speed below which nothing is replayed, m/s: a standing vehicle is uninformative.
pub const LEAST_SPEED: f64 = 2.0;
/// Longest step of a replay, s.
const LONGEST_STEP: f64 = 0.0201;
/// Clock step below which a log is brought to half its rate, s.
const QUICK: f64 = 0.0126;
/// Time between rows from which on they are slower than controllers, s: 20 a second are the fewest of a path tracking in use.
const SLOW: f64 = 0.0505;
/// Settling time of a replay before it is compared, s.
const SETTLING: f64 = 2.5;
/// Shortest stretch that is replayed at all, s.
const SHORTEST: f64 = 4.0;
/// Rows that do not count for so long are a hole, s; after a short one the log waits a second for the vehicle to settle.
const HOLE: f64 = 1.5;
/// Bend that resolves the friction of a truck's fifth wheel, which remembers the last direction of turning. Change of
/// the path's curvature over some time, 1/m and s, and the longest wait for it, s.
const BENT: f64 = 6e-4;
const BENT_FOR: f64 = 0.5;
const LONGEST_WAIT: f64 = 10.0;

/// Columns of a known road, from the log or its path.
pub const ROAD: [Signal; 3] = [signal::BANK, signal::GRADE, signal::FRICTION];

/// A log ready to be replayed.
#[derive(Debug, Clone)]
pub struct ReplayDrive {
    /// Sample time, s.
    pub step: f64,
    /// Steps of the replay in one sample.
    pub substeps: usize,
    /// Time of each row, s.
    pub time: Vec<f64>,
    /// The command, or its substitute, rad.
    pub steer: Vec<f64>,
    /// True if it is the command.
    pub commanded: bool,
    /// Asked acceleration, m/s2, if the log has it.
    pub accel_cmd: Option<Vec<f64>>,
    /// Acceleration by drive and brakes, from the speed, m/s2.
    pub accel: Vec<f64>,
    /// Other columns by signal.
    pub columns: BTreeMap<&'static str, Vec<f64>>,
    /// Columns that are written in steps.
    pub coarse: BTreeMap<&'static str, Coarseness>,
    /// Stretches to replay: rows from, to.
    pub stretches: Vec<(usize, usize)>,
    /// True for each row that is compared.
    pub scored: Vec<bool>,
    /// Compared signals.
    pub channels: Vec<Channel>,
    /// Heading at each row, rad: the log's, else the integral of the yaw rate. Empty if nothing tells it.
    pub heading: Vec<f64>,
    /// True if the heading counts from east, so that a wind fixed in the world has a direction. Without a compass it
    /// counts from the log's start.
    pub compass: bool,
}

/// False in holes: rows that do not count for this many and longer. What drives the replay may be a guess there, and the motion starts
/// anew behind.
fn known(valid: &[bool], longest: usize) -> Vec<bool> {
    let mut known = vec![true; valid.len()];
    let mut from = 0;
    for part in valid.chunk_by(|a, b| a == b) {
        let to = from + part.len();
        known[from..to].fill(part[0] || part.len() < longest);
        from = to;
    }
    known
}

/// Rows before the road's first change of bend; a bias of the yaw rate is no bend.
fn unbent(yaw_rate: &[f64], vx: &[f64], step: f64) -> usize {
    let rows = |time: f64| ((time / step).round() as usize).max(1);
    let curvature: Vec<f64> = yaw_rate.iter().zip(vx).map(|(rate, vx)| rate / vx.max(LEAST_SPEED)).collect();
    let over = rows(BENT_FOR);
    let mut means = curvature.windows(over).map(|part| part.iter().sum::<f64>() / over as f64);
    let Some(first) = means.next() else { return 0 };
    let bend = means.position(|mean| (mean - first).abs() > BENT);
    bend.map_or(usize::MAX, |row| row + over).min(rows(LONGEST_WAIT))
}

impl ReplayDrive {
    /// Drive of a clean log; `truck` is true if articulation is compared.
    #[must_use]
    pub fn new(log: &CleanLog, truck: bool) -> Self {
        let halved = (log.step < QUICK && log.time.len() > 2).then(|| halved(log));
        let log = halved.as_ref().unwrap_or(log);
        let rows = log.time.len();
        let column = |name: &str| log.columns.get(name).filter(|column| column.len() == rows);
        let vx = column("vx").cloned().unwrap_or_else(|| vec![0.0; rows]);
        let steer = column("steer_cmd").cloned().unwrap_or_else(|| vec![0.0; rows]);
        let known = known(&log.valid, (HOLE / log.step).ceil() as usize);
        let moving: Vec<bool> = (0..rows)
            .map(|i| known[i] && vx[i].is_finite() && vx[i] >= LEAST_SPEED && steer[i].is_finite())
            .collect();
        let pieces = pieces(&log.time, log.step);
        let mut stretches = Vec::new();
        let mut scored = vec![false; rows];
        let mut from = 0;
        while from < rows {
            if !moving[from] {
                from += 1;
                continue;
            }
            // The motion starts anew where the clock jumps.
            let end = pieces.iter().map(|piece| piece.1).find(|&end| end > from).unwrap_or(rows);
            let to = (from..end).find(|&i| !moving[i]).unwrap_or(end);
            if (to - from) as f64 * log.step >= SHORTEST {
                stretches.push((from, to));
                let rate = column("yaw_rate").filter(|_| truck).and_then(|rate| rate.get(from..to));
                let unbent = rate.map_or(0, |rate| unbent(rate, &vx[from..to], log.step));
                let settled = from + unbent.max((SETTLING / log.step).ceil() as usize);
                let valid = log.valid.iter().take(to).skip(settled);
                scored.iter_mut().skip(settled).zip(valid).for_each(|(scored, valid)| *scored = *valid);
            }
            from = to;
        }
        let channels = CHANNELS
            .into_iter()
            .filter(|channel| {
                channel.needs().iter().all(|name| column(name).is_some())
                    && (log.commanded || *channel != Channel::Steer)
                    && (truck || !matches!(channel, Channel::Articulation | Channel::ArticulationRate))
            })
            .collect();
        let accel = pieces.iter().flat_map(|&(from, to)| acceleration(&vx[from..to], log.step)).collect();
        let mut columns: BTreeMap<&'static str, Vec<f64>> = log
            .columns
            .iter()
            .filter(|(_, column)| column.len() == rows)
            .map(|(&k, v)| (k, v.clone()))
            .collect();
        columns.insert("vx", vx);
        let (heading, compass) = heading(&columns, &pieces, log.step);
        Self {
            step: log.step,
            substeps: (log.step / LONGEST_STEP).ceil().max(1.0) as usize,
            time: log.time.clone(),
            commanded: log.commanded,
            accel_cmd: column("accel_cmd").cloned(),
            steer,
            accel,
            columns,
            coarse: log.coarse.clone(),
            stretches,
            scored,
            channels,
            heading,
            compass,
        }
    }

    /// A column; empty if the log lacks it.
    #[must_use]
    pub fn column(&self, name: &str) -> &[f64] {
        self.columns.get(name).map_or(&[], Vec::as_slice)
    }

    /// True if the command is held from row to row. Rows slower than controllers are have left commands out between them: a line is
    /// nearer to these than the last one.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.commanded && self.step < SLOW
    }

    /// The command over a row; a measured angle, and the command of slow rows, by its mean.
    #[must_use]
    pub fn held(&self, row: usize) -> f64 {
        if self.holds() { self.steer[row] } else { at(&self.steer, row as f64 + 0.5) }
    }

    /// Seconds that are compared.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.scored.iter().filter(|&&scored| scored).count() as f64 * self.step
    }
}

/// Row ranges, from and to, without a jump of the clock. Several logs, or blocks of a long one, were put together, and
/// the end of one says nothing of the start of the next.
fn pieces(time: &[f64], step: f64) -> Vec<(usize, usize)> {
    let jumps = (1..time.len()).filter(|&i| time[i] - time[i - 1] > 1.5 * step);
    let starts: Vec<usize> = std::iter::once(0).chain(jumps).collect();
    let ends = starts[1..].iter().copied().chain([time.len()]);
    starts.iter().copied().zip(ends).collect()
}

/// Heading, and true if it counts from east: `yaw`; or the integral of the yaw rate, turned to the course of `x` and
/// `y`.
fn heading(
    columns: &BTreeMap<&'static str, Vec<f64>>,
    pieces: &[(usize, usize)],
    step: f64,
) -> (Vec<f64>, bool) {
    let column = |name: &str| columns.get(name).map_or(&[][..], Vec::as_slice);
    let (yaw, yaw_rate, vx, vy) = (column("yaw"), column("yaw_rate"), column("vx"), column("vy"));
    if !yaw.is_empty() || yaw_rate.is_empty() {
        return (yaw.to_vec(), !yaw.is_empty());
    }
    let (x, y) = (column("x"), column("y"));
    let has_place = !x.is_empty() && !y.is_empty();
    let mut heading = vec![0.0; yaw_rate.len()];
    for &(from, to) in pieces {
        for i in from + 1..to {
            heading[i] = heading[i - 1] + 0.5 * step * (yaw_rate[i - 1] + yaw_rate[i]);
        }
        if has_place {
            // The mean of where it moves to, less where it points to and slides.
            let (mut east, mut north) = (0.0, 0.0);
            for i in from..to.saturating_sub(1) {
                let (dx, dy) = (x[i + 1] - x[i], y[i + 1] - y[i]);
                let slip = vy.get(i).map_or(0.0, |vy| vy.atan2(vx[i].max(LEAST_SPEED)));
                let (sin, cos) = (heading[i] + slip).sin_cos();
                east += cos * dx + sin * dy;
                north += cos * dy - sin * dx;
            }
            let start = north.atan2(east);
            heading[from..to].iter_mut().for_each(|heading| *heading += start);
        }
    }
    (heading, has_place)
}

/// A log at half its rate: commands by the mean of the held values, measurements by a mean about the row.
fn halved(log: &CleanLog) -> CleanLog {
    let rows = log.time.len();
    // Rows that are kept, each with the ends of its piece.
    let kept: Vec<(usize, usize, usize)> = pieces(&log.time, log.step)
        .into_iter()
        .flat_map(|(from, to)| (from..to).step_by(2).map(move |i| (i, from, to)))
        .collect();
    let mean = |name: &str, column: &[f64]| -> Vec<f64> {
        let held = name == "accel_cmd" || name == "steer_cmd" && log.commanded;
        let of = |&(i, from, to): &(usize, usize, usize)| {
            let at = |i: usize| column[i.min(to - 1)];
            if held {
                0.5 * (at(i) + at(i + 1))
            } else if i == from {
                at(i)
            } else {
                0.25 * (at(i - 1) + 2.0 * at(i) + at(i + 1))
            }
        };
        kept.iter().map(of).collect()
    };
    let full = |column: &Vec<f64>| column.len() == rows;
    CleanLog {
        step: 2.0 * log.step,
        time: kept.iter().map(|&(i, ..)| log.time[i]).collect(),
        columns: log
            .columns
            .iter()
            .filter(|(_, c)| full(c))
            .map(|(&name, c)| (name, mean(name, c)))
            .collect(),
        commanded: log.commanded,
        valid: kept
            .iter()
            .map(|&(i, ..)| {
                (i.saturating_sub(1)..=i + 1).all(|i| i >= rows || log.valid.get(i).copied().unwrap_or(false))
            })
            .collect(),
        coarse: log.coarse.clone(),
        findings: Vec::new(),
    }
}

/// Rate of change of the speed over half a second, m/s2.
fn acceleration(vx: &[f64], step: f64) -> Vec<f64> {
    let half = (0.25 / step).ceil().max(1.0) as usize;
    let rows = vx.len();
    (0..rows)
        .map(|i| {
            let (from, to) = (i.saturating_sub(half), (i + half).min(rows - 1));
            if to > from { (vx[to] - vx[from]) / ((to - from) as f64 * step) } else { 0.0 }
        })
        .collect()
}

/// A column at a fractional row of a stretch, as [`at`], held beyond the stretch's ends.
#[inline]
#[must_use]
pub fn at_within(column: &[f64], row: f64, (from, to): (usize, usize)) -> f64 {
    at(column, row.clamp(from as f64, (to - 1) as f64))
}

/// A column at a fractional row, linear between rows, held beyond the ends.
#[inline]
#[must_use]
pub fn at(column: &[f64], row: f64) -> f64 {
    if row <= 0.0 {
        return column[0];
    }
    let i = row as usize;
    match column.get(i + 1) {
        Some(next) => column[i] + (row - i as f64) * (next - column[i]),
        None => column[column.len() - 1],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f64 = 0.02;
    const SPEED: f64 = 15.0;

    /// First compared row of a drive that is straight and bends from a time in s on, with a bias of its yaw rate.
    fn compared_from(bends_at: f64, bias: f64, truck: bool) -> f64 {
        let rows = 1000;
        let rate = |i: usize| bias + if i as f64 * STEP < bends_at { 0.0 } else { 0.05 };
        let columns = [
            ("vx", vec![SPEED; rows]),
            ("steer_cmd", vec![0.0; rows]),
            ("yaw_rate", (0..rows).map(rate).collect()),
        ];
        let log = CleanLog::of_columns(STEP, columns.into());
        let drive = ReplayDrive::new(&log, truck);
        drive.scored.iter().position(|&scored| scored).expect("some row is compared") as f64 * STEP
    }

    #[test]
    fn a_truck_is_compared_from_the_first_bend_on_and_a_car_at_once() {
        for bias in [0.0, 0.03] {
            let from = compared_from(6.0, bias, true);
            assert!((6.0..6.0 + BENT_FOR).contains(&from), "{from}");
            assert!((compared_from(1.0, bias, true) - SETTLING).abs() < STEP);
            assert!((compared_from(15.0, bias, true) - LONGEST_WAIT).abs() < STEP);
            assert!((compared_from(6.0, bias, false) - SETTLING).abs() < STEP);
        }
    }
}
