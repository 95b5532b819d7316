//! Sums and products of doubles without loss: the pair (rounded result, its exact error), and the
//! double-double arithmetic that stands on it. It knows numbers only.
//!
//! Where a formula cancels, the digits are lost in the rounding of the terms before the difference
//! is taken. Keeping that rounding (Dekker 1971; Knuth, TAOCP 2, 4.2.2) costs a few operations and
//! no thought about conditioning. The fused multiply-add is correctly rounded with or without
//! hardware for it, so it costs speed at most, never bits.

/// a + b as (rounded sum, exact rest). Knuth, any order of magnitudes.
pub(crate) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_rounded = sum - a;
    (sum, (a - (sum - b_rounded)) + (b - b_rounded))
}

/// a · b as (rounded product, exact rest), barring underflow of the rest.
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

/// An unevaluated sum of two doubles, about 32 digits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DoubleDouble {
    high: f64,
    low: f64,
}

impl DoubleDouble {
    pub(crate) const fn from_f64(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }

    /// a - b without loss.
    pub(crate) fn difference(a: f64, b: f64) -> Self {
        let (high, low) = two_sum(a, -b);
        Self { high, low }
    }

    /// Rounded to the nearest double.
    pub(crate) fn to_f64(self) -> f64 {
        self.high + self.low
    }

    pub(crate) fn add(self, other: Self) -> Self {
        let (high, rest) = two_sum(self.high, other.high);
        let (low, low_rest) = two_sum(self.low, other.low);
        let (high, rest) = two_sum(high, rest + low);
        Self::renormalised(high, rest + low_rest)
    }

    pub(crate) fn sub(self, other: Self) -> Self {
        self.add(other.neg())
    }

    pub(crate) fn mul(self, other: Self) -> Self {
        let (high, rest) = two_product(self.high, other.high);
        Self::renormalised(high, rest + self.high.mul_add(other.low, self.low * other.high))
    }

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
        Self { high: libm::scalbn(self.high, exponent), low: libm::scalbn(self.low, exponent) }
    }

    fn renormalised(high: f64, low: f64) -> Self {
        let (high, low) = two_sum(high, low);
        Self { high, low }
    }
}

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
}
