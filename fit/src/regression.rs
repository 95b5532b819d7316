//! Unweighted least squares of one curve: a polynomial, or columns with an intercept. For drifts,
//! calibration curves and other plain tables; the radiance field has its own fit. Knows no unit.
//!
//! Each fit maps its abscissae first: a polynomial is written in Chebyshev polynomials over the
//! data's interval, columns are taken from their means by their spreads. The same orthogonal
//! factorisation then holds where powers of a time in microseconds would leave no digit (NIST's
//! Filip and Longley data). Normal equations are never formed. Powers of x are found on request.

use std::fmt;

use radiometry::quadrature::Sum;

use crate::triangle::{Solution, Triangle};

/// More unknowns than any curve has a use for.
const UNKNOWNS_MAX: usize = 100;

/// Why there is no curve.
#[derive(Debug, Clone, PartialEq)]
pub enum RegressionError {
    /// A column is not as long as the readings.
    Lengths {
        /// Its length.
        found: usize,
        /// Readings.
        expected: usize,
    },
    /// A number is NaN or infinite.
    NotFinite,
    /// Fewer readings than unknowns, or more unknowns than are taken.
    Unknowns {
        /// Readings.
        readings: usize,
        /// Unknowns of the curve.
        unknowns: usize,
    },
    /// The readings leave combinations of unknowns open: too few places, or columns that depend on
    /// each other.
    Undetermined {
        /// How many are determined.
        rank: usize,
        /// Unknowns of the curve.
        unknowns: usize,
    },
    /// As many readings as unknowns: no residual is left to tell the scatter from.
    NoScatter,
    /// There is no such coefficient.
    Index {
        /// Asked for.
        index: usize,
        /// Coefficients.
        unknowns: usize,
    },
    /// The numbers are so large or so small that squares leave the range of f64.
    OutOfRange,
}

impl fmt::Display for RegressionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lengths { found, expected } => {
                write!(f, "a column has {found} numbers, expected {expected} as there are readings")
            }
            Self::NotFinite => write!(f, "a reading is NaN or infinite, expected finite numbers"),
            Self::Unknowns { readings, unknowns } => write!(
                f,
                "{readings} readings for {unknowns} unknowns, expected as many at least, \
                 and at most {UNKNOWNS_MAX} unknowns"
            ),
            Self::Undetermined { rank, unknowns } => {
                write!(f, "the readings determine {rank} of {unknowns} unknowns")
            }
            Self::NoScatter => {
                write!(f, "as many unknowns as readings: no residual is left to tell the scatter")
            }
            Self::Index { index, unknowns } => {
                write!(f, "index is {index}, expected one below {unknowns}")
            }
            Self::OutOfRange => write!(f, "the numbers leave the range of double precision"),
        }
    }
}

impl std::error::Error for RegressionError {}

/// A number that a curve yields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Yield {
    /// The number.
    pub value: f64,
    /// Its standard deviation by the residuals' scatter; none without a degree of freedom.
    pub sd: Option<f64>,
    /// A bound on the rounding error of the value.
    pub rounding: f64,
}

/// Unknowns in the mapped abscissae, with what is needed for their uncertainty.
#[derive(Debug, Clone)]
struct Unknowns {
    values: Vec<f64>,
    /// S with covariance S Sᵀ, upper triangular, packed by columns.
    factor: Vec<f64>,
    residual_squares: f64,
    dof: usize,
    condition: f64,
    /// The largest reading.
    size: f64,
}

impl Unknowns {
    /// Rows of as many numbers as unknowns, each with its reading.
    fn solve(
        rows: impl ExactSizeIterator<Item = Vec<f64>>,
        y: &[f64],
        unknowns: usize,
    ) -> Result<Self, RegressionError> {
        let readings = y.len();
        if readings < unknowns || unknowns > UNKNOWNS_MAX {
            return Err(RegressionError::Unknowns { readings, unknowns });
        }
        let size = y.iter().fold(0.0, |size: f64, y| size.max(y.abs()));
        let divisor = if size > 0.0 { size } else { 1.0 };
        let mut triangle = Triangle::new(unknowns, 1);
        for (mut row, y) in rows.zip(y) {
            row.push(y / divisor);
            triangle.absorb(&row);
        }
        let solution = triangle.solve().ok_or(RegressionError::OutOfRange)?;
        let spectrum = solution.spectrum().ok_or(RegressionError::OutOfRange)?;
        let rank = spectrum.rank();
        if rank < unknowns {
            return Err(RegressionError::Undetermined { rank, unknowns });
        }
        let condition = spectrum.condition();
        Ok(Self::new(&solution, divisor, size, condition, readings - unknowns))
    }

