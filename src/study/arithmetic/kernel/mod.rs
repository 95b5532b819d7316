//! One call of a kernel of `radiometry`, ready to be made again and again: by the quantity's name
//! in `gonio calc` and the inputs of a reference case, which are read beforehand, so that what is
//! timed is the kernel and no JSON. What changes from call to call (receiver, ray, incidence) is
//! built within the call; what stays (polygon, disk, interface) is built before it.

mod form_factors;
mod row;
mod solid_angles;

use std::hint::black_box;

use radiometry::{Estimate, EstimateError};
use serde_json::Value;

use crate::study::arithmetic::Unmeasured;
pub use row::Row;

/// What a kernel consists of, which is what its time is measured by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A closed form with up to about four transcendental functions.
    Closed,
    /// One closed form a corner or an edge.
    Corners,
    /// A recurrence over the degree.
    Recurrence,
    /// Integrated by quadrature to a tolerance.
    Integral,
}

impl Kind {
    /// For a table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Closed => "closed form",
            Self::Corners => "corner sum",
            Self::Recurrence => "recurrence",
            Self::Integral => "integral",
        }
    }

    /// What the middle case of a quantity may take; `None` if only the hardest case has an aim.
    pub fn aim_ns(self) -> Option<f64> {
        match self {
            Self::Closed => Some(200.0),
            Self::Corners => Some(2_000.0),
            Self::Recurrence | Self::Integral => None,
        }
    }
}

/// What any case may take.
pub const HARD_AIM_NS: f64 = 20_000.0;

/// A kernel with its inputs.
pub struct Call {
    /// What it consists of.
    pub kind: Kind,
    run: Box<dyn Fn() -> f64>,
}

impl Call {
    /// The inputs are hidden from the compiler, so that it cannot compute ahead.
    pub fn new<I: 'static>(kind: Kind, inputs: I, kernel: impl Fn(&I) -> f64 + 'static) -> Self {
        Self { kind, run: Box::new(move || kernel(black_box(&inputs))) }
    }

    /// Nothing: what making a call costs by itself.
    pub fn empty() -> Self {
        Self::new(Kind::Closed, 1.0, |x| *x)
    }

    /// The kernel's value, or that of its largest component; NaN where it has none.
    pub fn answer(&self) -> f64 {
        (self.run)()
    }
}

/// The kernel of a solid angle or a form factor on the inputs of a case; `None` for other quantities.
pub fn call(quantity: &str, inputs: &Value) -> Result<Option<Call>, Unmeasured> {
    let row = Row::new(inputs);
    let families = [solid_angles::call, form_factors::call];
    for family in families {
        if let Some(call) = family(quantity, row)? {
            return Ok(Some(call));
        }
    }
    Ok(None)
}

/// A value, or NaN where there is none.
pub fn value<T, E>(result: Result<T, E>, number: impl Fn(T) -> f64) -> f64 {
    result.map_or(f64::NAN, number)
}

/// An estimate's value; of one that misses its tolerance too.
pub fn estimated(result: Result<Estimate, EstimateError>) -> f64 {
    match result {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => black_box(estimate).value,
        Err(_) => f64::NAN,
    }
}
