//! Reference of following the road: the states and the steering of a vehicle that stays on it exactly.
//!
//! On the path `e1`, its rate and its second derivative are zero. The second row of
//! `x' = A x + B delta + D w + E w' + [0 1 0 ..]' g`, with the road's heading rate `w` and gravity `g` along its bank, then
//! gives the steering. The other rows give the body's motion meanwhile (the zero dynamics):
//! ```text
//! delta = -(a_2 x + d_2 w + e_2 w' + g) / b_2
//! x'    = (A - B a_2/b_2) x + (D - B d_2/b_2) w + (E - B e_2/b_2) w' + ([0 1 0 ..]' - B/b_2) g
//! ```
//!
//! They are stable for front steering and an error measured at the CG. The command leads the steering by the known
//! actuator, `u(t) = delta(t + T) + tau delta'(t + T)`.
//!
//! The cost of the MPC is on deviations from this. A cost on the steering's rate itself would cut every bend, the more
//! the calmer the loop is. With this one a calm loop that knows its vehicle tracks as well as a tight one. The weights
//! only decide the correction of errors.
//!
//! Source: Isidori, Nonlinear Control Systems, ch. 4.3 (zero dynamics, inversion); Rajamani, Vehicle Dynamics and Control,
//! ch. 3.3 (steady cornering as feedforward).

use super::preview::{Preview, bank_accel};
use crate::nominal::{Actuator, ContinuousErrorModel, DeadTimeModel, LateralVehicle};
use crate::path::Path;
use nalgebra::SVector;

/// Time before now at which the body's motion begins, in steady cornering, s: long enough to be forgotten.
const BEGIN: f64 = 0.6;
/// Longest look-ahead of a command beyond the horizon, s.
const AHEAD: f64 = 0.4;
/// Largest plausible deviation of the states from steady cornering, rad and rad/s: far from straight driving the linear
/// model means nothing.
const LARGEST: f64 = 0.3;

/// Steady motion of a vehicle on its path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steady<const S: usize> {
    /// State at the speed, for each 1/m of curvature.
    at: SVector<f64, S>,
    /// State on a straight, for each m/s2 of the tyres' lateral acceleration.
    of_accel: SVector<f64, S>,
}

impl<const S: usize> Steady<S> {
    /// Of a vehicle at a speed, m/s. Forces are as the square of the speed, angles of rolling wheels are not.
    pub fn new(vehicle: &impl LateralVehicle<S>, speed: f64) -> Self {
        let [slow, fast] = [10.0, 20.0];
        let of_accel =
            (vehicle.steady_state(fast) - vehicle.steady_state(slow)) / (fast * fast - slow * slow);
        Self { at: vehicle.steady_state(speed), of_accel }
    }
}

/// The reference over a horizon, preallocated.
#[derive(Debug, Clone)]
pub(super) struct RoadReference<const S: usize> {
    sample_time: f64,
    /// Steps before now.
    before: usize,
    /// Steering at the instants `before` steps before now and on, rad.
    steer: Vec<f64>,
    /// States at the ends of the steps less those of steady cornering.
    transient: Vec<SVector<f64, S>>,
}

impl<const S: usize> RoadReference<S> {
    /// Room for a horizon.
    #[must_use]
    pub fn new(horizon: usize, sample_time: f64) -> Self {
        let steps = |time: f64| (time / sample_time).ceil() as usize;
        let before = steps(BEGIN);
        Self {
            sample_time,
            before,
            steer: vec![0.0; before + horizon + steps(AHEAD) + 1],
            transient: vec![SVector::zeros(); horizon],
        }
    }

    /// Drives the road from a station on: `speed` now, then as in the preview, then held.
    pub fn follow(
        &mut self,
        model: &ContinuousErrorModel<S>,
        steady: &Steady<S>,
        path: &Path,
        station: f64,
        speed: f64,
        preview: &Preview,
    ) {
        let ContinuousErrorModel { a, b, d, e } = model;
        let row = a.row(1) / b[1];
        let is_banked = !path.is_level();
        let across = SVector::from_fn(|i, _| if i == 1 { 1.0 } else { 0.0 });
        let (of_rate, of_accel) = (d[1] / b[1], e[1] / b[1]);
        let kept = ContinuousErrorModel {
            a: a - b * row,
            // The place of an input that this motion no longer has is that of gravity.
            b: if is_banked { across - b / b[1] } else { SVector::zeros() },
            d: d - b * of_rate,
            e: e - b * of_accel,
        };
        let kept = kept.discretise(self.sample_time);
        let mut s = station - speed * self.sample_time * self.before as f64;
        let mut x = steady.at * path.curvature(s);
        if is_banked {
            x -= steady.of_accel * bank_accel(path, s);
        }
        let mut v = speed;
        for k in 0..self.steer.len() {
            let ahead = k.checked_sub(self.before);
            let [curvature, curvature_rate] = path.bend(s);
            let mut steer = -(row * x)[0] - of_rate * v * curvature - of_accel * v * v * curvature_rate;
            if is_banked {
                steer -= bank_accel(path, s) / b[1];
            }
            self.steer[k] = steer;
            let [mean, next] = ahead.and_then(|j| preview.speed.get(j)).copied().unwrap_or([v, v]);
            let (rate, accel, bank) = match ahead.filter(|&j| j < preview.heading_rate.len()) {
                Some(j) => (preview.heading_rate[j], preview.heading_accel[j], preview.bank_accel[j]),
                None => {
                    let middle = s + 0.5 * mean * self.sample_time;
                    let [curvature, curvature_rate] = path.bend(middle);
                    let bank = if is_banked { bank_accel(path, middle) } else { 0.0 };
                    (mean * curvature, mean * mean * curvature_rate, bank)
                }
            };
            x = kept.a * x + kept.d * rate + kept.e * accel;
            if is_banked {
                x += kept.b * bank;
            }
            // On the path, whatever rounding says.
            (x[0], x[1]) = (0.0, 0.0);
            (s, v) = (s + mean * self.sample_time, next);
            if let Some(j) = ahead.filter(|&j| j < self.transient.len()) {
                let deviation = x - steady.at * preview.curvature[j];
                self.transient[j] = deviation.map(|value| value.clamp(-LARGEST, LARGEST));
            }
        }
    }