    fn new(solution: &Solution, divisor: f64, size: f64, condition: f64, dof: usize) -> Self {
        Self {
            values: solution.unknowns(0).into_iter().map(|value| value * divisor).collect(),
            factor: solution.inverse(),
            residual_squares: solution.residual_squares(0) * divisor * divisor,
            dof,
            condition,
            size,
        }
    }

    /// Scatter of the readings around the curve.
    fn residual_sd(&self) -> Option<f64> {
        (self.dof > 0).then(|| (self.residual_squares / self.dof as f64).sqrt())
    }

    /// The combination of unknowns with these weights.
    fn combination(&self, weights: &[f64]) -> Yield {
        /// Roundings of the factorisation, by the rows of the references.
        const ROUNDINGS: f64 = 16.0 * f64::EPSILON;
        let terms = weights.iter().zip(&self.values).map(|(weight, value)| weight * value);
        let value = terms.collect::<Sum>().value();
        let spread: f64 = (0..weights.len())
            .map(|j| {
                let column = &self.factor[j * (j + 1) / 2..];
                weights.iter().zip(column).take(j + 1).map(|(w, s)| w * s).sum::<f64>().powi(2)
            })
            .sum();
        let sizes: f64 = weights.iter().map(|weight| weight.abs()).sum();
        Yield {
            value,
            sd: self.residual_sd().map(|sd| sd * spread.sqrt()),
            rounding: ROUNDINGS * self.condition * sizes * self.size,
        }
    }
}

/// A polynomial through readings.
#[derive(Debug, Clone)]
pub struct Polynomial {
    unknowns: Unknowns,
    middle: f64,
    half_width: f64,
}

impl Polynomial {
    /// The polynomial of that degree that fits the readings `y` at the places `x` best.
    ///
    /// ```
    /// use fit::regression::Polynomial;
    /// // A drift against a clock in microseconds since 1970: 2e-6 per µs.
    /// let x = [1.7e15, 1.7e15 + 1e6, 1.7e15 + 2e6, 1.7e15 + 3e6];
    /// let line = Polynomial::fit(&x, &[1.0, 3.0, 5.0, 7.0], 1)?;
    /// assert!((line.coefficient(1)?.value - 2e-6).abs() < 1e-20);
    /// assert!((line.value(1.7e15 + 5e5)?.value - 2.0).abs() < 1e-14);
    /// # Ok::<(), fit::regression::RegressionError>(())
    /// ```
    pub fn fit(x: &[f64], y: &[f64], degree: usize) -> Result<Self, RegressionError> {
        if x.len() != y.len() {
            return Err(RegressionError::Lengths { found: x.len(), expected: y.len() });
        }
        let unknowns = degree.saturating_add(1);
        if y.len() < unknowns || unknowns > UNKNOWNS_MAX {
            return Err(RegressionError::Unknowns { readings: y.len(), unknowns });
        }
        if x.iter().chain(y).any(|number| !number.is_finite()) {
            return Err(RegressionError::NotFinite);
        }
        let low = x.iter().copied().fold(f64::INFINITY, f64::min);
        let high = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let middle = f64::midpoint(low, high);
        // One place only determines a constant: the width then has no meaning.
        let half_width = if high > low { high / 2.0 - low / 2.0 } else { 1.0 };
        if half_width <= 0.0 {
            return Err(RegressionError::OutOfRange);
        }
        let rows = x.iter().map(|x| chebyshev((x - middle) / half_width, unknowns));
        Ok(Self { unknowns: Unknowns::solve(rows, y, unknowns)?, middle, half_width })
    }

