//! Fading of a learned model: its share in the prediction, by comparison with the model without it.
//!
//! At each step both predict the next state. The mean squares `J` of the errors of the last second are kept in each
//! component `c` of the state. Their floor is the sensors' variance, below which nothing can be seen. The relative
//! likelihood of the learned model against the nominal, each with its own unknown variance, is
//!
//! ```text
//! L = prod_c (J_nominal,c / J_learned,c)^(n/2)          share = min(1, 20 L)
//! ```
//!
//! with `n` the number of steps in that second. The learned model is used in full until the nominal one is twenty times
//! as likely, the usual level of significance. Beyond that it fades in proportion. At rest both are right and nothing
//! changes. A faded model is still evaluated, and returns when it is better again.
//!
//! It begins at nothing: at speed a few steps with a wrong model are too many. Without evidence for or against it the
//! share rises within a second; once the model is twenty times as likely as the nominal, at once.
//!
//! Source: Burnham and Anderson, Model Selection and Multimodel Inference, 2002, ch. 2 (relative likelihood); Bar-Shalom,
//! Li and Kirubarajan 2001, ch. 11 (multiple models by their one-step errors).

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// Time over which errors are averaged, s.
const MEMORY: f64 = 1.0;
/// Likelihood ratio, nominal over learned, from which on the learned model fades.
const SIGNIFICANT: f64 = 20.0;
/// Time in which the share follows its target, s: it changes smoothly.
const SMOOTHING: f64 = 0.1;
/// Time in which it rises without evidence, s.
const UNKNOWN: f64 = 0.5;
/// Least share: practically nothing, and still enough to compute the model's prediction.
pub const LEAST_SHARE: f64 = 1e-3;
/// A model that is to be used to a smaller share is reported as faded.
const FADED: f64 = 0.5;

/// The score of a learned model. For a controller without one it stays as it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fading<const S: usize> {
    /// The next state as predicted by the nominal and by the learned model, if both did.
    expected: Option<[SVector<f64, S>; 2]>,
    /// Sums of the squared errors of both, and of the floor, each step counting less than the one after it.
    squares: [SVector<f64, S>; 3],
    /// Steps that the sums are of.
    count: f64,
    share: f64,
    /// Target of the share.
    target: f64,
}

impl<const S: usize> Default for Fading<S> {
    fn default() -> Self {
        Self { expected: None, squares: [SVector::zeros(); 3], count: 0.0, share: LEAST_SHARE, target: 1.0 }
    }
}

impl<const S: usize> Fading<S> {
    /// Takes the state that was predicted, with the variance of its measurement.
    pub fn observe(&mut self, state: &SVector<f64, S>, variance: &SVector<f64, S>, elapsed: f64) {
        let Some(expected) = self.expected.take() else { return };
        let keep = (1.0 - elapsed / MEMORY).max(0.0);
        let squared = |error: SVector<f64, S>| error.component_mul(&error);
        let [nominal, learned] = expected.map(|expected| squared(state - expected));
        let all = nominal.iter().chain(learned.iter()).all(|square| square.is_finite());
        // A model that says no numbers is as wrong as can be.
        let newest =
            if all { [nominal, learned, *variance] } else { [SVector::zeros(), *variance * 1e6, *variance] };
        for (sum, newest) in self.squares.iter_mut().zip(newest) {
            *sum = *sum * keep + newest;
        }
        self.count = self.count * keep + 1.0;
        let [nominal, learned, floor] = &self.squares;
        let evidence: f64 = (0..S)
            .map(|c| ((nominal[c] + floor[c]) / (learned[c] + floor[c])).ln())
            .filter(|evidence| evidence.is_finite())
            .sum();
        let likely = (0.5 * self.count * evidence).exp();
        let target = (SIGNIFICANT * likely).clamp(LEAST_SHARE, 1.0);
        let known = likely >= SIGNIFICANT || target < self.share;
        let time = if known { SMOOTHING } else { UNKNOWN };
        let share = self.share + (target - self.share) * (elapsed / time).min(1.0);
        // What is used in full is used in full, to the bit.
        self.share = if target == 1.0 && share > 0.98 { 1.0 } else { share };
        self.target = target;
    }

    /// Keeps both models' predictions of the next state.
    pub fn expect(&mut self, expected: Option<[SVector<f64, S>; 2]>) {
        self.expected = expected;
    }

    /// Share of the learned model that is used, [`LEAST_SHARE`] to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// True if it predicts so much worse that a warning is due.
    #[must_use]
    pub fn faded(&self) -> bool {
        self.target < FADED
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector1;

    /// Share after two seconds of errors of both models that alternate in sign.
    fn share(nominal: f64, learned: f64) -> f64 {
        let mut fading = Fading::default();
        for k in 0..100 {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            fading.expect(Some([Vector1::new(sign * nominal), Vector1::new(sign * learned)]));
            fading.observe(&Vector1::zeros(), &Vector1::new(1e-4), 0.02);
        }
        fading.share()
    }

    #[test]
    fn what_is_as_good_or_better_is_used_in_full() {
        assert_eq!([share(0.03, 0.003), share(0.03, 0.03), share(0.0, 0.002)], [1.0; 3]);
    }

    #[test]
    fn what_is_worse_fades_and_comes_back() {
        assert!(share(0.01, 0.02) < 0.01);
        assert!(share(0.01, f64::NAN) < 0.01);
        let mut fading = Fading::default();
        for k in 0..300 {
            let learned = if k < 100 { 0.1 } else { 0.0 };
            fading.expect(Some([Vector1::new(0.02), Vector1::new(learned)]));
            fading.observe(&Vector1::zeros(), &Vector1::new(1e-4), 0.02);
            assert!(k != 25 || fading.faded());
        }
        assert_eq!(fading.share(), 1.0);
    }
}
