//! Speed tracking beside the steering: feedforward of the speed plan and a PI on the speed error.
//!
//! `a = a_plan(s) + gain (v_plan(s) - v) + integral sum (v_plan - v) Ts`, limited; the integral stands still while
//! the limit is active.

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
/// `target` is the planned speed in m/s and acceleration in m/s2, `speed` the measured speed, `integral` the integrator's state
/// in m/s2.
#[must_use]
pub fn track_speed(
    parameters: &SpeedParameters,
    target: (f64, f64),
    speed: f64,
    integral: f64,
    sample_time: f64,
) -> SpeedCommand {
    let error = target.0 - speed;
    let wanted = target.1 + parameters.gain * error + integral;
    let accel_cmd = wanted.clamp(-parameters.decel_cmd_max, parameters.accel_cmd_max);
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
