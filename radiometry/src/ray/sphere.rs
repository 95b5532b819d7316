//! A ray against a sphere, as a surface and as a body.

use glam::DVec3;

use super::{Exact, Ray, cross_of, dot, dot_of, numbers};
use crate::domain::{DomainError, finite_vector, not_negative};
use crate::polynomial::{Number, Pair, Polynomial, value};

impl Ray {
    /// Distance to the surface of a sphere of radius >= 0, m: the first hit at or after the
    /// origin; a tangent counts.
    ///
    /// The discriminant is written r²d² - |f × d|² (Lagrange), the near root c/(b + √Δ), so that
    /// neither a far origin nor one on the surface costs a digit.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::ray::Ray;
    /// let tangent = Ray::new(DVec3::new(-5.0, 1.0, 0.0), DVec3::X)?;
    /// assert_eq!(tangent.sphere(DVec3::ZERO, 1.0)?, Some(5.0));
    /// let from_within = Ray::new(DVec3::ZERO, DVec3::X)?;
    /// assert_eq!(from_within.sphere(DVec3::ZERO, 1.0)?, Some(1.0));
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn sphere(self, center: DVec3, radius_m: f64) -> Result<Option<f64>, DomainError> {
        self.against(center, radius_m, false)
    }

    /// As [`sphere`](Self::sphere), but 0 for a ray that starts inside.
    pub(super) fn ball(self, center: DVec3, radius_m: f64) -> Result<Option<f64>, DomainError> {
        self.against(center, radius_m, true)
    }

    fn against(
        self,
        center: DVec3,
        radius_m: f64,
        is_solid: bool,
    ) -> Result<Option<f64>, DomainError> {
        finite_vector("center", center)?;
        let mut lengths = [not_negative("radius_m", radius_m)?];
        let local = self.local([center], &mut lengths);
        let (offset, direction) = (local.points[0], self.exact_direction());
        let radius = (lengths[0], 0.0);
        let outside = value(&Outside { offset, radius });
        let towards = dot(&offset, &direction);
        if outside == 0.0 || (is_solid && outside < 0.0) {
            return Ok(Some(0.0));
        }
        let discriminant = value(&Discriminant { offset, direction, radius });
        if discriminant < 0.0 || (outside > 0.0 && towards <= 0.0) {
            return Ok(None);
        }
        let root = discriminant.sqrt();
        let parameter = if outside > 0.0 {
            outside / (towards + root)
        } else if towards > 0.0 {
            (towards + root) / dot(&direction, &direction)
        } else {
            -outside / (root - towards)
        };
        self.ahead(parameter, local.exponent)
    }
}

/// f² - r²: above zero outside.
struct Outside {
    offset: Exact,
    radius: Pair,
}

impl Polynomial for Outside {
    fn evaluate<N: Number>(&self) -> N {
        let offset = numbers::<N>(&self.offset);
        let radius = N::from_pair(self.radius);
        dot_of(&offset, &offset).sub(&radius.mul(&radius))
    }
}

/// r² d² - |f × d|²: below zero where the line misses.
struct Discriminant {
    offset: Exact,
    direction: Exact,
    radius: Pair,
}

impl Polynomial for Discriminant {
    fn evaluate<N: Number>(&self) -> N {
        let direction = numbers::<N>(&self.direction);
        let radius = N::from_pair(self.radius);
        let across = cross_of(&numbers(&self.offset), &direction);
        let reach = radius.mul(&radius).mul(&dot_of(&direction, &direction));
        reach.sub(&dot_of(&across, &across))
    }
}
