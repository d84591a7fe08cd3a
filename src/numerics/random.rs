//! A small random generator whose numbers are the same on every machine and in every version of this library.
//!
//! SplitMix64 (Steele, Lea, Flood 2014): the state grows by `0x9e3779b97f4a7c15` and each number is a mix of the
//! state,
//!
//! ```text
//! z ^= z >> 30; z *= 0xbf58476d1ce4e5b9; z ^= z >> 27; z *= 0x94d049bb133111eb; z ^= z >> 31
//! ```
//!
//! Each tree has a generator of its own, derived from the seed and the tree's number. Training gives the same bits in
//! any order of the trees, on any number of threads.

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The generator.
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
}

impl Random {
    /// A generator with this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// The generator of stream `stream` of `seed`: streams do not depend on one another.
    #[must_use]
    pub fn stream(seed: u64, stream: u64) -> Self {
        Self { state: mix(seed ^ mix(stream.wrapping_add(1).wrapping_mul(GOLDEN))) }
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mix(self.state)
    }

    /// Uniform in `0..bound`, without bias (Lemire 2019). `bound` must be positive.
    pub fn below(&mut self, bound: u32) -> u32 {
        let bound = u64::from(bound);
        // Of the 2^32 draws, the few that would make some results more likely than others are drawn again.
        let biased = (1 << 32) % bound;
        loop {
            let product = (self.bits() >> 32) * bound;
            if product & 0xffff_ffff >= biased {
                return (product >> 32) as u32;
            }
        }
    }

    /// `count` of the numbers below `all`, or all of them: each once, in random order.
    #[cfg(feature = "cli")]
    pub(crate) fn draw(&mut self, all: usize, count: usize) -> Vec<usize> {
        let mut numbers: Vec<usize> = (0..all).collect();
        let count = count.min(all);
        for i in 0..count {
            numbers.swap(i, i + self.below((all - i) as u32) as usize);
        }
        numbers.truncate(count);
        numbers
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform in `[0, 1)`.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Of the standard normal distribution (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_the_published_numbers() {
        // First outputs for seed 1234567, as in the test vectors of the algorithm's reference implementation.
        let mut random = Random::new(1_234_567);
        assert_eq!(random.bits(), 6_457_827_717_110_365_317);
        assert_eq!(random.bits(), 3_203_168_211_198_807_973);
        assert_eq!(random.bits(), 9_817_491_932_198_370_423);
    }

    #[test]
    fn below_is_uniform() {
        let mut random = Random::new(7);
        let mut count = [0_u32; 3];
        (0..30_000).for_each(|_| count[random.below(3) as usize] += 1);
        // Five standard deviations of a binomial with n = 30000, p = 1/3.
        assert!(count.iter().all(|&c| c.abs_diff(10_000) < 410), "{count:?}");
    }
}