    /// Its value at a place.
    pub fn value(&self, at: f64) -> Result<Yield, RegressionError> {
        if !at.is_finite() {
            return Err(RegressionError::NotFinite);
        }
        let t = (at - self.middle) / self.half_width;
        Ok(self.unknowns.combination(&chebyshev(t, self.unknowns.values.len())))
    }

    /// The coefficient of x^index. The powers of x are an ill-conditioned basis away from 0:
    /// [`value`](Self::value) is the better question, and `rounding` says by how much.
    pub fn coefficient(&self, index: usize) -> Result<Yield, RegressionError> {
        let unknowns = self.unknowns.values.len();
        if index >= unknowns {
            return Err(RegressionError::Index { index, unknowns });
        }
        let weights: Vec<f64> = self.powers().iter().map(|powers| powers[index]).collect();
        Ok(self.unknowns.combination(&weights))
    }

    /// The readings' standard deviation around the curve: √(Σr²/(n - degree - 1)).
    pub fn residual_sd(&self) -> Result<f64, RegressionError> {
        self.unknowns.residual_sd().ok_or(RegressionError::NoScatter)
    }

    /// Every Chebyshev polynomial of (x - middle)/half width, in powers of x.
    fn powers(&self) -> Vec<Vec<f64>> {
        let n = self.unknowns.values.len();
        let mut all: Vec<Vec<f64>> = Vec::with_capacity(n);
        for j in 0..n {
            let mut next = vec![0.0; n];
            if j == 0 {
                next[0] = 1.0;
            } else {
                let last = &all[j - 1];
                let twice = if j == 1 { 1.0 } else { 2.0 };
                for i in 0..n {
                    let shifted = if i > 0 { last[i - 1] } else { 0.0 };
                    next[i] = twice * ((shifted - self.middle * last[i]) / self.half_width);
                }
                if j > 1 {
                    next.iter_mut().zip(&all[j - 2]).for_each(|(next, before)| *next -= before);
                }
            }
            all.push(next);
        }
        all
    }
}

/// T₀ to Tₙ₋₁ at t.
fn chebyshev(t: f64, n: usize) -> Vec<f64> {
    let mut values = Vec::with_capacity(n + 1);
    values.extend([1.0, t]);
    for j in 2..n {
        values.push(2.0 * t * values[j - 1] - values[j - 2]);
    }
    values.truncate(n);
    values
}

/// Readings as an intercept and a multiple of each of several columns.
#[derive(Debug, Clone)]
pub struct Linear {
    unknowns: Unknowns,
    /// Mean and spread of each column.
    maps: Vec<(f64, f64)>,
}

impl Linear {
    /// Fits y = b₀ + Σ bⱼ columnⱼ.
    ///
    /// ```
    /// use fit::regression::Linear;
    /// let columns = [vec![0.0, 1.0, 2.0, 3.0], vec![1.0, 0.0, 0.0, 1.0]];
    /// let plane = Linear::fit(&columns, &[5.0, 4.0, 6.0, 11.0])?; // 2 + 2u + 3v
    /// let found: Vec<f64> = (0..3).map(|i| plane.coefficient(i).map(|c| c.value)).collect::<Result<_, _>>()?;
    /// assert!(found.iter().zip([2.0, 2.0, 3.0]).all(|(found, b)| (found - b).abs() < 1e-14));
    /// # Ok::<(), fit::regression::RegressionError>(())
    /// ```
    pub fn fit(columns: &[Vec<f64>], y: &[f64]) -> Result<Self, RegressionError> {
        if let Some(column) = columns.iter().find(|column| column.len() != y.len()) {
            return Err(RegressionError::Lengths { found: column.len(), expected: y.len() });
        }
        if columns.iter().flatten().chain(y).any(|number| !number.is_finite()) {
            return Err(RegressionError::NotFinite);
        }
        let unknowns = columns.len() + 1;
        let maps: Vec<(f64, f64)> = columns.iter().map(|column| mean_and_spread(column)).collect();
        let row = |i: usize| {
            let mapped =
                columns.iter().zip(&maps).map(|(c, (mean, spread))| (c[i] - mean) / spread);
            std::iter::once(1.0).chain(mapped).collect()
        };
        Ok(Self { unknowns: Unknowns::solve((0..y.len()).map(row), y, unknowns)?, maps })
    }

