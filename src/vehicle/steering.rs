//! The steering chain: from the command to the angle of the road wheels.
//!
//! ```text
//!  command -> dead time -> angle limit -> lag and rate limit -> backlash -> (sensor) -> gain, offset -> road wheels
//!             u(t - d)                    d' = clamp((u - d)/tau, +-rate)               real = gain d + offset
//! ```
//!
//! Commands are steps in time, so that every stage has a closed form between them: the chain is exact for any step.
//! The sensor sits before the linkage: gain and offset are not seen in the measured angle.

use super::effects::{Effects, NO_RATE_LIMIT};
use super::parameters::Steering;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Constants of the chain.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct SteeringChain {
    /// s
    pub dead_time: f64,
    /// s
    pub lag: f64,
    /// rad/s
    pub rate_limit: f64,
    /// rad
    pub angle_limit: f64,
    /// Full width of the gap, rad.
    pub backlash: f64,
    pub gain: f64,
    /// rad
    pub offset: f64,
}

impl SteeringChain {
    /// A vehicle's chain with the effects on it.
    #[must_use]
    pub fn new(steering: &Steering, effects: &Effects) -> Self {
        let unlimited = |limit: f64| if limit >= NO_RATE_LIMIT { f64::MAX } else { limit };
        Self {
            dead_time: steering.dead_time + effects.steer_delay,
            lag: steering.lag + effects.steer_lag,
            rate_limit: unlimited(steering.rate_limit.min(effects.steer_rate_limit)),
            angle_limit: steering.angle_limit,
            backlash: steering.backlash + effects.steer_backlash,
            gain: steering.gain * effects.steer_gain,
            offset: steering.offset + effects.steer_offset,
        }
    }

    /// Angle of the actuator at which the wheels stand straight, rad: a vehicle in motion is placed with it.
    #[must_use]
    pub fn straight(&self) -> f64 {
        ((0.0 - self.offset) / self.gain).clamp(-self.angle_limit, self.angle_limit)
    }
}

/// Largest number of changes of the command under way. Beyond it, the newest replaces the last.
const UNDER_WAY: usize = 4096;

/// State of the steering while driving.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SteeringState {
    /// Commands under way: the time at which each arrives, and its value.
    queue: VecDeque<(f64, f64)>,
    /// The command that last was given.
    last: f64,
    /// The command that has arrived.
    arrived: f64,
    /// The actuator's angle.
    actuator: f64,
    /// Its angle behind the backlash, which the sensor measures.
    measured: f64,
    /// True if angle or rate limit held the actuator back since the last command.
    limited: bool,
}

impl SteeringState {
    /// A chain at rest at an angle.
    #[must_use]
    pub fn at_rest(chain: &SteeringChain, angle: f64) -> Self {
        let capacity = if chain.dead_time > 0.0 { UNDER_WAY } else { 0 };
        Self {
            queue: VecDeque::with_capacity(capacity),
            last: angle,
            arrived: angle,
            actuator: angle,
            measured: angle,
            limited: false,
        }
    }

    /// Workspace for the longest queue, so that steps do not allocate (after deserialisation).
    pub fn reserve(&mut self, chain: &SteeringChain) {
        if chain.dead_time > 0.0 {
            self.queue.reserve(UNDER_WAY.saturating_sub(self.queue.len()));
        }
    }

    /// Copies without allocating where there is room.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.queue.clear();
        self.queue.extend(other.queue.iter().copied());
        (self.last, self.arrived) = (other.last, other.arrived);
        (self.actuator, self.measured) = (other.actuator, other.measured);
        self.limited = other.limited;
    }

    /// Gives a command at a time in s.
    pub fn command(&mut self, chain: &SteeringChain, time: f64, angle: f64) {
        self.limited = angle.abs() > chain.angle_limit;
        if chain.dead_time <= 0.0 {
            (self.last, self.arrived) = (angle, angle);
        } else if angle != self.last {
            self.last = angle;
            let arrival = time + chain.dead_time;
            let full = self.queue.len() >= UNDER_WAY;
            match self.queue.back_mut() {
                Some(newest) if full || newest.0 >= arrival => newest.1 = angle,
                _ => self.queue.push_back((arrival, angle)),
            }
        }
    }

    /// Moves from `time` to `time + step`, in s. A command that arrives exactly at the end acts from then on.
    pub fn advance(&mut self, chain: &SteeringChain, time: f64, step: f64) {
        let end = time + step;
        let mut now = time;
        while let Some(&(arrival, angle)) = self.queue.front() {
            if arrival >= end {
                break;
            }
            self.queue.pop_front();
            if arrival > now {
                self.follow(chain, arrival - now);
                now = arrival;
            }
            self.arrived = angle;
        }
        self.follow(chain, end - now);
    }

    /// Follows the arrived command for a while, in s.
    fn follow(&mut self, chain: &SteeringChain, duration: f64) {
        let target = self.arrived.clamp(-chain.angle_limit, chain.angle_limit);
        let gap = target - self.actuator;
        // Further away than this the rate limit governs, nearer the lag.
        let near = chain.rate_limit * chain.lag;
        let mut left = duration;
        if gap.abs() > near {
            let needed = (gap.abs() - near) / chain.rate_limit;
            let moving = needed.min(left);
            self.actuator += chain.rate_limit * moving * gap.signum();
            left -= moving;
            self.limited |= duration > 0.0 && chain.rate_limit < NO_RATE_LIMIT;
            if left > 0.0 && near == 0.0 {
                self.actuator = target;
            }
        }
        if left > 0.0 && chain.lag > 0.0 {
            let gap = target - self.actuator;
            self.actuator += gap * -(-left / chain.lag).exp_m1();
        }
        // The motion is monotone between commands, so that the play may be applied at its end.
        let half = 0.5 * chain.backlash;
        self.measured = self.measured.clamp(self.actuator - half, self.actuator + half);
    }

    /// The angle that the sensor measures, rad.
    #[must_use]
    pub fn measured(&self) -> f64 {
        self.measured
    }

    /// The angle of the road wheels, rad.
    #[must_use]
    pub fn road_wheel(&self, chain: &SteeringChain) -> f64 {
        chain.gain * self.measured + chain.offset
    }

    /// True if the angle or rate limit held the actuator back.
    #[must_use]
    pub fn is_limited(&self) -> bool {
        self.limited
    }
}
