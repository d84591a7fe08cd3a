//! Jumps of the vehicle's place that its speed does not explain, while the clock goes on.
//!
//! Rows were lost and their clock was numbered anew, two drives stand in one file, or a receiver has lost its way:
//!
//! ```text
//!     |p[i] - p[i - 1]| - int vx dt  >  10 x its usual size,   and more than the way of a tenth of a second
//! ```
//!
//! A drive ends there, and another one begins. A receiver that has lost its way drifts before it jumps back, or after it has
//! jumped: the seconds on either side in which the place moves otherwise than speed and heading say are left out,
//!
//! ```text
//!     |d(x, y) - int v dt| over a second  >  4 x its median        v: vx, vy by yaw
//! ```
//!
//! Without a place the heading tells it, or else speed and yaw rate at once, where they stay apart from what they were:
//!
//! ```text
//!     |yaw[i] - yaw[i - 1] - int yaw_rate dt|   or   |d(vx)| and |d(yaw_rate)|  >  10 x their usual size
//! ```

use super::agreement::Factors;
use super::clock::Clock;
use super::rows::{LogColumns, WrongRows};
use crate::numerics::statistics::{median, quantile};
use crate::path::wrap_angle;
use std::ops::Range;

/// Size of a jump, over the 99th percentile of the differences between way and speed.
const UNUSUAL: f64 = 10.0;
/// Time in which a moving vehicle drives a way as long as a jump, s.
const LEAST_TIME: f64 = 0.1;
/// Longest time between two places, s: over a longer one the speed's own errors add up.
const CLOSE: f64 = 1.5;

/// Length of the stretches in which a place drifts or does not, s.
const STRETCH: f64 = 1.0;
/// Drift over such a stretch, in usual ones.
const DRIFTS: f64 = 4.0;
/// Stretches without a drift that end it.
const SOUND: usize = 2;

/// A jump.
pub(super) struct Jump {
    /// Row of the file that begins anew.
    pub row: usize,
    /// What jumps, and how far.
    pub beyond: Beyond,
    /// Rows of the file beside it whose place drifts.
    pub astray: Vec<usize>,
}

/// Jump of a signal beyond what others say.
#[derive(Debug, Clone, Copy)]
pub(super) enum Beyond {
    /// Of the place, over that by speed, m.
    Way(f64),
    /// Of the heading, over that by the yaw rate, rad.
    Turn(f64),
    /// Of the speed, m/s, with one of the yaw rate.
    Speed(f64),
}

impl Beyond {
    /// Its size, in words.
    pub fn size(self) -> String {
        match self {
            Self::Way(way) => format!("{way:.1} m"),
            Self::Turn(turn) => format!("{turn:.2} rad"),
            Self::Speed(speed) => format!("{speed:.1} m/s"),
        }
    }

    /// The column and its jump, in words.
    pub fn words(self) -> (&'static str, String) {
        let size = self.size();
        match self {
            Self::Way(_) => {
                ("x", format!("the vehicle is {size} farther on than vx takes it from the row before"))
            }
            Self::Turn(_) => {
                ("yaw", format!("yaw turns {size} farther than yaw_rate says from the row before"))
            }
            Self::Speed(_) => ("vx", format!("vx jumps by {size} and yaw_rate with it")),
        }
    }
}

/// Jumps in the drives of a log, by its rows.
pub(super) fn jumps(
    log: &LogColumns,
    drives: &[Clock],
    factors: &Factors,
    left_out: &WrongRows,
) -> Vec<Jump> {
    let column = |name: &'static str| -> Option<Vec<f64>> {
        let factor = factors.get(name).copied().unwrap_or(1.0);
        let mut values: Vec<f64> = log.get(name)?.iter().map(|value| factor * value).collect();
        left_out.get(name).into_iter().flatten().for_each(|&row| values[row] = f64::NAN);
        Some(values)
    };
    let Some(vx) = column("vx") else { return Vec::new() };
    let (yaw, vy) = (column("yaw"), column("vy"));
    let (Some(x), Some(y)) = (column("x"), column("y")) else {
        let Some(rate) = column("yaw_rate") else { return Vec::new() };
        return drives.iter().flat_map(|drive| of_motion(drive, &vx, &rate, yaw.as_deref())).collect();
    };
    let mut jumps = Vec::new();
    for drive in drives {
        let mut found = of_drive(drive, [&x, &y, &vx]);
        if let (Some(yaw), false) = (&yaw, found.is_empty()) {
            leave_out_drift(drive, [&x, &y, &vx, yaw], vy.as_deref(), &mut found);
        }
        jumps.append(&mut found);
    }
    jumps
}

