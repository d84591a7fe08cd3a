//! Prior beliefs before a log is seen: quality of the vehicle's numbers, probability of each effect.
//!
//! Tolerances are normal, as of a careful measurement, or have heavy tails, as of a data sheet. With heavy tails most
//! numbers are right and a few are far off; one more of these is no discovery. The log tells which:
//!
//! ```text
//!     P(hypothesis | log) = sum over worlds w of  P(w) P(hypothesis | log, w),      tolerances of w: N(0, s^2) or t_4(0, s^2)
//! ```
//!
//! Sources: Student's t with 4 degrees of freedom is asked for by the specification. A mixture as a robust prior:
//! O'Hagan and Pericchi, Bayesian heavy-tailed models and conflict resolution, Braz. J. Probab. Stat. 26 (2012).

use super::calibration::Calibration;
use std::collections::BTreeMap;

/// Quality of the vehicle's numbers.
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

/// Spread of the tolerances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct World {
    /// Factor on all of them.
    pub factor: f64,
    /// True for Student's t ([`super::fit::FREEDOM`] degrees of freedom), false for normal ones.
    pub heavy_tails: bool,
    /// Logarithm of the odds against it.
    pub odds: f64,
}

impl Trust {
    /// Possible worlds; the log tells which.
    #[must_use]
    pub fn worlds(self, calibration: &Calibration) -> [World; 2] {
        let factor = match self {
            Self::Low => 2.0,
            Self::Usual => 1.0,
            Self::High => 0.5,
        };
        let world = |heavy_tails: bool| {
            let odds = if heavy_tails { calibration.tails_odds } else { 0.0 };
            World { factor, heavy_tails, odds }
        };
        [false, true].map(world)
    }
}

/// All that is believed.
#[derive(Debug, Clone, Default)]
pub struct Beliefs {
    /// Quality of the vehicle's numbers.
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
