//! How the index depends on the level in layered media. It knows no ray.

use crate::domain::{DomainError, finite, positive};

use super::checked_index;

/// The index at every level: a height over plane layers, or the distance from the centre of spherical
/// ones. Any `Fn(f64) -> f64` is one.
/// Who needs it: [`Stratified`](super::Stratified).
pub trait IndexProfile {
    /// n at a level, m.
    fn index(&self, level_m: f64) -> f64;

    /// n(level + rise) - n(level), and a bound of its rounding error. Next to a ray's turning point
    /// it is all that counts: a profile whose form is known answers without subtracting.
    fn difference(&self, level_m: f64, rise_m: f64) -> (f64, f64) {
        let (here, there) = (self.index(level_m), self.index(level_m + rise_m));
        (there - here, f64::EPSILON * (here + there))
    }
}

impl<F: Fn(f64) -> f64> IndexProfile for F {
    fn index(&self, level_m: f64) -> f64 {
        self(level_m)
    }
}

/// n₀ + g z: air over a hot road, a salt solution that settles. Rays are catenaries.
/// Who needs it: the page on curved rays: mirage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearProfile {
    at_zero: f64,
    slope_per_m: f64,
}

impl LinearProfile {
    /// The index at level 0, in 1 to 1000, and its finite slope, 1/m.
    pub fn new(at_zero: f64, slope_per_m: f64) -> Result<Self, DomainError> {
        Ok(Self {
            at_zero: checked_index(at_zero)?,
            slope_per_m: finite("slope_per_m", slope_per_m)?,
        })
    }
}

impl IndexProfile for LinearProfile {
    fn index(&self, level_m: f64) -> f64 {
        self.slope_per_m.mul_add(level_m, self.at_zero)
    }

    fn difference(&self, _: f64, rise_m: f64) -> (f64, f64) {
        let difference = self.slope_per_m * rise_m;
        (difference, f64::EPSILON * difference.abs())
    }
}

/// 1 + N exp(-(z - z₀)/H): an isothermal atmosphere of refractivity N at the level z₀.
/// Who needs it: the page on curved rays: atmosphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExponentialProfile {
    refractivity: f64,
    level_m: f64,
    scale_height_m: f64,
}

impl ExponentialProfile {
    /// The index at a level, in 1 to 1000, and the scale height H > 0, m.
    pub fn new(index: f64, level_m: f64, scale_height_m: f64) -> Result<Self, DomainError> {
        Ok(Self {
            refractivity: checked_index(index)? - 1.0,
            level_m: finite("level_m", level_m)?,
            scale_height_m: positive("scale_height_m", scale_height_m)?,
        })
    }

    fn refractivity(&self, level_m: f64) -> f64 {
        self.refractivity * libm::exp(-(level_m - self.level_m) / self.scale_height_m)
    }
}

impl IndexProfile for ExponentialProfile {
    fn index(&self, level_m: f64) -> f64 {
        1.0 + self.refractivity(level_m)
    }

    fn difference(&self, level_m: f64, rise_m: f64) -> (f64, f64) {
        let difference = self.refractivity(level_m) * libm::expm1(-(rise_m / self.scale_height_m));
        (difference, 4.0 * f64::EPSILON * difference.abs())
    }
}
