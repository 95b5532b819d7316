//! What a kernel says about an argument outside its domain. It does not know whose number it was:
//! the caller prefixes that.

use core::fmt;

/// An argument that has no meaning for the kernel; the name carries the unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DomainError {
    /// A quantity that cannot be below zero is.
    Negative {
        /// The argument and its unit.
        argument: &'static str,
        /// As given.
        value: f64,
    },
    /// NaN or an infinity.
    NotFinite {
        /// The argument and its unit.
        argument: &'static str,
        /// As given.
        value: f64,
    },
    /// A size that has to be there is zero or below.
    NotPositive {
        /// The argument and its unit.
        argument: &'static str,
        /// As given.
        value: f64,
    },
    /// The answer is beyond the largest double: choose a larger unit of length.
    Overflow {
        /// The quantity and its unit.
        result: &'static str,
    },
    /// Outside a closed interval.
    Outside {
        /// The argument and its unit.
        argument: &'static str,
        /// As given.
        value: f64,
        /// The interval's lower end, included.
        low: f64,
        /// The interval's upper end, included.
        high: f64,
    },
}

impl fmt::Display for DomainError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Negative { argument, value } => {
                write!(f, "{argument} is {value}, expected 0 or more")
            }
            Self::NotFinite { argument, value } => {
                write!(f, "{argument} is {value}, expected a finite number")
            }
            Self::NotPositive { argument, value } => {
                write!(f, "{argument} is {value}, expected more than 0")
            }
            Self::Overflow { result } => write!(f, "{result} is beyond the largest double"),
            Self::Outside { argument, value, low, high } => {
                write!(f, "{argument} is {value}, expected {low} to {high}")
            }
        }
    }
}

impl core::error::Error for DomainError {}

/// The value, if it is a finite number.
pub(crate) fn finite(argument: &'static str, value: f64) -> Result<f64, DomainError> {
    if value.is_finite() { Ok(value) } else { Err(DomainError::NotFinite { argument, value }) }
}

/// The value, if it is finite and above zero.
pub(crate) fn positive(argument: &'static str, value: f64) -> Result<f64, DomainError> {
    let value = finite(argument, value)?;
    if value > 0.0 { Ok(value) } else { Err(DomainError::NotPositive { argument, value }) }
}

/// The value, if it is finite and not below zero.
pub(crate) fn not_negative(argument: &'static str, value: f64) -> Result<f64, DomainError> {
    let value = finite(argument, value)?;
    if value >= 0.0 { Ok(value) } else { Err(DomainError::Negative { argument, value }) }
}

/// The value, if it lies in the closed interval.
pub(crate) fn within(
    argument: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<f64, DomainError> {
    let value = finite(argument, value)?;
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(DomainError::Outside { argument, value, low, high })
    }
}
