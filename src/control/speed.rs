//! Speed tracking beside the steering: feedforward of the speed plan and a PI on the speed error.
//!
//! A vehicle whose drive follows its command with a lag `tau` has an output that follows it without one:
//!
//! ```text
//! y = v + tau a_d,   tau a_d' = a - a_d,   v' = a_d + d     =>     y' = a + d
//! a = y_plan' + gain (y_plan - y) + integral sum (y_plan - y) Ts,     y_plan = v_plan(s) + tau a_plan(s)
//! ```
//!
//! limited; the integral stands still while the limit is active. Without a lag `y` is the speed.
//!
//! Source: Fliess, Levine, Martin and Rouchon, Flatness and defect of non-linear systems, Int. J. Control 1995.

use super::parameters::SpeedParameters;

/// Result of one speed control step.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct SpeedCommand {
    pub accel_cmd: f64,
    pub integral: f64,
}

/// One step of the speed controller.
///
/// `target` is the planned output in m/s and its rate in m/s2, `output` the measured one, `integral` the integrator's state in
/// m/s2.
#[must_use]
pub fn track_speed(
    parameters: &SpeedParameters,
    target: (f64, f64),
    output: f64,
    integral: f64,
    sample_time: f64,
) -> SpeedCommand {
    let error = target.0 - output;
    let wanted = target.1 + parameters.gain * error + integral;
    // Bounds that cross leave the upper one.
    let accel_cmd = wanted.max(-parameters.decel_cmd_max).min(parameters.accel_cmd_max);
    let drives_out = (wanted > accel_cmd && error > 0.0) || (wanted < accel_cmd && error < 0.0);
    let step = if drives_out { 0.0 } else { parameters.integral * error * sample_time };
    // Drag and grade are what the integral is for: more than 2 m/s2 of it is windup.
    SpeedCommand { accel_cmd, integral: (integral + step).clamp(-2.0, 2.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holds_the_planned_speed_against_a_constant_drag() {
        let parameters = SpeedParameters::default();
        let (mut speed, mut integral) = (10.0, 0.0);
        for _ in 0..5000 {
            let command = track_speed(&parameters, (10.0, 0.0), speed, integral, 0.02);
            integral = command.integral;
            speed += 0.02 * (command.accel_cmd - 0.4);
        }
        assert!((speed - 10.0).abs() < 1e-6, "{speed}");
    }

    #[test]
    fn a_known_lag_of_the_drive_leaves_no_overshoot() {
        let parameters = SpeedParameters { integral: 0.0, ..SpeedParameters::default() };
        let (lag, step) = (1.5, 0.02);
        let (mut speed, mut drive) = (10.0, 0.0);
        let mut largest: f64 = 0.0;
        for _ in 0..1000 {
            let command = track_speed(&parameters, (12.0, 0.0), speed + lag * drive, 0.0, step);
            let kept = (-step / lag).exp();
            let before = drive;
            drive = command.accel_cmd + (drive - command.accel_cmd) * kept;
            speed += 0.5 * step * (before + drive);
            largest = largest.max(speed);
        }
        assert!((speed - 12.0).abs() < 1e-3 && largest < 12.001, "{speed} {largest}");
    }

    #[test]
    fn does_not_wind_up_at_the_limit() {
        let parameters = SpeedParameters::default();
        let mut integral = 0.0;
        for _ in 0..1000 {
            let command = track_speed(&parameters, (30.0, 0.0), 0.0, integral, 0.02);
            assert!((command.accel_cmd - parameters.accel_cmd_max).abs() < 1e-12);
            integral = command.integral;
        }
        assert_eq!(integral, 0.0);
    }
}
