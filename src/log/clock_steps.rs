//! Steps of the clock ahead, while the rows and the vehicle go on: a recorder's clock was set.
//!
//! ```text
//!     vx d(t) - |d(p)|  >  10 x its usual size      over a gap of the stamps; t, p, vx: means of some rows on either side
//! ```
//!
//! A vehicle that goes on for the time of a gap is farther on behind it. The time that passed is the way over the speed, in whole rows.

use super::agreement::Factors;
use super::clock::{Clock, GAP_STEPS};
use super::rows::LogColumns;
use crate::numerics::statistics::quantile;
use std::ops::Range;

/// Size of a step, over the 99th percentile of the differences between way and speed.
const UNUSUAL: f64 = 10.0;

/// Rows on either side of a gap whose mean is its edge: a receiver has noise.
const BESIDE: usize = 5;

/// A step of the clock.
pub(super) struct ClockStep {
    /// Row of the file before which it was set.
    pub row: usize,
    /// Time by which it was set ahead, s.
    pub ahead: f64,
}

/// Steps of the clock in the drives of a log.
pub(super) fn find(log: &LogColumns, drives: &[Clock], factors: &Factors) -> Vec<ClockStep> {
    let column =
        |name: &'static str| log.get(name).map(|values| (values, factors.get(name).copied().unwrap_or(1.0)));
    let (Some(x), Some(y), Some(vx)) = (column("x"), column("y"), column("vx")) else { return Vec::new() };
    let mut steps = Vec::new();
    for drive in drives {
        let mean = |rows: Range<usize>, (values, factor): (&Vec<f64>, f64)| {
            let count = rows.len() as f64;
            factor * rows.map(|i| values[drive.rows[i]]).sum::<f64>() / count
        };
        let clock = |rows: Range<usize>| rows.clone().map(|i| drive.time[i]).sum::<f64>() / rows.len() as f64;
        // Time, way and speed between the rows before a row and those from it on.
        let over = |i: usize| {
            let [before, after] = [i - BESIDE..i, i..i + BESIDE];
            let moved = |column| mean(after.clone(), column) - mean(before.clone(), column);
            let way = moved(x).hypot(moved(y));
            [clock(after.clone()) - clock(before.clone()), way, mean(before.start..after.end, vx).abs()]
        };
        let is_gap: Vec<bool> =
            drive.time.windows(2).map(|pair| pair[1] - pair[0] > GAP_STEPS * drive.spacing).collect();
        let lacks = |[time, way, speed]: [f64; 3]| speed * time - way;
        let inner = BESIDE..drive.rows.len().saturating_sub(BESIDE);
        // Whatever gap is near, it is to be the only one between the means.
        let gaps = |i: usize| is_gap[i - BESIDE..i + BESIDE - 1].iter().filter(|gap| **gap).count();
        let sizes = inner.clone().filter(|&i| gaps(i) == 0).map(|i| lacks(over(i)).abs());
        let Some(usual) = quantile(sizes.filter(|size| size.is_finite()).collect(), 0.99) else { continue };
        for i in inner.filter(|&i| is_gap[i - 1] && gaps(i) == 1) {
            let [time, way, speed] = over(i);
            if lacks([time, way, speed]) > UNUSUAL * usual {
                let gap = drive.time[i] - drive.time[i - 1];
                let rows = ((gap - time + way / speed) / drive.spacing).round().max(1.0);
                steps.push(ClockStep { row: drive.rows[i], ahead: gap - rows * drive.spacing });
            }
        }
    }
    steps.retain(|step| step.ahead > 0.0);
    steps
}
