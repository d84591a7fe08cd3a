//! Stretches in which a vehicle drives backwards and its speed has no sign.
//!
//! Wheel sensors and receivers tell how fast, not whereto. In reverse with `v = |vx|`
//!
//! ```text
//!     d(x, y) along the heading = -int v dt        ay = -v yaw_rate        steer = -needed(v, yaw_rate)
//! ```
//!
//! A vehicle stands before it turns about, so that each stretch between stands is driven one way. Where all of them are backwards,
//! a column's sign is wrong, which [`super::agreement`] tells.

use super::clean_log::CleanLog;
use std::ops::Range;

/// Shortest stretch that is looked at, and that of which the means are taken, s.
const SHORTEST: f64 = 2.0;
const BLOCK: f64 = 0.5;
/// Slope in standard errors that tells a direction.
const SURE: f64 = 5.0;

/// Takes stretches out of the comparison that are driven backwards. `steering` is the road-wheel angle for a unit of curvature at a speed.
pub(super) fn leave_out(log: &mut CleanLog, steering: &dyn Fn(f64) -> f64) {
    let stretches = stretches(log);
    if stretches.len() < 2 {
        return;
    }
    let ways: Vec<Option<f64>> =
        stretches.iter().map(|rows| direction(log, rows.clone(), steering)).collect();
    let is_forward = ways.iter().flatten().any(|way| *way > 0.0);
    let back: Vec<&Range<usize>> = stretches
        .iter()
        .zip(&ways)
        .filter(|(_, way)| way.is_some_and(|way| way < 0.0))
        .map(|(rows, _)| rows)
        .collect();
    let (true, Some(first)) = (is_forward, back.first()) else { return };
    let mut valid = log.valid.clone();
    back.iter().for_each(|rows| valid[(*rows).clone()].fill(false));
    let what = format!(
        "the vehicle reverses for {:.1} s in all, first from {:.2} s to {:.2} s, and vx has no sign",
        log.step * back.iter().map(|rows| rows.len()).sum::<usize>() as f64,
        log.time[first.start],
        log.time[first.end - 1]
    );
    log.not_judged(valid, "vx", &what, "; give vx negative in reverse");
}

/// Stretches between stands.
fn stretches(log: &CleanLog) -> Vec<Range<usize>> {
    let vx = &log.columns["vx"];
    let (mut found, mut start) = (Vec::new(), None);
    for row in 0..=vx.len() {
        let moves = row < vx.len() && vx[row] >= super::clean_log::STANDING;
        match (moves, start) {
            (true, None) => start = Some(row),
            (false, Some(from)) => {
                found.push(from..row);
                start = None;
            }
            _ => {}
        }
    }
    found.retain(|rows| log.step * rows.len() as f64 >= SHORTEST);
    found
}

/// Positive where a stretch is driven forwards, negative where backwards; `None` where nothing tells.
fn direction(log: &CleanLog, rows: Range<usize>, steering: &dyn Fn(f64) -> f64) -> Option<f64> {
    let size = log.rows_in(BLOCK);
    let starts: Vec<usize> = rows.step_by(size).collect();
    let blocks: Vec<Range<usize>> = starts.windows(2).map(|pair| pair[0]..pair[1]).collect();
    let mean = |name: &str| -> Option<Vec<f64>> {
        let values = log.columns.get(name)?;
        let of = |rows: &Range<usize>| values[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
        Some(blocks.iter().map(of).collect())
    };
    let vx = mean("vx")?;
    let place = || {
        let [x, y, yaw] = ["x", "y", "yaw"].map(&mean);
        let (x, y, yaw) = (x?, y?, yaw?);
        let along = |k: usize| {
            let heading = 0.5 * (yaw[k] + yaw[k + 1]);
            (x[k + 1] - x[k]) * heading.cos() + (y[k + 1] - y[k]) * heading.sin()
        };
        let way = |k: usize| 0.5 * (vx[k] + vx[k + 1]) * size as f64 * log.step;
        sure((0..vx.len().saturating_sub(1)).map(|k| (way(k), along(k))))
    };
    let rate = mean("yaw_rate");
    let lateral = || {
        let (rate, ay) = (rate.as_ref()?, mean("ay")?);
        sure((0..vx.len()).map(|k| (vx[k] * rate[k], ay[k])))
    };
    let steered = || {
        let (rate, steer) = (rate.as_ref()?, mean("steer").or_else(|| mean("steer_cmd"))?);
        sure((0..vx.len()).map(|k| (steering(vx[k]) * rate[k] / vx[k], steer[k])))
    };
    place().or_else(lateral).or_else(steered)
}

/// Slope through the origin of pairs, if it is more than its standard errors.
fn sure(pairs: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let pairs: Vec<(f64, f64)> = pairs.filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let xx: f64 = pairs.iter().map(|(x, _)| x * x).sum();
    if pairs.len() < 3 || xx == 0.0 {
        return None;
    }
    let slope = pairs.iter().map(|(x, y)| x * y).sum::<f64>() / xx;
    let left: f64 = pairs.iter().map(|(x, y)| (y - slope * x).powi(2)).sum();
    let error = (left / (pairs.len() - 1) as f64 / xx).sqrt();
    (slope.abs() > SURE * error).then_some(slope)
}
