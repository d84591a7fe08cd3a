//! Rates that rest to the bit while the pose goes on: a dead sensor, or an input that nobody connects.
//!
//! A value is what the pose has integrated since it last changed. Over the time `T` that it rests,
//!
//! ```text
//! |yaw - yaw_0 - yaw_rate T| <= GATE sqrt(2 R_yaw) + sqrt(3 R_yaw_rate) T
//! |(x, y) - (x, y)_0| - |vx| T <= GATE sqrt(2 R_x) + sqrt(3 R_vx) T + LARGEST_SCALE |(x, y) - (x, y)_0|
//! ```
//!
//! `sqrt(3 R)` is the largest error of a value in steps that rests within one of them. No gate of a single step sees such a
//! fault: tyres may do as much between two samples, and the filter believes a sensor more than its model. A pose that jumps is
//! no motion: from one sample to the next its own velocity changes by no more than tyres give. From there `T` counts anew, and from
//! where a value has agreed so far: a long straight would hide what a bend then shows.

use super::{ARTICULATION, GATE, GRIP, LARGEST_SCALE, Signals, difference};
use serde::{Deserialize, Serialize};

/// Rates, and the signal that each is the rate of; the speed is that of the place.
const RATES: [(usize, usize); 3] = [(SPEED, 0), (5, 2), (ARTICULATION + 1, ARTICULATION)];
const SPEED: usize = 3;
/// Poses in a row, contradicted by a rate that rests, after which it is dead.
const CONTRADICTED: u32 = 3;
/// Share of the error of a resting value up to which it agrees with its pose.
const AGREES: f64 = 0.5;

/// A rate that has not changed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct RestingRate {
    /// The measurement from which on, and for how long, s.
    since: Signals,
    age: f64,
    /// Poses in a row that it contradicts.
    contradicted: u32,
    is_dead: bool,
}

/// The last pose, and its changes in time to it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Last {
    told: Signals,
    velocity: Option<Signals>,
}

/// The rates that rest.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Resting {
    rates: [Option<RestingRate>; RATES.len()],
    last: Option<Last>,
    /// Time since the last pose, s.
    waited: f64,
}

impl Resting {
    /// True for a signal of which nothing is to be believed until it changes.
    pub(super) fn is_dead(&self, signal: usize, told: &Signals) -> bool {
        let of = RATES.iter().position(|(rate, _)| *rate == signal);
        let rest = of.and_then(|place| self.rates[place]);
        rest.is_some_and(|rest| rest.is_dead && rest.since[signal] == told[signal])
    }

    /// True if any signal is dead.
    pub(super) fn has_dead(&self) -> bool {
        self.rates.iter().flatten().any(|rest| rest.is_dead)
    }

