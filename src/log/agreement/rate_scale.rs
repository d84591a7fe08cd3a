//! Scale of the yaw-rate sensor, by the yaw angle.
//!
//! Over spans of time, with an offset of the rate and a lateness of the angle,
//!
//! ```text
//! d(yaw) = s d(integral of yaw_rate) + b dt - T d(yaw_rate) + e
//! ```
//!
//! is solved for `s` by least squares, with its standard error. Where `x`, `y` and `vx` say that the clock is right, an `s`
//! that is clearly not 1 is a sensor's scale. A diagnosis has no effect for it, and would name a cause in the vehicle.

use super::ratios::way;
use crate::log::clean_log::CleanLog;
use nalgebra::{Matrix3, Vector3};

/// Length of a span, s.
const SPAN: f64 = 1.0;
/// Least number of spans.
const FEW: usize = 10;
/// Scale from which on it is named, as a logarithm: the error of an ordinary sensor is a hundredth.
const LEAST: f64 = 0.03;
/// Error of the clock up to which it is right, as a logarithm: a way is a chord of its bend.
const RIGHT: f64 = 0.02;
/// How many standard errors are clear.
const CLEAR: f64 = 5.0;

/// Words on a yaw rate with a wrong scale.
pub(super) fn words(log: &CleanLog) -> Option<String> {
    way(log).filter(|way| way.ln().abs() < RIGHT)?;
    let (scale, error) = scale(log)?;
    let off = scale.ln().abs();
    (off > LEAST && off > CLEAR * error / scale).then(|| {
        format!(
            "yaw turns {scale:.3} times as fast as yaw_rate says, and x and y move as vx says: the scale of yaw_rate is wrong (or of \
             yaw); calibrate the sensor, or multiply yaw_rate by {scale:.3}"
        )
    })
}

/// Change of yaw for each unit of the integrated yaw rate, and its standard error.
fn scale(log: &CleanLog) -> Option<(f64, f64)> {
    let (yaw, rate) = (log.columns.get("yaw")?, log.columns.get("yaw_rate")?);
    let (mut products, mut by_yaw, mut square, mut count) =
        (Matrix3::zeros(), Vector3::zeros(), 0.0, 0_usize);
    let rows = (SPAN / log.step).round().max(1.0) as usize;
    let mut begin = 0;
    while begin + rows < log.time.len() {
        let span = begin..=begin + rows;
        begin += rows;
        let whole = span.clone().all(|row| log.valid[row] && yaw[row].is_finite() && rate[row].is_finite());
        let (first, last) = (*span.start(), *span.end());
        let elapsed = log.time[last] - log.time[first];
        if !whole || elapsed > 1.5 * SPAN {
            continue;
        }
        let turned: f64 = (first..last)
            .map(|row| 0.5 * (rate[row] + rate[row + 1]) * (log.time[row + 1] - log.time[row]))
            .sum();
        let regressors = Vector3::new(turned, elapsed, rate[last] - rate[first]);
        let change = yaw[last] - yaw[first];
        products += regressors * regressors.transpose();
        by_yaw += regressors * change;
        square += change * change;
        count += 1;
    }
    let inverse = products.try_inverse().filter(|_| count >= FEW)?;
    let found = inverse * by_yaw;
    let left = (square - found.dot(&by_yaw)).max(0.0) / (count - 3) as f64;
    let error = (left * inverse[(0, 0)]).sqrt();
    (found[0] > 0.0 && error.is_finite()).then_some((found[0], error))
}
