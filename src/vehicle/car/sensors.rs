//! What is measured of the motion.
//!
//! Pose and velocities are those of the reference point: the place on the road under the CG of the vehicle file,
//! whatever payload or shift do to the real CG. `ax`, `ay` are what an accelerometer there, fixed to the rolling
//! and pitching body, reads: `ay = fy cos(roll) + fz sin(roll)`, `ax = fx cos(pitch) - fz sin(pitch)`.

use super::dynamics::Flow;
use super::plant::Plant;
use super::state::{
    CarState, PER_WHEEL, PITCH, ROLL, ROLL_RATE, SPIN, STATES, VX, VY, WHEELS, X, Y, YAW, YAW_RATE,
};
use super::wheel::WheelFlow;
use crate::enumeration;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// One wheel, as outputs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WheelOutput {
    /// Load, N.
    pub load: f64,
    /// Longitudinal slip, positive when driving.
    pub slip: f64,
    /// Slip angle, rad, positive when the contact slips to the left.
    pub slip_angle: f64,
    /// Spin, rad/s.
    pub speed: f64,
    /// Forces in the contact in axes of the wheel, N.
    pub fx: f64,
    /// See `fx`.
    pub fy: f64,
}

enumeration! {
    /// What the car does, in words.
    pub enum CarStatus {
        Driving = 0 "driving", "The car drives within the grip of its tyres";
        Standstill = 1 "standstill", "The car stands";
        SteeringLimited = 2 "steering_limited", "The angle or rate limit of the steering holds the actuator back";
        WheelSlip = 3 "wheel_slip", "A wheel is locked or spinning";
        Sliding = 4 "sliding", "An axle slides sideways";
        WheelLifted = 5 "wheel_lifted", "A wheel has left the road";
    }
}

/// Everything that is measured, with effects of the sensors. Units as in `signal`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(missing_docs)]
pub struct CarOutput {
    pub x: f64,
    pub y: f64,
    pub yaw: f64,
    pub vx: f64,
    pub vy: f64,
    pub yaw_rate: f64,
    pub ax: f64,
    pub ay: f64,
    /// Road-wheel angle at the sensor, before gain and offset of the linkage.
    pub steer: f64,
    pub roll: f64,
    pub pitch: f64,
    pub roll_rate: f64,
    /// Real angle of the road wheels, rad.
    pub road_wheel_angle: f64,
    /// Front left, front right, rear left, rear right.
    pub wheels: [WheelOutput; 4],
    /// Force that drive (positive) or brakes (negative, at most) are set to, N.
    pub drive_force: f64,
    /// Arc length on the road, m; 0 without a road.
    pub station: f64,
    pub status: CarStatus,
}

/// Motion signals.
const SIGNALS: usize = 11;

/// The motion signals at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Motion {
    signals: [f64; SIGNALS],
    wheels: [WheelOutput; 4],
    drive_force: f64,
}

impl Motion {
    /// The true motion of the reference point.
    pub fn of(plant: &Plant, state: &CarState, rates: &[f64; STATES], flow: &Flow) -> Self {
        let y = &state.y;
        let (sin, cos) = y[YAW].sin_cos();
        let arm = plant.reference_x;
        // The accelerometer may sit elsewhere than it is taken for.
        let imu = arm + plant.effects.imu_lever_arm;
        let fx = flow.specific_x - imu * y[YAW_RATE] * y[YAW_RATE];
        let fy = flow.specific_y + imu * rates[YAW_RATE];
        let fz = flow.specific_z;
        let (sin_roll, cos_roll) = y[ROLL].sin_cos();
        let (sin_pitch, cos_pitch) = y[PITCH].sin_cos();
        let wheel = |index: usize| {
            let wheel: &WheelFlow = &flow.wheels[index];
            WheelOutput {
                load: wheel.load,
                slip: wheel.kappa,
                slip_angle: wheel.alpha,
                speed: y[WHEELS + index * PER_WHEEL + SPIN],
                fx: wheel.forces.fx,
                fy: wheel.forces.fy,
            }
        };
        Self {
            signals: [
                y[X] + arm * cos,
                y[Y] + arm * sin,
                y[YAW],
                y[VX],
                y[VY] + arm * y[YAW_RATE],
                y[YAW_RATE],
                fx * cos_pitch - fz * sin_pitch,
                fy * cos_roll + fz * sin_roll,
                y[ROLL],
                y[PITCH],
                y[ROLL_RATE],
            ],
            wheels: [wheel(0), wheel(1), wheel(2), wheel(3)],
            drive_force: flow.drive_force,
        }
    }
}

/// Samples of the motion that have not been read yet; empty without latency.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct SensorState {
    samples: VecDeque<(f64, [f64; SIGNALS])>,
}

