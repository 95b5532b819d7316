//! Polynomials of doubles, right in the last digit and in the sign: in double-double where that is
//! enough, and exactly, as a sum of many doubles, where it isn't. It knows numbers only.
//!
//! Sources: Shewchuk (1997), "Adaptive precision floating-point arithmetic and fast robust
//! geometric predicates", for expansions and for the filter before them. Exact as long as no
//! product of two rounding errors underflows: hand coordinates in near 1.

use crate::error_free::{DoubleDouble, two_product, two_sum};

/// A number given as a sum of two doubles, like an exact difference.
pub(crate) type Pair = (f64, f64);

/// A polynomial of numbers that were handed in exactly.
pub(crate) trait Polynomial {
    /// Its value in one kind of arithmetic.
    fn evaluate<N: Number>(&self) -> N;
}

/// What a polynomial is computed with.
pub(crate) trait Number: Sized {
    fn from_pair(pair: Pair) -> Self;
    fn add(&self, other: &Self) -> Self;
    fn sub(&self, other: &Self) -> Self;
    fn mul(&self, other: &Self) -> Self;
}

/// The value within an ulp or two, zero only where it is zero, and with its true sign.
pub(crate) fn value(polynomial: &impl Polynomial) -> f64 {
    /// Double-double is good to some 1e-30 of the terms: 1e-16 of what is left above this.
    const FILTER: f64 = 1e-14;
    let approximate = polynomial.evaluate::<DoubleDouble>().to_f64();
    let Magnitude(terms) = polynomial.evaluate();
    if approximate.abs() > FILTER * terms {
        return approximate;
    }
    polynomial.evaluate::<Expansion>().value()
}

impl Number for DoubleDouble {
    fn from_pair((high, low): Pair) -> Self {
        Self::sum(high, low)
    }

    fn add(&self, other: &Self) -> Self {
        Self::add(*self, *other)
    }

    fn sub(&self, other: &Self) -> Self {
        Self::sub(*self, *other)
    }

    fn mul(&self, other: &Self) -> Self {
        Self::mul(*self, *other)
    }
}

/// The sum of the terms' sizes: what cancels is measured against it.
struct Magnitude(f64);

impl Number for Magnitude {
    fn from_pair((high, low): Pair) -> Self {
        Self(high.abs() + low.abs())
    }

    fn add(&self, other: &Self) -> Self {
        Self(self.0 + other.0)
    }

    fn sub(&self, other: &Self) -> Self {
        Self(self.0 + other.0)
    }

    fn mul(&self, other: &Self) -> Self {
        Self(self.0 * other.0)
    }
}

/// An exact sum of doubles that do not overlap, the smallest first, none of them zero.
struct Expansion(Vec<f64>);

impl Expansion {
    /// Shewchuk's grow-expansion, zeros left out.
    fn grow(&mut self, term: f64) {
        let (mut sum, mut kept) = (term, 0);
        for i in 0..self.0.len() {
            let (high, low) = two_sum(sum, self.0[i]);
            sum = high;
            if low != 0.0 {
                self.0[kept] = low;
                kept += 1;
            }
        }
        self.0.truncate(kept);
        if sum != 0.0 {
            self.0.push(sum);
        }
    }

    fn value(&self) -> f64 {
        self.0.iter().sum()
    }
}

impl Number for Expansion {
    fn from_pair((high, low): Pair) -> Self {
        let mut expansion = Self(Vec::with_capacity(2));
        expansion.grow(low);
        expansion.grow(high);
        expansion
    }

    fn add(&self, other: &Self) -> Self {
        let mut sum = Self(self.0.clone());
        other.0.iter().for_each(|term| sum.grow(*term));
        sum
    }

    fn sub(&self, other: &Self) -> Self {
        let mut difference = Self(self.0.clone());
        other.0.iter().for_each(|term| difference.grow(-term));
        difference
    }

    fn mul(&self, other: &Self) -> Self {
        let mut product = Self(Vec::new());
        for (a, b) in self.0.iter().flat_map(|a| other.0.iter().map(move |b| (a, b))) {
            let (high, low) = two_product(*a, *b);
            product.grow(low);
            product.grow(high);
        }
        product
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Telescope;

    impl Polynomial for Telescope {
        /// (1e16 + 1e-16)² - 1e32 - 2 = 1e-32, but for the rounding of the constants.
        fn evaluate<N: Number>(&self) -> N {
            let big = N::from_pair((1e16, 1e-16));
            let square = big.mul(&big);
            square.sub(&N::from_pair((1e16, 0.0)).mul(&N::from_pair((1e16, 0.0))))
        }
    }

    #[test]
    fn what_double_double_loses_is_found_exactly() {
        // 2·1e16·1e-16 + 1e-32.
        assert!((value(&Telescope) - 2.0).abs() < 1e-15);
    }

    struct Difference(f64, f64, f64, f64);

    impl Polynomial for Difference {
        fn evaluate<N: Number>(&self) -> N {
            let [a, b, c, d] = [self.0, self.1, self.2, self.3].map(|x| N::from_pair((x, 0.0)));
            a.mul(&b).sub(&c.mul(&d))
        }
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "the claim is exactness")]
    fn a_sign_is_right_in_the_last_bit() {
        let above = 1.0 + f64::EPSILON;
        let below = 1.0 - f64::EPSILON / 2.0;
        assert_eq!(value(&Difference(above, above, above, above)), 0.0);
        assert!(value(&Difference(above, below, 1.0, 1.0)) > 0.0);
        assert!(value(&Difference(below, below, below, 1.0)) < 0.0);
    }
}