/// Notes the rows beside each jump in which the place drifts.
fn leave_out_drift(drive: &Clock, [x, y, vx, yaw]: [&[f64]; 4], vy: Option<&[f64]>, jumps: &mut [Jump]) {
    let known = |row: &usize| [x, y, vx, yaw].iter().all(|column| column[*row].is_finite());
    let velocity = |row: usize| {
        let (sin, cos) = yaw[row].sin_cos();
        let vy = vy.map_or(0.0, |vy| vy[row]);
        let vy = if vy.is_finite() { vy } else { 0.0 };
        [vx[row] * cos - vy * sin, vx[row] * sin + vy * cos]
    };
    let is_jump = |row: usize| jumps.iter().any(|jump| jump.row == row);
    // Stretches: the first of their rows in the drive and the one behind the last, and the drift in m/s. None crosses a jump.
    let mut stretches: Vec<(usize, usize, f64)> = Vec::new();
    let (mut from, mut drift) = (0, [0.0; 2]);
    for i in 1..drive.rows.len() {
        let [before, row] = [drive.rows[i - 1], drive.rows[i]];
        let (step, lasts) = (drive.time[i] - drive.time[i - 1], drive.time[i] - drive.time[from]);
        if is_jump(row) || !(known(&before) && known(&row)) || step > CLOSE {
            (from, drift) = (i, [0.0; 2]);
            continue;
        }
        let moved = [x[row] - x[before], y[row] - y[before]];
        let [a, b] = [velocity(before), velocity(row)];
        for axis in 0..2 {
            drift[axis] += moved[axis] - 0.5 * step * (a[axis] + b[axis]);
        }
        if lasts >= STRETCH {
            stretches.push((from, i + 1, drift[0].hypot(drift[1]) / lasts));
            (from, drift) = (i, [0.0; 2]);
        }
    }
    let Some(usual) = median(stretches.iter().map(|stretch| stretch.2).collect()) else { return };
    for jump in jumps {
        let Some(place) = drive.rows.iter().position(|&row| row == jump.row) else { continue };
        let (before, after): (Vec<_>, Vec<_>) = stretches.iter().partition(|stretch| stretch.1 <= place);
        let first = drifting(before.into_iter().rev(), usual).map_or(place, |stretch| stretch.0);
        let end = drifting(after.into_iter(), usual).map_or(place, |stretch| stretch.1);
        jump.astray = drive.rows[first..end].to_vec();
    }
}

/// The farthest of the stretches that drift, from the nearest on.
fn drifting<'a>(
    stretches: impl Iterator<Item = &'a (usize, usize, f64)>,
    usual: f64,
) -> Option<(usize, usize, f64)> {
    let (mut farthest, mut sound) = (None, 0);
    for stretch in stretches {
        if stretch.2 > DRIFTS * usual {
            (farthest, sound) = (Some(*stretch), 0);
        } else {
            sound += 1;
            if sound == SOUND {
                break;
            }
        }
    }
    farthest
}

fn of_drive(drive: &Clock, [x, y, vx]: [&[f64]; 3]) -> Vec<Jump> {
    // Ways by speed up to each row.
    let (mut ways, mut way, mut before) = (Vec::with_capacity(drive.rows.len()), 0.0, None);
    for (&row, &time) in drive.rows.iter().zip(&drive.time) {
        if vx[row].is_finite() {
            way += before
                .map_or(0.0, |(since, speed): (f64, f64)| 0.5 * (speed + vx[row]).abs() * (time - since));
            before = Some((time, vx[row]));
        }
        ways.push(way);
    }
    let placed: Vec<usize> = (0..drive.rows.len())
        .filter(|&i| x[drive.rows[i]].is_finite() && y[drive.rows[i]].is_finite())
        .collect();
    let steps: Vec<(usize, f64)> = placed
        .windows(2)
        .filter(|pair| drive.time[pair[1]] - drive.time[pair[0]] < CLOSE)
        .map(|pair| {
            let [from, to] = [drive.rows[pair[0]], drive.rows[pair[1]]];
            (to, (x[to] - x[from]).hypot(y[to] - y[from]) - (ways[pair[1]] - ways[pair[0]]))
        })
        .collect();
    let sizes = steps.iter().map(|(_, excess)| excess.abs()).collect();
    let speeds = drive.rows.iter().map(|&row| vx[row].abs()).collect();
    let (Some(usual), Some(speed)) = (quantile(sizes, 0.99), median(speeds)) else { return Vec::new() };
    let least = (UNUSUAL * usual).max(LEAST_TIME * speed);
    steps
        .into_iter()
        .filter(|(_, way)| *way > least)
        .map(|(row, way)| Jump { row, beyond: Beyond::Way(way), astray: Vec::new() })
        .collect()
}

