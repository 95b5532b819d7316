//! Sums and products of doubles without loss: the pair (rounded result, its exact error), and the
//! double-double arithmetic that stands on it. It knows numbers only.
//!
//! Where a formula cancels, the digits are lost in the rounding of the terms before the difference
//! is taken. Keeping that rounding (Dekker 1971; Knuth, TAOCP 2, 4.2.2) costs a few operations and
//! no thought about conditioning. The fused multiply-add is correctly rounded with or without
//! hardware for it, so it costs speed at most, never bits.

#![expect(
    clippy::inline_always,
    reason = "code for a kind of processor is what was inlined into it"
)]

/// a + b as (rounded sum, exact rest). Knuth, any order of magnitudes.
#[inline(always)]
pub(crate) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_rounded = sum - a;
    (sum, (a - (sum - b_rounded)) + (b - b_rounded))
}

/// a · b as (rounded product, exact rest), barring underflow of the rest.
#[inline(always)]
pub(crate) fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    (product, a.mul_add(b, -product))
}

/// a·b - c·d within 1.5 ulp (Kahan; Jeannerod, Louvet and Muller 2013), barring underflow.
pub(crate) fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let product = c * d;
    let rest = (-c).mul_add(d, product);
    a.mul_add(b, -product) + rest
}

/// Times two to the power, as `libm::scalbn`: one multiplication where the power is a double itself.
pub(crate) fn scaled(value: f64, exponent: i32) -> f64 {
    const BIAS: i32 = 1023;
    match u64::try_from(exponent.saturating_add(BIAS)) {
        // Neither subnormal nor infinite: the product is rounded once, as it should be.
        Ok(biased @ 1..2047) => value * f64::from_bits(biased << 52),
        _ => libm::scalbn(value, exponent),
    }
}

/// An unevaluated sum of two doubles, about 32 digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DoubleDouble {
    high: f64,
    low: f64,
}

impl DoubleDouble {
    #[inline(always)]
    pub(crate) const fn from_f64(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }

    /// a + b without loss.
    pub(crate) fn sum(a: f64, b: f64) -> Self {
        Self::renormalised(a, b)
    }

    /// a - b without loss.
    pub(crate) fn difference(a: f64, b: f64) -> Self {
        Self::renormalised(a, -b)
    }

    /// Rounded to the nearest double.
    #[inline(always)]
    pub(crate) fn to_f64(self) -> f64 {
        self.high + self.low
    }

    #[inline(always)]
    pub(crate) fn add(self, other: Self) -> Self {
        let (high, rest) = two_sum(self.high, other.high);
        let (low, low_rest) = two_sum(self.low, other.low);
        let (high, rest) = two_sum(high, rest + low);
        Self::renormalised(high, rest + low_rest)
    }

    #[inline(always)]
    pub(crate) fn sub(self, other: Self) -> Self {
        self.add(other.neg())
    }

    #[inline(always)]
    pub(crate) fn mul(self, other: Self) -> Self {
        let (high, rest) = two_product(self.high, other.high);
        Self::renormalised(high, rest + self.high.mul_add(other.low, self.low * other.high))
    }

    /// By a double.
    #[inline(always)]
    pub(crate) fn times(self, factor: f64) -> Self {
        let (high, rest) = two_product(self.high, factor);
        Self::renormalised(high, self.low.mul_add(factor, rest))
    }

    /// a / b of two doubles.
    pub(crate) fn ratio(a: f64, b: f64) -> Self {
        Self::from_f64(a).div(Self::from_f64(b))
    }

    #[inline(always)]
    pub(crate) fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }

    pub(crate) fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self.sub(other.mul(Self::from_f64(first)));
        let second = rest.high / other.high;
        let rest = rest.sub(other.mul(Self::from_f64(second)));
        let (high, low) = two_sum(first, second);
        Self::renormalised(high, low + rest.high / other.high)
    }

    /// The square root of a number not below zero: one Newton step from the double's root.
    pub(crate) fn sqrt(self) -> Self {
        let root = self.high.sqrt();
        if root == 0.0 {
            return Self::from_f64(0.0);
        }
        let rest = self.sub(Self::from_f64(root).mul(Self::from_f64(root)));
        Self::renormalised(root, rest.to_f64() / (2.0 * root))
    }

    /// Times two to the power, exactly.
    pub(crate) fn scaled(self, exponent: i32) -> Self {
        Self { high: scaled(self.high, exponent), low: scaled(self.low, exponent) }
    }

    fn doubled(self) -> Self {
        Self { high: 2.0 * self.high, low: 2.0 * self.low }
    }

    fn halved(self) -> Self {
        Self { high: 0.5 * self.high, low: 0.5 * self.low }
    }

    #[inline(always)]
    fn renormalised(high: f64, low: f64) -> Self {
        let (high, low) = two_sum(high, low);
        Self { high, low }
    }
}

/// Several double-doubles side by side, their parts apart, as instructions on vectors take them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Abreast<const N: usize> {
    high: [f64; N],
    low: [f64; N],
}

impl<const N: usize> Abreast<N> {
    #[inline(always)]
    pub(crate) fn of(numbers: [DoubleDouble; N]) -> Self {
        Self { high: numbers.map(|number| number.high), low: numbers.map(|number| number.low) }
    }

    #[inline(always)]
    pub(crate) fn get(&self, i: usize) -> DoubleDouble {
        DoubleDouble { high: self.high[i], low: self.low[i] }
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, i: usize, number: DoubleDouble) {
        (self.high[i], self.low[i]) = (number.high, number.low);
    }
}

