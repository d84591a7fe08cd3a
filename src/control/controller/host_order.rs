//! Time from measurement to measurement in a host whose steps vary: it depends on the order in which the host steps its units.
//!
//! A host that steps the controller first gives it the measurement of the step's beginning, `t_k`. One that steps the vehicle
//! first gives that of its end, `t_k + h_k`, under the same time:
//!
//! ```text
//! controller first:  t_k - t_{k-1}        vehicle first:  (t_k + h_k) - (t_{k-1} + h_{k-1})
//! ```
//!
//! Of the two that one holds whose way by the velocities is the way of the poses,
//!
//! ```text
//! r = |way| - |v| elapsed,     evidence += (r_controller^2 - r_vehicle^2) / (2 sigma^2),  bounded
//! ```
//!
//! Where steps are alike both times are one, and nothing is to be found out.

use super::ROUNDING;
use crate::control::guard::Way;
use crate::control::observer::ObserverParameters;
use serde::{Deserialize, Serialize};

/// Evidence at the start, against a vehicle that is stepped first; of one step at most; and of all.
const START: f64 = -1.0;
const OF_STEP: f64 = 2.0;
const MOST: f64 = 6.0;
/// Share by which an odometer's way may differ from the poses', as a standard deviation.
const SCALE: f64 = 0.02;
/// Standard deviations beyond which a way fits neither time: a place that jumps, or a receiver slower than the steps.
const NEITHER: f64 = 3.0;

/// What the drive has shown of the order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct HostOrder {
    /// Above zero for a vehicle that is stepped first.
    evidence: f64,
    /// End of the step before, s.
    end: Option<f64>,
}

impl Default for HostOrder {
    fn default() -> Self {
        Self { evidence: START, end: None }
    }
}

impl HostOrder {
    /// Time since the last measurement, s: `by_label` by the times at which the controller was called, `end` that of the
    /// step's end now. `way`: since the last measurement, if something can be said of it.
    pub fn elapsed(&mut self, by_label: f64, end: f64, way: Option<Way>, noise: &ObserverParameters) -> f64 {
        let Some(by_end) = self.end.replace(end).map(|before| end - before).filter(|time| *time > 0.0) else {
            return by_label;
        };
        if (by_end - by_label).abs() < ROUNDING * by_label {
            return by_label;
        }
        if let Some(Way { by_poses, speed }) = way {
            let sigma = (2.0_f64.sqrt() * noise.noise_position)
                .hypot(noise.noise_velocity * by_label)
                .hypot(SCALE * by_poses);
            let [controller, vehicle] = [by_label, by_end].map(|time| (by_poses - speed * time) / sigma);
            if controller.abs().min(vehicle.abs()) < NEITHER {
                let said = 0.5 * (controller * controller - vehicle * vehicle);
                self.evidence = (self.evidence + said.clamp(-OF_STEP, OF_STEP)).clamp(-MOST, MOST);
            }
        }
        if self.evidence > 0.0 { by_end } else { by_label }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times that a drive with steps in turn is given, with `late` the place of the pose in its step.
    fn given(late: bool, jump: usize) -> Vec<(f64, f64)> {
        let noise = ObserverParameters::default();
        let (mut order, mut time, mut last) = (HostOrder::default(), 0.0, 0.0);
        let mut all = vec![];
        for (k, step) in [0.02, 0.05].into_iter().cycle().take(60).enumerate() {
            let pose = time + if late { step } else { 0.0 };
            let far = if k == jump { 0.4 } else { 0.0 };
            let way = (k > 0).then_some(Way { by_poses: 8.0 * (pose - last) + far, speed: 8.0 });
            let by_label = if k == 0 { 0.02 } else { [0.05, 0.02][k % 2] };
            all.push((order.elapsed(by_label, time + step, way, &noise), pose - last));
            (time, last) = (time + step, pose);
        }
        all.split_off(2)
    }

    #[test]
    fn the_order_is_found_and_kept() {
        for late in [false, true] {
            for jump in [usize::MAX, 3, 30] {
                let off = given(late, jump).into_iter().filter(|(found, truth)| (found - truth).abs() > 1e-9);
                assert!(off.count() <= 1, "{late}, {jump}");
            }
        }
    }
}
