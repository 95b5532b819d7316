//! A number with its uncertainty, and the rows of its budget. Knows no field and no basis.

/// A value with its combined standard uncertainty (k = 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The best value.
    pub value: f64,
    /// The standard uncertainty by all components.
    pub u: f64,
    /// By what is independent from reading to reading alone: it falls as more is measured.
    pub u_independent: f64,
}

/// A row of an uncertainty budget.
#[derive(Debug, Clone, PartialEq)]
pub struct Contribution {
    /// `independent`, or the name of a common component.
    pub name: String,
    /// Its part of the standard uncertainty; the parts' squares add to the whole's.
    pub u: f64,
}

impl Estimate {
    pub(crate) fn times(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            u: self.u * factor.abs(),
            u_independent: self.u_independent * factor.abs(),
        }
    }
}

/// The name of what the functions can't follow among contributions.
pub const TRUNCATION: &str = "truncation";
/// The name of what is not known where nothing was measured among contributions.
pub const EXTRAPOLATION: &str = "extrapolation";
/// The budget's name for what is independent from reading to reading.
pub(crate) const INDEPENDENT: &str = "independent";
