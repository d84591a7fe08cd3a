//! Arc tangent, sine and cosine of several numbers at once: most of the computation of a car's step.
//!
//! The functions of the system's library take one number at a time and differ in their last bits from processor to
//! processor. These use plain additions, multiplications and divisions without branches, for all numbers of
//! `Lanes` alike, and every processor gives the same bits.
//!
//! ```text
//!     atan x = c + atan t,       t = (x - tan c) / (1 + x tan c),   c in {0, pi/4, pi/2},    |t| <= tan(pi/8)
//!     sin x  = (-1)^n sin r,     r = x - n pi,                      n an integer,            |r| <= pi/2
//!     cos x  = (-1)^(k+1) sin r, r = x - n pi,                      n = k + 1/2
//! ```
//!
//! `atan t` and `sin r` are odd polynomials of degree 23 and 17 that interpolate `(f(t)/t - 1)/t^2` at Chebyshev nodes
//! in `t^2`. Their relative errors are 7e-18 and 4e-17. With rounding the relative error of `atan` and the absolute
//! error of `sin` and `cos` are below 5e-16 (`tests/vehicle_trigonometry.rs`).

use crate::numerics::lanes::Lanes;
use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4};

const TAN_PI_8: f64 = 0.414_213_562_373_095;
const TAN_3_PI_8: f64 = 2.414_213_562_373_095;
/// Rounding errors of `FRAC_PI_2` and `FRAC_PI_4`.
const REST_OF_PI_2: f64 = 6.123_233_995_736_766e-17;
const REST_OF_PI_4: f64 = 3.061_616_997_868_383e-17;
/// Pi in two parts; the first has 38 bits, so that its product with `n` is exact.
const PI_HIGH: f64 = 3.141_592_653_584_666_6;
const PI_LOW: f64 = 5.126_688_303_189_038e-12;
/// Argument beyond which `n` pi is not exact enough, and the library's functions are used.
const GREATEST: f64 = 1e4;
/// Adding 1.5 2^52 rounds to an integer, whose parity is then the last bit.
const ROUND: f64 = 6_755_399_441_055_744.0;

const ATAN: [f64; 11] = [
    -0.333_333_333_333_333_3,
    0.199_999_999_999_955_2,
    -0.142_857_142_846_665_42,
    0.111_111_110_152_563_59,
    -0.090_909_045_781_237_67,
    0.076_921_831_908_229_27,
    -0.066_645_114_473_374_43,
    0.058_581_489_124_155_936,
    -0.050_854_497_359_171_004,
    0.039_231_658_237_138_915,
    -0.019_176_887_047_482_12,
];

const SIN: [f64; 8] = [
    -0.166_666_666_666_666_66,
    0.008_333_333_333_333_316,
    -0.000_198_412_698_412_549_74,
    2.755_731_921_916_323_4e-6,
    -2.505_210_761_699_618e-8,
    1.605_897_731_246_383_6e-10,
    -7.643_970_296_790_515e-13,
    // 5e-21 more than the interpolation gives, so that the cosine of 0 is exactly 1.
    2.731_449_766_885_94e-15,
];

/// Arc tangent, rad.
#[inline(always)]
pub(super) fn atan_of<L: Lanes>(x: L) -> L {
    let number = L::splat;
    let (zero, one) = (number(0.0), number(1.0));
    let a = x.abs();
    let (below, middle) = (a.up_to(number(TAN_PI_8)), a.below(number(TAN_3_PI_8)));
    let above = L::choose(middle, a - one, number(-1.0));
    let under = L::choose(middle, a + one, a);
    let high = L::choose(middle, number(FRAC_PI_4), number(FRAC_PI_2));
    let low = L::choose(middle, number(REST_OF_PI_4), number(REST_OF_PI_2));
    let (above, under) = (L::choose(below, a, above), L::choose(below, one, under));
    let (high, low) = (L::choose(below, zero, high), L::choose(below, zero, low));
    let t = above / under;
    let z = t * t;
    let z2 = z * z;
    let z4 = z2 * z2;
    let pair = |i: usize| number(ATAN[i]) + number(ATAN[i + 1]) * z;
    let p =
        (pair(0) + pair(2) * z2) + ((pair(4) + pair(6) * z2) + (pair(8) + number(ATAN[10]) * z2) * z4) * z4;
    (high + (t + (t * (z * p) + low))).copysign(x)
}

/// Sine of `x` for `half` 0, the cosine's negative for 1/2; `|x| <= GREATEST`.
#[inline(always)]
fn turned<L: Lanes>(x: L, half: L) -> L {
    let number = L::splat;
    let shifted = (x * number(FRAC_1_PI) - half) + number(ROUND);
    let n = (shifted - number(ROUND)) + half;
    let r = (x - n * number(PI_HIGH)) - n * number(PI_LOW);
    let z = r * r;
    let z2 = z * z;
    let z4 = z2 * z2;
    let pair = |i: usize| number(SIN[i]) + number(SIN[i + 1]) * z;
    let p = (pair(0) + pair(2) * z2) + (pair(4) + pair(6) * z2) * z4;
    // The cosine has the opposite sign: the second half of the period comes first.
    (r + r * (z * p)).negated_if_odd(shifted)
}

/// The cosine; `|x| <= GREATEST`. Half turns may round either way: it is even to the bit.
#[inline(always)]
fn turned_cos<L: Lanes>(x: L) -> L {
    -turned(x.abs(), L::splat(0.5))
}

/// Sine of an angle in rad.
#[inline(always)]
pub(super) fn sin_of<L: Lanes>(x: L) -> L {
    if L::all(x.abs().up_to(L::splat(GREATEST))) { turned(x, L::splat(0.0)) } else { x.each(f64::sin) }
}

/// Cosine of an angle in rad.
#[inline(always)]
pub(super) fn cos_of<L: Lanes>(x: L) -> L {
    if L::all(x.abs().up_to(L::splat(GREATEST))) { turned_cos(x) } else { x.each(f64::cos) }
}

/// Arc tangent, rad. As the library's for zeros, infinities and NaN.
#[must_use]
pub fn atan(x: f64) -> f64 {
    atan_of(x)
}

/// Sine of an angle in rad.
#[must_use]
pub fn sin(x: f64) -> f64 {
    sin_of(x)
}

/// Cosine of an angle in rad.
#[must_use]
pub fn cos(x: f64) -> f64 {
    cos_of(x)
}
