//! Mean change of a few pairs of figures, and its exact interval: the sign-flip test, inverted.
//!
//! ```text
//! d_i = ln(after_i / before_i),    change = exp(mean_i d_i) - 1
//! P(centre < k-th smallest of the 2^n - 1 means of a part of the d_i) = k / 2^n
//! ```
//!
//! Assumed: the `d_i` are independent, and each is symmetric about one centre. No distribution is assumed beyond that,
//! and no equal spread. The logarithm is taken since errors scale with road and plant. The test at zero is Fisher's.
//!
//! Source: Hartigan, Using subsample values as typical values, J. Am. Stat. Assoc. 64, 1969; Fisher, The Design of
//! Experiments, 1935, ch. 21.

use serde::Serialize;
use std::fmt;

/// Probability that the centre lies beyond one end of the interval, at most: the level of the one-sided test.
const BEYOND: f64 = 0.05;
/// Pairs at most: all their parts are looked at.
const MOST_PAIRS: usize = 16;

/// Change from one of two paired figures to the other, as a share of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairedChange {
    /// Geometric mean over the pairs, less 1.
    pub mean: f64,
    /// Interval in which the change lies by 90 %, 5 % on either side; without ends of fewer pairs than 5 or more than 16.
    pub interval: Option<[f64; 2]>,
}

impl PairedChange {
    /// Of pairs of a figure before and after.
    #[must_use]
    pub fn of(pairs: impl Iterator<Item = (f64, f64)>) -> Self {
        let ratios: Vec<f64> =
            pairs.map(|(before, after)| (after / before).ln()).filter(|ratio| ratio.is_finite()).collect();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        Self { mean: mean.exp_m1(), interval: interval(&ratios).map(|ends| ends.map(f64::exp_m1)) }
    }

    /// True if it is shown to be below zero.
    #[must_use]
    pub fn is_decrease(&self) -> bool {
        self.interval.is_some_and(|[_, high]| high < 0.0)
    }
}

impl fmt::Display for PairedChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.mean.is_nan() {
            return write!(f, "not known, for no drive went to its end with both");
        }
        write!(f, "{:+.1} %", 100.0 * self.mean)?;
        match self.interval {
            Some([low, high]) => write!(f, ", 90 % interval {:+.1} ... {:+.1} %", 100.0 * low, 100.0 * high),
            None => write!(f, ", too few drives for an interval"),
        }
    }
}

/// Interval of the centre of these differences.
fn interval(differences: &[f64]) -> Option<[f64; 2]> {
    if differences.len() > MOST_PAIRS {
        return None;
    }
    let parts = 1_usize << differences.len();
    let below = (BEYOND * parts as f64).floor() as usize;
    let mean = |part: usize| {
        let of = differences.iter().enumerate().filter(|(place, _)| part >> place & 1 == 1);
        of.map(|(_, difference)| difference).sum::<f64>() / f64::from(part.count_ones())
    };
    let mut means: Vec<f64> = (1..parts).map(mean).collect();
    means.sort_by(f64::total_cmp);
    let low = below.checked_sub(1)?;
    Some([means[low], means[means.len() - 1 - low]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Random;

    fn change(ratios: &[f64]) -> PairedChange {
        PairedChange::of(ratios.iter().map(|ratio| (2.0, 2.0 * ratio)))
    }

    #[test]
    fn a_decrease_is_shown_where_the_drives_agree() {
        let agreed = change(&[0.98, 0.97, 0.985, 0.975, 0.98, 0.97, 0.99, 0.98]);
        assert!(
            agreed.is_decrease() && agreed.to_string().starts_with("-2.1 %, 90 % interval -2."),
            "{agreed}"
        );
        // The same mean of drives that differ more.
        let scattered = change(&[0.8, 1.15, 0.9, 1.1, 0.85, 1.12, 0.95, 1.0]);
        assert!(scattered.mean < -0.01 && !scattered.is_decrease(), "{scattered}");
        // Fewer than five pairs may all be less by chance, oftener than one time in twenty.
        assert!(!change(&[0.5; 4]).is_decrease() && change(&[0.5; 5]).is_decrease());
        assert!(!change(&[]).is_decrease() && !change(&[0.5; 17]).is_decrease());
        // A pair without a ratio is none.
        assert!(!PairedChange::of([(0.0, 0.0); 9].into_iter()).is_decrease());
    }

    #[test]
    fn the_test_is_the_sign_flip_test() {
        let mut random = Random::new(11);
        for _ in 0..200 {
            let ratios: Vec<f64> = (0..8).map(|_| random.between(-1.0, 0.5)).collect();
            let total: f64 = ratios.iter().sum();
            let flipped = |signs: usize| -> f64 {
                let sign = |place: usize| if signs >> place & 1 == 1 { -1.0 } else { 1.0 };
                ratios.iter().enumerate().map(|(place, ratio)| sign(place) * ratio).sum()
            };
            let as_low = (0..256).filter(|&signs| flipped(signs) <= total).count();
            let shown = change(&ratios.iter().map(|ratio| ratio.exp()).collect::<Vec<_>>()).is_decrease();
            assert_eq!(shown, as_low as f64 <= BEYOND * 256.0);
        }
    }

    #[test]
    fn of_no_change_one_in_twenty_is_taken_for_a_decrease() {
        // Heavy tails, and spreads that differ from pair to pair.
        let mut random = Random::new(5);
        let tries = 4000;
        let shown = (0..tries)
            .filter(|_| {
                let ratios: Vec<f64> = (1..9)
                    .map(|place| (f64::from(place) * random.between(-0.2, 0.2).powi(3)).exp())
                    .collect();
                change(&ratios).is_decrease()
            })
            .count();
        let share = shown as f64 / f64::from(tries);
        // 12 of 256, give or take three standard deviations.
        assert!((share - 12.0 / 256.0).abs() < 0.01, "{share}");
    }
}
