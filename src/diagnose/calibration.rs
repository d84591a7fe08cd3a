//! Numbers of the statistical model, from one file.

use super::form::DeviationKind;
use super::posterior::Unknown;
use super::replay::Channel;
use crate::numerics::fnv;
use serde::Deserialize;
use std::sync::LazyLock;

const TEXT: &str = include_str!("calibration.toml");

/// Usual cost of freeing an effect: a log makes the prior range some ten times narrower.
const USUAL: f64 = 2.5;

/// Contents of `calibration.toml`; evidence is a difference of `J`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Power of the likelihood.
    pub temper: f64,
    /// Logarithm of the odds against an effect.
    pub odds: f64,
    /// The same against a varying value.
    varying_odds: f64,
    /// And against another number of the vehicle that is off.
    other_odds: f64,
    /// And against a sensor's number that is far off, which is ordinary then.
    pub sensor_odds: f64,
    /// Size of what is left.
    pub misfit: Misfit,
    /// Errors of the model's form.
    pub form: Form,
    /// Factor on the standard deviations of named values: the model's form adds to the fit's own.
    pub interval: f64,
}

/// Size of a fit's remainder, in units of the remainder that the model's form leaves.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Misfit {
    /// Mean and deviation of its logarithm for a cause in the library.
    known: (f64, f64),
    /// The same where it has not.
    outside: (f64, f64),
    /// Logarithm of the odds against that.
    odds: f64,
    /// Share of the explained part that a form leaves.
    pub share: f64,
}

/// Standard deviations of the tyres' curve: shape factor, as a share, curvature factor, lateral peak, as a share, early
/// softening, in that of brushes, and the nominal load over the load of the greatest stiffness.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct TyreDeviations {
    car: [f64; 5],
    truck: [f64; 5],
}

/// Standard deviations of the errors of the model's form: size, lateness in s, change with speed, with lateral and with
/// longitudinal acceleration, as in `form.rs`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Form {
    yaw_rate: [f64; 5],
    ay: [f64; 5],
    vy: [f64; 5],
    roll: [f64; 5],
    articulation: [f64; 5],
    ax: [f64; 5],
    tyre: TyreDeviations,
}

impl Form {
    /// Of a channel.
    #[must_use]
    pub fn of(&self, channel: Channel, kind: DeviationKind) -> f64 {
        let sizes = match channel {
            Channel::YawRate => self.yaw_rate,
            Channel::Ay => self.ay,
            Channel::Vy => self.vy,
            Channel::Roll => self.roll,
            Channel::Articulation => self.articulation,
            Channel::Ax => self.ax,
            _ => [0.0; 5],
        };
        sizes[kind as usize]
    }

    /// Of the tyres' curve: shape factor, as a share, curvature factor, lateral peak, as a share, early softening, and fall
    /// of stiffness with load.
    #[must_use]
    pub fn tyre(&self, truck: bool) -> [f64; 5] {
        if truck { self.tyre.truck } else { self.tyre.car }
    }
}

impl Calibration {
    /// The calibration that comes with the program.
    ///
    /// # Panics
    /// Never: the file is part of the program, and a test reads it.
    #[must_use]
    pub fn built_in() -> &'static Self {
        static PARSED: LazyLock<Calibration> = LazyLock::new(|| {
            toml::from_str(TEXT).expect("the calibration that comes with the program is sound")
        });
        &PARSED
    }

    /// Logarithm of the weight of effects, from the evidence of the tempered likelihood, the cost of their freedom, and
    /// the `odds` against them.
    #[must_use]
    pub fn weight(&self, evidence: f64, narrowing: f64, odds: f64) -> f64 {
        0.5 * evidence - narrowing - odds
    }

    /// Weight of a cause outside the library relative to the hypothesis that it extends. For a misfit: the ratio of two
    /// log-normal densities.
    #[must_use]
    pub fn unknown_weight(&self, unknown: &Unknown, evidence: f64, narrowing: f64) -> f64 {
        let explained = 0.5 * evidence - narrowing;
        match unknown {
            Unknown::Varies(_) | Unknown::Swings => explained - self.varying_odds,
            Unknown::Off { .. } => explained - self.other_odds,
            Unknown::Misfit(size, _) => {
                let Misfit { known, outside, odds, .. } = self.misfit;
                // Less than is usual speaks for nothing.
                let log = size.ln().max(known.0);
                let density = |(mean, deviation): (f64, f64)| {
                    -0.5 * ((log - mean) / deviation).powi(2) - deviation.ln()
                };
                density(outside) - density(known) - odds
            }
        }
    }

    /// Evidence from which on an effect with the usual cost of freedom is more probable than nothing.
    #[must_use]
    pub fn telling(&self) -> f64 {
        2.0 * (self.odds + USUAL) / self.temper
    }

    /// Its hash, hexadecimal.
    #[must_use]
    pub fn hash() -> String {
        format!("{:016x}", fnv(TEXT.as_bytes()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_speaks_for_another_cause_the_more_there_is() {
        let calibration = Calibration::built_in();
        let weights: Vec<f64> = [0.1, 0.4, 0.8, 1.6, 3.2]
            .iter()
            .map(|&size| calibration.unknown_weight(&Unknown::Misfit(size, Channel::Ay), 0.0, 0.0))
            .collect();
        assert!(weights[0] == weights[1] && weights.windows(2).all(|pair| pair[0] <= pair[1]), "{weights:?}");
        assert!(weights[1] < 0.0 && weights[4] > 0.0, "{weights:?}");
        let telling = calibration.telling();
        assert!(calibration.weight(calibration.temper * telling, USUAL, calibration.odds).abs() < 1e-12);
    }
}
