//! Fits of shares of the readings, to be merged: what a share says of the coefficients, in memory
//! that doesn't grow with its readings, and the fit of several shares together.
//!
//! A partial fit holds the triangle of its rows, weighted by what is known of each reading alone. So
//! the merge of partial fits equals the one of all readings to rounding, in whatever shares and order.
//! What can be told only from all readings together is done at the end, on the triangle: where
//! nothing is known of the noise, or the residuals scatter beyond it, the residuals' size scales
//! every u alike. A share remembers where its readings lie, so that the merge knows its gaps and the narrowest
//! feature that it can show; and where that is asked for ([`Accumulator::with_truncation`]), what
//! they say of finer functions, so that u holds what the fit's own can't follow. It knows no file: [`Parts`] are the
//! numbers to be stored.
//!
//! ```
//! use fit::partial::{Accumulator, Weighting};
//! use fit::{BasisSpec, Noise, Ray, Region, Sample};
//!
//! let sample = |i: u32| Sample {
//!     ray: Ray { x_m: 0.0, y_m: 0.0, theta_rad: f64::from(i % 8) * 0.2, phi_rad: 0.1 },
//!     value: 100.0 + f64::from(i % 3),
//!     noise: Noise::Unknown,
//! };
//! let region = Region::surface((0.0, 0.0), (0.0, 0.0), 1.4);
//! let basis = BasisSpec::zernike(0, 0);
//! let share = |from: u32| -> Result<_, Box<dyn std::error::Error>> {
//!     let mut share = Accumulator::new(region, basis, None, Weighting::Alike)?;
//!     share.absorb(&(from..from + 30).map(sample).collect::<Vec<_>>())?;
//!     Ok(share.finish())
//! };
//! let mut all = share(0)?;
//! all.merge(&share(30)?)?;
//! let field = all.fit(None)?;
//! assert_eq!(field.n_used(), 60);
//! assert!((field.radiance(&sample(0).ray).value - 101.0).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use accumulator::Accumulator;
pub use closing::Closed;

use std::fmt;

use crate::basis::Basis;
use crate::beam::Optics;
use crate::triangle::Triangle;
use crate::truncation::Remembered;
use crate::whereabouts::Whereabouts;
use crate::{BasisSpec, FitError, Penalty, Region, Resolves};

mod accumulator;
mod closing;

/// What the rows of a share are weighted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// Each reading by its stated variance.
    Stated,
    /// All readings alike: the residuals of the whole will tell their variance.
    Alike,
}

/// What a share of the readings says.
#[derive(Debug, Clone)]
pub struct Partial {
    basis: Basis,
    penalty: Penalty,
    weighting: Weighting,
    common: Vec<String>,
    sums: Sums,
    triangle: Triangle,
    whereabouts: Whereabouts,
    finer: Option<Remembered>,
}

/// What is summed beside the triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sums {
    /// Readings taken in.
    pub readings: u64,
    /// Σ value², in the values' unit squared.
    pub value_squares: f64,
    /// Σ 1/variance.
    pub weights: f64,
    /// The smallest and the largest variance.
    pub variance: (f64, f64),
}

/// The numbers that a partial fit consists of, to be stored and taken up again.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// What the fit stands for.
    pub region: Region,
    /// Which functions.
    pub basis: BasisSpec,
    /// What will be held against them; no share holds it yet.
    pub penalty: Penalty,
    /// What the rows are weighted by.
    pub weighting: Weighting,
    /// The common components that were carried along, each a right-hand side of its own.
    pub common: Vec<String>,
    /// What is summed beside the triangle.
    pub sums: Sums,
    /// The upper triangle of functions, values and common components, packed by columns.
    pub triangle: Vec<f64>,
    /// Where its readings lie; what each number says this crate alone knows.
    pub whereabouts: Vec<f64>,
    /// What they say of functions that the fit doesn't have, where that was asked for.
    pub finer: Option<FinerParts>,
}

/// The numbers of what a share says of finer functions, in the order that this crate alone knows.
#[derive(Debug, Clone, PartialEq)]
pub struct FinerParts {
    /// The common components that show in residuals.
    pub common: Vec<String>,
    /// Triangle, sums, and mean rows by direction.
    pub numbers: Vec<f64>,
}

/// Why partial fits can't be merged, or a share not be taken in.
#[derive(Debug, Clone, PartialEq)]
pub enum PartialError {
    /// They don't stand for the same: give all shares the same region and basis.
    Differ {
        /// What differs.
        what: &'static str,
    },
    /// A reading's noise is not what the weighting calls for.
    Noise {
        /// The sample, from 0.
        index: usize,
    },
    /// As of a fit.
    Fit(FitError),
}

impl PartialError {
    /// The sample that is to blame, from 0, where one is.
    pub fn index(&self) -> Option<usize> {
        match self {
            Self::Noise { index } => Some(*index),
            Self::Fit(error) => error.index(),
            Self::Differ { .. } => None,
        }
    }
}

impl From<FitError> for PartialError {
    fn from(error: FitError) -> Self {
        Self::Fit(error)
    }
}

