//! What a number in a file may be. NaN and infinity are never inside any bounds.

use core::fmt;

/// An interval of finite numbers, each end included or not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    low: f64,
    low_included: bool,
    high: f64,
    high_included: bool,
}

impl Bounds {
    /// Any finite number.
    pub const FINITE: Self = Self::new(f64::NEG_INFINITY, true, f64::INFINITY, true);
    /// Zero and above.
    pub const NON_NEGATIVE: Self = Self::new(0.0, true, f64::INFINITY, true);
    /// Above zero.
    pub const POSITIVE: Self = Self::new(0.0, false, f64::INFINITY, true);

    const fn new(low: f64, low_included: bool, high: f64, high_included: bool) -> Self {
        Self { low, low_included, high, high_included }
    }

    /// From `low` to `high`, both included.
    pub const fn between(low: f64, high: f64) -> Self {
        Self::new(low, true, high, true)
    }

    /// Above zero, up to `high` included.
    pub const fn positive_up_to(high: f64) -> Self {
        Self::new(0.0, false, high, true)
    }

    /// Whether `value` is finite and inside.
    pub fn contain(self, value: f64) -> bool {
        let above = if self.low_included { value >= self.low } else { value > self.low };
        let below = if self.high_included { value <= self.high } else { value < self.high };
        value.is_finite() && above && below
    }
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let above = if self.low_included { "at least" } else { "above" };
        let below = if self.high_included { "at most" } else { "below" };
        match (self.low.is_finite(), self.high.is_finite()) {
            (false, false) => f.write_str("a finite number"),
            (true, false) => write!(f, "a finite number {above} {}", Short(self.low)),
            (false, true) => write!(f, "a finite number {below} {}", Short(self.high)),
            (true, true) => {
                write!(f, "a number {above} {} and {below} {}", Short(self.low), Short(self.high))
            }
        }
    }
}

/// A number as a person would write it: powers of ten where there would be many zeros.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || (1e-4..1e9).contains(&size) {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_contains_nan_or_infinity() {
        for bounds in [Bounds::FINITE, Bounds::NON_NEGATIVE, Bounds::between(-1.0, 1.0)] {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(!bounds.contain(value), "{bounds} contains {value}");
            }
        }
    }

    #[test]
    fn ends_are_included_or_not_as_stated() {
        assert!(Bounds::NON_NEGATIVE.contain(0.0) && !Bounds::POSITIVE.contain(0.0));
        assert!(Bounds::between(0.0, 90.0).contain(90.0));
        assert_eq!(Bounds::POSITIVE.to_string(), "a finite number above 0");
        let wide = Bounds::between(-1e15, 1e6).to_string();
        assert_eq!(wide, "a number at least -1e15 and at most 1000000");
    }
}
