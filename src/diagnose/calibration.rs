//! Thresholds and probabilities, from one file.

use crate::residual::fnv;
use serde::Deserialize;

const TEXT: &str = include_str!("calibration.toml");

/// What `calibration.toml` holds; evidence is a difference of `J`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Evidence below which nothing is named.
    pub none: f64,
    /// Evidence that a second effect must add.
    pub pair: f64,
    /// Evidence within which candidates are one class.
    pub class: f64,
    /// Rest over noise and model form from which on the cause is not in the library.
    pub outside: f64,
    /// Share of the neutral gap that must be left besides.
    pub left: f64,
    /// Gap of an effect over that of the background below which it is not worth naming.
    pub dominance: f64,
    effect: [f64; 2],
    nothing: [f64; 2],
    unknown: [f64; 2],
}

impl Calibration {
    /// The calibration that comes with the program.
    ///
    /// # Panics
    /// Never: the file is part of the program, and a test reads it.
    #[must_use]
    pub fn built_in() -> Self {
        toml::from_str(TEXT).expect("the calibration that comes with the program is sound")
    }

    /// Its hash, hexadecimal.
    #[must_use]
    pub fn hash() -> String {
        format!("{:016x}", fnv(TEXT.as_bytes()))
    }

    /// Probability that a named effect is right, by the evidence against the next candidate outside its class.
    #[must_use]
    pub fn of_effect(&self, margin: f64) -> f64 {
        logistic(self.effect, margin)
    }

    /// That there is nothing, by the evidence that is missing to name something.
    #[must_use]
    pub fn of_nothing(&self, margin: f64) -> f64 {
        logistic(self.nothing, margin)
    }

    /// That the cause is not in the library, by what is left beyond the threshold, as a share of it.
    #[must_use]
    pub fn of_unknown(&self, margin: f64) -> f64 {
        logistic(self.unknown, margin)
    }
}

fn logistic([a, b]: [f64; 2], margin: f64) -> f64 {
    1.0 / (1.0 + (-(a + b * margin.max(0.0).ln_1p())).exp())
}
