//! Jumps of the vehicle's place that its speed does not explain, while the clock goes on.
//!
//! Rows were lost and their clock was numbered anew, two drives stand in one file, or a receiver has lost its way:
//!
//! ```text
//!     |p[i] - p[i - 1]| - int vx dt  >  10 x its usual size,   and more than the way of a tenth of a second
//! ```
//!
//! A drive ends there, and another one begins.

use super::agreement::Factors;
use super::clock::Clock;
use super::rows::{LogColumns, WrongRows};
use crate::numerics::statistics::{median, quantile};

/// Size of a jump, over the 99th percentile of the differences between way and speed.
const UNUSUAL: f64 = 10.0;
/// Time in which a moving vehicle drives a way as long as a jump, s.
const LEAST_TIME: f64 = 0.1;
/// Longest time between two places, s: over a longer one the speed's own errors add up.
const CLOSE: f64 = 1.5;

/// A jump.
pub(super) struct Jump {
    /// Row of the file that begins anew.
    pub row: usize,
    /// Way beyond that by speed, m.
    pub way: f64,
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
    let (Some(x), Some(y), Some(vx)) = (column("x"), column("y"), column("vx")) else { return Vec::new() };
    drives.iter().flat_map(|drive| of_drive(drive, [&x, &y, &vx])).collect()
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
    steps.into_iter().filter(|(_, way)| *way > least).map(|(row, way)| Jump { row, way }).collect()
}
