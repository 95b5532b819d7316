//! What an integral without a closed form is asked for, and what it answers: a tolerance in, a value
//! with a bound of its error out. It does not know the method.

use core::fmt;

use crate::domain::{DomainError, not_negative, within};

/// How well an integral shall be known, and what that may cost: done when the error's bound is at
/// most `absolute` + `relative`·|value|, given up after `budget` evaluations of the integrand.
/// Who needs it: every kernel without a closed form; the simulator's laws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    relative: f64,
    absolute: f64,
    budget: usize,
}

impl Tolerance {
    /// As far as a one-dimensional integral of a positive function reaches in doubles.
    pub const FINE: Self = Self { relative: 1e-13, absolute: 0.0, budget: 1_000_000 };

    /// Relative in [0, 1], absolute (in the value's own unit) not negative, budget at least one.
    ///
    /// ```
    /// use radiometry::Tolerance;
    /// assert!(Tolerance::new(1e-9, 0.0, 100_000).is_ok());
    /// assert!(Tolerance::new(-1e-9, 0.0, 100_000).is_err());
    /// ```
    pub fn new(relative: f64, absolute: f64, budget: usize) -> Result<Self, DomainError> {
        Ok(Self {
            relative: within("relative_tolerance", relative, 0.0, 1.0)?,
            absolute: not_negative("absolute_tolerance", absolute)?,
            budget: if budget > 0 {
                budget
            } else {
                return Err(DomainError::NotPositive { argument: "budget", value: 0.0 });
            },
        })
    }

    /// The default but for the relative tolerance.
    pub fn from_relative(relative: f64) -> Result<Self, DomainError> {
        let default = Self::default();
        Self::new(relative, default.absolute, default.budget)
    }

    /// Relative to the value.
    pub const fn relative(self) -> f64 {
        self.relative
    }

    /// In the value's unit.
    pub const fn absolute(self) -> f64 {
        self.absolute
    }

    /// Evaluations of the integrand at most.
    pub const fn budget(self) -> usize {
        self.budget
    }

    /// The largest error that a value may have.
    pub fn allowed(self, value: f64) -> f64 {
        self.relative.mul_add(value.abs(), self.absolute)
    }

    /// The same for a part of a problem, or for its integrand: tighter by a factor in (0, 1].
    #[must_use]
    pub fn tightened(self, factor: f64) -> Self {
        Self { relative: self.relative * factor, absolute: self.absolute * factor, ..self }
    }
}

impl Tolerance {
    /// For an integral that a factor will make the value of: the relative tolerance stays, but for what the
    /// factor's own roundings need of it.
    pub(crate) fn before_factor(self, factor: f64) -> Self {
        const ROUNDINGS: f64 = 8.0 * f64::EPSILON;
        let relative = (self.relative - ROUNDINGS).max(0.5 * self.relative);
        Self { relative, absolute: (self.absolute / factor).min(f64::MAX), ..self }
    }
}

impl Default for Tolerance {
    /// Ten digits, a million evaluations.
    fn default() -> Self {
        Self { relative: 1e-10, absolute: 0.0, budget: 1_000_000 }
    }
}

/// The value of an integral, with a bound of its error.
/// Who needs it: every kernel without a closed form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// The true value lies within this of `value`, in the same unit; roundings are counted.
    pub error_bound: f64,
    /// How often the integrand was evaluated.
    pub evaluations: usize,
}

impl Estimate {
    /// A value from a closed form, good to some units in the last place.
    pub fn closed(value: f64, ulps: f64) -> Self {
        Self { value, error_bound: ulps * f64::EPSILON * value.abs(), evaluations: 0 }
    }

    /// Whether the bound is within the tolerance.
    pub fn meets(self, tolerance: Tolerance) -> bool {
        self.error_bound <= tolerance.allowed(self.value)
    }

    /// Value and bound times a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            error_bound: self.error_bound * factor.abs(),
            evaluations: self.evaluations,
        }
    }

    /// The nearest value in an interval that the true value is known to lie in; the bound holds on.
    #[must_use]
    pub fn clamped(self, low: f64, high: f64) -> Self {
        Self { value: self.value.clamp(low, high), ..self }
    }

    /// The estimate, if it meets the tolerance; what it is all the same, if it does not.
    pub fn within(self, tolerance: Tolerance) -> Result<Self, EstimateError> {
        if self.meets(tolerance) {
            Ok(self)
        } else {
            Err(EstimateError::Unmet { estimate: self, tolerance })
        }
    }
}

/// Why an integral has no estimate within the tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EstimateError {
    /// An argument outside its domain.
    Domain(DomainError),
    /// The budget is spent, or more digits are lost to rounding than the tolerance grants. The
    /// estimate and its bound stand.
    Unmet {
        /// As far as it came.
        estimate: Estimate,
        /// As asked for.
        tolerance: Tolerance,
    },
    /// The integrand is NaN or infinite inside of the domain.
    Integrand {
        /// What it gave.
        value: f64,
    },
}

impl From<DomainError> for EstimateError {
    fn from(error: DomainError) -> Self {
        Self::Domain(error)
    }
}

impl fmt::Display for EstimateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Domain(error) => error.fmt(f),
            Self::Unmet { estimate, tolerance } => write!(
                f,
                "the integral is {:e} within {:e} after {} evaluations, expected within {:e}",
                estimate.value,
                estimate.error_bound,
                estimate.evaluations,
                tolerance.allowed(estimate.value)
            ),
            Self::Integrand { value } => {
                write!(f, "the integrand is {value}, expected a finite number")
            }
        }
    }
}

impl core::error::Error for EstimateError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_that_nothing_can_mean_is_refused() {
        assert!(Tolerance::new(f64::NAN, 0.0, 1).is_err());
        assert!(Tolerance::new(2.0, 0.0, 1).is_err());
        assert!(Tolerance::new(0.1, f64::INFINITY, 1).is_err());
        assert!(Tolerance::new(0.1, 0.0, 0).is_err());
    }

    #[test]
    fn an_estimate_beyond_its_tolerance_is_handed_on_in_the_error() {
        let estimate = Estimate { value: 2.0, error_bound: 0.5, evaluations: 21 };
        let tolerance = Tolerance::new(0.1, 0.0, 21).unwrap();
        let error = estimate.within(tolerance).unwrap_err();
        assert_eq!(error, EstimateError::Unmet { estimate, tolerance });
        assert_eq!(
            error.to_string(),
            "the integral is 2e0 within 5e-1 after 21 evaluations, expected within 2e-1"
        );
    }
}
