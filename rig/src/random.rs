//! The one generator whose sequences are part of results: kept photon walks, blinks of a face, skin colours.
//!
//! Not taken from a crate: stored results and goldens depend on these very numbers, and no crate promises its sequence
//! across versions.

/// Counter through a finaliser (SplitMix64; Steele, Lea and Flood 2014).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplitMix64(pub u64);

impl SplitMix64 {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mixed(self.0)
    }

    /// Uniform in [0, 1), a multiple of 2^-53.
    pub fn uniform(&mut self) -> f64 {
        unit(self.bits())
    }

    /// A whole number below `end`, nearly uniform where `end` is far below 2^64; 0 where `end` is 0.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end.max(1) as u64) as usize
    }
}

/// The finaliser of [`SplitMix64`]: a bijection of 64 bits that looks random, for numbers by index.
pub fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// 64 bits as a number in [0, 1), a multiple of 2^-53.
pub fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        // First outputs of the reference implementation (S. Vigna, splitmix64.c) for the seed 1234567.
        let mut random = SplitMix64(1_234_567);
        let found: [u64; 3] = std::array::from_fn(|_| random.bits());
        assert_eq!(found, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn whole_numbers_fill_their_range() {
        let mut random = SplitMix64(3);
        let mut counts = [0; 7];
        (0..7000).for_each(|_| counts[random.below(7)] += 1);
        assert!(counts.iter().all(|n| (850..1150).contains(n)), "{counts:?}");
        assert_eq!(random.below(0), 0);
    }

    #[test]
    fn units_fill_the_interval() {
        let mut random = SplitMix64(3);
        let values: Vec<f64> = (0..10_000).map(|_| random.uniform()).collect();
        let mean = values.iter().sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.01 && values.iter().all(|v| (0.0..1.0).contains(v)), "{mean}");
        assert!(unit(u64::MAX) < 1.0 && unit(0) == 0.0);
    }
}
