//! Several numbers in one: four wheels, or four columns of a matrix, are computed as one.
//!
//! Formulas are written once, for any [`Lanes`]: a plain `f64`, or four of them. On a processor with AVX2, four are one
//! register; elsewhere they are an array, as the compiler translates it. Each operation is the one that IEEE 754
//! rounds, and none is fused with another, so that all give the same bits.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Count of numbers that a processor with AVX2 takes at once.
pub(crate) const FOUR: usize = 4;

/// Numbers that are computed alike.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The numbers in memory.
    type Stored: Copy;
    /// Yes or no for each.
    type Mask: Copy;

    fn load(stored: &Self::Stored) -> Self;
    fn store(self) -> Self::Stored;
    /// The same number in all lanes.
    fn splat(x: f64) -> Self;
    /// One by one, for rare functions.
    fn each(self, of: impl Fn(f64) -> f64) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn copysign(self, sign: Self) -> Self;
    /// Negative where the lowest bit of `integer` is set.
    fn negated_if_odd(self, integer: Self) -> Self;
    /// `self < other`.
    fn below(self, other: Self) -> Self::Mask;
    /// `self <= other`.
    fn up_to(self, other: Self) -> Self::Mask;
    /// `self == other`.
    fn equals(self, other: Self) -> Self::Mask;
    fn all(mask: Self::Mask) -> bool;
    fn any(mask: Self::Mask) -> bool;
    fn choose(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// The smaller one; the other one if they are equal or not numbers.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::choose(self.below(other), self, other)
    }

    /// The greater one; the other one if they are equal or not numbers.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::choose(other.below(self), self, other)
    }

    /// Not a number stays it.
    #[inline(always)]
    fn clamp(self, least: Self, greatest: Self) -> Self {
        greatest.min(least.max(self))
    }

    /// 1 above zero, -1 below, else 0.
    #[inline(always)]
    fn sign(self) -> Self {
        let zero = Self::splat(0.0);
        let negative = Self::choose(self.below(zero), Self::splat(-1.0), zero);
        Self::choose(zero.below(self), Self::splat(1.0), negative)
    }

    /// True if all are zero.
    #[inline(always)]
    fn is_zero(self) -> bool {
        Self::all(self.equals(Self::splat(0.0)))
    }
}

impl Lanes for f64 {
    type Stored = f64;
    type Mask = bool;

    #[inline(always)]
    fn load(stored: &f64) -> f64 {
        *stored
    }

    #[inline(always)]
    fn store(self) -> f64 {
        self
    }

    #[inline(always)]
    fn splat(x: f64) -> f64 {
        x
    }

    #[inline(always)]
    fn each(self, of: impl Fn(f64) -> f64) -> f64 {
        of(self)
    }

    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }

    #[inline(always)]
    fn copysign(self, sign: f64) -> f64 {
        f64::copysign(self, sign)
    }

    #[inline(always)]
    fn negated_if_odd(self, integer: f64) -> f64 {
        f64::from_bits(self.to_bits() ^ (integer.to_bits() << 63))
    }

    #[inline(always)]
    fn below(self, other: f64) -> bool {
        self < other
    }

    #[inline(always)]
    fn up_to(self, other: f64) -> bool {
        self <= other
    }

    #[inline(always)]
    fn equals(self, other: f64) -> bool {
        self == other
    }

    #[inline(always)]
    fn all(mask: bool) -> bool {
        mask
    }

    #[inline(always)]
    fn any(mask: bool) -> bool {
        mask
    }

    #[inline(always)]
    fn choose(mask: bool, yes: f64, no: f64) -> f64 {
        if mask { yes } else { no }
    }
}

/// Four numbers for any processor.
#[derive(Clone, Copy)]
pub(crate) struct Portable([f64; FOUR]);

impl Portable {
    #[inline(always)]
    fn with(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([of(a, e), of(b, f), of(c, g), of(d, h)])
    }

    #[inline(always)]
    fn compare(self, other: Self, of: impl Fn(f64, f64) -> bool) -> [bool; FOUR] {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        [of(a, e), of(b, f), of(c, g), of(d, h)]
    }
}

impl Lanes for Portable {
    type Stored = [f64; FOUR];
    type Mask = [bool; FOUR];

    #[inline(always)]
    fn load(stored: &[f64; FOUR]) -> Self {
        Self(*stored)
    }

    #[inline(always)]
    fn store(self) -> [f64; FOUR] {
        self.0
    }

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; FOUR])
    }

    #[inline(always)]
    fn each(self, of: impl Fn(f64) -> f64) -> Self {
        let [a, b, c, d] = self.0;
        Self([of(a), of(b), of(c), of(d)])
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.each(f64::sqrt)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.each(f64::abs)
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.with(sign, f64::copysign)
    }

    #[inline(always)]
    fn negated_if_odd(self, integer: Self) -> Self {
        self.with(integer, Lanes::negated_if_odd)
    }

    #[inline(always)]
    fn below(self, other: Self) -> [bool; FOUR] {
        self.compare(other, |a, b| a < b)
    }

    #[inline(always)]
    fn up_to(self, other: Self) -> [bool; FOUR] {
        self.compare(other, |a, b| a <= b)
    }

    #[inline(always)]
    fn equals(self, other: Self) -> [bool; FOUR] {
        self.compare(other, |a, b| a == b)
    }

    #[inline(always)]
    fn all(mask: [bool; FOUR]) -> bool {
        mask == [true; FOUR]
    }

    #[inline(always)]
    fn any(mask: [bool; FOUR]) -> bool {
        mask != [false; FOUR]
    }

    #[inline(always)]
    fn choose(mask: [bool; FOUR], yes: Self, no: Self) -> Self {
        let pick = |i: usize| if mask[i] { yes.0[i] } else { no.0[i] };
        Self([pick(0), pick(1), pick(2), pick(3)])
    }
}

