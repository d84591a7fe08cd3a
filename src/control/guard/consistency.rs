//! Sensors that contradict one another for longer: two relations that hold in any motion.
//!
//! A gate judges one sample. A fault that grows stays inside every gate, and draws the filter along until what is right lies
//! outside. Yaw, yaw rate, place and velocities tell of one motion, whatever tyres, road and wind do:
//!
//! ```text
//! e_turn  <- (1 - dt / T) e_turn  + yaw - yaw_before - yaw_rate dt
//! e_aside <- (1 - dt / T) e_aside + n . (p - p_before) - vy dt,            n to the left of the yaw
//! |e_turn - bias T|    <= GATE sqrt(2 R_yaw) + BIAS T    + LARGEST_SCALE turn + LATENESS |change of yaw_rate|
//! |e_aside - slip way| <= GATE sqrt(2 R_x)   + SLIP way  + LEVER turn
//! ```
//!
//! The right sides allow for ordinary sensors: noise, as they have shown it; the rate's scale, and the yaw's lateness; a slip that
//! nobody measures, and sensors that are not in one place. `bias` of the rate and `slip`, a mounting angle, are means of ten seconds
//! but for the last while: an error that was there from the start on, or comes slowly, is the sensors' own. A way of the place beyond
//! that of the velocities is a wheel's radius or an odometer's scale, which the filter is told.
//!
//! | beyond | at fault |
//! |---|---|
//! | the turn, and the place goes where the yaw points | the yaw rate |
//! | the turn, and the place slips by `-sum e_turn ds`, as it does for a yaw that is off by `e_turn` | the yaw |
//! | the place alone, while it is inside its gate; half of the limit as it leaves it | the yaw |
//! | the place, while yaw and rate have rested to the bit | both |
//!
//! Yaw and rate of one inertial unit may drift together; without the yaw, place and velocities hold the rate. A place that
//! drifts alone leaves its gate first, and so does a signal that jumps; neither is summed. A sensor is believed again once the sums of
//! the last fifth of a second are within half of their limits.
//!
//! Source: Chow and Willsky, Analytical redundancy and the design of robust failure detection systems, IEEE Transactions on
//! Automatic Control 29 (1984): parity relations of sensors.

use super::super::rate_sensor::LARGEST_BIAS;
use super::track::{Track, difference};
use super::{ARTICULATION, GATE, GRIP, LARGEST_SCALE, SIGNALS, Signals};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Time over which the relations are summed, that after which they hold again, that over which a scale is learned, and that over
/// which bias and slip are, s.
const MEMORY: f64 = 0.7;
const RECENT: f64 = 0.2;
const SCALE_MEMORY: f64 = 1.0;
const OWN_MEMORY: f64 = 10.0;
/// Time after which the recent sums say something, s.
const JUDGED_AFTER: f64 = 0.08;
/// Way, m, and time, s, after which what is learned is half learned.
const WAY_PRIOR: f64 = 1.0;
const TIME_PRIOR: f64 = 0.2;
/// Change of the rate's bias that is none of this, rad/s.
const BIAS: f64 = 0.01;
/// Lateness of the yaw that is none, s.
const LATENESS: f64 = 0.1;
/// Change of the angle between yaw and course that is none, rad, and distance of sensors, m.
const SLIP: f64 = 0.04;
const LEVER: f64 = 1.0;
/// Angle between yaw and course beyond which a place jumps, rad.
const LARGEST_SLIP: f64 = 0.3;
/// Share of the limits below which the relations hold again.
const AGAIN: f64 = 0.5;

/// Sensors at fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum AtFault {
    Rate,
    Yaw,
    Both,
}

/// A value that was told, and its change by the velocities until it is told anew.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Reckoned<T> {
    from: T,
    by: T,
    /// Time since then, s.
    waited: f64,
}

/// Sums that are forgotten over a time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Sums {
    turn: f64,
    aside: f64,
    /// Slip of the place if all of the turn's error is of the yaw, m.
    aside_by_yaw: f64,
    /// Time, s, way, m, and turn, rad, without sign; and the turn with it.
    time: f64,
    way: f64,
    turned: f64,
    turned_by: f64,
}

/// Ordinary sensors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ordinary<'a> {
    /// Variance of each signal, as it has shown it.
    pub variance: &'a Signals,
    /// Largest change of a turn in time, rad/s2.
    pub yaw_accel: f64,
}

/// The relations.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Consistency {
    before: Option<[f64; ARTICULATION]>,
    yaw: Option<Reckoned<f64>>,
    place: Option<Reckoned<[f64; 2]>>,
    long: Sums,
    recent: Sums,
    /// Errors that the sensors have for good.
    own: Sums,
    /// Way of the place beyond that of the velocities, and that of the velocities, m, over the last while.
    ways: [f64; 2],
    /// Time for which yaw and rate have rested to the bit, s.
    rested: f64,
    fault: Option<AtFault>,
}

