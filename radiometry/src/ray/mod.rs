//! Rays against surfaces: where a ray first meets a plane, sphere, disk, triangle, polygon or
//! cylinder, and how often it meets a mesh. Edges and tangents count as hits. It knows no light.
//!
//! For visibility between places of a scene. The traps are far origins (the coordinates'
//! difference has to be exact), tangents (b² - ac has no digit left) and edges that two triangles
//! share (rounding lets a ray slip between or hits twice). Here every difference of coordinates
//! is kept exactly, and every decision is the sign of a polynomial of the given doubles, which is
//! computed without error where it is near zero.
//!
//! ```
//! use glam::DVec3;
//! use radiometry::ray::Ray;
//! let ray = Ray::new(DVec3::new(-1e8, 0.5, 0.0), DVec3::X)?;
//! // From 100 000 km: 1e8 - √3/2.
//! assert_eq!(ray.sphere(DVec3::ZERO, 1.0)?, Some(99_999_999.133_974_61));
//! assert_eq!(ray.sphere(DVec3::ZERO, 0.499_999_999_999_999_9)?, None);
//! # Ok::<(), radiometry::DomainError>(())
//! ```

mod cylinder;
mod flat;
mod polygon;
mod sphere;
mod triangle;

use glam::DVec3;

use crate::domain::{self, DomainError, finite_vector};
use crate::error_free::{scaled, two_sum};
use crate::polynomial::{Number, Pair, Polynomial, value};

/// A half-line from an origin, metres, along a direction of any length.
/// Who needs it: whoever asks what a ray meets first: `gonio calc`, the page on visibility.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    origin: DVec3,
    /// In a scale of its own.
    direction: DVec3,
}

/// A vector each component of which is an exact sum of two doubles.
type Exact = [Pair; 3];

/// Points seen from a ray's origin, in a unit of length that is a power of two.
struct Local<const N: usize> {
    points: [Exact; N],
    exponent: i32,
}

impl Ray {
    /// A finite origin, and a finite direction that is not the zero vector.
    pub fn new(origin: DVec3, direction: DVec3) -> Result<Self, DomainError> {
        finite_vector("origin", origin)?;
        Ok(Self { origin, direction: domain::direction("direction", direction)? })
    }

    /// The same ray seen from its origin, with the points' differences exact; lengths go through
    /// the same scale as coordinates.
    fn local<const N: usize>(self, points: [DVec3; N], lengths: &mut [f64]) -> Local<N> {
        let sizes = points.iter().map(|point| point.abs().max_element());
        let sizes = sizes.chain(lengths.iter().copied()).chain([self.origin.abs().max_element()]);
        let largest = sizes.fold(0.0, f64::max);
        let exponent = if largest > 0.0 { libm::ilogb(largest) } else { 0 };
        let scale = |length: f64| scaled(length, -exponent);
        for length in lengths {
            *length = scale(*length);
        }
        let offset = |point: DVec3| {
            let (point, origin) = (point.to_array(), self.origin.to_array());
            core::array::from_fn(|i| two_sum(scale(point[i]), -scale(origin[i])))
        };
        Local { points: points.map(offset), exponent }
    }

    fn exact_direction(self) -> Exact {
        exact(self.direction)
    }

    /// Parameter along the direction to metres, if the hit lies ahead.
    fn ahead(self, parameter: f64, exponent: i32) -> Result<Option<f64>, DomainError> {
        if parameter < 0.0 {
            return Ok(None);
        }
        // Adding zero makes one zero of both.
        let distance_m = libm::scalbn(parameter * self.direction.length(), exponent) + 0.0;
        if distance_m.is_finite() {
            Ok(Some(distance_m))
        } else {
            Err(DomainError::Overflow { result: "the distance to the hit, m," })
        }
    }
}

fn exact(vector: DVec3) -> Exact {
    vector.to_array().map(|component| (component, 0.0))
}

fn numbers<N: Number>(vector: &Exact) -> [N; 3] {
    vector.map(N::from_pair)
}

fn dot_of<N: Number>(a: &[N; 3], b: &[N; 3]) -> N {
    a[0].mul(&b[0]).add(&a[1].mul(&b[1])).add(&a[2].mul(&b[2]))
}

fn cross_of<N: Number>(a: &[N; 3], b: &[N; 3]) -> [N; 3] {
    let component = |i: usize, j: usize| a[i].mul(&b[j]).sub(&a[j].mul(&b[i]));
    [component(1, 2), component(2, 0), component(0, 1)]
}

struct Dot<'a>(&'a Exact, &'a Exact);

impl Polynomial for Dot<'_> {
    fn evaluate<N: Number>(&self) -> N {
        dot_of(&numbers(self.0), &numbers(self.1))
    }
}

struct Determinant<'a>(&'a Exact, &'a Exact, &'a Exact);

impl Polynomial for Determinant<'_> {
    fn evaluate<N: Number>(&self) -> N {
        dot_of(&numbers(self.0), &cross_of(&numbers(self.1), &numbers(self.2)))
    }
}

/// a · b.
fn dot(a: &Exact, b: &Exact) -> f64 {
    value(&Dot(a, b))
}

/// a · (b × c).
fn determinant(a: &Exact, b: &Exact, c: &Exact) -> f64 {
    value(&Determinant(a, b, c))
}
