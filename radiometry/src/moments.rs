//! Mean and variance of weighted readings, to the last digits: of a list at once, or as running moments
//! that merge. They do not know what was read.
//!
//! For whoever averages readings: dwells, repeats, partial results of several runs (`gonio calc`; the
//! fit weights readings itself). A list is taken from its first reading and in units of its spread, the second pass
//! corrected (Chan, Golub and `LeVeque` 1983), every sum compensated (Neumaier 1974).

use crate::domain::{DomainError, finite, not_negative, positive, within};
use crate::error_free::two_sum;
use crate::quadrature::Sum;

/// Σ w v / Σ w; weights not negative, not all zero.
/// Who needs it: whoever averages readings by hand: `gonio calc`.
///
/// ```
/// use radiometry::moments::weighted_mean;
/// assert_eq!(weighted_mean(&[1.0, 4.0], &[2.0, 1.0])?, 2.0);
/// assert!(weighted_mean(&[1.0, 4.0], &[0.0, 0.0]).is_err());
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn weighted_mean(values: &[f64], weights: &[f64]) -> Result<f64, DomainError> {
    let spread = Spread::new(values, Some(weights))?;
    let mean = spread.origin / 4.0 + libm::scalbn(spread.mean / 4.0, spread.exponent);
    known("mean", 4.0 * mean)
}

/// Σ w (v - mean)²/Σ w, the variance of a population; an error beyond the largest double.
/// Who needs it: whoever averages readings by hand: `gonio calc`.
///
/// ```
/// // An offset of 1e9 costs no digit.
/// let values = [1e9 + 4.0, 1e9 + 7.0, 1e9 + 13.0, 1e9 + 16.0];
/// assert_eq!(radiometry::moments::weighted_variance(&values, &[1.0; 4])?, 22.5);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn weighted_variance(values: &[f64], weights: &[f64]) -> Result<f64, DomainError> {
    let spread = Spread::new(values, Some(weights))?;
    known("variance", libm::scalbn(spread.squares / spread.weight, 2 * spread.exponent))
}

/// The square root of [`weighted_variance`], also where that itself would overflow.
/// Who needs it: whoever averages readings by hand: `gonio calc`.
///
/// ```
/// let deviation = radiometry::moments::weighted_std(&[1e200, 3e200], &[1.0, 1.0])?;
/// assert!((deviation / 1e200 - 1.0).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn weighted_std(values: &[f64], weights: &[f64]) -> Result<f64, DomainError> {
    let spread = Spread::new(values, Some(weights))?;
    let variance = spread.squares / spread.weight;
    known("standard deviation", libm::scalbn(variance.sqrt(), spread.exponent))
}

/// Σ (v - mean)²/(n - 1), of two values or more.
/// Who needs it: whoever judges repeats by hand: `gonio calc`.
///
/// ```
/// assert_eq!(radiometry::moments::sample_variance(&[1.0, 2.0, 3.0])?, 1.0);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn sample_variance(values: &[f64]) -> Result<f64, DomainError> {
    positive("count of values less one", values.len() as f64 - 1.0)?;
    let spread = Spread::new(values, None)?;
    let variance = spread.squares / (values.len() as f64 - 1.0);
    known("variance", libm::scalbn(variance, 2 * spread.exponent))
}

/// The sum with two roundings, whatever its terms and their order.
/// Who needs it: whoever adds up readings by hand: `gonio calc`.
///
/// ```
/// assert_eq!(radiometry::moments::sum(&[1e16, 1.0, -1e16])?, 1.0);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn sum(values: &[f64]) -> Result<f64, DomainError> {
    for value in values {
        finite("value", *value)?;
    }
    known("sum", values.iter().copied().collect::<Sum>().value())
}

fn known(result: &'static str, value: f64) -> Result<f64, DomainError> {
    if value.is_finite() { Ok(value) } else { Err(DomainError::Overflow { result }) }
}

/// Values from the first one, in units of two to the exponent.
struct Spread {
    origin: f64,
    exponent: i32,
    mean: f64,
    /// Σ w (v - mean)²
    squares: f64,
    /// Σ w
    weight: f64,
}

impl Spread {
    fn new(values: &[f64], weights: Option<&[f64]>) -> Result<Self, DomainError> {
        positive("count of values", values.len() as f64)?;
        if let Some(weights) = weights.filter(|weights| weights.len() != values.len()) {
            let (value, count) = (weights.len() as f64, values.len() as f64);
            return Err(DomainError::Outside {
                argument: "count of weights",
                value,
                low: count,
                high: count,
            });
        }
        for value in values {
            finite("value", *value)?;
        }
        let mut heaviest: f64 = 0.0;
        for weight in weights.unwrap_or_default() {
            heaviest = heaviest.max(not_negative("weight", *weight)?);
        }
        let weight_unit = match weights {
            Some(_) => libm::ilogb(positive("sum of weights", heaviest)?),
            None => 0,
        };
        let weight = |i: usize| weights.map_or(1.0, |w| libm::scalbn(w[i], -weight_unit));
        Ok(Self::from_weighted(values, weight))
    }

