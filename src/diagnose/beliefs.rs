//! Prior beliefs before a log is seen: quality of the vehicle's numbers, probability of each effect.
//!
//! The numbers of a vehicle file share one unknown quality: a file is that of a careful measurement, of a data sheet, or
//! of another vehicle of the kind. Each tolerance `s` is scaled by the same `w`,
//!
//! ```text
//!     x ~ N(0, (w s)^2),    1 / w^2 ~ Gamma(nu / 2, nu / 2):    together a multivariate Student's t with nu = 4,
//!     P(hypothesis | log) = sum over w of  P(w) P(hypothesis | log, w),
//! ```
//!
//! by quadrature over `ln w`. So a number that is far off speaks for a poor file as well as for an effect, and all
//! others say which. Sensors and errors of the model's form are no matter of the file and keep their tolerances. One
//! sensor in twenty is far off besides, which is ordinary then, and no cause of its own (`calibration.toml`).
//!
//! Sources: Student's t with 4 degrees of freedom is asked for by the specification. A mixture as a robust prior:
//! O'Hagan and Pericchi, Bayesian heavy-tailed models and conflict resolution, Braz. J. Probab. Stat. 26 (2012).

use super::calibration::Calibration;
use std::collections::BTreeMap;

/// Degrees of freedom of the tolerances' Student's t.
const FREEDOM: f64 = 4.0;
/// Scales of the quadrature, as powers of their ratio, the square root of two: from 0.7 to 4.
const SCALES: std::ops::RangeInclusive<i32> = -1..=4;

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

/// Scale of the tolerances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct World {
    /// Factor on those of the vehicle's numbers.
    pub factor: f64,
    /// Logarithm of the odds against it.
    pub odds: f64,
}

impl Trust {
    /// Possible worlds; the log tells which.
    #[must_use]
    pub fn worlds(self) -> Vec<World> {
        let trusted = match self {
            Self::Low => 2.0,
            Self::Usual => 1.0,
            Self::High => 0.5,
        };
        // Density of ln w, but for a constant.
        let density = |w: f64| -FREEDOM * w.ln() - 0.5 * FREEDOM / (w * w);
        let scales: Vec<f64> = SCALES.map(|k| 2.0_f64.sqrt().powi(k)).collect();
        let all: f64 = scales.iter().map(|&w| density(w).exp()).sum();
        scales.into_iter().map(|w| World { factor: trusted * w, odds: all.ln() - density(w) }).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scales_make_a_students_t() {
        // Their mixture of normal densities, of one tolerance, beside 3 / 8 (1 + x^2 / 4)^-5/2.
        let worlds = Trust::Usual.worlds();
        let mixture = |x: f64| -> f64 {
            let of = |world: &World| {
                let deviation = world.factor;
                (-world.odds - 0.5 * (x / deviation).powi(2)).exp()
                    / (deviation * std::f64::consts::TAU.sqrt())
            };
            worlds.iter().map(of).sum()
        };
        for x in [0.0_f64, 1.0, 2.0, 4.0, 7.0] {
            let exact = 0.375 * (1.0 + 0.25 * x * x).powf(-2.5);
            let ratio = mixture(x) / exact;
            assert!((0.8..1.25).contains(&ratio), "{x}: {ratio}");
        }
        let all: f64 = worlds.iter().map(|world| (-world.odds).exp()).sum();
        assert!((all - 1.0).abs() < 1e-12);
        for (trust, times) in [(Trust::Low, 2.0), (Trust::High, 0.5)] {
            for (one, usual) in trust.worlds().iter().zip(&worlds) {
                assert!((one.factor - times * usual.factor).abs() < 1e-12 && one.odds == usual.odds);
            }
        }
    }
}
