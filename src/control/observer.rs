//! A disturbance observer: what the prediction misses on average, added to it (offset-free MPC).
//!
//! ```text
//! d_k = d_{k-1} + L (x_k - x^_k),     x^_{k+1} = prediction of x_{k+1} with d_k and the command that was issued
//! ```
//!
//! and the horizon is predicted with `d_k` held. A steady gap (bank, wind, a steering offset, a wrong stiffness in a
//! long bend) is then no steady error any more. On a vehicle with an uncorrected actuator delay a fast observer
//! feeds the delay's error back and destabilises the loop: choose a small `L`, or add a learned residual first.
//!
//! Source: Maeder, Borrelli and Morari, Linear offset-free model predictive control, Automatica 2009.

use crate::nominal::ErrorState;
use serde::{Deserialize, Serialize};

/// The observer's state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Observer {
    disturbance: ErrorState,
    predicted: Option<ErrorState>,
}

/// Largest disturbance for one step that is believed: [m, m/s, rad, rad/s]. More is a jump in a measurement, not a gap.
const LARGEST: [f64; 4] = [0.05, 0.2, 0.02, 0.1];

impl Default for Observer {
    fn default() -> Self {
        Self { disturbance: ErrorState::zeros(), predicted: None }
    }
}

impl Observer {
    /// Takes a measured state; `gain` is `L` in 0..1, 0 switches the observer off.
    pub fn observe(&mut self, state: &ErrorState, gain: f64) {
        let Some(predicted) = self.predicted.take() else { return };
        self.disturbance += (state - predicted) * gain;
        for (value, largest) in self.disturbance.iter_mut().zip(LARGEST) {
            *value = value.clamp(-largest, largest);
        }
    }

    /// Keeps the prediction of the next state, with the disturbance in it.
    pub fn expect(&mut self, state: ErrorState) {
        self.predicted = Some(state);
    }

    /// Forgets everything: the vehicle was moved, or is where the model says nothing.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// Disturbance of a step.
    #[must_use]
    pub fn disturbance(&self) -> &ErrorState {
        &self.disturbance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_finds_a_steady_gap() {
        let mut observer = Observer::default();
        let gap = ErrorState::new(0.0, 0.01, 0.0, -0.002);
        for _ in 0..400 {
            observer.observe(&gap, 0.05);
            observer.expect(*observer.disturbance());
        }
        assert!((observer.disturbance() - gap).norm() < 1e-8);
    }
}
