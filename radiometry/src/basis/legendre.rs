//! Legendre polynomials over [-1, 1], for what varies along the sample. They don't know the sample's
//! extent: the caller maps it to the interval.

use super::jacobi::{self, Recurrence, Step};
use crate::domain::{DomainError, within};

/// The Legendre polynomials of degree 0 to `degree`, each scaled by √(2k+1): P₀ = 1, and the mean
/// of Pₖ² over [-1, 1] is 1 (of Pⱼ Pₖ: 0).
#[derive(Debug, Clone, PartialEq)]
pub struct Legendre {
    steps: Vec<Step>,
    norms: Vec<f64>,
}

impl Legendre {
    /// All of them up to a degree.
    pub fn new(degree: usize) -> Self {
        Self {
            steps: (0..degree).map(|k| jacobi::step(k, 0)).collect(),
            norms: (0..=degree).map(|k| (2.0f64.mul_add(k as f64, 1.0)).sqrt()).collect(),
        }
    }

    /// The highest degree.
    pub fn degree(&self) -> usize {
        self.steps.len()
    }

    /// How many there are: degree + 1.
    #[expect(clippy::len_without_is_empty, reason = "there is always the constant")]
    pub fn len(&self) -> usize {
        self.norms.len()
    }

    /// All values at `t`, by degree, into `values` (of length [`len`](Self::len), or it panics). A `t`
    /// a little outside [-1, 1] is extrapolated.
    ///
    /// ```
    /// let legendre = radiometry::basis::Legendre::new(2);
    /// let mut values = [0.0; 3];
    /// legendre.evaluate(1.0, &mut values);
    /// assert_eq!(values, [1.0, 3f64.sqrt(), 5f64.sqrt()]);
    /// ```
    pub fn evaluate(&self, t: f64, values: &mut [f64]) {
        assert_eq!(values.len(), self.len(), "one value a polynomial");
        // Pₖ(-t) = (-1)^k Pₖ(t): both ends are as exact as t = 1.
        let mirrored = t < 0.0;
        let mut recurrence = Recurrence::new(1.0 - t.abs());
        for (k, value) in values.iter_mut().enumerate() {
            let sign = if mirrored && k % 2 == 1 { -1.0 } else { 1.0 };
            *value = sign * self.norms[k] * recurrence.value();
            if let Some(step) = self.steps.get(k) {
                recurrence.advance(*step);
            }
        }
    }
}

/// The Legendre polynomial of a degree with P(1) = 1, at x in [-1, 1].
///
/// ```
/// assert_eq!(radiometry::basis::legendre::polynomial(2, 0.5)?, -0.125);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn polynomial(degree: usize, x: f64) -> Result<f64, DomainError> {
    let x = within("x", x, -1.0, 1.0)?;
    let sign = if x < 0.0 && degree % 2 == 1 { -1.0 } else { 1.0 };
    Ok(sign * jacobi::polynomial(degree, 0, 1.0 - x.abs()))
}
