//! The rows of drives for a fit: stretches without gaps, without wrong values, with a mark for rows that count.

use super::steering_drive::{LeftOut, SteeringDrive};
use std::borrow::Cow;

/// Longest hole with known commands, s: a longer one ends the stretch.
const LONGEST_HOLE: f64 = 0.15;
/// Number of steps without a row that is a hole, for slow rows.
const HOLE_STEPS: f64 = 2.5;
/// Distance of a wrong value, in ranges of the ordinary ones.
const FAR_OUT: f64 = 3.0;
/// Least range of ordinary values, rad or rad/s: that of a sensor at rest.
const LEAST_RANGE: f64 = 1e-2;
/// Useful rows a second while the command stands: more tell nothing of an actuator.
const FASTEST: f64 = 100.0;
/// Fewest distances between numbers that tell the step in which they are written, and share of them that are whole
/// multiples of it, within a share of it.
const FEWEST_STEPS: usize = 3;
const WHOLE: f64 = 0.95;
const EVEN: f64 = 0.05;
/// Fewest rests of a command that tell how it is recorded.
const FEWEST_RESTS: usize = 12;
/// Time after which the command before a stretch is forgotten, s; or a quarter of the stretch.
const FORGOTTEN: f64 = 1.0;

/// Rows of all drives, one after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct DriveRows {
    /// s, rising within a stretch.
    pub time: Vec<f64>,
    /// rad, finite.
    pub command: Vec<f64>,
    /// rad or rad/s less `mean`; 0 in a gap, where the row does not count.
    pub response: Vec<f64>,
    /// m/s; empty where it is not needed.
    pub speed: Vec<f64>,
    /// True for each row that counts.
    pub counts: Vec<bool>,
    /// First row of each stretch.
    pub begins: Vec<usize>,
    /// First row of each piece with a free response of its own; a stretch begins one.
    pub pieces: Vec<usize>,
    /// Drive and row that each came from.
    pub origin: Vec<(u32, u32)>,
    /// Values that were taken out.
    pub left_out: Vec<LeftOut>,
    /// Mean of the responses that count.
    pub mean: f64,
    /// Typical time between rows, s.
    pub step: f64,
    /// Step in which each drive's response was written, 0 if it is not seen.
    pub resolutions: Vec<f64>,
    /// True if commands lie on lines between those that changed.
    pub laid: bool,
}

/// Least and greatest ordinary value, far ones beyond.
fn ordinary(values: &[f64]) -> [f64; 2] {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return [0.0; 2] };
    let at = |share: f64| sorted[(share * last as f64).round() as usize];
    let [low, high] = [at(0.005), at(0.995)];
    let range = FAR_OUT * (high - low).max(LEAST_RANGE);
    [low - range, high + range]
}

/// Typical step of a drive's clock, s.
fn typical_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> =
        time.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// Step in which numbers are written: they lie close enough to show that their distances are whole multiples of one. 0 if
/// none is seen.
fn written_step(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (sorted.first(), sorted.last()) else { return 0.0 };
    let rounding = 1e-9 * (last - first);
    let mut gaps: Vec<f64> =
        sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > rounding).collect();
    if gaps.len() < FEWEST_STEPS {
        return 0.0;
    }
    gaps.sort_by(f64::total_cmp);
    let step = gaps[gaps.len() / 4];
    let whole = |gap: &&f64| (*gap / step - (*gap / step).round()).abs() < EVEN && **gap > 0.5 * step;
    let wholes = gaps.iter().filter(whole).count() as f64;
    if wholes >= WHOLE * gaps.len() as f64 { step } else { 0.0 }
}

/// Rows for which a command is repeated, where it changes on such a beat only; else 1.
fn held_rows(commands: &[f64]) -> usize {
    let rests: Vec<usize> = commands.chunk_by(|a, b| a == b).map(<[f64]>::len).collect();
    // Where the record begins and ends in a rest is chance.
    let Some(within) =
        rests.get(1..rests.len().saturating_sub(1)).filter(|within| within.len() >= FEWEST_RESTS)
    else {
        return 1;
    };
    let mut sorted = within.to_vec();
    sorted.sort_unstable();
    let beat = sorted[sorted.len() / 4];
    let on_beat = within.iter().filter(|rest| **rest % beat == 0).count() as f64;
    if on_beat >= WHOLE * within.len() as f64 { beat } else { 1 }
}