/// Time between samples, s.
const SAMPLING: f64 = super::LONGEST_SUBSTEP;

fn capacity(plant: &Plant) -> usize {
    let delay = plant.effects.sensor_delay;
    if delay > 0.0 { (delay / SAMPLING) as usize * 2 + 8 } else { 0 }
}

impl SensorState {
    pub fn new(plant: &Plant) -> Self {
        Self { samples: VecDeque::with_capacity(capacity(plant)) }
    }

    pub fn start(&mut self, plant: &Plant, motion: Motion) {
        self.samples.clear();
        if plant.effects.sensor_delay > 0.0 {
            self.samples.push_back((0.0, motion.signals));
        }
    }

    pub fn reserve(&mut self, plant: &Plant) {
        self.samples.reserve(capacity(plant).saturating_sub(self.samples.len()));
    }

    pub fn copy_from(&mut self, other: &Self) {
        self.samples.clear();
        self.samples.extend(other.samples.iter().copied());
    }

    /// Whether a sample is due.
    pub fn wants(&self, plant: &Plant, time: f64) -> bool {
        plant.effects.sensor_delay > 0.0
            && self.samples.back().is_none_or(|newest| time >= newest.0 + 0.9 * SAMPLING)
    }

    /// Takes a sample, and forgets those that nobody will read.
    pub fn push(&mut self, time: f64, motion: Motion) {
        if self.samples.len() == self.samples.capacity() {
            self.samples.pop_front();
        }
        self.samples.push_back((time, motion.signals));
    }

    /// The signals as they were one latency ago, linear between samples.
    pub fn read(&mut self, plant: &Plant, time: f64, now: &Motion) -> [f64; SIGNALS] {
        let delay = plant.effects.sensor_delay;
        if delay <= 0.0 {
            return now.signals;
        }
        let wanted = time - delay;
        while self.samples.len() > 1 && self.samples[1].0 <= wanted {
            self.samples.pop_front();
        }
        let Some(&(from, before)) = self.samples.front() else { return now.signals };
        if wanted <= from {
            return before;
        }
        let (to, after) = self.samples.get(1).copied().unwrap_or((time, now.signals));
        let share = if to > from { (wanted - from) / (to - from) } else { 1.0 };
        std::array::from_fn(|i| before[i] + share * (after[i] - before[i]))
    }
}

/// The output from the (delayed) motion, and what has no latency.
pub(super) fn measure(plant: &Plant, state: &CarState, now: &Motion, delayed: &[f64; SIGNALS]) -> CarOutput {
    let [x, y, yaw, vx, vy, yaw_rate, ax, ay, roll, pitch, roll_rate] = *delayed;
    let effects = &plant.effects;
    let angle = effects.heading_misalignment;
    let (sin, cos) = angle.sin_cos();
    let turn = |x: f64, y: f64| (x * cos + y * sin, y * cos - x * sin);
    let (vx, vy) = turn(vx * effects.speed_scale, vy * effects.speed_scale);
    let (ax, ay) = turn(ax, ay);
    CarOutput {
        x,
        y,
        yaw: yaw + angle,
        vx,
        vy,
        yaw_rate: yaw_rate + effects.yaw_rate_bias,
        ax,
        ay: ay + effects.lateral_accel_bias,
        steer: state.steering.measured(),
        roll,
        pitch,
        roll_rate,
        road_wheel_angle: state.steering.road_wheel(&plant.steering),
        wheels: now.wheels,
        drive_force: now.drive_force,
        station: state.station,
        status: status(state, now),
    }
}

/// Slip beyond which a wheel counts as locked or spinning, slip angle beyond which an axle slides.
const WHEEL_SLIP: f64 = 0.3;
const SLIDING: f64 = 0.25;
/// Speed below which the car stands, m/s.
const STANDING: f64 = 0.02;

fn status(state: &CarState, now: &Motion) -> CarStatus {
    let axle_slides =
        |left: usize| now.wheels[left].slip_angle.abs().min(now.wheels[left + 1].slip_angle.abs()) > SLIDING;
    if now.wheels.iter().any(|wheel| wheel.load <= 0.0) {
        CarStatus::WheelLifted
    } else if state.y[VX].hypot(state.y[VY]) < STANDING
        && now.wheels.iter().all(|wheel| wheel.speed.abs() < 1.0)
    {
        CarStatus::Standstill
    } else if axle_slides(0) || axle_slides(2) {
        CarStatus::Sliding
    } else if now.wheels.iter().any(|wheel| wheel.slip.abs() > WHEEL_SLIP) {
        CarStatus::WheelSlip
    } else if state.steering.is_limited() {
        CarStatus::SteeringLimited
    } else {
        CarStatus::Driving
    }
}