impl fmt::Display for PartialError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Differ { what } => write!(f, "partial fits differ in their {what}"),
            Self::Noise { index } => write!(
                f,
                "sample {index}: expected a known variance, as the samples before it have"
            ),
            Self::Fit(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for PartialError {}

impl Partial {
    /// Of rows that its own fit weighted, the common components their sides.
    pub(crate) fn weighted(
        (basis, penalty): (Basis, Penalty),
        common: Vec<String>,
        (sums, triangle): (Sums, Triangle),
        whereabouts: Whereabouts,
        finer: Option<Remembered>,
    ) -> Self {
        let weighting = Weighting::Stated;
        Self { basis, penalty, weighting, common, sums, triangle, whereabouts, finer }
    }

    /// Takes up stored parts.
    pub fn from_parts(parts: Parts) -> Result<Self, FitError> {
        let basis = basis_over(parts.basis, parts.penalty, parts.region)?;
        let (p, sides) = (basis.len(), 1 + parts.common.len());
        let expected = (p + sides) * (p + sides + 1) / 2;
        let found = parts.triangle.iter().filter(|value| value.is_finite()).count();
        if found != expected || parts.triangle.len() != expected {
            return Err(FitError::Parts { what: "triangle", expected, found });
        }
        if !parts.sums.is_sound() {
            return Err(FitError::Parts { what: "sums", expected: 4, found: 0 });
        }
        let malformed = |what| FitError::Parts { what, expected: 1, found: 0 };
        let whereabouts = Whereabouts::stored(&parts.whereabouts, &parts.region)
            .ok_or_else(|| malformed("whereabouts"))?;
        let finer = match parts.finer {
            None => None,
            Some(FinerParts { common, numbers }) => {
                // Room is made for each: no more than the triangle has.
                let is_known = common.iter().all(|name| parts.common.contains(name));
                let is_sound = is_known && common.len() <= parts.common.len();
                let stored = is_sound.then(|| Remembered::stored(&numbers, &basis, common));
                let stored = stored.transpose()?.flatten();
                Some(stored.ok_or_else(|| malformed("finer functions"))?)
            }
        };
        Ok(Self {
            whereabouts,
            finer,
            basis,
            penalty: parts.penalty,
            weighting: parts.weighting,
            common: parts.common,
            sums: parts.sums,
            triangle: Triangle::from_packed(p, sides, parts.sums.readings, &parts.triangle),
        })
    }

    /// The numbers that it consists of.
    pub fn parts(&self) -> Parts {
        Parts {
            region: *self.basis.region(),
            basis: self.basis.spec(),
            penalty: self.penalty,
            weighting: self.weighting,
            common: self.common.clone(),
            sums: self.sums,
            triangle: self.triangle.packed(),
            whereabouts: self.whereabouts.numbers(),
            finer: self.finer.as_ref().map(|finer| FinerParts {
                common: finer.names().to_vec(),
                numbers: finer.numbers(),
            }),
        }
    }

    /// Takes in what another share says. Common components of the same name are taken for one and
    /// the same, wholly correlated.
    pub fn merge(&mut self, other: &Self) -> Result<(), PartialError> {
        let differs = |what| Err(PartialError::Differ { what });
        if self.basis.spec() != other.basis.spec() {
            return differs("basis");
        }
        if self.basis.region() != other.basis.region() {
            return differs("region");
        }
        if self.penalty != other.penalty {
            return differs("penalty");
        }
        if self.weighting != other.weighting {
            return differs("weights: some samples state an uncertainty, others none");
        }
        if self.common != other.common {
            return differs("common components");
        }
        match (&mut self.finer, &other.finer) {
            (Some(own), Some(others)) => own.merge(others),
            (None, None) => {}
            _ => return differs("truncation: some shares hold finer functions, others none"),
        }
        self.triangle.merge(&other.triangle);
        self.sums.merge(&other.sums);
        self.whereabouts.merge(&other.whereabouts);
        Ok(())
    }

    /// The narrowest feature that the fit of all readings taken in can show; of a beam, if these were
    /// averaged over one.
    pub fn resolves(&self, optics: Option<&Optics>) -> Resolves {
        self.whereabouts.resolves(self.basis.spec(), optics)
    }

    /// Readings taken in.
    pub fn readings(&self) -> u64 {
        self.sums.readings
    }
}

fn basis_over(spec: BasisSpec, penalty: Penalty, region: Region) -> Result<Basis, FitError> {
    if !region.is_sound() {
        return Err(FitError::Region);
    }
    spec.checked_len()?;
    penalty.check()?;
    Basis::new(spec, region)
}

impl Sums {
    pub(crate) const NONE: Self =
        Self { readings: 0, value_squares: 0.0, weights: 0.0, variance: (f64::INFINITY, 0.0) };

    pub(crate) fn note(&mut self, value: f64, variance: f64) {
        self.readings += 1;
        self.value_squares += value * value;
        self.weights += 1.0 / variance;
        self.variance = (self.variance.0.min(variance), self.variance.1.max(variance));
    }

    fn merge(&mut self, other: &Self) {
        self.readings += other.readings;
        self.value_squares += other.value_squares;
        self.weights += other.weights;
        let ((low, high), (other_low, other_high)) = (self.variance, other.variance);
        self.variance = (low.min(other_low), high.max(other_high));
    }

    fn mean_square(&self) -> f64 {
        self.value_squares / self.readings as f64
    }

    fn is_sound(&self) -> bool {
        let Self { readings, value_squares, weights, variance: (low, high) } = *self;
        if readings == 0 {
            return *self == Self::NONE;
        }
        value_squares.is_finite()
            && value_squares >= 0.0
            && weights.is_finite()
            && weights > 0.0
            && low > 0.0
            && low <= high
            && high.is_finite()
    }
}

#[cfg(test)]
mod tests;