impl Sums {
    fn forget(&mut self, elapsed: f64, memory: f64) {
        let keep = 1.0 - (elapsed / memory).min(1.0);
        let Self { turn, aside, aside_by_yaw, time, way, turned, turned_by } = self;
        for sum in [turn, aside, aside_by_yaw, time, way, turned, turned_by] {
            *sum *= keep;
        }
    }

    /// Each relation's error in units of what is allowed. `rate`: yaw rate now, rad/s.
    fn excess(&self, rate: f64, [bias, slip]: [f64; 2], ordinary: &Ordinary, memory: f64) -> [f64; 2] {
        let noise = |i: usize| GATE * (2.0 * ordinary.variance[i]).sqrt();
        let changed = (rate - self.turned_by / memory).abs();
        let turn = noise(2) + BIAS * memory + LARGEST_SCALE * self.turned + LATENESS * changed;
        let aside = noise(0) + SLIP * self.way + LEVER * self.turned;
        [(self.turn - bias * self.time).abs() / turn, (self.aside - slip * self.way).abs() / aside]
    }
}

impl Consistency {
    /// Takes a measurement, `elapsed` seconds after the last one. `old`: signals that are stale or dead; `outside`: time for
    /// which the place has been outside its gate, s. The filter's knowledge from a sensor since its fault began is made
    /// uncertain in `track`.
    pub fn observe(
        &mut self,
        told: &Signals,
        old: &[bool; SIGNALS],
        outside: f64,
        ordinary: &Ordinary,
        track: &mut Track,
        elapsed: f64,
    ) {
        self.long.forget(elapsed, MEMORY);
        self.recent.forget(elapsed, RECENT);
        if self.fault.is_none() {
            self.own.forget(elapsed, OWN_MEMORY);
        }
        let keep = 1.0 - (elapsed / SCALE_MEMORY).min(1.0);
        self.ways = self.ways.map(|way| way * keep);
        let body: [f64; ARTICULATION] = std::array::from_fn(|i| told[i]);
        let finite = body.iter().all(|value| value.is_finite());
        let before = std::mem::replace(&mut self.before, finite.then_some(body));
        let Some(before) = before.filter(|_| finite && !old[3]) else {
            (self.yaw, self.place) = (None, None);
            return;
        };
        let rate_lives = !old[5];
        self.turn(told, before[5], old[2] || !rate_lives, ordinary, elapsed);
        let heading = match self.yaw {
            // Of a receiver that is slower than the rate.
            Some(yaw) if old[2] && rate_lives => yaw.from + yaw.by - 0.25 * (before[5] + told[5]) * elapsed,
            _ => before[2] + 0.5 * difference(2, told[2], before[2]),
        };
        self.slip(told, &before, heading, old[0], ordinary, elapsed);
        let rest = [2, 5].into_iter().all(|i| told[i] == before[i]);
        self.rested = if rest { self.rested + elapsed } else { 0.0 };
        let suspected = match outside {
            0.0 => 1.0,
            time if time < 1.5 * elapsed => AGAIN,
            _ => f64::INFINITY,
        };
        self.judge(told[5], suspected, ordinary, track);
    }

    /// Finds what is at fault, and what no longer is. `rate`: yaw rate now, rad/s; `suspected`: share of its limit from
    /// which on a slip of the place is the yaw's.
    fn judge(&mut self, rate: f64, suspected: f64, ordinary: &Ordinary, track: &mut Track) {
        let own = self.means();
        let [turn, aside] = self.long.excess(rate, own, ordinary, MEMORY);
        let slip = self.long.aside - own[1] * self.long.way;
        let found = match turn > 1.0 {
            _ if self.rested > MEMORY && aside > 1.0 => Some(AtFault::Both),
            true if (slip - self.long.aside_by_yaw).abs() < slip.abs() => Some(AtFault::Yaw),
            true => Some(AtFault::Rate),
            false => (aside > suspected).then_some(AtFault::Yaw),
        };
        if found.is_some() && found != self.fault && self.fault != Some(AtFault::Both) {
            self.fault = found;
            let of_course = self.long.aside.abs() / self.long.way.max(f64::MIN_POSITIVE);
            let off = self.long.turn.abs().max(of_course).min(FRAC_PI_2);
            track.covariance[(2, 2)] += off * off;
            track.covariance[(5, 5)] += (off / MEMORY).powi(2);
        } else if let Some(fault) = self.fault {
            let [turn, aside] = self.recent.excess(rate, own, ordinary, RECENT).map(|it| it < AGAIN);
            let goes_on = match fault {
                AtFault::Rate => !turn,
                AtFault::Yaw | AtFault::Both => !turn || !aside,
            };
            if !goes_on && self.recent.time > JUDGED_AFTER {
                (self.fault, self.long, self.recent) = (None, Sums::default(), Sums::default());
            }
        }
    }