/// cos θ in double-double for θ in [0, π]: the Taylor series of the versine 1 - cos at θ/16, and
/// four doublings vers 2x = 2 sin² x = 2 vers x (2 - vers x), in which nothing
/// cancels before π.
pub(crate) fn cosine(theta: f64) -> DoubleDouble {
    const DOUBLINGS: i32 = 4;
    let x = DoubleDouble::from_f64(libm::scalbn(theta, -DOUBLINGS));
    let x_squared = x.mul(x);
    // Beyond x¹² a term is below 1e-18 of the series: doubles carry it to 1e-34.
    let tail = VERSINE_TAIL.iter().rev().fold(0.0, |sum, c| x_squared.high.mul_add(sum, *c));
    let mut series = DoubleDouble::from_f64(tail);
    for (high, low) in VERSINE.into_iter().rev() {
        series = DoubleDouble { high, low }.add(x_squared.mul(series));
    }
    let mut versine = x_squared.mul(series).halved();
    let two = DoubleDouble::from_f64(2.0);
    for _ in 0..DOUBLINGS {
        versine = versine.mul(two.sub(versine)).doubled();
    }
    DoubleDouble::from_f64(1.0).sub(versine)
}

/// vers x = x²/2 Σ cₖ x²ᵏ: (-1)ᵏ 2/(2k+2)! as sums of two doubles, the rest as doubles. With
/// x up to π/16, (π/16)²² 2/24! is below 1e-38.
const VERSINE: [(f64, f64); 7] = [
    (1.0, 0.0),
    (-0.083_333_333_333_333_33, -4.625_929_269_271_485e-18),
    (0.002_777_777_777_777_778, -1.060_108_790_874_715_4e-19),
    (-4.960_317_460_317_46e-5, -4.302_389_573_355_176_3e-23),
    (5.511_463_844_797_178e-7, 4.753_542_924_450_059_5e-23),
    (-4.175_351_397_573_62e-9, 2.414_690_118_226_52e-25),
    (2.294_149_119_545_946e-11, 4.131_102_550_566_149e-28),
];
const VERSINE_TAIL: [f64; 4] = [
    -9.558_954_664_774_77e-14,
    3.123_841_393_717_245e-16,
    -8.220_635_246_624_33e-19,
    1.779_358_278_490_115e-21,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "the claim is exactness")]
    fn sums_and_products_lose_nothing() {
        assert_eq!(two_sum(1e16, 1.0), (1e16, 1.0));
        let epsilon = f64::EPSILON;
        assert_eq!(
            two_product(1.0 + epsilon, 1.0 + epsilon),
            (1.0 + 2.0 * epsilon, epsilon * epsilon)
        );
        assert_eq!(
            difference_of_products(1.0 + epsilon, 1.0 + epsilon, 1.0 + 2.0 * epsilon, 1.0),
            epsilon * epsilon
        );
    }

    #[test]
    fn a_third_times_three_is_one_to_thirty_digits() {
        let three = DoubleDouble::from_f64(3.0);
        let one = DoubleDouble::from_f64(1.0);
        let defect = one.div(three).mul(three).sub(one).to_f64();
        assert!(defect.abs() < 1e-31, "{defect:e}");
    }

    #[test]
    fn the_cosine_next_to_a_right_angle_is_what_the_double_misses_of_it() {
        // cos of the double nearest π/2 is π/2's next digits.
        let found = cosine(core::f64::consts::FRAC_PI_2).to_f64();
        assert!((found - 6.123_233_995_736_766e-17).abs() < 1e-31, "{found:e}");
        for i in 0..200 {
            let theta = f64::from(i) * core::f64::consts::PI / 200.0;
            assert!((cosine(theta).to_f64() - libm::cos(theta)).abs() < 2e-16);
        }
    }

    #[test]
    fn powers_of_two_scale_as_the_library_does() {
        let values = [0.0, -1.0, 1.7e308, 5e-324, 2.3e-308, -1.000_000_000_000_000_2e-300, 3.0];
        for value in values {
            for exponent in (-2200..2200).step_by(7).chain([-1023, -1022, 1023, 1024]) {
                let (ours, theirs) = (scaled(value, exponent), libm::scalbn(value, exponent));
                assert_eq!(ours.to_bits(), theirs.to_bits(), "{value:e} 2^{exponent}");
            }
        }
    }

    #[test]
    fn a_cosine_has_thirty_digits() {
        let one = DoubleDouble::from_f64(1.0);
        for step in 0..=1000 {
            let theta = f64::from(step) * (core::f64::consts::FRAC_PI_2 / 1000.0);
            let (once, twice) = (cosine(theta), cosine(2.0 * theta));
            // cos 2θ = 2 cos² θ - 1, and the double next to it is libm's.
            let defect = once.mul(once).doubled().sub(one).sub(twice).to_f64();
            assert!(defect.abs() < 1e-30, "{theta}: {defect:e}");
            let error = (once.to_f64() - libm::cos(theta)).abs();
            assert!(error <= f64::EPSILON * once.to_f64().max(1e-3), "{theta}: {error:e}");
        }
        // The double next to π/3 lies so far above it: 1/2 less √3/2 of that.
        let above = 1.072_081_766_451_091e-16;
        let rest = cosine(core::f64::consts::FRAC_PI_3).sub(DoubleDouble::from_f64(0.5)).to_f64();
        let expected = -0.5 * 3.0_f64.sqrt() * above;
        assert!((rest / expected - 1.0).abs() < 1e-14, "{rest:e}, not {expected:e}");
    }
}
