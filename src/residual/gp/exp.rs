//! The exponential function in a form that compilers vectorise: plain arithmetic, no branch, no call, no table.
//!
//! ```text
//! x = n ln 2 + r, |r| <= ln 2 / 2;    e^x = 2^n e^r,    e^r: its Taylor series to the 13th power
//! ```
//!
//! Adding 1.5 2^52 rounds `x / ln 2` to an integer and leaves that integer in the low bits of the sum. From there it
//! goes into the exponent of a float. The same bits come out on every machine and with every number of lanes; the
//! library's `exp` gives neither.

/// `1.5 * 2^52`: doubles of this size are integers.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// High part of ln 2: its product with an integer below 2^11 is exact.
const LN2_HIGH: f64 = 0.693_147_180_369_123_8;
/// The rest of ln 2.
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// Least argument: below, the result would be no normal number; e^-700 is negligible.
const LOWEST: f64 = -700.0;

/// `1 / k!` for k = 2, 3, ..
const FACTORS: [f64; 12] = {
    let mut factors = [0.0; 12];
    let (mut k, mut factorial) = (2, 2.0);
    while k < 14 {
        factors[k - 2] = 1.0 / factorial;
        k += 1;
        factorial *= k as f64;
    }
    factors
};

/// `e^x` for `x` up to 0, to a few units in the last place; about 1e-304 below -700; NaN for NaN.
#[inline(always)]
pub(super) fn exp(x: f64) -> f64 {
    // In this order a NaN stays one.
    let x = if x < LOWEST { LOWEST } else { x };
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN2_HIGH) - n * LN2_LOW;
    // Estrin's scheme: short chains of dependent operations.
    let [c2, c3, c4, c5, c6, c7, c8, c9, c10, c11, c12, c13] = FACTORS;
    let r2 = r * r;
    let r4 = r2 * r2;
    let r8 = r4 * r4;
    let low = (1.0 + r) + r2 * (c2 + c3 * r);
    let middle = (c4 + c5 * r) + r2 * (c6 + c7 * r);
    let high = ((c8 + c9 * r) + r2 * (c10 + c11 * r)) + r4 * (c12 + c13 * r);
    let series = low + r4 * middle + r8 * high;
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    series * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_library() {
        let mut worst = 0.0_f64;
        for i in 0..=700_000 {
            let x = -1e-3 * f64::from(i);
            worst = worst.max((exp(x) / x.exp() - 1.0).abs());
        }
        assert!(worst < 1e-15, "{worst:e}");
        assert_eq!(exp(0.0), 1.0);
    }

    #[test]
    fn is_nothing_far_out_and_nan_for_nan() {
        for x in [-701.0, -1e9, -1e300, f64::NEG_INFINITY] {
            assert!((0.0..1e-300).contains(&exp(x)), "{x}");
        }
        assert!(exp(f64::NAN).is_nan());
    }
}
