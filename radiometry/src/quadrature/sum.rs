//! Sums that keep their digits. They do not know what is added.

use crate::error_free::two_sum;

/// A running sum that carries what rounding drops (Neumaier 1974): the error of the sum stays a
/// rounding or two, however many terms and whatever their order.
/// Who needs it: the fit's regression, and every long sum here.
///
/// ```
/// let sum: radiometry::quadrature::Sum = [1e16, 1.0, -1e16].into_iter().collect();
/// assert_eq!(sum.value(), 1.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sum {
    rounded: f64,
    rest: f64,
}

impl Sum {
    /// One more term.
    pub fn add(&mut self, term: f64) {
        let (rounded, rest) = two_sum(self.rounded, term);
        self.rounded = rounded;
        // Once the sum is infinite the exact rest is NaN: the infinity is the answer.
        if rest.is_finite() {
            self.rest += rest;
        }
    }

    /// The sum so far.
    pub fn value(self) -> f64 {
        self.rounded + self.rest
    }
}

impl Extend<f64> for Sum {
    fn extend<I: IntoIterator<Item = f64>>(&mut self, terms: I) {
        for term in terms {
            self.add(term);
        }
    }
}

impl FromIterator<f64> for Sum {
    fn from_iter<I: IntoIterator<Item = f64>>(terms: I) -> Self {
        let mut sum = Self::default();
        sum.extend(terms);
        sum
    }
}
