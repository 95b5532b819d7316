//! Convex bodies by their surface. After Crofton and Cauchy the mean over all directions of the shadow's
//! area is a quarter of the surface S, and the throughput of all rays that meet the body πS = 4πĀ.
//!
//! It answers the lecture's page on the throughput of a sphere both ways, and how much stray light
//! a body in the beam can take up.

use core::f64::consts::PI;

use crate::domain::{DomainError, not_negative};
use crate::quantity::{Area, ProjectedArea, Throughput};

/// A closed convex body; lengths in metres, not negative. A flat one has two faces, a line no area.
/// Who needs it: the page on Crofton's theorem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ConvexBody {
    /// A ball.
    Sphere {
        /// Its radius.
        radius_m: f64,
    },
    /// A cuboid.
    Box {
        /// Its edges.
        edges_m: [f64; 3],
    },
    /// A circular cylinder with both caps.
    Cylinder {
        /// Of the caps.
        radius_m: f64,
        /// Along the axis.
        height_m: f64,
    },
    /// A right circular cone with its base.
    Cone {
        /// Of the base.
        radius_m: f64,
        /// Along the axis.
        height_m: f64,
    },
    /// An ellipsoid with three axes.
    Ellipsoid {
        /// Half the length of each axis.
        semi_axes_m: [f64; 3],
    },
}

/// The mean over all directions of the area of a convex body's shadow: S/4.
/// Who needs it: the page on Crofton's theorem.
///
/// ```
/// use radiometry::convex::{ConvexBody, mean_projected_area};
/// // A ball's shadow is the same from everywhere.
/// let shadow = mean_projected_area(ConvexBody::Sphere { radius_m: 2.0 })?;
/// assert_eq!(shadow.m2(), 4.0 * std::f64::consts::PI);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn mean_projected_area(body: ConvexBody) -> Result<ProjectedArea, DomainError> {
    Ok(ProjectedArea::from_m2(surface_area(body)?.m2() / 4.0))
}

/// The throughput of all rays that meet a convex body, from outside: π S, the projected solid angle of
/// the hemisphere on each piece of the surface; or 4π Ā, all directions times the mean shadow.
/// Who needs it: the page on Crofton's theorem and on the throughput of a sphere.
///
/// ```
/// use radiometry::convex::{ConvexBody, mean_projected_area, throughput};
/// use radiometry::quantity::SolidAngle;
/// let body = ConvexBody::Cone { radius_m: 1.0, height_m: 2.0 };
/// let all_directions = SolidAngle::from_sr(4.0 * std::f64::consts::PI);
/// let both_ways = throughput(body)? / (mean_projected_area(body)? * all_directions);
/// assert!((both_ways - 1.0).abs() < 1e-15);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn throughput(body: ConvexBody) -> Result<Throughput, DomainError> {
    let throughput = PI * surface_area(body)?.m2();
    if throughput.is_finite() {
        Ok(Throughput::from_m2_sr(throughput))
    } else {
        Err(DomainError::Overflow { result: "throughput_m2_sr" })
    }
}

/// The area of the whole surface. Closed forms; the ellipsoid's is Carlson's (1979)
/// S = `4π R_G(a²b², a²c², b²c²)`, by the arithmetic of its duplication theorem.
/// Who needs it: the page on Crofton's theorem.
///
/// ```
/// use radiometry::convex::{ConvexBody, surface_area};
/// let cube = surface_area(ConvexBody::Box { edges_m: [2.0; 3] })?;
/// assert_eq!(cube.m2(), 24.0);
/// # Ok::<(), radiometry::DomainError>(())
/// ```
pub fn surface_area(body: ConvexBody) -> Result<Area, DomainError> {
    let area = match body {
        ConvexBody::Sphere { radius_m } => {
            let r = not_negative("radius_m", radius_m)?;
            4.0 * PI * r * r
        }
        ConvexBody::Box { edges_m } => {
            let [a, b, c] = none_negative("edges_m", edges_m)?;
            2.0 * (a * b + b * c + c * a)
        }
        ConvexBody::Cylinder { radius_m, height_m } => {
            let (r, h) = (not_negative("radius_m", radius_m)?, not_negative("height_m", height_m)?);
            2.0 * PI * r * (r + h)
        }
        ConvexBody::Cone { radius_m, height_m } => {
            let (r, h) = (not_negative("radius_m", radius_m)?, not_negative("height_m", height_m)?);
            PI * r * (r + libm::hypot(r, h))
        }
        ConvexBody::Ellipsoid { semi_axes_m } => {
            ellipsoid(none_negative("semi_axes_m", semi_axes_m)?)
        }
    };
    if area.is_finite() {
        Ok(Area::from_m2(area))
    } else {
        Err(DomainError::Overflow { result: "area_m2" })
    }
}