    fn from_weighted(values: &[f64], weight: impl Fn(usize) -> f64) -> Self {
        let origin = values[0];
        // By quarters, so that no difference overflows.
        let off = |value: f64| two_sum(value / 4.0, -origin / 4.0);
        let widest = values.iter().map(|value| off(*value).0.abs()).fold(0.0, f64::max);
        let exponent = if widest > 0.0 { libm::ilogb(widest) } else { 0 };
        let unit = |length: f64| libm::scalbn(length, -exponent);
        let (mut total, mut first) = (Sum::default(), Sum::default());
        for (i, value) in values.iter().enumerate() {
            let (difference, rest) = off(*value);
            total.add(weight(i));
            first.add(weight(i) * unit(difference));
            first.add(weight(i) * unit(rest));
        }
        let (total, mean) = (total.value(), first.value() / total.value());
        let (mut squares, mut left) = (Sum::default(), Sum::default());
        for (i, value) in values.iter().enumerate() {
            let (difference, rest) = off(*value);
            let deviation = (unit(difference) - mean) + unit(rest);
            squares.add(weight(i) * deviation * deviation);
            left.add(weight(i) * deviation);
        }
        let left = left.value();
        let squares = (squares.value() - left * left / total).max(0.0);
        Self { origin, exponent: exponent + 2, mean, squares, weight: total }
    }
}

/// Weight, mean and sum of squared deviations so far; two of them merge into those of all readings
/// together, in any grouping, to a rounding or two.
/// Who needs it: partial results of several runs, merged.
///
/// ```
/// use radiometry::moments::Moments;
/// let mut first = Moments::default();
/// first.add(1.0, 1.0)?;
/// let mut second = Moments::from_parts(2.0, 2.5, 0.5)?; // 2 and 3
/// second.merge(&first);
/// assert_eq!((second.mean(), second.variance()), (2.0, 2.0 / 3.0));
/// # Ok::<(), radiometry::DomainError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moments {
    weight: Sum,
    mean: f64,
    mean_rest: f64,
    squares: Sum,
}

/// Of a running mean or weight.
const LARGEST: f64 = 1e150;

impl Moments {
    /// From a count or weight (positive), the mean, and Σ w (v - mean)²; weight and mean up to 1e150
    /// in size, so that no square of theirs overflows.
    pub fn from_parts(weight: f64, mean: f64, squares: f64) -> Result<Self, DomainError> {
        positive("weight", within("weight", weight, 0.0, LARGEST)?)?;
        within("mean", mean, -LARGEST, LARGEST)?;
        within("sum of squared deviations", squares, 0.0, LARGEST * LARGEST)?;
        Ok(Self {
            weight: [weight].into_iter().collect(),
            mean,
            mean_rest: 0.0,
            squares: [squares].into_iter().collect(),
        })
    }

    /// One more reading; one of no weight changes nothing.
    pub fn add(&mut self, value: f64, weight: f64) -> Result<(), DomainError> {
        finite("value", value)?;
        if not_negative("weight", weight)? > 0.0 {
            self.merge(&Self::from_parts(weight, value, 0.0)?);
        }
        Ok(())
    }

    /// Those of both together (Chan, Golub and `LeVeque`).
    pub fn merge(&mut self, other: &Self) {
        if self.weight() == 0.0 {
            *self = *other;
            return;
        }
        if other.weight() == 0.0 {
            return;
        }
        let mine = self.weight();
        self.weight.add(other.weight());
        let share = other.weight() / self.weight();
        let (difference, rest) = two_sum(other.mean, -self.mean);
        let step = difference + (rest + (other.mean_rest - self.mean_rest));
        let (mean, rest) = two_sum(self.mean, step * share);
        let (mean, mean_rest) = two_sum(mean, rest + self.mean_rest);
        (self.mean, self.mean_rest) = (mean, mean_rest);
        self.squares.add(other.squares.value());
        self.squares.add(step * share * step * mine);
    }

    /// Σ w
    pub fn weight(&self) -> f64 {
        self.weight.value()
    }

    /// 0 before the first reading.
    pub fn mean(&self) -> f64 {
        self.mean + self.mean_rest
    }

    /// Of the population: Σ w (v - mean)²/Σ w; 0 before the first reading.
    pub fn variance(&self) -> f64 {
        if self.weight() > 0.0 { self.squares.value().max(0.0) / self.weight() } else { 0.0 }
    }
}
