//! Share of a decay that is over, `1 - e^-z`, by ratios of polynomials.

use crate::numerics::lanes::{FOUR, Lanes};

/// `1 - e^-z`: by Pade's approximation of sixth order for ordinary `z`, off by less than 2e-9 of `z`. A larger one in
/// four parts, off by less than 4e-9 of `z`.
pub(super) fn one_minus_exp_neg(z: f64) -> f64 {
    if (0.0..2.0).contains(&z) {
        return by_pade(z);
    }
    if (0.0..8.0).contains(&z) {
        let left = 1.0 - by_pade(0.25 * z);
        let left = left * left;
        return 1.0 - left * left;
    }
    -(-z).exp_m1()
}

/// The same of four numbers.
#[inline(always)]
pub(super) fn one_minus_exp_neg_of<L: Lanes<Stored = [f64; FOUR]>>(z: L) -> L {
    let ordinary = L::all(L::splat(0.0).up_to(z)) && L::all(z.below(L::splat(2.0)));
    if ordinary { by_pade(z) } else { z.each(one_minus_exp_neg) }
}

#[inline(always)]
fn by_pade<L: Lanes>(z: L) -> L {
    let number = L::splat;
    let zz = z * z;
    let odd = z * (number(0.5) + zz * (number(1.0 / 66.0) + zz / number(15_840.0)));
    let even = number(1.0) + zz * (number(5.0 / 44.0) + zz * (number(1.0 / 792.0) + zz / number(665_280.0)));
    number(2.0) * odd / (even + odd)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::lanes::Portable;

    #[test]
    fn what_is_over_is_that_of_the_exponential() {
        for i in 0..1000 {
            let z = 0.01 * f64::from(i);
            let most = if z < 2.0 { 2e-9 } else { 4e-9 };
            let over = one_minus_exp_neg(z);
            assert!((over + (-z).exp_m1()).abs() <= most * z, "{over} at {z}");
            for other in [0.3, 5.0] {
                let four = one_minus_exp_neg_of(Portable::load(&[z, other, z, other])).store();
                assert_eq!(four[2].to_bits(), over.to_bits());
            }
        }
        assert!(one_minus_exp_neg(f64::NAN).is_nan());
    }
}