/// The first command of each beat; the others are no numbers.
fn told(commands: &[f64], beat: usize) -> Vec<f64> {
    let mut told = Vec::with_capacity(commands.len());
    for rest in commands.chunk_by(|a, b| a == b) {
        // The first rest may have begun before the record.
        let begun = if told.is_empty() { (beat - rest.len() % beat) % beat } else { 0 };
        let first = told.len();
        told.resize(first + rest.len(), f64::NAN);
        for (row, command) in rest.iter().enumerate() {
            if (row + begun) % beat == 0 || first + row == 0 {
                told[first + row] = *command;
            }
        }
    }
    told
}

impl DriveRows {
    /// The rows of drives, `even` where each row has to stay, as a model sampled at the clock needs it.
    pub fn of(drives: &[SteeringDrive], even: bool) -> Self {
        Self::collected(drives, even, false)
    }

    /// The same of drives whose record lost commands: rows, or commands that a recorder has repeated. Those that
    /// nobody recorded are on a line between those beside them, and held like these. `None` if none is missing.
    pub fn with_lost_rows(&self, drives: &[SteeringDrive]) -> Option<Self> {
        let filled = Self::collected(drives, false, true);
        (filled.command != self.command).then_some(filled)
    }

    fn collected(drives: &[SteeringDrive], even: bool, fill: bool) -> Self {
        let mut rows = Self::default();
        for (place, drive) in drives.iter().enumerate() {
            rows.add(place as u32, drive, even, fill);
        }
        rows.resolutions = drives.iter().map(|drive| written_step(&drive.response)).collect();
        rows.step = drives.iter().map(|drive| typical_step(&drive.time)).fold(0.0, f64::max);
        let stretches: Vec<_> = rows.stretches().collect();
        for stretch in stretches {
            rows.forget_beginning(stretch);
        }
        rows.pieces = rows.begins.clone();
        let (mut sum, mut count) = (0.0, 0.0);
        for (response, _) in rows.response.iter().zip(&rows.counts).filter(|(_, counts)| **counts) {
            sum += response;
            count += 1.0;
        }
        rows.mean = if count > 0.0 { sum / count } else { 0.0 };
        let mean = rows.mean;
        for (response, counts) in rows.response.iter_mut().zip(&rows.counts) {
            *response = if *counts { *response - mean } else { 0.0 };
        }
        rows
    }

    fn add(&mut self, place: u32, drive: &SteeringDrive, even: bool, fill: bool) {
        let repeated = if fill { held_rows(&drive.steer_cmd) } else { 1 };
        self.laid |= repeated > 1;
        let told = match repeated {
            1 => Cow::Borrowed(&drive.steer_cmd[..]),
            beat => Cow::Owned(told(&drive.steer_cmd, beat)),
        };
        let [low, high] = ordinary(&drive.steer_cmd);
        let [least, most] = ordinary(&drive.response);
        let step = typical_step(&drive.time);
        let hole = LONGEST_HOLE.max(HOLE_STEPS * step * repeated as f64);
        // Time of the last row with a command, and the command.
        let mut known: Option<(f64, f64)> = None;
        for row in 0..drive.time.len() {
            let (time, mut command, response) = (drive.time[row], told[row], drive.response[row]);
            let speed = drive.speed.get(row).copied();
            if !(time.is_finite() && known.is_none_or(|(last, _)| time > last)) {
                continue;
            }
            if command.is_finite() && !(low..=high).contains(&command) {
                self.left_out.push(LeftOut {
                    drive: place,
                    row: row as u32,
                    signal: "steer_cmd",
                    value: command,
                });
                command = f64::NAN;
            }
            if !command.is_finite() {
                // A short hole: the last command goes on.
                match known {
                    Some((last, held)) if time - last <= hole => command = held,
                    _ => continue,
                }
            } else {
                if known.is_none_or(|(last, _)| time - last > hole) {
                    self.begins.push(self.time.len());
                } else if let (false, Some((last, held))) = (even, known) {
                    let kept = self.time.last().copied().unwrap_or(f64::NEG_INFINITY);
                    let close = time - kept < 0.99 / FASTEST && time - last <= hole;
                    if command == held && close {
                        known = Some((time, command));
                        continue;
                    }
                    if fill && command != held {
                        self.fill((last, held), (time, command), step, (place, row as u32), speed);
                    }
                }
                known = Some((time, command));
            }
            let far = response.is_finite() && !(least..=most).contains(&response);
            if far {
                self.left_out.push(LeftOut {
                    drive: place,
                    row: row as u32,
                    signal: "response",
                    value: response,
                });
            }
            let counts = response.is_finite() && !far;
            self.time.push(time);
            self.command.push(command);
            self.response.push(if counts { response } else { 0.0 });
            self.counts.push(counts);
            self.origin.push((place, row as u32));
            self.speed.extend(speed);
        }
    }

