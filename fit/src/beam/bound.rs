//! How far a rule over a beam can be off, for any field of a basis.
//!
//! Holds for fields that are as large below the horizon as above it, as Zernike polynomials and even
//! harmonics are, times polynomials in the place. For other bases rules are compared instead.
//!
//! Along a great circle a field of degree n is a trigonometric polynomial of that degree: off the
//! real axis, at α + iβ, it is at most e^(n|β|) times its largest value (Bernstein; Boas 1954,
//! Entire Functions, 11.4). A polynomial of total degree d in the place, within δ of the square
//! [-1, 1]², is at most (1 + δ + √(2δ + δ²))^d times its largest value there (Bernstein and Walsh;
//! Siciak 1962 for the square). So the part of degree k of the field's expansion about the axis is
//! at most M(Λ)/Λᵏ (Cauchy), M being the largest modulus over slopes Λ times the beam's; a rule
//! that is exact below errs by at most twice what remains.

use std::collections::HashMap;

use radiometry::beam::{Beam, Moments};

use crate::basis::Basis;
use crate::{Chart, Region};

/// A bound for one beam and one basis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bound {
    angular: f64,
    position: i32,
    /// Largest slope of a ray against the axis.
    slope: f64,
    /// Largest place of a ray across the axis, where it looks, in half widths of the region.
    reach: f64,
    moments: Option<Moments>,
}

impl Bound {
    /// `None` of a basis that it doesn't hold for.
    pub(crate) fn new(beam: &Beam, basis: &Basis) -> Option<Self> {
        let degree = basis.directions().mirrored_degree()?;
        let position_degree = basis.spec().position.degree()?;
        let half = |(from, to): (f64, f64)| (to - from) / 2.0;
        let Region { x_m, y_m, .. } = *basis.region();
        let widths = [half(x_m), half(y_m)].into_iter().filter(|half| *half > 0.0);
        let narrowest = widths.fold(f64::INFINITY, f64::min);
        let is_even = !narrowest.is_finite();
        if basis.region().chart != Chart::Surface && !is_even && position_degree > 0 {
            // Places turn with the direction there.
            return None;
        }
        let position = if is_even { 0 } else { i32::try_from(position_degree).unwrap_or(i32::MAX) };
        Some(Self {
            angular: degree as f64,
            position,
            slope: (beam.stop_radius_m() + beam.pupil_radius_m()) / beam.separation_m(),
            reach: if is_even { 0.0 } else { beam.reach_m(0.0) / narrowest },
            moments: beam.moments().ok(),
        })
    }

    /// The largest error of the axis's ray for the beam, as a part of the field's largest value.
    pub(crate) fn of_point(&self, theta_rad: f64) -> f64 {
        // |f''| <= n² along great circles; <α²> is twice that of one component.
        let by_moments = match self.moments {
            Some(moments) if self.position == 0 => {
                self.angular * self.angular * moments.direction * SLENDER
            }
            _ => f64::INFINITY,
        };
        by_moments.min(self.best(theta_rad, 1, true))
    }

    /// The same of a rule that is exact to `degree` in the slopes (odd) and in the places.
    pub(crate) fn of_rule(&self, theta_rad: f64, degree: usize) -> f64 {
        2.0 * self.best(theta_rad, degree, false)
    }

