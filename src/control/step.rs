//! What a control step is given, and what it says: measurement, report, error.

use super::status::ControlStatus;
use serde::{Deserialize, Serialize};

/// Measurements of the vehicle, in SI units and ISO 8855 axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(missing_docs)]
pub struct Measurement {
    pub x: f64,
    pub y: f64,
    pub yaw: f64,
    pub vx: f64,
    pub vy: f64,
    pub yaw_rate: f64,
    /// Road-wheel angle: start of the steering command at the first step.
    pub steer: f64,
    /// Articulation angle, rad; 0 for a vehicle without one.
    pub articulation: f64,
    /// Its rate, rad/s.
    pub articulation_rate: f64,
}

/// Decision of a step, and its grounds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct StepReport {
    pub steer_cmd: f64,
    pub accel_cmd: f64,
    pub status: ControlStatus,
    pub e1: f64,
    pub e1_rate: f64,
    pub e2: f64,
    pub e2_rate: f64,
    pub station: f64,
    pub curvature: f64,
    pub curvature_rate: f64,
    pub speed_ref: f64,
    /// Distance along the path from the vehicle to the point that the speed controller follows, m; 0 without one.
    pub lag_error: f64,
    /// Share of the horizon where the learned residual was asked outside its training and faded out, 0 to 1.
    pub residual_outside: f64,
    /// Iterations of the QP solver; 0 if it did not run to an end.
    pub iterations: u32,
    /// Wall-clock time of the step, s: the only value that is not reproducible.
    pub compute_time: f64,
    /// The end of an open path is reached, or a full lap of a closed one is driven.
    pub finished: bool,
}

/// Reasons for which a step cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum StepError {
    #[error(
        "the measured {signal} is {value}: every value of the first measurement must be a finite number; later ones are \
         bridged for a while"
    )]
    NotFinite { signal: &'static str, value: f64 },
    #[error("the state is of a controller with another horizon, window or speed control")]
    ForeignState,
}

impl Measurement {
    /// Checks that every value is a number.
    pub(super) fn check(&self) -> Result<(), StepError> {
        let Self { x, y, yaw, vx, vy, yaw_rate, steer, articulation, articulation_rate } = *self;
        let signals = [
            ("x", x),
            ("y", y),
            ("yaw", yaw),
            ("vx", vx),
            ("vy", vy),
            ("yaw_rate", yaw_rate),
            ("steer", steer),
            ("articulation", articulation),
            ("articulation_rate", articulation_rate),
        ];
        match signals.into_iter().find(|(_, value)| !value.is_finite()) {
            Some((signal, value)) => Err(StepError::NotFinite { signal, value }),
            None => Ok(()),
        }
    }
}
