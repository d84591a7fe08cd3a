//! Accuracy of a file's coordinates, by how they are written.
//!
//! A digit behind the point says to what the coordinates were rounded, and their greatest common divisor says it where it
//! is a coarser step. Whether coarse steps are rounding, or a grid to draw on, the points tell (`noise.rs`).

/// Accuracy of a file's coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Accuracy {
    /// Exactly, as far as we know.
    Exact,
    /// Written to a digit, in m; none where it is so coarse that the road may have been drawn by hand. All coordinates are
    /// multiples of a step, in m, that may be coarser.
    Rounded { digit: Option<f64>, step: f64 },
    /// Measured, to this RMS distance in m.
    Measured(f64),
}

impl Accuracy {
    /// The step of coordinates in m, where it is coarser than a digit that is known for an accuracy.
    pub fn coarse_step(self) -> Option<f64> {
        match self {
            Self::Rounded { digit, step } if digit.is_none_or(|digit| step > 1.5 * digit) => Some(step),
            _ => None,
        }
    }
}

/// RMS distance in m from the centre lines of racetrack-database. Its arcs begin and end without a transition, and
/// through every point the curvature would overshoot there by a fifth.
pub(super) const RACETRACK_DATABASE: f64 = 0.02;

/// Digits and steps that coordinates are written with.
#[derive(Default)]
pub(super) struct Decimals {
    most: u32,
    exponents: bool,
    /// First x and y in units of the last digit; the greatest common divisor of all distances from them.
    first: [Option<i128>; 2],
    divisor: i128,
}

/// Most decimals that are looked at: a double has no more.
const DECIMALS: u32 = 15;

impl Decimals {
    /// Looks at a coordinate's text: of `x` (0) or `y` (1).
    pub fn look(&mut self, text: &str, axis: usize) {
        self.exponents |= text.contains(['e', 'E']);
        let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
        self.most = self.most.max(fraction.len().min(DECIMALS as usize) as u32);
        if self.exponents || fraction.len() > DECIMALS as usize || whole.len() > DECIMALS as usize {
            self.exponents = true;
            return;
        }
        let digits = format!("{whole}{fraction:0<width$}", width = DECIMALS as usize);
        let Ok(units) = digits.parse::<i128>() else { return };
        let first = *self.first[axis].get_or_insert(units);
        self.divisor = greatest_common_divisor(self.divisor, (units - first).abs());
    }

    /// The accuracy of coordinates in a unit of so many m. Whole metres and decimetres may have been drawn by hand.
    pub fn accuracy(&self, unit: f64) -> Accuracy {
        if self.exponents || self.most >= DECIMALS {
            return Accuracy::Exact;
        }
        let digit = 0.1f64.powi(self.most as i32);
        let step = self.divisor as f64 * 0.1f64.powi(DECIMALS as i32);
        let digit = unit * digit;
        Accuracy::Rounded {
            digit: (self.most >= 2).then_some(digit),
            step: if self.divisor > 0 { unit * step } else { digit },
        }
    }
}

fn greatest_common_divisor(a: i128, b: i128) -> i128 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(xs: &[&str], ys: &[&str]) -> Accuracy {
        let mut decimals = Decimals::default();
        xs.iter().for_each(|text| decimals.look(text, 0));
        ys.iter().for_each(|text| decimals.look(text, 1));
        decimals.accuracy(1.0)
    }

    #[test]
    fn the_step_is_the_greatest_common_divisor() {
        for (xs, ys, digit, step) in [
            (["0.1", "0.35", "-7"], ["0", "1", "2"], Some(0.01), 0.05),
            (["1000000.25", "1000001", "1000002.5"], ["-5.75", "0", "3"], Some(0.01), 0.25),
            (["0", "3", "-1"], ["7", "8", "9"], None, 1.0),
            (["0.5", "1.5", "2.5"], ["0.5", "0.5", "0.5"], None, 1.0),
            (["1.001", "1.002", "1.004"], ["0", "0", "0"], Some(0.001), 0.001),
            (["5", "5", "5"], ["5.0", "5", "5"], None, 0.1),
        ] {
            let Accuracy::Rounded { digit: found, step: of_step } = of(&xs, &ys) else { panic!("{xs:?}") };
            assert!((of_step - step).abs() < 1e-12, "{xs:?}: {of_step}");
            assert_eq!(found.is_some(), digit.is_some(), "{xs:?}");
            assert!(digit.is_none_or(|digit| (found.unwrap_or(0.0) - digit).abs() < 1e-12), "{xs:?}");
        }
        assert_eq!(of(&["1e3", "2"], &["0", "1"]), Accuracy::Exact);
        assert_eq!(of(&["0.3333333333333333", "2"], &["0", "1"]), Accuracy::Exact);
    }
}
