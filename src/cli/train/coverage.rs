//! Coverage of logs: speeds, bends and commands, and the steering actuator that they show.

use crate::nominal::{Actuator, LateralVehicle, SteeringDrive, identify_from_drives};
use crate::residual::{DataSet, ShownActuator, ShownBy};
use crate::signal::{STEER, YAW_RATE};
use crate::simulate::prove::NotBetter;
use serde_json::{Value, json};

/// The steering actuator as logs show it: by the measured angle where there is one, else by the yaw rate.
pub(in crate::cli) fn shown_by<V: LateralVehicle<S>, const S: usize>(
    angles: &[SteeringDrive],
    data: &DataSet<V, S>,
    threads: usize,
) -> Option<ShownActuator> {
    // A copy of the command in the place of the angle shows no actuator. Where a measured angle shows none, the yaw rate,
    // which comes later in the same chain, shows none either: what it seems to show is a gap, or the tyres.
    let copied = angles.iter().all(|drive| drive.steer_cmd == drive.response);
    if copied {
        return data.actuator(threads);
    }
    ShownActuator::measured(&identify_from_drives(angles).ok()?)
}

/// Coverage of the logs.
pub(super) struct Coverage {
    /// Least, greatest and 5 %, 95 % quantiles of the speed, m/s.
    speed: [f64; 4],
    /// Greatest curvature, 1/m.
    curvature: f64,
    /// Greatest lateral acceleration, m/s2.
    lateral_accel: f64,
    /// Root mean square of the command's change over a second, rad/s.
    command_rate: f64,
    shown: Option<ShownActuator>,
}

impl Coverage {
    pub fn of<V: LateralVehicle<S>, const S: usize>(
        data: &DataSet<V, S>,
        shown: Option<ShownActuator>,
    ) -> Self {
        let windows = data.windows(2);
        let mut speeds: Vec<f64> = (0..windows.len()).map(|i| windows.road(i)[0]).collect();
        speeds.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            let place = (share * speeds.len().saturating_sub(1) as f64).round() as usize;
            speeds.get(place).copied().unwrap_or(f64::NAN)
        };
        let most = |of: fn([f64; 3]) -> f64| {
            (0..windows.len()).map(|i| of(windows.road(i)).abs()).fold(0.0, f64::max)
        };
        let change = |i: usize| windows.commands(i)[1] - windows.commands(i)[0];
        let squares: f64 = (0..windows.len()).map(|i| change(i).powi(2)).sum();
        Self {
            speed: [0.0, 1.0, 0.05, 0.95].map(quantile),
            curvature: most(|[_, curvature, _]| curvature),
            lateral_accel: most(|[speed, curvature, _]| speed * speed * curvature),
            command_rate: (squares / windows.len().max(1) as f64).sqrt() / data.sample_time(),
            shown,
        }
    }

    pub fn say(&self) {
        let [least, greatest, low, high] = self.speed;
        say!(
            "covered: speed {least:.1} to {greatest:.1} m/s (90 % of the time {low:.1} to {high:.1}), curvature up to {:.3} 1/m, \
             lateral acceleration up to {:.1} m/s2, command changing by {:.3} rad/s (RMS)",
            self.curvature,
            self.lateral_accel,
            self.command_rate
        );
        match self.shown {
            Some(shown) if shown.is_shown() => {
                let Actuator { dead_time, time_constant, .. } = shown.prior.actuator;
                let by = match shown.by {
                    ShownBy::Angle => "its measured angle",
                    ShownBy::YawRate => "its yaw response",
                };
                say!(
                    "steering by {by}: dead time {dead_time:.3} s, lag {time_constant:.3} s, both together {:.3} +- {:.3} s",
                    dead_time + time_constant,
                    shown.spread
                );
            }
            _ => say!("steering: the logs do not excite it enough to show dead time and lag"),
        }
    }

    pub fn json(&self) -> Value {
        let [least, greatest, low, high] = self.speed;
        json!({
            "speed": { "min": least, "max": greatest, "p05": low, "p95": high },
            "curvature_max": self.curvature,
            "lateral_accel_max": self.lateral_accel,
            "command_rate_rms": self.command_rate,
            "steering": self.shown.map(|shown| json!({
                "dead_time": shown.prior.actuator.dead_time,
                "lag": shown.prior.actuator.time_constant,
                "sum_spread": shown.spread,
                "by": match shown.by { ShownBy::Angle => STEER.name, ShownBy::YawRate => YAW_RATE.name },
                "shown": shown.is_shown(),
            })),
        })
    }

    /// Advice for better logs.
    pub fn advice(&self, car: &str, reason: &NotBetter) -> String {
        if let NotBetter::Unexplained { .. } = reason {
            return format!(
                "rfl diagnose LOG.csv{car} finds what the vehicle's file lacks and leaves a corrected one: rfl train LOG.csv --vehicle \
                 out/diagnosis/calibrated.toml. Check the file's wheelbase, mass and tyres, too"
            );
        }
        if self.shown.is_some_and(|shown| shown.is_shown()) {
            let choice = match reason {
                NotBetter::NotShown { .. } => "drives about as well, and needs no model",
                _ => "is the better choice",
            };
            format!(
                "The default controller {choice} (rfl drive{car}). Drives with dither at the speeds and bends to come say \
                 more: rfl collect{car}, then rfl train out/collect/*.csv{car}"
            )
        } else {
            format!(
                "The steering is not excited enough: rfl collect{car}, then rfl train out/collect/*.csv{car}"
            )
        }
    }
}
