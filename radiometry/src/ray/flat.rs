//! A ray against a plane and against a disk.

use glam::DVec3;

use super::{Exact, Ray, cross_of, dot, dot_of, exact, numbers};
use crate::domain::{DomainError, direction, finite_vector, not_negative};
use crate::polynomial::{Number, Pair, Polynomial, value};

impl Ray {
    /// Distance to the plane through `at` across `normal` (of any length), m; none if the ray runs
    /// beside the plane or away from it, 0 if it lies in it.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::ray::Ray;
    /// let grazing = Ray::new(DVec3::ZERO, DVec3::new(1.0, 0.0, 1e-12))?;
    /// assert_eq!(grazing.plane(DVec3::Z, DVec3::Z)?, Some(1e12));
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn plane(self, at: DVec3, normal: DVec3) -> Result<Option<f64>, DomainError> {
        finite_vector("point", at)?;
        let normal = exact(direction("normal", normal)?);
        let local = self.local([at], &mut []);
        let along = dot(&normal, &self.exact_direction());
        let height = dot(&normal, &local.points[0]);
        if along == 0.0 {
            return Ok((height == 0.0).then_some(0.0));
        }
        self.ahead(height / along, local.exponent)
    }

    /// Distance to the disk with that centre, normal (of any length) and radius >= 0, m; its rim
    /// belongs to it. A ray within its plane meets the rim first, or is on it from the start.
    pub fn disk(
        self,
        center: DVec3,
        normal: DVec3,
        radius_m: f64,
    ) -> Result<Option<f64>, DomainError> {
        finite_vector("center", center)?;
        let exact_normal = exact(direction("normal", normal)?);
        let mut lengths = [not_negative("radius_m", radius_m)?];
        let local = self.local([center], &mut lengths);
        let reach = Reach {
            offset: local.points[0],
            direction: self.exact_direction(),
            normal: exact_normal,
            radius: (lengths[0], 0.0),
        };
        if dot(&reach.normal, &reach.direction) == 0.0 {
            let is_in_plane = dot(&reach.normal, &reach.offset) == 0.0;
            return if is_in_plane { self.ball(center, radius_m) } else { Ok(None) };
        }
        if value(&reach) < 0.0 { Ok(None) } else { self.plane(center, normal) }
    }
}

/// (n·d)² r² - |n × (f × d)|²: not below zero where the line through f along d passes the plane
/// n·x = 0 within r of the origin.
struct Reach {
    offset: Exact,
    direction: Exact,
    normal: Exact,
    radius: Pair,
}

impl Polynomial for Reach {
    fn evaluate<N: Number>(&self) -> N {
        let (direction, normal) = (numbers::<N>(&self.direction), numbers(&self.normal));
        let beside = cross_of(&normal, &cross_of(&numbers(&self.offset), &direction));
        let reach = dot_of(&normal, &direction).mul(&N::from_pair(self.radius));
        reach.mul(&reach).sub(&dot_of(&beside, &beside))
    }
}