macro_rules! operators {
    ($lanes:ty: $($trait:ident $name:ident |$a:ident, $b:ident| $made:expr;)* -$c:ident = $negative:expr) => {
        $(impl $trait for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                let ($a, $b) = (self, other);
                $made
            }
        })*

        impl Neg for $lanes {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                let $c = self;
                $negative
            }
        }
    };
}

operators! {
    Portable:
    Add add |a, b| a.with(b, |a, b| a + b);
    Sub sub |a, b| a.with(b, |a, b| a - b);
    Mul mul |a, b| a.with(b, |a, b| a * b);
    Div div |a, b| a.with(b, |a, b| a / b);
    -a = a.each(|a| -a)
}

/// A computation on four lanes.
pub(crate) trait Work {
    /// Result.
    type Given;
    /// Always to be inlined: only then it consists of the processor's own instructions.
    fn with<L: Lanes<Stored = [f64; FOUR]>>(self) -> Self::Given;
}

/// Does it with the widest registers that there are.
#[inline]
pub(crate) fn compute<W: Work>(work: W) -> W::Given {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { avx2::compute(work) };
    }
    work.with::<Portable>()
}

/// Does it as any processor can.
#[cfg(test)]
pub(crate) fn compute_portably<W: Work>(work: W) -> W::Given {
    work.with::<Portable>()
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{FOUR, Lanes, Work};
    use std::arch::x86_64::*;
    use std::ops::{Add, Div, Mul, Neg, Sub};

    /// Four numbers in a register. Made and used within [`compute`] alone: the name is not known outside.
    #[derive(Clone, Copy)]
    struct Register(__m256d);

    #[target_feature(enable = "avx2")]
    pub fn compute<W: Work>(work: W) -> W::Given {
        work.with::<Register>()
    }

    /// An instruction; where there is a register, there is AVX2.
    macro_rules! with_avx2 {
        ($($instruction:tt)*) => {
            // SAFETY: within `compute` the processor has AVX2, and pointers are to four numbers.
            unsafe { $($instruction)* }
        };
    }

    operators! {
        Register:
        Add add |a, b| with_avx2!(Self(_mm256_add_pd(a.0, b.0)));
        Sub sub |a, b| with_avx2!(Self(_mm256_sub_pd(a.0, b.0)));
        Mul mul |a, b| with_avx2!(Self(_mm256_mul_pd(a.0, b.0)));
        Div div |a, b| with_avx2!(Self(_mm256_div_pd(a.0, b.0)));
        -a = with_avx2!(Self(_mm256_xor_pd(a.0, _mm256_set1_pd(-0.0))))
    }

    impl Lanes for Register {
        type Stored = [f64; FOUR];
        type Mask = __m256d;

        #[inline(always)]
        fn load(stored: &[f64; FOUR]) -> Self {
            with_avx2!(Self(_mm256_loadu_pd(stored.as_ptr())))
        }

        #[inline(always)]
        fn store(self) -> [f64; FOUR] {
            let mut stored = [0.0; FOUR];
            with_avx2!(_mm256_storeu_pd(stored.as_mut_ptr(), self.0));
            stored
        }

        #[inline(always)]
        fn splat(x: f64) -> Self {
            with_avx2!(Self(_mm256_set1_pd(x)))
        }

        #[inline(always)]
        fn each(self, of: impl Fn(f64) -> f64) -> Self {
            Self::load(&self.store().map(of))
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            with_avx2!(Self(_mm256_sqrt_pd(self.0)))
        }

        #[inline(always)]
        fn abs(self) -> Self {
            with_avx2!(Self(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)))
        }

        #[inline(always)]
        fn copysign(self, sign: Self) -> Self {
            with_avx2!({
                let bit = _mm256_set1_pd(-0.0);
                Self(_mm256_or_pd(_mm256_andnot_pd(bit, self.0), _mm256_and_pd(bit, sign.0)))
            })
        }

        #[inline(always)]
        fn negated_if_odd(self, integer: Self) -> Self {
            with_avx2!({
                let sign = _mm256_slli_epi64::<63>(_mm256_castpd_si256(integer.0));
                Self(_mm256_xor_pd(self.0, _mm256_castsi256_pd(sign)))
            })
        }

        #[inline(always)]
        fn below(self, other: Self) -> __m256d {
            with_avx2!(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0))
        }

        #[inline(always)]
        fn up_to(self, other: Self) -> __m256d {
            with_avx2!(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0))
        }

        #[inline(always)]
        fn equals(self, other: Self) -> __m256d {
            with_avx2!(_mm256_cmp_pd::<_CMP_EQ_OQ>(self.0, other.0))
        }

        #[inline(always)]
        fn all(mask: __m256d) -> bool {
            with_avx2!(_mm256_movemask_pd(mask) == 0b1111)
        }

        #[inline(always)]
        fn any(mask: __m256d) -> bool {
            with_avx2!(_mm256_movemask_pd(mask) != 0)
        }

        #[inline(always)]
        fn choose(mask: __m256d, yes: Self, no: Self) -> Self {
            with_avx2!(Self(_mm256_blendv_pd(no.0, yes.0, mask)))
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            with_avx2!(Self(_mm256_min_pd(self.0, other.0)))
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            with_avx2!(Self(_mm256_max_pd(self.0, other.0)))
        }
    }
}
