//! What is believed before a log is seen: how good the vehicle's numbers are, and how likely each effect is.
//!
//! Tolerances are normal, as of a careful measurement; or they have heavy tails, as of a data sheet: most numbers are right, and
//! a few are far off, and one more of these is no discovery. The log tells which:
//!
//! ```text
//!     P(hypothesis | log) = sum over worlds w of  P(w) P(hypothesis | log, w),      tolerances of w: N(0, s^2) or t_4(0, s^2)
//! ```
//!
//! Source: the specification asks for Student's t with 4 degrees of freedom; a mixture as a robust prior is that of O'Hagan and
//! Pericchi, Bayesian heavy-tailed models and conflict resolution, Braz. J. Probab. Stat. 26 (2012).

use super::calibration::Calibration;
use std::collections::BTreeMap;

/// Degrees of freedom of heavy tails.
const TAILS: f64 = 4.0;

/// How good the vehicle's numbers are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Trust {
    /// Of another vehicle of the kind, or by hearsay: tolerances twice as wide
    Low,
    /// Of a data sheet, or measured
    #[default]
    Usual,
    /// Measured on this very vehicle: tolerances half as wide
    High,
}

/// How tolerances are spread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct World {
    /// Factor on all of them.
    pub factor: f64,
    /// Degrees of freedom of Student's t; none where they are normal.
    pub tails: Option<f64>,
    /// Logarithm of the odds against it.
    pub odds: f64,
}

impl Trust {
    /// What may be; the log tells which.
    #[must_use]
    pub fn worlds(self, calibration: &Calibration) -> [World; 2] {
        let factor = match self {
            Self::Low => 2.0,
            Self::Usual => 1.0,
            Self::High => 0.5,
        };
        let world = |tails: Option<f64>| {
            let odds = if tails.is_none() { 0.0 } else { calibration.tails_odds };
            World { factor, tails, odds }
        };
        [None, Some(TAILS)].map(world)
    }
}

/// All that is believed.
#[derive(Debug, Clone, Default)]
pub struct Beliefs {
    /// How good the vehicle's numbers are.
    pub trust: Trust,
    /// Probability that an effect is among the causes, by id; of all others it is that of `calibration.toml`.
    pub probabilities: BTreeMap<String, f64>,
}

impl Beliefs {
    /// Logarithm of the odds against an effect.
    #[must_use]
    pub fn odds(&self, effect: &str, calibration: &Calibration) -> f64 {
        self.probabilities.get(effect).map_or(calibration.odds, |p| ((1.0 - p) / p).ln())
    }
}
