//! A new start: signals that contradict the filter, and are a motion of their own.
//!
//! The poses follow from the velocities, and these change no faster than tyres allow:
//!
//! ```text
//! |p - (p_0 + sum v dt)| <= GATE sqrt(2 R) + WAY_SHARE way,    |v - v_before| <= GATE sqrt(2 R) + 2 GRIP dt
//! ```
//!
//! Some of them are a vehicle that the host has carried: its pose jumps further than it can have driven.

use super::{ARTICULATION, GATE, GRIP, Guard, GuardState, LARGEST_SPREAD, Signals};
use crate::nominal::LateralVehicle;
use crate::path::wrap_angle;
use crate::signal;
use serde::{Deserialize, Serialize};

/// Share of the way, and of the turn, by which a pose and the integrated velocities of a new start may differ.
const WAY_SHARE: f64 = 0.02;
/// Ratio of the way that a vehicle can have driven to what its estimate and its sensors say: both may be wrong.
const REACH: f64 = 2.0;

/// A motion that may be a new start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct NewStart {
    /// Pose from the velocities since its first sample.
    reckoned: [f64; 3],
    last: Signals,
    /// Way, m, and turn, rad, since then.
    way: f64,
    turn: f64,
    pub age: f64,
    /// True if the host has put the vehicle there.
    pub carried: bool,
}

/// True if a vehicle can move like this at all.
fn is_possible(told: &Signals) -> bool {
    [(3, signal::VX), (4, signal::VY), (5, signal::YAW_RATE)].iter().all(|(i, signal)| {
        let (least, most) = signal.range;
        (least..=most).contains(&told[*i])
    })
}

impl<V: LateralVehicle<S>, const S: usize> Guard<V, S> {
    /// True if the host has put the vehicle further away than it can have driven since its last pose. `speed`: by the
    /// filter, m/s.
    pub(super) fn is_carried(
        &self,
        state: &mut GuardState,
        told: &Signals,
        speed: f64,
        elapsed: f64,
    ) -> bool {
        let said = if told[3].is_finite() { told[3].abs() } else { 0.0 };
        state.reach += REACH * speed.abs().max(said) * elapsed;
        let place = [told[0], told[1]];
        if !place.iter().all(|value| value.is_finite()) {
            return false;
        }
        let spread = state.spread[0].clamp(1.0, LARGEST_SPREAD);
        let reach = std::mem::take(&mut state.reach) + GATE * (2.0 * self.noise[0] * spread).sqrt();
        let before = state.place.replace(place);
        before.is_some_and(|[x, y]| (place[0] - x).hypot(place[1] - y) > reach)
    }

    /// Continues the candidate of a new start with the motion in `told`, if it is one.
    pub(super) fn candidate(
        &self,
        before: Option<NewStart>,
        told: &Signals,
        there: bool,
        elapsed: f64,
        scale: f64,
        spread: &Signals,
    ) -> Option<NewStart> {
        let body = told.fixed_rows::<ARTICULATION>(0);
        if !there || body.iter().all(|value| *value == 0.0) || !is_possible(told) {
            return None;
        }
        // Its age counts from the step that ended with it.
        let first = NewStart {
            reckoned: [told[0], told[1], told[2]],
            last: *told,
            way: 0.0,
            turn: 0.0,
            age: elapsed,
            carried: false,
        };
        let Some(NewStart { reckoned: [x, y, yaw], last, way, turn, age, carried }) = before else {
            return Some(first);
        };
        let between = |i: usize| 0.5 * (last[i] + told[i]);
        let heading = last[2] + 0.5 * wrap_angle(told[2] - last[2]);
        let (sin, cos) = heading.sin_cos();
        let (vx, vy, turned) = (scale * between(3), scale * between(4), between(5) * elapsed);
        let reckoned =
            [x + (vx * cos - vy * sin) * elapsed, y + (vx * sin + vy * cos) * elapsed, yaw + turned];
        let (way, turn) = (way + vx.hypot(vy) * elapsed, turn + turned.abs());
        let noise = |i: usize| GATE * (2.0 * self.noise[i] * spread[i].clamp(1.0, LARGEST_SPREAD)).sqrt();
        let gap = (told[0] - reckoned[0]).hypot(told[1] - reckoned[1]);
        let follows = gap <= noise(0) + WAY_SHARE * way
            && wrap_angle(told[2] - reckoned[2]).abs() <= noise(2) + WAY_SHARE * turn;
        let changes = [2.0 * GRIP, 2.0 * GRIP, 2.0 * self.yaw_accel];
        let smooth = (3..)
            .zip(changes)
            .all(|(i, change): (usize, f64)| (told[i] - last[i]).abs() <= noise(i) + change * elapsed);
        let goes_on = NewStart { reckoned, last: *told, way, turn, age: age + elapsed, carried };
        Some(if follows && smooth { goes_on } else { first })
    }
}