    /// The intercept (index 0), or what a column is multiplied with (from 1).
    pub fn coefficient(&self, index: usize) -> Result<Yield, RegressionError> {
        let unknowns = self.unknowns.values.len();
        if index >= unknowns {
            return Err(RegressionError::Index { index, unknowns });
        }
        let mut weights = vec![0.0; unknowns];
        if index == 0 {
            weights[0] = 1.0;
            for (weight, (mean, spread)) in weights[1..].iter_mut().zip(&self.maps) {
                *weight = -mean / spread;
            }
        } else {
            weights[index] = 1.0 / self.maps[index - 1].1;
        }
        Ok(self.unknowns.combination(&weights))
    }

    /// The readings' standard deviation around the fit: √(Σr²/(n - unknowns)).
    pub fn residual_sd(&self) -> Result<f64, RegressionError> {
        self.unknowns.residual_sd().ok_or(RegressionError::NoScatter)
    }
}

/// The mean, and the largest deviation from it; 1 where there is none, as in a constant column.
fn mean_and_spread(column: &[f64]) -> (f64, f64) {
    let count = column.len().max(1) as f64;
    let mean = column.iter().map(|value| value / count).collect::<Sum>().value();
    let spread = column.iter().map(|value| (value - mean).abs()).fold(0.0, f64::max);
    // A constant's mean may be a rounding off it: that is no spread.
    let is_constant = column.windows(2).all(|pair| pair[0].to_bits() == pair[1].to_bits());
    (mean, if is_constant || spread <= 0.0 { 1.0 } else { spread })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_readings_leave_open_is_refused() {
        let x = [1.0, 2.0, 3.0];
        let refused = |x: &[f64], y: &[f64], degree| Polynomial::fit(x, y, degree).unwrap_err();
        assert_eq!(refused(&x, &x, 3), RegressionError::Unknowns { readings: 3, unknowns: 4 });
        let two_places = refused(&[1.0, 1.0, 2.0], &x, 2);
        assert!(matches!(two_places, RegressionError::Undetermined { rank: 2, unknowns: 3 }));
        assert_eq!(refused(&x, &[1.0, f64::NAN, 2.0], 1), RegressionError::NotFinite);
        assert_eq!(refused(&x, &x[..2], 1), RegressionError::Lengths { found: 3, expected: 2 });
        assert!(matches!(refused(&x, &x, usize::MAX), RegressionError::Unknowns { .. }));
        let through = Polynomial::fit(&x, &x, 2).unwrap();
        assert_eq!(through.residual_sd(), Err(RegressionError::NoScatter));
        let same = Linear::fit(&[x.to_vec(), x.to_vec()], &x).unwrap_err();
        assert!(matches!(same, RegressionError::Undetermined { rank: 2, unknowns: 3 }));
        let constant = Linear::fit(&[vec![0.1; 3]], &x).unwrap_err();
        assert!(matches!(constant, RegressionError::Undetermined { rank: 1, unknowns: 2 }));
    }

    #[test]
    fn a_lines_uncertainty_is_the_textbooks() {
        // y = x + (1, -1, -1, 1)·0.5 at x = 0..3: s² = 1/2, Sxx = 5.
        let line = Polynomial::fit(&[0.0, 1.0, 2.0, 3.0], &[0.5, 0.5, 1.5, 3.5], 1).unwrap();
        let slope = line.coefficient(1).unwrap();
        assert!((slope.value - 1.0).abs() < 1e-14);
        assert!((slope.sd.unwrap() - 0.1f64.sqrt()).abs() < 1e-14);
        assert!((line.residual_sd().unwrap() - 0.5f64.sqrt()).abs() < 1e-14);
        // At the middle: s/√n.
        assert!((line.value(1.5).unwrap().sd.unwrap() - 0.125f64.sqrt()).abs() < 1e-14);
    }
}
