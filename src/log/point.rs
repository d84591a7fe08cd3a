//! Points of the car at which an instrument gives the velocity across it, or the place: converted to the centre of gravity.
//!
//! ```text
//!     vy = vy(CG) + l yaw_rate        (x, y) = (x, y)(CG) + l (cos yaw, sin yaw)        l: forward
//! ```
//!
//! Receivers and optical heads often tell of the rear axle, or of the place where they stand. From the rear axle the way to such a
//! point is told by the motion ([`kinematics::vy_point`]); the vehicle tells how far its centre of gravity is from there.

use super::clean_log::CleanLog;
use super::finding::FindingSeverity;
use super::kinematics::{self, SURE_LEVER};

/// Least way that is one, m: the slip of a real car's rear axle, which is not quite linear, looks like up to 0.45 m.
const LEAST: f64 = 0.5;

/// Brings `vy`, and `x` and `y`, of another point to the centre of gravity. `rear`: from there back to the rear axle, m.
pub(super) fn mend(log: &mut CleanLog, rear: f64) {
    if let Some((lever, error)) = clear(kinematics::vy_point(log), rear)
        && let Some(rate) = log.columns.get("yaw_rate").cloned()
        && let Some(vy) = log.columns.get_mut("vy")
    {
        vy.iter_mut().zip(&rate).for_each(|(vy, rate)| *vy -= lever * rate);
        find(log, "vy", "vy is the velocity", lever, error);
    }
    if let Some((lever, error)) = clear(kinematics::place_point(log), rear)
        && let Some(yaw) = log.columns.get("yaw").cloned()
    {
        for (name, part) in [("x", f64::cos as fn(f64) -> f64), ("y", f64::sin)] {
            let Some(place) = log.columns.get_mut(name) else { continue };
            place.iter_mut().zip(&yaw).for_each(|(place, yaw)| *place -= lever * part(*yaw));
        }
        find(log, "x", "x and y are the place", lever, error);
    }
}

/// Way forward from the centre of gravity and its standard error, where it is clearly one, m.
fn clear(from_rear_axle: Option<(f64, f64)>, rear: f64) -> Option<(f64, f64)> {
    let (from_rear_axle, error) = from_rear_axle?;
    let lever = from_rear_axle - rear;
    (lever.abs() > LEAST && lever.abs() > SURE_LEVER * error).then_some((lever, error))
}

fn find(log: &mut CleanLog, column: &str, what: &str, lever: f64, error: f64) {
    let side = if lever > 0.0 { "before" } else { "behind" };
    let words = format!(
        "{what} of a point {:.2} m {side} the vehicle's centre of gravity (standard error {error:.2} m), as the yaw rate moves it: converted to \
         that of the centre of gravity",
        lever.abs()
    );
    log.find(FindingSeverity::Warning, column, words);
}