    /// Puts commands on the line between two known ones: at rows without any, or at the instants whose rows are missing.
    fn fill(
        &mut self,
        (last, held): (f64, f64),
        (time, command): (f64, f64),
        step: f64,
        origin: (u32, u32),
        speed: Option<f64>,
    ) {
        let on_line = |now: f64| held + (command - held) * (now - last) / (time - last);
        let without = self.time.iter().rposition(|kept| *kept <= last).map_or(0, |row| row + 1);
        for row in without..self.time.len() {
            self.command[row] = on_line(self.time[row]);
        }
        let steps = ((time - last) / step).round();
        if without < self.time.len() || !steps.is_finite() {
            return;
        }
        for k in 1..steps as u32 {
            let now = last + (time - last) * f64::from(k) / steps;
            self.time.push(now);
            self.command.push(on_line(now));
            self.response.push(0.0);
            self.counts.push(false);
            self.origin.push(origin);
            self.speed.extend(speed);
        }
    }

    /// Leaves out the beginning of a stretch whose earlier command is not known, unless the command stands there.
    fn forget_beginning(&mut self, stretch: std::ops::Range<usize>) {
        let (first, time) = (self.command[stretch.start], &self.time);
        let begin = time[stretch.start];
        let stands =
            stretch.clone().take_while(|&row| self.command[row] == first).last().unwrap_or(stretch.start);
        let length = time[stretch.end - 1] - begin;
        let forgotten = FORGOTTEN.min(0.25 * length) - (time[stands] - begin);
        for row in stretch {
            if time[row] - begin >= forgotten {
                break;
            }
            self.counts[row] = false;
        }
    }

    /// Stretches without a gap.
    pub fn stretches(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        ranges(&self.begins, self.time.len())
    }

    /// Number of rows that count.
    pub fn counted(&self) -> usize {
        self.counts.iter().filter(|counts| **counts).count()
    }

    /// Half the range of the commands, rad.
    pub fn half_range(&self) -> f64 {
        let (low, high) = self
            .command
            .iter()
            .fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(*value), high.max(*value)));
        0.5 * (high - low)
    }

    /// Blocks with the most motion of the command, of about `limit` rows together, and their places.
    pub fn most_moved(&self, limit: usize, block: usize) -> (Self, Vec<usize>) {
        let mut blocks: Vec<(f64, std::ops::Range<usize>)> = Vec::new();
        for stretch in self.stretches() {
            let mut from = stretch.start;
            while from < stretch.end {
                let to = (from + block).min(stretch.end);
                let moved = self.command[from..to].windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
                blocks.push((moved, from..to));
                from = to;
            }
        }
        blocks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.start.cmp(&b.1.start)));
        blocks.truncate(limit.div_ceil(block));
        blocks.sort_by_key(|(_, range)| range.start);
        let mut part = Self { step: self.step, mean: self.mean, ..Self::default() };
        let mut places = Vec::new();
        for (_, range) in blocks {
            places.extend(range.clone());
            part.begins.push(part.time.len());
            part.time.extend_from_slice(&self.time[range.clone()]);
            part.command.extend_from_slice(&self.command[range.clone()]);
            part.response.extend_from_slice(&self.response[range.clone()]);
            part.counts.extend_from_slice(&self.counts[range.clone()]);
            part.origin.extend_from_slice(&self.origin[range.clone()]);
            if !self.speed.is_empty() {
                part.speed.extend_from_slice(&self.speed[range]);
            }
        }
        let stretches: Vec<_> = part.stretches().collect();
        for stretch in stretches {
            part.forget_beginning(stretch);
        }
        part.pieces = part.begins.clone();
        (part, places)
    }
}

/// The ranges between begins.
pub(super) fn ranges(begins: &[usize], end: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
    begins.iter().enumerate().map(move |(i, &from)| from..begins.get(i + 1).copied().unwrap_or(end))
}
