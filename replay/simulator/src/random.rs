//! Counter-based random numbers: each effect has its own counter for each source and step.
//!
//! A new effect or sensor therefore leaves the random numbers of all other effects unchanged.
//!
//! Source: Salmon et al., "Parallel Random Numbers: As Easy as 1, 2, 3", SC 2011 (Philox4x32-10); Wichura, "Algorithm
//! AS 241", Applied Statistics 37, 1988 (normal quantiles).

use headrace_geometry::math;
use sha2::{Digest as _, Sha256};

const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: usize = 10;

/// Stream of random numbers of one effect for one source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream {
    key: [u32; 2],
}

/// A block of two random numbers for one step of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Draw {
    words: [u32; 4],
}

impl Stream {
    /// Returns the stream of the effect and the source with these names.
    pub fn new(seed: u64, effect: &str, source: &str) -> Self {
        let mut hash = Sha256::new();
        hash.update(seed.to_le_bytes());
        for name in [effect, source] {
            hash.update((name.len() as u64).to_le_bytes());
            hash.update(name.as_bytes());
        }
        let digest = hash.finalize();
        let word = |at: usize| {
            let bytes = digest.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
            u32::from_le_bytes(bytes.unwrap_or_default())
        };
        Self { key: [word(0), word(4)] }
    }

    /// First block of random numbers for `step`.
    pub fn at(self, step: u64) -> Draw {
        self.block(step, 0)
    }

    /// Block number `block` of random numbers for `step`. A block has two numbers, so an effect that draws more per
    /// step needs several blocks.
    pub fn block(self, step: u64, block: u64) -> Draw {
        let half = |value: u64| [(value & 0xFFFF_FFFF) as u32, (value >> 32) as u32];
        let ([a, b], [c, d]) = (half(step), half(block));
        Draw { words: philox([a, b, c, d], self.key) }
    }
}

impl Draw {
    /// Two random numbers that are uniformly distributed between 0 and 1, in steps of 2^-53. Neither 0 nor 1 occurs.
    pub fn uniform(&self) -> [f64; 2] {
        let [a, b, c, d] = self.words;
        let number = |high: u32, low: u32| {
            let bits = (u64::from(high) << 21) | (u64::from(low) >> 11);
            (bits as f64 + 0.5) * (1.0 / 9_007_199_254_740_992.0)
        };
        [number(a, b), number(c, d)]
    }

    /// Two random numbers from the standard normal distribution.
    pub fn normal(&self) -> [f64; 2] {
        self.uniform().map(normal_quantile)
    }
}

fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..ROUNDS {
        let product = |multiplier: u32, word: u32| {
            let product = u64::from(multiplier) * u64::from(word);
            ((product >> 32) as u32, (product & 0xFFFF_FFFF) as u32)
        };
        let (high_a, low_a) = product(MULTIPLIERS[0], counter[0]);
        let (high_b, low_b) = product(MULTIPLIERS[1], counter[2]);
        counter = [high_b ^ counter[1] ^ key[0], low_b, high_a ^ counter[3] ^ key[1], low_a];
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    counter
}

/// Quantile of the standard normal distribution for probability `p`, 0 < p < 1. The relative error is 1e-15.
pub(crate) fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        return q * ratio(r, &CENTRE);
    }
    let tail = if q < 0.0 { p } else { 1.0 - p };
    let r = math::sqrt(-math::ln(tail));
    let size = if r <= 5.0 { ratio(r - 1.6, &TAIL) } else { ratio(r - 5.0, &FAR_TAIL) };
    if q < 0.0 { -size } else { size }
}

type Rational = [[f64; 8]; 2];

/// Quotient of two polynomials. Coefficients start with the highest power.
fn ratio(r: f64, [above, below]: &Rational) -> f64 {
    let polynomial = |coefficients: &[f64; 8]| coefficients.iter().fold(0.0, |sum, c| sum * r + c);
    polynomial(above) / polynomial(below)
}

const CENTRE: Rational = [
    [
        2_509.080_928_730_122_7,
        33_430.575_583_588_13,
        67_265.770_927_008_7,
        45_921.953_931_549_87,
        13_731.693_765_509_46,
        1_971.590_950_306_551_4,
        133.141_667_891_784_38,
        3.387_132_872_796_366_6,
    ],
    [
        5_226.495_278_852_545,
        28_729.085_735_721_943,
        39_307.895_800_092_71,
        21_213.794_301_586_597,
        5_394.196_021_424_751,
        687.187_007_492_057_9,
        42.313_330_701_600_91,
        1.0,
    ],
];