    /// The least of M(Λ) ΣΛ⁻ᵏ over all k above `degree`; even ones only where odd ones vanish.
    fn best(&self, theta_rad: f64, degree: usize, is_joint: bool) -> f64 {
        let (sin, cos) = libm::sincos(theta_rad);
        // Rays may lie in the plane, or behind the sphere's edge, at slopes beyond this.
        let limit = LIMIT
            / self.slope.max(if self.position > 0 {
                self.slope * sin / cos.max(1e-12)
            } else {
                0.0
            });
        let power = i32::try_from(degree).unwrap_or(i32::MAX);
        let is_even = self.position == 0 || is_joint;
        let at = |step: u32| {
            let lambda = libm::pow(limit, f64::from(step) / f64::from(STEPS));
            let slope = lambda * self.slope;
            let direction = libm::exp(self.angular * libm::atanh(slope));
            let place = if self.position == 0 {
                1.0
            } else {
                let factor = if is_joint { lambda } else { 1.0 };
                let delta = factor * self.reach * core::f64::consts::SQRT_2 / (cos - slope * sin);
                libm::pow(1.0 + delta + (delta * (2.0 + delta)).sqrt(), f64::from(self.position))
            };
            let tail = if is_even {
                lambda.powi(-power - 1) / (1.0 - lambda.powi(-2))
            } else {
                lambda.powi(-power) / (lambda - 1.0)
            };
            direction * place * tail
        };
        if limit > 1.0 { (1..=STEPS).map(at).fold(f64::INFINITY, f64::min) } else { f64::INFINITY }
    }
}

/// What was found out of one bound: a grid asks the same of a circle's every direction, and an answer
/// takes dozens of exponentials.
#[derive(Debug, Default)]
pub(crate) struct Known {
    /// By the bits of θ and the degree that a rule is exact to; `None` of the point.
    errors: HashMap<(u64, Option<usize>), f64>,
}

impl Known {
    /// As [`Bound::of_point`].
    pub(crate) fn of_point(&mut self, bound: &Bound, theta_rad: f64) -> f64 {
        self.or_else((theta_rad.to_bits(), None), || bound.of_point(theta_rad))
    }

    /// As [`Bound::of_rule`].
    pub(crate) fn of_rule(&mut self, bound: &Bound, theta_rad: f64, degree: usize) -> f64 {
        self.or_else((theta_rad.to_bits(), Some(degree)), || bound.of_rule(theta_rad, degree))
    }

    fn or_else(&mut self, asked: (u64, Option<usize>), find: impl FnOnce() -> f64) -> f64 {
        if self.errors.len() >= KNOWN_MAX {
            self.errors.clear();
        }
        *self.errors.entry(asked).or_insert_with(find)
    }
}

/// Errors that are remembered; beyond it they are forgotten, so that memory doesn't grow with readings
/// that share no θ.
const KNOWN_MAX: usize = 1 << 14;
/// Sizes Λ that are tried.
const STEPS: u32 = 24;
/// Of the size at which the bound has no value.
const LIMIT: f64 = 0.98;
/// An arc over its slope, squared, and more: slopes are small.
const SLENDER: f64 = 1.01;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BasisSpec;

    #[test]
    fn what_is_remembered_is_what_the_bound_says_of_that_direction_and_rule() {
        let beam = Beam::of_spot(0.00625, 0.0025, 0.3).unwrap();
        let region = Region::surface((-0.05, 0.05), (-0.05, 0.05), 1.4);
        let basis = Basis::new(BasisSpec::zernike(6, 2), region).unwrap();
        let (bound, mut known) = (Bound::new(&beam, &basis).unwrap(), Known::default());
        // More than are remembered, and each asked again.
        let thetas: Vec<f64> = (0..KNOWN_MAX).map(|i| i as f64 * 1.3 / KNOWN_MAX as f64).collect();
        for theta_rad in thetas.iter().flat_map(|theta_rad| [*theta_rad; 2]) {
            let found = known.of_point(&bound, theta_rad);
            assert_eq!(found.to_bits(), bound.of_point(theta_rad).to_bits());
            for degree in [1, 5] {
                let found = known.of_rule(&bound, theta_rad, degree);
                assert_eq!(found.to_bits(), bound.of_rule(theta_rad, degree).to_bits());
            }
            assert!(known.errors.len() <= KNOWN_MAX);
        }
        let mut bits = |theta_rad, degree| known.of_rule(&bound, theta_rad, degree).to_bits();
        assert_ne!(bits(0.0, 1), bits(1.0, 1));
        assert_ne!(bits(1.0, 1), bits(1.0, 5));
    }
}
