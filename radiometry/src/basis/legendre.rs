//! Legendre polynomials over [-1, 1], for what varies along the sample. They don't know the sample's
//! extent: the caller maps it to the interval.

use super::jacobi::{self, Recurrence, Step};
use crate::domain::{DomainError, within};

/// The Legendre polynomials of degree 0 to `degree`, each scaled by √(2k+1): P₀ = 1, and the mean
/// of Pₖ² over [-1, 1] is 1 (of Pⱼ Pₖ: 0).
/// Who needs it: the fit, for what varies over the sample.
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

/// Products of two Legendre polynomials over the square [-1, 1]², for what varies over the sample's
/// area: √(2a+1) Pₐ(x) times its like of degree b in y, of limited total degree a + b. By total
/// degree, then by b; the mean of a square over the square is 1, of a product of two different ones 0.
/// Who needs it: fields over an area; the fit makes the same products of [`Legendre`] itself.
#[derive(Debug, Clone, PartialEq)]
pub struct LegendreProducts(Legendre);

impl LegendreProducts {
    /// All of them up to a total degree.
    pub fn new(total_degree: usize) -> Self {
        Self(Legendre::new(total_degree))
    }

    /// The highest total degree d.
    pub fn degree(&self) -> usize {
        self.0.degree()
    }

    /// How many there are: (d+1)(d+2)/2.
    #[expect(clippy::len_without_is_empty, reason = "there is always the constant")]
    pub fn len(&self) -> usize {
        (self.degree() + 1) * (self.degree() + 2) / 2
    }

    /// The degrees (a, b) in x and y of every product, in order.
    pub fn degrees(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..=self.degree()).flat_map(|total| (0..=total).map(move |b| (total - b, b)))
    }

    /// All values at (x, y), into `values` (of length [`len`](Self::len), or it panics), without a
    /// heap. A place a little outside the square is extrapolated.
    ///
    /// ```
    /// let products = radiometry::basis::LegendreProducts::new(1);
    /// let mut values = [0.0; 3];
    /// products.evaluate(1.0, -1.0, &mut values);
    /// assert_eq!(values, [1.0, 3f64.sqrt(), -3f64.sqrt()]); // 1, x, y
    /// ```
    pub fn evaluate(&self, x: f64, y: f64, values: &mut [f64]) {
        assert_eq!(values.len(), self.len(), "one value a product");
        let steps = &self.0.steps;
        let mut along_y = Recurrence::new(1.0 - y.abs());
        for b in 0..=self.degree() {
            let mut along_x = Recurrence::new(1.0 - x.abs());
            for a in 0..=self.degree() - b {
                let is_negative = (x < 0.0 && a % 2 == 1) != (y < 0.0 && b % 2 == 1);
                let product =
                    self.0.norms[a] * along_x.value() * (self.0.norms[b] * along_y.value());
                let total = a + b;
                values[total * (total + 1) / 2 + b] = if is_negative { -product } else { product };
                if let Some(step) = steps.get(a) {
                    along_x.advance(*step);
                }
            }
            if let Some(step) = steps.get(b) {
                along_y.advance(*step);
            }
        }
    }
}

/// The Legendre polynomial of a degree with P(1) = 1, at x in [-1, 1].
/// Who needs it: the basis's tests and `gonio calc`.
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
