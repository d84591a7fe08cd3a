//! The filter's motion: its step by the nominal model and the commands, and what a measurement tells of it.

use super::{ARTICULATION, GATE, GRIP, Guard, SIGNALS, Signals};
use crate::nominal::{ERRORS, LateralVehicle};
use crate::path::wrap_angle;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// The vehicle's motion by the filter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Track {
    pub mean: Signals,
    pub covariance: SMatrix<f64, SIGNALS, SIGNALS>,
}

impl Track {
    /// False once numbers have outgrown the arithmetic, as those of a damaged saved state may.
    pub fn is_sound(&self, noise: &Signals) -> bool {
        // Of an innovation; rounding may leave a little less than nothing of the track's own.
        let variances = self.covariance.diagonal() + noise;
        self.mean.iter().chain(&variances).all(|number| number.is_finite()) && variances.min() >= 0.0
    }

    /// Takes the measured value of a signal into the estimate.
    pub fn observe(&mut self, signal: usize, value: f64, noise: f64) {
        let off = difference(signal, value, self.mean[signal]);
        let column = self.covariance.column(signal).into_owned();
        let gain = column / (column[signal] + noise);
        self.mean += gain * off;
        self.covariance -= gain * column.transpose();
    }
}

/// Difference of two values of a signal.
pub(super) fn difference(signal: usize, a: f64, b: f64) -> f64 {
    // Yaw and articulation are angles.
    if matches!(signal, 2 | ARTICULATION) && (a - b).is_finite() { wrap_angle(a - b) } else { a - b }
}

impl<V: LateralVehicle<S>, const S: usize> Guard<V, S> {
    /// The motion a step later.
    pub(super) fn predict(
        &self,
        track: &Track,
        steer: f64,
        [command, drift]: [f64; 2],
        scale: f64,
        elapsed: f64,
    ) -> Track {
        let (h, accel) = (elapsed, command + drift);
        let [x, y, yaw, vx, vy, yaw_rate, articulation, articulation_rate] = track.mean.data.0[0];
        // Slower than the model can be, the vehicle rolls: its steering turns it in proportion to its speed.
        let speed = vx.max(self.min_model_speed);
        let turned_by = steer * (vx / speed).clamp(-1.0, 1.0);
        // The model's errors to the line along which the vehicle drives now: e1' = vy + v e2. By the implicit Euler rule,
        // which is stable at every speed.
        let mut start = SVector::<f64, S>::zeros();
        (start[1], start[3]) = (vy, yaw_rate);
        if Self::JUDGED == SIGNALS {
            (start[ERRORS], start[ERRORS + 1]) = (articulation, articulation_rate);
        }
        let (by_start, next) = match self.vehicle.model_at(speed) {
            Ok(model) => {
                let by_start =
                    (SMatrix::identity() - model.a * h).try_inverse().unwrap_or_else(SMatrix::identity);
                (by_start, by_start * (start + model.b * (turned_by * h)))
            }
            Err(_) => (SMatrix::identity(), start),
        };
        // Tyres saturate, the model's do not.
        let limited = |to: f64, from: f64, rate: f64| to.clamp(from - rate * h, from + rate * h);
        let next_rate = limited(next[3], yaw_rate, self.yaw_accel);
        let next_vy = limited(next[1], vy, GRIP) - speed * h * next_rate;
        // Brakes hold, they do not reverse, nor drive on what rolls back.
        let next_vx = match (accel < 0.0, vx >= 0.0) {
            (true, true) => (vx + accel * h).max(0.0),
            (true, false) if command < 0.0 => (vx - command * h).min(0.0),
            _ => vx + accel * h,
        };
        let mut mean = track.mean;
        let (sin, cos) = (yaw + 0.25 * h * (yaw_rate + next_rate)).sin_cos();
        let (along, across) = (0.5 * scale * (vx + next_vx), 0.5 * scale * (vy + next_vy));
        mean[0] = x + h * (along * cos - across * sin);
        mean[1] = y + h * (along * sin + across * cos);
        mean[2] = yaw + 0.5 * h * (yaw_rate + next_rate);
        (mean[3], mean[4], mean[5]) = (next_vx, next_vy, next_rate);

        let mut by = SMatrix::<f64, SIGNALS, SIGNALS>::identity();
        by[(0, 2)] = -h * (along * sin + across * cos);
        by[(1, 2)] = h * (along * cos - across * sin);
        (by[(0, 3)], by[(0, 4)]) = (h * cos, -h * sin);
        (by[(1, 3)], by[(1, 4)]) = (h * sin, h * cos);
        by[(2, 5)] = h;
        // The body's states by its states: places in the motion and in the model.
        let body = [(4, 1), (5, 3), (6, ERRORS), (7, ERRORS + 1)];
        let body = &body[..if Self::JUDGED == SIGNALS { 4 } else { 2 }];
        for &(column, of) in body {
            for &(row, to) in body {
                by[(row, column)] = by_start[(to, of)];
            }
            by[(4, column)] -= speed * by_start[(2, of)];
        }
        if Self::JUDGED == SIGNALS {
            let rate = limited(next[ERRORS + 1], articulation_rate, 2.0 * self.yaw_accel);
            (mean[6], mean[7]) = (articulation + 0.5 * h * (articulation_rate + rate), rate);
        }
        // Beyond the model tyres do no more than they can do at all: that is where the gate stands.
        let (push, turn) = (GRIP / GATE * h, self.yaw_accel / GATE * h);
        let missed = Signals::from([
            0.5 * h * push,
            0.5 * h * push,
            0.5 * h * turn,
            push,
            push,
            turn,
            h * turn,
            2.0 * turn,
        ]);
        let mut covariance = by * track.covariance * by.transpose();
        for i in 0..Self::JUDGED {
            covariance[(i, i)] += missed[i] * missed[i];
        }
        Track { mean, covariance }
    }
}