    /// Bias of the rate, rad/s, and slip, rad, but for the last while.
    fn means(&self) -> [f64; 2] {
        let (own, last) = (&self.own, &self.long);
        let time = (own.time - last.time).max(0.0) + TIME_PRIOR;
        let way = (own.way - last.way).max(0.0) + WAY_PRIOR;
        let bias = (own.turn - last.turn) / time;
        let slip = (own.aside - last.aside) / way;
        [bias.clamp(-LARGEST_BIAS, LARGEST_BIAS), slip.clamp(-LARGEST_SCALE, LARGEST_SCALE)]
    }

    /// Way of the place for each metre of the velocities'.
    pub fn scale(&self) -> f64 {
        let [beyond, way] = self.ways;
        1.0 + (beyond / (way + WAY_PRIOR)).clamp(-LARGEST_SCALE, LARGEST_SCALE)
    }

    /// True for a signal that is at fault.
    pub fn is_at_fault(&self, signal: usize) -> bool {
        match self.fault {
            None => false,
            Some(AtFault::Rate) => signal == 5,
            Some(AtFault::Yaw) => signal == 2,
            Some(AtFault::Both) => matches!(signal, 2 | 5),
        }
    }

    /// True if any signal is at fault.
    pub fn has_fault(&self) -> bool {
        self.fault.is_some()
    }

    /// Adds to the sums.
    fn each(&mut self, add: impl Fn(&mut Sums)) {
        add(&mut self.long);
        add(&mut self.recent);
        if self.fault.is_none() {
            add(&mut self.own);
        }
    }

    /// The turn of the yaw against that of the rate.
    fn turn(&mut self, told: &Signals, rate: f64, is_old: bool, ordinary: &Ordinary, elapsed: f64) {
        let turn = 0.5 * (rate + told[5]) * elapsed;
        for sums in [&mut self.long, &mut self.recent] {
            sums.turned += turn.abs();
            sums.turned_by += turn;
        }
        let start = Reckoned { from: told[2], by: 0.0, waited: 0.0 };
        let Some(since) = &mut self.yaw else {
            self.yaw = (!is_old).then_some(start);
            return;
        };
        (since.by, since.waited) = (since.by + turn, since.waited + elapsed);
        if is_old {
            return;
        }
        let off = difference(2, told[2], since.from + since.by);
        let time = since.waited;
        let allowed = GATE * (2.0 * ordinary.variance[2]).sqrt() + ordinary.yaw_accel * time * time;
        self.yaw = Some(start);
        if off.abs() > allowed {
            // As it was before, or another yaw altogether: what it is to be judged by begins here.
            self.recent = Sums::default();
        } else {
            self.each(|sums| {
                sums.turn += off;
                sums.time += time;
            });
        }
    }

    /// The place's motion against that of the velocities, along and to the left of a heading, rad.
    fn slip(
        &mut self,
        told: &Signals,
        before: &[f64; ARTICULATION],
        heading: f64,
        is_old: bool,
        ordinary: &Ordinary,
        elapsed: f64,
    ) {
        let (sin, cos) = heading.sin_cos();
        let [along, aside] = [3, 4].map(|i| 0.5 * (before[i] + told[i]) * elapsed);
        let start = Reckoned { from: [told[0], told[1]], by: [0.0; 2], waited: 0.0 };
        let Some(since) = &mut self.place else {
            self.place = (!is_old).then_some(start);
            return;
        };
        since.by[0] += along * cos - aside * sin;
        since.by[1] += along * sin + aside * cos;
        since.waited += elapsed;
        if is_old {
            return;
        }
        let off = [0, 1].map(|i| told[i] - since.from[i] - since.by[i]);
        let way = since.by[0].hypot(since.by[1]);
        let allowed = GATE * (2.0 * ordinary.variance[0]).sqrt() + GRIP * since.waited * since.waited;
        self.place = Some(start);
        let off_by = off[0].hypot(off[1]);
        if off_by <= allowed + LARGEST_SCALE * way {
            self.ways[0] += (off[0] * cos + off[1] * sin) * along.signum();
            self.ways[1] += way;
        }
        if off_by <= allowed + LARGEST_SLIP * way {
            let by_yaw = (self.means()[0] * self.long.time - self.long.turn) * way;
            let aside = off[1] * cos - off[0] * sin;
            self.each(|sums| {
                sums.way += way;
                sums.aside += aside;
                sums.aside_by_yaw += by_yaw;
            });
        }
    }
}