/// Least jumps of heading, rad, speed, m/s2, and yaw rate, rad/s2, that are none of a vehicle.
const LEAST_TURN: f64 = 0.1;
const LEAST_BRAKING: f64 = 20.0;
const LEAST_SWERVE: f64 = 5.0;
/// Rows on either side whose middle values stay apart.
const BESIDE: usize = 5;

/// Jumps of a drive without a place.
fn of_motion(drive: &Clock, vx: &[f64], rate: &[f64], yaw: Option<&[f64]>) -> Vec<Jump> {
    // Heading beyond that by the yaw rate, up to each row.
    let (mut beyond, mut total) = (vec![f64::NAN; drive.rows.len()], 0.0);
    let mut before: Option<usize> = None;
    let rates: Vec<f64> = drive.rows.iter().map(|&row| rate[row]).collect();
    for (i, &row) in drive.rows.iter().enumerate() {
        let Some(yaw) = yaw.filter(|yaw| yaw[row].is_finite() && rates[i].is_finite()) else { continue };
        if let Some(last) = before.filter(|last| drive.time[i] - drive.time[*last] < CLOSE) {
            let turned = 0.5 * (rates[last] + rates[i]) * (drive.time[i] - drive.time[last]);
            total += wrap_angle(yaw[row] - yaw[drive.rows[last]] - turned);
        }
        beyond[i] = total;
        before = Some(i);
    }
    let speeds: Vec<f64> = drive.rows.iter().map(|&row| vx[row]).collect();
    let by_turn: Vec<(usize, f64)> = steps(&beyond, &drive.time, |_| LEAST_TURN);
    let by_speed = steps(&speeds, &drive.time, |apart| LEAST_BRAKING * apart);
    let by_rate = steps(&rates, &drive.time, |apart| LEAST_SWERVE * apart);
    let with_rate = by_speed.into_iter().filter(|(i, _)| by_rate.iter().any(|(other, _)| other == i));
    let turns = by_turn.iter().map(|&(i, size)| (i, Beyond::Turn(size)));
    let speeds = with_rate.map(|(i, size)| (i, Beyond::Speed(size)));
    let mut found: Vec<(usize, Beyond)> = turns.chain(speeds).collect();
    found.sort_by_key(|(i, _)| *i);
    found.dedup_by_key(|(i, _)| *i);
    let jump = |(i, beyond): (usize, Beyond)| Jump { row: drive.rows[i], beyond, astray: Vec::new() };
    found.into_iter().map(jump).collect()
}

/// Steps of a signal from row to row, beyond the usual and a least one, after which it stays apart.
fn steps(values: &[f64], time: &[f64], least: impl Fn(f64) -> f64) -> Vec<(usize, f64)> {
    let change = |i: usize| values[i] - values[i - 1];
    let sizes = (1..values.len()).map(|i| change(i).abs()).filter(|size| size.is_finite()).collect();
    let Some(usual) = quantile(sizes, 0.99) else { return Vec::new() };
    let most = |i: usize| (UNUSUAL * usual).max(least(time[i] - time[i - 1]));
    let middle = |rows: Range<usize>| median(values[rows].to_vec());
    let stays = |i: &usize| {
        let (before, after) =
            (middle(i.saturating_sub(BESIDE)..*i), middle(*i..(i + BESIDE).min(values.len())));
        before.zip(after).is_some_and(|(before, after)| (after - before).abs() > 0.5 * change(*i).abs())
    };
    let is_step = |i: &usize| change(*i).abs() > most(*i) && stays(i);
    (1..values.len()).filter(is_step).map(|i| (i, change(i).abs())).collect()
}