    /// Takes a measurement, `elapsed` seconds after the last one; `is_new`: with a pose of its own. `variance`: of each
    /// signal, as it has shown it. `yaw_accel`: largest change of a turn in time, rad/s2.
    pub(super) fn observe(
        &mut self,
        told: &Signals,
        is_new: bool,
        variance: &Signals,
        yaw_accel: f64,
        elapsed: f64,
    ) {
        self.waited += elapsed;
        for ((rate, _), rest) in RATES.into_iter().zip(&mut self.rates) {
            *rest = match rest.filter(|rest| rest.since[rate] == told[rate]) {
                Some(rest) => Some(RestingRate { age: rest.age + elapsed, ..rest }),
                None => Some(RestingRate { since: *told, age: 0.0, contradicted: 0, is_dead: false }),
            };
        }
        if !is_new {
            return;
        }
        let interval = std::mem::take(&mut self.waited);
        let moved = self.last.map(|last| Signals::from_fn(|i, _| difference(i, told[i], last.told[i])));
        let velocity = moved.map(|moved| moved / interval);
        let before = self.last.and_then(|last| last.velocity);
        self.last = Some(Last { told: *told, velocity });
        let changed = velocity.zip(before).map(|(now, before)| (now - before) * interval);
        for ((rate, of), rest) in RATES.into_iter().zip(&mut self.rates) {
            let Some(rest) = rest else { continue };
            let accel = if rate == SPEED { GRIP } else { yaw_accel };
            let may_change = GATE * (6.0 * variance[of]).sqrt() + 2.0 * accel * interval * interval;
            let is_motion = changed.is_some_and(|changed| {
                let by = if rate == SPEED { changed[0].hypot(changed[1]) } else { changed[of].abs() };
                by <= may_change
            });
            if !is_motion {
                *rest = RestingRate { since: *told, age: 0.0, ..*rest };
                continue;
            }
            let of_rest = (3.0 * variance[rate]).sqrt() * rest.age;
            let allowed = GATE * (2.0 * variance[of]).sqrt() + of_rest;
            let off = if rate == SPEED {
                let moved = (told[0] - rest.since[0]).hypot(told[1] - rest.since[1]);
                moved * (1.0 - LARGEST_SCALE) - told[rate].abs() * rest.age
            } else {
                // Beyond a full turn an angle does not tell.
                difference(of, told[of], rest.since[of] + told[rate] * rest.age).abs()
            };
            // One wrong pose is the pose's fault.
            rest.contradicted = if off > allowed { rest.contradicted.saturating_add(1) } else { 0 };
            rest.is_dead |= rest.contradicted >= CONTRADICTED;
            // What has agreed so far would only widen the limit for what comes.
            if !rest.is_dead && off < AGREES * of_rest {
                *rest = RestingRate { since: *told, age: 0.0, ..*rest };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Variances of a car's sensors, as the guard takes them.
    fn variance() -> Signals {
        Signals::from([0.01, 0.01, 0.003, 0.02, 0.02, 0.008, 0.002, 0.004])
            .map(|deviation: f64| deviation.powi(2))
    }

    /// Seconds until a rate is dead, in 20 s of a motion: its measurement by the time.
    fn dead_after(signal: usize, at: impl Fn(f64) -> Signals) -> Option<f64> {
        let mut resting = Resting::default();
        (0..1000).map(|k| 0.02 * f64::from(k)).find(|&time| {
            let told = at(time);
            resting.observe(&told, true, &variance(), 5.0, 0.02);
            resting.is_dead(signal, &told)
        })
    }

    /// A circle at constant speed, with rates that are said, m/s and rad/s.
    fn circle(time: f64, [speed, rate]: [f64; 2], [said, turns]: [f64; 2]) -> Signals {
        let (sin, cos) = (rate * time).sin_cos();
        let radius = speed / rate;
        Signals::from([radius * sin, radius * (1.0 - cos), rate * time, said, 0.0, turns, 0.0, 0.0])
    }

    #[test]
    fn a_rate_that_rests_while_its_pose_goes_on_is_dead() {
        let motion = [10.0, 0.2];
        let no_turn = dead_after(5, |time| circle(time, motion, [10.0, 0.0])).unwrap();
        assert!(no_turn < 0.3, "{no_turn}");
        let no_speed = dead_after(3, |time| circle(time, motion, [0.0, 0.2])).unwrap();
        assert!(no_speed < 0.1, "{no_speed}");
        // One that is stuck at another value, too.
        let stuck = dead_after(5, |time| circle(time, motion, [10.0, 0.25])).unwrap();
        assert!(stuck < 1.0, "{stuck}");
    }

    #[test]
    fn a_rate_that_rests_and_is_right_is_not() {
        for motion in [[10.0, 0.2], [30.0, 0.02], [0.5, 0.01]] {
            for signal in [3, 5] {
                assert_eq!(dead_after(signal, |time| circle(time, motion, motion)), None, "{motion:?}");
                // Poses of a wheel's other radius; a rate in steps.
                let rounded = [motion[0] * 0.92, motion[1] + 0.01];
                assert_eq!(dead_after(signal, |time| circle(time, motion, rounded)), None, "{motion:?}");
            }
        }
    }

    #[test]
    fn a_change_ends_it_and_a_pose_that_jumps_says_nothing() {
        let mut resting = Resting::default();
        let at = |yaw: f64, rate: f64| Signals::from([0.0, 0.0, yaw, 0.0, 0.0, rate, 0.0, 0.0]);
        let mut see = |yaw: f64, rate: f64| {
            let told = at(yaw, rate);
            resting.observe(&told, true, &variance(), 5.0, 0.02);
            resting.is_dead(5, &told)
        };
        // Put elsewhere by the host, and back.
        assert!([0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0].into_iter().all(|yaw| !see(yaw, 0.0)));
        let turns = (1..20).map(|k| see(0.005 * f64::from(k), 0.0)).collect::<Vec<_>>();
        assert!(turns[18] && !turns[2], "{turns:?}");
        assert!(!see(0.1, 0.25) && !see(0.1, 0.0));
        assert!(!resting.has_dead());
    }
}
