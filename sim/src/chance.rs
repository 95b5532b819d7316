//! Chance. Every random number of the simulated rig comes from the seed, the name of the effect
//! that asks and a key: so one effect's numbers do not depend on which others there are, nor a
//! reading's noise on what was measured before it.

use rand_core::Rng;
use rand_pcg::Pcg64;

/// The numbers of one effect for one key.
#[derive(Debug, Clone)]
pub(crate) struct Stream {
    generator: Pcg64,
    /// The second number of the pair that Box and Muller's method makes.
    spare: Option<f64>,
}

impl Stream {
    pub(crate) fn new(seed: u64, effect: &str, key: u64) -> Self {
        let name = hash(effect);
        let half = |salt: u64| {
            let mixed = mix(seed.wrapping_add(salt));
            u128::from(mix(mix(mixed ^ name) ^ key))
        };
        let (state, stream) = (half(1) << 64 | half(2), half(3) << 64 | half(4));
        Self { generator: Pcg64::new(state, stream), spare: None }
    }

    /// Uniform in [0, 1), all 53 bits.
    pub(crate) fn uniform(&mut self) -> f64 {
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.generator.next_u64() >> 11) as f64 * STEP
    }

    /// Standard normal (Box, Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        // 1 - u is never 0, and its logarithm never positive.
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        let (sin, cos) = libm::sincos(core::f64::consts::TAU * self.uniform());
        self.spare = Some(radius * sin);
        radius * cos
    }
}

/// One standard normal number for something that is drawn once.
pub(crate) fn draw(seed: u64, effect: &str, key: u64) -> f64 {
    Stream::new(seed, effect, key).normal()
}

/// FNV-1a (Fowler, Noll, Vo 1991), 64 bits.
fn hash(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// `SplitMix64`'s finaliser (Steele, Lea, Flood 2014): every bit of the input reaches every bit
/// of the output.
pub(crate) fn mix(z: u64) -> u64 {
    let z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_effect_and_key_give_the_same_numbers_and_others_others() {
        let first = |seed, effect, key| Stream::new(seed, effect, key).uniform().to_bits();
        assert_eq!(first(1, "shot", 7), first(1, "shot", 7));
        let all =
            [first(1, "shot", 7), first(2, "shot", 7), first(1, "read", 7), first(1, "shot", 8)];
        for (i, one) in all.iter().enumerate() {
            assert!(all.iter().skip(i + 1).all(|other| other != one));
        }
    }

    #[test]
    fn normal_numbers_have_their_moments() {
        // A million numbers: standard errors are 1e-3 of the mean, 1.4e-3 of the variance and
        // 5e-3 of the fourth moment's 3 (its own deviation is sqrt(96)/1000 = 0.0098).
        const N: u32 = 1_000_000;
        let mut stream = Stream::new(5, "test", 0);
        let (mut sum, mut squares, mut fourth) = (0.0, 0.0, 0.0);
        for _ in 0..N {
            let z = stream.normal();
            sum += z;
            squares += z * z;
            fourth += z * z * z * z;
        }
        let n = f64::from(N);
        assert!(libm::fabs(sum / n) < 4e-3, "mean {}", sum / n);
        assert!(libm::fabs(squares / n - 1.0) < 6e-3, "variance {}", squares / n);
        assert!(libm::fabs(fourth / n - 3.0) < 0.04, "fourth moment {}", fourth / n);
    }

    #[test]
    fn draws_of_neighbouring_seeds_and_keys_are_independent() {
        // The correlation of 10 000 pairs has a standard error of 0.01.
        let correlate = |pair: &dyn Fn(u64) -> (f64, f64)| {
            (0..10_000).map(pair).map(|(a, b)| a * b).sum::<f64>() / 10_000.0
        };
        let by_seed = correlate(&|i| (draw(i, "zero", 0), draw(i + 1, "zero", 0)));
        let by_key = correlate(&|i| (draw(1, "zero", i), draw(1, "zero", i + 1)));
        let by_name = correlate(&|i| (draw(1, "a", i), draw(1, "b", i)));
        for correlation in [by_seed, by_key, by_name] {
            assert!(libm::fabs(correlation) < 0.045, "{correlation}");
        }
    }
}
