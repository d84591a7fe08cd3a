//! Signals of a replay at values of the sensors' uncertain parameters.

use super::list::INERTIAL;
use super::parameter::{Transform, UncertainParameter};
use crate::diagnose::replay::{Channel, LEAK, ReplayDrive, Trace};

impl UncertainParameter {
    /// Applies a sensor's uncertain parameter to a replay.
    pub(super) fn sense(&self, x: f64, drive: &ReplayDrive, trace: &mut Trace) {
        let (channel, factor, shift) = match self.turns {
            Transform::Scale(channel) => (channel, self.value(x), 0.0),
            Transform::Bias(channel) => (channel, 1.0, self.value(x)),
            Transform::Arm => {
                let arm = self.value(x);
                let rate = trace.columns[Channel::YawRate as usize].clone();
                trace.columns[Channel::Vy as usize]
                    .iter_mut()
                    .zip(rate)
                    .for_each(|(vy, rate)| *vy += arm * rate);
                return;
            }
            Transform::ReferenceHeight => {
                let (height, keep) = (self.value(x), (-drive.step / LEAK).exp());
                let Trace { columns, roll, .. } = trace;
                for &(from, to) in &drive.stretches {
                    let (mut across, mut before) = (0.0, roll[from]);
                    for (row, &roll) in roll.iter().enumerate().take(to).skip(from) {
                        let moved = -height * (roll - before);
                        before = roll;
                        across = keep * (across + moved);
                        for (channel, by) in [(Channel::Vy, moved / drive.step), (Channel::Across, across)] {
                            if let Some(value) = columns[channel as usize].get_mut(row) {
                                *value += by;
                            }
                        }
                    }
                }
                return;
            }
            Transform::InertialLag => {
                let rows = self.value(x) / drive.step;
                for column in INERTIAL.map(|channel| channel as usize) {
                    let column = &mut trace.columns[column];
                    for &(from, to) in &drive.stretches {
                        for i in (from + 1..to.min(column.len())).rev() {
                            column[i] -= rows * (column[i] - column[i - 1]);
                        }
                    }
                }
                return;
            }
            Transform::ImuHeight => {
                let feels = -self.value(x) / drive.step.powi(2);
                let roll = &trace.roll;
                let ay = &mut trace.columns[Channel::Ay as usize];
                for &(from, to) in &drive.stretches {
                    for i in from + 1..to.min(ay.len()).saturating_sub(1) {
                        ay[i] += feels * (roll[i - 1] - 2.0 * roll[i] + roll[i + 1]);
                    }
                }
                return;
            }
            _ => return,
        };
        trace.columns[channel as usize].iter_mut().for_each(|value| *value = factor * *value + shift);
    }
}

/// Lateness of a receiver's columns relative to all others, s.
#[must_use]
pub fn receiver_late(uncertain: &[UncertainParameter], x: &[f64]) -> f64 {
    let place = uncertain.iter().position(|uncertain| uncertain.turns == Transform::ReceiverLate);
    place.map_or(0.0, |i| uncertain[i].value(x[i]))
}

/// Applies the sensors' uncertain parameters to a replay.
pub fn sense(uncertain: &[UncertainParameter], x: &[f64], drive: &ReplayDrive, trace: &mut Trace) {
    for (uncertain, &x) in uncertain.iter().zip(x) {
        if x != 0.0 {
            uncertain.sense(x, drive, trace);
        }
    }
}