const TAIL: Rational = [
    [
        7.745_450_142_783_414e-4,
        0.022_723_844_989_269_184,
        0.241_780_725_177_450_6,
        1.270_458_252_452_368_4,
        3.647_848_324_763_204_5,
        5.769_497_221_460_691,
        4.630_337_846_156_546,
        1.423_437_110_749_683_5,
    ],
    [
        1.050_750_071_644_416_9e-9,
        5.475_938_084_995_345e-4,
        0.015_198_666_563_616_457,
        0.148_103_976_427_480_08,
        0.689_767_334_985_1,
        1.676_384_830_183_803_8,
        2.053_191_626_637_759,
        1.0,
    ],
];

const FAR_TAIL: Rational = [
    [
        2.010_334_399_292_288e-7,
        2.711_555_568_743_487_6e-5,
        0.001_242_660_947_388_078_4,
        0.026_532_189_526_576_124,
        0.296_560_571_828_504_87,
        1.784_826_539_917_291_3,
        5.463_784_911_164_114,
        6.657_904_643_501_104,
    ],
    [
        2.044_263_103_389_939_8e-15,
        1.421_511_758_316_446e-7,
        1.846_318_317_510_054_8e-5,
        7.868_691_311_456_133e-4,
        0.014_875_361_290_850_615,
        0.136_929_880_922_735_8,
        0.599_832_206_555_888,
        1.0,
    ],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with known answers from the authors of the generator (Random123, kat_vectors).
    #[test]
    fn philox_gives_the_known_answers() {
        let all = u32::MAX;
        for (counter, key, answer) in [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            ([all; 4], [all; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ] {
            assert_eq!(philox(counter, key), answer);
        }
    }

    /// The expected values have 16 digits and were computed with mpmath at 50 digits.
    #[test]
    fn normal_quantiles_are_accurate_in_the_middle_and_tails() {
        for (p, x) in [
            (0.5, 0.0),
            (0.6, 0.253_347_103_135_799_8),
            (0.975, 1.959_963_984_540_054),
            (0.9999, 3.719_016_485_455_709),
            (1e-10, -6.361_340_902_404_056),
            (1e-14, -7.650_628_092_935_266),
        ] {
            assert!((normal_quantile(p) - x).abs() <= 4e-15 * x.abs(), "{p}: {}", normal_quantile(p));
            if p > 1e-6 {
                assert!((normal_quantile(1.0 - p) + x).abs() <= 1e-11, "{p}");
            }
        }
    }

    #[test]
    fn random_numbers_follow_their_distribution() {
        let stream = Stream::new(7, "some_effect", "head");
        let count = 100_000_u64;
        let (mut sum, mut squares, mut fourth, mut below) = (0.0, 0.0, 0.0, 0_u64);
        for step in 0..count {
            for x in stream.at(step).normal() {
                (sum, squares, fourth) = (sum + x, squares + x * x, fourth + x * x * x * x);
            }
            below += stream.at(step).uniform().iter().filter(|u| **u < 0.3).count() as u64;
        }
        let n = 2.0 * count as f64;
        // Each tolerance is five standard deviations of the estimate.
        assert!((sum / n).abs() < 5.0 / math::sqrt(n));
        assert!((squares / n - 1.0).abs() < 5.0 * math::sqrt(2.0 / n));
        assert!((fourth / n - 3.0).abs() < 5.0 * math::sqrt(96.0 / n));
        assert!((below as f64 / n - 0.3).abs() < 5.0 * math::sqrt(0.21 / n));
    }

    #[test]
    fn random_numbers_differ_by_seed_effect_source_step_and_block() {
        let here = Stream::new(1, "a", "b").at(5);
        let others = [
            Stream::new(2, "a", "b").at(5),
            Stream::new(1, "c", "b").at(5),
            Stream::new(1, "a", "c").at(5),
            Stream::new(1, "ab", "").at(5),
            Stream::new(1, "a", "b").at(6),
            Stream::new(1, "a", "b").block(5, 1),
        ];
        assert!(others.iter().all(|other| *other != here));
        assert_eq!(here, Stream::new(1, "a", "b").at(5));
    }
}
