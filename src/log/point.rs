//! Points of the car at which an instrument gives the velocity across it, or the place: converted to the centre of gravity.
//!
//! ```text
//!     vy = vy(CG) + l yaw_rate        (x, y) = (x, y)(CG) + l (cos yaw, sin yaw) + w (-sin yaw, cos yaw)        l: forward, w: to the left
//! ```
//!
//! Receivers and optical heads often tell of the rear axle, or of the place where they stand, beside the middle, too. From the rear
//! axle the way forward to such a point is told by the motion ([`kinematics::vy_point`]); the vehicle tells how far its centre of
//! gravity is from there. The way to the side needs no law of the tyres.

use super::clean_log::CleanLog;
use super::finding::FindingSeverity;
use super::kinematics::{self, SURE_LEVER};

/// Least way that is one, m: the slip of a real car's rear axle, which is not quite linear, looks like up to 0.45 m.
const LEAST: f64 = 0.5;

/// Least way to the side, m: a few times what receivers and speeds that are a little off leave of it.
const LEAST_ASIDE: f64 = 0.15;

/// Words on which side a point is.
const FORWARD: [&str; 2] = ["before", "behind"];
const LEFT: [&str; 2] = ["left of", "right of"];

/// Brings `vy`, and `x` and `y`, of another point to the centre of gravity. `rear`: from there back to the rear axle, m.
pub(super) fn mend(log: &mut CleanLog, rear: f64) {
    if let Some((lever, error)) = kinematics::vy_point(log).and_then(|way| clear(way, rear, LEAST))
        && let Some(rate) = log.columns.get("yaw_rate").cloned()
        && let Some(vy) = log.columns.get_mut("vy")
    {
        vy.iter_mut().zip(&rate).for_each(|(vy, rate)| *vy -= lever * rate);
        find(log, "vy", "vy is the velocity", &[way(lever, error, FORWARD)]);
    }
    let Some([forward, left]) = kinematics::place_point(log) else { return };
    let (forward, left) = (clear(forward, rear, LEAST), clear(left, 0.0, LEAST_ASIDE));
    if forward.is_none() && left.is_none() {
        return;
    }
    let Some(yaw) = log.columns.get("yaw").cloned() else { return };
    let of = |way: Option<(f64, f64)>| way.map_or(0.0, |(lever, _)| lever);
    let (ahead, aside) = (of(forward), of(left));
    let away: [fn(f64, f64, f64) -> f64; 2] =
        [|yaw, l, w| l * yaw.cos() - w * yaw.sin(), |yaw, l, w| l * yaw.sin() + w * yaw.cos()];
    for (name, away) in ["x", "y"].into_iter().zip(away) {
        let Some(place) = log.columns.get_mut(name) else { continue };
        place.iter_mut().zip(&yaw).for_each(|(place, yaw)| *place -= away(*yaw, ahead, aside));
    }
    let ways = [(forward, FORWARD), (left, LEFT)];
    let ways =
        ways.into_iter().filter_map(|(found, sides)| found.map(|(lever, error)| way(lever, error, sides)));
    find(log, "x", "x and y are the place", &ways.collect::<Vec<_>>());
}

/// Way from the centre of gravity and its standard error, where it is clearly one, m; `from`: where the way that was found begins.
fn clear((found, error): (f64, f64), from: f64, least: f64) -> Option<(f64, f64)> {
    let lever = found - from;
    (lever.abs() > least && lever.abs() > SURE_LEVER * error).then_some((lever, error))
}

/// Words on a way, and on its standard error.
fn way(lever: f64, error: f64, [positive, negative]: [&str; 2]) -> [String; 2] {
    let side = if lever > 0.0 { positive } else { negative };
    [format!("{:.2} m {side}", lever.abs()), format!("{error:.2} m")]
}

fn find(log: &mut CleanLog, column: &str, what: &str, ways: &[[String; 2]]) {
    let [ways, errors] =
        [0, 1].map(|part| ways.iter().map(|way| way[part].as_str()).collect::<Vec<_>>().join(" and "));
    let words = format!(
        "{what} of a point {ways} the vehicle's centre of gravity (standard error {errors}), as the yaw rate moves it: converted to that of \
         the centre of gravity"
    );
    log.find(FindingSeverity::Warning, column, words);
}