    /// Least and largest steering from now to the end of the horizon, rad.
    pub fn steer_range(&self) -> [f64; 2] {
        let ahead = &self.steer[self.before..];
        ahead.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[least, largest], &steer| {
            [least.min(steer), largest.max(steer)]
        })
    }

    /// Deviation of the states from steady cornering at the end of a step.
    pub fn transient(&self, step: usize) -> &SVector<f64, S> {
        &self.transient[step]
    }

    /// Writes the change of the command in each step, ahead of the steering by an actuator.
    pub fn write_increments(&self, actuator: Option<&Actuator>, increments: &mut [f64]) {
        let (dead_time, lag) = match actuator {
            None => (0.0, 0.0),
            Some(known) if known.dead_time_model == DeadTimeModel::FirstOrder => (0.0, known.time_constant),
            Some(known) => (known.dead_time, known.time_constant),
        };
        let last = self.steer.len() - 1;
        // Mean over a step in which the command is held; `after` counts steps from the one before now.
        let command = |after: usize| {
            let at = (self.before + after) as f64 - 0.5 + dead_time / self.sample_time;
            let k = (at as usize).min(last - 1);
            let (from, to) = (self.steer[k], self.steer[k + 1]);
            from + (to - from) * (at - k as f64).min(1.0) + lag * (to - from) / self.sample_time
        };
        let mut newest = command(0);
        for (j, increment) in increments.iter_mut().enumerate() {
            let next = command(j + 1);
            *increment = next - newest;
            newest = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::SpeedAhead;
    use crate::control::variant::effect_of_bank;
    use crate::path::{Closure, Sample};
    use crate::vehicle::SingleTrack;

    /// A road with gentle bends of both sides, banked as much at most, rad.
    fn road(bank: f64) -> Path {
        let mut samples = Vec::new();
        let (mut x, mut y, mut yaw) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..1200 {
            let s = f64::from(k) * 0.5;
            let banked = (bank > 0.0).then(|| bank * (0.5 + 0.5 * (s / 40.0).cos()));
            samples.push(Sample { bank: banked, ..Sample::at(x, y) });
            yaw += 0.5 * 0.02 * (s / 12.0).sin();
            x += 0.5 * yaw.cos();
            y += 0.5 * yaw.sin();
        }
        Path::from_samples(samples, Closure::Detect).unwrap()
    }

    #[test]
    fn the_reference_keeps_the_linear_vehicle_on_the_road() {
        let car = SingleTrack { mass: 1400.0, yaw_inertia: 2300.0, lf: 1.1, lr: 1.6, cf: 120e3, cr: 140e3 };
        let (ts, horizon) = (0.02, 200);
        for (speed, bank) in [(5.0, 0.0), (12.0, 0.0), (25.0, 0.0), (12.0, 0.1), (25.0, 0.1)] {
            let path = road(bank);
            let model = car.model_at(speed).unwrap();
            let mut preview = Preview::new(horizon);
            preview.look(&path, 100.0, SpeedAhead { speed, accel: 0.0, predicted: &[] }, ts);
            let mut reference = RoadReference::new(horizon, ts);
            reference.follow(&model, &Steady::new(&car, speed), &path, 100.0, speed, &preview);
            let mut increments = vec![0.0; horizon];
            reference.write_increments(None, &mut increments);
            // Begins where the reference is; drives its commands.
            let sampled = model.discretise(ts);
            let mut x = SVector::<f64, 4>::zeros();
            let first = reference.steer[reference.before];
            let mut steer = 0.5 * (reference.steer[reference.before - 1] + first);
            let mut begun = false;
            for (j, increment) in increments.iter().enumerate() {
                steer += increment;
                if begun {
                    x = sampled.step(&x, steer, preview.heading_rate[j], preview.heading_accel[j]);
                    x += effect_of_bank(&model.a, &sampled.a, ts) * preview.bank_accel[j];
                    assert!(x[0].abs() < 2e-3, "{speed} m/s, bank {bank}, step {j}: {} m off", x[0]);
                } else {
                    x = reference.transient(j) + car.steady_state(speed) * preview.curvature[j];
                    begun = true;
                }
            }
        }
    }
}