fn none_negative(argument: &'static str, lengths: [f64; 3]) -> Result<[f64; 3], DomainError> {
    for length in lengths {
        not_negative(argument, length)?;
    }
    Ok(lengths)
}

/// `4π R_G(a²b², a²c², b²c²)` with a >= b >= c, in units of (ab)², so that no fourth power overflows.
fn ellipsoid(mut semi_axes: [f64; 3]) -> f64 {
    semi_axes.sort_by(f64::total_cmp);
    let [c, b, a] = semi_axes;
    if b == 0.0 {
        return 0.0;
    }
    4.0 * PI * a * b * carlson_g((c / a) * (c / a), (c / b) * (c / b))
}

/// `R_G(x, y, 1)` for 0 <= x <= y <= 1 (Carlson 1995; DLMF 19.21.10): with the middle argument last
/// all three terms are positive.
fn carlson_g(x: f64, y: f64) -> f64 {
    if y == 0.0 {
        return 0.5;
    }
    let product = (1.0 - y) * (y - x);
    0.5 * (y * carlson_f(x, 1.0, y) + product * carlson_d(x, 1.0, y) / 3.0 + (x / y).sqrt())
}

/// Duplications until the arguments are equal to 1e-4 at the least, from any that doubles can hold.
const DUPLICATIONS: usize = 24;

/// √x√y + √y√z + √z√x
fn shift(x: f64, y: f64, z: f64) -> f64 {
    let (x, y, z) = (x.sqrt(), y.sqrt(), z.sqrt());
    x * y + y * z + z * x
}

/// `R_F` (DLMF 19.36.1).
fn carlson_f(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    for _ in 0..DUPLICATIONS {
        let shift = shift(x, y, z);
        (x, y, z) = ((x + shift) / 4.0, (y + shift) / 4.0, (z + shift) / 4.0);
    }
    let mean = (x + y + z) / 3.0;
    let (dx, dy) = (1.0 - x / mean, 1.0 - y / mean);
    let dz = -(dx + dy);
    let (second, third) = (dx * dy - dz * dz, dx * dy * dz);
    (1.0 - second / 10.0 + third / 14.0 + second * second / 24.0) / mean.sqrt()
}

/// `R_D` (DLMF 19.36.2).
fn carlson_d(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    let (mut sum, mut quarter) = (0.0, 1.0);
    for _ in 0..DUPLICATIONS {
        let shift = shift(x, y, z);
        sum += quarter / (z.sqrt() * (z + shift));
        quarter /= 4.0;
        (x, y, z) = ((x + shift) / 4.0, (y + shift) / 4.0, (z + shift) / 4.0);
    }
    let mean = (x + y + 3.0 * z) / 5.0;
    let (dx, dy) = (1.0 - x / mean, 1.0 - y / mean);
    let dz = -(dx + dy) / 3.0;
    let second = dx * dy - 6.0 * dz * dz;
    let third = (3.0 * dx * dy - 8.0 * dz * dz) * dz;
    let series = 1.0 - 3.0 * second / 14.0 + third / 6.0 + 9.0 * second * second / 88.0;
    3.0 * sum + quarter * series / (mean * mean.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_and_flat_ellipsoids_are_spheres_and_plates() {
        let area = |semi_axes_m| surface_area(ConvexBody::Ellipsoid { semi_axes_m }).unwrap().m2();
        assert!((area([3.0; 3]) / (36.0 * PI) - 1.0).abs() < 1e-15);
        assert!((area([1e-200, 2.0, 3.0]) / (12.0 * PI) - 1.0).abs() < 1e-15);
        // A needle is a prolate one: 2π b (b + a asin(e)/e), π² a b in the limit.
        assert!((area([1e-9, 1.0, 1e-9]) / (PI * PI * 1e-9) - 1.0).abs() < 1e-8);
    }

    #[test]
    fn an_ellipsoid_does_not_know_the_order_of_its_axes() {
        let area = |semi_axes_m| surface_area(ConvexBody::Ellipsoid { semi_axes_m });
        assert_eq!(area([1.0, 1.5, 2.5]), area([2.5, 1.0, 1.5]));
    }

    #[test]
    fn a_body_without_extent_is_refused() {
        assert!(surface_area(ConvexBody::Sphere { radius_m: -1.0 }).is_err());
        assert!(surface_area(ConvexBody::Box { edges_m: [1.0, f64::NAN, 1.0] }).is_err());
        assert!(throughput(ConvexBody::Sphere { radius_m: 1e160 }).is_err());
    }
}
