//! A ray against the lateral surface of a cylinder.

use glam::DVec3;

use super::{Exact, Ray, cross_of, dot, dot_of, numbers};
use crate::domain::{DomainError, finite_vector, not_negative};
use crate::error_free::two_sum;
use crate::polynomial::{Number, Pair, Polynomial, value};

/// The offset to the axis, the ray's direction, the axis and the radius.
#[derive(Clone, Copy)]
struct Pipe {
    offset: Exact,
    direction: Exact,
    axis: Exact,
    radius: Pair,
}

impl Ray {
    /// Distance to the lateral surface of a circular cylinder from `base` to `top`, without its
    /// caps, m: the first hit at or after the origin; a tangent counts. A ray along the axis
    /// direction meets it only within the surface, which is counted from where it enters. At the
    /// ends the height is decided to rounding.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::ray::Ray;
    /// let ray = Ray::new(DVec3::new(-3.0, 0.0, 1.0), DVec3::X)?;
    /// assert_eq!(ray.cylinder(DVec3::ZERO, DVec3::new(0.0, 0.0, 2.0), 1.0)?, Some(2.0));
    /// assert_eq!(ray.cylinder(DVec3::ZERO, DVec3::new(0.0, 0.0, 0.5), 1.0)?, None);
    /// # Ok::<(), radiometry::DomainError>(())
    /// ```
    pub fn cylinder(
        self,
        base: DVec3,
        top: DVec3,
        radius_m: f64,
    ) -> Result<Option<f64>, DomainError> {
        finite_vector("base", base)?;
        finite_vector("top", top)?;
        let mut lengths = [not_negative("radius_m", radius_m)?];
        let local = self.local([base, top], &mut lengths);
        let scale = |length: f64| libm::scalbn(length, -local.exponent);
        let (from, to) = (base.to_array().map(scale), top.to_array().map(scale));
        let axis = core::array::from_fn(|i| two_sum(to[i], -from[i]));
        let pipe = Pipe {
            offset: local.points[0],
            direction: self.exact_direction(),
            axis,
            radius: (lengths[0], 0.0),
        };
        let length = dot(&axis, &axis);
        if length == 0.0 {
            return Err(DomainError::NotPositive { argument: "the cylinder's length", value: 0.0 });
        }
        let roots = pipe.roots();
        // Height above the base, in parts of the length.
        let rise = dot(&pipe.direction, &axis) / length;
        let start = -dot(&pipe.offset, &axis) / length;
        let hit = roots.into_iter().flatten().filter(|t| *t >= 0.0).find(|t| {
            let height = rise.mul_add(*t, start);
            (0.0..=1.0).contains(&height)
        });
        match hit {
            Some(parameter) => self.ahead(parameter, local.exponent),
            None if pipe.runs_within() => match (start, rise) {
                (start, _) if (0.0..=1.0).contains(&start) => Ok(Some(0.0)),
                (start, rise) if start < 0.0 => self.ahead(-start / rise, local.exponent),
                (start, rise) => self.ahead((1.0 - start) / rise, local.exponent),
            },
            None => Ok(None),
        }
    }
}

impl Pipe {
    /// Both parameters at which the line pierces the endless cylinder, the smaller first.
    fn roots(self) -> [Option<f64>; 2] {
        let speed = value(&Speed(self));
        if speed == 0.0 {
            return [None, None];
        }
        let discriminant = value(&Discriminant(self));
        if discriminant < 0.0 {
            return [None, None];
        }
        let outside = value(&Outside(self));
        let towards = value(&Towards(self));
        // Δ has the axis' square taken out: put it back.
        let axis_squared = dot(&self.axis, &self.axis);
        let root = (discriminant * axis_squared).sqrt();
        let (near, far) = if towards >= 0.0 {
            let sum = towards + root;
            (if sum == 0.0 { 0.0 } else { outside / sum }, sum / speed)
        } else {
            let sum = towards - root;
            (sum / speed, outside / sum)
        };
        [Some(near), Some(far)]
    }

    /// Along the axis, and within the surface.
    fn runs_within(self) -> bool {
        value(&Speed(self)) == 0.0 && value(&Outside(self)) == 0.0
    }
}

/// |d × u|².
struct Speed(Pipe);

impl Polynomial for Speed {
    fn evaluate<N: Number>(&self) -> N {
        let across = cross_of(&numbers::<N>(&self.0.direction), &numbers(&self.0.axis));
        dot_of(&across, &across)
    }
}

/// (f × u)·(d × u).
struct Towards(Pipe);

impl Polynomial for Towards {
    fn evaluate<N: Number>(&self) -> N {
        let axis = numbers::<N>(&self.0.axis);
        let across = cross_of(&numbers(&self.0.direction), &axis);
        dot_of(&cross_of(&numbers(&self.0.offset), &axis), &across)
    }
}

/// |f × u|² - r² u².
struct Outside(Pipe);

impl Polynomial for Outside {
    fn evaluate<N: Number>(&self) -> N {
        let axis = numbers::<N>(&self.0.axis);
        let across = cross_of(&numbers(&self.0.offset), &axis);
        let radius = N::from_pair(self.0.radius);
        let reach = radius.mul(&radius).mul(&dot_of(&axis, &axis));
        dot_of(&across, &across).sub(&reach)
    }
}

/// r² |d × u|² - det(f, d, u)², a u²-th of b² - ac.
struct Discriminant(Pipe);

impl Polynomial for Discriminant {
    fn evaluate<N: Number>(&self) -> N {
        let across = cross_of(&numbers::<N>(&self.0.direction), &numbers(&self.0.axis));
        let radius = N::from_pair(self.0.radius);
        let beside = dot_of(&numbers(&self.0.offset), &across);
        let reach = radius.mul(&radius).mul(&dot_of(&across, &across));
        reach.sub(&beside.mul(&beside))
    }
}
