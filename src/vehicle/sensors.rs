//! Measured signals of the motion.
//!
//! Pose and velocities are those of the reference point. It is the place on the road under the CG of the vehicle file,
//! regardless of the real CG under payload or shift. `ax`, `ay` are the readings of an accelerometer there, fixed to
//! the rolling and pitching body: `ay = fy cos(roll) + fz sin(roll)`, `ax = fx cos(pitch) - fz sin(pitch)`.

use super::array;
use super::effects::Effects;
use super::substep::LONGEST_SUBSTEP;
use super::unit::{BODY, PITCH, ROLL, ROLL_RATE, VX, VY, X, Y, YAW, YAW_RATE};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Motion signals of a body.
pub(super) const BODY_SIGNALS: usize = 11;

/// The true motion signals of a body's reference point, which lies `arm` forward of the CG. Specific forces at the CG
/// in the plane of the road and out of it; yaw acceleration.
#[inline]
pub(super) fn body_signals(
    effects: &Effects,
    body: &[f64; BODY],
    arm: f64,
    [specific_x, specific_y, specific_z]: [f64; 3],
    yaw_accel: f64,
) -> [f64; BODY_SIGNALS] {
    let (sin, cos) = body[YAW].sin_cos();
    // The accelerometer may sit elsewhere than it is taken for.
    let imu = arm + effects.imu_lever_arm;
    let fx = specific_x - imu * body[YAW_RATE] * body[YAW_RATE];
    let fy = specific_y + imu * yaw_accel;
    let fz = specific_z;
    let (sin_roll, cos_roll) = body[ROLL].sin_cos();
    let (sin_pitch, cos_pitch) = body[PITCH].sin_cos();
    [
        body[X] + arm * cos,
        body[Y] + arm * sin,
        body[YAW],
        body[VX],
        body[VY] + arm * body[YAW_RATE],
        body[YAW_RATE],
        fx * cos_pitch - fz * sin_pitch,
        fy * cos_roll + fz * sin_roll,
        body[ROLL],
        body[PITCH],
        body[ROLL_RATE],
    ]
}

/// Sensor readings of (delayed) signals of a body, in the same order.
#[inline]
pub(super) fn measured(effects: &Effects, signals: &[f64]) -> [f64; BODY_SIGNALS] {
    let [x, y, yaw, vx, vy, yaw_rate, ax, ay, roll, pitch, roll_rate] = std::array::from_fn(|i| signals[i]);
    let angle = effects.heading_misalignment;
    let (sin, cos) = angle.sin_cos();
    let turn = |x: f64, y: f64| (x * cos + y * sin, y * cos - x * sin);
    let (vx, vy) = turn(vx * effects.speed_scale, vy * effects.speed_scale);
    let (ax, ay) = turn(ax, ay);
    let yaw_rate = yaw_rate + effects.yaw_rate_bias;
    [x, y, yaw + angle, vx, vy, yaw_rate, ax, ay + effects.lateral_accel_bias, roll, pitch, roll_rate]
}

/// Signals at a time, s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct TimedSignals<const S: usize>(f64, #[serde(with = "array")] [f64; S]);

/// Samples of the signals that have not been read yet; empty without latency.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Latency<const S: usize> {
    samples: VecDeque<TimedSignals<S>>,
}

/// Time between samples, s.
const SAMPLING: f64 = LONGEST_SUBSTEP;

/// Room for a latency of `delay` s.
fn capacity(delay: f64) -> usize {
    if delay > 0.0 { (delay / SAMPLING) as usize * 2 + 8 } else { 0 }
}

impl<const S: usize> Latency<S> {
    pub fn new(delay: f64) -> Self {
        Self { samples: VecDeque::with_capacity(capacity(delay)) }
    }

    pub fn start(&mut self, delay: f64, signals: [f64; S]) {
        self.samples.clear();
        if delay > 0.0 {
            self.samples.push_back(TimedSignals(0.0, signals));
        }
    }

    pub fn reserve(&mut self, delay: f64) {
        self.samples.reserve(capacity(delay).saturating_sub(self.samples.len()));
    }

    pub fn copy_from(&mut self, other: &Self) {
        self.samples.clear();
        self.samples.extend(other.samples.iter().copied());
    }

    /// True if a sample is due.
    pub fn wants(&self, delay: f64, time: f64) -> bool {
        delay > 0.0 && self.samples.back().is_none_or(|newest| time >= newest.0 + 0.9 * SAMPLING)
    }

    /// Takes a sample, and forgets those that are no longer needed.
    pub fn push(&mut self, time: f64, signals: [f64; S]) {
        if self.samples.len() == self.samples.capacity() {
            self.samples.pop_front();
        }
        self.samples.push_back(TimedSignals(time, signals));
    }

    /// The signals as they were one latency ago, linear between samples.
    pub fn read(&mut self, delay: f64, time: f64, now: &[f64; S]) -> [f64; S] {
        if delay <= 0.0 {
            return *now;
        }
        let wanted = time - delay;
        while self.samples.len() > 1 && self.samples[1].0 <= wanted {
            self.samples.pop_front();
        }
        let Some(&TimedSignals(from, before)) = self.samples.front() else { return *now };
        if wanted <= from {
            return before;
        }
        let (to, after) = self.samples.get(1).map_or((time, *now), |next| (next.0, next.1));
        let share = if to > from { (wanted - from) / (to - from) } else { 1.0 };
        std::array::from_fn(|i| before[i] + share * (after[i] - before[i]))
    }
}
