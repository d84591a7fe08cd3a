//! Stretches in which a vehicle spins, or slides far sideways.
//!
//! ```text
//!     |atan2(vy, vx)| > SPINNING
//! ```
//!
//! Beyond the angle at which tyres grip most, the motion is unstable: two vehicles that differ by nothing that can be measured go
//! different ways. No replay of the commands follows, and no cause is to be read from how it fails.

use super::clean_log::{CleanLog, STANDING};
use super::rows::runs;
use std::ops::Range;

/// Sideslip at the CG beyond which no tyre holds, rad: twice the slip angle at which most tyres grip most.
const SPINNING: f64 = 0.3;
/// Times before and after, s, in which a replay goes another way, or has not come back.
const BEFORE: f64 = 0.5;
const AFTER: f64 = 2.0;
/// Shortest stretch, s: a single value is an outlier.
const SHORTEST: f64 = 0.1;

/// Largest share of a drive that spins.
const MOST: f64 = 0.3;

/// Takes stretches out of the comparison in which the vehicle spins.
pub(super) fn leave_out(log: &mut CleanLog) {
    let (Some(vx), Some(vy)) = (log.columns.get("vx"), log.columns.get("vy")) else { return };
    let spins =
        |row: usize| vx[row].hypot(vy[row]) > STANDING && vy[row].atan2(vx[row].abs()).abs() > SPINNING;
    let rows: Vec<usize> = (0..vx.len()).filter(|&row| log.valid[row] && spins(row)).collect();
    let least = log.rows_in(SHORTEST);
    let stretches: Vec<Range<usize>> = runs(&rows).filter(|rows| rows.len() >= least).collect();
    // A column that says so for most of the drive is another quantity: units and signs are told elsewhere.
    let moving = (0..vx.len()).filter(|&row| log.valid[row] && vx[row].abs() > STANDING).count();
    let Some(first) = stretches.first().filter(|_| rows.len() as f64 <= MOST * moving as f64).cloned() else {
        return;
    };
    let mut valid = log.valid.clone();
    let (before, after) = (log.rows_in(BEFORE), log.rows_in(AFTER));
    for rows in &stretches {
        let around = rows.start.saturating_sub(before)..(rows.end + after).min(valid.len());
        valid[around].fill(false);
    }
    let what = format!(
        "the vehicle spins or slides for {:.1} s in all, first from {:.2} s to {:.2} s, with more than {SPINNING} rad of sideslip",
        log.step * stretches.iter().map(Range::len).sum::<usize>() as f64,
        log.time[first.start],
        log.time[first.end - 1]
    );
    log.not_judged(valid, "vy", &what, "; no replay follows a spin");
}
