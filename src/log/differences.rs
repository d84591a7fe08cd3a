//! Noise of a column by its third differences: no motion reaches these.

use crate::numerics::statistics::{MEDIAN_OF_NORMAL, median};
use std::ops::Range;

/// Differences beyond so many usual ones count as so many: a glitch is none of the noise.
const FAR: f64 = 4.0;
/// Correlation of third differences of white noise from row to row, and the distance within which it is that.
const WHITE: f64 = -0.75;
const NEARLY: f64 = 0.07;

/// Standard deviation of third differences of white noise of unit size.
const OF_WHITE: f64 = 4.472_135_954_999_58;

/// Correlation of a column's third differences.
pub(super) struct Correlation {
    differences: Vec<Vec<f64>>,
    power: f64,
    usual: f64,
}

impl Correlation {
    /// `None` without any difference.
    pub fn of(values: &[f64], spans: &[Range<usize>]) -> Option<Self> {
        let third = |v: &[f64]| v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0];
        let mut differences: Vec<Vec<f64>> =
            spans.iter().map(|span| values[span.clone()].windows(4).map(third).collect()).collect();
        let sizes = differences.iter().flatten().map(|it| it.abs()).filter(|it| it.is_finite()).collect();
        let usual = median(sizes)? / MEDIAN_OF_NORMAL;
        let most = FAR * usual;
        for it in differences.iter_mut().flatten() {
            *it = if it.is_finite() { it.clamp(-most, most) } else { 0.0 };
        }
        let power = differences.iter().flatten().map(|it| it * it).sum();
        (power > 0.0).then_some(Self { differences, power, usual })
    }

    /// With those so many rows later.
    pub fn at(&self, apart: usize) -> f64 {
        let product =
            |part: &Vec<f64>| part.iter().zip(part.iter().skip(apart)).map(|(a, b)| a * b).sum::<f64>();
        self.differences.iter().map(product).sum::<f64>() / self.power
    }

    /// Number of differences.
    pub fn count(&self) -> usize {
        self.differences.iter().map(Vec::len).sum()
    }
}

/// Standard deviation of a column's noise, with what the motion adds to it where rows are far apart.
pub(super) fn noise(values: &[f64], spans: &[Range<usize>]) -> Option<f64> {
    Correlation::of(values, spans).map(|it| it.usual / OF_WHITE)
}

/// Standard deviation of a column's noise, if its differences are those of white noise.
pub(super) fn own_noise(values: &[f64], spans: &[Range<usize>]) -> Option<f64> {
    let correlation = Correlation::of(values, spans)?;
    ((correlation.at(1) - WHITE).abs() < NEARLY).then_some(correlation.usual / OF_WHITE)
}
